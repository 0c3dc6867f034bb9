//! The parts on a bus whose devices a test writes down.

use std::collections::{BTreeMap, VecDeque};

use embassy_futures::block_on;
use embedded_hal_async::i2c::{ErrorType, NoAcknowledgeSource};
use proptest::prelude::*;

use super::*;
use crate::battery::{
    BatteryMonitor, BatteryState, ChargeState, Chemistry, Date, Faults, GaugeReading, Measurement, Modes,
    PackNotice, PackSettings, ReadError, Reported, Supply, SupplyEvent, Thermometer, Tick,
};
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, MonitorKind, Parameters, PartKind, Refused};
use crate::time::Instant;
use crate::vehicle::ArmState;

/// Devices as tables: by address and register, the bytes that are read. What is written is not kept.
#[derive(Default)]
struct Tables(BTreeMap<(u8, u8), Vec<u8>>);

impl Tables {
    fn set(&mut self, address: u8, register: u8, bytes: &[u8]) {
        self.0.insert((address, register), bytes.to_vec());
    }
}

impl I2cBus for Tables {
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        if !self.0.keys().any(|(device, _)| *device == address) {
            return Err(BusError::NoAnswer);
        }
        let mut register = 0;
        for operation in operations {
            match operation {
                Operation::Write(bytes) => register = bytes[0],
                Operation::Read(buffer) => {
                    let bytes = self.0.get(&(address, register)).ok_or(BusError::NoAnswer)?;
                    buffer.fill(0xff);
                    buffer.iter_mut().zip(bytes).for_each(|(to, from)| *to = *from);
                }
            }
        }
        Ok(())
    }
}

/// Answers with whatever comes next, until that is used up.
struct Anything(VecDeque<Result<u8, BusError>>);

impl I2cBus for Anything {
    async fn transfer(&mut self, _: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        for operation in operations {
            if let Operation::Read(buffer) = operation {
                for byte in buffer.iter_mut() {
                    *byte = self.0.pop_front().unwrap_or(Err(BusError::NoAnswer))?;
                }
            }
        }
        Ok(())
    }
}

/// A BQ76952 that reports what it is given: its commands, and answers to its subcommands.
struct Stack {
    commands: [u8; 128],
    answers: BTreeMap<u16, Vec<u8>>,
}

impl Stack {
    /// Recognised, and with these words from the first cell to the current.
    fn new(words: &[u16], charge: [u8; 12], units: [u8; 3]) -> Self {
        let mut commands = [0; 128];
        let bytes: Vec<u8> = words.iter().flat_map(|word| word.to_le_bytes()).collect();
        commands[0x14..0x14 + bytes.len()].copy_from_slice(&bytes);
        let answers = [
            (0x0001, vec![0x95, 0x76]),
            (0x0057, vec![0, 0]),
            (0x0076, charge.to_vec()),
            (0x92fd, [&[0; 6], &units[..]].concat()),
        ];
        Self {
            commands,
            answers: answers.into(),
        }
    }

    fn answer(&mut self, low: u8, high: u8) {
        let answer = &self.answers[&u16::from_le_bytes([low, high])];
        self.commands[0x3e..0x40].copy_from_slice(&[low, high]);
        self.commands[0x40..0x40 + answer.len()].copy_from_slice(answer);
        let sum = answer
            .iter()
            .fold(low.wrapping_add(high), |sum, byte| sum.wrapping_add(*byte));
        self.commands[0x60..0x62].copy_from_slice(&[!sum, answer.len() as u8 + 4]);
    }
}

impl I2cBus for Stack {
    async fn transfer(&mut self, _: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        let mut from = 0;
        for operation in operations {
            match operation {
                Operation::Write([0x3e, low, high]) => self.answer(*low, *high),
                Operation::Write(command) => from = usize::from(command[0]),
                Operation::Read(buffer) => {
                    let until = from + buffer.len();
                    buffer.copy_from_slice(&self.commands[from..until]);
                }
            }
        }
        Ok(())
    }
}

type Wires = Buses<Tables, NoSpi>;

fn wires(tables: Tables) -> Wires {
    Buses::i2c(tables)
}

fn parameters(settings: &[(Pack, BatteryParameter, f32)]) -> Parameters {
    let mut parameters = Parameters::defaults();
    for (pack, parameter, value) in settings {
        parameters.set(parameter.of(*pack), *value).expect("in range");
    }
    parameters
}

fn part_kinds() -> Vec<PartKind> {
    let part = |kind: &MonitorKind| match kind {
        MonitorKind::Bus(part) => Some(*part),
        _ => None,
    };
    MonitorKind::ALL.iter().filter_map(part).collect()
}

fn second_is(kind: PartKind) -> Parameters {
    parameters(&[(
        Pack::Second,
        BatteryParameter::Monitor,
        MonitorKind::Bus(kind).number() as f32,
    )])
}

/// The second pack is a part of this kind.
fn devices_of(kind: PartKind) -> BusDevices {
    BusDevices::from_parameters(&second_is(kind), Instant::EPOCH)
}

/// A pack, sampled ten times a second.
#[derive(Default)]
struct Sampled {
    monitor: BatteryMonitor,
    state: BatteryState,
    now: Instant,
}

impl Sampled {
    fn take(&mut self, reading: Result<Measurement, ReadError>, settings: &PackSettings) {
        self.now = self.now.after_us(100_000);
        let tick = Tick {
            now: self.now,
            ..Tick::default()
        };
        let _ = self.monitor.update(&mut self.state, tick, reading, settings);
    }

    fn assert_is_sound(&self) {
        let state = &self.state;
        let readings = state.readings;
        let is_charge = |pct: f32| (0.0..=100.0).contains(&pct);
        assert!(readings.remaining_pct.is_none_or(is_charge), "{state:?}");
        let values = [
            readings.voltage_v,
            readings.current_a,
            readings.time_remaining_s,
            state.consumed_mah(),
        ];
        assert!(values.into_iter().flatten().all(f32::is_finite), "{state:?}");
    }
}

/// Reads the part that is due next, and collects its readings.
fn read_next(
    devices: &mut BusDevices,
    bus: &mut impl SensorBus,
) -> Vec<(Pack, Result<Measurement, ReadError>)> {
    let mut readings = Vec::new();
    let now = devices.next_due().expect("there is a part");
    let _ = block_on(devices.read_next(bus, now, ArmState::Disarmed, |pack, reading| {
        readings.push((pack, reading));
    }));
    readings
}

/// The events of the next readings.
fn findings(
    devices: &mut BusDevices,
    bus: &mut impl SensorBus,
    arm_state: ArmState,
) -> Vec<(Pack, SupplyEvent)> {
    let mut readings = 0..20;
    std::iter::from_fn(|| {
        readings.next()?;
        let now = devices.next_due()?;
        Some(block_on(devices.read_next(bus, now, arm_state, |_, _| {})))
    })
    .flatten()
    .collect()
}

#[test]
fn a_part_that_is_not_found_is_looked_for_once_while_disarmed() {
    let parameters = parameters(&[
        (Pack::Second, BatteryParameter::Monitor, 21.0),
        (Pack::Second, BatteryParameter::I2cAddr, 64.0),
    ]);
    let mut devices = BusDevices::from_parameters(&parameters, Instant::EPOCH);
    let mut tables = Tables::default();
    for address in [0x44, 0x41, 0x50] {
        tables.set(address, 0, &[1]);
    }
    let mut bus = wires(tables);
    assert_eq!(findings(&mut devices, &mut bus, ArmState::Armed), []);
    let event = SupplyEvent::NotFound {
        address: Some(0x40),
        answering: [Some(0x41), Some(0x44), None, None, None],
    };
    let found = findings(&mut devices, &mut bus, ArmState::Disarmed);
    assert_eq!(found, [(Pack::Second, event)]);
    assert_eq!(findings(&mut devices, &mut bus, ArmState::Disarmed), []);
}

