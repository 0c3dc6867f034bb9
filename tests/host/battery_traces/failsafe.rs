//! Times at which failsafes trip.

use rover_battmon::battery::{
    ChargeState, FailsafeLevel, FailsafeSettings, PackSettings, Thresholds, VoltageSource,
};

use super::replay::{failsafes, run, trace};

const VOLTAGES: &str = "trace_failsafe_voltage.csv";

/// Low below 10.5 V, critical below 9.9 V, after 10 s.
fn settings() -> PackSettings {
    let below = |voltage_v| Thresholds {
        voltage_v: Some(voltage_v),
        remaining_mah: None,
    };
    PackSettings {
        failsafe: FailsafeSettings {
            timer_s: Some(10.0),
            voltage_source: VoltageSource::Terminal,
            low: below(10.5),
            critical: below(9.9),
        },
        ..PackSettings::default()
    }
}

fn with_source(voltage_source: VoltageSource) -> PackSettings {
    let mut settings = settings();
    settings.failsafe.voltage_source = voltage_source;
    settings
}

/// As in ArduPilot: the preceding 9.9 s below 10.5 V and 9 s below 9.9 V do not trip.
const LOW_THEN_CRITICAL: [(f64, FailsafeLevel); 2] =
    [(26.1, FailsafeLevel::Low), (51.1, FailsafeLevel::Critical)];

#[test]
fn low_voltage_trips_after_the_timer_and_a_dip_does_not() {
    let moments = run(&trace(VOLTAGES), &settings());
    assert_eq!(failsafes(&moments), LOW_THEN_CRITICAL);
}

#[test]
fn resting_voltage_trips_under_a_constant_load() {
    let moments = run(&trace(VOLTAGES), &with_source(VoltageSource::Resting));
    assert_eq!(failsafes(&moments), LOW_THEN_CRITICAL);
}

#[test]
fn sag_trips_the_terminal_voltage_and_not_the_resting_one() {
    let sag = trace("trace_sag.csv");
    let by_terminal = failsafes(&run(&sag, &with_source(VoltageSource::Terminal)));
    assert_eq!(by_terminal, [(25.1, FailsafeLevel::Low)]);
    let by_resting = failsafes(&run(&sag, &with_source(VoltageSource::Resting)));
    assert_eq!(by_resting, []);
}

#[test]
fn zero_timer_disables_voltage_thresholds() {
    let mut settings = settings();
    settings.failsafe.timer_s = None;
    assert_eq!(failsafes(&run(&trace(VOLTAGES), &settings)), []);
}

#[test]
fn sensor_failed_for_five_seconds_is_unhealthy() {
    let moments = run(&trace("trace_unhealthy.csv"), &settings());
    // The last valid reading is at 9.9 s; the second gap is only 3 s.
    assert_eq!(failsafes(&moments), [(15.0, FailsafeLevel::Unhealthy)]);
    assert_eq!(moments.last().unwrap().state.charge_state, ChargeState::Ok);
}

#[test]
fn dip_before_disarming_does_not_trip_after_rearming() {
    let moments = run(&trace("trace_disarm_stale_timer.csv"), &settings());
    // Armed at 36 s, where ArduPilot trips at once; the voltage stays low, so it trips 10 s later.
    assert_eq!(failsafes(&moments), [(46.1, FailsafeLevel::Low)]);
}

/// Time of the low failsafe in the drive of ten minutes (3S, 2200 mAh) and remaining charge then, in the guide's
/// format.
fn low_failsafe_of_the_drive(low_v: f32, timer_s: f32, voltage_source: VoltageSource) -> String {
    let settings = PackSettings {
        cell_count: Some(3),
        capacity_mah: Some(2200.0),
        failsafe: FailsafeSettings {
            timer_s: Some(timer_s),
            voltage_source,
            low: Thresholds {
                voltage_v: Some(low_v),
                remaining_mah: None,
            },
            ..FailsafeSettings::default()
        },
        ..PackSettings::default()
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
    let guide = support::repository().join("docs/guides/failsafe-tuning.md");
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
