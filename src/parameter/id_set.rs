//! A set of parameters.

use super::{PARAMETER_COUNT, ParameterId};

/// Bytes that have a bit for each parameter.
const BYTES: usize = PARAMETER_COUNT.div_ceil(8);

/// A set of parameters: one bit each.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ParameterIdSet([u8; BYTES]);

impl ParameterIdSet {
    /// None of them.
    pub const EMPTY: Self = Self([0; BYTES]);

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
}

fn place(id: ParameterId) -> (usize, u8) {
    let number = id.number();
    (number / 8, 1 << (number % 8))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_parameter_is_added_by_itself() {
        for added in ParameterId::all() {
            let mut set = ParameterIdSet::EMPTY;
            set.insert(added);
            assert!(
                ParameterId::all().all(|id| set.contains(id) == (id == added)),
                "{}",
                added.name()
            );
        }
    }
}
