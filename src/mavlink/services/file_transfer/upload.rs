//! The packed parameters as a file that is written: each is set when its last byte comes, but `SYSID_THISMAV` at the end.

use core::fmt::{self, Formatter};

use heapless::{String, Vec};

use super::packed::{HEADER_BYTES, MAGIC, MAX_HEAD_BYTES, MAX_VALUE_BYTES, PackedType};
use crate::numbers::text;
use crate::parameter::{
    Access, BatteryParameter, Bearing, MAX_NAME_LENGTH, NamedParameter, ParameterId, ParameterIdSet,
    Parameters, VehicleParameter, checked,
};

const SYSTEM_ID: ParameterId = ParameterId::Vehicle(VehicleParameter::SysidThismav);

/// A header or a record, whichever is longer.
const PENDING_BYTES: usize = MAX_HEAD_BYTES + MAX_VALUE_BYTES;

/// Names that are listed of those that are refused.
const LISTED_NAMES: usize = 5;

/// The longest text about what was not set.
const NOT_SET_BYTES: usize = "Parameters not set:".len()
    + LISTED_NAMES * (" (but ), ".len() + 2 * MAX_NAME_LENGTH)
    + " 65530 more, 65535 unknown".len();

/// Pins, and the factor of each: with another pin it makes a plausible value of anything.
const FACTORS: [(BatteryParameter, BatteryParameter); 3] = [
    (BatteryParameter::VoltPin, BatteryParameter::VoltMult),
    (BatteryParameter::CurrPin, BatteryParameter::AmpPervlt),
    (BatteryParameter::FlPin, BatteryParameter::FlVMult),
];

/// A file of parameters on its way here.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Upload {
    /// Number of received bytes.
    position: u32,
    expected: Option<Expected>,
    /// Received part of the header or record that is not complete.
    pending: Vec<u8, PENDING_BYTES>,
    name_before: Vec<u8, MAX_NAME_LENGTH>,
    records: u16,
    /// The new system id, to be set at the end.
    system_id: Option<f32>,
    not_set: NotSet,
}

/// Parameters that a file has not set.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct NotSet {
    /// The first that are known here, and were refused.
    refused: Vec<ParameterId, LISTED_NAMES>,
    more_refused: u16,
    unknown: u16,
    /// Parameters that were set.
    set: ParameterIdSet,
}

impl NotSet {
    fn refuse(&mut self, id: ParameterId) {
        if self.refused.push(id).is_err() {
            self.more_refused = self.more_refused.saturating_add(1);
        }
    }

    /// The text about them: names first, since the file of another rover has a thousand that are unknown.
    pub fn text(&self) -> String<NOT_SET_BYTES> {
        // It has room for everything.
        text(format_args!("{}", fmt::from_fn(|f| self.write(f))))
    }

    fn write(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let mut separator = ":";
        f.write_str("Parameters not set")?;
        for id in &self.refused {
            write!(f, "{separator} {}", id.name())?;
            separator = ",";
            if let Some(factor) = factor_of(*id).filter(|factor| self.set.contains(*factor)) {
                write!(f, " (but {})", factor.name())?;
            }
        }
        for (count, what) in [(self.more_refused, "more"), (self.unknown, "unknown")] {
            if count > 0 {
                write!(f, "{separator} {count} {what}")?;
                separator = ",";
            }
        }
        Ok(())
    }
}

/// The factor of a pin.
fn factor_of(pin: ParameterId) -> Option<ParameterId> {
    let ParameterId::Battery(pack, pin) = pin else {
        return None;
    };
    let (_, factor) = FACTORS.into_iter().find(|(of_pin, _)| *of_pin == pin)?;
    Some(factor.of(pack))
}

/// The header's content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Expected {
    records: u16,
    bytes: u16,
}

/// Why a block was not taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum BlockError {
    /// There is a gap before it: the blocks in between have to come first.
    TooEarly,
    /// The file is not one of parameters. What was set before is.
    BadFormat,
}

impl Upload {
    /// Takes a block that belongs at `offset`, and calls `on_set` for each parameter that it sets. Bytes that have come before
    /// are skipped, since a block is sent again when its answer is lost.
    ///
    /// # Errors
    /// The block was not taken, or only in part.
    pub fn write(
        &mut self,
        offset: u32,
        bytes: impl Iterator<Item = u8>,
        parameters: &mut Parameters,
        mut on_set: impl FnMut(ParameterId),
    ) -> Result<(), BlockError> {
        let Some(known) = self.position.checked_sub(offset) else {
            return Err(BlockError::TooEarly);
        };
        for byte in bytes.skip(known as usize) {
            self.position += 1;
            if let Some(id) = self.take(byte, parameters)? {
                on_set(id);
            }
        }
        Ok(())
    }

