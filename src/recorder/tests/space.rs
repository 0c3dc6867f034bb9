//! Erasing ahead, and the space that the oldest file leaves.

use super::*;

#[test]
fn room_is_what_can_be_appended_without_an_erase() {
    let mut recorder = Recorder::<8>::with_erased(3);
    assert_eq!(recorder.ring.room(), 3 * PAYLOAD_BYTES);
    recorder.open().unwrap();
    let mut room = recorder.ring.room();
    for seed in 0.. {
        if room < 1000 {
            break;
        }
        assert_eq!(recorder.append(&bytes(seed, 1000)), Ok(Ok(())));
        room -= 1000;
        assert_eq!(recorder.ring.room(), room);
    }
    assert_eq!(recorder.append(&bytes(0, room as usize)), Ok(Ok(())));
    assert_eq!(recorder.append(&[1]), Ok(Err(AppendError::NoErasedSpace)));
    // It goes on in the same file once there is space.
    recorder.erase(1);
    assert_eq!(recorder.append(&bytes(1, 4000)), Ok(Ok(())));
    assert_eq!(recorder.ring.files().len(), 1);
    recorder.assert_files();
}

#[test]
fn no_file_is_opened_without_erased_space() {
    let mut recorder = Recorder::<4>::new();
    assert_eq!(recorder.open(), Err(AppendError::NoErasedSpace));
    assert_eq!(recorder.append(&[1]), Ok(Err(AppendError::Closed)));
    recorder.erase(1);
    assert_eq!(recorder.record(&[1]), 1);
    assert_eq!(recorder.open(), Err(AppendError::NoErasedSpace));
}

#[test]
fn oldest_file_goes_whole_when_the_ring_is_full() {
    let mut recorder = Recorder::<8>::with_erased(8);
    let sectors = 3 * PAYLOAD_BYTES as usize;
    let lengths = [sectors, sectors, sectors - 5000];
    let [_, second, third] = [0, 1, 2].map(|index| recorder.record(&bytes(index as u64, lengths[index])));
    assert_eq!(recorder.ring.files().len(), 3);
    recorder.erase(1);
    assert_eq!(recorder.numbers(), [second, third]);
    recorder.restart();
    // Not even what was not erased yet.
    assert_eq!(recorder.numbers(), [second, third]);
    recorder.assert_files();
    recorder.erase(3);
    assert_eq!(recorder.numbers(), [second, third]);
    recorder.erase(4);
    assert_eq!(recorder.numbers(), [third]);
    recorder.assert_files();
}

#[test]
fn open_file_is_never_erased() {
    let mut recorder = Recorder::<8>::with_erased(8);
    recorder.record(&bytes(0, 5000));
    let open = recorder.begin(1, 5000);
    recorder.erase(8);
    assert_eq!(recorder.ring.files(), [undated(open, 5000)]);
    recorder.close();
    recorder.erase(8);
    assert_eq!(recorder.ring.files(), []);
}

#[test]
fn sector_that_is_erased_and_marked_is_not_erased_again() {
    let mut recorder = Recorder::<8>::with_erased(5);
    for _ in 0..3 {
        recorder.restart();
        recorder.erase(5);
    }
    assert_eq!(recorder.flash.erases, [1, 1, 1, 1, 1, 0, 0, 0]);
    recorder.record(&bytes(0, 5000));
    recorder.restart();
    recorder.erase(3);
    assert_eq!(recorder.flash.erases, [1, 1, 1, 1, 1, 0, 0, 0]);
}

#[test]
fn empty_ring_that_is_erased_ahead_is_left_alone_by_the_next_start() {
    let mut recorder = Recorder::<8>::new();
    for _ in 0..3 {
        recorder.erase(recorder.ring.free_sectors());
        recorder.restart();
    }
    assert_eq!(recorder.flash.erases, [1, 1, 1, 1, 1, 1, 1, 0]);
    recorder.record(&bytes(0, 1));
    recorder.erase(recorder.ring.free_sectors());
    recorder.restart();
    recorder.erase(recorder.ring.free_sectors());
    assert_eq!(recorder.flash.erases, [1; 8]);
}

