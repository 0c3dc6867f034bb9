//! A fleet: what distinguishes its rovers, and one status line for all of them.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::fmt;
use std::fs;
use std::io;

use embassy_time::{Duration, Ticker};
use rover_battmon::autopilot::Start;
use rover_battmon::battery::{Chemistry, FailsafeLevel};
use rover_battmon::memory::identity::BoardId;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{
    BatteryParameter, MonitorKind, ParameterId, Parameters, PartKind, SimulationParameter, VehicleParameter,
};
use rover_battmon::vehicle::{Alert, ArmState};

use super::console::{Level, Output, print_event, print_line, print_status};
use super::status::Status;
use super::{PackModel, SHUNT_OHM, Scenario, SimulatedPack};

/// System ids above belong to ground stations: MAVSDK's is 245, that of most others 255.
pub const MAX_ROVERS: usize = 240;

/// Capacities of the packs, in ampere-hours.
const CAPACITIES_AH: [f32; 4] = [2.2, 3.0, 4.0, 5.0];

/// Charges of the packs, 0 to 1. No two of the first twenty rovers have the same capacity and charge.
const CHARGES: [f32; 10] = [1.0, 0.95, 0.9, 0.85, 0.8, 0.75, 0.7, 0.65, 0.6, 0.55];

/// Highest supply of the simulated motor drivers, in volts: the simulated 3S packs are below it.
const DRIVER_LIMIT_V: f32 = 13.0;

/// The files of ready parameters.
const READY_FILES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../docs/params");

/// Kinds of monitors of which the simulator has the hardware: the board's divider with a current sensor, and an INA226.
const MEASURED_BY: [MonitorKind; 4] = [
    MonitorKind::AnalogVoltage,
    MonitorKind::AnalogVoltageAndCurrent,
    MonitorKind::SyntheticCurrent,
    MonitorKind::Bus(PartKind::Ina2xx),
];

/// The parameters of a rover with the pack of a ready file, `docs/params/{name}.param`. Without a capacity in the file it is that of a
/// usual cell.
///
/// # Errors
/// There is no such file, or its pack can't be simulated, in words.
pub fn ready_pack(name: &str) -> Result<Vec<(ParameterId, f32)>, String> {
    let files = ready_files().map_err(|error| format!("{READY_FILES}: {error}"))?;
    let can_be = files.iter().filter(|(_, text)| parameters_of(text).is_some());
    let names: Vec<_> = can_be.map(|(name, _)| name.as_str()).collect();
    let names = names.join(", ");
    match files.get(name) {
        Some(text) => parameters_of(text).ok_or_else(|| {
            format!("{name}.param has no cells and chemistry, or a monitor that is not simulated; there are {names}")
        }),
        None => Err(format!("there are {names}")),
    }
}

/// The ready files' texts by their names.
fn ready_files() -> io::Result<BTreeMap<String, String>> {
    let mut files = BTreeMap::new();
    for entry in fs::read_dir(READY_FILES)? {
        let path = entry?.path();
        if let Some(name) = path.file_stem() {
            files.insert(name.to_string_lossy().into_owned(), fs::read_to_string(&path)?);
        }
    }
    Ok(files)
}

/// The parameters in the text of a file, and what it leaves to its owner; `None` if its first pack can't be simulated.
fn parameters_of(text: &str) -> Option<Vec<(ParameterId, f32)>> {
    let mut parameters = vec![];
    for line in text.lines().filter(|line| !line.starts_with('#')) {
        let (name, value) = line.split_once(',')?;
        parameters.push((ParameterId::from_name(name.as_bytes())?, value.parse().ok()?));
    }
    let model = model_of(&parameters)?;
    let kind = MonitorKind::from_number(value_of(&parameters, BatteryParameter::Monitor)? as i32)?;
    parameters.extend([
        (
            BatteryParameter::Capacity.of(Pack::First),
            model.capacity_ah * 1e3,
        ),
        (BatteryParameter::Shunt.of(Pack::First), SHUNT_OHM),
        (SimulationParameter::BattCapAh.into(), model.capacity_ah),
    ]);
    MEASURED_BY.contains(&kind).then_some(parameters)
}

/// The first pack of these parameters.
fn model_of(parameters: &[(ParameterId, f32)]) -> Option<PackModel> {
    let cells = value_of(parameters, BatteryParameter::Cells)?;
    let chemistry = Chemistry::from_number(value_of(parameters, BatteryParameter::Chem)? as i32)?;
    let capacity_ah = value_of(parameters, BatteryParameter::Capacity).map(|mah| mah / 1e3);
    Some(PackModel::usual(chemistry, cells as u8, capacity_ah))
}

fn value_of(parameters: &[(ParameterId, f32)], wanted: BatteryParameter) -> Option<f32> {
    let found = parameters.iter().find(|(id, _)| *id == wanted.of(Pack::First));
    found.map(|(_, value)| *value)
}