    /// Takes a byte, and returns the parameter that it sets.
    fn take(&mut self, byte: u8, parameters: &mut Parameters) -> Result<Option<ParameterId>, BlockError> {
        self.pending.push(byte).map_err(|_| BlockError::BadFormat)?;
        if self.expected.is_none() {
            self.take_header()?;
            return Ok(None);
        }
        if self.pending.as_slice() == [0] {
            // No record begins with 0, which is put between them.
            self.pending.clear();
        }
        self.take_record(parameters)
    }

    fn take_header(&mut self) -> Result<(), BlockError> {
        let Ok([a, b, c, d, e, f]) = <[u8; HEADER_BYTES]>::try_from(self.pending.as_slice()) else {
            return Ok(());
        };
        if u16::from_le_bytes([a, b]) != MAGIC {
            return Err(BlockError::BadFormat);
        }
        self.expected = Some(Expected {
            records: u16::from_le_bytes([c, d]),
            bytes: u16::from_le_bytes([e, f]),
        });
        self.pending.clear();
        Ok(())
    }

    /// Takes the record that is pending if it is complete.
    fn take_record(&mut self, parameters: &mut Parameters) -> Result<Option<ParameterId>, BlockError> {
        let [type_and_flags, lengths, rest @ ..] = self.pending.as_slice() else {
            return Ok(None);
        };
        let packed_type = PackedType::from_number(*type_and_flags).ok_or(BlockError::BadFormat)?;
        let own_bytes = usize::from(lengths >> 4) + 1;
        if rest.len() < own_bytes + packed_type.value_bytes() {
            return Ok(None);
        }
        let (own, value) = rest.split_at_checked(own_bytes).ok_or(BlockError::BadFormat)?;
        let value = packed_type.unpack(value);
        let common_bytes = usize::from(lengths & 0xf);
        if common_bytes > self.name_before.len() {
            return Err(BlockError::BadFormat);
        }
        self.name_before.truncate(common_bytes);
        self.name_before
            .extend_from_slice(own)
            .map_err(|_| BlockError::BadFormat)?;
        self.pending.clear();
        self.records = self.records.saturating_add(1);
        let set = self.set(value, parameters);
        parameters.follow_file(self.records, &self.not_set.set);
        Ok(set)
    }

    /// Sets the parameter whose name has come. What only shows or triggers something is not a setting, and is left out.
    fn set(&mut self, value: f32, parameters: &mut Parameters) -> Option<ParameterId> {
        let Some(named) = NamedParameter::from_name(&self.name_before) else {
            self.not_set.unknown = self.not_set.unknown.saturating_add(1);
            return None;
        };
        let (id, value) = (named.id, named.to_own(value));
        let Access::Setting(bearing) = id.row().access else {
            return None;
        };
        if id == SYSTEM_ID
            && let Ok(system_id) = checked(id, value)
        {
            self.system_id = Some(system_id);
            return None;
        }
        if parameters.set(id, value).is_err() {
            self.not_set.refuse(id);
            return None;
        }
        if bearing == Bearing::Drive {
            let announced = self.expected.map_or(0, |expected| expected.records);
            parameters.set_by_file(id, announced);
        }
        self.not_set.set.insert(id);
        Some(id)
    }

    /// Ends a file that is complete: sets the system id if it had one.
    pub fn end(&self, parameters: &mut Parameters) {
        if let Some(system_id) = self.system_id {
            // It was in range when it came.
            let _ = parameters.set(SYSTEM_ID, system_id);
        }
        parameters.end_file(self.records, &self.not_set.set);
    }

    /// Whether all has come that the header says.
    pub fn is_complete(&self) -> bool {
        self.pending.is_empty()
            && self.expected.is_some_and(|expected| {
                expected.records == self.records && u32::from(expected.bytes) == self.position
            })
    }

    /// Parameters that the file has not set, if there are any.
    pub fn not_set(&self) -> Option<&NotSet> {
        let not_set = &self.not_set;
        (!not_set.refused.is_empty() || not_set.unknown > 0).then_some(not_set)
    }
}

#[cfg(test)]
mod tests;
