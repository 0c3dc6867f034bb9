//! Flash that is damaged, worn or slow.

use emulator::{FlashOperationKind, FlashTiming};
use support::commands::PREFLIGHT_STORAGE;
use support::frames::{CRITICAL, PARAM_VALUE, ParamValue, STATUSTEXT, of_message, texts_of};
use support::requests::{VEHICLE, arm, command_long, param_read_by_name, param_request_list, param_set};
use workbench::bench::{
    Bench, MILLISECOND, PARAMETER_BYTES, PARAMETER_OFFSET, SAVED_US, SECOND, SECTOR_BYTES,
};

fn texts(bench: &mut Bench) -> Vec<(u8, String)> {
    let frames = bench.frames();
    of_message(&frames, STATUSTEXT)
        .iter()
        .map(|frame| (frame.u8(0), frame.text(1, 50)))
        .collect()
}

fn read(bench: &mut Bench, name: &str) -> Option<f32> {
    let answers = bench.ask(&param_read_by_name(name));
    let values = of_message(&answers, PARAM_VALUE);
    values.first().map(|frame| ParamValue(frame).value())
}

const DAMAGED: &str = "Parameters damaged: check them, then set PARAM_CHECKED 1";

/// The firmware retries what it could not write once a minute.
const RETRIED_US: u64 = 65 * SECOND;

/// When "Parameters can't be saved" arrived since `from_us`, and the rest of the text.
fn save_failures(bench: &mut Bench, from_us: u64) -> Vec<(u64, String)> {
    let frames = bench.frames_since(from_us);
    let texts = of_message(&frames, STATUSTEXT)
        .into_iter()
        .map(|frame| (frame.at_us, frame.text(1, 50)));
    texts
        .filter_map(|(at_us, text)| {
            let reason = text.strip_prefix("Parameters can't be saved: ")?;
            Some((at_us, reason.to_owned()))
        })
        .collect()
}

#[test]
fn damaged_storage_boots_with_defaults_says_so_and_works_again() {
    let noise: Vec<u8> = (0..PARAMETER_BYTES as u32)
        .map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect();
    for content in [noise, vec![0; PARAMETER_BYTES], vec![0xa5; PARAMETER_BYTES]] {
        let mut bench = Bench::power_up_with_parameters(2482, &content);
        bench.run_for(SECOND);
        assert!(bench.resets().is_empty(), "a boot loop");
        let said = texts(&mut bench);
        // The other one is that nothing counts as low with the defaults.
        assert_eq!(said.len(), 3, "{said:?}");
        assert_eq!(said[0].0, CRITICAL);
        assert_eq!(said[0].1.clone() + &said[1].1, DAMAGED);
        assert_eq!(read(&mut bench, "SR0_EXTRA1"), Some(2.0));

        bench.ask(&param_set("ARMING_CHECK", 0.0));
        bench.ask(&param_set("SR0_EXTRA1", 4.0));
        bench.run_for(SECOND);
        bench.power_cycle();
        bench.run_for(SECOND);
        assert_eq!(read(&mut bench, "SR0_EXTRA1"), Some(4.0));
        let refused = texts_of(&bench.ask(&arm())).concat();
        assert_eq!(refused, format!("Arm: {DAMAGED}"));

        bench.ask(&param_set("PARAM_CHECKED", 1.0));
        bench.run_for(SECOND);
        bench.power_cycle();
        bench.run_for(SECOND);
        assert_eq!(texts_of(&bench.ask(&arm())).concat(), "");
    }
}

#[test]
fn one_damaged_sector_is_said_and_no_boot_loop() {
    let mut bench = Bench::power_up(2482);
    bench.run_for(SECOND);
    bench.ask(&param_set("SR0_EXTRA1", 4.0));
    bench.run_for(SECOND);
    let content = bench.read_flash(PARAMETER_OFFSET, PARAMETER_BYTES);
    for sector in 0..PARAMETER_BYTES / SECTOR_BYTES {
        let mut damaged = content.clone();
        damaged[sector * SECTOR_BYTES..(sector + 1) * SECTOR_BYTES].fill(0x5a);
        let mut bench = Bench::power_up_with_parameters(2482, &damaged);
        bench.run_for(SECOND);
        assert!(bench.resets().is_empty());
        let value = read(&mut bench, "SR0_EXTRA1");
        let said = texts(&mut bench);
        assert!(
            value == Some(4.0) || said.iter().any(|(severity, _)| *severity == CRITICAL),
            "sector {sector}: {value:?}, {said:?}"
        );
    }
}

#[test]
fn worn_out_flash_is_said_and_the_value_lives_until_the_restart() {
    let mut bench = Bench::power_up(2482);
    for sector in 0..PARAMETER_BYTES / SECTOR_BYTES {
        bench.wear_out_sector(PARAMETER_OFFSET + (sector * SECTOR_BYTES) as u32);
    }
    // Something has to be there that a worn sector can't get rid of.
    bench.write_flash(PARAMETER_OFFSET, &[0; PARAMETER_BYTES]);
    bench.run_for(SECOND);
    bench.ask(&param_set("SR0_EXTRA1", 4.0));
    bench.run_for(10 * SECOND);
    assert_eq!(read(&mut bench, "SR0_EXTRA1"), Some(4.0));
    assert!(
        texts(&mut bench)
            .iter()
            .any(|(_, text)| text.contains("can't be saved")),
        "{:?}",
        texts(&mut bench)
    );
    assert!(bench.resets().is_empty(), "{:?}", bench.resets());
}