#[test]
fn all_files_are_erased_on_request() {
    let mut recorder = Recorder::<8>::with_erased(6);
    recorder.record(&bytes(0, 9000));
    let last = recorder.record(&bytes(1, 3000));
    recorder.open().unwrap();
    recorder.erase_all();
    assert_eq!(recorder.ring.files(), []);
    assert_eq!(recorder.append(&[1]), Ok(Err(AppendError::Closed)));
    // A file begun before it is done is kept.
    let next = recorder.record(&bytes(2, 3000));
    assert!(next > last);
    recorder.erase(0);
    let region = recorder.flash.region().to_vec();
    assert!(!region.windows(16).any(|window| window == &bytes(0, 9000)[..16]));
    assert!(!region.windows(16).any(|window| window == &bytes(1, 3000)[..16]));
    recorder.assert_files();
    recorder.assert_files_after_restart();
}

#[test]
fn ring_without_any_file_keeps_what_is_erased() {
    let mut recorder = Recorder::<8>::with_erased(6);
    recorder.record(&bytes(0, 9000));
    recorder.erase_all();
    recorder.erase(0);
    let before = recorder.flash.operations();
    recorder.restart();
    assert_eq!(recorder.ring.files(), []);
    assert_eq!(recorder.ring.room(), 7 * PAYLOAD_BYTES);
    recorder.erase(7);
    assert_eq!(recorder.flash.operations(), before);
    assert_eq!(recorder.record(&bytes(1, 20_000)), 1);
    recorder.assert_files();
}

#[test]
fn sector_that_cannot_be_erased_is_left_out_for_a_lap() {
    // The erase, or the program of its mark.
    for operation in 0..2 {
        let mut recorder = Recorder::<8>::with_erased(2);
        recorder.flash.refuse_after(operation);
        recorder.erase(5);
        assert_eq!(recorder.ring.room(), 5 * PAYLOAD_BYTES);
        // The file ends before it.
        recorder.open().unwrap();
        assert_eq!(recorder.append(&bytes(0, 9000)), Ok(Err(AppendError::Closed)));
        recorder.assert_files();
        assert_eq!(recorder.ring.files()[0].bytes, 2 * PAYLOAD_BYTES);
        recorder.record(&bytes(1, 9000));
        recorder.assert_files_after_restart();
        recorder.erase(6);
        recorder.record(&bytes(2, 5 * 4064));
        recorder.assert_files();
    }
}

#[test]
fn flash_that_fails_always_is_left_after_as_many_attempts_as_the_caller_makes() {
    let mut recorder = Recorder::<4>::with_erased(4);
    let number = recorder.begin(0, 5000);
    for _ in 0..100 {
        recorder.flash.refuse_after(0);
        recorder.erase_one(4).unwrap();
    }
    assert_eq!(recorder.ring.files(), [undated(number, 5000)]);
    recorder.flash.power_up();
    recorder.close();
    recorder.erase(2);
    recorder.record(&bytes(1, 5000));
    recorder.assert_files();
}

#[test]
fn ring_goes_round_for_many_laps_and_wears_evenly() {
    let mut recorder = Recorder::<7>::new();
    for seed in 0..400 {
        recorder.erase(3);
        recorder.record(&bytes(seed, 1 + (seed as usize * 977) % 12_000));
        if seed % 3 == 0 {
            recorder.restart();
        }
        recorder.assert_files();
    }
    let erases = &recorder.flash.erases;
    let (least, most) = (erases.iter().min().unwrap(), erases.iter().max().unwrap());
    assert!(*least > 50 && most - least <= 1, "{erases:?}");
}

#[test]
fn boards_ring_lists_its_newest_files() {
    let mut recorder = Recorder::<{ MAX_SECTORS as usize }>::with_erased(MAX_SECTORS);
    for seed in 0..100 {
        recorder.record(&bytes(seed, 1 + seed as usize * 97));
    }
    assert_eq!(recorder.ring.files().len(), MAX_FILES);
    recorder.assert_files();
    recorder.assert_files_after_restart();
}
