//! The one table of parameters, their live values, and what of them is not in flash yet.
//!
//! Names, units and meanings are ArduPilot 4.6's, so that a ground station shows what its user expects.

mod baud;
#[cfg(not(target_os = "none"))]
pub mod documentation;
mod storage;
mod table;

pub use baud::serial_baud;
pub use storage::{ParameterStorage, StorageError, Stored};
pub use table::{Kind, PARAMETER_COUNT, Parameter, ParameterId, Range, TABLE, TakesEffect};

/// A whole number that comes as a float may be off by this much, as in ArduPilot.
const WHOLE_NUMBER_TOLERANCE: f32 = 0.01;

/// The live values of all parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    values: [f32; PARAMETER_COUNT],
    unsaved: [bool; PARAMETER_COUNT],
}

/// The parameter does not take this value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct OutOfRange;

impl Parameters {
    /// Every parameter at its default.
    pub fn defaults() -> Self {
        Self {
            values: core::array::from_fn(|row| TABLE[row].default),
            unsaved: [false; PARAMETER_COUNT],
        }
    }

    /// The live value, in the parameter's unit.
    pub fn get(&self, id: ParameterId) -> f32 {
        self.values[id as usize]
    }

    /// The live value of a parameter that is a whole number.
    pub fn get_whole(&self, id: ParameterId) -> i32 {
        self.get(id) as i32
    }

    /// Sets the live value; a new one still has to be saved.
    ///
    /// # Errors
    /// The parameter does not take this value; the old one stays.
    pub fn set(&mut self, id: ParameterId, value: f32) -> Result<(), OutOfRange> {
        let value = self.accept(id, value)?;
        if value.to_bits() != self.get(id).to_bits() {
            self.values[id as usize] = value;
            self.unsaved[id as usize] = true;
        }
        Ok(())
    }

    /// Sets the live value to one that was read from flash under `key`.
    ///
    /// # Errors
    /// No parameter has this key any more, or it does not take this value any more. The default stays.
    pub fn restore(&mut self, key: u16, value: f32) -> Result<(), OutOfRange> {
        let row = TABLE.iter().find(|row| row.key == key).ok_or(OutOfRange)?;
        self.values[row.id as usize] = self.accept(row.id, value)?;
        Ok(())
    }

    /// A parameter whose live value is not in flash yet, and that value.
    pub fn next_unsaved(&self) -> Option<(ParameterId, f32)> {
        let row = self.unsaved.iter().position(|unsaved| *unsaved)?;
        Some((TABLE[row].id, self.values[row]))
    }

    /// `value` is in flash now. If another one has been set meanwhile, that one still has to be saved.
    pub fn mark_saved(&mut self, id: ParameterId, value: f32) {
        self.unsaved[id as usize] = value.to_bits() != self.get(id).to_bits();
    }

    fn accept(&self, id: ParameterId, value: f32) -> Result<f32, OutOfRange> {
        let row = &TABLE[id as usize];
        let value = match row.kind {
            Kind::Real32 => value,
            Kind::Int8 | Kind::Int16 | Kind::Int32 => whole_number(value),
        };
        if row.range.contains(value) {
            Ok(value)
        } else {
            Err(OutOfRange)
        }
    }
}

/// Truncated, as ArduPilot does with values for whole-number parameters. NaN and infinity stay what they are.
fn whole_number(value: f32) -> f32 {
    let nudged = value
        + if value < 0.0 {
            -WHOLE_NUMBER_TOLERANCE
        } else {
            WHOLE_NUMBER_TOLERANCE
        };
    if nudged.is_finite() {
        nudged as i32 as f32
    } else {
        value
    }
}

