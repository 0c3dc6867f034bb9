//! Parts on the bus, as the emulator has them, read by the firmware's tasks in stepped time: their values and their faults.

use std::cell::{Cell, RefCell};
use std::collections::BTreeMap;
use std::convert::Infallible;
use std::pin::Pin;
use std::rc::Rc;

use embassy_futures::join::join3;
use embassy_time::{Duration, Instant, Timer};
use embedded_hal_async::i2c::Operation;
use embedded_hal_async::spi::{ErrorType, Operation as SpiOperation, SpiDevice};
use emulator::i2c_devices::{
    Ad7091r5, Bq76952, Garbled, Ina219, Ina226, Ina228, Ina3221, Ltc2946, Pec, Reads, SmartBattery,
};
use emulator::spi_devices::Ina239;
use emulator::{Ack, I2cDevice, I2cDirection, Random, SpiClock, SpiDevice as _, SpiMode};
use rover_battmon::autopilot::Autopilot;
use rover_battmon::battery::{BatteryState, BusError, PackStatus, RetainedRecord, Thermometer};
use rover_battmon::mavlink::LinkId;
use rover_battmon::pack::Pack;
use rover_battmon::sensor::{Buses, I2cBus};
use rover_battmon::tasks::{CheckIn, Link, Shared, read_bus, sample_batteries, serve_link};
use rover_battmon_tools::sim::clock::Stepped;
use rover_battmon_tools::sim::stepped::{BYTE_US, Pins, Port};
use support::desk::{id_of, start_with};
use support::frames::{frames, texts_of};
use support::monitor_types::{INA2XX, SMART_BATTERY};
use support::time::SECOND;

use crate::simulated_packs::assert_about;

const LTC2946: f32 = 22.0;
const INA239: f32 = 26.0;
const AD7091R5: f32 = 28.0;
const INA3221: f32 = 30.0;
const BQ76952: f32 = 32.0;

const STACK_AT: u8 = 0x08;
const BATTERY_AT: u8 = 0x0b;
const CONVERTER_AT: u8 = 0x2f;
const MONITOR_AT: u8 = 0x40;

/// The shunt of a pack unless it is set.
const SHUNT_OHM: f64 = 0.0005;

/// An INA226's of a volt, and of an ampere through 2 mOhm.
const STEP: f32 = 1.25e-3;

/// A byte with its acknowledge bit.
const BYTE_BITS: u64 = 9;

/// The time of the emulator.
const CYCLES_PER_US: u64 = 125;

const SPI_CLOCK: SpiClock = SpiClock {
    mode: SpiMode::Mode1,
    hz: 1_000_000,
};

type Device = Rc<RefCell<dyn I2cDevice>>;

/// The devices on both buses.
#[derive(Clone, Default)]
struct Wires {
    devices: Rc<RefCell<BTreeMap<u8, Device>>>,
    behind_select: Rc<RefCell<Option<Ina239>>>,
    /// Addresses of the transfers on the I2C bus.
    transfers: Rc<RefCell<Vec<u8>>>,
    /// Clock of the I2C bus; 0 before the board has set it.
    clock_hz: Rc<Cell<u32>>,
}

impl Wires {
    fn with(devices: impl IntoIterator<Item = (u8, Device)>) -> Self {
        let wires = Self::default();
        wires.devices.borrow_mut().extend(devices);
        wires
    }

    fn attach(&self, address: u8, device: Device) {
        self.devices.borrow_mut().insert(address, device);
    }

    fn detach(&self, address: u8) {
        self.devices.borrow_mut().remove(&address);
    }

    fn device(&self, address: u8) -> Result<Device, BusError> {
        let devices = self.devices.borrow();
        devices.get(&address).cloned().ok_or(BusError::NoAnswer)
    }

    /// Waits until this many bytes of an operation, which began at `start`, are on the wire.
    async fn pass(&self, start: Instant, bytes: u64) {
        let us = bytes * BYTE_BITS * SECOND / u64::from(self.clock_hz.get());
        Timer::at(start + Duration::from_micros(us)).await;
    }
}

