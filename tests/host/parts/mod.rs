//! Parts on I2C and SPI, as the emulator has them, read by their drivers without tasks: what a pack's owner learns at the ends of
//! their ranges, and after a transfer that failed.

mod ends;
mod faults;

use std::any::Any;
use std::cell::RefCell;
use std::collections::BTreeMap;
use std::ops::Range;
use std::rc::Rc;

use embassy_futures::block_on;
use embedded_hal_async::i2c::Operation;
use embedded_hal_async::spi::{ErrorKind, ErrorType, Operation as SpiOperation, SpiDevice};
use emulator::i2c_devices::{RegisterMap, Registers};
use emulator::spi_devices::Ina239;
use emulator::{Ack, I2cDevice, I2cDirection, SpiClock, SpiDevice as _, SpiMode};
use rover_battmon::battery::{BatteryState, BusError, Measurement, ReadError};
use rover_battmon::pack::Pack;
use rover_battmon::sensor::{AnalogReadings, BusDevices, Buses, I2cBus, bus_clock_hz};
use rover_battmon::time::Instant;
use rover_battmon::vehicle::ArmState;
use support::desk::{Desk, start_with};
use support::frames::texts_of;
use support::time::SECOND;

const TICK_US: u64 = 100_000;

/// The board starts when the parts have had their supply for as long.
const START_US: u64 = 2 * SECOND;

/// The time of the emulator.
const CYCLES_PER_US: u64 = 125;
const CYCLES_PER_SECOND: u64 = CYCLES_PER_US * SECOND;

/// A byte with its acknowledge bit.
const BYTE_BITS: u64 = 9;

/// After as long the board gives up a transfer (`TIMEOUT` in `src/board/i2c.rs`).
const TIME_OUT_US: u64 = 35_000;

const SPI_CLOCK: SpiClock = SpiClock {
    mode: SpiMode::Mode1,
    hz: 1_000_000,
};

/// A device on one of the buses, and what is done to it.
struct Part<D> {
    device: D,
    power_cycle: fn(&mut D),
    /// It is connected to this current, in amperes, which has drawn this charge since the start, in milliampere-hours.
    connect: fn(&mut D, f64, f64),
}

trait Emulated {
    fn any(&mut self) -> &mut dyn Any;
    fn power_cycle(&mut self);
    fn connect(&mut self, amperes: f64, drawn_mah: f64);
    fn i2c(&mut self) -> Option<&mut dyn I2cDevice>;
    fn spi(&mut self) -> Option<&mut Ina239>;
}

impl<D: I2cDevice + 'static> Emulated for Part<D> {
    fn any(&mut self) -> &mut dyn Any {
        self
    }

    fn power_cycle(&mut self) {
        (self.power_cycle)(&mut self.device);
    }

    fn connect(&mut self, amperes: f64, drawn_mah: f64) {
        (self.connect)(&mut self.device, amperes, drawn_mah);
    }

    fn i2c(&mut self) -> Option<&mut dyn I2cDevice> {
        Some(&mut self.device)
    }

    fn spi(&mut self) -> Option<&mut Ina239> {
        None
    }
}

/// A device that is connected to nothing, and keeps its supply.
fn idle<D: I2cDevice + 'static>(device: D) -> Box<dyn Emulated> {
    wired(device, |_| (), |_, _, _| ())
}

fn wired<D: I2cDevice + 'static>(
    device: D,
    power_cycle: fn(&mut D),
    connect: fn(&mut D, f64, f64),
) -> Box<dyn Emulated> {
    Box::new(Part {
        device,
        power_cycle,
        connect,
    })
}

/// The part behind the chip select.
struct AtSpi(Ina239);

impl Emulated for AtSpi {
    fn any(&mut self) -> &mut dyn Any {
        self
    }

    fn power_cycle(&mut self) {
        self.0.power_cycle();
    }

    fn connect(&mut self, amperes: f64, _: f64) {
        self.0.set(VOLTS, amperes, 25.0);
    }

    fn i2c(&mut self) -> Option<&mut dyn I2cDevice> {
        None
    }

    fn spi(&mut self) -> Option<&mut Ina239> {
        Some(&mut self.0)
    }
}

/// Voltage and current of the packs.
const VOLTS: f64 = 12.0;
const AMPERES: f64 = 7.2;

