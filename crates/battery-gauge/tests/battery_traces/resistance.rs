//! Resistance and resting voltage.

use battery_gauge::PackSettings;

use super::replay::{Moment, run, trace};

#[test]
// Requirement: AP-15, OWN-1
fn resistance_is_known_within_15_seconds_of_steps() {
    let moments = run(&trace("trace_step_r50m.csv"), &PackSettings::default());
    let known = |moment: &Moment| Some((moment.t_s, moment.state.resistance_ohm?));
    let (first_s, first_ohm) = moments.iter().find_map(known).expect("a resistance");
    println!("resistance: {first_ohm} Ω at {first_s} s");
    assert!(first_s <= 15.0);
    let mut last_ohm = first_ohm;
    for moment in moments.iter().filter(|moment| moment.t_s >= 15.0) {
        last_ohm = moment.state.resistance_ohm.expect("it stays known");
        assert!(
            (0.045..=0.055).contains(&last_ohm),
            "{last_ohm} Ω at {} s",
            moment.t_s
        );
    }
    println!("resistance: {last_ohm} Ω at the end");
}

/// Difference between resting and terminal voltage beyond the sag by the reported resistance, in volts.
fn unexplained_v(moment: &Moment) -> Option<f32> {
    let state = &moment.state;
    let terminal_v = state.readings.voltage_v?;
    let resting_v = state.readings.resting_voltage_v.unwrap_or(terminal_v);
    let explained_v = state.readings.current_a? * state.resistance_ohm.unwrap_or(0.0);
    Some((resting_v - terminal_v - explained_v).abs())
}

#[test]
// Requirement: OWN-1
fn voltage_falling_at_constant_load_is_not_sag() {
    let moments = run(&trace("trace_failsafe_voltage.csv"), &PackSettings::default());
    let largest_v = moments.iter().filter_map(unexplained_v).fold(0.0, f32::max);
    println!("resting voltage: {largest_v} V unexplained at most");
    assert!(largest_v <= 0.1, "{largest_v} V");
    let is_unknown = |moment: &Moment| moment.state.resistance_ohm.is_none();
    assert!(
        moments.iter().all(is_unknown),
        "no resistance from a constant load"
    );
}

#[test]
// Requirement: AP-15
fn resting_voltage_compensates_the_sag() {
    let moments = run(&trace("trace_sag.csv"), &PackSettings::default());
    for moment in moments.iter().filter(|moment| moment.t_s >= 15.0) {
        let resting_v = moment.state.readings.resting_voltage_v;
        let resting_v = resting_v.expect("a resting voltage");
        assert!(
            (resting_v - 11.1).abs() < 0.02,
            "{resting_v} V at {} s",
            moment.t_s
        );
    }
}
