//! When the failsafes trip.

use rover_battmon::battery::{
    ChargeState, FailsafeLevel, FailsafeSettings, PackSettings, Thresholds, VoltageSource,
};

use crate::replay::{failsafes, run, trace};

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

/// The times at which ArduPilot trips, too: the 9.9 s below 10.5 V and the 9 s below 9.9 V before them do not count.
const LOW_THEN_CRITICAL: [(f64, FailsafeLevel); 2] =
    [(26.1, FailsafeLevel::Low), (51.1, FailsafeLevel::Critical)];

#[test]
fn a_voltage_that_stays_low_trips_and_a_shorter_dip_does_not() {
    let moments = run(&trace(VOLTAGES), &settings());
    assert_eq!(failsafes(&moments), LOW_THEN_CRITICAL);
}

#[test]
fn the_resting_voltage_trips_as_well_under_a_constant_load() {
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
fn a_timer_of_zero_turns_the_voltages_off() {
    let mut settings = settings();
    settings.failsafe.timer_s = None;
    assert_eq!(failsafes(&run(&trace(VOLTAGES), &settings)), []);
}

#[test]
fn a_sensor_that_is_silent_for_more_than_five_seconds_is_unhealthy() {
    let moments = run(&trace("trace_unhealthy.csv"), &settings());
    // The last good reading was at 9.9 s; the second silence is of 3 s only.
    assert_eq!(failsafes(&moments), [(15.0, FailsafeLevel::Unhealthy)]);
    assert_eq!(moments.last().unwrap().state.charge_state, ChargeState::Ok);
}

#[test]
fn a_dip_before_disarming_does_not_trip_when_armed_again() {
    let moments = run(&trace("trace_disarm_stale_timer.csv"), &settings());
    // Armed at 36 s: ArduPilot trips at once. The voltage stays low from then on, so that it trips 10 s later.
    assert_eq!(failsafes(&moments), [(46.1, FailsafeLevel::Low)]);
}

/// When the ten minutes' drive of a 3S pack of 2200 mAh counts as low and what is left then, in the guide's words.
fn told_of_the_drive(low_v: f32, timer_s: f32, voltage_source: VoltageSource) -> String {
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
        let remaining_pct = moment.remaining_pct().expect("it is known");
        format!("{:.0} s, {remaining_pct:.0} %", moment.t_s)
    })
}

#[test]
fn the_guides_table_is_what_the_drive_shows() {
    let guide = concat!(env!("CARGO_MANIFEST_DIR"), "/docs/guides/failsafe-tuning.md");
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
        let told = |source| told_of_the_drive(low_v, timer_s, source);
        assert_eq!(told(VoltageSource::Terminal), by_terminal, "{line}");
        assert_eq!(told(VoltageSource::Resting), by_resting, "{line}");
    }
    assert_eq!(rows, 7);
}