fn power_cycle<R: Registers>(device: &mut RegisterMap<R>) {
    device.power_cycle();
}

fn connect<R: Registers>(device: &mut RegisterMap<R>, amperes: f64, _: f64) {
    device.set_load(VOLTS, amperes);
}

/// A power monitor of Texas Instruments'.
fn monitor<R: Registers + 'static>(device: RegisterMap<R>) -> Box<dyn Emulated> {
    wired(device, power_cycle, connect)
}

/// A fault of one transfer, or of a few.
#[derive(Clone, Copy, Debug)]
enum Fault {
    /// Nothing answers; on SPI the line is not driven.
    Refused,
    /// The device holds the clock until the board gives up. It has taken the bytes before, or not.
    Delayed { has_taken: bool },
    /// These bits of the byte at this place of an answer are inverted.
    Corrupted { place: usize, bits: u8 },
    /// The supply is gone for this long.
    PowerLost { us: u64 },
}

/// Bytes of an answer that are others: of the read of a register or command, from a place on.
#[derive(Clone, Debug)]
struct Altered {
    command: u8,
    place: usize,
    bytes: Vec<u8>,
}

/// Both buses.
struct Bus {
    address: u8,
    clock_hz: u64,
    part: Box<dyn Emulated>,
    now: u64,
    transfers: usize,
    /// The transfers that fail, from 1, and how.
    failing: Range<usize>,
    fault: Fault,
    off_until: Option<u64>,
    altered: Vec<Altered>,
    amperes: f64,
    /// In ampere-cycles.
    drawn: f64,
}

#[derive(Clone)]
struct Wires(Rc<RefCell<Bus>>);

impl Bus {
    fn pass(&mut self, cycles: u64) {
        self.now += cycles;
        self.drawn += self.amperes * cycles as f64;
    }

    fn pass_until(&mut self, now_us: u64) {
        self.pass((now_us * CYCLES_PER_US).saturating_sub(self.now));
    }

    fn pass_byte(&mut self) {
        self.pass(BYTE_BITS * CYCLES_PER_SECOND / self.clock_hz);
    }

    fn drawn_mah(&self) -> f64 {
        self.drawn / CYCLES_PER_SECOND as f64 / 3.6
    }

    fn connect(&mut self) {
        let drawn_mah = self.drawn_mah();
        self.part.connect(self.amperes, drawn_mah);
    }

    /// The part counts until now.
    fn look(&mut self) {
        let now = self.now;
        if let Some(device) = self.part.i2c() {
            device.start(I2cDirection::Write, now);
            device.stop();
        }
        if let Some(device) = self.part.spi() {
            device.advance(now);
        }
    }

    /// Counts a transfer, and returns its fault.
    fn begin(&mut self) -> Option<Fault> {
        self.transfers += 1;
        self.connect();
        let fails = self.failing.contains(&self.transfers);
        if let (true, Fault::PowerLost { us }) = (fails, self.fault) {
            self.off_until = Some(self.now + us * CYCLES_PER_US);
        }
        if let Some(until) = self.off_until {
            if self.now < until {
                return Some(Fault::Refused);
            }
            self.off_until = None;
            self.part.power_cycle();
        }
        fails.then_some(self.fault)
    }

    fn write(&mut self, bytes: &[u8]) -> Result<(), BusError> {
        self.start(I2cDirection::Write)?;
        for byte in bytes {
            self.pass_byte();
            if self.i2c()?.write(*byte) == Ack::Nack {
                return Err(BusError::NoAnswer);
            }
        }
        Ok(())
    }

    fn read(&mut self, buffer: &mut [u8]) -> Result<(), BusError> {
        self.start(I2cDirection::Read)?;
        for byte in buffer {
            *byte = self.i2c()?.read();
            self.pass_byte();
        }
        Ok(())
    }

    fn start(&mut self, direction: I2cDirection) -> Result<(), BusError> {
        self.pass_byte();
        let now = self.now;
        self.i2c()?.start(direction, now);
        Ok(())
    }

    fn i2c(&mut self) -> Result<&mut dyn I2cDevice, BusError> {
        self.part.i2c().ok_or(BusError::NoAnswer)
    }

