//! The live values of all parameters.

use core::iter;

use battery_gauge::Chemistry;

use super::stick_channel::Sticks;
use super::table::THERMOMETER_DISABLED;
use super::trouble::{CHECKED, Doubts, HalfFile};
use super::{
    Access, BatteryParameter, Bearing, ForEachParameter, Kind, Listed, MonitorInput, MonitorKind,
    ParameterId, ParameterIdSet, ThermometerParameter, VehicleParameter,
};
use crate::memory::storage::StorageError;
use crate::numbers::round_to_i32;
use crate::pack::Pack;

/// Tolerance of a whole number received as a float, as in ArduPilot.
const WHOLE_NUMBER_TOLERANCE: f32 = 0.01;

/// `BATT_MONITOR` of a disabled pack.
const MONITOR_DISABLED: f32 = 0.0;

/// `CAN_P1_DRIVER` without a bus.
const CAN_DISABLED: f32 = 0.0;

/// The live parameters of one pack: [`Parameters::pack`].
#[derive(Clone, Copy, Debug)]
pub struct PackParameters<'a> {
    /// Those of all.
    pub all: &'a Parameters,
    /// The pack.
    pub pack: Pack,
}

impl PackParameters<'_> {
    /// The value, in the parameter's unit.
    pub fn get(self, parameter: BatteryParameter) -> f32 {
        self.all.get(parameter.of(self.pack))
    }

    /// The value of a whole number or bit mask.
    pub fn get_whole(self, parameter: BatteryParameter) -> i32 {
        self.all.get_whole(parameter.of(self.pack))
    }

    /// Whether its owner has set a point of a curve (`BATT_CURVE_10` to `BATT_CURVE_90`).
    fn has_curve(self) -> bool {
        BatteryParameter::CURVE
            .iter()
            .any(|point| self.get(*point) != 0.0)
    }

    /// Cell chemistry (`BATT_CHEM`).
    pub fn chemistry(self) -> Chemistry {
        Chemistry::from_number(self.get_whole(BatteryParameter::Chem)).unwrap_or_default()
    }

    /// The value where 0 is disabled or not set.
    pub fn above_zero(self, parameter: BatteryParameter) -> Option<f32> {
        Some(self.get(parameter)).filter(|value| *value > 0.0)
    }
}

/// The live values of all parameters.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameters {
    values: ForEachParameter<f32>,
    /// Changes of values (wraps).
    revision: Revision,
    /// Parameters whose values have to be written.
    pub(super) unsaved: ParameterIdSet,
    /// The failed ones among them, until a retry.
    pub(super) waiting: ParameterIdSet,
    /// Parameters whose stored values do not fit, and stay until others are to be written.
    pub(super) misfits: ParameterIdSet,
    /// The last reset has to be written.
    pub(super) reset: bool,
    /// It has failed and waits for a retry.
    pub(super) reset_waits: bool,
    /// The latest failure to write, until a write succeeds.
    pub(super) failure: Option<StorageError>,
    /// It has been reported since the latest change.
    pub(super) is_reported: bool,
    pub(super) doubts: Doubts,
    /// The files that did not come whole since the start; `None` if there are none, or before the start.
    pub(super) half_file: Option<HalfFile>,
    /// The listed parameters.
    pub(super) listed: ParameterIdSet,
    /// Parameters that have changed since they were taken.
    changed: ParameterIdSet,
    pub(super) sticks: Sticks,
    /// A default of a simulated board that differs from the board's.
    #[cfg(not(target_os = "none"))]
    own_default: Option<(ParameterId, f32)>,
}

/// Number of changes of values (wraps).
#[derive(Clone, Copy, Debug)]
struct Revision(u32);

/// Parameters with the same values are alike, however often these have changed.
impl PartialEq for Revision {
    fn eq(&self, _: &Self) -> bool {
        true
    }
}