#[test]
fn a_smart_battery_is_announced_once() {
    let mut devices = devices_of(PartKind::SmartBattery);
    let (address, cells) = (ADDRESS, Some(2));
    let found = findings(&mut devices, &mut battery(&[]), ArmState::Armed);
    assert_eq!(found, [(Pack::Second, SupplyEvent::Found { address, cells })]);
}

#[test]
fn the_range_of_a_current_over_a_shunt_is_announced_once_for_each_pack() {
    for (part, shunt_ohm, expected) in [
        (ina226(), 0.1, Some("INA226 up to 0.8 A")),
        (ina231(), 0.0005, Some("INA231 up to 163.8 A")),
        (ina219(), 0.1, Some("INA219 up to 3.2 A")),
        (ina238(), 0.1, Some("INA238 up to 1.6 A")),
        (ina260(), 0.1, None),
        // Its counters end at BATT_MAX_AMPS, 90 A.
        (ina228(), 0.0015, Some("INA228 up to 90.0 A")),
        (ina228(), 0.1, Some("INA228 up to 1.6 A")),
        (ltc2946(), 0.002, Some("LTC2946 up to 51.2 A")),
        (ina3221(), 0.1, Some("INA3221 up to 1.6 A")),
    ] {
        let mut bus = wires(Tables::default());
        for (register, bytes) in &part.registers {
            bus.i2c.set(part.address, *register, bytes);
        }
        let mut devices = BusDevices::from_parameters(
            &parameters(&[
                (
                    Pack::Second,
                    BatteryParameter::Monitor,
                    MonitorKind::Bus(part.kind).number() as f32,
                ),
                (Pack::Second, BatteryParameter::Shunt, shunt_ohm),
            ]),
            Instant::EPOCH,
        );
        let found = findings(&mut devices, &mut bus, ArmState::Armed);
        let texts: Vec<_> = found
            .iter()
            .map(|(pack, event)| PackNotice(*pack, event).to_string())
            .collect();
        let expected = expected.map(|text| format!("Battery 2 {text}"));
        assert_eq!(texts, Vec::from_iter(expected));
    }
    let monitor = MonitorKind::Bus(PartKind::Ina3221).number() as f32;
    let mut devices = BusDevices::from_parameters(
        &parameters(&[
            (Pack::Second, BatteryParameter::Monitor, monitor),
            (Pack::Third, BatteryParameter::Monitor, monitor),
            (Pack::Third, BatteryParameter::Channel, 2.0),
            (Pack::Third, BatteryParameter::Shunt, 0.01),
        ]),
        Instant::EPOCH,
    );
    let mut bus = wires(Tables::default());
    for (register, bytes) in ina3221().registers {
        bus.i2c.set(0x40, register, &bytes);
    }
    for register in 1..=4 {
        bus.i2c.set(0x40, register, &[0, 0]);
    }
    let found = findings(&mut devices, &mut bus, ArmState::Armed);
    let texts = found
        .iter()
        .map(|(pack, event)| PackNotice(*pack, event).to_string());
    assert_eq!(
        Vec::from_iter(texts),
        [
            "Battery 2 INA3221 up to 327.6 A",
            "Battery 3 INA3221 up to 16.4 A"
        ]
    );
}

#[test]
fn an_address_that_is_set_twice_is_the_first_packs() {
    let [second, third] = [Pack::Second, Pack::Third].map(|pack| {
        [
            (pack, BatteryParameter::Monitor, 21.0),
            (pack, BatteryParameter::I2cAddr, 64.0),
        ]
    });
    let mut devices = BusDevices::from_parameters(&parameters(&[second, third].concat()), Instant::EPOCH);
    let mut bus = wires(Tables::default());
    counters(&mut bus, 0, 0);
    for _ in 0..5 {
        for (pack, reading) in read_next(&mut devices, &mut bus) {
            let voltage_v = reading.map(|measurement| measurement.voltage_v);
            match pack {
                Pack::Second => assert_eq!(voltage_v, Ok(Some(12.0))),
                _ => assert_eq!((pack, voltage_v), (Pack::Third, Err(ReadError::AddressTaken))),
            }
        }
    }
}

/// The next reading; the turn that sets up a part may give none.
fn read_one(devices: &mut BusDevices, bus: &mut Wires) -> Result<Measurement, ReadError> {
    let mut readings = read_next(devices, bus);
    if readings.is_empty() {
        readings = read_next(devices, bus);
    }
    assert_eq!(readings.len(), 1, "{readings:?}");
    readings[0].1
}

/// 16 LiFe cells, the last of which is at this voltage in millivolts: the state after three seconds.
fn sixteen_cells(last_mv: u16) -> BatteryState {
    let mut words = [3300; 20];
    words[15] = last_mv;
    // The stack in units of 10 mV, two pins and the current.
    words[16] = ((15 * 3300 + u32::from(last_mv)) / 10) as u16;
    words[17..].fill(0);
    let mut devices = devices_of(PartKind::Bq76952);
    let mut stack = Stack::new(&words, [0; 12], [5, 0, 0]);
    // 25 °C.
    stack.commands[0x68..0x6a].copy_from_slice(&2981u16.to_le_bytes());
    let mut bus = Buses::i2c(stack);
    let mut pack = Sampled::default();
    let settings = PackSettings {
        chemistry: Chemistry::LiFe,
        ..PackSettings::default()
    };
    for _ in 1..30 {
        for (_, reading) in read_next(&mut devices, &mut bus) {
            pack.take(reading, &settings);
        }
    }
    pack.state
}

#[test]
// Requirement: AP-7
fn the_last_of_sixteen_cells_is_one_of_them() {
    let sound = sixteen_cells(3300);
    assert_eq!(
        (sound.readings.voltage_v, sound.cell_count),
        (Some(52.8), Some(16))
    );
    assert_eq!(sound.readings.faults, Faults::empty());
    // Half full: 14 cells would be full at this voltage.
    assert!(
        sound.readings.remaining_pct.is_none_or(|percent| percent < 80.0),
        "{sound:?}"
    );
    let broken = sixteen_cells(2000);
    assert_eq!(broken.readings.faults, Faults::CELL_FAIL | Faults::DEEP_DISCHARGE);
}

/// The second pack is this stack.
fn on_stack(stack: Stack) -> (BusDevices, Buses<Stack, NoSpi>) {
    (devices_of(PartKind::Bq76952), Buses::i2c(stack))
}

/// Its words from the first cell to the current, in its units.
fn stack_words(cells_mv: [u16; 16], stack: u16, current: i16) -> [u16; 20] {
    let mut words = [0; 20];
    words[..16].copy_from_slice(&cells_mv);
    (words[16], words[19]) = (stack, current as u16);
    words
}

/// The first three, and the last.
const INPUTS_MV: [u16; 16] = [3900, 3800, 3700, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 3600];

