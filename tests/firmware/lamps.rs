//! The lamps' wire, as the release firmware drives it by PIO.

use crate::rover::GOOD_3S;
use emulator::Board;
use support::requests::{arm, param_set};
use workbench::bench::{Bench, MILLISECOND, SECOND, TestedVehicle};

pub const LAMPS: usize = 16;

const NS_PER_CYCLE: u64 = 8;

/// A lamp takes what comes after this for the first lamp's bits.
const RESET_NS: u64 = 50_000;

const BITS: usize = 8 * 24;

const INTERRUPT_LINES: u32 = 26;

const GREEN: [u8; 3] = [16, 0, 0];
const BLUE: [u8; 3] = [0, 0, 16];

/// When the line goes up and down, in nanoseconds.
type Pulse = (u64, u64);

fn pulses(edges: &[(u64, bool)]) -> Vec<Pulse> {
    let pulses = edges.chunks(2).map(|pulse| {
        let [(rise, true), (fall, false)] = pulse else {
            panic!("not a pulse: {pulse:?}");
        };
        (*rise * NS_PER_CYCLE, *fall * NS_PER_CYCLE)
    });
    pulses.collect()
}

/// A one or a zero, by the times that hold for the WS2812 and for the WS2812B: high for 0.35 or 0.4 µs (0), for 0.7 or
/// 0.8 µs (1), each ±0.15 µs.
fn bit(&(rise, fall): &Pulse) -> u8 {
    match fall - rise {
        250..=500 => 0,
        650..=850 => 1,
        other => panic!("high for {other} ns"),
    }
}

/// The lamps' bytes of each frame. Panics unless all eight lamps got all of their bits, each 1.25 µs ±0.6 µs long.
pub fn frames(edges: &[(u64, bool)]) -> Vec<Vec<u8>> {
    let pulses = pulses(edges);
    let frames = pulses.chunk_by(|one, next| next.0 - one.1 < RESET_NS);
    let frames = frames.map(|frame| {
        assert_eq!(frame.len(), BITS, "a frame is cut off or torn");
        for pair in frame.windows(2) {
            let period = pair[1].0 - pair[0].0;
            assert!((650..=1850).contains(&period), "a bit takes {period} ns");
        }
        let bits: Vec<u8> = frame.iter().map(bit).collect();
        let bytes = bits.chunks(8);
        bytes
            .map(|bits| bits.iter().fold(0, |byte, bit| byte << 1 | bit))
            .collect()
    });
    frames.collect()
}

/// The bytes of the only frame.
pub fn decode(edges: &[(u64, bool)]) -> Vec<u8> {
    frames(edges).concat()
}

/// How long the line is high, and how long bits are within frames: each length once.
pub fn lengths(edges: &[(u64, bool)]) -> (Vec<u64>, Vec<u64>) {
    let pulses = pulses(edges);
    let high = pulses.iter().map(|(rise, fall)| fall - rise);
    let frames = pulses.chunk_by(|one, next| next.0 - one.1 < RESET_NS);
    let periods = frames.flat_map(|frame| frame.windows(2).map(|pair| pair[1].0 - pair[0].0));
    (distinct(high), distinct(periods))
}

fn distinct(lengths: impl Iterator<Item = u64>) -> Vec<u64> {
    let mut lengths: Vec<u64> = lengths.collect();
    lengths.sort_unstable();
    lengths.dedup();
    lengths
}

fn shown(bench: &mut Bench) -> Vec<Vec<u8>> {
    frames(&bench.take_edges(LAMPS))
}

fn eight(colour: [u8; 3]) -> Vec<u8> {
    colour.repeat(8)
}

#[test]
fn all_lamps_show_each_state_once() {
    let mut bench = Bench::power_up(GOOD_3S);
    bench.record_pin(LAMPS);
    bench.run_for(SECOND);
    assert_eq!(shown(&mut bench), [eight(GREEN)], "disarmed");
    bench.ask(&param_set("BATT_CELLS", 3.0));
    bench.ask(&arm());
    assert_eq!(shown(&mut bench), [eight(BLUE)], "armed");
    bench.hang_program();
    bench.run_for(2 * SECOND);
    assert_eq!(shown(&mut bench), [eight(GREEN)], "after a reset");
}

#[test]
fn a_frame_goes_on_while_the_processor_stands() {
    let mut bench = Bench::configured(GOOD_3S, &[("BATT_CELLS", 3.0)]);
    bench.record_pin(LAMPS);
    let now_us = bench.time_us();
    let received_us = bench.uart_send(0, now_us, &arm());
    bench.run_until_time(received_us);
    let begun = |board: &mut Board| board.pin_level(LAMPS) == Some(true);
    // Within a tick and a millisecond.
    assert!(bench.run_until(22 * MILLISECOND, begun));
    // Nothing is executed any more.
    bench.hang_program();
    (0..INTERRUPT_LINES).for_each(|line| bench.cut_interrupt(line));
    bench.run_for(MILLISECOND);
    let edges = bench.take_edges(LAMPS);
    assert_eq!(decode(&edges), eight(BLUE));
    assert_eq!(lengths(&edges), (vec![360, 720], vec![1200]), "ns");
}
