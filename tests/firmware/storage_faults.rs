//! Flash that is damaged, worn or slow.

use emulator::{FlashOperationKind, FlashTiming};
use support::commands::PREFLIGHT_STORAGE;
use support::frames::{CRITICAL, STATUSTEXT, of_message, texts_of};
use support::requests::{arm, command_long, param_set};
use workbench::bench::{
    Bench, MILLISECOND, PARAMETER_BYTES, PARAMETER_OFFSET, SECOND, SECTOR_BYTES, TestedVehicle, count_of,
};

const DAMAGED: &str = "Parameters damaged: check them, then set PARAM_CHECKED 1";

#[test]
fn damaged_storage_boots_with_defaults_says_so_and_works_again() {
    let noise: Vec<u8> = (0..PARAMETER_BYTES as u32)
        .map(|n| (n.wrapping_mul(2_654_435_761) >> 24) as u8)
        .collect();
    for content in [noise, vec![0; PARAMETER_BYTES]] {
        let mut bench = Bench::power_up_with_parameters(2482, &content);
        bench.run_for(SECOND);
        assert!(bench.resets().is_empty(), "a boot loop");
        let frames = bench.frames();
        let texts = of_message(&frames, STATUSTEXT).into_iter();
        let said: Vec<_> = texts.map(|frame| (frame.u8(0), frame.text(1, 50))).collect();
        // The other one is that nothing counts as low with the defaults.
        assert_eq!(said.len(), 3, "{said:?}");
        assert_eq!(said[0].0, CRITICAL);
        assert_eq!(said[0].1.clone() + &said[1].1, DAMAGED);
        assert_eq!(bench.read_parameter("SR0_EXTRA1"), Some(2.0));

        bench.ask(&param_set("ARMING_CHECK", 0.0));
        bench.ask(&param_set("SR0_EXTRA1", 4.0));
        bench.run_for(SECOND);
        bench.power_cycle();
        bench.run_for(SECOND);
        assert_eq!(bench.read_parameter("SR0_EXTRA1"), Some(4.0));
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
    assert_eq!(bench.read_parameter("SR0_EXTRA1"), Some(4.0));
    let said = texts_of(&bench.frames());
    assert!(
        said.iter().any(|text| text.contains("can't be saved")),
        "{said:?}"
    );
    assert!(bench.resets().is_empty(), "{:?}", bench.resets());
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
        let reset = command_long(PREFLIGHT_STORAGE, 2.0);
        bench.uart_send(0, now_us + 100 * MILLISECOND, &reset);
    };
    clear(&mut bench);
    bench.run_until_time(4_080 * MILLISECOND);
    bench.take_ticks();
    bench.take_flash_operations();
    clear(&mut bench);
    bench.run_until_time(9_080 * MILLISECOND);
    clear(&mut bench);
    bench.run_until_time(14_050 * MILLISECOND);
    let erased = count_of(FlashOperationKind::SectorErase, bench.flash_operations());
    assert!(erased > 0, "nothing was erased");
    let ticks = bench.take_ticks();
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
