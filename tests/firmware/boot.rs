//! The start, and the log.

use embassy_futures::block_on;
use rover_battmon::memory::flash_map;
use rover_battmon::memory::storage::{Erase, Storage};
use rover_battmon_tools::sim::SimulatedFlash;

use emulator::{AdcInput, Board, FlashOperation, FlashOperationKind, FlashTiming, LogLevel};
use support::firmware_version;
use support::requests::param_set;
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND, SIGNING_OFFSET, TestedVehicle, Wire};
use workbench::signing_key::{flash_with, words_of_key};

#[test]
fn the_banner_names_version_and_reset_reason() {
    let mut bench = Bench::power_up(2482);
    bench.run_for(SECOND / 10);
    let banner = format!("rover-battmon {}, started by PowerOn", firmware_version());
    let lines = bench.logged(LogLevel::Info, &banner);
    assert_eq!(lines.len(), 1, "{:?}", bench.log_lines());

    bench.press_run();
    bench.run_for(SECOND / 10);
    let lines = bench.logged(LogLevel::Info, "started by RunPin");
    assert_eq!(lines.len(), 1, "{:?}", bench.log_lines());
}

#[test]
fn two_lines_a_second_report_voltage_and_rates() {
    let mut bench = Bench::power_up(2482);
    bench.run_for(10 * SECOND + SECOND / 2);
    let lines = bench.logged(LogLevel::Info, "samples/s");
    assert_eq!(lines.len(), 10);
    let packs = bench.logged(LogLevel::Info, "mV");
    assert_eq!(packs.len(), 10, "one pack: {packs:?}");
    let (_, last) = &packs[9];
    assert!(
        last.contains("battery 1: Healthy") && last.contains("7900"),
        "{last}"
    );
    let (_, last) = &lines[9];
    assert!(
        last.contains("10 samples/s") && last.contains("5 frames/s, 213 bytes/s, 0 dropped"),
        "{last}"
    );
}

/// An `Option` that is `None` holds whatever RAM held. The compiler may compare that before it looks whether it counts,
/// and a comparison of floats takes a few cycles more or less. A task that is ready by as much later may find another one
/// before it, or is interrupted by a reading of the pins, and waits for as long; nothing else comes of it.
const JITTER_US: u64 = 250;

/// Two frames that are ready at the same time may leave in either order: by then the later one is late by the other's length.
const LONGEST_FRAME_US: u64 = 25_000;

/// The frames that were sent with the time of their first byte, sorted by content. Zeros stand for the sequence number, the
/// checksum, and the load in SYS_STATUS, which a few cycles more or less may round up.
fn frames(sent: &[(u64, u8)]) -> Vec<(Vec<u8>, u64)> {
    const SYS_STATUS: [u8; 3] = [1, 0, 0];
    const HEADER_BYTES: usize = 10;
    const LOAD_OFFSET: usize = HEADER_BYTES + 12;
    let mut frames = Vec::new();
    let mut rest = sent;
    while rest.len() > HEADER_BYTES {
        let length = HEADER_BYTES + usize::from(rest[1].1) + 2;
        let Some((frame, behind)) = rest.split_at_checked(length) else {
            break;
        };
        let mut content: Vec<u8> = frame.iter().map(|(_, byte)| *byte).collect();
        let is_sys_status = content[7..10] == SYS_STATUS;
        if is_sys_status {
            content[LOAD_OFFSET..LOAD_OFFSET + 2].fill(0);
        }
        for place in [4, length - 2, length - 1] {
            content[place] = 0;
        }
        frames.push((content, frame[0].0));
        rest = behind;
    }
    frames.sort();
    frames
}

#[test]
fn what_is_in_ram_at_power_up_makes_no_difference() {
    let run = |seed| {
        let mut bench = Bench::power_up_seeded(2482, seed);
        bench.run_for(5 * SECOND);
        bench.assert_untroubled();
        frames(bench.sent())
    };
    let first = run(1);
    assert!(!first.is_empty());
    for seed in 2..6 {
        let other = run(seed);
        assert_eq!(other.len(), first.len(), "RAM contents {seed}");
        for ((frame, at_us), (first_frame, first_at_us)) in other.into_iter().zip(&first) {
            assert_eq!(frame, *first_frame, "RAM contents {seed}, at {at_us} us");
            assert!(
                at_us.abs_diff(*first_at_us) <= JITTER_US + LONGEST_FRAME_US,
                "RAM contents {seed}: {at_us} instead of {first_at_us} us"
            );
        }
    }
}

#[test]
fn nothing_is_used_that_the_emulator_does_not_model() {
    let mut bench = Bench::power_up(2482);
    bench.run_for(3 * SECOND);
    let unmodelled: Vec<_> = bench.unmodelled().keys().copied().collect();
    assert!(unmodelled.is_empty(), "{unmodelled:?}");
}

/// Records that a sector takes: of parameters, and of signing.
const PARAMETER_RECORDS: usize = 680;
const SIGNING_RECORDS: usize = 338;

