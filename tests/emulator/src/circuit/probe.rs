//! Probes, sensors and meters at the pack's terminals.

use super::totals::{Means, Terminals, Totals};

/// A voltage that follows the circuit, for an input of a converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Probe {
    /// A divider at the pack's voltage, of which it leaves this share.
    Voltage(f64),
    /// A sensor of the pack's current.
    Current(CurrentSensor),
}

/// A current sensor with a voltage output.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentSensor {
    pub volts_per_ampere: f64,
    /// Its output without a current.
    pub offset_v: f64,
    pub range: SensorRange,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SensorRange {
    /// Linear through zero, as a Hall sensor whose output is half of its supply at 0 A (ACS712).
    BothWays,
    /// A current into the pack shows as none, as with a shunt amplifier for one direction.
    FromZero,
}

impl Probe {
    pub fn volts(self, Terminals { volts, amperes }: Terminals) -> f64 {
        match self {
            Self::Voltage(share) => share * volts,
            Self::Current(sensor) => sensor.volts(amperes),
        }
    }
}

impl CurrentSensor {
    fn volts(self, amperes: f64) -> f64 {
        let shown = match self.range {
            SensorRange::BothWays => amperes,
            SensorRange::FromZero => amperes.max(0.0),
        };
        self.offset_v + self.volts_per_ampere * shown
    }
}

/// Looks at a circuit from time to time.
#[derive(Clone, Copy, Debug, Default)]
pub struct Meter {
    before: Option<Totals>,
}

impl Meter {
    /// The means since the look before.
    pub fn means(&mut self, totals: Totals) -> Option<Means> {
        let before = self.before.replace(totals)?;
        totals.since(before)
    }
}
