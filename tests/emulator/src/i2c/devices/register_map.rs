//! What the monitors have in common: a pointer, and registers sent with the highest byte first.

use std::ops::{Deref, DerefMut};

use super::super::super::circuit::{Circuit, Meter};
use super::super::super::clock::Cycle;
use super::super::device::{Ack, I2cDevice, I2cDirection};
use super::{Converter, Load};

pub trait Registers {
    /// Size of a register in bytes.
    fn size(&self, _pointer: u8) -> usize {
        2
    }

    fn read(&self, pointer: u8) -> u64;

    fn write(&mut self, pointer: u8, value: u16);

    /// It is addressed at this time: what has been converted until then is in its registers.
    fn note_time(&mut self, now: Cycle);

    /// Its connections, from the moment on at which it was addressed last.
    fn set_load(&mut self, volts: f64, amperes: f64);

    /// The supply is gone, and back when it is addressed next.
    fn power_cycle(&mut self);
}

/// A monitor with one converter, of whose registers only the configuration is written.
pub trait OneConverter {
    fn converter(&mut self) -> &mut Converter;

    fn register(&self, pointer: u8) -> u64;

    fn configure(&mut self, configuration: u16);

    fn reset(&mut self);

    /// Results until this time go to its registers.
    fn convert(&mut self, now: Cycle);
}

const CONFIGURATION: u8 = 0x00;
const RESET: u16 = 1 << 15;

impl<M: OneConverter> Registers for M {
    fn read(&self, pointer: u8) -> u64 {
        self.register(pointer)
    }

    fn write(&mut self, pointer: u8, value: u16) {
        match pointer {
            CONFIGURATION if value & RESET != 0 => self.reset(),
            CONFIGURATION => self.configure(value),
            _ => {}
        }
    }

    fn note_time(&mut self, now: Cycle) {
        self.convert(now);
    }

    fn set_load(&mut self, volts: f64, amperes: f64) {
        self.converter().set_load(Load::of(volts, amperes));
    }

    fn power_cycle(&mut self) {
        self.reset();
        self.converter().power_cycle();
    }
}

/// The byte after the address sets the pointer, two more are written to its register; a read gives
/// the register at the pointer, which stays until it is set again.
pub struct RegisterMap<R> {
    registers: R,
    pointer: u8,
    /// Bytes since the START; the first is the pointer.
    written: Vec<u8>,
    /// The register as it was when the read began, and how many bytes of it were sent.
    latched: u64,
    sent: usize,
    /// `None`: it measures what a test sets.
    meter: Option<Meter>,
}

impl<R: Registers> RegisterMap<R> {
    pub fn of(registers: R) -> Self {
        Self {
            meter: None,
            registers,
            pointer: 0,
            written: Vec::new(),
            latched: 0,
            sent: 0,
        }
    }

    /// Connected to the pack of the board's circuit.
    pub fn measuring_circuit(self) -> Self {
        Self {
            meter: Some(Meter::default()),
            ..self
        }
    }

    /// The supply of the device is gone and back. What it is connected to stays.
    pub fn power_cycle(&mut self) {
        self.registers.power_cycle();
        self.pointer = 0;
        self.written.clear();
        self.latched = 0;
    }
}

impl<R> Deref for RegisterMap<R> {
    type Target = R;

    fn deref(&self) -> &R {
        &self.registers
    }
}

impl<R> DerefMut for RegisterMap<R> {
    fn deref_mut(&mut self) -> &mut R {
        &mut self.registers
    }
}

impl<R: Registers> I2cDevice for RegisterMap<R> {
    fn sense(&mut self, circuit: &Circuit) {
        let Some(meter) = &mut self.meter else {
            return;
        };
        let totals = circuit.totals();
        if let Some(means) = meter.means(totals) {
            self.registers.set_load(means.volts, means.shown_amperes);
            self.registers.note_time(totals.at);
        }
    }

    fn start(&mut self, direction: I2cDirection, now: Cycle) -> Ack {
        self.registers.note_time(now);
        match direction {
            I2cDirection::Write => self.written.clear(),
            I2cDirection::Read => {
                self.latched = self.registers.read(self.pointer);
                self.sent = 0;
            }
        }
        Ack::Ack
    }

