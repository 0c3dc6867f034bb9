//! From the voltage at GP26 to the voltage on the wire.

use emulator::{AdcFault, AdcInput, Board};
use support::frames::{last_of, statuses_of};
use workbench::bench::{Bench, CURRENT, CYCLES_PER_US, MILLISECOND, PACK, SECOND};

/// The DMA channel that brings the converter's results to RAM.
const CONVERTER_DMA: usize = 2;

/// The voltage on the wire after the input has been there for a while.
fn reported_mv(bench: &mut Bench) -> u16 {
    bench.run_for(700 * MILLISECOND);
    last_of(&bench.frames(), 0).voltage_mv(0)
}

#[test]
// Requirement: FR-14
fn the_mean_error_over_the_range_stays_within_ten_counts() {
    const POINTS: u32 = 30;
    let mut bench = Bench::power_up(2482);
    bench.adc_noise(0.001);
    let (mut sum, mut worst) = (0.0, 0.0f64);
    for point in 0..POINTS {
        // From just above "not connected" to just below full scale.
        let volts = 0.55 + 2.7 * f64::from(point) / f64::from(POINTS);
        bench.adc_input(PACK, AdcInput::Volts(volts));
        let error = f64::from(reported_mv(&mut bench)) / 3950.0 / 3.3 * 4095.0 - volts / 3.3 * 4095.0;
        sum += error.abs();
        worst = worst.max(error.abs());
    }
    let mean = sum / f64::from(POINTS);
    println!("converter error over the range: mean {mean:.1} counts, worst {worst:.1} counts");
    assert!(mean <= 10.0, "{mean}");
}

/// GP26 has the first pack's voltage, GP27 the second one's current, which is 0.
fn two_pins() -> Bench {
    let parameters = [
        ("BATT2_MONITOR", 31.0),
        ("BATT2_CURR_PIN", 27.0),
        ("BATT2_AMP_PERVLT", 100.0),
        ("BATT2_AMP_OFFSET", 0.0),
    ];
    let mut bench = Bench::configured(2482, &parameters);
    bench.adc_input(CURRENT, AdcInput::Code(0));
    bench.run_for(SECOND);
    bench.take_log();
    bench
}

/// The times at which the converter was found to have failed, for this reason.
fn failures(bench: &mut Bench, reason: &str) -> Vec<u64> {
    let begins_again = format!("converter: {reason}, begins again");
    let log = bench.take_log();
    let failures = log.iter().filter(|line| line.text.contains(&begins_again));
    failures.map(|line| line.time_us).collect()
}

/// Nothing but the two packs' own readings was ever reported, and the board did not restart.
fn assert_undisturbed(bench: &mut Bench) {
    bench.run_for(700 * MILLISECOND);
    let frames = bench.frames();
    for status in statuses_of(&frames, 0) {
        assert_eq!(status.voltage_mv(0), 7901);
    }
    for status in statuses_of(&frames, 1) {
        assert_eq!((status.current_ca(), status.consumed_mah()), (0, 0));
    }
    // The one that makes the parameters count.
    assert_eq!(bench.resets().len(), 1, "{:?}", bench.resets());
}

/// The FIFO names no channel: after a conversion that is lost, each later one would count as the neighbouring pin's.
#[test]
fn a_lost_conversion_is_found_in_the_next_tick_and_moves_no_reading_to_another_pin() {
    let mut bench = two_pins();
    for (attempt, lost) in (0..36).zip([1, 2, 3].into_iter().cycle()) {
        bench.run_for(100 * MILLISECOND + 2_700 * attempt);
        bench.adc_fault(AdcFault::LostConversions(lost));
        let lost_us = bench.time_us();
        bench.run_for(250 * MILLISECOND);
        let found_us = failures(&mut bench, "Conversion");
        // A tick may lie between two of them: then the next one finds the rest.
        let found = 1..=lost as usize;
        assert!(
            found.contains(&found_us.len()),
            "{lost} lost at {lost_us}: {found_us:?}"
        );
        assert!(
            found_us[0] - lost_us < 105 * MILLISECOND,
            "{lost_us}: {found_us:?}"
        );
    }
    assert_undisturbed(&mut bench);
}

#[test]
fn results_that_wait_for_dma_too_long_fail_the_tick_and_end_with_it() {
    let mut bench = two_pins();
    for held_us in [700, 5_000, 130_000] {
        bench.run_for(137 * MILLISECOND);
        bench.hold_dma();
        bench.run_for(held_us);
        bench.release_dma();
        bench.run_for(150 * MILLISECOND);
        assert!(!failures(&mut bench, "Conversion").is_empty(), "{held_us}");
        bench.run_for(300 * MILLISECOND);
        assert!(failures(&mut bench, "Conversion").is_empty(), "{held_us}");
    }
    assert_undisturbed(&mut bench);
}

