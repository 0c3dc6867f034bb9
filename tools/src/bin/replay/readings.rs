//! The readings of all packs in a log, each put together from the records that follow it.

use std::ops::Range;

use rover_battmon::battery::{CellVoltages, MAX_CELLS};
use rover_battmon::pack::{MAX_PACKS, Pack};

use crate::binlog::Record;
use crate::survey::pack_of;
use crate::trace::{Reported, Sample};

/// BAT: a remaining charge and a state of health that are unknown.
const REMAINING_UNKNOWN_PCT: f32 = 255.0;
const HEALTH_UNKNOWN_PCT: f32 = 0.0;

/// BATX: `Stat` of a pack whose sensor has failed.
const UNHEALTHY: f64 = 4.0;

/// Cells in BCL; BCL2 has those that follow.
const FIRST_CELLS: usize = 12;

/// Puts readings together. One is whole when the next one of its pack begins, the rover is armed or disarmed, or the file ends.
#[derive(Debug, Default)]
pub struct Readings {
    armed: bool,
    begun: [Option<Sample>; MAX_PACKS],
    latest_s: [f64; MAX_PACKS],
    backward_steps: usize,
}

impl Readings {
    /// Takes a record, and gives each reading that is whole then to `take`.
    pub fn add(&mut self, record: &Record, mut take: impl FnMut(Pack, Sample)) {
        if record.name() == "ARM" {
            self.finish(&mut take);
            self.armed = record.number("ArmState") == Some(1.0);
        }
        let Some(pack) = pack_of(record) else {
            return;
        };
        let place = usize::from(pack.instance());
        let (begun, latest_s) = (&mut self.begun[place], &mut self.latest_s[place]);
        match (record.name(), begun) {
            ("BAT", begun) => {
                let Some(next) = reading(record, self.armed) else {
                    return;
                };
                self.backward_steps += usize::from(next.time_s < *latest_s);
                *latest_s = next.time_s;
                if let Some(whole) = begun.replace(next) {
                    take(pack, whole);
                }
            }
            ("BATX", Some(begun)) => estimate(begun, record),
            ("BCL", Some(begun)) => cells(begun, record, 0..FIRST_CELLS),
            ("BCL2", Some(begun)) => {
                cells(begun, record, FIRST_CELLS..MAX_CELLS);
                drop_incomplete_cells(begun);
            }
            _ => {}
        }
    }

    /// Readings so far that are earlier than the one before of the same pack.
    pub fn backward_steps(&self) -> usize {
        self.backward_steps
    }

    /// Gives what is begun to `take`.
    pub fn finish(&mut self, mut take: impl FnMut(Pack, Sample)) {
        for (pack, begun) in Pack::ALL.into_iter().zip(&mut self.begun) {
            if let Some(sample) = begun.take() {
                take(pack, sample);
            }
        }
    }
}

fn reading(record: &Record, armed: bool) -> Option<Sample> {
    Some(Sample {
        time_s: time_s(record)?,
        voltage_v: number(record, "Volt"),
        current_a: number(record, "Curr"),
        // Logs of ArduPilot before 4.6 do not say.
        healthy: record.number("H") != Some(0.0),
        armed,
        // 0 is unknown.
        temperature_c: number(record, "Temp").filter(|celsius| *celsius != 0.0),
        cells: CellVoltages::NONE,
        reported: Some(Reported {
            consumed_mah: number(record, "CurrTot"),
            consumed_wh: number(record, "EnrgTot"),
            remaining_pct: number(record, "RemPct").filter(|pct| *pct != REMAINING_UNKNOWN_PCT),
            health_pct: number(record, "SH").filter(|pct| *pct != HEALTH_UNKNOWN_PCT),
            charge_state: None,
            faults: None,
        }),
    })
}

/// Seconds since the recorder started.
pub fn time_s(record: &Record) -> Option<f64> {
    record.number("TimeUS").map(|time_us| time_us / 1e6)
}

fn estimate(sample: &mut Sample, record: &Record) {
    // A pack that is not connected is not healthy, and its sensor works.
    sample.healthy = record.number("Stat") != Some(UNHEALTHY);
    if let Some(reported) = &mut sample.reported {
        reported.remaining_pct = number(record, "SoC").or(reported.remaining_pct);
        reported.charge_state = record.number("State").map(|state| state as u8);
        reported.faults = record.number("Flt").map(|faults| faults as u16);
    }
}

/// A cell that does not exist is 0.
fn cells(sample: &mut Sample, record: &Record, places: Range<usize>) {
    let mut millivolts = sample.cells.millivolts().to_vec();
    let cells = places.map_while(|place| record.number(&format!("V{}", place + 1)));
    millivolts.extend(cells.take_while(|mv| *mv > 0.0).map(|mv| mv as u16));
    sample.cells = CellVoltages::from_millivolts(&millivolts);
}

/// A log has columns for the first cells of a larger stack only: their number is not the stack's. ArduPilot's has 14.
fn drop_incomplete_cells(sample: &mut Sample) {
    let cells_v: f32 = sample
        .cells
        .millivolts()
        .iter()
        .map(|mv| f32::from(*mv) / 1000.0)
        .sum();
    let missing_v = sample.voltage_v.unwrap_or(cells_v) - cells_v;
    if missing_v > 0.5 * cells_v / sample.cells.count() as f32 {
        sample.cells = CellVoltages::NONE;
    }
}

fn number(record: &Record, column: &str) -> Option<f32> {
    record.number(column).map(|number| number as f32)
}