impl Default for Parameters {
    fn default() -> Self {
        Self::defaults()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn every_row_is_in_its_place_and_fits_mavlink_and_its_own_range() {
        let mut parameters = Parameters::defaults();
        for (number, row) in TABLE.iter().enumerate() {
            assert_eq!(row.id as usize, number, "{} stands in another row", row.name);
            assert!((1..=16).contains(&row.name.len()), "{}", row.name);
            assert_eq!(parameters.set(row.id, row.default), Ok(()), "{}", row.name);
            let others = || TABLE.iter().filter(|other| other.id != row.id);
            assert!(others().all(|other| other.name != row.name), "{} twice", row.name);
            assert!(
                others().all(|other| other.key != row.key),
                "key {} twice",
                row.key
            );
        }
    }

    #[test]
    fn a_value_out_of_range_changes_nothing() {
        let mut parameters = Parameters::defaults();
        for value in [-1.0, 51.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            assert_eq!(
                parameters.set(ParameterId::Sr0Extra1, value),
                Err(OutOfRange),
                "{value}"
            );
            assert_eq!(parameters.get(ParameterId::Sr0Extra1), 2.0);
        }
        assert_eq!(parameters.set(ParameterId::BattMonitor, 1.0), Err(OutOfRange));
        assert_eq!(parameters.next_unsaved(), None);
    }

    #[test]
    fn whole_numbers_are_truncated_as_ardupilot_does() {
        let mut parameters = Parameters::defaults();
        for (given, kept) in [(7.0, 7.0), (7.9, 7.0), (6.995, 7.0), (0.5, 0.0)] {
            assert_eq!(parameters.set(ParameterId::Sr0Extra1, given), Ok(()));
            assert_eq!(parameters.get(ParameterId::Sr0Extra1), kept, "{given}");
        }
    }

    #[test]
    fn only_a_changed_value_has_to_be_saved_and_once() {
        let mut parameters = Parameters::defaults();
        parameters.set(ParameterId::Sr0Extra1, 2.0).unwrap();
        assert_eq!(parameters.next_unsaved(), None);
        parameters.set(ParameterId::Sr0Extra1, 5.0).unwrap();
        parameters.set(ParameterId::BattVoltMult, 4.0).unwrap();
        assert_eq!(parameters.next_unsaved(), Some((ParameterId::Sr0Extra1, 5.0)));
        parameters.mark_saved(ParameterId::Sr0Extra1, 5.0);
        assert_eq!(parameters.next_unsaved(), Some((ParameterId::BattVoltMult, 4.0)));
        parameters.mark_saved(ParameterId::BattVoltMult, 4.0);
        assert_eq!(parameters.next_unsaved(), None);
    }

    #[test]
    fn a_value_that_changes_while_it_is_saved_is_saved_again() {
        let mut parameters = Parameters::defaults();
        parameters.set(ParameterId::Sr0Extra1, 5.0).unwrap();
        parameters.set(ParameterId::Sr0Extra1, 6.0).unwrap();
        parameters.mark_saved(ParameterId::Sr0Extra1, 5.0);
        assert_eq!(parameters.next_unsaved(), Some((ParameterId::Sr0Extra1, 6.0)));
    }

    #[test]
    fn a_stored_value_that_no_longer_fits_leaves_the_default() {
        let mut parameters = Parameters::defaults();
        assert_eq!(parameters.restore(3, 10.0), Ok(()));
        assert_eq!(parameters.restore(66, f32::NAN), Err(OutOfRange));
        assert_eq!(parameters.restore(9999, 1.0), Err(OutOfRange));
        assert_eq!(parameters.get(ParameterId::Sr0Extra1), 10.0);
        assert_eq!(parameters.get(ParameterId::BattVoltMult), 3.95);
        assert_eq!(parameters.next_unsaved(), None);
    }

    proptest! {
        #[test]
        fn whatever_is_set_every_value_stays_in_its_range(
            changes in prop::collection::vec((0..PARAMETER_COUNT, any::<f32>(), -200.0f32..2000.0), 0..100),
        ) {
            let mut parameters = Parameters::defaults();
            for (row, wild, plausible) in changes {
                let _ = parameters.set(TABLE[row].id, wild);
                let _ = parameters.set(TABLE[row].id, plausible);
            }
            for row in &TABLE {
                prop_assert!(row.range.contains(parameters.get(row.id)), "{}", row.name);
            }
        }
    }
}
