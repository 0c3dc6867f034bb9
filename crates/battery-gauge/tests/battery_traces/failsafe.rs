//! Times at which failsafes trip.

use battery_gauge::{FailsafeLevel, FailsafeSettings, PackSettings, Thresholds, VoltageSource};

use super::replay::{cells_and_capacity_set, repository, run, trace};

/// Time of the low failsafe in the drive of ten minutes (3S, 2200 mAh) and remaining charge then, in the guide's
/// format.
fn low_failsafe_of_the_drive(low_v: f32, timer_s: f32, voltage_source: VoltageSource) -> String {
    let settings = PackSettings {
        failsafe: FailsafeSettings {
            timer_s: Some(timer_s),
            voltage_source,
            low: Thresholds {
                voltage_v: Some(low_v),
                ..Thresholds::default()
            },
            ..FailsafeSettings::default()
        },
        ..cells_and_capacity_set()
    };
    let moments = run(&trace("trace_discharge_3s_10min.csv"), &settings);
    let low = moments
        .iter()
        .find(|moment| moment.state.failsafe == FailsafeLevel::Low);
    low.map_or("never".into(), |moment| {
        let remaining_pct = moment.remaining_pct().expect("known");
        format!("{:.0} s, {remaining_pct:.0} %", moment.t_s)
    })
}

#[test]
fn table_of_the_guide_matches_the_trace() {
    let guide = repository().join("docs/failsafes.md");
    let guide = std::fs::read_to_string(guide).expect("the guide");
    let mut rows = 0;
    for line in guide.lines() {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let &["", low_v, timer_s, by_terminal, by_resting, ""] = cells.as_slice() else {
            continue;
        };
        let (Ok(low_v), Ok(timer_s)) = (low_v.parse(), timer_s.parse()) else {
            continue;
        };
        rows += 1;
        let result = |source| low_failsafe_of_the_drive(low_v, timer_s, source);
        assert_eq!(result(VoltageSource::Terminal), by_terminal, "{line}");
        assert_eq!(result(VoltageSource::Resting), by_resting, "{line}");
    }
    assert_eq!(rows, 7);
}
