//! Pack data retained over a restart, in RAM that start-up code leaves alone.

use super::Chemistry;
use super::charge::{KnownCharge, Reference};
use super::consumption::Consumption;
use super::estimator::{EstimatorMemory, SetCells};
use super::swap::Doubt;
use crate::memory::retained::{is_sealed, seal};
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{BatteryParameter, Parameters};

/// Identifies this layout.
const MAGIC: u32 = u32::from_le_bytes(*b"BAT4");

const HEADER_WORDS: usize = 2;

/// Beside the sequence number: power was off since.
const WAS_OFF: u32 = 1 << 31;

const PACK_WORDS: usize = 12;
/// With the checksum as the last word.
const RECORD_WORDS: usize = HEADER_WORDS + PACK_WORDS * MAX_PACKS + 1;

/// Two records written alternately: a reset during a write leaves the other one valid.
pub type RetainedMemory = [RetainedRecord; 2];

/// Data of all packs with a sequence number and a checksum, as words.
#[derive(Clone, Copy, Debug)]
#[repr(transparent)]
pub struct RetainedRecord([u32; RECORD_WORDS]);

/// Source of a pack's readings since boot, by the parameters that take effect then: `BATT_MONITOR`, `BATT_I2C_ADDR`
/// and `BATT_CHANNEL`. Behind another source is another pack.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PackSource([u8; 3]);

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

impl PackSource {
    /// By a pack's parameters at boot.
    pub fn from_parameters(parameters: &Parameters, pack: Pack) -> Self {
        let source = [
            BatteryParameter::Monitor,
            BatteryParameter::I2cAddr,
            BatteryParameter::Channel,
        ];
        Self(source.map(|parameter| parameters.get_whole(parameter.of(pack)) as u8))
    }
}

impl RetainedRecord {
    /// An empty, invalid record.
    pub const BLANK: Self = Self([0; RECORD_WORDS]);

    fn new(sequence: u32, packs: &[PackMemory; MAX_PACKS]) -> Self {
        let mut record = [0; RECORD_WORDS];
        let (header, rest) = record.split_at_mut(HEADER_WORDS);
        header.copy_from_slice(&[MAGIC, sequence & !WAS_OFF]);
        for (words, pack) in rest.chunks_exact_mut(PACK_WORDS).zip(packs) {
            words.copy_from_slice(&pack.to_words());
        }
        seal(&mut record, MAGIC);
        Self(record)
    }

    /// A bit of RAM is lost.
    #[cfg(test)]
    pub(super) fn flip(&mut self, bit: usize) {
        self.0[bit / 32 % RECORD_WORDS] ^= 1 << (bit % 32);
    }

    /// The sequence number, if the record is valid.
    fn sequence(&self) -> Option<u32> {
        let word = self.0.get(1).filter(|_| is_sealed(&self.0, MAGIC));
        word.map(|word| word & !WAS_OFF)
    }

    fn packs(&self) -> [PackMemory; MAX_PACKS] {
        let mut packs = [PackMemory::default(); MAX_PACKS];
        let words = self.0.get(HEADER_WORDS..).unwrap_or(&[]);
        let was_off = self.0.get(1).is_some_and(|word| word & WAS_OFF != 0);
        for (pack, words) in packs.iter_mut().zip(words.as_chunks().0) {
            *pack = PackMemory::from_words(words);
            if was_off {
                pack.lose_power();
            }
        }
        packs
    }
}

/// The data of the newer valid record.
pub fn recall(memory: &RetainedMemory) -> Option<[PackMemory; MAX_PACKS]> {
    newest(memory).map(|(_, record)| record.packs())
}

/// Writes `packs` over the older record.
pub fn retain(memory: &mut RetainedMemory, packs: &[PackMemory; MAX_PACKS]) {
    let (sequence, older) = match newest(memory) {
        Some((0, record)) => (record.sequence().unwrap_or(0).wrapping_add(1), 1),
        Some((_, record)) => (record.sequence().unwrap_or(0).wrapping_add(1), 0),
        None => (0, 0),
    };
    if let Some(record) = memory.get_mut(older) {
        *record = RetainedRecord::new(sequence, packs);
    }
}

/// Power was off: another pack may be connected.
pub fn lose_power(memory: &mut RetainedMemory) {
    for record in memory {
        if let (Some(_), Some(word)) = (record.sequence(), record.0.get_mut(1)) {
            *word |= WAS_OFF;
            seal(&mut record.0, MAGIC);
        }
    }
}

