//! Errors of a driven pack's readings.

use crate::figures::{Figure, Table};
use emulator::AdcCurve;
use workbench::driven_rover::{Reading, Sides, drive_steadily, rover};

/// As far as they may be in the tests of the same.
const VOLTAGE_GOAL_MV: f64 = 20.0;
const CURRENT_GOAL_MA: f64 = 50.0;

/// Which conversions fall beside an edge is chance.
const TOLERANCE: f64 = 1.0;

const DUTIES: u32 = 16;

pub fn tables() -> Vec<Table> {
    let mut bench = rover(AdcCurve::Ideal, &[]);
    let (mut worst_mv, mut worst_ma) = (0.0f64, 0.0f64);
    let (mut counted_as, mut drawn_as) = (0.0, 0.0);
    for step in 1..=DUTIES {
        let drive = drive_steadily(&mut bench, Sides::Both, f64::from(step) / f64::from(DUTIES));
        let (error_v, error_a) = drive.worst_errors();
        worst_mv = worst_mv.max(error_v * 1e3);
        worst_ma = worst_ma.max(error_a * 1e3);
        counted_as += Reading::mean_of(&drive.readings).current_a;
        drawn_as += drive.means.amperes;
    }
    let figure = |what: &str, value: f64| Figure::new(what, value).with_tolerance(TOLERANCE);
    let figures = vec![
        figure("voltage, mV", worst_mv)
            .with_digits(1)
            .with_goal(VOLTAGE_GOAL_MV),
        figure("current, mA", worst_ma).with_goal(CURRENT_GOAL_MA),
        figure(
            "charge of all together, %",
            100.0 * (counted_as / drawn_as - 1.0).abs(),
        )
        .with_digits(2),
    ];
    vec![Table::new(
        "error of a driven pack, the worst of 16 duties",
        "at most",
        figures,
    )]
}