fn assert_stack(reading: Result<Measurement, ReadError>, voltage_v: f32, current_a: f32, cells_mv: &[u16]) {
    let reading = reading.expect("it answers");
    assert_near(reading.voltage_v, voltage_v);
    assert_near(reading.current_a, current_a);
    assert_eq!(reading.cells.millivolts(), cells_mv);
}

#[test]
// Requirement: AP-7
fn a_stack_is_read_in_the_units_and_at_the_inputs_it_is_set_up_for() {
    // Units of 10 mV and 10 mA.
    let words = stack_words(INPUTS_MV, 1500, -12_000);
    let (mut devices, mut bus) = on_stack(Stack::new(&words, [0; 12], [0x06, 0x07, 0x80]));
    let reading = read_next(&mut devices, &mut bus)[0].1;
    assert_stack(reading, 15.0, 120.0, &[3900, 3800, 3700, 3600]);
    // It is set up for 1 mV, 1 mA and the first two cells.
    bus.i2c = Stack::new(&stack_words(INPUTS_MV, 15_000, -20_000), [0; 12], [0x01, 0x03, 0]);
    assert_eq!(read_next(&mut devices, &mut bus)[0].1, Err(ReadError::OtherPart));
    let reading = read_next(&mut devices, &mut bus)[0].1;
    assert_stack(reading, 15.0, 20.0, &[3900, 3800]);
}

#[test]
fn a_sealed_stack_is_read_in_the_units_it_has_by_default() {
    let mut stack = Stack::new(&stack_words(INPUTS_MV, 1500, -5000), [0; 12], [0; 3]);
    stack.commands[0x13] = 3;
    stack.answers.remove(&0x92fd);
    let (mut devices, mut bus) = on_stack(stack);
    let reading = read_next(&mut devices, &mut bus)[0].1;
    assert_stack(reading, 15.0, 5.0, &[3900, 3800, 3700, 3600]);
}

#[test]
fn a_stack_reports_what_its_protection_does() {
    let enabled = 1 << 4;
    let no_discharge = 1 << 5;
    for (safety, alarms, manufacturing, faults, modes) in [
        (0, 0, 0, Faults::empty(), Modes::empty()),
        (
            0,
            1 << 2,
            enabled,
            Faults::empty(),
            Modes::PROTECTED | Modes::BALANCING,
        ),
        (
            1 << 7,
            1 << 14 | no_discharge,
            enabled,
            Faults::SHORT_CIRCUIT | Faults::SWITCHED_OFF,
            Modes::PROTECTED,
        ),
        // By a command.
        (0, no_discharge, enabled, Faults::empty(), Modes::PROTECTED),
    ] {
        let mut stack = Stack::new(&stack_words(INPUTS_MV, 1500, 0), [0; 12], [5, 0, 0]);
        stack.commands[0x03] = safety;
        stack.commands[0x64..0x66].copy_from_slice(&u16::to_le_bytes(alarms));
        stack.answers.insert(0x0057, vec![manufacturing, 0]);
        let (mut devices, mut bus) = on_stack(stack);
        let (_, reading) = read_next(&mut devices, &mut bus)[0];
        let reported = reading.expect("it answers").reported;
        assert_eq!((reported.faults, reported.modes), (faults, modes));
    }
}

/// A battery that follows version 1.1 of the specification, with these words instead of its own.
fn battery(words: &[(u8, u16)]) -> Wires {
    let mut bus = wires(Tables::default());
    let own = [
        (0x03, 0),
        (0x08, 2981),
        (0x09, 7400),
        (0x0a, 0x10000 - 1500),
        (0x0f, 1300),
        (0x10, 2600),
        (0x17, 12),
        (0x18, 3250),
        (0x19, 7200),
        (0x1a, 0x0021),
        (0x1b, 44 << 9 | 5 << 5 | 17),
        (0x1c, 4711),
        (0x3f, 3690),
        (0x3e, 3710),
    ];
    for (command, word) in own
        .into_iter()
        .map(|(command, word)| (command, word as u16))
        .chain(words.iter().copied())
    {
        bus.i2c.set(0x0b, command, &word.to_le_bytes());
    }
    for (command, text) in [(0x20, "Acme"), (0x21, "2S"), (0x22, "LiP")] {
        bus.i2c
            .set(0x0b, command, &[&[text.len() as u8], text.as_bytes()].concat());
    }
    bus
}

#[track_caller]
fn assert_near(value: Option<f32>, expected: f32) {
    let value = value.expect("it is measured");
    assert!(
        (value - expected).abs() <= expected.abs() * 1e-5,
        "{value} is not {expected}"
    );
}

fn read_battery(mut bus: Wires) -> Measurement {
    let mut devices = devices_of(PartKind::SmartBattery);
    read_one(&mut devices, &mut bus).expect("it answers");
    read_one(&mut devices, &mut bus).expect("it answers again")
}

#[test]
fn a_smart_battery_introduces_itself() {
    let reading = read_battery(battery(&[]));
    assert_near(reading.voltage_v, 7.4);
    assert_near(reading.current_a, 1.5);
    assert_near(reading.temperature_c, 24.95);
    let gauge = reading.gauge.read().unwrap();
    assert_eq!((gauge.remaining_mah, gauge.full_mah), (1300.0, 2600.0));
    assert_eq!(reading.cells.millivolts(), [3690, 3710]);
    let details = reading.details;
    assert_eq!(
        (details.manufacturer.as_bytes(), details.device.as_bytes()),
        (&b"Acme"[..], &b"2S"[..])
    );
    let numbers = (Some(4711), Some(12));
    assert_eq!((details.serial_number, details.cycle_count), numbers);
    assert_eq!(details.design_capacity_mah, Some(3250.0));
    assert_near(details.design_voltage_v, 7.2);
    assert_eq!(details.state_of_health_pct, Some(80));
    assert_eq!(details.chemistry, Some(Chemistry::LiPo));
    let date = Date {
        year: 2024,
        month: 5,
        day: 17,
    };
    assert_eq!(details.manufactured, Some(date));
}

/// Report of a smart battery once each of its slow words was read.
fn reported_by(words: &[(u8, u16)]) -> Reported {
    let mut devices = devices_of(PartKind::SmartBattery);
    let mut bus = battery(words);
    let readings = (0..4).map(|_| read_one(&mut devices, &mut bus).expect("it answers"));
    readings.last().expect("four").reported
}

#[test]
// Requirement: AP-5
fn status_and_error_of_a_smart_battery_are_reported() {
    assert_eq!(reported_by(&[]), Reported::NONE, "it refuses both");
    let blank = reported_by(&[(0x16, 0xffff), (0x0c, 0xffff)]);
    assert_eq!(blank, Reported::NONE);
    let full = reported_by(&[(0x16, 0x00e0), (0x0c, 4)]);
    assert_eq!((full.faults, full.modes), (Faults::empty(), Modes::FULL));
    assert_eq!(full.gauge.error_pct, Some(4));
    let empty_and_hot = reported_by(&[(0x16, 0x18c0), (0x0c, 101)]);
    assert_eq!(empty_and_hot.faults, Faults::OVER_TEMPERATURE);
    // Fully discharged, an alarm to end the discharge, or both; an alarm of the remaining capacity.
    for (status, charge_state) in [
        (0x00e0, None),
        (0x00d0, Some(ChargeState::Emergency)),
        (0x08c0, Some(ChargeState::Emergency)),
        (0x0ad0, Some(ChargeState::Emergency)),
        (0x02c0, Some(ChargeState::Low)),
    ] {
        assert_eq!(
            reported_by(&[(0x16, status)]).charge_state,
            charge_state,
            "{status:#x}"
        );
    }
    assert_eq!(empty_and_hot.gauge.error_pct, None, "out of range");
}

