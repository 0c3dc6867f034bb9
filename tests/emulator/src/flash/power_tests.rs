//! Tests of power cuts while the flash chip is at work, and of preloaded flash.

use super::super::board::Board;
use super::super::firmware::Firmware;
use super::super::memory::FLASH_SIZE;
use super::super::reset::ResetCause;
use super::super::thumb::MAIN;
use super::fixture::*;
use super::*;

const OLD: [u8; SECTOR as usize] = [0x0f; SECTOR as usize];

/// Erase a sector and program four pages, with a cut at an operation.
fn cut_at(number: u64, cut: FlashCut) -> Board {
    let mut board = flash_board();
    board.write_flash(OFFSET, &OLD);
    board.cut_power_at_flash_operation(number, cut);
    start_erase(&mut board, OFFSET, SECTOR);
    board.run_until(100_000, |board| is_done(board) || !board.is_powered());
    if board.is_powered() {
        start_program(&mut board, OFFSET, &[0; 4 * 256]);
        board.run_for(100_000);
    }
    board
}

fn sector(board: &Board) -> Vec<u8> {
    board.read_flash(OFFSET, SECTOR as usize)
}

#[test]
fn a_cut_before_an_erase_leaves_the_sector_and_one_after_it_leaves_it_erased() {
    let board = cut_at(1, FlashCut::Before);
    assert!(!board.is_powered());
    assert_eq!(sector(&board), OLD);
    assert!(board.time_us() < 200, "at once: {}", board.time_us());
    assert!(board.flash_erase_counts().is_empty());
    let board = cut_at(1, FlashCut::After);
    assert!(!board.is_powered());
    assert_eq!(sector(&board), [0xff; SECTOR as usize]);
    assert!((45_100..45_200).contains(&board.time_us()), "{}", board.time_us());
}

#[test]
fn a_torn_erase_leaves_neither_the_old_bytes_nor_an_erased_sector() {
    for cut in [FlashCut::Prefix, FlashCut::ScatteredBits] {
        let board = cut_at(1, cut);
        assert!(!board.is_powered());
        let left = sector(&board);
        assert!(left != OLD && left != [0xff; SECTOR as usize], "{cut:?}");
        assert!(board.time_us() < 45_000);
        assert_eq!(board.flash_operations()[0].cut, Some(cut));
    }
}

#[test]
fn every_page_is_an_operation_that_can_be_cut() {
    for pages in 0..4 {
        let board = cut_at(2 + pages as u64, FlashCut::ScatteredBits);
        let left = sector(&board);
        let torn = 256 * pages..256 * (pages + 1);
        assert!(left[..torn.start].iter().all(|&byte| byte == 0));
        assert!(left[torn.end..].iter().all(|&byte| byte == 0xff));
        assert!(left[torn.clone()].iter().any(|&byte| byte != 0));
        assert!(left[torn].iter().any(|&byte| byte != 0xff));
        assert_eq!(board.flash_operations().len(), 2 + pages);
    }
    let board = cut_at(6, FlashCut::Before);
    assert!(board.is_powered(), "there are five operations");
}

#[test]
fn a_run_ends_with_the_power_and_time_goes_on_without_it() {
    let mut board = flash_board();
    board.cut_power_at_flash_operation(1, FlashCut::After);
    start_erase(&mut board, OFFSET, SECTOR);
    board.run_for(1_000_000);
    let cut_at = board.time_us();
    assert!(cut_at < 46_000, "{cut_at}");
    let instructions = board.instructions();
    board.run_for(1_000_000);
    assert_eq!(board.time_us() - cut_at, 1_000_000);
    assert!(!board.run_until(500, |_| false));
    assert_eq!((board.instructions(), board.resets().len()), (instructions, 0));
    board.power_cycle();
    assert!(board.is_powered());
    assert_eq!(
        (board.pc(), board.resets()[0].cause),
        (MAIN, ResetCause::PowerCycle)
    );
    board.run_for(100);
    assert!(board.instructions() > instructions);
    assert_eq!(board.time_us() - cut_at, 1_000_600);
}

#[test]
fn run_until_ends_with_the_power() {
    let mut board = flash_board();
    board.cut_power_at_flash_operation(1, FlashCut::Before);
    start_erase(&mut board, OFFSET, SECTOR);
    assert!(!board.run_until(1_000_000, |_| false));
    assert!(board.time_us() < 200);
}

#[test]
fn a_power_cycle_in_the_course_of_an_erase_tears_it_and_the_run_pin_does_not() {
    for tears in [true, false] {
        let mut board = flash_board();
        board.write_flash(OFFSET, &OLD);
        start_erase(&mut board, OFFSET, SECTOR);
        board.run_for(10_000);
        if tears {
            board.power_cycle();
        } else {
            board.press_run();
        }
        board.run_for(50_000);
        assert_eq!(sector(&board) != [0xff; SECTOR as usize], tears);
        assert_ne!(sector(&board), OLD);
    }
}

#[test]
fn a_reset_ends_a_call_and_the_next_one_is_a_call_of_its_own() {
    let mut board = flash_board();
    start_erase(&mut board, OFFSET, 2 * SECTOR);
    board.run_for(10_000);
    board.press_run();
    board.run_for(40_000);
    program(&mut board, OFFSET + 2 * SECTOR, &[0; 256]);
    let offsets: Vec<u32> = board.flash_operations().iter().map(|one| one.offset).collect();
    assert_eq!(offsets, [OFFSET, OFFSET + 2 * SECTOR]);
}

#[test]
fn a_worn_sector_is_not_torn_either() {
    let mut board = flash_board();
    board.write_flash(OFFSET, &OLD);
    board.wear_out_sector(OFFSET);
    board.cut_power_at_flash_operation(1, FlashCut::ScatteredBits);
    start_erase(&mut board, OFFSET, SECTOR);
    board.run_for(50_000);
    assert!(!board.is_powered());
    assert_eq!(sector(&board), OLD);
}

#[test]
fn a_firmware_can_come_with_other_bytes_in_flash() {
    let firmware = Firmware::from_flash(vec![0xff; FLASH_SIZE]);
    let preloaded = firmware.with_flash(OFFSET, b"kept");
    assert_eq!(Board::power_up(&preloaded, 1).read_flash(OFFSET, 5), b"kept\xff");
    assert_eq!(Board::power_up(&firmware, 1).read_flash(OFFSET, 4), [0xff; 4]);
}
