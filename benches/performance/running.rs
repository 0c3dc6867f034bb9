//! What the whole firmware takes of the processor.

use crate::figures::{Figure, Table};
use emulator::{AdcInput, CpuState};
use support::requests::{command_long, manual_control, param_read_by_name, ping, timesync};
use workbench::bench::{Bench, CYCLES_PER_US, SECOND, TestedVehicle, running_task};

/// Of one pack, of some, of as many as there can be.
const PACKS: [u8; 3] = [1, 4, 9];
const RATES_HZ: [u8; 3] = [1, 10, 50];

/// `SERIAL0_BAUD` for 460800 baud.
const BAUD: f32 = 460.0;
const BYTES_PER_SECOND: u64 = 46_080;

/// Three LiPo cells at 3.8 V, and a current of 4 A.
pub const VOLTAGE_CODE: u16 = 3582;
const CURRENT_CHANNEL: usize = 1;
const CURRENT_CODE: u16 = 300;

/// Until everything has settled that was set.
const SETTLING_US: u64 = 2 * SECOND;
const MEASURED_US: u64 = 10 * SECOND;

const REQUEST_MESSAGE: u16 = 512;
const AUTOPILOT_VERSION: f32 = 148.0;

const AWAKE_GOAL_PERCENT: f64 = 3.0;

/// Which functions share a place in the cache depends on where the linker puts them: any change to the source can make it
/// a third more or less.
const MISSES_TOLERANCE: f64 = 0.5;

pub fn tables() -> Vec<Table> {
    let mut awake = Vec::new();
    let mut missed = Vec::new();
    let mut longest_turn = Vec::new();
    for packs in PACKS {
        let mut bench = with_packs(packs);
        for rate_hz in RATES_HZ {
            bench.set("SR0_EXTRA1", f32::from(rate_hz));
            bench.run_for(SETTLING_US);
            let name = format!(
                "{packs} {} at {rate_hz} Hz",
                if packs == 1 { "pack" } else { "packs" }
            );
            let (awake_percent, misses_per_second) = load(&mut bench);
            let figure = Figure::new(format!("{name}: misses"), misses_per_second);
            missed.push(figure.with_tolerance(MISSES_TOLERANCE));
            awake.push(Figure::new(name, awake_percent).with_digits(2));
        }
        if Some(&packs) == PACKS.last() {
            longest_turn.push(longest_turn_of(&mut bench));
        }
    }
    // The last is of the most packs at the highest rate.
    if let Some(most) = awake.last_mut() {
        most.goal = Some(AWAKE_GOAL_PERCENT);
    }
    vec![
        Table::new("awake, at 460800 baud", "% of the time", awake),
        Table::new("lines of 8 bytes read from the flash chip", "a second", missed),
        Table::new("9 packs at 50 Hz, 460800 baud", "µs", longest_turn),
    ]
}

/// A board with this many packs, each of which is measured by voltage and current.
fn with_packs(count: u8) -> Bench {
    let mut parameters = vec![("SERIAL0_BAUD".to_owned(), BAUD)];
    for number in 1..=count {
        let pack = if number == 1 {
            "BATT".to_owned()
        } else {
            format!("BATT{number}")
        };
        for (name, value) in [("MONITOR", 4.0), ("CURR_PIN", 27.0), ("CELLS", 3.0)] {
            parameters.push((format!("{pack}_{name}"), value));
        }
    }
    let parameters: Vec<_> = parameters
        .iter()
        .map(|(name, value)| (name.as_str(), *value))
        .collect();
    let mut bench = Bench::configured(VOLTAGE_CODE, &parameters);
    bench.adc_input(CURRENT_CHANNEL, AdcInput::Code(CURRENT_CODE));
    bench
}

/// The share of the time in which the processor is awake, in percent, and what the flash cache misses in a second.
fn load(bench: &mut Bench) -> (f64, f64) {
    let (before, missed_before) = (bench.awake_cycles(), bench.xip_misses());
    bench.run_for(MEASURED_US);
    let awake_cycles = bench.awake_cycles() - before;
    let awake_percent = 100.0 * awake_cycles as f64 / (MEASURED_US * CYCLES_PER_US) as f64;
    (
        awake_percent,
        (bench.xip_misses() - missed_before) as f64 * SECOND as f64 / MEASURED_US as f64,
    )
}

/// Longest turn of a task while the line is full of requests.
fn longest_turn_of(bench: &mut Bench) -> Figure {
    flood(bench);
    let longest_us = longest_turn_us(bench);
    Figure::new("longest turn of a task, requests fill the line", longest_us).with_digits(1)
}

/// Requests back to back, for as long as is measured. None of them changes anything, so none has flash erased.
fn flood(bench: &mut Bench) {
    let requests = [
        ping(1, 1),
        timesync(1),
        param_read_by_name("BATT_VOLT_MULT"),
        command_long(REQUEST_MESSAGE, AUTOPILOT_VERSION),
        manual_control(1, 200, 600),
    ];
    let bytes = (MEASURED_US * BYTES_PER_SECOND / SECOND) as usize;
    let requests: Vec<u8> = requests.concat().into_iter().cycle().take(bytes).collect();
    let now_us = bench.time_us();
    bench.uart_send(0, now_us, &requests);
}

/// The longest time that one task ran without a pause and without another: so long each other waits for its turn. It is
/// looked at every 10 µs.
fn longest_turn_us(bench: &mut Bench) -> f64 {
    let (mut running, mut since, mut longest) = (None, bench.time_cycles(), 0);
    bench.run_until(MEASURED_US, |board| {
        let now = board.time_cycles();
        let task = running_task(board).filter(|_| board.cpu_state() == CpuState::Running);
        if task.is_none() || task != running {
            (running, since) = (task, now);
        }
        longest = longest.max(now - since);
        false
    });
    longest as f64 / CYCLES_PER_US as f64
}
