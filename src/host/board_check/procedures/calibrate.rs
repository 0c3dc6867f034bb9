//! Compares the shown voltage with a multimeter's.

use super::super::evidence::{Calibration, Evidence, Trial, first_pack_v, mean};
use super::super::plan::{Calibrate, Multimeter};
use super::super::session::{Interruption, Session};
use super::set;

const MULTIPLIER: &str = "BATT_VOLT_MULT";

/// A new multiplier is in the next reading; some readings are averaged.
const SETTLING_US: u64 = 1_000_000;
const AVERAGING_US: u64 = 3_000_000;

/// Goes through it.
pub(in super::super) fn calibrate(
    session: &mut Session<'_>,
    evidence: &mut Evidence,
    multimeter: Multimeter,
    calibrate: Calibrate,
) -> Result<(), Interruption> {
    let measured_v = match multimeter {
        Multimeter::None => return Ok(()),
        Multimeter::Shows(measured_v) => Some(measured_v),
        Multimeter::Ask => ask(session)?,
    };
    let mut calibration = Calibration {
        measured_v,
        shown_v: shown_v(session)?,
        old: evidence.parameter(MULTIPLIER),
        ..Calibration::default()
    };
    if let (Calibrate::Apply, Some(exact)) = (calibrate, calibration.exact()) {
        calibration.applied = set(session, MULTIPLIER, exact)?;
        session.listen_for(SETTLING_US)?;
        calibration.shown_since_v = shown_v(session)?;
    }
    evidence.calibration = Trial::Done(calibration);
    Ok(())
}

fn ask(session: &mut Session<'_>) -> Result<Option<f32>, Interruption> {
    let answer = session.ask("What does the multimeter show at the pack, in volts? (return to skip)")?;
    let number = answer.and_then(|line| line.trim().replace(',', ".").parse().ok());
    Ok(number.filter(|measured_v: &f32| measured_v.is_finite() && *measured_v > 0.0))
}

/// The mean of what the board reports from now on, in volts; `None` if no pack is connected.
fn shown_v(session: &mut Session<'_>) -> Result<Option<f32>, Interruption> {
    let before = session.record().received.len();
    session.listen_for(AVERAGING_US)?;
    let new = session.record().received.get(before..).unwrap_or_default();
    let voltages_v: Vec<_> = new
        .iter()
        .filter_map(|received| first_pack_v(&received.message))
        .collect();
    Ok(mean(&voltages_v))
}