impl I2cBus for Wires {
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        self.transfers.borrow_mut().push(address);
        for operation in operations {
            let start = Instant::now();
            let direction = match operation {
                Operation::Write(_) => I2cDirection::Write,
                Operation::Read(_) => I2cDirection::Read,
            };
            self.pass(start, 1).await;
            let device = self.device(address)?;
            device
                .borrow_mut()
                .start(direction, start.as_micros() * CYCLES_PER_US);
            match operation {
                Operation::Write(bytes) => {
                    for (byte, passed) in bytes.iter().zip(2..) {
                        self.pass(start, passed).await;
                        if device.borrow_mut().write(*byte) == Ack::Nack {
                            return Err(BusError::NoAnswer);
                        }
                    }
                }
                Operation::Read(buffer) => {
                    for (byte, passed) in buffer.iter_mut().zip(2..) {
                        *byte = device.borrow_mut().read();
                        self.pass(start, passed).await;
                    }
                }
            }
        }
        Ok(())
    }
}

impl ErrorType for Wires {
    type Error = Infallible;
}

impl SpiDevice for Wires {
    async fn transaction(&mut self, operations: &mut [SpiOperation<'_, u8>]) -> Result<(), Infallible> {
        let mut device = self.behind_select.borrow_mut();
        for device in device.iter_mut() {
            device.advance(Instant::now().as_micros() * CYCLES_PER_US);
            device.select();
        }
        // Nothing else drives the line.
        let mut exchange = |byte| {
            let answer = device.as_mut().map(|device| device.exchange(byte, SPI_CLOCK));
            answer.flatten().unwrap_or(0xff)
        };
        for operation in operations {
            match operation {
                SpiOperation::Write(bytes) => {
                    let _: Vec<u8> = bytes.iter().map(|byte| exchange(*byte)).collect();
                }
                SpiOperation::Read(buffer) => buffer.fill_with(|| exchange(0)),
                other => unimplemented!("{other:?}"),
            }
        }
        Ok(())
    }
}

/// A rover with these devices, and a ground station.
struct Rover {
    wires: Wires,
    shared: Rc<Shared>,
    port: Rc<Port>,
    run: Stepped<Pin<Box<dyn Future<Output = ()>>>>,
    now_us: u64,
}

/// The tasks.
async fn run(wires: Wires, shared: Rc<Shared>, port: Rc<Port>) {
    let check_in = CheckIn::new("", u32::MAX);
    let link = Link::of_board(LinkId::Uart0, &shared);
    let pins = Pins::default();
    let mut memory = [RetainedRecord::BLANK; 2];
    let buses = Buses {
        i2c: wires.clone(),
        spi: wires,
    };
    join3(
        sample_batteries(&pins, &mut memory, &shared, &check_in),
        read_bus(buses, &shared, &check_in),
        serve_link(&*port, &*port, &shared, &link, &check_in),
    )
    .await;
}

impl Rover {
    /// After a second.
    fn with(wires: &Wires, settings: &[(&str, f32)]) -> Self {
        let shared = Rc::new(Shared::new(&start_with(settings)));
        let wiring = shared.with(|autopilot| autopilot.wiring());
        wires.clock_hz.set(wiring.i2c_clock_hz);
        let port = Rc::new(Port::new(BYTE_US));
        let run = run(wires.clone(), Rc::clone(&shared), Rc::clone(&port));
        let mut rover = Self {
            wires: wires.clone(),
            shared,
            port,
            run: Stepped::new(Box::pin(run)),
            now_us: 0,
        };
        rover.run_for(SECOND);
        rover
    }

    fn run_for(&mut self, duration_us: u64) {
        self.now_us += duration_us;
        self.run.run_until(self.now_us);
    }

    fn state(&self, pack: Pack) -> BatteryState {
        self.shared.with(|autopilot| *autopilot.battery(pack))
    }

    /// Announcements of a pack's health.
    fn health(&self, number: u8) -> Vec<String> {
        let mut texts = texts_of(&frames(&self.port.sent()));
        let beginning = format!("Battery {number} ");
        texts.retain(|text| text.starts_with(&beginning) && text.contains("healthy"));
        texts
    }

    /// The number of transfers with this address in a while.
    fn transfers_in(&mut self, duration_us: u64, address: u8) -> usize {
        self.wires.transfers.take();
        self.run_for(duration_us);
        let transfers = self.wires.transfers.take();
        transfers.iter().filter(|other| **other == address).count()
    }

    /// With the tolerance of each, in volts and amperes.
    #[track_caller]
    fn assert_measures(&self, pack: Pack, (volts, step_v): (f32, f32), (amperes, step_a): (f32, f32)) {
        let readings = self.state(pack).readings;
        assert_about(readings.voltage_v, volts, step_v);
        assert_about(readings.current_a, amperes, step_a);
    }
}

/// A device that is set like this.
fn device<D: I2cDevice + 'static>(mut device: D, set: impl FnOnce(&mut D)) -> Rc<RefCell<D>> {
    set(&mut device);
    Rc::new(RefCell::new(device))
}