/// The second half of the second sector can't be erased, and the parameters have to move there.
fn block_the_move_to_the_second_sector(bench: &mut Bench) -> u32 {
    let half = PARAMETER_OFFSET + 3 * SECTOR_BYTES as u32;
    bench.write_flash(half, &[0; SECTOR_BYTES]);
    bench.wear_out_sector(half);
    half
}

#[test]
// Requirement: L-18
fn what_could_not_be_saved_is_tried_once_more_before_a_restart() {
    let mut bench = Bench::running(2482);
    bench.set("SR0_EXTRA1", 5.0);
    bench.run_for(SAVED_US);
    let worn = block_the_move_to_the_second_sector(&mut bench);
    bench.ask(&command_long(PREFLIGHT_STORAGE, 2.0));
    bench.set("BATT_VOLT_MULT", 4.1);
    bench.run_for(SAVED_US);
    bench.restore_sector(worn);
    bench.reboot();
    assert_eq!(read(&mut bench, "SR0_EXTRA1"), Some(2.0));
    assert_eq!(read(&mut bench, "BATT_VOLT_MULT"), Some(4.1));
}

#[test]
fn a_list_is_preceded_by_a_failure_to_save_while_it_lasts() {
    let mut bench = Bench::running(2482);
    bench.set("SR0_EXTRA1", 5.0);
    bench.run_for(SAVED_US);
    let worn = block_the_move_to_the_second_sector(&mut bench);
    bench.ask(&command_long(PREFLIGHT_STORAGE, 2.0));
    bench.run_for(7 * SECOND);
    let reports_in_a_list = |bench: &mut Bench| {
        let from_us = bench.time_us();
        bench.ask(&param_request_list(VEHICLE));
        bench.run_for(2 * SECOND);
        save_failures(bench, from_us).len()
    };
    assert_eq!(reports_in_a_list(&mut bench), 1);
    bench.restore_sector(worn);
    bench.run_for(RETRIED_US);
    assert_eq!(reports_in_a_list(&mut bench), 0);
}

/// Clears the stored parameters twice, after which a sector is erased ahead, and returns the sampling ticks of those ten
/// seconds.
fn ticks_around_an_erase(timing: FlashTiming) -> (Bench, Vec<u64>) {
    let mut bench = Bench::power_up(2482);
    bench.flash_timing(timing);
    bench.run_until_time(500 * MILLISECOND);
    let clear = |bench: &mut Bench| {
        let now_us = bench.time_us();
        bench.uart_send(0, now_us, &param_set("SR0_EXTRA1", 4.0));
        bench.uart_send(
            0,
            now_us + 100 * MILLISECOND,
            &command_long(PREFLIGHT_STORAGE, 2.0),
        );
    };
    clear(&mut bench);
    bench.run_until_time(4_080 * MILLISECOND);
    bench.take_adc_record();
    bench.take_flash_operations();
    clear(&mut bench);
    bench.run_until_time(9_080 * MILLISECOND);
    clear(&mut bench);
    bench.run_until_time(14_050 * MILLISECOND);
    let erased = |bench: &Bench| {
        bench
            .flash_operations()
            .iter()
            .any(|operation| operation.kind == FlashOperationKind::SectorErase)
    };
    assert!(erased(&bench), "nothing was erased");
    let ticks = bench
        .take_adc_record()
        .chunks(16)
        .map(|burst| burst[0].start / 125)
        .collect();
    (bench, ticks)
}

#[test]
fn a_typical_erase_loses_no_sampling_tick() {
    let (bench, ticks) = ticks_around_an_erase(FlashTiming::TYPICAL);
    assert_eq!(ticks.len(), 100);
    let due_us = |n: usize| ticks[99] - (99 - n as u64) * 100_000;
    let latest_us = (0..100).map(|n| ticks[n].saturating_sub(due_us(n))).max();
    println!("latest tick {latest_us:?} us late");
    assert!(latest_us.is_some_and(|late_us| late_us < 50 * MILLISECOND));
    assert!(bench.resets().is_empty());
}

#[test]
fn the_slowest_erase_makes_ticks_coalesce_and_invents_none() {
    let (bench, ticks) = ticks_around_an_erase(FlashTiming::MAXIMUM);
    // 400 ms cover four ticks at most, of which one is served late. Two sectors are erased, in two erases
    // each.
    assert!((84..100).contains(&ticks.len()), "{} ticks", ticks.len());
    // No two closer together than the end of the erase and the next regular tick allow, and none twice.
    let phase_us = ticks[ticks.len() - 1] % 100_000;
    let regular = ticks
        .iter()
        // The one behind it waits for what has waited meanwhile.
        .filter(|tick| (**tick % 100_000).abs_diff(phase_us) < 4 * MILLISECOND)
        .count();
    assert!(ticks.len() - regular <= 4, "only the tick after an erase is late");
    assert!(bench.resets().is_empty(), "the watchdog waited");
}
