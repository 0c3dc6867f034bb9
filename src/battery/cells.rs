//! Cell voltages.

/// Maximum number of cells in series: BATTERY_STATUS has 10 fields and 4 in its extension.
pub const MAX_CELLS: usize = 14;

/// The voltage of each cell in series, from the negative end; empty if not measured.
#[derive(Clone, Copy, Debug, PartialEq)]
// Copied at every reading: by words.
#[repr(align(4))]
pub struct CellVoltages {
    millivolts: [u16; MAX_CELLS],
    count: u8,
}

impl CellVoltages {
    /// Not measured.
    pub const NONE: Self = Self {
        millivolts: [0; MAX_CELLS],
        count: 0,
    };

    /// From millivolts. Cells beyond the 14th are dropped.
    pub fn from_millivolts(cells: &[u16]) -> Self {
        let mut voltages = Self::NONE;
        for (to, from) in voltages.millivolts.iter_mut().zip(cells) {
            *to = *from;
            voltages.count += 1;
        }
        voltages
    }

    /// The measured cells, in millivolts.
    pub fn millivolts(&self) -> &[u16] {
        self.millivolts.get(..usize::from(self.count)).unwrap_or(&[])
    }

    /// Highest minus lowest cell voltage, in volts.
    pub fn imbalance_v(&self) -> Option<f32> {
        let cells = self.millivolts();
        let (lowest, highest) = (cells.iter().min()?, cells.iter().max()?);
        Some(f32::from(highest - lowest) / 1000.0)
    }

    /// The lowest cell voltage, in volts.
    pub fn lowest_v(&self) -> Option<f32> {
        self.millivolts().iter().min().map(|mv| f32::from(*mv) / 1000.0)
    }
}

impl Default for CellVoltages {
    fn default() -> Self {
        Self::NONE
    }
}
