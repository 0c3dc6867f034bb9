//! Flash chips of other makes than Raspberry Pi's.

use emulator::{FlashMake, FlashOperationKind, LogLevel, Status2Write, StatusWrite};
use rover_battmon::memory::flash_map;
use support::frames::texts_of;
use support::requests::arm;
use workbench::bench::{Bench, DIVIDER_CODE, SECOND, TestedVehicle, Wire, count_of};
use workbench::downloads::{download, list};
use workbench::log_records::{named, records_of_torn};

use super::log::board_id;

const WEARS: &str = "Logging wears out this flash chip: set LOG_BITMASK 0";

/// Bit QE of status register 2.
const QUAD_ENABLED: u8 = 1 << 1;

/// Bits of status register 1 that protect nothing by themselves, and of status register 2 that a copy can't clear.
const STATUS_1: u8 = 0x60;
const FIXED_BIT: u8 = 0x40;

/// A board with another chip, switched on.
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

/// Pages of the log that a drive of 10 s writes, and how often registers of the chip were stored since it was soldered in.
fn pages_and_status_writes(bench: &mut Bench) -> (usize, u64) {
    bench.take_flash_operations();
    bench.ask(&arm());
    bench.run_for(10 * SECOND);
    let mut operations = bench.take_flash_operations();
    operations.retain(|operation| flash_map::LOG.contains(&operation.offset));
    let pages = count_of(FlashOperationKind::PageProgram, &operations);
    assert!(pages >= 10, "{pages} pages");
    (pages, bench.flash_status_writes())
}

/// Panics unless the board logs a drive, has its log after the power has failed, and has not stored a register of the chip.
fn assert_keeps_a_log_and_registers(bench: &mut Bench) {
    let (_, stored) = pages_and_status_writes(bench);
    assert_eq!(stored, 0);
    assert_keeps_a_log(bench);
}

/// Panics unless the log of a drive of 10 s is there after the power has failed.
fn assert_keeps_a_log(bench: &mut Bench) {
    let resets = bench.resets().len();
    bench.power_cycle();
    bench.forget_sent();
    bench.run_for(2 * SECOND);
    let file = list(bench)[0];
    let log = records_of_torn(&download(bench, file));
    let seconds = named(&log, "PM").count();
    assert!((8..=11).contains(&seconds), "{seconds} s of a drive of 10");
    assert_eq!(bench.resets().len(), resets + 1, "{:?}", bench.resets());
}

#[test]
// Requirement: R-15
fn chips_without_quad_reads_are_given_them_until_the_power_fails() {
    let rv = FlashMake::w25q16rv([7; 8]);
    for make in [
        rv,
        FlashMake {
            stored_status: [STATUS_1, FIXED_BIT],
            status_2_write: Status2Write::WithStatus1,
            ..rv
        },
    ] {
        let mut bench = running_with(make);
        let [status_1, status_2] = make.stored_status;
        assert_eq!(bench.flash_status(), [status_1, status_2 | QUAD_ENABLED]);
        let texts = texts_at_the_port(&mut bench);
        assert!(!texts.contains(WEARS), "{make:?}: {texts}");
        assert_keeps_a_log_and_registers(&mut bench);
        bench.cut_power();
        assert_eq!(bench.flash_status(), make.stored_status);
    }
}

#[test]
// Requirement: R-15
fn a_chip_that_never_has_quad_reads_is_read_on_one_line_and_announced() {
    let mut bench = running_with(FlashMake {
        status_2_write: Status2Write::Never,
        ..FlashMake::w25q16rv([7; 8])
    });
    let texts = texts_at_the_port(&mut bench);
    assert!(texts.contains(WEARS), "{texts}");
    assert_keeps_a_log_and_registers(&mut bench);
}

#[test]
// Requirement: R-15
fn a_chip_that_stores_its_registers_with_each_page_keeps_its_log() {
    let mut bench = running_with(FlashMake {
        status_2_write: Status2Write::Never,
        write_behind_50h: StatusWrite::Stored,
        ..FlashMake::w25q16rv([7; 8])
    });
    let texts = texts_at_the_port(&mut bench);
    assert!(texts.contains(WEARS), "{texts}");
    let (pages, stored) = pages_and_status_writes(&mut bench);
    assert!(stored >= pages as u64, "{pages} pages, {stored} times");
    assert_keeps_a_log(&mut bench);
}

#[test]
// Requirement: R-15
fn a_chip_with_quad_reads_is_not_written_whatever_else_its_registers_hold() {
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
    assert!(!texts.contains(WEARS), "{texts}");
    assert_keeps_a_log_and_registers(&mut bench);
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