#[test]
fn a_bus_error_of_its_dma_halts_the_converter_for_a_tick_at_most() {
    let mut bench = two_pins();
    bench.fail_dma_transfer(CONVERTER_DMA);
    bench.run_for(200 * MILLISECOND);
    assert_eq!(failures(&mut bench, "Conversion").len(), 1);
    assert_undisturbed(&mut bench);
    assert!(failures(&mut bench, "Conversion").is_empty());
}

#[test]
// Requirement: FR-12
fn a_converter_that_stalls_times_out_and_is_read_again_when_it_goes_on() {
    let mut bench = two_pins();
    for stalled_us in [110_000, 150_000, 250_000] {
        bench.adc_fault(AdcFault::Stalled);
        bench.run_for(stalled_us);
        bench.adc_fault(AdcFault::None);
        bench.run_for(101 * MILLISECOND);
        assert!(!failures(&mut bench, "Timeout").is_empty(), "{stalled_us}");
        bench.run_for(300 * MILLISECOND);
        assert!(failures(&mut bench, "Timeout").is_empty(), "{stalled_us}");
    }
    assert_undisturbed(&mut bench);
}

#[test]
fn single_conversions_with_an_error_are_left_out_and_many_fail_the_read() {
    let mut bench = two_pins();
    bench.adc_fault(AdcFault::ConversionErrorInEvery(201));
    bench.run_for(2 * SECOND);
    let failed_reads = |bench: &mut Bench| {
        let mut log = bench.take_log();
        log.retain(|line| line.text.contains("read failed, Conversion"));
        log.len()
    };
    assert_eq!(failed_reads(&mut bench), 0);
    assert_undisturbed(&mut bench);
    bench.adc_fault(AdcFault::ConversionErrorInEvery(49));
    bench.run_for(2 * SECOND);
    assert!(failed_reads(&mut bench) > 0);
    assert_eq!(last_of(&bench.frames(), 0).charge_state(), 6);
}

/// RESETS.RESET (RP2040 datasheet 2.14.3), and its bits of the converter and of DMA.
const RESETS: u32 = 0x4000_c000;
const CONVERTER_AND_DMA: u32 = 0b101;

/// The rings are where the program before had them.
#[test]
fn after_a_reset_of_the_processor_alone_dma_stops_before_ram_is_set_up() {
    const GARBAGE: [u8; 4] = [0xa5; 4];
    let mut bench = Bench::running(2482);
    let data = bench.section(".data").start;
    bench.reset_processor();
    bench.write_memory(data, &GARBAGE);
    let are_held = |board: &mut Board| board.read_register(RESETS) & CONVERTER_AND_DMA == CONVERTER_AND_DMA;
    assert!(bench.run_until(SECOND / 10, are_held));
    assert_eq!(bench.read_memory(data, 4), GARBAGE);
    bench.forget_sent();
    assert_eq!(reported_mv(&mut bench), 7901);
}

/// From the first look at the converter to the first pad that is set after the read.
#[test]
// Requirement: FR-12
fn a_read_of_all_pins_with_each_pair_takes_less_than_two_milliseconds() {
    const GP26_PAD: u32 = 0x4001_c004 + 4 * 26;
    let pairs = [(26, 27), (28, 29), (26, 28), (27, 29), (26, 29), (27, 28)];
    let names = |(pack, (voltage_pin, current_pin)): (usize, (u8, u8))| {
        let prefix = if pack == 0 {
            "BATT".to_owned()
        } else {
            format!("BATT{}", pack + 1)
        };
        [
            ("MONITOR", 4),
            ("VOLT_PIN", voltage_pin),
            ("CURR_PIN", current_pin),
        ]
        .map(|(name, value)| (format!("{prefix}_{name}"), f32::from(value)))
    };
    let named: Vec<_> = pairs.into_iter().enumerate().flat_map(names).collect();
    let parameters: Vec<_> = named
        .iter()
        .map(|(name, value)| (name.as_str(), *value))
        .collect();
    let mut bench = Bench::configured(2482, &parameters);
    bench.run_for(2 * SECOND);
    let mut other = bench.clone();
    bench.take_reads();
    bench.run_for(SECOND);
    other.watch_reads(GP26_PAD);
    other.run_for(SECOND);
    let begun = bench.take_ticks();
    let ended: Vec<u64> = other.take_reads().iter().map(|at| at / CYCLES_PER_US).collect();
    let took_us = begun.iter().map(|begin_us| {
        let end_us = ended.iter().find(|end_us| *end_us >= begin_us);
        end_us.expect("the pad is set in each tick") - begin_us
    });
    let longest_us = took_us.max().expect("ticks");
    println!("a read takes {longest_us} us at most");
    assert!(longest_us < 2 * MILLISECOND);
}
