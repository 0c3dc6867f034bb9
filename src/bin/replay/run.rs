//! A trace through the monitor.

use rover_battmon::battery::{BatteryMonitor, LearntPack, Measurement, PackSettings, ReadError, Tick};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::Parameters;
use rover_battmon::time::Instant;
use rover_battmon::vehicle::ArmState;

use crate::report::Row;
use crate::settings::Inputs;
use crate::trace::{Sample, Trace};

/// What a fresh monitor with the parameters of `pack` makes of each reading of the trace; `learnt` is known of the pack and
/// updated as flash would be.
pub fn run(
    trace: &Trace,
    pack: Pack,
    inputs: Inputs,
    parameters: &Parameters,
    learnt: &mut LearntPack,
) -> Vec<Row> {
    let settings = PackSettings::from_parameters(parameters, pack);
    let mut monitor = BatteryMonitor::new();
    monitor.restore_learnt(*learnt);
    let rows = trace.samples.iter().map(|sample| {
        let update = monitor.update(tick(sample), reading(sample, inputs), &settings);
        Row {
            time_s: sample.time_s,
            state: *monitor.state(),
            failsafe: monitor.state().failsafe,
            events: update.events.iter().map(ToString::to_string).collect(),
            reported: sample.reported,
        }
    });
    let rows = rows.collect();
    if let Some(unsaved) = monitor.unsaved_learnt() {
        *learnt = *unsaved;
    }
    rows
}

fn tick(sample: &Sample) -> Tick {
    Tick {
        now: Instant::from_micros((sample.time_s * 1e6).round() as u64),
        arm_state: if sample.armed {
            ArmState::Armed
        } else {
            ArmState::Disarmed
        },
    }
}

fn reading(sample: &Sample, inputs: Inputs) -> Result<Measurement, ReadError> {
    if !sample.healthy {
        return Err(ReadError::Timeout);
    }
    Ok(Measurement {
        voltage_v: sample.voltage_v.filter(|_| inputs.voltage),
        current_a: sample.current_a.filter(|_| inputs.current),
        temperature_c: sample.temperature_c,
        cells: sample.cells,
        ..Measurement::default()
    })
}
