//! Flipped bits, garbage, and what other firmware left.

use proptest::prelude::*;

use super::*;

const SECTORS: usize = 8;

/// Three files: of two sectors, of four and of one, and a sector that is erased.
fn recorded() -> Recorder<SECTORS> {
    let mut recorder = Recorder::with_erased(8);
    for (seed, length) in [(1, 5000), (2, 15_000), (3, 100)] {
        recorder.record(&bytes(seed, length));
    }
    recorder
}

/// A start, and then everything that can be done: what is listed stays as it is, and what is recorded is found again.
fn assert_goes_on(flash: Flash<SECTORS>) {
    let mut recorder = Recorder::on(flash);
    recorder.erase(4);
    recorder.record_sectors(4);
    let recorded = recorder.files.split_off(recorder.files.len() - 4);
    recorder.restart();
    assert!(recorder.listed().ends_with(&recorded));
    recorder.erase_all();
    recorder.erase(8);
    recorder.record_sectors(8);
}

#[test]
fn damaged_header_within_a_file_does_not_split_it() {
    // The second and third sector of the second file; then its first one.
    for positions in [&[3, 4][..], &[2]] {
        let mut recorder = recorded();
        for position in positions {
            recorder.front(*position)[5] ^= 1;
        }
        recorder.assert_files_after_restart();
        assert_goes_on(recorder.flash);
    }
}

#[test]
fn sector_at_the_end_of_a_file_is_lost_with_its_header() {
    let mut recorder = recorded();
    recorder.front(5)[5] ^= 1;
    recorder.front(6)[5] ^= 1;
    recorder.restart();
    let listed = recorder.listed();
    assert_eq!(listed.len(), 2);
    assert_eq!(listed[0].1, bytes(1, 5000));
    assert_eq!(listed[1].1, bytes(2, 15_000)[..3 * 4064]);
    // Both may hold data: neither is begun.
    assert_eq!(recorder.ring.room(), PAYLOAD_BYTES);
    assert_goes_on(recorder.flash);
}

#[test]
fn damaged_mark_only_costs_an_erase() {
    let mut recorder = recorded();
    recorder.front(7)[17] ^= 1;
    recorder.assert_files_after_restart();
    assert_eq!(recorder.ring.room(), 0);
    recorder.erase(1);
    assert_eq!(recorder.ring.files().len(), 3);
    recorder.record(&[1, 2, 3]);
    recorder.assert_files();
}

/// What an interrupted erase may leave of a sector, in which the header is gone and the mark is not.
#[test]
fn old_mark_does_not_make_a_half_erased_sector_ready() {
    let mut recorder = Recorder::<4>::with_erased(4);
    for seed in 0..4 {
        recorder.record(&bytes(seed, 100));
    }
    recorder.erase(1);
    // The oldest file is the next to be erased; a mark behind it makes it one of those erased ahead.
    recorder.front(1)[..16].fill(0xFF);
    recorder.flash.region()[4096 + 32..2 * 4096].fill(0xFF);
    recorder.flash.region()[2 * 4096..3 * 4096].fill(0xFF);
    recorder.front(2)[16..24].copy_from_slice(&front::mark(10, 4));
    recorder.restart();
    assert_eq!(recorder.ring.room(), 2 * PAYLOAD_BYTES);
}

#[test]
fn file_whose_first_sector_may_be_half_erased_is_not_listed() {
    let mut recorder = Recorder::<4>::with_erased(4);
    recorder.record(&bytes(0, 5000));
    recorder.record(&bytes(1, 5000));
    recorder.front(0)[5] ^= 1;
    recorder.restart();
    assert_eq!(recorder.numbers(), [2]);
}

#[test]
fn sectors_of_a_ring_of_another_size_are_space() {
    let mut flash = recorded().flash;
    let mut range = Flash::<SECTORS>::REGION;
    range.end -= SECTOR_BYTES;
    let mut ring = block_on(Ring::scan(&mut flash, range));
    assert_eq!(ring.files(), []);
    assert_eq!(ring.room(), 0);
    assert!(ring.next_erase(7).is_some());
}

#[test]
fn unreadable_flash_is_empty() {
    let mut flash = recorded().flash;
    flash.cut_power_after(0, 1);
    let _ = block_on(flash.erase(4096, 8192));
    let ring = block_on(Ring::scan(&mut flash, Flash::<SECTORS>::REGION));
    assert_eq!((ring.files(), ring.room()), (&[][..], 0));
}

/// Bits to be flipped: a sector, an offset in it, a mask.
fn damage() -> impl Strategy<Value = Vec<(usize, usize, u8)>> {
    prop::collection::vec((0..SECTORS, 0..4096_usize, any::<u8>()), 0..60)
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn garbage_is_space(seed: u64, headers in prop::collection::vec((0..SECTORS, 0..40_u32, 0..4_u16, 0..9_u16), 0..12)) {
        let mut recorder = Recorder::<SECTORS>::new();
        fastrand::Rng::with_seed(seed).fill(recorder.flash.region());
        // Headers and marks that contradict one another.
        for (position, sequence, number, index) in headers {
            let header = front::Header { sequence, number, index };
            let front = recorder.front(position);
            front[..16].copy_from_slice(&header.to_bytes(SECTORS as u32));
            front[16..24].copy_from_slice(&front::mark(sequence + u32::from(index), SECTORS as u32));
        }
        assert_goes_on(recorder.flash);
    }

    #[test]
    fn flipped_bits_harm_only_what_they_are_in(flips in damage()) {
        let mut recorder = recorded();
        let expected = recorder.listed();
        for (sector, offset, mask) in &flips {
            recorder.flash.region()[sector * 4096 + offset] ^= mask;
        }
        recorder.restart();
        for (number, content) in recorder.listed() {
            let (_, original) = expected.iter().find(|(other, _)| *other == number).unwrap();
            let changed = content.iter().zip(original).filter(|(a, b)| a != b).count();
            prop_assert!(changed <= flips.len());
        }
        assert_goes_on(recorder.flash);
    }

    #[test]
    fn flips_in_headers_leave_the_other_files(positions in prop::collection::hash_set(0..SECTORS, 0..4), bit in 0..256_usize) {
        let mut recorder = recorded();
        let expected = recorder.listed();
        for position in &positions {
            recorder.front(*position)[bit / 8] ^= 1 << (bit % 8);
        }
        recorder.restart();
        let listed = recorder.listed();
        for ((number, content), sectors) in expected.into_iter().zip([0..2, 2..6, 6..7]) {
            if sectors.into_iter().all(|sector| !positions.contains(&sector)) {
                prop_assert!(listed.contains(&(number, content)));
            }
        }
        assert_goes_on(recorder.flash);
    }
}
