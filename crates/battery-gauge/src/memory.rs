//! What is retained of a pack over a restart, in RAM that start-up code leaves alone.

use crate::Chemistry;
use crate::charge::{KnownCharge, Reference};
use crate::consumption::Consumption;
use crate::estimator::{EstimatorMemory, SetCells};
use crate::swap::Doubt;

/// Words of a [`PackMemory`].
pub const PACK_WORDS: usize = 12;

/// Identifies what a pack is measured by, as its owner numbers it: kind of monitor, address, channel. Behind another source is
/// another pack.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PackSource(pub [u8; 3]);

/// Retained data of one pack.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct PackMemory {
    /// Source of the data.
    pub source: PackSource,
    pub(super) consumption: Consumption,
    pub(super) estimate: EstimatorMemory,
    /// Whether that may be of another pack than the one that is connected.
    pub(super) doubt: Doubt,
    /// Reported by a smart battery.
    pub(super) serial_number: Option<i32>,
    /// Whether the pack was too hot when its temperature was known last.
    pub(super) is_too_hot: bool,
}

/// Bits beside the fewest cells.
const HAS_CHARGE: u8 = 1;
const IS_TOO_HOT: u8 = 1 << 1;
const LEAST_CELLS_SHIFT: u32 = 2;

/// Bits beside the source.
const HAS_SERIAL_NUMBER: u8 = 1;
const DOUBT_SHIFT: u32 = 1;
const DOUBTS: [Doubt; 4] = [Doubt::None, Doubt::ShortLoss, Doubt::ContactLoss, Doubt::Rescaled];

impl PackMemory {
    /// Power was off: another pack may be connected. A count without a charge to compare it by is forgotten.
    pub fn lose_power(&mut self) {
        if self.estimate.reference.is_none() || self.doubt == Doubt::Rescaled {
            *self = Self::default();
        }
        self.doubt = Doubt::ContactLoss;
        self.is_too_hot = false;
    }

    /// As words, of which a checksum is kept beside them.
    pub fn to_words(self) -> [u32; PACK_WORDS] {
        let [charge_low, charge_high, energy_low, energy_high] = self.consumption.to_words();
        let EstimatorMemory {
            charge,
            reference,
            estimated_for,
            detected_cells,
            least_cells,
        } = self.estimate;
        let [soc, sigma] = charge.map_or([0; 2], KnownCharge::to_words);
        let has_charge = u8::from(charge.is_some()) * HAS_CHARGE;
        let is_too_hot = u8::from(self.is_too_hot) * IS_TOO_HOT;
        let flags = has_charge | is_too_hot | least_cells << LEAST_CELLS_SHIFT;
        let [chemistry, cells] = estimated_for.map_or([0; 2], bytes_of);
        let [monitor, address, channel] = self.source.0;
        let [cell_v, sigma_v, slow_a] = reference.map_or([0; 3], Reference::to_words);
        let doubt = (self.doubt as u8) << DOUBT_SHIFT;
        let has_serial_number = u8::from(self.serial_number.is_some()) * HAS_SERIAL_NUMBER;
        [
            charge_low,
            charge_high,
            energy_low,
            energy_high,
            soc,
            sigma,
            u32::from_le_bytes([detected_cells.unwrap_or(0), flags, chemistry, cells]),
            u32::from_le_bytes([monitor, address, channel, doubt | has_serial_number]),
            self.serial_number.unwrap_or(0) as u32,
            cell_v,
            sigma_v,
            slow_a,
        ]
    }

    /// From the words of the same version, if their checksum is valid.
    pub fn from_words(words: &[u32; PACK_WORDS]) -> Self {
        let &[
            charge_low,
            charge_high,
            energy_low,
            energy_high,
            soc,
            sigma,
            estimate,
            source,
            serial_number,
            cell_v,
            sigma_v,
            slow_a,
        ] = words;
        let [detected_cells, flags, chemistry, cells] = estimate.to_le_bytes();
        let [monitor, address, channel, bits] = source.to_le_bytes();
        let charge = (flags & HAS_CHARGE != 0)
            .then(|| KnownCharge::from_words([soc, sigma]))
            .flatten();
        Self {
            source: PackSource([monitor, address, channel]),
            consumption: Consumption::from_words([charge_low, charge_high, energy_low, energy_high]),
            estimate: EstimatorMemory {
                charge,
                reference: charge
                    .and_then(|charge| Reference::from_words(charge.soc, [cell_v, sigma_v, slow_a])),
                estimated_for: cells_of([chemistry, cells]),
                detected_cells: (detected_cells > 0).then_some(detected_cells),
                least_cells: flags >> LEAST_CELLS_SHIFT,
            },
            doubt: DOUBTS
                .get(usize::from(bits >> DOUBT_SHIFT))
                .copied()
                .unwrap_or_default(),
            serial_number: (bits & HAS_SERIAL_NUMBER != 0).then_some(serial_number as i32),
            is_too_hot: flags & IS_TOO_HOT != 0,
        }
    }
}

fn bytes_of((chemistry, cells): SetCells) -> [u8; 2] {
    [chemistry as u8, cells.unwrap_or(0)]
}

fn cells_of([chemistry, cells]: [u8; 2]) -> Option<SetCells> {
    let chemistry = Chemistry::from_number(chemistry.into())?;
    Some((chemistry, (cells > 0).then_some(cells)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Consumed;

    #[test]
    fn words_restore_all_that_is_kept() {
        let mut memory = PackMemory {
            source: PackSource([u8::MAX; 3]),
            estimate: EstimatorMemory {
                charge: Some(KnownCharge::set(0.625)),
                reference: Reference::from_words(0.625, [3.75, 0.01, -2.0].map(f32::to_bits)),
                estimated_for: Some((Chemistry::NiMh, Some(16))),
                detected_cells: Some(3),
                least_cells: 3,
            },
            is_too_hot: true,
            serial_number: Some(-7),
            ..PackMemory::default()
        };
        memory.consumption.restart(Consumed {
            charge_mah: 1234.5,
            energy_wh: -2.5,
        });
        for doubt in DOUBTS {
            memory.doubt = doubt;
            assert_eq!(PackMemory::from_words(&memory.to_words()), memory);
        }
        let empty = PackMemory::default();
        assert_eq!(PackMemory::from_words(&empty.to_words()), empty);
    }
}
