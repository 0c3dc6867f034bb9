//! The tables of parameters, their live values, and what of them is not in flash yet.
//!
//! Names, units and meanings are ArduPilot 4.6's, so that a ground station shows what its user expects.
//! As there, a pack that is not monitored has its other parameters hidden from lists.

mod baud;
#[cfg(not(target_os = "none"))]
pub mod documentation;
mod for_each;
mod id;
mod pack;
mod save_failures;
mod table;
mod unsaved;

pub use baud::serial_baud;
pub use for_each::ForEachParameter;
pub use id::{PARAMETER_COUNT, ParameterId};
pub use pack::Pack;
pub use save_failures::{SAVE_RETRY_INTERVAL_US, SaveFailures, save_failure_text};
pub use table::{BatteryParameter, Kind, Meaning, Parameter, Range, VehicleParameter, means};
#[cfg(not(target_os = "none"))]
pub use table::{Documentation, SimulationParameter, TakesEffect};
pub use unsaved::Unsaved;

use unsaved::Progress;

use crate::battery::MAX_PACKS;
use crate::rounding::round_to_i32;

/// The characters MAVLink has room for in a parameter's name.
pub const MAX_NAME_LENGTH: usize = 16;

/// A whole number that comes as a float may be off by this much, as in ArduPilot.
const WHOLE_NUMBER_TOLERANCE: f32 = 0.01;

/// `BATT_MONITOR`: the pack is not monitored.
const MONITOR_DISABLED: f32 = 0.0;

/// The live values of all parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    values: ForEachParameter<f32>,
    /// Of each value to flash.
    progress: ForEachParameter<Progress>,
    /// Of the last reset to flash.
    reset: Progress,
    flash: Flash,
}

/// What is known of the values in flash.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Flash {
    /// They are the live ones, where those are not unsaved or defaults.
    AsLive,
    /// They were not read, and may be any.
    Unread,
}

/// The parameter does not take this value.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct OutOfRange;

impl Parameters {
    /// Every parameter at its default.
    pub fn defaults() -> Self {
        Self {
            values: ForEachParameter::from_fn(ParameterId::default_value),
            progress: ForEachParameter::default(),
            reset: Progress::Saved,
            flash: Flash::AsLive,
        }
    }

    /// What is in flash is left unread, so whatever is set has to be written, a default too.
    pub fn leave_stored_unread(&mut self) {
        self.flash = Flash::Unread;
    }

    /// The live value, in the parameter's unit.
    pub fn get(&self, id: impl Into<ParameterId>) -> f32 {
        self.values.get(id.into())
    }

    /// The live value of a parameter that is a whole number, in the parameter's unit.
    pub fn get_whole(&self, id: impl Into<ParameterId>) -> i32 {
        self.whole(id.into())
    }

    #[inline(never)]
    fn whole(&self, id: ParameterId) -> i32 {
        round_to_i32(self.get(id))
    }

    /// Every parameter a ground station is shown, in the order of their indices: all but those of packs that are not
    /// monitored. What is not listed can be read and set all the same.
    pub fn listed(&self) -> impl Iterator<Item = ParameterId> {
        ParameterId::all().filter(|id| self.is_listed(*id))
    }

    /// How many of them there are.
    pub fn listed_count(&self) -> usize {
        let of_packs: usize = Pack::ALL.into_iter().map(|pack| self.listed_of(pack)).sum();
        PARAMETER_COUNT - MAX_PACKS * BatteryParameter::COUNT + of_packs
    }

    /// The place of a parameter among them; `None` if it is hidden.
    pub fn listed_index(&self, id: ParameterId) -> Option<usize> {
        if !self.is_listed(id) {
            return None;
        }
        let packs_before = match id {
            ParameterId::Vehicle(_) => 0,
            ParameterId::Battery(pack, _) => usize::from(pack.instance()),
            #[cfg(not(target_os = "none"))]
            ParameterId::Simulation(_) => MAX_PACKS,
        };
        let hidden_before: usize = Pack::ALL
            .into_iter()
            .take(packs_before)
            .map(|pack| BatteryParameter::COUNT - self.listed_of(pack))
            .sum();
        Some(id.number() - hidden_before)
    }

