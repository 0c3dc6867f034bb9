//! Tests of what a power cut leaves, over many seeds, and of the chip by itself.

use super::super::memory::FLASH_SIZE;
use super::*;

const SEEDS: std::ops::Range<u64> = 0..200;
const OLD: u8 = 0b1100_1100;
const NEW: u8 = 0b1010_1010;
const PROGRAMMED: u8 = 0b1000_1000;

fn program() -> Command {
    Command::ProgramPage {
        offset: 0,
        data: vec![NEW; PAGE_SIZE as usize],
    }
}

fn erase() -> Command {
    Command::EraseSector { offset: 0 }
}

fn remains(cut: FlashCut, command: &Command, seed: u64) -> Vec<u8> {
    let before = vec![OLD; command.range().len()];
    cut.remains(command, &before, &mut Random::new(seed))
}

#[test]
fn before_and_after_are_all_or_nothing() {
    for (command, done) in [(program(), PROGRAMMED), (erase(), 0xff)] {
        let all = |cut, byte| remains(cut, &command, 1).iter().all(|&left| left == byte);
        assert!(all(FlashCut::Before, OLD));
        assert!(all(FlashCut::After, done));
    }
}

#[test]
fn a_prefix_is_done_and_the_rest_untouched() {
    for (command, done) in [(program(), PROGRAMMED), (erase(), 0xff)] {
        let mut lengths = BTreeSet::new();
        for seed in SEEDS {
            let left = remains(FlashCut::Prefix, &command, seed);
            let length = left.iter().take_while(|&&byte| byte == done).count();
            let untouched = left[length..].iter().filter(|&&byte| byte != OLD).count();
            assert!(untouched <= 1, "one byte may be torn, not {untouched}");
            assert!(length > 0 && length < left.len(), "{length}");
            assert_eq!(left.last(), Some(&OLD));
            lengths.insert(length);
        }
        assert!(lengths.len() > 50, "{} different lengths", lengths.len());
    }
}

#[test]
fn scattered_bits_of_a_program_are_cleared_or_not_and_no_other_bit_moves() {
    let to_clear = OLD & !NEW;
    let mut shares = Vec::new();
    for seed in SEEDS {
        let left = remains(FlashCut::ScatteredBits, &program(), seed);
        assert!(left.iter().all(|byte| byte & !to_clear == PROGRAMMED));
        shares.push(
            left.iter()
                .map(|byte| (byte & to_clear).count_ones())
                .sum::<u32>(),
        );
    }
    let most = 2 * PAGE_SIZE;
    assert!(shares.iter().any(|&share| share < most / 4) && shares.iter().any(|&share| share > most * 3 / 4));
}

#[test]
fn a_torn_erase_leaves_programmed_cells_too() {
    let scattered = |seed| remains(FlashCut::ScatteredBits, &erase(), seed);
    let cleared = SEEDS.filter(|&seed| scattered(seed).iter().all(|byte| byte & !OLD == 0));
    let (cleared, all) = (cleared.count(), SEEDS.count());
    assert!(
        cleared > all / 4 && cleared < all * 3 / 4,
        "{cleared} of {all} were cut while cells were being programmed"
    );
    assert!(
        SEEDS
            .into_iter()
            .any(|seed| scattered(seed).iter().any(|byte| byte & !OLD != 0))
    );
}

#[test]
fn a_seed_decides_what_is_left() {
    for cut in FlashCut::ALL {
        assert_eq!(remains(cut, &erase(), 5), remains(cut, &erase(), 5));
    }
    let scattered = |seed| remains(FlashCut::ScatteredBits, &erase(), seed);
    assert_ne!(scattered(1), scattered(2));
}

#[test]
#[should_panic(expected = "takes no command while it is busy")]
fn one_command_at_a_time() {
    let mut chip = FlashChip::new(vec![0; FLASH_SIZE], 1);
    chip.begin(erase(), 0);
    chip.begin(program(), 1);
}
