//! The status line: what the pack is, and what the monitor estimates of it.

use std::fmt;

use rover_battmon::battery::{BatteryState, ChargeState, FailsafeLevel, PackStatus};
use rover_battmon::vehicle::ArmState;
use rover_battmon::vehicle::{Mode, VehicleStatus};

use super::SimulatedPack;
use super::console::Level;

/// The simulated pack beside the monitor's estimate of its charge.
#[derive(Clone, Debug)]
pub struct Comparison {
    truth: SimulatedPack,
    estimate: BatteryState,
}

impl Comparison {
    /// The present state of both.
    pub fn new(pack: &SimulatedPack, battery: &BatteryState) -> Self {
        Self {
            truth: pack.clone(),
            estimate: *battery,
        }
    }

    /// `None` while `SIM_BATT_VOLTAGE` overrides the voltage: the charge would contradict it.
    fn true_charge_pct(&self) -> Option<f32> {
        (!self.truth.is_held()).then_some(self.truth.charge() * 100.0)
    }

    /// Both charges alone, as `9 % left, 15 ±4 % estimated`.
    pub fn charges(&self) -> String {
        let left = match (self.truth.is_plugged_in(), self.true_charge_pct()) {
            (false, _) => "no pack".into(),
            (true, Some(charge_pct)) => format!("{charge_pct:.0} % left"),
            (true, None) => "voltage set".into(),
        };
        let readings = &self.estimate.readings;
        match (readings.remaining_pct, readings.remaining_sigma_pct) {
            (Some(remaining_pct), Some(sigma_pct)) => {
                format!("{left}, {remaining_pct:.0} ±{sigma_pct:.0} % estimated")
            }
            _ => left,
        }
    }

    /// The remaining charge, in percent, by the monitor.
    pub fn remaining_pct(&self) -> Option<f32> {
        self.estimate.readings.remaining_pct
    }

    /// The failsafe level, by the monitor.
    pub fn failsafe(&self) -> FailsafeLevel {
        self.estimate.failsafe
    }

    /// Its urgency, by the monitor.
    pub fn level(&self) -> Level {
        match (self.estimate.status, self.estimate.charge_state) {
            (_, ChargeState::Critical | ChargeState::Emergency | ChargeState::Failed) => Level::Critical,
            (PackStatus::Unhealthy, _) | (_, ChargeState::Low | ChargeState::Unhealthy) => Level::Warning,
            _ => Level::Info,
        }
    }
}

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let pack = &self.truth;
        if pack.is_plugged_in() {
            write!(f, "pack {:.2} V {:.1} A ", pack.voltage_v(), pack.current_a())?;
            match self.true_charge_pct() {
                Some(charge_pct) => write!(f, "{charge_pct:.0} %")?,
                None => f.write_str("(voltage set)")?,
            }
        } else {
            f.write_str("no pack")?;
        }
        f.write_str(" | ")?;
        write_estimate(f, &self.estimate)
    }
}

fn write_estimate(f: &mut fmt::Formatter<'_>, battery: &BatteryState) -> fmt::Result {
    match battery.status {
        PackStatus::Disabled => return f.write_str("not monitored"),
        PackStatus::Unknown => return f.write_str("not measured yet"),
        PackStatus::NotConnected => return f.write_str("not connected"),
        PackStatus::Healthy | PackStatus::Unhealthy => {}
    }
    let readings = &battery.readings;
    match (readings.remaining_pct, readings.remaining_sigma_pct) {
        (Some(remaining_pct), Some(sigma_pct)) => {
            write!(f, "estimated {remaining_pct:.0} ±{sigma_pct:.0} %")?;
        }
        (Some(remaining_pct), None) => write!(f, "reported {remaining_pct:.0} %")?,
        (None, _) => f.write_str("charge unknown")?,
    }
    f.write_str(match battery.charge_state {
        ChargeState::Undefined | ChargeState::Ok => "",
        ChargeState::Low => ", low",
        ChargeState::Critical => ", critical",
        ChargeState::Emergency => ", emergency",
        ChargeState::Failed => ", failed",
        ChargeState::Unhealthy => ", unhealthy",
        ChargeState::Charging => ", charging",
    })
}

/// A mode and whether the rover is armed, as ground stations show them.
pub(super) fn driving(mode: Mode, arm_state: ArmState) -> String {
    let mode = match mode {
        Mode::Manual => "MANUAL",
        Mode::Hold => "HOLD",
    };
    let arm_state = match arm_state {
        ArmState::Armed => "armed",
        ArmState::Disarmed => "disarmed",
    };
    format!("{mode}, {arm_state}")
}

