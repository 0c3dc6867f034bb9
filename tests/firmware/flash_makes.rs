//! Flash chips of other makes than Raspberry Pi's.

use emulator::{FlashMake, FlashOperationKind, LogLevel};
use rover_battmon::memory::flash_map;
use support::frames::texts_of;
use support::requests::arm;
use workbench::bench::{Bench, DIVIDER_CODE, SECOND, TestedVehicle, Wire, count_of};

use super::log::board_id;

const WEARS: &str = "Logging wears out this flash chip: set LOG_BITMASK 0";

/// A bit that the boot loader clears: of a copy, in which it stays as it is.
const FIXED_BIT: u8 = 0x40;

fn running_with(make: FlashMake) -> Bench {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.solder_flash(make);
    bench.power_cycle();
    bench.run_for(SECOND);
    bench
}

/// Texts that a program is sent which opens the port now.
fn texts_at_the_port(bench: &mut Bench) -> String {
    bench.use_wire(Wire::Usb);
    bench.run_for(SECOND);
    texts_of(&bench.frames()).concat()
}

/// Pages of the log that a drive of 10 s writes, and how often registers of the chip were stored meanwhile.
fn pages_and_status_writes(bench: &mut Bench) -> (usize, u64) {
    bench.take_flash_operations();
    let before = bench.flash_status_writes();
    bench.ask(&arm());
    bench.run_for(10 * SECOND);
    let mut operations = bench.take_flash_operations();
    operations.retain(|operation| flash_map::LOG.contains(&operation.offset));
    let pages = count_of(FlashOperationKind::PageProgram, &operations);
    (pages, bench.flash_status_writes() - before)
}

#[test]
// Requirement: R-15
fn a_chip_whose_registers_are_stored_with_each_page_is_announced_with_what_to_do() {
    let mut bench = running_with(FlashMake {
        fixed_status_2: FIXED_BIT,
        ..FlashMake::w25q16jv([7; 8])
    });
    let read = "flash chip EF4015, status register 2 0x42";
    assert_eq!(
        bench.logged(LogLevel::Info, read).len(),
        1,
        "{:?}",
        bench.log_lines()
    );
    let texts = texts_at_the_port(&mut bench);
    assert!(texts.contains(WEARS), "{texts}");

    let (pages, stored) = pages_and_status_writes(&mut bench);
    assert!(pages >= 10 && stored >= pages as u64, "{pages}, {stored}");
    assert!(bench.resets().len() == 1, "{:?}", bench.resets());
}

#[test]
// Requirement: R-15
fn a_chip_whose_id_is_unique_in_16_bytes_only_gives_each_board_an_id_of_its_own() {
    const ZETTA: [u8; 3] = [0xba, 0x60, 0x15];
    const WINBOND: [u8; 3] = [0xef, 0x40, 0x15];
    let with = |jedec_id, last| {
        let mut unique_id = [0x5a; 16];
        unique_id[15] = last;
        let mut bench = running_with(FlashMake {
            jedec_id,
            unique_id,
            ..FlashMake::w25q16jv([0; 8])
        });
        board_id(&mut bench)
    };
    // FNV-1a of 64 bits, by another implementation.
    assert_eq!(with(ZETTA, 1), "677705883F125594");
    // The first 8 bytes, whatever follows: a board keeps the id it has had.
    assert_eq!(with(WINBOND, 1), "5A5A5A5A5A5A5A5A");
}