/// What a simulated rover is among others.
#[derive(Clone, Copy)]
pub enum Role<'a> {
    /// The only one, with a full pack, that of [`ready_pack`] if there are such parameters; its lines go here.
    Alone(Output, &'a [(ParameterId, f32)]),
    /// The one with this number, from 1 on, which is its system id.
    Member(&'a Fleet, u8),
}

impl Role<'_> {
    fn number(self) -> u8 {
        match self {
            Self::Alone(..) => 1,
            Self::Member(_, number) => number,
        }
    }

    /// Its pack at the start of a scenario, or without one.
    pub(super) fn pack(self, scenario: Option<&Scenario>) -> SimulatedPack {
        match self {
            Self::Alone(_, parameters) => match (model_of(parameters), scenario) {
                (Some(model), _) => SimulatedPack::full(model),
                (None, Some(scenario)) => scenario.pack.clone(),
                (None, None) => SimulatedPack::full(PackModel::LIPO_3S_2200),
            },
            Self::Member(_, number) => {
                let model = PackModel {
                    capacity_ah: capacity_ah(number),
                    ..PackModel::LIPO_3S_2200
                };
                SimulatedPack::charged(model, of_number(&CHARGES, number))
            }
        }
    }

    /// Which board it is, and parameters that it has as long as no others are in its flash.
    pub(super) fn set_up(self, start: &mut Start) {
        start.identity.board_id = Some(board_id(self.number()));
        start
            .parameters
            .set_default(VehicleParameter::MotDrvVolt.into(), DRIVER_LIMIT_V);
        let number = match self {
            Self::Alone(_, parameters) => return restore(&mut start.parameters, parameters),
            Self::Member(_, number) => number,
        };
        let own: [(ParameterId, f32); 4] = [
            (VehicleParameter::SysidThismav.into(), number.into()),
            (SimulationParameter::BattCapAh.into(), capacity_ah(number)),
            (
                BatteryParameter::Capacity.of(Pack::First),
                capacity_ah(number) * 1e3,
            ),
            (
                BatteryParameter::Cells.of(Pack::First),
                PackModel::LIPO_3S_2200.cells.into(),
            ),
        ];
        restore(&mut start.parameters, &own);
    }

    /// Whether its announcements are shown. Those of the only rover are in the log, which lines in a file have beside them.
    pub(super) fn shows_announcements(self) -> bool {
        matches!(self, Self::Alone(Output::Terminal, _) | Self::Member(..))
    }

    /// Shows what it announces; of a fleet's rover what is urgent.
    pub(super) fn show_event(self, level: Level, text: &str) {
        match self {
            Self::Alone(..) => print_event(level, text),
            Self::Member(..) if level == Level::Info => {}
            Self::Member(_, number) => print_event(level, &format!("rover {number}: {text}")),
        }
    }

    /// Shows something that has happened to the simulator.
    pub(super) fn show_line(self, line: &str) {
        match self {
            Self::Alone(..) => print_line(line),
            Self::Member(_, number) => print_line(&format!("rover {number}: {line}")),
        }
    }

    /// Shows its status; that of a fleet's rover in the line of the fleet.
    pub(super) fn show_status(self, status: Status) {
        match self {
            Self::Alone(Output::Terminal, _) => print_status(status.comparison.level(), &status.short()),
            Self::Alone(Output::Lines, _) => print_status(status.comparison.level(), &status.long()),
            Self::Member(fleet, number) => fleet.report(number, status),
        }
    }
}

fn restore(parameters: &mut Parameters, values: &[(ParameterId, f32)]) {
    for (id, value) in values {
        let set = parameters.restore(id.key(), *value);
        debug_assert_eq!(set, Ok(()), "{id:?}");
    }
}

fn of_number<const N: usize>(values: &[f32; N], number: u8) -> f32 {
    values[(usize::from(number) - 1) % N]
}

fn capacity_ah(number: u8) -> f32 {
    of_number(&CAPACITIES_AH, number)
}

/// An id that is equal in each run: `SIM`, then the number.
fn board_id(number: u8) -> BoardId {
    let [s, i, m] = *b"SIM";
    BoardId([s, i, m, 0, 0, 0, 0, number])
}

/// The latest status of each rover.
#[derive(Debug)]
pub struct Fleet {
    /// Their number.
    rovers: u8,
    statuses: RefCell<Vec<(u8, Status)>>,
}

impl Fleet {
    /// A fleet of this many.
    pub fn of(rovers: u8) -> Self {
        Self {
            rovers,
            statuses: RefCell::default(),
        }
    }

