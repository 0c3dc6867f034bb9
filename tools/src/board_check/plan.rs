//! The owner's requests.

use object::LittleEndian;
use object::elf::{FileHeader32, PT_LOAD};
use object::read::elf::{FileHeader, ProgramHeader};
use rover_battmon::memory::identity::FirmwareHash;

use super::evidence::{Divider, Evidence, Trial};

/// Reading of a multimeter at the pack.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Multimeter {
    /// There is none.
    #[default]
    None,
    /// The owner is asked.
    Ask,
    /// This many volts.
    Shows(f32),
}

/// The requested procedures.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Plan {
    /// Provoke a fault.
    pub provoke_fault: bool,
    /// Turn the wheels.
    pub turn_motors: bool,
    /// Compare the voltage with a multimeter's.
    pub multimeter: Multimeter,
    /// Set the exact `BATT_VOLT_MULT`, instead of only reporting it.
    pub apply_calibration: bool,
    /// Whether any factor is believed.
    pub divider: Divider,
    /// The firmware's hash, if it has to be a certain one.
    pub firmware_hash: Option<FirmwareHash>,
}

impl Plan {
    /// Knowledge before anything is done.
    pub(super) fn nothing_yet(&self) -> Evidence {
        Evidence {
            expected_hash: self.firmware_hash,
            fault: asked(self.provoke_fault),
            motors: asked(self.turn_motors),
            loads: asked(self.turn_motors),
            calibration: asked(self.multimeter != Multimeter::None),
            ..Evidence::default()
        }
    }
}

fn asked<T>(is_asked: bool) -> Trial<T> {
    if is_asked {
        Trial::NotReached
    } else {
        Trial::NotAsked
    }
}

/// The hash that the firmware in an ELF file reports; `None` if the file is damaged or has no program.
pub fn hash_of_elf(file: &[u8]) -> Option<FirmwareHash> {
    let header = FileHeader32::<LittleEndian>::parse(file).ok()?;
    let endian = header.endian().ok()?;
    let mut segments = Vec::new();
    for segment in header.program_headers(endian, file).ok()? {
        let bytes = segment.data(endian, file).ok()?;
        if segment.p_type(endian) == PT_LOAD {
            segments.push((segment.p_paddr(endian), bytes));
        }
    }
    segments.sort_by_key(|(address, _)| *address);
    let program = segments.iter().flat_map(|(_, segment)| *segment).copied();
    let program: Vec<u8> = program.collect();
    let (words, rest) = program.as_chunks();
    let is_whole = !words.is_empty() && rest.is_empty();
    is_whole.then(|| FirmwareHash::of(words.iter().copied().map(u32::from_le_bytes)))
}