/// Why a value is refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Refused {
    /// It is out of the parameter's range, or there is no such parameter.
    OutOfRange,
    /// No cell of the pack's chemistry rests at this voltage.
    OtherChemistry,
    /// The parameter is constant, or shows a value of the firmware's own.
    ReadOnly,
    /// A time-out is not raised while the rover is armed.
    Armed,
    /// The system id is not changed while the rover is armed.
    NotWhileArmed,
}

/// The value by which a trigger acts.
const TRIGGERED: f32 = 1.0;

impl Parameters {
    /// All parameters at their defaults.
    pub fn defaults() -> Self {
        let mut parameters = Self {
            values: ForEachParameter::from_fn(ParameterId::default_value),
            revision: Revision(0),
            unsaved: ParameterIdSet::default(),
            waiting: ParameterIdSet::default(),
            misfits: ParameterIdSet::default(),
            reset: false,
            reset_waits: false,
            failure: None,
            is_reported: false,
            doubts: Doubts::empty(),
            half_file: None,
            listed: ParameterIdSet::default(),
            changed: ParameterIdSet::default(),
            sticks: Sticks::defaults(),
            #[cfg(not(target_os = "none"))]
            own_default: None,
        };
        parameters.update_listed(ParameterId::all());
        parameters
    }

    /// The live value, in the parameter's unit.
    pub fn get(&self, id: impl Into<ParameterId>) -> f32 {
        match id.into() {
            ParameterId::GroundStation(constant) => constant.row().default,
            id => self.values.get(id),
        }
    }

    /// The default, in the parameter's unit: the value after a reset.
    pub fn default_of(&self, id: ParameterId) -> f32 {
        #[cfg(not(target_os = "none"))]
        if let Some((own, default)) = self.own_default
            && own == id
        {
            return default;
        }
        id.default_value()
    }

    /// Sets the default and the live value of a parameter of a simulated board.
    #[cfg(not(target_os = "none"))]
    pub fn set_default(&mut self, id: ParameterId, default: f32) {
        self.own_default = Some((id, default));
        self.write(id, default);
    }

    /// The live value of a whole-number parameter, in the parameter's unit.
    pub fn get_whole(&self, id: impl Into<ParameterId>) -> i32 {
        self.whole(id.into())
    }

    /// System id of the vehicle in MAVLink (`SYSID_THISMAV`).
    pub fn system_id(&self) -> u8 {
        // The table's range is 1 to 255.
        self.get_whole(VehicleParameter::SysidThismav) as u8
    }

    #[inline(never)]
    fn whole(&self, id: ParameterId) -> i32 {
        round_to_i32(self.get(id))
    }

    /// The listed parameters in the order of their indices: all except those of disabled packs and of what is not in use,
    /// which can still be read and set by name.
    pub fn listed(&self) -> impl Iterator<Item = ParameterId> {
        let mut all = ParameterId::all();
        iter::from_fn(move || self.next_listed(&mut all))
    }

    // Inlined, the search would be repeated wherever the list is read.
    #[inline(never)]
    fn next_listed(&self, all: &mut impl Iterator<Item = ParameterId>) -> Option<ParameterId> {
        all.find(|id| self.listed.contains(*id))
    }

    /// Number of listed parameters.
    pub fn listed_count(&self) -> usize {
        self.listed.len()
    }

    /// Another one when other parameters are listed.
    pub fn list_checksum(&self) -> u32 {
        self.listed.checksum()
    }

    /// Whether the value has changed since [`take_changed`](Self::take_changed) was called.
    pub fn has_changed(&self, id: ParameterId) -> bool {
        self.changed.contains(id)
    }

    /// The parameters whose value has changed since the last call, from any source.
    pub fn take_changed(&mut self) -> ParameterIdSet {
        core::mem::take(&mut self.changed)
    }

    /// Index of a parameter in the list; `None` if hidden.
    pub fn listed_index(&self, id: ParameterId) -> Option<usize> {
        self.listed.contains(id).then(|| self.listed.count_before(id))
    }

