//! A set of parameters, and a map from them to values.

use super::id::VARIABLE_COUNT;
use super::{PARAMETER_COUNT, ParameterId};
use crate::memory::checksum::file_crc32;

/// Bytes that have a bit for each parameter.
const BYTES: usize = PARAMETER_COUNT.div_ceil(8);

/// A set of parameters: one bit each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParameterIdSet([u8; BYTES]);

impl Default for ParameterIdSet {
    /// None of them.
    fn default() -> Self {
        Self([0; BYTES])
    }
}

impl ParameterIdSet {
    /// Whether it has `id`.
    pub fn contains(&self, id: ParameterId) -> bool {
        let (byte, bit) = place(id);
        self.0.get(byte).is_some_and(|bits| bits & bit != 0)
    }

    /// Adds `id`.
    pub fn insert(&mut self, id: ParameterId) {
        let (byte, bit) = place(id);
        // In bounds for every id, but an index would leave a panicking path.
        if let Some(bits) = self.0.get_mut(byte) {
            *bits |= bit;
        }
    }

    /// Adds all of `others`.
    pub fn insert_all(&mut self, others: &Self) {
        for (bits, others) in self.0.iter_mut().zip(others.0) {
            *bits |= others;
        }
    }

    /// Whether it has none.
    pub fn is_empty(&self) -> bool {
        self.0.iter().all(|bits| *bits == 0)
    }

    /// Removes one, which is returned.
    pub fn take_any(&mut self) -> Option<ParameterId> {
        if self.is_empty() {
            return None;
        }
        let id = ParameterId::all().find(|id| self.contains(*id))?;
        self.remove(id);
        Some(id)
    }

    /// Removes `id`.
    pub fn remove(&mut self, id: ParameterId) {
        let (byte, bit) = place(id);
        if let Some(bits) = self.0.get_mut(byte) {
            *bits &= !bit;
        }
    }

    /// Number of its parameters.
    pub(super) fn len(&self) -> usize {
        ones(self.0.iter().copied())
    }

    /// Number of its parameters that `others` does not have.
    pub(super) fn count_without(&self, others: &Self) -> usize {
        let pairs = self.0.iter().zip(others.0);
        ones(pairs.map(|(bits, others)| bits & !others))
    }

    /// Another one for another set.
    pub(super) fn checksum(&self) -> u32 {
        file_crc32(0, &self.0)
    }

    /// Number of its parameters before `id`.
    pub(super) fn count_before(&self, id: ParameterId) -> usize {
        let (byte, bit) = place(id);
        let beside = self.0.get(byte).map(|bits| bits & (bit - 1));
        ones(self.0.iter().copied().take(byte).chain(beside))
    }
}

fn ones(bytes: impl Iterator<Item = u8>) -> usize {
    bytes.map(|bits| bits.count_ones() as usize).sum()
}

fn place(id: ParameterId) -> (usize, u8) {
    let number = id.number();
    (number / 8, 1 << (number % 8))
}

/// One `T` for each parameter that is not constant.
#[derive(Clone, Debug, PartialEq)]
pub struct ForEachParameter<T>([T; VARIABLE_COUNT]);

impl<T: Copy + Default> ForEachParameter<T> {
    /// Initialised with `make` for each parameter.
    pub fn from_fn(make: impl Fn(ParameterId) -> T) -> Self {
        let mut all = Self::default();
        all.set_all(make);
        all
    }

    /// Sets each to `make` of its parameter.
    pub fn set_all(&mut self, make: impl Fn(ParameterId) -> T) {
        for id in ParameterId::all() {
            self.set(id, make(id));
        }
    }

    /// The value of `id`, of a constant the default.
    pub fn get(&self, id: ParameterId) -> T {
        self.0.get(id.number()).copied().unwrap_or_default()
    }

    /// Sets the value of `id`.
    pub fn set(&mut self, id: ParameterId, value: T) {
        if let Some(place) = self.0.get_mut(id.number()) {
            *place = value;
        }
    }
}

impl<T: Copy + Default> Default for ForEachParameter<T> {
    fn default() -> Self {
        Self([T::default(); VARIABLE_COUNT])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_parameter_is_added_by_itself() {
        for added in ParameterId::all() {
            let mut set = ParameterIdSet::default();
            set.insert(added);
            assert!(
                ParameterId::all().all(|id| set.contains(id) == (id == added)),
                "{}",
                added.name()
            );
        }
    }

    #[test]
    fn every_parameter_has_its_value() {
        let keys = ForEachParameter::from_fn(ParameterId::key);
        for id in ParameterId::all() {
            assert_eq!(keys.get(id), id.key(), "{}", id.name());
        }
    }
}
