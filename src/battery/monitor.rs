//! From a series of measurements to the state of a pack.

use super::{BatteryState, ChargeState, Measurement, PackStatus, ReadError};

/// Below this voltage no pack is connected, in volts: the divider then sees what leaks in while the board runs from USB.
/// The same limit as PX4's `BATTERY_CONNECTED` test.
pub const MIN_CONNECTED_VOLTAGE_V: f32 = 2.1;

/// After this many failed reads in a row the state says unhealthy: half a second at 10 Hz.
pub const FAILED_READS_UNTIL_UNHEALTHY: u8 = 5;

/// Follows one pack.
#[derive(Clone, Debug, Default)]
pub struct BatteryMonitor {
    state: BatteryState,
    failed_reads: u8,
}

impl BatteryMonitor {
    /// A monitor that has seen nothing yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// What is known now.
    pub fn state(&self) -> BatteryState {
        self.state
    }

    /// How many reads have failed since the last good one (saturating).
    pub fn failed_reads(&self) -> u8 {
        self.failed_reads
    }

    /// Takes one reading, good or failed, and returns the state that follows from it.
    ///
    /// # Errors
    /// The reading was failed or implausible. The state keeps its last good values.
    pub fn update(&mut self, reading: Result<Measurement, ReadError>) -> Result<BatteryState, ReadError> {
        match reading.and_then(plausible) {
            Ok(measurement) => {
                self.accept(measurement);
                Ok(self.state)
            }
            Err(error) => {
                self.reject();
                Err(error)
            }
        }
    }

    fn accept(&mut self, measurement: Measurement) {
        self.failed_reads = 0;
        let connected = measurement
            .voltage_v
            .is_some_and(|voltage_v| voltage_v >= MIN_CONNECTED_VOLTAGE_V);
        (self.state.status, self.state.charge_state) = if connected {
            (PackStatus::Healthy, ChargeState::Ok)
        } else {
            (PackStatus::NotConnected, ChargeState::Undefined)
        };
        // Without a pack the pin's voltage is not a pack voltage: unknown, not a flat battery.
        self.state.voltage_v = measurement.voltage_v.filter(|_| connected);
    }

    fn reject(&mut self) {
        self.failed_reads = self.failed_reads.saturating_add(1);
        if self.failed_reads >= FAILED_READS_UNTIL_UNHEALTHY {
            self.state.status = PackStatus::Unhealthy;
            self.state.charge_state = ChargeState::Unhealthy;
        }
    }
}

fn plausible(measurement: Measurement) -> Result<Measurement, ReadError> {
    if measurement.voltage_v.is_none_or(f32::is_finite) {
        Ok(measurement)
    } else {
        Err(ReadError::Implausible)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn volts(voltage_v: f32) -> Result<Measurement, ReadError> {
        Ok(Measurement {
            voltage_v: Some(voltage_v),
            ..Measurement::default()
        })
    }

    #[test]
    fn it_starts_unknown_and_invents_no_voltage() {
        let state = BatteryMonitor::new().state();
        assert_eq!(state, BatteryState::default());
        assert_eq!(state.status, PackStatus::Unknown);
        assert_eq!(state.voltage_v, None);
    }

    #[test]
    fn failures_keep_the_last_good_value_and_the_fifth_says_unhealthy() {
        let mut monitor = BatteryMonitor::new();
        monitor.update(volts(11.1)).unwrap();
        for failure in 1..=7 {
            assert_eq!(monitor.update(Err(ReadError::Timeout)), Err(ReadError::Timeout));
            let expected = if failure < 5 {
                PackStatus::Healthy
            } else {
                PackStatus::Unhealthy
            };
            assert_eq!(monitor.state().status, expected, "failure {failure}");
            assert_eq!(monitor.state().voltage_v, Some(11.1));
        }
        let recovered = monitor.update(volts(10.9)).unwrap();
        assert_eq!(recovered.status, PackStatus::Healthy);
        assert_eq!(recovered.voltage_v, Some(10.9));
    }

    #[test]
    fn four_failures_between_good_reads_never_make_it_unhealthy() {
        let mut monitor = BatteryMonitor::new();
        for _ in 0..10 {
            monitor.update(volts(11.1)).unwrap();
            for _ in 0..4 {
                let _ = monitor.update(Err(ReadError::Conversion));
                assert_eq!(monitor.state().status, PackStatus::Healthy);
            }
        }
    }

    #[test]
    fn a_dead_converter_at_boot_stays_unknown_then_unhealthy() {
        let mut monitor = BatteryMonitor::new();
        for _ in 0..4 {
            let _ = monitor.update(Err(ReadError::Timeout));
            assert_eq!(monitor.state().status, PackStatus::Unknown);
        }
        let _ = monitor.update(Err(ReadError::Timeout));
        assert_eq!(monitor.state().status, PackStatus::Unhealthy);
        assert_eq!(monitor.state().voltage_v, None);
    }

    #[test]
    fn usb_power_is_no_pack_and_not_a_flat_one() {
        let mut monitor = BatteryMonitor::new();
        monitor.update(volts(11.1)).unwrap();
        let state = monitor.update(volts(2.09)).unwrap();
        assert_eq!(state.status, PackStatus::NotConnected);
        assert_eq!(state.voltage_v, None);
        let state = monitor.update(volts(2.1)).unwrap();
        assert_eq!(state.status, PackStatus::Healthy);
    }

    #[test]
    fn a_voltage_that_is_no_number_counts_as_a_failed_read() {
        let mut monitor = BatteryMonitor::new();
        monitor.update(volts(11.1)).unwrap();
        assert_eq!(monitor.update(volts(f32::NAN)), Err(ReadError::Implausible));
        assert_eq!(monitor.state().voltage_v, Some(11.1));
        assert_eq!(monitor.failed_reads(), 1);
    }

    fn any_reading() -> impl Strategy<Value = Result<Measurement, ReadError>> {
        prop_oneof![
            any::<f32>().prop_map(volts),
            Just(Err(ReadError::Timeout)),
            Just(Err(ReadError::Conversion)),
        ]
    }

    proptest! {
        #[test]
        fn any_series_leaves_a_finite_voltage_of_a_connected_pack_or_none(
            readings in prop::collection::vec(any_reading(), 0..200),
        ) {
            let mut monitor = BatteryMonitor::new();
            for reading in readings {
                let _ = monitor.update(reading);
                if let Some(voltage_v) = monitor.state().voltage_v {
                    prop_assert!(voltage_v.is_finite() && voltage_v >= MIN_CONNECTED_VOLTAGE_V);
                }
            }
        }
    }
}
