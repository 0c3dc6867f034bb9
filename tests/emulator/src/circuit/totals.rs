//! Charge, energy and voltage over time, and the means of any stretch of it.

use super::super::clock::{CLK_SYS_HZ, Cycle};

/// Integrals over the time since the circuit was attached, at a moment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Totals {
    /// In cycles since power-up.
    pub at: Cycle,
    /// Charge that the pack has given, in coulombs.
    pub coulombs: f64,
    /// Charge by a current that is cut off at the ends of a monitor's range.
    pub shown_coulombs: f64,
    /// Energy that the pack has given at its terminals, in joules.
    pub joules: f64,
    /// Voltage at its terminals, times time.
    pub volt_seconds: f64,
}

/// The means of a stretch of time at the pack's terminals. Currents that discharge the pack are positive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Means {
    pub seconds: f64,
    pub volts: f64,
    pub amperes: f64,
    /// The mean of a current that is cut off at the ends of a monitor's range.
    pub shown_amperes: f64,
    /// The mean of voltage × current, which is not the product of the means.
    pub watts: f64,
}

impl Totals {
    /// The means since an earlier moment; `None` if no time has passed.
    pub fn since(self, earlier: Self) -> Option<Means> {
        let cycles = self.at.checked_sub(earlier.at).filter(|cycles| *cycles != 0)?;
        let seconds = cycles as f64 / CLK_SYS_HZ as f64;
        Some(Means {
            seconds,
            volts: (self.volt_seconds - earlier.volt_seconds) / seconds,
            amperes: (self.coulombs - earlier.coulombs) / seconds,
            shown_amperes: (self.shown_coulombs - earlier.shown_coulombs) / seconds,
            watts: (self.joules - earlier.joules) / seconds,
        })
    }
}

/// Voltage and current at the pack's terminals.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Terminals {
    pub volts: f64,
    /// Positive while the pack is discharged.
    pub amperes: f64,
}

/// The smallest and the largest of each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Extremes {
    pub least: Terminals,
    pub most: Terminals,
}

impl Extremes {
    pub const fn of(terminals: Terminals) -> Self {
        Self {
            least: terminals,
            most: terminals,
        }
    }

    pub fn include(&mut self, Terminals { volts, amperes }: Terminals) {
        self.least.volts = self.least.volts.min(volts);
        self.least.amperes = self.least.amperes.min(amperes);
        self.most.volts = self.most.volts.max(volts);
        self.most.amperes = self.most.amperes.max(amperes);
    }
}