fn newest(memory: &RetainedMemory) -> Option<(usize, &RetainedRecord)> {
    let [first, second] = memory;
    match (first.sequence(), second.sequence()) {
        // Sequence numbers wrap; the two are one apart.
        (Some(a), Some(b)) if b.wrapping_sub(a) & !WAS_OFF == 1 => Some((1, second)),
        (Some(_), _) => Some((0, first)),
        (None, Some(_)) => Some((1, second)),
        (None, None) => None,
    }
}

impl PackMemory {
    /// A count without a charge to compare it by is forgotten.
    fn lose_power(&mut self) {
        if self.estimate.reference.is_none() || self.doubt == Doubt::Rescaled {
            *self = Self::default();
        }
        self.doubt = Doubt::ContactLoss;
        self.is_too_hot = false;
    }

    fn to_words(self) -> [u32; PACK_WORDS] {
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

    fn from_words(words: &[u32; PACK_WORDS]) -> Self {
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
    use crate::battery::Consumed;
    use proptest::prelude::*;

    fn used(charge_mah: f32) -> [PackMemory; MAX_PACKS] {
        let mut packs = [PackMemory::default(); MAX_PACKS];
        packs[3].consumption.restart(Consumed {
            charge_mah,
            energy_wh: -2.5,
        });
        packs[3].estimate = EstimatorMemory {
            charge: Some(KnownCharge::set(0.625)),
            reference: Reference::from_words(0.625, [3.75, 0.01, -2.0].map(f32::to_bits)),
            estimated_for: Some((Chemistry::NiMh, Some(16))),
            detected_cells: Some(3),
            least_cells: 3,
        };
        packs[3].is_too_hot = true;
        packs[3].serial_number = Some(-7);
        packs[3].doubt = Doubt::ContactLoss;
        packs[4].doubt = Doubt::Rescaled;
        packs[3].source = PackSource([u8::MAX; 3]);
        packs
    }

    #[test]
    fn latest_record_is_recalled() {
        let mut memory = [RetainedRecord::BLANK; 2];
        assert_eq!(recall(&memory), None);
        for charge_mah in [1.0, 2.0, 3.0, 4.0] {
            retain(&mut memory, &used(charge_mah));
            assert_eq!(recall(&memory), Some(used(charge_mah)));
        }
    }

    #[test]
    fn any_other_monitor_address_or_channel_is_another_source() {
        let mut parameters = Parameters::defaults();
        let mut sources = vec![PackSource::from_parameters(&parameters, Pack::First)];
        for (parameter, value) in [
            (BatteryParameter::Monitor, 4.0),
            (BatteryParameter::Monitor, 32.0),
            (BatteryParameter::I2cAddr, 64.0),
            (BatteryParameter::I2cAddr, 119.0),
            (BatteryParameter::Channel, 3.0),
        ] {
            parameters.set(parameter.of(Pack::First), value).unwrap();
            let source = PackSource::from_parameters(&parameters, Pack::First);
            assert!(!sources.contains(&source), "{parameter:?} {value}");
            sources.push(source);
        }
    }

    #[test]
    fn torn_write_leaves_the_previous_record() {
        let mut memory = [RetainedRecord::BLANK; 2];
        retain(&mut memory, &used(1.0));
        retain(&mut memory, &used(2.0));
        let before = memory;
        retain(&mut memory, &used(3.0));
        let after = memory;
        let written = (0..2).find(|slot| before[*slot].0 != after[*slot].0).unwrap();
        for words in 1..RECORD_WORDS {
            let mut torn = before;
            torn[written].0[..words].copy_from_slice(&after[written].0[..words]);
            assert_eq!(recall(&torn), Some(used(2.0)), "after {words} words");
        }
    }

    #[test]
    fn sequence_numbers_wrap() {
        let mut memory = [
            RetainedRecord::new(WAS_OFF - 2, &used(1.0)),
            RetainedRecord::new(WAS_OFF - 1, &used(2.0)),
        ];
        for charge_mah in [3.0, 4.0, 5.0] {
            retain(&mut memory, &used(charge_mah));
            assert_eq!(recall(&memory), Some(used(charge_mah)));
        }
    }

    proptest! {
        #[test]
        fn arbitrary_words_are_no_record(words in prop::collection::vec(any::<u32>(), RECORD_WORDS)) {
            let mut record = RetainedRecord::BLANK;
            record.0.copy_from_slice(&words);
            prop_assert!(recall(&[record, record]).is_none());
        }
    }
}