#[test]
fn word_that_a_battery_refuses_later_stays_as_it_was() {
    let mut devices = devices_of(PartKind::SmartBattery);
    let mut bus = battery(&[]);
    for _ in 0..2 {
        read_one(&mut devices, &mut bus).expect("it answers");
    }
    for command in [0x10, 0x17] {
        bus.i2c.0.remove(&(0x0b, command));
    }
    for _ in 0..4 {
        let reading = read_one(&mut devices, &mut bus).expect("it answers again");
        assert_eq!(reading.gauge.read().map(|gauge| gauge.full_mah), Some(2600.0));
        assert_eq!(reading.details.cycle_count, Some(12));
    }
    // What is left is known now or not at all.
    bus.i2c.0.remove(&(0x0b, 0x0f));
    let reading = read_one(&mut devices, &mut bus).expect("it answers again");
    assert_eq!(reading.gauge, GaugeReading::Missing);
}

#[test]
fn cycles_are_counted_on_and_another_serial_number_is_another_battery() {
    let mut devices = devices_of(PartKind::SmartBattery);
    read_one(&mut devices, &mut battery(&[])).expect("it answers");
    let mut older = battery(&[(0x17, 13)]);
    let readings = [0; 5].map(|_| read_one(&mut devices, &mut older).expect("it answers"));
    assert_eq!(readings[4].details.cycle_count, Some(13));
    let mut other = battery(&[(0x1c, 815), (0x17, 7), (0x0f, 1000), (0x10, 2000)]);
    assert_eq!(read_one(&mut devices, &mut other), Err(ReadError::OtherPart));
    let reading = read_one(&mut devices, &mut other).expect("it is set up");
    let details = reading.details;
    assert_eq!((details.serial_number, details.cycle_count), (Some(815), Some(7)));
    let gauge = reading.gauge.read().unwrap();
    assert_eq!((gauge.remaining_mah, gauge.full_mah), (1000.0, 2000.0));
}

#[test]
fn what_a_battery_does_not_report_is_unknown() {
    let mut bus = battery(&[(0x17, 0xffff), (0x18, 0), (0x10, 0xffff), (0x1b, 0)]);
    for command in [0x08, 0x20, 0x21, 0x22, 0x1c] {
        bus.i2c.0.remove(&(0x0b, command));
    }
    let reading = read_battery(bus);
    assert_eq!((reading.temperature_c, reading.gauge.read()), (None, None));
    let details = reading.details;
    assert!(details.manufacturer.is_empty() && details.device.is_empty());
    assert_eq!((details.serial_number, details.cycle_count), (None, None));
    assert_eq!(
        (details.design_capacity_mah, details.state_of_health_pct),
        (None, None)
    );
    assert_eq!((details.chemistry, details.manufactured), (None, None));
}

#[test]
fn commands_a_maker_uses_for_something_else_are_no_cells() {
    let reading = read_battery(battery(&[(0x3f, 1234), (0x3e, 555)]));
    assert!(reading.cells.millivolts().is_empty());
    // A third one that would be a cell by itself is not one of two that amount to the pack's voltage.
    let reading = read_battery(battery(&[(0x3d, 3700)]));
    assert_eq!(reading.cells.millivolts().len(), 2);
}

/// An INA228 at 0x40 that was set up, with these counters.
fn counters(bus: &mut Wires, charge: i64, energy: u64) {
    bus.i2c.set(0x40, 0x3e, &0x5449u16.to_be_bytes());
    bus.i2c.set(0x40, 0x3f, &0x2281u16.to_be_bytes());
    bus.i2c.set(0x40, 0xfe, &[0, 0]);
    bus.i2c.set(0x40, 0xff, &[0, 0]);
    bus.i2c.set(0x40, 0x00, &[0, 0]);
    bus.i2c.set(0x40, 0x01, &0xb92au16.to_be_bytes());
    // 13107.2e6 × 90 A / 2^19 × 0.5 mΩ
    bus.i2c.set(0x40, 0x02, &1125u16.to_be_bytes());
    bus.i2c.set(0x40, 0x04, &[0, 0, 0]);
    bus.i2c.set(0x40, 0x05, &(61_440u32 << 12).to_be_bytes()[..3]);
    bus.i2c.set(0x40, 0x09, &energy.to_be_bytes()[3..]);
    bus.i2c.set(0x40, 0x0a, &charge.to_be_bytes()[3..]);
}

#[test]
fn counters_go_on_over_their_end_and_their_sign() {
    let top = (1i64 << 39) - 1;
    // By steps of 171.66 µA: this many coulombs for 36 mAh, and this many joules for 0.36 Wh.
    let steps = (129.6 / 171.661_38e-6) as i64;
    let energy_steps = (1296.0 / (171.661_38e-6 * 51.2)) as u64;
    for (from, to, sign) in [(top, top.wrapping_add(steps), 1.0), (-100, -100 - steps, -1.0)] {
        let mut bus = wires(Tables::default());
        let mut devices = devices_of(PartKind::Ina2xx);
        let energy = (1u64 << 40) - 5;
        counters(&mut bus, from, energy);
        let first = read_one(&mut devices, &mut bus).unwrap().counted;
        assert_eq!(first, None);
        counters(&mut bus, to, energy + energy_steps);
        let reading = read_one(&mut devices, &mut bus).unwrap();
        assert_eq!(reading.voltage_v, Some(12.0));
        let Some(crate::battery::Counted::Increment(counted)) = reading.counted else {
            panic!("{reading:?}");
        };
        assert!((counted.charge_mah - 36.0 * sign).abs() < 0.001, "{counted:?}");
        assert!((counted.energy_wh - 0.36 * sign).abs() < 1e-5, "{counted:?}");
    }
}

/// A part of this kind, its address, and the registers by which it is recognised and set up.
struct Recorded {
    kind: PartKind,
    address: u8,
    registers: Vec<(u8, Vec<u8>)>,
}

impl Recorded {
    fn new(kind: PartKind, address: u8, words: &[(u8, u16)]) -> Self {
        let registers = words
            .iter()
            .map(|(register, word)| (*register, word.to_be_bytes().to_vec()));
        Self {
            kind,
            address,
            registers: registers.collect(),
        }
    }
}

/// With an identification and a configuration.
fn ina(kind: PartKind, identity: &[(u8, u16)], configured: &[(u8, u16)]) -> Recorded {
    // Registers of the others of the family.
    let absent = [(0xfe, 0), (0xff, 0), (0x3e, 0), (0x3f, 0)];
    let words = [&absent[..], identity, configured].concat();
    Recorded::new(kind, 0x40, &words)
}

const TI: u16 = 0x5449;

fn ina226() -> Recorded {
    ina(PartKind::Ina2xx, &[(0xfe, TI), (0xff, 0x2260)], &[(0, 0x44df)])
}

fn ina231() -> Recorded {
    ina(PartKind::Ina2xx, &[], &[(0, 0x44df)])
}

fn ina219() -> Recorded {
    ina(PartKind::Ina2xx, &[], &[(0, 0x3e67)])
}

fn ina260() -> Recorded {
    ina(PartKind::Ina2xx, &[(0xfe, TI), (0xff, 0x2270)], &[(0, 0x64df)])
}