    fn transfer(&mut self, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        let mut command = None;
        for operation in operations {
            match operation {
                Operation::Write(bytes) => {
                    command = bytes.first().copied();
                    self.write(bytes)?;
                }
                Operation::Read(buffer) => {
                    self.read(buffer)?;
                    alter(&self.altered, command, buffer);
                }
            }
        }
        self.i2c()?.stop();
        Ok(())
    }
}

fn alter(altered: &[Altered], command: Option<u8>, buffer: &mut [u8]) {
    for altered in altered.iter().filter(|altered| command == Some(altered.command)) {
        let places = buffer.iter_mut().skip(altered.place);
        places
            .zip(&altered.bytes)
            .for_each(|(byte, other)| *byte = *other);
    }
}

fn corrupt(operations: &mut [Operation<'_>], place: usize, bits: u8) {
    for operation in operations {
        if let Operation::Read(buffer) = operation {
            let place = place % buffer.len();
            buffer[place] ^= bits;
        }
    }
}

impl I2cBus for Wires {
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        let mut bus = self.0.borrow_mut();
        if address != bus.address {
            bus.pass_byte();
            return Err(BusError::NoAnswer);
        }
        match bus.begin() {
            None | Some(Fault::PowerLost { .. }) => bus.transfer(operations),
            Some(Fault::Refused) => {
                bus.pass_byte();
                Err(BusError::NoAnswer)
            }
            Some(Fault::Delayed { has_taken }) => {
                if has_taken {
                    bus.transfer(operations)?;
                }
                bus.pass(TIME_OUT_US * CYCLES_PER_US);
                Err(BusError::Timeout)
            }
            Some(Fault::Corrupted { place, bits }) => {
                bus.transfer(operations)?;
                corrupt(operations, place, bits);
                Ok(())
            }
        }
    }
}

impl ErrorType for Wires {
    type Error = ErrorKind;
}

impl SpiDevice for Wires {
    async fn transaction(&mut self, operations: &mut [SpiOperation<'_, u8>]) -> Result<(), ErrorKind> {
        let mut bus = self.0.borrow_mut();
        let fault = bus.begin();
        // Without a supply it takes nothing, and nothing drives the line.
        let is_driven = !matches!(fault, Some(Fault::Refused));
        let now = bus.now;
        let Bus { part, altered, .. } = &mut *bus;
        let device = part.spi().expect("an INA239");
        device.advance(now);
        device.select();
        let mut bytes = 0;
        let mut exchange = |byte| {
            bytes += 1;
            let answer = is_driven.then(|| device.exchange(byte, SPI_CLOCK));
            answer.flatten().unwrap_or(0xff)
        };
        let mut register = None;
        for operation in operations {
            match operation {
                SpiOperation::Write(written) => {
                    register = written.first().map(|command| command >> 2);
                    written.iter().for_each(|byte| {
                        exchange(*byte);
                    });
                }
                SpiOperation::Read(buffer) => {
                    buffer.fill_with(|| exchange(0));
                    alter(altered, register, buffer);
                }
                other => unimplemented!("{other:?}"),
            }
        }
        device.deselect();
        bus.pass(bytes * 8 * CYCLES_PER_SECOND / SPI_CLOCK.hz);
        match fault {
            Some(Fault::Delayed { .. }) => Err(ErrorKind::Other),
            _ => Ok(()),
        }
    }
}

type Settings = &'static [(&'static str, f32)];

/// Packs that are measured by a part.
struct Row {
    name: &'static str,
    address: u8,
    make: fn() -> Box<dyn Emulated>,
    settings: Settings,
}

const fn row(name: &'static str, address: u8, make: fn() -> Box<dyn Emulated>, settings: Settings) -> Row {
    Row {
        name,
        address,
        make,
        settings,
    }
}

/// Times of a pack's readings.
#[derive(Clone, Copy)]
struct Times {
    /// Drawn before the first one, in milliampere-hours.
    drawn_before_mah: f64,
    /// The latest one.
    read_us: u64,
    /// For how long there was none.
    unread_us: u64,
}

/// The core, the drivers and a part.
struct Bench {
    desk: Desk,
    devices: BusDevices,
    wires: Wires,
    latest: BTreeMap<u8, Result<Measurement, ReadError>>,
    /// Readings since the last turn.
    readings: Vec<(Pack, Result<Measurement, ReadError>)>,
    /// The packs that have been read.
    packs: BTreeMap<u8, Times>,
}