    /// How many of a pack's are listed: all, or its switch, which is the first.
    fn listed_of(&self, pack: Pack) -> usize {
        if self.is_monitored(pack) {
            BatteryParameter::COUNT
        } else {
            1
        }
    }

    /// Whether a pack is monitored by the live value of its `BATT_MONITOR`.
    pub fn is_monitored(&self, pack: Pack) -> bool {
        self.get(BatteryParameter::Monitor.of(pack)) != MONITOR_DISABLED
    }

    fn is_listed(&self, id: ParameterId) -> bool {
        match id {
            ParameterId::Vehicle(_) | ParameterId::Battery(_, BatteryParameter::Monitor) => true,
            #[cfg(not(target_os = "none"))]
            ParameterId::Simulation(_) => true,
            ParameterId::Battery(pack, _) => self.is_monitored(pack),
        }
    }

    /// Sets the live value; one that is not in flash still has to be saved.
    ///
    /// # Errors
    /// The parameter does not take this value; the old one stays.
    pub fn set(&mut self, id: impl Into<ParameterId>, value: f32) -> Result<(), OutOfRange> {
        let id = id.into();
        let value = accept(id, value)?;
        let is_saved = self.flash == Flash::AsLive
            && self.progress.get(id) == Progress::Saved
            && value.to_bits() == self.get(id).to_bits();
        if !is_saved {
            self.values.set(id, value);
            self.progress.set(id, Progress::New);
        }
        Ok(())
    }

    /// Sets the live value to one that was read from flash under `key`.
    ///
    /// # Errors
    /// No parameter has this key any more, or it does not take this value any more. The default stays.
    pub fn restore(&mut self, key: u16, value: f32) -> Result<(), OutOfRange> {
        let id = ParameterId::from_key(key).ok_or(OutOfRange)?;
        self.values.set(id, accept(id, value)?);
        Ok(())
    }
}

