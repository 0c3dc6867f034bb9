//! The packed parameters as a file that is written: each is set when its last byte comes, but `SYSID_THISMAV` at the end.

use core::fmt::Write;

use heapless::{String, Vec};

use super::packed::{HEADER_BYTES, MAGIC, MAX_HEAD_BYTES, MAX_VALUE_BYTES, PackedType};
use crate::parameter::{Access, MAX_NAME_LENGTH, ParameterId, Parameters, VehicleParameter, checked};

const SYSTEM_ID: ParameterId = ParameterId::Vehicle(VehicleParameter::SysidThismav);

/// A header or a record, whichever is longer.
const PENDING_BYTES: usize = MAX_HEAD_BYTES + MAX_VALUE_BYTES;

/// Names that are listed of those that were not set.
const LISTED_NAMES: usize = 5;

/// The longest text about what was not set.
const NOT_SET_BYTES: usize =
    "Parameters not set".len() + LISTED_NAMES * (", ".len() + MAX_NAME_LENGTH) + " and 65530 more".len();

/// A file of parameters on its way here.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Upload {
    /// How many bytes have come.
    position: u32,
    expected: Option<Expected>,
    /// What has come of the header or record that is not complete.
    pending: Vec<u8, PENDING_BYTES>,
    name_before: Vec<u8, MAX_NAME_LENGTH>,
    records: u16,
    /// The new system id, to be set at the end.
    system_id: Option<f32>,
    not_set: NotSet,
}

/// The parameters of a file that do not exist or were out of range: how many, and the names of the first.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct NotSet {
    count: u16,
    names: Vec<Vec<u8, MAX_NAME_LENGTH>, LISTED_NAMES>,
}

impl NotSet {
    fn add(&mut self, name: &Vec<u8, MAX_NAME_LENGTH>) {
        self.count = self.count.saturating_add(1);
        // Those that come later are counted only.
        let _ = self.names.push(name.clone());
    }

    /// The text about them. Any bytes may have come as a name.
    pub fn text(&self) -> String<NOT_SET_BYTES> {
        let mut text = String::new();
        // It has room for all names.
        let _ = text.push_str("Parameters not set");
        for (place, name) in self.names.iter().enumerate() {
            let _ = text.push_str(if place == 0 { ": " } else { ", " });
            for byte in name {
                let _ = text.push(if byte.is_ascii_graphic() {
                    char::from(*byte)
                } else {
                    '?'
                });
            }
        }
        match usize::from(self.count) - self.names.len() {
            0 => {}
            more => {
                let _ = write!(text, " and {more} more");
            }
        }
        text
    }
}

/// What the header says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Expected {
    records: u16,
    bytes: u16,
}

/// Result of a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Written {
    /// It was taken, now or before.
    Taken,
    /// There is a gap before it: the blocks in between have to come first.
    TooEarly,
}

/// The file is not in the format.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct BadFormat;

impl Upload {
    /// Takes a block that belongs at `offset`, and calls `on_set` for each parameter that it sets. Bytes that have come before
    /// are skipped, since a block is sent again when its answer is lost.
    ///
    /// # Errors
    /// This is not a file of parameters. What was set before is.
    pub fn write(
        &mut self,
        offset: u32,
        bytes: impl Iterator<Item = u8>,
        parameters: &mut Parameters,
        mut on_set: impl FnMut(ParameterId),
    ) -> Result<Written, BadFormat> {
        let Some(known) = self.position.checked_sub(offset) else {
            return Ok(Written::TooEarly);
        };
        for byte in bytes.skip(known as usize) {
            self.position += 1;
            if let Some(id) = self.take(byte, parameters)? {
                on_set(id);
            }
        }
        Ok(Written::Taken)
    }

    /// Takes a byte, and returns the parameter that it sets.
    fn take(&mut self, byte: u8, parameters: &mut Parameters) -> Result<Option<ParameterId>, BadFormat> {
        self.pending.push(byte).map_err(|_| BadFormat)?;
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

    fn take_header(&mut self) -> Result<(), BadFormat> {
        let Ok([a, b, c, d, e, f]) = <[u8; HEADER_BYTES]>::try_from(self.pending.as_slice()) else {
            return Ok(());
        };
        if u16::from_le_bytes([a, b]) != MAGIC {
            return Err(BadFormat);
        }
        self.expected = Some(Expected {
            records: u16::from_le_bytes([c, d]),
            bytes: u16::from_le_bytes([e, f]),
        });
        self.pending.clear();
        Ok(())
    }

    /// Takes the record that is pending if it is complete.
    fn take_record(&mut self, parameters: &mut Parameters) -> Result<Option<ParameterId>, BadFormat> {
        let [type_and_flags, lengths, rest @ ..] = self.pending.as_slice() else {
            return Ok(None);
        };
        let packed_type = PackedType::from_number(*type_and_flags).ok_or(BadFormat)?;
        let own_bytes = usize::from(lengths >> 4) + 1;
        if rest.len() < own_bytes + packed_type.value_bytes() {
            return Ok(None);
        }
        let (own, value) = rest.split_at_checked(own_bytes).ok_or(BadFormat)?;
        let value = packed_type.unpack(value);
        let common_bytes = usize::from(lengths & 0xf);
        if common_bytes > self.name_before.len() {
            return Err(BadFormat);
        }
        self.name_before.truncate(common_bytes);
        self.name_before.extend_from_slice(own).map_err(|_| BadFormat)?;
        self.pending.clear();
        self.records = self.records.saturating_add(1);
        Ok(self.set(value, parameters))
    }

    /// Sets the parameter whose name has come. What only shows or triggers something is not a setting, and is left out.
    fn set(&mut self, value: f32, parameters: &mut Parameters) -> Option<ParameterId> {
        let Some(id) = ParameterId::from_name(&self.name_before) else {
            self.not_set.add(&self.name_before);
            return None;
        };
        if id.row().access != Access::Setting {
            return None;
        }
        let set = match checked(id, value) {
            Ok(system_id) if id == SYSTEM_ID => {
                self.system_id = Some(system_id);
                return None;
            }
            _ => parameters.set(id, value),
        };
        if set.is_err() {
            self.not_set.add(&self.name_before);
        }
        set.ok().map(|()| id)
    }

    /// Sets the system id if the file had one.
    pub fn set_system_id(&self, parameters: &mut Parameters) {
        if let Some(system_id) = self.system_id {
            // It was in range when it came.
            let _ = parameters.set(SYSTEM_ID, system_id);
        }
    }

    /// Whether all has come that the header says.
    pub fn is_complete(&self) -> bool {
        self.pending.is_empty()
            && self.expected.is_some_and(|expected| {
                expected.records == self.records && u32::from(expected.bytes) == self.position
            })
    }

    /// The parameters that do not exist or were out of range, if there were any.
    pub fn not_set(&self) -> Option<&NotSet> {
        (self.not_set.count > 0).then_some(&self.not_set)
    }
}

#[cfg(test)]
mod tests;