/// Parameters with as many records as a sector takes, all of the same one.
fn full_parameters() -> Vec<u8> {
    const SR0_PARAMS: u16 = 4;
    let flash = SimulatedFlash::blank();
    let mut storage = Storage::of_double_sectors(flash.clone(), flash_map::PARAMETERS);
    for number in 0..PARAMETER_RECORDS {
        let value = 3.0 + (number % 40) as f32;
        let stored = block_on(storage.store(SR0_PARAMS, value.to_bits(), &Erase::always));
        stored.expect("a sound flash");
    }
    flash.content(flash_map::PARAMETERS)
}

/// Signing's sectors, the first outdated and the second full: the time that each start writes has to move back.
fn full_signing() -> Vec<u8> {
    const MARK: u16 = 0x121;
    let words = words_of_key();
    let moved = words.iter().filter(|(key, _)| *key != MARK).count();
    let marks = 2 * SIGNING_RECORDS - words.len() - moved;
    let marks = (1..=marks as u32).map(|time| (MARK, time));
    flash_with(words.into_iter().chain(marks))
}

/// With both sectors full, the first start erases one, at the slowest that the flash chip's datasheet permits.
#[test]
// Requirement: R-5
fn the_slowest_flash_takes_less_than_half_of_the_watchdogs_second_at_the_start() {
    let mut bench = Bench::power_up_with_parameters(DIVIDER_CODE, &full_parameters());
    bench.write_flash(SIGNING_OFFSET, &full_signing());
    bench.flash_timing(FlashTiming::MAXIMUM);
    bench.run_for(3 * SECOND);
    let is_erase = |operation: &&FlashOperation| operation.kind == FlashOperationKind::SectorErase;
    let erased = bench.flash_operations().iter().find(is_erase);
    let erased = erased.expect("the time moves to the other sector");
    assert!(erased.time_us < SECOND / 2, "at the start");
    assert!(bench.resets().is_empty(), "{:?}", bench.resets());
    let slack_us = bench.smallest_watchdog_slack_us().expect("it was fed");
    println!(
        "{} ms of its second used at most, erase from {} us",
        (SECOND - slack_us) / MILLISECOND,
        erased.time_us
    );
    assert!(slack_us > SECOND / 2, "{slack_us} us");
}

/// What distinguishes two boards.
fn traces(bench: &mut Bench) -> impl PartialEq + use<> {
    let log: Vec<_> = bench.log_lines().to_vec();
    let counts = (
        bench.time_cycles(),
        bench.instructions(),
        bench.awake_cycles(),
        bench.lowest_stack_pointer(),
    );
    (bench.sent().to_vec(), log, counts, bench.take_adc_record())
}

/// Asks, sets, moves to a wire of its own, and arms.
fn use_it(bench: &mut Bench) {
    bench.adc_input(0, AdcInput::Volts(2.0));
    bench.adc_noise(0.002);
    bench.set("BATT_CAPACITY", 4200.0);
    bench.use_wire(Wire::Usb);
    bench.ask(&param_set("SR0_EXTRA1", 5.0));
    bench.reboot();
    bench.use_wire(Wire::Uart);
    bench.run_for(2 * SECOND);
}

#[test]
fn boards_that_share_their_first_second_and_copies_of_them_go_on_as_one_of_its_own() {
    let mut own = Bench::power_up(DIVIDER_CODE);
    let board: &mut Board = &mut own;
    // Not through the bench, which would share it.
    board.run_for(SECOND);
    let mut shared = [Bench::running(DIVIDER_CODE), Bench::running(DIVIDER_CODE)];
    let mut copy = own.clone();
    use_it(&mut own);
    let expected = traces(&mut own);
    for bench in shared.iter_mut().chain([&mut copy]) {
        use_it(bench);
        assert!(traces(bench) == expected);
    }
}

#[test]
fn a_copy_that_is_made_while_a_line_is_logged_has_the_whole_line() {
    let mut bench = Bench::running(DIVIDER_CODE);
    let mut copy = bench.clone();
    let before = copy.log_lines().len();
    copy.run_for(SECOND);
    let line = copy.log_lines()[before].clone();
    bench.run_until_time(line.time_us - 100);
    while bench.log_lines().len() == before {
        let mut copy = bench.clone();
        copy.run_for(MILLISECOND);
        assert_eq!(copy.log_lines()[before], line, "a copy of {} us", bench.time_us());
        bench.run_for(1);
    }
}

#[test]
fn a_copy_of_a_pico_w_goes_on_as_the_board() {
    let mut bench = Bench::power_up(DIVIDER_CODE);
    bench.attach_wifi();
    // While the radio's program is loaded, and when its network is there.
    for at_us in [SECOND / 2, 3 * SECOND] {
        bench.run_until_time(at_us);
        let mut copy = bench.clone();
        bench.run_for(SECOND);
        copy.run_for(SECOND);
        assert!(traces(&mut bench) == traces(&mut copy));
        assert_eq!(bench.wifi().access_point(), copy.wifi().access_point());
    }
    assert!(bench.wifi().access_point().is_some());
}