    fn write(&mut self, byte: u8) -> Ack {
        self.written.push(byte);
        match self.written[..] {
            [pointer] => self.pointer = pointer,
            [pointer, high, low] => self.registers.write(pointer, u16::from_be_bytes([high, low])),
            _ => {}
        }
        Ack::Ack
    }

    fn read(&mut self) -> u8 {
        let size = self.registers.size(self.pointer);
        let place = size - 1 - self.sent % size;
        self.sent += 1;
        (self.latched >> (8 * place)) as u8
    }
}

/// Reads and writes registers as a driver does, for the tests of the devices: each of these a second after the one before.
#[cfg(test)]
pub mod driver {
    use std::cell::Cell;

    use super::super::super::super::clock::{CLK_SYS_HZ, Cycle};
    use super::super::super::device::{Ack, I2cDevice, I2cDirection};

    thread_local! {
        static NOW: Cell<Cycle> = const { Cell::new(0) };
    }

    /// The time of the last access.
    pub fn now() -> Cycle {
        NOW.get()
    }

    fn a_second_later() -> Cycle {
        NOW.set(NOW.get() + CLK_SYS_HZ);
        NOW.get()
    }

    pub fn read(device: &mut impl I2cDevice, pointer: u8, bytes: usize) -> u64 {
        read_at(device, pointer, bytes, a_second_later())
    }

    pub fn read_at(device: &mut impl I2cDevice, pointer: u8, bytes: usize, now: u64) -> u64 {
        device.start(I2cDirection::Write, now);
        assert_eq!(device.write(pointer), Ack::Ack);
        device.start(I2cDirection::Read, now);
        let value = (0..bytes).fold(0, |value, _| value << 8 | u64::from(device.read()));
        device.stop();
        value
    }

    pub fn write(device: &mut impl I2cDevice, pointer: u8, value: u16) {
        write_at(device, pointer, value, a_second_later());
    }

    pub fn write_at(device: &mut impl I2cDevice, pointer: u8, value: u16, now: u64) {
        device.start(I2cDirection::Write, now);
        device.write(pointer);
        for byte in value.to_be_bytes() {
            device.write(byte);
        }
        device.stop();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Default)]
    struct TwoRegisters([u16; 2]);

    impl Registers for TwoRegisters {
        fn read(&self, pointer: u8) -> u64 {
            u64::from(self.0[usize::from(pointer)])
        }

        fn write(&mut self, pointer: u8, value: u16) {
            self.0[usize::from(pointer)] = value;
        }

        fn note_time(&mut self, _: Cycle) {}

        fn set_load(&mut self, _: f64, _: f64) {}

        fn power_cycle(&mut self) {
            self.0 = [0; 2];
        }
    }

    #[test]
    fn the_pointer_stays_and_the_highest_byte_comes_first() {
        let mut device = RegisterMap::of(TwoRegisters::default());
        driver::write(&mut device, 1, 0x1234);
        device.start(I2cDirection::Read, 0);
        let read: Vec<u8> = (0..3).map(|_| device.read()).collect();
        assert_eq!(read, [0x12, 0x34, 0x12]);
        assert_eq!(driver::read(&mut device, 0, 2), 0);
    }

    #[test]
    fn a_power_cycle_clears_registers_and_pointer() {
        let mut device = RegisterMap::of(TwoRegisters::default());
        driver::write(&mut device, 0, 0x1111);
        driver::write(&mut device, 1, 0x2222);
        device.power_cycle();
        assert_eq!(device.0, [0, 0]);
        device.0 = [0x3333, 0x4444];
        device.start(I2cDirection::Read, 0);
        assert_eq!([device.read(), device.read()], [0x33, 0x33], "register 0");
    }

    #[test]
    fn half_a_register_is_not_written() {
        let mut device = RegisterMap::of(TwoRegisters::default());
        device.start(I2cDirection::Write, 0);
        device.write(1);
        device.write(0x55);
        device.stop();
        assert_eq!(driver::read(&mut device, 1, 2), 0);
    }
}