/// What a parameter becomes when it is set to `value`.
fn accept(id: ParameterId, value: f32) -> Result<f32, OutOfRange> {
    let row = id.row();
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

    const EXTRA1: ParameterId = ParameterId::Vehicle(VehicleParameter::Sr0Extra1);
    const VOLT_MULT: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::VoltMult);

    #[test]
    fn every_default_is_in_its_own_range() {
        let mut parameters = Parameters::defaults();
        for id in ParameterId::all() {
            assert_eq!(parameters.get(id), id.default_value(), "{}", id.name());
            assert_eq!(parameters.set(id, id.default_value()), Ok(()), "{}", id.name());
        }
        assert_eq!(parameters, Parameters::defaults());
    }

    /// Those of the vehicle, the first pack's, the others' switches, and the simulator's.
    const LISTED_BY_DEFAULT: usize =
        VehicleParameter::COUNT + BatteryParameter::COUNT + MAX_PACKS - 1 + SimulationParameter::COUNT;

    #[test]
    fn a_pack_that_is_not_monitored_is_hidden_but_for_its_switch() {
        let mut parameters = Parameters::defaults();
        assert_eq!(parameters.listed().count(), LISTED_BY_DEFAULT);
        for pack in Pack::ALL {
            parameters.set(BatteryParameter::Monitor.of(pack), 4.0).unwrap();
        }
        assert_eq!(parameters.listed().count(), PARAMETER_COUNT);
        for pack in Pack::ALL {
            parameters.set(BatteryParameter::Monitor.of(pack), 0.0).unwrap();
            let hidden = |id: &ParameterId| matches!(id, ParameterId::Battery(other, _) if *other == pack);
            let listed: Vec<_> = parameters.listed().filter(hidden).collect();
            assert_eq!(listed, [BatteryParameter::Monitor.of(pack)]);
        }
        assert_eq!(
            parameters.listed().count(),
            VehicleParameter::COUNT + MAX_PACKS + SimulationParameter::COUNT
        );
    }

    #[test]
    fn places_and_their_number_are_those_of_the_list_whichever_packs_are_monitored() {
        let mut parameters = Parameters::defaults();
        for monitored in [0b0_0000_0000, 0b1_1111_1111, 0b0_0000_0001, 0b1_0100_1010] {
            for pack in Pack::ALL {
                let monitor = if monitored & 1 << pack.instance() != 0 {
                    4.0
                } else {
                    0.0
                };
                parameters
                    .set(BatteryParameter::Monitor.of(pack), monitor)
                    .unwrap();
            }
            assert_eq!(parameters.listed_count(), parameters.listed().count());
            for id in ParameterId::all() {
                let place = parameters.listed().position(|listed| listed == id);
                assert_eq!(parameters.listed_index(id), place, "{}", id.name());
            }
        }
    }

    #[test]
    fn a_hidden_parameter_is_set_and_saved_like_any_other() {
        let mut parameters = Parameters::defaults();
        let hidden = BatteryParameter::VoltMult.of(Pack::Ninth);
        assert_eq!(parameters.set(hidden, 11.0), Ok(()));
        assert_eq!(parameters.get(hidden), 11.0);
        assert_eq!(parameters.next_unsaved(), Some(Unsaved::Value(hidden, 11.0)));
        assert_eq!(parameters.get(VOLT_MULT), 3.95);
    }

    #[test]
    fn a_value_out_of_range_changes_nothing() {
        let mut parameters = Parameters::defaults();
        for value in [-1.0, 51.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            assert_eq!(parameters.set(EXTRA1, value), Err(OutOfRange), "{value}");
            assert_eq!(parameters.get(EXTRA1), 2.0);
        }
        assert_eq!(
            parameters.set(BatteryParameter::Monitor.of(Pack::First), 1.0),
            Err(OutOfRange)
        );
        assert_eq!(parameters.next_unsaved(), None);
    }

    #[test]
    fn whole_numbers_are_truncated_as_ardupilot_does() {
        let mut parameters = Parameters::defaults();
        for (given, kept) in [(7.0, 7.0), (7.9, 7.0), (6.995, 7.0), (0.5, 0.0)] {
            assert_eq!(parameters.set(EXTRA1, given), Ok(()));
            assert_eq!(parameters.get(EXTRA1), kept, "{given}");
        }
    }

    #[test]
    fn a_stored_value_that_no_longer_fits_leaves_the_default() {
        let mut parameters = Parameters::defaults();
        assert_eq!(parameters.restore(3, 10.0), Ok(()));
        assert_eq!(parameters.restore(66, f32::NAN), Err(OutOfRange));
        assert_eq!(parameters.restore(9999, 1.0), Err(OutOfRange));
        assert_eq!(parameters.get(EXTRA1), 10.0);
        assert_eq!(parameters.get(VOLT_MULT), 3.95);
        assert_eq!(parameters.next_unsaved(), None);
    }

    proptest! {
        #[test]
        fn whatever_is_set_every_value_stays_in_its_range(
            changes in prop::collection::vec((0..PARAMETER_COUNT, any::<f32>(), -200.0f32..2000.0), 0..100),
        ) {
            let mut parameters = Parameters::defaults();
            for (number, wild, plausible) in changes {
                let id = ParameterId::all().nth(number).expect("there are as many");
                let _ = parameters.set(id, wild);
                let _ = parameters.set(id, plausible);
            }
            for id in ParameterId::all() {
                prop_assert!(id.row().range.contains(parameters.get(id)), "{}", id.name());
            }
        }
    }
}
