//! Voltages of single cells.

/// The most cells in series a pack can report: BATTERY_STATUS has room for 10 and 4 more.
pub const MAX_CELLS: usize = 14;

/// The voltage of each cell in series, from the negative end; empty when the sensor does not measure them.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CellVoltages {
    millivolts: [u16; MAX_CELLS],
    count: u8,
}

impl CellVoltages {
    /// None is measured.
    pub const NONE: Self = Self {
        millivolts: [0; MAX_CELLS],
        count: 0,
    };

    /// The cells of a pack, in millivolts. Cells beyond the 14th are left out.
    pub fn from_millivolts(cells: &[u16]) -> Self {
        let mut voltages = Self::NONE;
        for (to, from) in voltages.millivolts.iter_mut().zip(cells) {
            *to = *from;
            voltages.count += 1;
        }
        voltages
    }

    /// The cells that are measured, in millivolts.
    pub fn millivolts(&self) -> &[u16] {
        self.millivolts.get(..usize::from(self.count)).unwrap_or(&[])
    }

    /// How far the highest and the lowest cell are apart, in volts.
    pub fn imbalance_v(&self) -> Option<f32> {
        let cells = self.millivolts();
        let (lowest, highest) = (cells.iter().min()?, cells.iter().max()?);
        Some(f32::from(highest - lowest) / 1000.0)
    }

    /// The lowest cell's voltage, in volts.
    pub fn lowest_v(&self) -> Option<f32> {
        self.millivolts().iter().min().map(|mv| f32::from(*mv) / 1000.0)
    }
}

impl Default for CellVoltages {
    fn default() -> Self {
        Self::NONE
    }
}
