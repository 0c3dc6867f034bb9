//! Masks and filters (4.5), and the way of a frame into a buffer (figure 4-3).

use super::super::super::super::can::{CanFrame, CanId};
use super::{BUKT, CANINTF, EXIDE, FILTERS, MASKS, RXB_CTRL, RXIF, RXM};

/// RXM: masks and filters off.
const ANY_MESSAGE: u8 = 0b11 << 5;
/// The filters of RXB0 come first.
const FILTERS_OF_FIRST: usize = 2;

/// What becomes of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Destination {
    /// No filter lets it through.
    Nowhere,
    /// Into this buffer, by this filter.
    Buffer(usize, usize),
    /// It is lost: the overflow flag of this buffer is set.
    Overflow(usize),
}

pub fn destination(registers: &[u8; 128], frame: &CanFrame) -> Destination {
    let at = |address: u8| registers[usize::from(address)];
    let is_full = |buffer: usize| at(CANINTF) & RXIF[buffer] != 0;
    if let Some(filter) = match_of(registers, 0, frame) {
        return match (is_full(0), at(RXB_CTRL[0]) & BUKT != 0, is_full(1)) {
            (false, _, _) => Destination::Buffer(0, filter),
            (true, true, false) => Destination::Buffer(1, filter),
            (true, true, true) => Destination::Overflow(1),
            (true, false, _) => Destination::Overflow(0),
        };
    }
    match match_of(registers, 1, frame) {
        Some(_) if is_full(1) => Destination::Overflow(1),
        Some(filter) => Destination::Buffer(1, filter),
        None => Destination::Nowhere,
    }
}

/// The first filter of a buffer that lets a frame through.
fn match_of(registers: &[u8; 128], buffer: usize, frame: &CanFrame) -> Option<usize> {
    let filters = match buffer {
        0 => 0..FILTERS_OF_FIRST,
        _ => FILTERS_OF_FIRST..FILTERS.len(),
    };
    if registers[usize::from(RXB_CTRL[buffer])] & RXM == ANY_MESSAGE {
        return Some(filters.start);
    }
    let mask = Pattern::at(registers, MASKS[buffer]);
    let matches = |filter: &usize| Pattern::at(registers, FILTERS[*filter]).matches(mask, frame);
    filters.into_iter().find(matches)
}

/// Four registers of a mask or a filter.
#[derive(Clone, Copy)]
struct Pattern {
    standard: u16,
    /// EID17 to EID0.
    extension: u32,
    is_extended: bool,
}

impl Pattern {
    fn at(registers: &[u8; 128], address: u8) -> Self {
        let start = usize::from(address);
        let [high, low, eid8, eid0] = registers[start..start + 4].try_into().expect("four");
        Self {
            standard: u16::from(high) << 3 | u16::from(low) >> 5,
            extension: u32::from(low & 0b11) << 16 | u32::from(eid8) << 8 | u32::from(eid0),
            is_extended: low & EXIDE != 0,
        }
    }

    fn matches(self, mask: Self, frame: &CanFrame) -> bool {
        // The first two bytes of standard frames, which could be compared, too (4.4), are not.
        let (is_extended, standard, extension, compared) = match frame.id {
            CanId::Extended(id) => (true, (id >> 18) as u16, id & 0x3_ffff, 0x3_ffff),
            CanId::Standard(id) => (false, id, 0, 0),
        };
        is_extended == self.is_extended
            && (standard ^ self.standard) & mask.standard == 0
            && (extension ^ self.extension) & mask.extension & compared == 0
    }
}