fn ina238() -> Recorded {
    let identity = [(0x3e, TI), (0x3f, 0x2380)];
    ina(PartKind::Ina2xx, &identity, &[(0, 0), (1, 0xb92a)])
}

fn ina228() -> Recorded {
    let identity = [(0x3e, TI), (0x3f, 0x2281)];
    // 13107.2e6 x 60 A / 2^19 x 2 mOhm.
    let configured = [(0, 0), (1, 0xb92a), (2, 3000)];
    let mut part = ina(PartKind::Ina2xx, &identity, &configured);
    part.registers.extend([(0x09, vec![0; 5]), (0x0a, vec![0; 5])]);
    part
}

fn ina3221() -> Recorded {
    let words = [(0xfe, TI), (0xff, 0x3220), (0, 0x74df)];
    Recorded::new(PartKind::Ina3221, 0x40, &words)
}

fn ltc2946() -> Recorded {
    let mut part = Recorded::new(PartKind::Ltc2946, 0x6f, &[]);
    part.registers = vec![
        (0xe7, vec![0x60]),
        (0x00, vec![0x98]),
        (0x01, vec![0]),
        (0x38, vec![0; 4]),
        (0x3c, vec![0; 4]),
    ];
    part
}

#[test]
fn a_part_is_read_once_the_first_conversion_after_its_set_up_is_over() {
    // Twice 16 times 588 us; 16 times 540 us; six times as much as the first; four conversions of 16.4 ms: a tenth longer at
    // the most.
    for (part, conversion_ms) in [
        (ina226(), 18.8),
        (ina219(), 17.0),
        (ina238(), 17.3),
        (ina3221(), 56.5),
        (ltc2946(), 65.6),
    ] {
        let mut bus = wires(Tables::default());
        for (register, bytes) in &part.registers {
            bus.i2c.set(part.address, *register, bytes);
        }
        let mut devices = devices_of(part.kind);
        let set_up = devices.next_due().unwrap();
        assert_eq!(read_next(&mut devices, &mut bus), [], "{:?}", part.kind);
        let waits_ms = devices.next_due().unwrap().us_since(set_up) as f32 / 1e3;
        assert!(waits_ms > 1.1 * conversion_ms, "{:?} {waits_ms} ms", part.kind);
    }
}

/// Tables of which some addresses hold up the bus.
struct Slow {
    tables: Tables,
    slow: &'static [u8],
    time_outs: usize,
}

impl I2cBus for Slow {
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        if self.slow.contains(&address) {
            self.time_outs += 1;
            return Err(BusError::Timeout);
        }
        self.tables.transfer(address, operations).await
    }
}

#[test]
fn devices_that_time_out_do_not_end_a_search_and_hold_up_one_turn_each() {
    for (slow, turns) in [(&[0x40][..], 2), (&[0x40, 0x41], 3), (&[0x41], 2), (&[0x45], 1)] {
        let mut tables = Tables::default();
        let mut part = ina226();
        part.registers.extend([(1, vec![0, 0]), (2, vec![0x25, 0x70])]);
        for (register, bytes) in &part.registers {
            tables.set(0x44, *register, bytes);
        }
        let mut bus = Buses::i2c(Slow {
            tables,
            slow,
            time_outs: 0,
        });
        let mut devices = devices_of(PartKind::Ina2xx);
        for turn in 1..turns {
            let reading = read_next(&mut devices, &mut bus);
            assert_eq!(reading, [(Pack::Second, Err(BusError::Timeout.into()))]);
            assert_eq!(bus.i2c.time_outs, turn);
        }
        assert_eq!(read_next(&mut devices, &mut bus), [], "set up");
        let (_, reading) = read_next(&mut devices, &mut bus)[0];
        assert_near(reading.expect("it answers").voltage_v, 11.98);
    }
}

#[test]
fn the_second_of_two_packs_at_one_channel_has_its_address_taken() {
    let third_at = |address: f32, channel: f32| {
        let monitor = MonitorKind::Bus(PartKind::Ina3221).number() as f32;
        let mut devices = BusDevices::from_parameters(
            &parameters(&[
                (Pack::Second, BatteryParameter::Monitor, monitor),
                (Pack::Second, BatteryParameter::I2cAddr, address),
                (Pack::Third, BatteryParameter::Monitor, monitor),
                (Pack::Third, BatteryParameter::I2cAddr, address),
                (Pack::Third, BatteryParameter::Channel, channel),
            ]),
            Instant::EPOCH,
        );
        let mut bus = wires(Tables::default());
        for (register, bytes) in ina3221().registers {
            bus.i2c.set(0x40, register, &bytes);
        }
        // 12 V and 8 V.
        for (register, code) in [(1, 0), (2, 1500 << 3), (3, 0), (4, 1000u16 << 3)] {
            bus.i2c.set(0x40, register, &code.to_be_bytes());
        }
        let mut latest = [None; 2];
        for (pack, reading) in (0..6).flat_map(|_| read_next(&mut devices, &mut bus)) {
            let place = if pack == Pack::Second { 0 } else { 1 };
            latest[place] = Some(reading.map(|reading| reading.voltage_v.map(f32::round)));
        }
        latest
    };
    let taken = Some(Err(ReadError::AddressTaken));
    for address in [0.0, 64.0] {
        assert_eq!(third_at(address, 1.0), [Some(Ok(Some(12.0))), taken]);
        assert_eq!(
            third_at(address, 2.0),
            [Some(Ok(Some(12.0))), Some(Ok(Some(8.0)))]
        );
    }
}

#[test]
fn a_part_that_is_refused_three_times_is_given_time() {
    let mut devices = devices_of(PartKind::Ina2xx);
    let mut bus = wires(Tables::default());
    let mut due = Vec::new();
    for _ in 0..5 {
        due.push(devices.next_due().unwrap());
        assert_eq!(read_one(&mut devices, &mut bus), Err(BusError::NoAnswer.into()));
    }
    let waits_ms: Vec<_> = due
        .windows(2)
        .map(|pair| pair[1].us_since(pair[0]) / 1000)
        .collect();
    assert_eq!(due[0].us_since(Instant::EPOCH), 12_500, "between two ticks");
    assert_eq!(waits_ms, [25, 25, 225, 225]);
}

#[test]
fn the_slowest_part_sets_the_clock() {
    assert_eq!(bus_clock_hz(&Parameters::defaults()), 400_000);
    assert_eq!(bus_clock_hz(&second_is(PartKind::Ina2xx)), 400_000);
    assert_eq!(bus_clock_hz(&second_is(PartKind::SmartBattery)), 100_000);
}

#[test]
fn only_an_address_that_a_device_can_have_is_set_and_0_is_searched_for() {
    let id = BatteryParameter::I2cAddr.of(Pack::First);
    for (value, address) in [
        (0.0, Ok(None)),
        (8.0, Ok(Some(Address::I2c(8)))),
        (119.0, Ok(Some(Address::I2c(0x77)))),
        (1.0, Err(Refused::OutOfRange)),
        (7.0, Err(Refused::OutOfRange)),
        (120.0, Err(Refused::OutOfRange)),
        (-1.0, Err(Refused::OutOfRange)),
    ] {
        let mut parameters = Parameters::defaults();
        let set = parameters.set(id, value);
        let found = set.map(|()| Address::from_parameter(parameters.get_whole(id)));
        assert_eq!(found, address, "{value}");
    }
}

/// A foreign bus, whose error is its own type: only its kind is known here.
struct Refusing(ErrorKind);