    /// Those of a pack.
    pub fn pack(&self, pack: Pack) -> PackParameters<'_> {
        PackParameters { all: self, pack }
    }

    /// Whether a pack is enabled by the live value of its `BATT_MONITOR`.
    pub fn is_monitored(&self, pack: Pack) -> bool {
        self.get(BatteryParameter::Monitor.of(pack)) != MONITOR_DISABLED
    }

    /// The kind of a pack's monitor (`BATT_MONITOR`); `None` if disabled.
    pub fn monitor_kind(&self, pack: Pack) -> Option<MonitorKind> {
        MonitorKind::from_number(self.get_whole(BatteryParameter::Monitor.of(pack)))
    }

    /// Whether any pack's monitor is read by this input.
    pub(crate) fn uses_input(&self, input: MonitorInput) -> bool {
        let mut kinds = Pack::ALL.into_iter().filter_map(|pack| self.monitor_kind(pack));
        kinds.any(|kind| kind.input() == input)
    }

    /// Lists those of `ids` that are in use now.
    fn update_listed(&mut self, ids: impl Iterator<Item = ParameterId>) {
        for id in ids {
            if self.is_used(id) {
                self.listed.insert(id);
            } else {
                self.listed.remove(id);
            }
        }
    }

    /// Whether what a parameter sets up is in use. `BATT_MONITOR` always is.
    fn is_used(&self, id: ParameterId) -> bool {
        let monitor = match id {
            ParameterId::Battery(pack, _) => Some(self.get(BatteryParameter::Monitor.of(pack))),
            _ => None,
        };
        match id.row().listed {
            _ if matches!(id, ParameterId::Battery(_, BatteryParameter::Monitor)) => true,
            Listed::Always => monitor != Some(MONITOR_DISABLED),
            // Whole numbers are stored as such.
            Listed::WithSerialProtocol(protocol) => self.get(VehicleParameter::Serial1Protocol) == protocol,
            Listed::WithCan => self.get(VehicleParameter::CanP1Driver) != CAN_DISABLED,
            Listed::WithThermometer => matches!(id, ParameterId::Thermometer(sensor, _)
                if self.get(ThermometerParameter::Type.of(sensor)) != THERMOMETER_DISABLED),
            Listed::WithMonitor(kind) => monitor == Some(kind.number() as f32),
            Listed::WithCurve => matches!(id, ParameterId::Battery(pack, _)
                if monitor != Some(MONITOR_DISABLED) && self.pack(pack).has_curve()),
        }
    }

    /// Differs from an earlier one if a value has changed meanwhile (wraps).
    pub fn revision(&self) -> u32 {
        self.revision.0
    }

    /// Writes a live value, which nothing else does, and updates what follows from it.
    pub(super) fn write(&mut self, id: ParameterId, value: f32) {
        if value.to_bits() != self.values.get(id).to_bits() {
            self.changed.insert(id);
            self.revision.0 = self.revision.0.wrapping_add(1);
        }
        self.values.set(id, value);
        match id {
            ParameterId::Stick(id) => self.follow_sticks(id),
            // Whether others are in use depends on these; all of them would take a millisecond.
            ParameterId::Battery(pack, BatteryParameter::Monitor) => {
                self.update_listed(BatteryParameter::ALL.iter().map(|parameter| parameter.of(pack)));
            }
            ParameterId::Battery(pack, parameter) if parameter.row().listed == Listed::WithCurve => {
                self.update_listed(BatteryParameter::CURVE.iter().map(|point| point.of(pack)));
            }
            ParameterId::Thermometer(sensor, ThermometerParameter::Type) => {
                self.update_listed(
                    ThermometerParameter::ALL
                        .iter()
                        .map(|parameter| parameter.of(sensor)),
                );
            }
            ParameterId::Vehicle(VehicleParameter::Serial1Protocol | VehicleParameter::CanP1Driver) => {
                self.update_listed(VehicleParameter::ALL.iter().map(|parameter| (*parameter).into()));
            }
            _ => {}
        }
    }

    /// Sets the live value, and marks it to be saved unless flash holds the same. A trigger stays at 0: the service that sets it acts
    /// on it if it [`triggers`].
    ///
    /// # Errors
    /// The value is refused; the old one is kept.
    pub fn set(&mut self, id: impl Into<ParameterId>, value: f32) -> Result<(), Refused> {
        let id = id.into();
        let value = match id.row().access {
            Access::Setting(_) => self.check_curve(id, checked(id, value)?)?,
            Access::ReadOnly | Access::Constant => return Err(Refused::ReadOnly),
            Access::Trigger => return checked(id, value).map(drop),
        };
        let is_saved = !self.doubts.contains(Doubts::NOT_READ)
            && !self.unsaved.contains(id)
            && !self.misfits.contains(id)
            && value.to_bits() == self.get(id).to_bits();
        if !is_saved {
            self.mark_unsaved(id);
            self.write(id, value);
        }
        Ok(())
    }

    /// `value`, unless it is a point of a curve that no cell of the pack's chemistry has.
    fn check_curve(&self, id: ParameterId, value: f32) -> Result<f32, Refused> {
        match id {
            ParameterId::Battery(pack, parameter)
                if value != 0.0
                    && parameter.row().listed == Listed::WithCurve
                    && !self
                        .pack(pack)
                        .chemistry()
                        .resting_cell_voltages_v()
                        .contains(&value) =>
            {
                Err(Refused::OtherChemistry)
            }
            _ => Ok(value),
        }
    }

    /// Sets the live value while the rover is armed: a time-out that is raised would let a rover without a driver go on for longer,
    /// and with another system id its driver's DISARM would be for another rover.
    ///
    /// # Errors
    /// The value is refused; the old one is kept.
    pub fn set_while_armed(&mut self, id: impl Into<ParameterId>, value: f32) -> Result<(), Refused> {
        let id = id.into();
        let is_time_out = [VehicleParameter::FsTimeout, VehicleParameter::FsGcsTimeout]
            .map(ParameterId::from)
            .contains(&id);
        if is_time_out && checked(id, value)? > self.get(id) {
            return Err(Refused::Armed);
        }
        if id == VehicleParameter::SysidThismav.into() && checked(id, value)? != self.get(id) {
            return Err(Refused::NotWhileArmed);
        }
        self.set(id, value)
    }

    /// Sets what a read-only parameter shows, and returns whether that has changed. A value out of range is not shown.
    pub fn show(&mut self, id: ParameterId, value: f32) -> bool {
        match checked(id, value) {
            Ok(value) if id.row().access == Access::ReadOnly && value != self.get(id) => {
                self.write(id, value);
                true
            }
            _ => false,
        }
    }

    /// Sets the live value to one loaded from flash under `key`, which may have the mark of a [`trouble`](Self::trouble) instead.
    ///
    /// # Errors
    /// The value is out of range: the default is kept. [`Refused::ReadOnly`]: the key is unknown, or of no setting.
    pub fn restore(&mut self, key: u16, value: f32) -> Result<(), Refused> {
        let id = ParameterId::from_key(key).ok_or(Refused::ReadOnly)?;
        if id == CHECKED {
            self.restore_mark(value);
            return Ok(());
        }
        let Access::Setting(bearing) = id.row().access else {
            return Err(Refused::ReadOnly);
        };
        let checked = checked(id, value);
        match checked {
            Ok(value) => {
                self.mark_as_stored(id);
                self.write(id, value);
                // A loaded value is no change.
                self.changed.remove(id);
            }
            Err(_) if bearing == Bearing::Drive => self.misfits.insert(id),
            Err(_) => {}
        }
        checked.map(drop)
    }
}

