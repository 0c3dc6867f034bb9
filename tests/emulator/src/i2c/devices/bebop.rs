//! The motor board of Parrot's Bebop (Paparazzi's wiki, Bebop/BLDC; ArduPilot's `RCOutput_Bebop.cpp`): its identification and
//! what it observes. Its motors stand.

use super::super::super::clock::Cycle;
use super::super::device::{Ack, I2cDevice, I2cDirection};

const GET_OBS_DATA: u8 = 0x20;
const GET_INFO: u8 = 0xa0;

/// Status: the motors stand.
const IDLE: u8 = 1;

pub struct Bebop {
    millivolts: u16,
    motors: u8,
    command: u8,
    /// What a read is still to give.
    answer: std::vec::IntoIter<u8>,
}

impl Bebop {
    pub fn new(motors: u8) -> Self {
        Self {
            millivolts: 0,
            motors,
            command: 0,
            answer: Vec::new().into_iter(),
        }
    }

    pub fn set(&mut self, millivolts: u16) {
        self.millivolts = millivolts;
    }

    fn answer(&self) -> Vec<u8> {
        let mut bytes = match self.command {
            GET_OBS_DATA => {
                let mut observed = vec![0; 14];
                observed[8..10].copy_from_slice(&self.millivolts.to_be_bytes());
                observed[10] = IDLE;
                // In degrees.
                observed[13] = 30;
                observed
            }
            GET_INFO => vec![1, 5, 2, self.motors, 0, 12, 0, 60, 0, 0, 3, 4, 0],
            _ => return Vec::new(),
        };
        bytes.push(bytes.iter().fold(0, |sum, byte| sum ^ byte));
        bytes
    }
}

impl I2cDevice for Bebop {
    fn start(&mut self, direction: I2cDirection, _now: Cycle) -> Ack {
        if direction == I2cDirection::Read {
            self.answer = self.answer().into_iter();
        }
        Ack::Ack
    }

    fn write(&mut self, byte: u8) -> Ack {
        self.command = byte;
        Ack::Ack
    }

    fn read(&mut self) -> u8 {
        self.answer.next().unwrap_or(0xff)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_voltage_is_in_bytes_8_and_9_and_the_checksum_makes_all_of_them_zero() {
        let mut device = Bebop::new(4);
        device.set(11_432);
        device.write(GET_OBS_DATA);
        device.start(I2cDirection::Read, 0);
        let read: Vec<u8> = (0..15).map(|_| device.read()).collect();
        assert_eq!(read[8..10], [0x2c, 0xa8]);
        assert_eq!(read.iter().fold(0, |sum, byte| sum ^ byte), 0);
    }
}
