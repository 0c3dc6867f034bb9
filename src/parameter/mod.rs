//! The one table of parameters and their live values.
//!
//! Names, units and meanings are ArduPilot 4.6's, so that a ground station shows what its user expects.

mod table;

pub use table::{Parameter, ParameterId, TABLE};

use table::PARAMETER_COUNT;

/// The live values of all parameters, in RAM.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    values: [f32; PARAMETER_COUNT],
}

/// A value a parameter can't take.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct OutOfRange;

impl Parameters {
    /// Every parameter at its default.
    pub const fn defaults() -> Self {
        let mut values = [0.0; PARAMETER_COUNT];
        let mut index = 0;
        while index < PARAMETER_COUNT {
            values[index] = TABLE[index].default;
            index += 1;
        }
        Self { values }
    }

    /// The live value, in the parameter's unit.
    pub fn get(&self, id: ParameterId) -> f32 {
        self.values[id as usize]
    }

    /// Sets the live value.
    ///
    /// # Errors
    /// The value is not a number or outside the parameter's range; the old one stays.
    pub fn set(&mut self, id: ParameterId, value: f32) -> Result<(), OutOfRange> {
        let parameter = &TABLE[id as usize];
        // False for NaN too.
        if !(parameter.min..=parameter.max).contains(&value) {
            return Err(OutOfRange);
        }
        self.values[id as usize] = value;
        Ok(())
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

    #[test]
    fn every_default_lies_in_its_range_and_every_name_fits_mavlink() {
        let mut parameters = Parameters::defaults();
        for id in ParameterId::ALL {
            let row = &TABLE[id as usize];
            assert_eq!(row.id, id, "{} stands in another row", row.name);
            assert!(row.name.len() <= 16, "{}", row.name);
            assert_eq!(parameters.set(id, row.default), Ok(()), "{}", row.name);
        }
    }

    #[test]
    fn a_value_out_of_range_changes_nothing() {
        let mut parameters = Parameters::defaults();
        for value in [-1.0, 50.5, f32::NAN, f32::INFINITY] {
            assert_eq!(parameters.set(ParameterId::Sr0Extra1, value), Err(OutOfRange));
            assert_eq!(parameters.get(ParameterId::Sr0Extra1), 2.0);
        }
        assert_eq!(parameters.set(ParameterId::Sr0Extra1, 50.0), Ok(()));
        assert_eq!(parameters.get(ParameterId::Sr0Extra1), 50.0);
    }
}
