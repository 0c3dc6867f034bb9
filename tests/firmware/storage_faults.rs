//! Flash that is damaged, worn or slow.

use crate::bench::{Bench, MILLISECOND, PARAMETER_BYTES, PARAMETER_OFFSET, SECOND, SECTOR_BYTES};
use crate::emulator::{FlashOperationKind, FlashTiming};
use crate::support::frames::{PARAM_VALUE, ParamValue, STATUSTEXT, of_message};
use crate::support::requests::{param_read_by_name, param_set};

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

const CRITICAL: u8 = 2;

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
        assert_eq!(said.len(), 2, "{said:?}");
        assert!(
            said[0].0 == CRITICAL && said[0].1.contains("Parameter storage damaged"),
            "{said:?}"
        );
        assert_eq!(read(&mut bench, "SR0_EXTRA1"), Some(2.0));

        bench.ask(&param_set("SR0_EXTRA1", 4.0));
        bench.run_for(SECOND);
        bench.power_cycle();
        bench.run_for(SECOND);
        assert_eq!(read(&mut bench, "SR0_EXTRA1"), Some(4.0));
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

/// Sets a parameter, for which a sector has to be erased, and returns the sampling ticks of those ten seconds.
fn ticks_around_an_erase(timing: FlashTiming) -> (Bench, Vec<u64>) {
    // Nothing there can be kept, so the first value that is written needs an erased sector.
    let mut bench = Bench::power_up_with_parameters(2482, &[0; PARAMETER_BYTES]);
    bench.flash_timing(timing);
    bench.run_until_time(2_080 * MILLISECOND);
    bench.take_adc_record();
    let now_us = bench.time_us();
    bench.uart_send(0, now_us, &param_set("SR0_EXTRA1", 4.0));
    bench.run_until_time(12_050 * MILLISECOND);
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
    // 400 ms cover four ticks at most, of which one is served late.
    assert!((96..100).contains(&ticks.len()), "{} ticks", ticks.len());
    // No two closer together than the end of the erase and the next regular tick allow, and none twice.
    let phase_us = ticks[ticks.len() - 1] % 100_000;
    let regular = ticks
        .iter()
        .filter(|tick| (**tick % 100_000).abs_diff(phase_us) < MILLISECOND)
        .count();
    assert!(
        ticks.len() - regular <= 1,
        "only the tick after the erase is late"
    );
    assert!(bench.resets().is_empty(), "the watchdog waited");
}
