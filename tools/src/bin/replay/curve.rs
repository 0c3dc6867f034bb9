//! The curve of a pack's cells, from a slow discharge that begins full and ends empty.

use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, Parameters};
use rover_battmon_tools::recordings::entry::Sample;

use crate::assignments::Assignment;
use crate::drive::Trace;
use crate::run;

/// The least time under load, in hours: a faster discharge shows how a cell sags.
const LEAST_H: f64 = 5.0;

/// The sag at once is looked for this long after the load begins, in seconds.
const SAG_S: f64 = 10.0;

/// The charges of the points, from 0 to 1, and the share to either side over which the voltage is averaged.
const POINTS: [f64; BatteryParameter::CURVE.len()] = [0.1, 0.3, 0.5, 0.7, 0.9];
const HALF_WIDTH: f64 = 0.01;

/// The lines of a file of parameters with the curve of a cell of `pack`.
///
/// # Errors
/// The recording is no such discharge, or the curve can't be one of such cells, in words.
pub fn lines(
    trace: &Trace,
    parameters: &Parameters,
    pack: Pack,
    cells: Option<u8>,
) -> Result<String, String> {
    let cells = cells.ok_or("the number of cells is unknown: --param BATT_CELLS=")?;
    let readings: Vec<_> = trace.samples.iter().filter_map(measured).collect();
    let least_a = least_load_a(&readings).ok_or("it has no current")?;
    let is_loaded = |(_, _, current_a): &(f64, f64, f64)| *current_a >= least_a;
    let begin = readings.iter().position(is_loaded).unwrap_or_default();
    let (mut loaded_s, mut drawn_as) = (0.0, 0.0);
    let ohm = resistance_ohm(&readings, begin);
    // The charge drawn since the load began, and the resting voltage.
    let mut curve = vec![];
    for (before, now) in readings[begin..].iter().zip(&readings[begin + 1..]) {
        let (time_s, voltage_v, current_a) = *now;
        let seconds = time_s - before.0;
        drawn_as += 0.5 * (before.2 + current_a) * seconds;
        if is_loaded(before) {
            loaded_s += seconds;
            curve.push((drawn_as, voltage_v + ohm * current_a));
        }
    }
    let loaded_h = loaded_s / 3600.0;
    if loaded_h < LEAST_H {
        return Err(format!(
            "a discharge of {loaded_h:.1} h is too fast: {LEAST_H} h are needed"
        ));
    }
    let mut assignments = vec![];
    for (parameter, soc) in BatteryParameter::CURVE.into_iter().zip(POINTS) {
        let is_near = |(at_as, _): &&(f64, f64)| (1.0 - at_as / drawn_as - soc).abs() <= HALF_WIDTH;
        let near_v: Vec<f64> = curve
            .iter()
            .filter(is_near)
            .map(|(_, resting_v)| *resting_v)
            .collect();
        if near_v.is_empty() {
            return Err(format!("no readings near {} %", soc * 100.0));
        }
        let cell_v = near_v.iter().sum::<f64>() / near_v.len() as f64 / f64::from(cells);
        assignments.push(Assignment {
            id: parameter.of(pack),
            value: (cell_v * 1000.0).round() as f32 / 1000.0,
        });
    }
    let with_curve = run::assign(parameters.clone(), &assignments, pack, trace.measured())?;
    if !run::settings(&with_curve, pack).is_curve_possible() {
        return Err("the voltage does not fall with the charge".into());
    }
    let chemistry = BatteryParameter::Chem.of(pack);
    let full_ah = drawn_as / 3600.0;
    let mut text = format!("# The curve of a cell, by {full_ah:.2} Ah in {loaded_h:.1} h.\n");
    text += &format!("{},{}\n", chemistry.name(), with_curve.get(chemistry));
    for Assignment { id, value } in assignments {
        text += &format!("{},{value}\n", id.name());
    }
    Ok(text)
}

/// Time in seconds, voltage in volts and current in amperes of a reading that has both.
fn measured(sample: &Sample) -> Option<(f64, f64, f64)> {
    Some((sample.time_s, sample.voltage_v?.into(), sample.current_a?.into()))
}

/// Half of the mean load: less is a pause.
fn least_load_a(readings: &[(f64, f64, f64)]) -> Option<f64> {
    let loads_a = || {
        readings
            .iter()
            .map(|(_, _, current_a)| *current_a)
            .filter(|a| *a > 0.0)
    };
    let count = loads_a().count();
    (count > 0).then(|| 0.5 * loads_a().sum::<f64>() / count as f64)
}

/// Resistance of the pack by the step with which the load begins at this reading; 0 if none is before.
fn resistance_ohm(readings: &[(f64, f64, f64)], begin: usize) -> f64 {
    let (rests, loads) = readings.split_at(begin);
    let begin_s = loads.first().map_or(0.0, |(time_s, ..)| *time_s);
    let after = loads.iter().find(|(time_s, ..)| *time_s >= begin_s + SAG_S);
    match (rests.last(), after) {
        (Some((_, rest_v, rest_a)), Some((_, loaded_v, loaded_a))) if loaded_a > rest_a => {
            ((rest_v - loaded_v) / (loaded_a - rest_a)).max(0.0)
        }
        _ => 0.0,
    }
}