impl Bench {
    fn new(row: &Row) -> Self {
        let settings = [&[("BATT_MONITOR", 0.0)], row.settings].concat();
        let mut desk = Desk::starting(start_with(&settings));
        desk.now_us = START_US;
        let devices = BusDevices::from_parameters(desk.parameters(), desk.now());
        let bus = Bus {
            address: row.address,
            clock_hz: bus_clock_hz(desk.parameters()).into(),
            part: (row.make)(),
            now: START_US * CYCLES_PER_US,
            transfers: 0,
            failing: 0..0,
            fault: Fault::Refused,
            off_until: None,
            altered: Vec::new(),
            amperes: AMPERES,
            drawn: 0.0,
        };
        Self {
            desk,
            devices,
            wires: Wires(Rc::new(RefCell::new(bus))),
            latest: BTreeMap::new(),
            readings: Vec::new(),
            packs: BTreeMap::new(),
        }
    }

    fn now_us(&self) -> u64 {
        self.wires.0.borrow().now / CYCLES_PER_US
    }

    fn transfers(&self) -> usize {
        self.wires.0.borrow().transfers
    }

    fn fail(&self, failing: Range<usize>, fault: Fault) {
        let mut bus = self.wires.0.borrow_mut();
        (bus.failing, bus.fault) = (failing, fault);
    }

    fn is_off(&self) -> bool {
        self.wires.0.borrow().off_until.is_some()
    }

    fn set_amperes(&self, amperes: f64) {
        let mut bus = self.wires.0.borrow_mut();
        bus.look();
        bus.amperes = amperes;
        bus.connect();
    }

    fn state(&self, pack: Pack) -> BatteryState {
        *self.desk.autopilot.battery(pack)
    }

    /// Texts since the last call, once the link is open.
    fn announced(&mut self) -> Vec<String> {
        self.desk.post_due(self.desk.now_us);
        texts_of(&self.desk.sent())
    }

    /// Charge drawn since the start, in milliampere-hours.
    fn drawn_mah(&self) -> f64 {
        self.wires.0.borrow().drawn_mah()
    }

    /// Charge that was counted, in milliampere-hours.
    fn counted_mah(&self, pack: Pack) -> f64 {
        self.state(pack).consumed_mah().unwrap_or(0.0).into()
    }

    fn unread_us(&self, pack: Pack) -> u64 {
        self.packs[&pack.number()].unread_us
    }

    /// The next turn of a part, and the ticks before it.
    fn turn(&mut self) {
        let due = self.devices.next_due().expect("there is a part");
        let now_us = due.as_micros().max(self.now_us());
        while self.desk.now_us + TICK_US <= now_us {
            self.desk.now_us += TICK_US;
            self.wires.0.borrow_mut().pass_until(self.desk.now_us);
            self.desk.sample(AnalogReadings::NONE);
        }
        self.wires.0.borrow_mut().pass_until(now_us);
        let mut buses = Buses {
            i2c: self.wires.clone(),
            spi: self.wires.clone(),
        };
        let now = Instant::from_micros(now_us);
        self.readings.clear();
        let (autopilot, readings) = (&mut self.desk.autopilot, &mut self.readings);
        self.devices.follow(autopilot.parameters());
        let finding =
            block_on(
                self.devices
                    .read_next(&mut buses, now, ArmState::Disarmed, |pack, reading| {
                        autopilot.add_bus_reading(pack, reading, now);
                        readings.push((pack, reading));
                    }),
            );
        if let Some((pack, event)) = finding {
            autopilot.announce_supply(pack, &event, now);
        }
        let first = Times {
            drawn_before_mah: self.drawn_mah(),
            read_us: now_us,
            unread_us: 0,
        };
        for (pack, reading) in &self.readings {
            self.latest.insert(pack.number(), *reading);
            if reading.is_ok() {
                let times = self.packs.entry(pack.number()).or_insert(first);
                let since_us = now_us - std::mem::replace(&mut times.read_us, now_us);
                times.unread_us += since_us.saturating_sub(TICK_US);
            }
        }
    }

    fn run_for(&mut self, us: u64) {
        let until = self.now_us() + us;
        while self.now_us() < until {
            self.turn();
        }
    }
}