/// `value` converted to the parameter's type, if it is in range.
///
/// # Errors
/// The value is out of range.
pub(crate) fn checked(id: ParameterId, value: f32) -> Result<f32, Refused> {
    let row = id.row();
    let value = match row.kind {
        Kind::Real32 => value,
        Kind::Int8 | Kind::Int16 | Kind::Int32 => whole_number(value),
    };
    if row.range.contains(value) {
        Ok(value)
    } else {
        Err(Refused::OutOfRange)
    }
}

/// Whether setting `id` to `value` triggers its action.
pub fn triggers(id: ParameterId, value: f32) -> bool {
    id.row().access == Access::Trigger && checked(id, value) == Ok(TRIGGERED)
}

/// Truncates a value of a whole-number parameter, as ArduPilot does. NaN and infinity are kept, to be out of range.
pub(super) fn whole_number(value: f32) -> f32 {
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
    use crate::pack::MAX_PACKS;
    use crate::parameter::{
        GroundStationParameter, PARAMETER_COUNT, SimulationParameter, StickParameter, THERMOMETER_COUNT,
        Unsaved,
    };
    use proptest::prelude::*;

    const EXTRA1: ParameterId = ParameterId::Vehicle(VehicleParameter::Sr0Extra1);
    const VOLT_MULT: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::VoltMult);

    #[test]
    fn every_default_is_in_its_own_range() {
        let mut parameters = Parameters::defaults();
        for id in ParameterId::all() {
            assert_eq!(parameters.get(id), id.default_value(), "{}", id.name());
            let expected = match id.row().access {
                Access::Setting(_) | Access::Trigger => Ok(()),
                Access::ReadOnly | Access::Constant => Err(Refused::ReadOnly),
            };
            assert_eq!(parameters.set(id, id.default_value()), expected, "{}", id.name());
        }
        assert_eq!(parameters, Parameters::defaults());
    }

    #[test]
    fn a_curve_is_listed_while_one_of_its_points_is_set_and_the_pack_monitored() {
        let mut parameters = Parameters::defaults();
        let listed = |parameters: &Parameters, pack| {
            let points = BatteryParameter::CURVE.map(|point| parameters.listed_index(point.of(pack)));
            points.iter().flatten().count()
        };
        let by_default = parameters.listed_count();
        for (pack, count) in [(Pack::First, 5), (Pack::Second, 0)] {
            let point = BatteryParameter::Curve50.of(pack);
            assert_eq!(listed(&parameters, pack), 0);
            parameters.set(point, 3.7).unwrap();
            assert_eq!(listed(&parameters, pack), count, "{pack:?}");
            assert_eq!(parameters.listed_count(), by_default + count);
            parameters.set(point, 0.0).unwrap();
            assert_eq!(parameters.listed_count(), by_default);
        }
        parameters
            .set(BatteryParameter::Curve90.of(Pack::Second), 4.0)
            .unwrap();
        parameters
            .set(BatteryParameter::Monitor.of(Pack::Second), 3.0)
            .unwrap();
        assert_eq!(listed(&parameters, Pack::Second), 5);
    }

    #[test]
    fn a_point_that_no_cell_of_the_chemistry_has_is_refused_and_changes_nothing() {
        let mut parameters = Parameters::defaults();
        let [first, second] = [Pack::First, Pack::Second].map(|pack| BatteryParameter::Curve50.of(pack));
        parameters
            .set(BatteryParameter::Chem.of(Pack::Second), 4.0)
            .unwrap();
        for (point, value, result) in [
            (first, 3.7, Ok(())),
            (first, 1.3, Err(Refused::OtherChemistry)),
            (first, 4.36, Err(Refused::OutOfRange)),
            (second, 1.3, Ok(())),
            (second, 3.7, Err(Refused::OtherChemistry)),
        ] {
            let before = parameters.get(point);
            assert_eq!(parameters.set(point, value), result, "{value}");
            let live = if result.is_ok() { value } else { before };
            assert_eq!(parameters.get(point), live);
        }
    }

    /// Rows of what is not in use by default.
    const UNUSED_OF_VEHICLE: usize = 10;
    const UNUSED_OF_PACK: usize = 7;

    /// The vehicle's, those of the first pack, `MONITOR` of the others, and the simulator's.
    const LISTED_BY_DEFAULT: usize = VehicleParameter::COUNT - UNUSED_OF_VEHICLE
        + StickParameter::COUNT
        + THERMOMETER_COUNT
        + GroundStationParameter::COUNT
        + BatteryParameter::COUNT
        - UNUSED_OF_PACK
        + MAX_PACKS
        - 1
        + SimulationParameter::COUNT;

    #[test]
    // Requirement: AP-3
    fn disabled_pack_is_hidden_except_its_monitor_parameter() {
        let mut parameters = Parameters::defaults();
        assert_eq!(parameters.listed().count(), LISTED_BY_DEFAULT);
        for pack in Pack::ALL {
            parameters.set(BatteryParameter::Monitor.of(pack), 4.0).unwrap();
        }
        let mut hidden = ParameterId::all().filter(|id| parameters.listed_index(*id).is_none());
        assert!(hidden.all(|id| id.row().listed != Listed::Always));
        for pack in Pack::ALL {
            parameters.set(BatteryParameter::Monitor.of(pack), 0.0).unwrap();
            let hidden = |id: &ParameterId| matches!(id, ParameterId::Battery(other, _) if *other == pack);
            let listed: Vec<_> = parameters.listed().filter(hidden).collect();
            assert_eq!(listed, [BatteryParameter::Monitor.of(pack)]);
        }
        assert_eq!(
            parameters.listed().count(),
            LISTED_BY_DEFAULT - (BatteryParameter::COUNT - UNUSED_OF_PACK - 1)
        );
    }

    #[test]
    fn indices_and_count_match_the_list() {
        let mut parameters = Parameters::defaults();
        for monitored in [0b0_0000_0000, 0b1_1111_1111, 0b0_0000_0001, 0b1_0100_1010] {
            for pack in Pack::ALL {
                let is_monitored = monitored & 1 << pack.instance() != 0;
                let value = if is_monitored { 4.0 } else { 0.0 };
                parameters.set(BatteryParameter::Monitor.of(pack), value).unwrap();
            }
            assert_eq!(parameters.listed_count(), parameters.listed().count());
            for id in ParameterId::all() {
                let place = parameters.listed().position(|listed| listed == id);
                assert_eq!(parameters.listed_index(id), place, "{}", id.name());
            }
        }
    }

    #[test]
    fn the_list_follows_each_parameter_that_it_depends_on() {
        let mut parameters = Parameters::defaults();
        let values = [0.0, 1.0, 4.0, 8.0, 9.0, 24.0, 30.0, 39.0];
        for id in ParameterId::all() {
            for value in values.into_iter().chain([id.default_value()]) {
                let _ = parameters.set(id, value);
                let used = ParameterId::all().filter(|id| parameters.is_used(*id));
                assert!(parameters.listed().eq(used), "{} {value}", id.name());
            }
        }
    }

    #[test]
    // Requirement: AP-3
    fn parameters_of_what_is_not_in_use_are_hidden() {
        let mut parameters = Parameters::defaults();
        let bitrate = ParameterId::from(VehicleParameter::CanP1Bitrate);
        let multiplier = BatteryParameter::CurrMult.of(Pack::Second);
        let count = parameters.listed_count();
        let indices = [bitrate, multiplier].map(|id| parameters.listed_index(id));
        assert_eq!(indices, [None, None]);
        parameters.set(VehicleParameter::CanP1Driver, 1.0).unwrap();
        let of_bus = parameters.listed_count() - count;
        assert_eq!(of_bus, 3);
        let monitor = BatteryParameter::Monitor.of(Pack::Second);
        parameters.set(monitor, 9.0).unwrap();
        assert_eq!(parameters.listed_index(multiplier), None);
        parameters.set(monitor, 8.0).unwrap();
        for (index, id) in parameters.listed().enumerate() {
            assert_eq!(parameters.listed_index(id), Some(index), "{}", id.name());
        }
        let listed: Vec<_> = parameters.listed().collect();
        assert_eq!(listed.len(), parameters.listed_count());
        assert!(listed.contains(&bitrate) && listed.contains(&multiplier));
    }

    #[test]
    fn hidden_parameter_can_be_set_and_saved() {
        let mut parameters = Parameters::defaults();
        let hidden = BatteryParameter::VoltMult.of(Pack::Ninth);
        assert_eq!(parameters.set(hidden, 11.0), Ok(()));
        assert_eq!(parameters.get(hidden), 11.0);
        assert_eq!(parameters.next_unsaved(), Some(Unsaved::Value(hidden, 11.0)));
        assert_eq!(parameters.get(VOLT_MULT), 3.95);
    }

    #[test]
    // Requirement: AP-1
    fn value_out_of_range_is_rejected() {
        let mut parameters = Parameters::defaults();
        for value in [-1.0, 51.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            assert_eq!(parameters.set(EXTRA1, value), Err(Refused::OutOfRange), "{value}");
            assert_eq!(parameters.get(EXTRA1), 2.0);
        }
        let set = parameters.set(BatteryParameter::Monitor.of(Pack::First), 1.0);
        assert_eq!(set, Err(Refused::OutOfRange));
        assert_eq!(parameters.next_unsaved(), None);
    }

    #[test]
    fn whole_numbers_are_truncated_as_in_ardupilot() {
        let mut parameters = Parameters::defaults();
        for (given, kept) in [(7.0, 7.0), (7.9, 7.0), (6.995, 7.0), (0.5, 0.0)] {
            assert_eq!(parameters.set(EXTRA1, given), Ok(()));
            assert_eq!(parameters.get(EXTRA1), kept, "{given}");
        }
    }

    const LRN_CAP: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::LrnCap);
    const LRN_ERASE: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::LrnErase);

    #[test]
    fn read_only_value_is_shown_kept_by_a_reset_and_never_saved() {
        let mut parameters = Parameters::defaults();
        assert!(parameters.show(LRN_CAP, 2950.0));
        assert!(!parameters.show(LRN_CAP, 2950.0));
        for value in [2950.0, 0.0, 1.0, f32::NAN] {
            assert_eq!(parameters.set(LRN_CAP, value), Err(Refused::ReadOnly));
            assert_eq!(parameters.restore(LRN_CAP.key(), value), Err(Refused::ReadOnly));
        }
        for value in [f32::NAN, -1.0, 1e9] {
            assert!(!parameters.show(LRN_CAP, value));
        }
        assert!(!parameters.show(EXTRA1, 5.0), "a setting");
        assert_eq!(parameters.next_unsaved(), None);
        parameters.reset();
        assert_eq!(parameters.get(LRN_CAP), 2950.0);
        parameters.mark_saved(Unsaved::Reset);
        assert_eq!(parameters.next_unsaved(), None);
    }

    #[test]
    fn trigger_reads_0_and_is_never_saved() {
        let mut parameters = Parameters::defaults();
        parameters.mark_not_read();
        for (value, expected) in [(0.0, false), (0.5, false), (0.995, true), (1.0, true)] {
            assert_eq!(parameters.set(LRN_ERASE, value), Ok(()));
            assert_eq!(triggers(LRN_ERASE, value), expected, "{value}");
            assert_eq!(parameters.get(LRN_ERASE), 0.0);
        }
        for value in [2.0, -1.0, f32::NAN] {
            assert_eq!(parameters.set(LRN_ERASE, value), Err(Refused::OutOfRange));
            assert!(!triggers(LRN_ERASE, value), "{value}");
        }
        assert!(!triggers(EXTRA1, 1.0), "a setting");
        assert_eq!(parameters.restore(LRN_ERASE.key(), 1.0), Err(Refused::ReadOnly));
        assert_eq!(parameters.next_unsaved(), None);
    }

    #[test]
    fn stored_value_out_of_range_leaves_the_default() {
        let mut parameters = Parameters::defaults();
        assert_eq!(parameters.restore(3, 10.0), Ok(()));
        assert_eq!(parameters.restore(66, f32::NAN), Err(Refused::OutOfRange));
        assert_eq!(parameters.restore(9999, 1.0), Err(Refused::ReadOnly));
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