    /// What each is among the others.
    pub fn roles(&self) -> impl Iterator<Item = Role<'_>> {
        (1..=self.rovers).map(|number| Role::Member(self, number))
    }

    fn report(&self, number: u8, status: Status) {
        let mut statuses = self.statuses.borrow_mut();
        match statuses.iter_mut().find(|(reported, _)| *reported == number) {
            Some((_, known)) => *known = status,
            None => statuses.push((number, status)),
        }
    }

    /// Prints the status line, each time after this interval.
    pub async fn print(&self, interval: Duration) -> ! {
        let mut lines = Ticker::every(interval);
        loop {
            lines.next().await;
            print_status(self.level(), &self.to_string());
        }
    }

    /// How urgent it is: as the rover of which it is most urgent.
    fn level(&self) -> Level {
        let statuses = self.statuses.borrow();
        let levels = statuses.iter().map(|(_, status)| status.comparison.level());
        levels.max().unwrap_or(Level::Info)
    }
}

impl fmt::Display for Fleet {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let statuses = self.statuses.borrow();
        let count = |is_counted: fn(&Status) -> bool| {
            statuses.iter().filter(|(_, status)| is_counted(status)).count()
        };
        write!(
            f,
            "{} rovers: {} armed, {} in failsafe",
            self.rovers,
            count(|status| status.vehicle.arm_state == ArmState::Armed),
            count(is_in_failsafe),
        )?;
        let charges = statuses
            .iter()
            .filter_map(|(number, status)| Some((status.comparison.remaining_pct()?, number)));
        if let Some((lowest_pct, number)) = charges.min_by(|(one, _), (other, _)| one.total_cmp(other)) {
            write!(f, " | lowest pack {lowest_pct:.0} % (rover {number})")?;
        }
        let heard_by = count(|status| status.stations > 0);
        write!(f, " | {heard_by} hear a ground station")
    }
}

/// Of a pack, or of the driver.
fn is_in_failsafe(status: &Status) -> bool {
    status.comparison.failsafe() != FailsafeLevel::None || status.vehicle.alert != Alert::None
}

#[cfg(test)]
mod tests {
    use std::collections::HashSet;

    use super::*;
    use crate::sim::status::Comparison;
    use rover_battmon::battery::{BatteryState, PackStatus, Readings};
    use rover_battmon::vehicle::VehicleStatus;

    #[test]
    fn every_rover_has_a_system_id_a_board_and_no_two_of_twenty_the_same_pack() {
        let fleet = Fleet::of(MAX_ROVERS as u8);
        let (mut ids, mut packs) = (HashSet::new(), HashSet::new());
        for role in fleet.roles() {
            let mut start = Start::default();
            role.set_up(&mut start);
            let system_id = start.parameters.get_whole(VehicleParameter::SysidThismav);
            assert!(ids.insert(system_id) && ids.insert(-i32::from(role.number())));
            assert_eq!(start.identity.board_id, Some(board_id(role.number())));
            let pack = role.pack(None);
            let is_new = packs.insert((pack.capacity_ah().to_bits(), pack.charge().to_bits()));
            assert!(is_new || role.number() > 20, "{system_id}");
        }
    }

    #[test]
    fn the_drivers_of_every_rover_stand_its_full_pack() {
        let full_v = SimulatedPack::full(PackModel::LIPO_3S_2200).voltage_v();
        for role in [Role::Alone(Output::Lines, &[]), Role::Member(&Fleet::of(1), 1)] {
            let mut start = Start::default();
            role.set_up(&mut start);
            let limit_v = |start: &Start| start.parameters.get(VehicleParameter::MotDrvVolt);
            assert!(limit_v(&start) > full_v);
            start.parameters.set(VehicleParameter::MotDrvVolt, 5.0).unwrap();
            start.parameters.reset();
            assert!(limit_v(&start) > full_v, "after a reset");
        }
    }

    fn status(battery: BatteryState, arm_state: ArmState) -> Status {
        Status {
            comparison: Comparison::new(&SimulatedPack::full(PackModel::LIPO_3S_2200), &battery),
            vehicle: VehicleStatus {
                arm_state,
                ..VehicleStatus::default()
            },
            stations: 1,
            samples: 10,
            frames: 0,
            dropped: 0,
        }
    }

    #[test]
    fn one_line_is_of_all_rovers() {
        let fleet = Fleet::of(3);
        assert_eq!(
            fleet.to_string(),
            "3 rovers: 0 armed, 0 in failsafe | 0 hear a ground station"
        );
        let battery = |remaining_pct, failsafe| BatteryState {
            status: PackStatus::Healthy,
            readings: Readings {
                remaining_pct: Some(remaining_pct),
                ..Readings::NONE
            },
            failsafe,
            ..BatteryState::UNKNOWN
        };
        fleet.report(1, status(battery(99.6, FailsafeLevel::None), ArmState::Disarmed));
        fleet.report(2, status(battery(70.0, FailsafeLevel::None), ArmState::Armed));
        fleet.report(2, status(battery(41.6, FailsafeLevel::Low), ArmState::Armed));
        assert_eq!(
            fleet.to_string(),
            "3 rovers: 1 armed, 1 in failsafe | lowest pack 42 % (rover 2) | 2 hear a ground station"
        );
    }
}
