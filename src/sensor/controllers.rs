//! Motor controllers: several may measure a pack together.

use crate::battery::{Consumed, Counted, Measurement};

/// A motor controller's reading. `None` is not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControllerReading {
    /// Voltage at its supply, in volts.
    pub voltage_v: Option<f32>,
    /// Current drawn from the pack, in amperes.
    pub current_a: Option<f32>,
    /// Temperature, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Charge drawn since its previous reading, in milliampere-hours, by a counter of its own.
    pub drawn_mah: Option<f32>,
}

impl From<ControllerReading> for Measurement {
    fn from(reading: ControllerReading) -> Self {
        let increment = |charge_mah: f32| {
            Counted::Increment(Consumed {
                charge_mah,
                energy_wh: charge_mah * 1e-3 * reading.voltage_v.unwrap_or(0.0),
            })
        };
        Self {
            voltage_v: reading.voltage_v,
            current_a: reading.current_a,
            temperature_c: reading.temperature_c,
            counted: reading.drawn_mah.map(increment),
            ..Self::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn charge_of_a_counter_is_an_increment_with_its_energy() {
        let reading = ControllerReading {
            voltage_v: Some(15.76),
            drawn_mah: Some(3.0),
            ..ControllerReading::default()
        };
        let Some(Counted::Increment(consumed)) = Measurement::from(reading).counted else {
            panic!("an increment");
        };
        assert_eq!(consumed.charge_mah, 3.0);
        assert!((consumed.energy_wh - 0.04728).abs() < 1e-6);
        assert_eq!(
            Measurement::from(ControllerReading::default()),
            Measurement::default()
        );
    }
}