#[derive(Debug)]
struct ForeignError(ErrorKind);

impl Error for ForeignError {
    fn kind(&self) -> ErrorKind {
        self.0
    }
}

impl ErrorType for Refusing {
    type Error = ForeignError;
}

impl I2c for Refusing {
    async fn transaction(&mut self, _: u8, _: &mut [Operation<'_>]) -> Result<(), ForeignError> {
        Err(ForeignError(self.0))
    }
}

#[test]
fn the_error_of_a_foreign_bus_is_diagnosed_by_its_kind() {
    use NoAcknowledgeSource::{Address, Data, Unknown};
    for (kind, diagnosis) in [
        (ErrorKind::NoAcknowledge(Address), BusError::NoAnswer),
        (ErrorKind::NoAcknowledge(Data), BusError::NoAnswer),
        (ErrorKind::NoAcknowledge(Unknown), BusError::NoAnswer),
        (ErrorKind::ArbitrationLoss, BusError::Transfer),
        (ErrorKind::Bus, BusError::Transfer),
        (ErrorKind::Overrun, BusError::Transfer),
        (ErrorKind::Other, BusError::Transfer),
    ] {
        let mut devices = devices_of(PartKind::Ina2xx);
        let reading = read_next(&mut devices, &mut Buses::i2c(Refusing(kind)));
        assert_eq!(reading, [(Pack::Second, Err(diagnosis.into()))], "{kind:?}");
    }
}

proptest! {
    #[test]
    fn whatever_the_devices_answer_the_packs_stay_sound(
        bytes in prop::collection::vec(prop_oneof![
            8 => any::<u8>().prop_map(Ok),
            2 => Just(Ok(0xff)),
            1 => prop::sample::select(vec![BusError::NoAnswer, BusError::Timeout, BusError::Stuck]).prop_map(Err),
        ], 0..2000),
        kind in prop::sample::select(part_kinds()),
    ) {
        let mut devices = devices_of(kind);
        let mut bus = Buses::i2c(Anything(bytes.into()));
        let mut sampled = Sampled::default();
        // A part that is not on the I2C bus takes nothing from it.
        for _ in 0..200 {
            for (pack, reading) in read_next(&mut devices, &mut bus) {
                prop_assert_eq!(pack, Pack::Second);
                sampled.take(reading, &PackSettings::default());
                sampled.assert_is_sound();
            }
        }
    }

    /// An honest part with any numbers in its registers: recognised, so that these get through.
    #[test]
    fn whatever_an_honest_battery_reports_the_pack_stays_sound(
        words in prop::collection::vec((0u8..0x40, any::<u16>()), 0..40),
        ticks in 1usize..20,
    ) {
        let words: Vec<_> = words.into_iter().filter(|(command, _)| ![0x20, 0x21, 0x22].contains(command)).collect();
        let mut bus = battery(&words);
        let mut devices = devices_of(PartKind::SmartBattery);
        let mut sampled = Sampled::default();
        for _ in 0..ticks {
            for (_, reading) in read_next(&mut devices, &mut bus) {
                sampled.take(reading, &PackSettings::default());
            }
            sampled.assert_is_sound();
        }
    }

    /// An honest stack with any numbers: its units, cells, current and charge.
    #[test]
    fn whatever_an_honest_stack_reports_the_pack_stays_sound(
        readings in prop::collection::vec((any::<[u16; 20]>(), any::<[u8; 12]>()), 1..20),
        units in any::<[u8; 3]>(),
    ) {
        let mut devices = devices_of(PartKind::Bq76952);
        let mut sampled = Sampled::default();
        for (words, charge) in &readings {
            let mut bus = Buses::i2c(Stack::new(words, *charge, units));
            for (_, reading) in read_next(&mut devices, &mut bus) {
                prop_assert!(!matches!(reading, Err(ReadError::OtherPart | ReadError::Bus(_))), "{:?}", reading);
                sampled.take(reading, &PackSettings::default());
            }
            sampled.assert_is_sound();
        }
    }

    /// A motor board with any numbers, and one byte that may be damaged.
    #[test]
    fn a_motor_board_of_a_bebop_is_believed_only_if_its_checksum_is_right(
        body in any::<[u8; 14]>(),
        damage in any::<u8>(),
        place in 0usize..15,
    ) {
        let mut bus = wires(Tables::default());
        bus.i2c.set(0x08, 0xa0, &[1, 5, 2, 4]);
        let sum = body.iter().fold(0, |sum, byte| sum ^ byte);
        let mut observed = [&body[..], &[sum]].concat();
        observed[place] ^= damage;
        bus.i2c.set(0x08, 0x20, &observed);
        let mut devices = devices_of(PartKind::Bebop);
        let millivolts = u16::from_be_bytes([body[8], body[9]]);
        match (read_one(&mut devices, &mut bus), damage) {
            (Ok(reading), 0) => assert_near(reading.voltage_v, f32::from(millivolts) * 1e-3),
            (Err(ReadError::Implausible), 0) => prop_assert_eq!(millivolts, 0),
            (reading, _) => prop_assert_eq!(reading, Err(BusError::Checksum.into())),
        }
    }
}

#[test]
fn a_motor_board_of_another_number_of_motors_is_no_bebops() {
    let mut bus = wires(Tables::default());
    bus.i2c.set(0x08, 0xa0, &[1, 5, 2, 1]);
    let mut devices = devices_of(PartKind::Bebop);
    assert_eq!(read_one(&mut devices, &mut bus), Err(ReadError::OtherPart));
}

/// Address of smart batteries.
const ADDRESS: u8 = 0x0b;

fn add_codes(tables: &mut Tables) {
    for ((_, command), bytes) in &mut tables.0 {
        *bytes = with_code(*command, bytes);
    }
}

/// An answer with its packet error code.
fn with_code(command: u8, answer: &[u8]) -> Vec<u8> {
    let header = [ADDRESS << 1, command, ADDRESS << 1 | 1];
    let code = smbus_pec::pec(&[&header[..], answer].concat());
    [answer, &[code]].concat()
}

fn word(value: i16) -> Vec<u8> {
    value.to_le_bytes().into()
}

fn block(bytes: &[u8]) -> Vec<u8> {
    [&[bytes.len() as u8], bytes].concat()
}

/// Answers of a battery that says it has a packet error code.
type Answers = Vec<(u8, Vec<u8>)>;

/// A battery with these answers instead of others, and with packet error codes if its kind has them.
fn dialect(kind: PartKind, answers: &Answers) -> (BusDevices, Wires) {
    let mut bus = battery(&[(0x1a, 0x0031)]);
    if [PartKind::Sui3Cells, PartKind::Solo].contains(&kind) {
        bus.i2c.0.remove(&(ADDRESS, 0x09));
    }
    for (command, bytes) in answers {
        bus.i2c.set(ADDRESS, *command, bytes);
    }
    if ![PartKind::Maxell, PartKind::Sui3Cells, PartKind::Sui6Cells].contains(&kind) {
        add_codes(&mut bus.i2c);
    }
    (devices_of(kind), bus)
}

#[test]
// Requirement: AP-5
fn each_dialect_is_read_as_its_maker_has_it() {
    let discharge = (-2500i32).to_le_bytes();
    let four_cells = || block(&[4100u16, 4101, 4102, 4103].map(u16::to_le_bytes).concat());
    // A thermistor at 45 °C, and none at the other place.
    let thermistors = [(0x48, word(3182)), (0x49, word(0))];
    let rotoye = |tenths_a| [&thermistors[..], &[(0x41, word(tenths_a))]].concat();
    let ten_cells = (0x30..0x3a).map(|command| (command, word(3700)));
    let neo = [(0x09, word(37_000u16 as i16)), (0x5c, word(10))];
    let sui = || vec![(0x28, four_cells()), (0x2a, discharge.into())];
    let solo = vec![
        (0x28, four_cells()),
        (0x2a, block(&discharge)),
        (0x23, block(&[0; 6])),
    ];
    let maxell = vec![(0x20, block(b"Hitachi maxell")), (0x10, word(2500))];
    /// Volts, amperes, cells, capacity and temperature.
    type Values = (f32, f32, &'static [u16], f32, f32);
    let table: [(PartKind, Answers, Values); 7] = [
        (PartKind::Maxell, maxell, (7.4, 1.5, &[3690, 3710], 5000.0, 24.95)),
        (
            PartKind::Rotoye,
            rotoye(-1),
            (7.4, 1.5, &[3690, 3710], 2600.0, 45.05),
        ),
        // The word does not hold this many milliamperes.
        (
            PartKind::Rotoye,
            rotoye(-800),
            (7.4, 80.0, &[3690, 3710], 2600.0, 45.05),
        ),
        (
            PartKind::Sui3Cells,
            sui(),
            (12.303, 2.5, &[4100, 4101, 4102], 2600.0, 24.95),
        ),
        (
            PartKind::Sui6Cells,
            [&sui()[..], &[(0x09, word(24_600))]].concat(),
            (24.6, 2.5, &[], 2600.0, 24.95),
        ),
        (
            PartKind::NeoDesign,
            neo.into_iter().chain(ten_cells).collect(),
            (37.0, 1.5, &[3700; 10], 2600.0, 24.95),
        ),
        (
            PartKind::Solo,
            solo,
            (16.406, 2.5, &[4100, 4101, 4102, 4103], 2600.0, 24.95),
        ),
    ];
    for (kind, answers, (voltage_v, current_a, cells_mv, full_mah, temperature_c)) in table {
        println!("{kind:?}");
        let (mut devices, mut bus) = dialect(kind, &answers);
        let reading = read_one(&mut devices, &mut bus).expect("it answers");
        assert_near(reading.voltage_v, voltage_v);
        assert_near(reading.current_a, current_a);
        assert_near(reading.temperature_c, temperature_c);
        assert_eq!(reading.cells.millivolts(), cells_mv);
        let gauge = reading.gauge.read().expect("it has one");
        let factor = if kind == PartKind::Maxell { 2.0 } else { 1.0 };
        assert_eq!((gauge.remaining_mah, gauge.full_mah), (1300.0 * factor, full_mah));
    }
}

#[test]
// Requirement: AP-20
fn a_solo_powers_off_while_its_button_is_held_for_seven_readings() {
    let cells = block(&[4100u16; 4].map(u16::to_le_bytes).concat());
    let idle = vec![(0x28, cells), (0x2a, block(&[0; 4])), (0x23, block(&[0; 6]))];
    let (mut devices, mut bus) = dialect(PartKind::Solo, &idle);
    let mut press = |buttons: u8, readings: usize| {
        let answer = with_code(0x23, &block(&[0, buttons, 0, 0, 0, 0]));
        bus.i2c.set(ADDRESS, 0x23, &answer);
        let supplies = (0..readings).map(|_| read_next(&mut devices, &mut bus)[0].1.unwrap().supply);
        supplies.collect::<Vec<_>>()
    };
    assert_eq!(press(8, 6), [Supply::On; 6]);
    assert_eq!(press(0, 1), [Supply::On]);
    let held = press(8, 9);
    assert_eq!((held[5], &held[6..]), (Supply::On, &[Supply::PoweringOff; 3][..]));
    assert_eq!(press(0, 1), [Supply::On]);
}

/// Reads a battery for `seconds`, and returns the latest reading and their number.
fn read_for(
    devices: &mut BusDevices,
    bus: &mut Wires,
    seconds: f32,
) -> (Result<Measurement, ReadError>, usize) {
    let until = devices.next_due().unwrap().after_us((seconds * 1e6) as u64);
    let (mut last, mut readings) = (Err(ReadError::Timeout), 0);
    while devices.next_due().unwrap() < until {
        last = read_one(devices, bus);
        readings += usize::from(last.is_ok());
    }
    (last, readings)
}

#[test]
// Requirement: AP-5
fn what_a_battery_refuses_three_times_is_missing_and_counts_once_it_is_answered() {
    // Its currents and capacities are ten times as large.
    let info = 0x1021u16;
    let mut bus = battery(&[]);
    bus.i2c.0.remove(&(0x0b, 0x1a));
    let mut devices = devices_of(PartKind::SmartBattery);
    let (last, readings) = read_for(&mut devices, &mut bus, 2.2);
    assert_eq!((last, readings), (Err(ReadError::Timeout), 0), "it may be scaled");
    let (last, _) = read_for(&mut devices, &mut bus, 1.0);
    assert_near(last.expect("as if it were not scaled").current_a, 1.5);
    bus.i2c.set(0x0b, 0x1a, &info.to_le_bytes());
    let (last, _) = read_for(&mut devices, &mut bus, 1.3);
    let scaled = last.expect("it answers");
    assert_near(scaled.current_a, 15.0);
    let gauge = scaled.gauge.read().expect("it has one");
    assert_eq!((gauge.remaining_mah, gauge.full_mah), (13_000.0, 26_000.0));

    let mut bus = battery(&[(0x1c, 0)]);
    bus.i2c.0.remove(&(0x0b, 0x03));
    let mut devices = devices_of(PartKind::SmartBattery);
    let (last, readings) = read_for(&mut devices, &mut bus, 2.2);
    let unsettled = last.expect("it is measured");
    assert_eq!((readings, unsettled.gauge), (22, GaugeReading::Missing));
    let details = unsettled.details;
    assert_eq!((details.design_capacity_mah, details.serial_number), (None, None));
    let (last, _) = read_for(&mut devices, &mut bus, 1.0);
    let settled = last.expect("it is measured");
    assert_eq!(settled.gauge.read().map(|gauge| gauge.full_mah), Some(2600.0));
    // 26 Wh at 7.2 V.
    bus.i2c.set(0x0b, 0x03, &(1u16 << 15).to_le_bytes());
    bus.i2c.set(0x0b, 0x1c, &4711u16.to_le_bytes());
    let (last, _) = read_for(&mut devices, &mut bus, 1.3);
    let known = last.expect("it is measured");
    let full_mah = known.gauge.read().map(|gauge| gauge.full_mah);
    assert_near(full_mah, 26_000.0 / 7.2);
    assert_eq!(known.details.serial_number, Some(4711));
}

#[test]
fn capacities_follow_the_mode_in_which_they_are_read() {
    let mut bus = battery(&[]);
    let mut devices = devices_of(PartKind::SmartBattery);
    read_one(&mut devices, &mut bus).expect("it answers");
    // These capacities in steps of 10 mWh at 7.2 V.
    for (command, word) in [(0x03, 1u16 << 15), (0x0f, 936), (0x10, 1872), (0x18, 2340)] {
        bus.i2c.set(0x0b, command, &word.to_le_bytes());
    }
    for number in 0..15 {
        let reading = read_one(&mut devices, &mut bus).expect("it answers");
        match reading.gauge.read() {
            Some(gauge) => assert_near(Some(gauge.remaining_mah / gauge.full_mah), 0.5),
            None => assert!(number < 4, "unknown in reading {number}"),
        }
        if number == 14 {
            assert_near(reading.gauge.read().map(|gauge| gauge.full_mah), 2600.0);
            assert_near(reading.details.design_capacity_mah, 3250.0);
        }
    }
}

#[test]
fn a_battery_that_was_silent_for_a_second_is_introduced_anew() {
    let with =
        |serial: u16, cycles: u16, design: u16| battery(&[(0x1c, serial), (0x17, cycles), (0x18, design)]);
    for (serial, silent_s) in [(0, 0.5), (0, 1.5), (4711, 0.5), (4711, 1.5)] {
        let mut devices = devices_of(PartKind::SmartBattery);
        read_for(&mut devices, &mut with(serial, 12, 3250), 2.0)
            .0
            .expect("it answers");
        read_for(&mut devices, &mut wires(Tables::default()), silent_s)
            .0
            .expect_err("it is gone");
        let mut back = with(serial, 12, 5000);
        for command in [0x1b, 0x20] {
            back.i2c.0.remove(&(0x0b, command));
        }
        let (reading, _) = read_for(&mut devices, &mut back, 2.0);
        let details = reading.expect("it is back").details;
        let is_new = silent_s > 1.0;
        let design_mah = if is_new { 5000.0 } else { 3250.0 };
        assert_eq!(
            details.design_capacity_mah,
            Some(design_mah),
            "{serial}, {silent_s} s"
        );
        // Facts that it refuses now are those of the same battery, if its number says so.
        let is_same = serial != 0 || !is_new;
        let kept = (details.manufactured.is_some(), !details.manufacturer.is_empty());
        assert_eq!(kept, (is_same, is_same), "{serial}, {silent_s} s");
    }
}

#[test]
fn a_name_that_is_too_long_or_fails_its_checksum_is_none_and_keeps_nothing_from_being_read() {
    let bad_names = [vec![33, b'A', b'B'], vec![0xff], with_code(0x21, b"\x02XY")];
    for (mut bad, code) in bad_names.into_iter().zip([0, 0, 1]) {
        let (mut devices, mut bus) = dialect(PartKind::SmartBattery, &vec![]);
        if let Some(last) = bad.last_mut() {
            *last ^= code;
        }
        bus.i2c.set(ADDRESS, 0x21, &bad);
        let reading = read_one(&mut devices, &mut bus).expect("it answers");
        assert!(reading.details.device.is_empty(), "{bad:?}");
        assert_eq!(reading.details.manufacturer.as_bytes(), b"Acme");
        assert_near(reading.voltage_v, 7.4);
    }
}

#[test]
// Requirement: AP-5
fn cells_are_counted_for_15_s_and_given_once_they_add_up_to_the_pack() {
    let with = |cells: &[u16], pack_mv: u16| {
        let cells = (0..16).map(|input| (0x3f - input, cells.get(usize::from(input)).copied().unwrap_or(0)));
        let words: Vec<_> = cells.chain([(0x09, pack_mv)]).collect();
        battery(&words)
    };
    let cells_of = |devices: &mut BusDevices, mut bus: Wires, seconds: f32| {
        let (last, _) = read_for(devices, &mut bus, seconds);
        last.expect("it answers").cells.millivolts().to_vec()
    };
    for (answered_after_s, expected) in [(0.0, 3), (5.0, 3), (13.0, 3), (16.0, 0)] {
        let mut devices = devices_of(PartKind::SmartBattery);
        if answered_after_s > 0.0 {
            let waiting = with(&[3700, 0, 0], 11_100);
            assert!(cells_of(&mut devices, waiting, answered_after_s).is_empty());
        }
        let cells = cells_of(&mut devices, with(&[3700; 3], 11_100), 1.5);
        assert_eq!(cells.len(), expected, "after {answered_after_s} s");
    }
    let mut devices = devices_of(PartKind::SmartBattery);
    let sixteen: Vec<_> = [4200; 15].into_iter().chain([2500]).collect();
    assert_eq!(cells_of(&mut devices, with(&sixteen, 65_500), 1.0), sixteen);
    // 6 % beside the pack, and one that has failed.
    let mut devices = devices_of(PartKind::SmartBattery);
    assert!(cells_of(&mut devices, with(&[3700; 3], 11_800), 1.0).is_empty());
    assert_eq!(cells_of(&mut devices, with(&[3700; 3], 11_600), 1.5).len(), 3);
    assert_eq!(
        cells_of(&mut devices, with(&[3700, 0, 3700], 7400), 1.0),
        [3700, 0, 3700]
    );
}

#[test]
// Requirement: AP-7
fn inputs_of_a_stack_are_its_cells_once_they_add_up_and_its_thermistors_are_the_packs() {
    let stack = |cells_mv, thermistors: &[(u8, u16)], units: [u8; 3]| {
        let mut stack = Stack::new(&stack_words(cells_mv, 1500, 0), [0; 12], units);
        let memory = stack.answers.get_mut(&0x92fd).unwrap();
        stack.commands[0x68..0x6a].copy_from_slice(&3331u16.to_le_bytes());
        for ((pin, (usage, tenths_k)), command) in thermistors.iter().enumerate().zip([0x70, 0x72, 0x74]) {
            memory[pin] = *usage;
            stack.commands[command..command + 2].copy_from_slice(&tenths_k.to_le_bytes());
        }
        stack
    };
    let mut late_mv = INPUTS_MV;
    late_mv[1] = 0;
    for (late, expected) in [(0, 4), (149, 4), (151, 0)] {
        let (mut devices, mut bus) = on_stack(stack(late_mv, &[], [5, 0, 0]));
        for _ in 0..late {
            let reading = read_next(&mut devices, &mut bus)[0].1.expect("it answers");
            assert!(reading.cells.millivolts().is_empty());
        }
        bus.i2c = stack(INPUTS_MV, &[], [5, 0, 0]);
        let reading = read_next(&mut devices, &mut bus)[0].1.expect("it answers");
        assert_eq!(
            reading.cells.millivolts().len(),
            expected,
            "after {late} readings"
        );
    }
    let (of_cells, measured, of_transistors) = (0x07, 0x0b, 0x0f);
    let not_connected = 1500;
    for (thermistors, celsius, thermometer) in [
        (&[][..], 59.95, Thermometer::Device),
        (&[(of_transistors, 3431)], 59.95, Thermometer::Device),
        (&[(of_cells, not_connected)], 59.95, Thermometer::Device),
        (&[(0, 0), (of_cells, 2981)], 24.95, Thermometer::Pack),
        (
            &[(of_cells, 2981), (of_transistors, 3431), (measured, 3131)],
            39.95,
            Thermometer::Pack,
        ),
    ] {
        let (mut devices, mut bus) = on_stack(stack(INPUTS_MV, thermistors, [5, 0, 0]));
        let reading = read_next(&mut devices, &mut bus)[0].1.expect("it answers");
        assert_near(reading.temperature_c, celsius);
        assert_eq!(reading.thermometer, thermometer, "{thermistors:?}");
    }
}

#[test]
fn a_date_needs_a_month_and_a_day() {
    for word in [44 << 9 | 5 << 5, 44 << 9 | 17] {
        let details = read_battery(battery(&[(0x1b, word)])).details;
        assert_eq!(details.manufactured, None, "{word:#x}");
    }
}