/// Everything in the status line.
#[derive(Clone, Debug)]
pub(super) struct Status {
    pub comparison: Comparison,
    pub vehicle: VehicleStatus,
    pub stations: usize,
    /// Of the sensors, since the previous status.
    pub samples: u32,
    /// Sent, since the previous status.
    pub frames: u32,
    /// Frames that were dropped so far.
    pub dropped: u32,
}

impl Status {
    /// For a terminal: what a line of 80 columns has room for.
    pub fn short(&self) -> String {
        let dropped = match self.dropped {
            0 => String::new(),
            dropped => format!(" | {dropped} dropped"),
        };
        format!("{self}{dropped}")
    }

    /// For a file.
    pub fn long(&self) -> String {
        format!(
            "{self} | {} samples, {} frames, {} dropped",
            self.samples, self.frames, self.dropped
        )
    }
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let driving = driving(self.vehicle.mode, self.vehicle.arm_state);
        write!(f, "{} | {driving} | ", self.comparison)?;
        match self.stations {
            1 => f.write_str("1 ground station"),
            stations => write!(f, "{stations} ground stations"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::PackModel;
    use rover_battmon::battery::Readings;

    fn comparison(battery: BatteryState) -> Comparison {
        let mut pack = SimulatedPack::full(PackModel::LIPO_3S_2200);
        pack.draw(0.2, 0.001);
        Comparison::new(&pack, &battery)
    }

    fn estimated(remaining_pct: f32, charge_state: ChargeState) -> BatteryState {
        BatteryState {
            status: PackStatus::Healthy,
            readings: Readings {
                remaining_pct: Some(remaining_pct),
                remaining_sigma_pct: Some(3.2),
                ..Readings::NONE
            },
            charge_state,
            ..BatteryState::UNKNOWN
        }
    }

    #[test]
    fn truth_stands_beside_the_estimate() {
        let status = Status {
            comparison: comparison(estimated(97.4, ChargeState::Ok)),
            vehicle: VehicleStatus::default(),
            stations: 1,
            samples: 10,
            frames: 5,
            dropped: 0,
        };
        let expected = "pack 12.59 V 0.2 A 100 % | estimated 97 ±3 % | HOLD, disarmed | 1 ground station";
        assert_eq!(status.short(), expected);
        assert_eq!(status.comparison.charges(), "100 % left, 97 ±3 % estimated");
        assert_eq!(
            status.long(),
            format!("{expected} | 10 samples, 5 frames, 0 dropped")
        );
    }

    #[test]
    fn what_the_monitor_can_not_say_is_said() {
        for (status, expected) in [
            (PackStatus::Disabled, "not monitored"),
            (PackStatus::Unknown, "not measured yet"),
            (PackStatus::NotConnected, "not connected"),
            (PackStatus::Healthy, "charge unknown"),
        ] {
            let battery = BatteryState {
                status,
                ..BatteryState::UNKNOWN
            };
            let line = comparison(battery).to_string();
            assert!(line.ends_with(&format!(" | {expected}")), "{line}");
        }
    }

    #[test]
    fn charge_states_have_their_word_and_level() {
        for (charge_state, ending, level) in [
            (ChargeState::Ok, " %", Level::Info),
            (ChargeState::Low, ", low", Level::Warning),
            (ChargeState::Critical, ", critical", Level::Critical),
            (ChargeState::Emergency, ", emergency", Level::Critical),
            (ChargeState::Unhealthy, ", unhealthy", Level::Warning),
        ] {
            let comparison = comparison(estimated(10.0, charge_state));
            assert!(comparison.to_string().ends_with(ending), "{comparison}");
            assert_eq!(comparison.level(), level, "{comparison}");
        }
    }

    #[test]
    fn a_voltage_that_is_set_has_no_true_charge_beside_it() {
        let mut pack = SimulatedPack::full(PackModel::LIPO_3S_2200);
        pack.hold_open_circuit(Some(10.2));
        let comparison = Comparison::new(&pack, &estimated(9.0, ChargeState::Low));
        assert_eq!(
            comparison.to_string(),
            "pack 10.20 V 0.0 A (voltage set) | estimated 9 ±3 %, low"
        );
        assert_eq!(comparison.charges(), "voltage set, 9 ±3 % estimated");
    }

    #[test]
    fn a_pack_that_is_unplugged_has_no_values() {
        let mut pack = SimulatedPack::full(PackModel::LIPO_3S_2200);
        pack.unplug();
        let comparison = Comparison::new(&pack, &BatteryState::UNKNOWN);
        assert_eq!(comparison.to_string(), "no pack | not measured yet");
        assert_eq!(comparison.charges(), "no pack");
    }
}
