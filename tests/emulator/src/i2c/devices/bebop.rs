//! The motor board of Parrot's Bebop, of which Parrot has published nothing: as the drivers of Paparazzi
//! (`sw/airborne/boards/bebop/actuators.c`) and ArduPilot (`RCOutput_Bebop.cpp`) read it.
//!
//! Left out: everything that drives its motors.

use super::super::device::{Ack, I2cDevice, I2cDirection};

const OBSERVED: u8 = 0x20;
const INFO: u8 = 0xa0;

/// Version, type and number of motors, and nothing counted so far.
const ABOUT_IT: [u8; 13] = [1, 5, 2, 4, 0, 0, 0, 0, 0, 0, 0, 0, 0];

pub struct Bebop {
    millivolts: u16,
    pointer: u8,
    answer: std::vec::IntoIter<u8>,
}

impl Bebop {
    pub fn new(millivolts: u16) -> Self {
        Self {
            millivolts,
            pointer: 0,
            answer: Vec::new().into_iter(),
        }
    }

    pub fn set(&mut self, millivolts: u16) {
        self.millivolts = millivolts;
    }

    /// The speeds of four motors, the voltage, states and temperature; then the byte that makes their exclusive or zero.
    fn observed(&self) -> Vec<u8> {
        let [high, low] = self.millivolts.to_be_bytes();
        let body = [0, 0, 0, 0, 0, 0, 0, 0, high, low, 0, 0, 0, 25];
        let checksum = body.iter().fold(0, |sum, byte| sum ^ byte);
        [&body[..], &[checksum]].concat()
    }
}

impl I2cDevice for Bebop {
    fn start(&mut self, direction: I2cDirection, _now: super::Cycle) -> Ack {
        if direction == I2cDirection::Read {
            let answer = match self.pointer {
                OBSERVED => self.observed(),
                INFO => ABOUT_IT.to_vec(),
                _ => Vec::new(),
            };
            self.answer = answer.into_iter();
        }
        Ack::Ack
    }

    fn write(&mut self, byte: u8) -> Ack {
        self.pointer = byte;
        Ack::Ack
    }

    fn read(&mut self) -> u8 {
        self.answer.next().unwrap_or(0xff)
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::read;
    use super::*;

    #[test]
    fn it_has_four_motors_and_its_observations_have_a_checksum() {
        let mut device = Bebop::new(11_640);
        assert_eq!(read(&mut device, INFO, 4), 0x0105_0204);
        // 0x2d78, and what makes both and the temperature zero.
        assert_eq!(read(&mut device, OBSERVED, 8), 0);
        device.start(I2cDirection::Read, 0);
        let bytes: Vec<u8> = (0..15).map(|_| device.read()).collect();
        assert_eq!(bytes[8..], [0x2d, 0x78, 0, 0, 0, 25, 0x2d ^ 0x78 ^ 25]);
    }
}