fn ina226(volts: f64, amperes: f64) -> Device {
    device(Ina226::new(SHUNT_OHM), |part| part.set(volts, amperes))
}

#[test]
// Requirement: AP-6
fn each_part_measures_voltage_and_current_within_a_step() {
    // The datasheet's example: 10 A through 2 mOhm at 11.98 V. In 2.5 uV over 2 mOhm there are 1.25 mA.
    let example = device(Ina226::new(0.002), |part| part.set(11.98, 10.0));
    let charging = device(Ina226::new(0.002), |part| part.set(7.3, -2.5));
    let ina260 = device(Ina226::ina260(), |part| part.set(12.345, 4.2));
    let ina228 = device(Ina228::new(SHUNT_OHM), |part| part.set(12.0, 36.0, 60.0));
    let ina238 = device(Ina228::ina238(SHUNT_OHM), |part| part.set(12.5, 30.0, 60.0));
    let ltc2946 = device(Ltc2946::new(SHUNT_OHM), |part| part.set(12.0, 36.0));
    let counter = ina228.clone();
    let shunt = [("BATT2_SHUNT", 0.002)];
    let at_74 = [("BATT2_I2C_ADDR", 74.0), ("BATT2_MAX_AMPS", 100.0)];
    /// Kind, address, part, settings; voltage and current, each with its step.
    type Row<'a> = (f32, u8, Device, &'a [(&'a str, f32)], (f32, f32), (f32, f32));
    let table: [Row<'_>; 6] = [
        (INA2XX, 0x40, example, &shunt, (11.98, STEP), (10.0, STEP)),
        (INA2XX, 0x41, charging, &shunt, (7.3, STEP), (-2.5, STEP)),
        // Its shunt is inside.
        (INA2XX, 0x45, ina260, &shunt, (12.345, STEP), (4.2, STEP)),
        (INA2XX, 74, counter, &at_74, (12.0, 2e-4), (36.0, 7e-4)),
        (INA2XX, 0x44, ina238, &[], (12.5, 3.125e-3), (30.0, 10e-3)),
        (LTC2946, 0x6f, ltc2946, &[], (12.0, 25e-3), (36.0, 50e-3)),
    ];
    for (kind, address, part, settings, voltage, current) in table {
        let wires = Wires::with([(address, part)]);
        let settings = [&[("BATT2_MONITOR", kind)], settings].concat();
        let rover = Rover::with(&wires, &settings);
        rover.assert_measures(Pack::Second, voltage, current);
        let temperature_c = rover.state(Pack::Second).temperature_c;
        assert_eq!(temperature_c, None, "the chip's is not the pack's");
    }
    // 13107.2e6 x 100 A / 2^19 x 0.5 mOhm
    assert_eq!(ina228.borrow().shunt_calibration(), 1250);
}

#[test]
// Requirement: AP-6
fn a_part_without_identification_is_known_by_its_set_up_when_the_board_restarts() {
    let ina231 = device(Ina226::ina231(0.002), |part| part.set(11.1, 4.0));
    let ina219 = device(Ina219::new(0.1), |part| part.set(7.416, 1.25));
    for (part, shunt_ohm, voltage, current) in [
        (ina231 as Device, 0.002, (11.1, STEP), (4.0, STEP)),
        (ina219.clone() as Device, 0.1, (7.416, 4e-3), (1.25, 1e-4)),
    ] {
        let wires = Wires::with([(MONITOR_AT, part)]);
        for _ in 0..2 {
            let rover = Rover::with(&wires, &[("BATT2_MONITOR", INA2XX), ("BATT2_SHUNT", shunt_ohm)]);
            rover.assert_measures(Pack::Second, voltage, current);
        }
    }
    // 32 V, 320 mV, 16 samples of each, continuously.
    assert_eq!(ina219.borrow().configuration(), 0x3e67);
}

fn ina239() -> Ina239 {
    let mut part = Ina239::new(0.0002);
    part.set(24.0, -12.0, 25.0);
    part
}

#[test]
// Requirement: AP-6
fn an_ina239_is_read_by_spi_and_recovers_after_it_was_unplugged() {
    let wires = Wires::default();
    wires.behind_select.replace(Some(ina239()));
    let mut rover = Rover::with(&wires, &[("BATT2_MONITOR", INA239), ("BATT2_SHUNT", 0.0002)]);
    // 5 uV over 0.2 mOhm.
    rover.assert_measures(Pack::Second, (24.0, 3.125e-3), (-12.0, 25e-3));
    wires.behind_select.replace(None);
    rover.run_for(5 * SECOND);
    assert_eq!(rover.health(2), ["Battery 2 unhealthy: unknown part"]);
    // It has lost what was set.
    wires.behind_select.replace(Some(ina239()));
    rover.run_for(8 * SECOND);
    assert_eq!(rover.health(2)[1..], ["Battery 2 healthy again"]);
    rover.assert_measures(Pack::Second, (24.0, 3.125e-3), (-12.0, 25e-3));
}

#[test]
// Requirement: AP-6
fn an_ina3221_measures_three_packs_at_one_address() {
    let channels = [
        (Pack::Second, 12.6, 1.2),
        (Pack::Third, 7.4, -0.4),
        (Pack::Fourth, 5.0, 10.0),
    ];
    let part = device(Ina3221::new(SHUNT_OHM), |part| {
        for (channel, (_, volts, amperes)) in (1..).zip(channels) {
            part.set(channel, volts, amperes);
        }
    });
    let settings = [
        ("BATT2_MONITOR", INA3221),
        ("BATT3_MONITOR", INA3221),
        ("BATT3_CHANNEL", 2.0),
        ("BATT4_MONITOR", INA3221),
        ("BATT4_CHANNEL", 3.0),
    ];
    let mut rover = Rover::with(&Wires::with([(0x42, part as Device)]), &settings);
    for (pack, volts, amperes) in channels {
        rover.assert_measures(pack, (volts as f32, 8e-3), (amperes as f32, 80e-3));
    }
    // Two for each channel, and a check.
    assert_eq!(rover.transfers_in(SECOND, 0x42), 10 * 9);
}

#[test]
fn several_power_monitors_are_found_one_after_the_other() {
    let parts = [(0x45, 12.0), (0x40, 10.0), (0x41, 11.0)];
    let wires = Wires::with(parts.map(|(address, volts)| (address, ina226(volts, 1.0))));
    let settings = ["BATT2_MONITOR", "BATT3_MONITOR", "BATT4_MONITOR"].map(|name| (name, INA2XX));
    let rover = Rover::with(&wires, &settings);
    for (pack, volts) in [(Pack::Second, 10.0), (Pack::Third, 11.0), (Pack::Fourth, 12.0)] {
        rover.assert_measures(pack, (volts, STEP), (1.0, 5e-3));
    }
}

fn stack() -> Bq76952 {
    let mut stack = Bq76952::new();
    stack.set(&[4000, 4010, 3990], 7.2, 31.0);
    stack
}

/// Charge and energy drawn from the second pack.
fn drawn(rover: &Rover) -> (f32, f32) {
    let state = rover.state(Pack::Second);
    let drawn = state.consumed_mah().zip(state.consumed_wh);
    drawn.expect("it is counted")
}

#[test]
// Requirement: AP-7
fn a_stack_counts_its_charge_while_it_is_not_read_and_back_while_it_charges() {
    let part = device(stack(), |_| ());
    let wires = Wires::with([(STACK_AT, part.clone() as Device)]);
    let mut rover = Rover::with(&wires, &[("BATT2_MONITOR", BQ76952)]);
    let state = rover.state(Pack::Second);
    assert_eq!(state.cells.millivolts(), [4000, 4010, 3990]);
    assert_about(state.temperature_c, 31.0, 0.05);
    rover.assert_measures(Pack::Second, (12.0, 1e-3), (7.2, 1e-3));
    let (before_mah, _) = drawn(&rover);
    wires.detach(STACK_AT);
    rover.run_for(10 * SECOND);
    wires.attach(STACK_AT, part.clone());
    rover.run_for(SECOND);
    // 7.2 A are 2 mAh a second.
    let (after_mah, _) = drawn(&rover);
    assert_about(Some(after_mah - before_mah), 22.0, 1.0);
    assert_eq!(rover.state(Pack::Second).thermometer, Thermometer::Device);
    // It is set up for a thermistor of the cells and one of the transistors.
    let thermistors = [(0x07, 22.0), (0, 0.0), (0x0f, 80.0)];
    part.borrow_mut().set_thermistors(thermistors);
    part.borrow_mut().set(&[4000; 3], -7.2, 31.0);
    rover.run_for(10 * SECOND);
    assert_about(Some(drawn(&rover).0 - after_mah), -20.0, 1.0);
    let state = rover.state(Pack::Second);
    assert_about(state.temperature_c, 22.0, 0.05);
    assert_eq!(state.thermometer, Thermometer::Pack);
}

#[test]
// Requirement: AP-6
fn an_ltc2946_counts_charge_and_energy_while_it_is_not_read_and_a_restart_loses_nothing() {
    let part = device(Ltc2946::new(SHUNT_OHM), |part| part.set(12.0, 36.0));
    let wires = Wires::with([(0x6f, part.clone() as Device)]);
    let mut rover = Rover::with(&wires, &[("BATT2_MONITOR", LTC2946)]);
    let (before_mah, before_wh) = drawn(&rover);
    wires.detach(0x6f);
    rover.run_for(10 * SECOND);
    wires.attach(0x6f, part.clone());
    rover.run_for(10 * SECOND);
    // 10 mAh and 0.12 Wh a second.
    let (after_mah, after_wh) = drawn(&rover);
    assert_about(Some(after_mah - before_mah), 200.0, 2.0);
    assert_about(Some(after_wh - before_wh), 2.4, 0.024);
    part.borrow_mut().power_cycle();
    rover.run_for(SECOND);
    assert_about(Some(drawn(&rover).0 - after_mah), 10.0, 1.0);
}

fn converter(volts: [f64; 4]) -> Rc<RefCell<Ad7091r5>> {
    device(Ad7091r5::new(3.3), |part| {
        (0..)
            .zip(volts)
            .for_each(|(channel, volts)| part.set(channel, volts));
    })
}

/// The second pack at the first two pins of the converter.
const AT_50_AND_51: [(&str, f32); 5] = [
    ("BATT2_MONITOR", AD7091R5),
    ("BATT2_VOLT_PIN", 50.0),
    ("BATT2_CURR_PIN", 51.0),
    ("BATT2_VOLT_MULT", 6.0),
    ("BATT2_AMP_PERVLT", 10.0),
];

#[test]
// Requirement: AP-6
fn a_converter_on_the_bus_is_four_more_analog_pins() {
    let third = [
        ("BATT3_MONITOR", AD7091R5),
        ("BATT3_VOLT_PIN", 52.0),
        ("BATT3_CURR_PIN", 53.0),
        ("BATT3_VOLT_MULT", 4.0),
    ];
    let wires = Wires::with([(CONVERTER_AT, converter([2.0, 1.0, 3.0, 0.5]) as Device)]);
    let mut rover = Rover::with(&wires, &[&AT_50_AND_51[..], &third].concat());
    rover.assert_measures(Pack::Second, (12.0, 4.9e-3), (10.0, 8.1e-3));
    rover.assert_measures(Pack::Third, (12.0, 3.3e-3), (8.5, 14e-3));
    // One set of transfers for both: a check, and all four results.
    assert_eq!(rover.transfers_in(SECOND, CONVERTER_AT), 20);
}

/// A period of the motors' PWM.
const PWM_PERIOD_US: u64 = 2_000;

impl Rover {
    /// Runs for a second of pulses at the first two pins of the converter, with this share of a period.
    fn run_with_pulses(&mut self, part: &RefCell<Ad7091r5>, duty: f64) {
        let pulse_us = (duty * PWM_PERIOD_US as f64) as u64;
        for _ in 0..SECOND / PWM_PERIOD_US {
            for (us, volts) in [(pulse_us, [1.5, 2.0]), (PWM_PERIOD_US - pulse_us, [2.0, 0.0])] {
                (0..)
                    .zip(volts)
                    .for_each(|(channel, volts)| part.borrow_mut().set(channel, volts));
                self.run_for(us);
            }
        }
    }
}

#[test]
// Requirement: AP-6, R-16
fn a_converter_on_the_bus_measures_the_means_of_pulses() {
    let slowed_down: &[(&str, f32)] = &[("BATT3_MONITOR", SMART_BATTERY)];
    // 11 rounds in a period, and 25 in nine: a pulse may gain or lose a conversion.
    for (neighbour, tolerance) in [(&[][..], 0.1), (slowed_down, 0.04)] {
        let part = converter([2.0, 0.0, 0.0, 0.0]);
        let battery = device(SmartBattery::new(Pec::Right), |_| ());
        let wires = Wires::with([
            (CONVERTER_AT, part.clone() as Device),
            (BATTERY_AT, battery as Device),
        ]);
        let mut rover = Rover::with(&wires, &[&AT_50_AND_51[..], neighbour].concat());
        for duty in [0.05, 0.25, 0.4, 0.5, 0.7, 0.95] {
            for _ in 0..8 {
                // Another phase of the readings.
                rover.run_for(PWM_PERIOD_US / 8);
                rover.run_with_pulses(&part, duty);
                let share = duty as f32;
                let voltage = (12.0 - 3.0 * share, 3.0 * tolerance);
                let current = (20.0 * share, 20.0 * tolerance);
                rover.assert_measures(Pack::Second, voltage, current);
            }
        }
    }
}

#[test]
fn a_pack_without_a_pin_of_the_converter_does_not_take_the_next_one_along() {
    let wires = Wires::with([(CONVERTER_AT, converter([2.0, 0.5, 0.0, 0.0]) as Device)]);
    let settings = [
        ("BATT2_MONITOR", AD7091R5),
        ("BATT3_MONITOR", AD7091R5),
        ("BATT3_VOLT_PIN", 50.0),
        ("BATT3_CURR_PIN", 51.0),
        ("BATT3_VOLT_MULT", 6.0),
    ];
    let mut rover = Rover::with(&wires, &settings);
    rover.run_for(SECOND);
    assert_eq!(rover.health(2), ["Battery 2 unhealthy: no pin set"]);
    assert_eq!(rover.health(3), [""; 0]);
    rover.assert_measures(Pack::Third, (12.0, 4.9e-3), (8.5, 14e-3));
}

#[derive(Debug)]
enum Fault {
    Answers(Reads),
    Replaced(fn() -> Device),
    Unplugged,
}

/// Asserts that the second pack's part measures again after a fault and a power cycle, that the fault was announced once, and
/// that the third pack was read as before.
fn assert_survives<D: I2cDevice + 'static>(
    (kind, address, part): (f32, u8, D),
    power_cycle: fn(&mut D),
    fault: Fault,
    reason: &str,
) {
    println!("{fault:?} of {kind}");
    let part = device(Garbled::new(part, Reads::Own), |_| ());
    let neighbour = device(SmartBattery::new(Pec::Right), |_| ());
    let wires = Wires::with([
        (address, part.clone() as Device),
        (BATTERY_AT, neighbour as Device),
    ]);
    let monitors = [("BATT2_MONITOR", kind), ("BATT3_MONITOR", SMART_BATTERY)];
    let mut rover = Rover::with(&wires, &monitors);
    let usual = rover.transfers_in(5 * SECOND, BATTERY_AT);
    match fault {
        Fault::Answers(reads) => part.borrow_mut().set_reads(reads),
        Fault::Replaced(other) => wires.attach(address, other()),
        Fault::Unplugged => wires.detach(address),
    }
    assert_eq!(rover.transfers_in(5 * SECOND, BATTERY_AT), usual);
    assert_eq!(rover.health(2), [format!("Battery 2 unhealthy: {reason}")]);
    assert_eq!(rover.state(Pack::Second).status, PackStatus::Unhealthy);
    part.borrow_mut().set_reads(Reads::Own);
    power_cycle(&mut part.borrow_mut());
    wires.attach(address, part);
    rover.run_for(8 * SECOND);
    assert_eq!(rover.health(2)[1..], ["Battery 2 healthy again"]);
    assert_eq!(rover.health(3), [""; 0]);
    rover.assert_measures(Pack::Second, (12.0, STEP), (7.2, 5e-3));
}

fn assert_monitor_survives(fault: Fault, reason: &str) {
    let mut part = Ina226::new(SHUNT_OHM);
    part.set(12.0, 7.2);
    assert_survives(
        (INA2XX, MONITOR_AT, part),
        |part| part.power_cycle(),
        fault,
        reason,
    );
}

fn assert_stack_survives(fault: Fault, reason: &str) {
    assert_survives((BQ76952, STACK_AT, stack()), Bq76952::power_cycle, fault, reason);
}

#[test]
// Requirement: AP-12
fn a_part_that_fails_is_announced_once_holds_up_no_other_and_recovers() {
    for assert_survives in [assert_monitor_survives, assert_stack_survives] {
        assert_survives(Fault::Answers(Reads::Fixed(0xff)), "unknown part");
        assert_survives(Fault::Answers(Reads::Fixed(0)), "unknown part");
        assert_survives(Fault::Answers(Reads::Noise(Random::new(7))), "unknown part");
        assert_survives(Fault::Unplugged, "no answer");
    }
    let other = || device(Ina3221::new(SHUNT_OHM), |_| ()) as Device;
    assert_monitor_survives(Fault::Replaced(other), "unknown part");
    assert_stack_survives(Fault::Replaced(|| ina226(12.0, 1.0)), "unknown part");
}

/// Writes the first register as another board would.
fn configure(part: &Device, now_us: u64, word: u16) {
    let mut part = part.borrow_mut();
    part.start(I2cDirection::Write, now_us * CYCLES_PER_US);
    for byte in [&[0][..], &word.to_be_bytes()].concat() {
        assert_eq!(part.write(byte), Ack::Ack);
    }
    part.stop();
}

#[test]
fn a_narrow_range_that_was_set_before_or_comes_later_shows_no_other_current() {
    let narrow = 1 << 4;
    let ina228 = device(Ina228::new(SHUNT_OHM), |part| part.set(12.0, 36.0, 60.0));
    let ina238 = device(Ina228::ina238(SHUNT_OHM), |part| part.set(12.0, 36.0, 60.0));
    for part in [ina228 as Device, ina238 as Device] {
        configure(&part, 0, narrow);
        let wires = Wires::with([(MONITOR_AT, part.clone())]);
        let mut rover = Rover::with(&wires, &[("BATT2_MONITOR", INA2XX)]);
        rover.assert_measures(Pack::Second, (12.0, 3.2e-3), (36.0, 10e-3));
        configure(&part, rover.now_us, narrow);
        for _ in 0..20 {
            rover.run_for(SECOND / 20);
            rover.assert_measures(Pack::Second, (12.0, 3.2e-3), (36.0, 10e-3));
        }
        assert_eq!(rover.health(2), [""; 0]);
    }
}

#[test]
fn a_converters_scale_offset_and_pins_follow_their_parameters_at_once() {
    let part = converter([2.0, 1.0, 1.5, 0.5]);
    let mut rover = Rover::with(&Wires::with([(CONVERTER_AT, part as Device)]), &AT_50_AND_51);
    rover.assert_measures(Pack::Second, (12.0, 4.9e-3), (10.0, 8.1e-3));
    for (name, value, volts, amperes) in [
        ("BATT2_VOLT_MULT", 5.0, 10.0, 10.0),
        ("BATT2_VLT_OFFSET", 0.2, 9.0, 10.0),
        ("BATT2_VOLT_PIN", 52.0, 6.5, 10.0),
        ("BATT2_AMP_PERVLT", 20.0, 6.5, 20.0),
        ("BATT2_AMP_OFFSET", 0.1, 6.5, 18.0),
        ("BATT2_CURR_PIN", 53.0, 6.5, 8.0),
    ] {
        let set = |autopilot: &mut Autopilot| autopilot.parameters_mut().set(id_of(name), value);
        assert_eq!(rover.shared.with(set), Ok(()), "{name}");
        rover.run_for(SECOND / 4);
        rover.assert_measures(Pack::Second, (volts, 9e-3), (amperes, 17e-3));
    }
}

#[test]
// Requirement: S-11
fn a_kind_that_is_set_while_the_board_runs_freezes_no_pack() {
    for kind in [3.0, SMART_BATTERY, BQ76952] {
        let part = device(Ina226::new(SHUNT_OHM), |part| part.set(12.0, 1.0));
        let wires = Wires::with([(MONITOR_AT, part.clone() as Device)]);
        let mut rover = Rover::with(&wires, &[("BATT2_MONITOR", INA2XX)]);
        let set = |autopilot: &mut Autopilot| autopilot.parameters_mut().set(id_of("BATT2_MONITOR"), kind);
        assert_eq!(rover.shared.with(set), Ok(()));
        part.borrow_mut().set(11.0, 2.0);
        rover.run_for(SECOND);
        rover.assert_measures(Pack::Second, (11.0, STEP), (2.0, 5e-3));
        wires.detach(MONITOR_AT);
        rover.run_for(SECOND);
        assert_eq!(rover.health(2), ["Battery 2 unhealthy: no answer"]);
    }
}
