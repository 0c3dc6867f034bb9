//! A device that takes everything and answers nonsense.

use std::ops::{Deref, DerefMut};

use super::super::super::circuit::Circuit;
use super::super::super::clock::Cycle;
use super::super::super::random::Random;
use super::super::device::{Ack, I2cDevice, I2cDirection};

/// What a read of a garbled device gives.
#[derive(Clone, Debug)]
pub enum Reads {
    /// What the device says.
    Own,
    /// This byte, whatever was asked for.
    Fixed(u8),
    /// Pseudo-random bytes.
    Noise(Random),
}

/// A device whose answers do not arrive. It acknowledges, and takes what is written, as ever.
pub struct Garbled<D> {
    device: D,
    reads: Reads,
}

impl<D> Garbled<D> {
    pub fn new(device: D, reads: Reads) -> Self {
        Self { device, reads }
    }

    /// From the next byte on.
    pub fn set_reads(&mut self, reads: Reads) {
        self.reads = reads;
    }
}

impl<D> Deref for Garbled<D> {
    type Target = D;

    fn deref(&self) -> &D {
        &self.device
    }
}

impl<D> DerefMut for Garbled<D> {
    fn deref_mut(&mut self) -> &mut D {
        &mut self.device
    }
}

impl<D: I2cDevice> I2cDevice for Garbled<D> {
    fn sense(&mut self, circuit: &Circuit) {
        self.device.sense(circuit);
    }

    fn start(&mut self, direction: I2cDirection, now: Cycle) -> Ack {
        self.device.start(direction, now)
    }

    fn write(&mut self, byte: u8) -> Ack {
        self.device.write(byte)
    }

    /// The device goes on to its next byte in any case.
    fn read(&mut self) -> u8 {
        let own = self.device.read();
        match &mut self.reads {
            Reads::Own => own,
            Reads::Fixed(byte) => *byte,
            Reads::Noise(random) => random.next_u64() as u8,
        }
    }

    fn stop(&mut self) {
        self.device.stop();
    }

    fn stretch(&mut self) -> Cycle {
        self.device.stretch()
    }
}

#[cfg(test)]
mod tests {
    use super::super::Ina226;
    use super::super::register_map::driver::{read, write};
    use super::*;

    const CONFIGURATION: u8 = 0x00;
    const BUS_VOLTAGE: u8 = 0x02;

    #[test]
    fn noise_is_another_value_each_time_and_the_same_in_every_run() {
        let values = |seed| {
            let noise = Reads::Noise(Random::new(seed));
            let mut device = Garbled::new(Ina226::new(0.002), noise);
            [0; 3].map(|_| read(&mut device, BUS_VOLTAGE, 2))
        };
        let [first, second, third] = values(1);
        assert!(first != second && second != third);
        assert_eq!(values(1), [first, second, third]);
        assert_ne!(values(2), [first, second, third]);
    }

    #[test]
    fn it_accepts_writes_and_returns_its_own_values_when_set_to() {
        let mut device = Garbled::new(Ina226::new(0.002), Reads::Fixed(0xff));
        device.set(12.0, 1.0);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 0xffff);
        write(&mut device, CONFIGURATION, 0x4527);
        device.set_reads(Reads::Own);
        assert_eq!(read(&mut device, BUS_VOLTAGE, 2), 9600);
        assert_eq!(read(&mut device, CONFIGURATION, 2), 0x4527);
    }
}
