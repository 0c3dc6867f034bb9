//! AD7091R-5: 12-bit converter with four inputs.
//!
//! In command mode, and in autocycle mode, each result that is read is followed by that of the next
//! enabled channel; the channel a result says it belongs to lags a changed selection by one, as drivers
//! have found. Left out: the CONVST pin, alerts, conversion times. What is not confirmed is said where
//! it stands.

use super::super::super::clock::Cycle;
use super::super::device::{Ack, I2cDevice, I2cDirection};
use super::unsigned_code;

const RESULT: u8 = 0x00;
const CHANNEL: u8 = 0x01;
const CONFIG: u8 = 0x02;
const FIRST_LIMIT: u8 = 0x04;
const LAST_LIMIT: u8 = 0x0f;

/// From memory, not confirmed.
const CONFIG_RESET: u16 = 0x00c0;
const CMD: u16 = 1 << 10;
const RESET: u16 = 1 << 9;
const AUTO: u16 = 1 << 8;
const INTERNAL_REFERENCE: u16 = 1;
const INTERNAL_REFERENCE_V: f64 = 2.5;
/// Low, high, hysteresis of each channel; that hysteresis starts at all ones is not confirmed.
const LIMITS_RESET: [u16; 3] = [0, 0xfff, 0xfff];

const CHANNELS: u8 = 4;
const RESULT_BITS: u32 = 12;
const CHANNEL_SHIFT: u32 = 13;

/// What is at the REF pin while the internal reference is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reference {
    External(f64),
    /// A capacitor: there is none, and every result is 0 (an assumption).
    None,
}

struct State {
    enabled: u8,
    config: u16,
    limits: [u16; 12],
    pointer: u8,
    /// The channel of the next result.
    converted: u8,
}

impl State {
    fn after_reset() -> Self {
        Self {
            enabled: 0,
            config: CONFIG_RESET,
            limits: std::array::from_fn(|index| LIMITS_RESET[index % 3]),
            pointer: RESULT,
            converted: 0,
        }
    }
}

pub struct Ad7091r5 {
    reference: Reference,
    volts: [f64; CHANNELS as usize],
    state: State,
    /// Bytes since the START that were not used yet.
    written: Vec<u8>,
    pointer_was_sent: bool,
    /// The low byte of the word that is being read.
    half_read: Option<u8>,
}

impl Ad7091r5 {
    pub fn new(reference: Reference) -> Self {
        Self {
            reference,
            volts: [0.0; CHANNELS as usize],
            state: State::after_reset(),
            written: Vec::new(),
            pointer_was_sent: false,
            half_read: None,
        }
    }

    /// Input VIN0 to VIN3.
    pub fn set(&mut self, channel: usize, volts: f64) {
        self.volts[channel] = volts;
    }

    /// The supply of the device is gone and back. What it is connected to stays.
    pub fn power_cycle(&mut self) {
        self.state = State::after_reset();
        self.written.clear();
    }

    fn reference_v(&self) -> Option<f64> {
        match self.reference {
            _ if self.state.config & INTERNAL_REFERENCE != 0 => Some(INTERNAL_REFERENCE_V),
            Reference::External(volts) => Some(volts),
            Reference::None => None,
        }
    }

    fn code(&self, channel: u8) -> u16 {
        let volts = self.volts[usize::from(channel)];
        let steps = f64::from(1 << RESULT_BITS);
        self.reference_v().map_or(0, |reference| {
            unsigned_code(volts, reference / steps, RESULT_BITS) as u16
        })
    }

    /// The enabled channel after the one converted last, in ascending order and round again.
    fn next_channel(&self) -> Option<u8> {
        (1..=CHANNELS)
            .map(|step| (self.state.converted + step) % CHANNELS)
            .find(|channel| self.state.enabled >> channel & 1 != 0)
    }

    fn take_result(&mut self) -> u16 {
        let channel = self.state.converted;
        if self.state.config & (CMD | AUTO) != 0
            && let Some(next) = self.next_channel()
        {
            self.state.converted = next;
        }
        u16::from(channel) << CHANNEL_SHIFT | self.code(channel)
    }

    fn read_word(&mut self) -> u16 {
        match self.state.pointer {
            RESULT => self.take_result(),
            // Eight bits; that both bytes are the same is an assumption.
            CHANNEL => u16::from_be_bytes([self.state.enabled; 2]),
            CONFIG => self.state.config,
            pointer @ FIRST_LIMIT..=LAST_LIMIT => self.state.limits[usize::from(pointer - FIRST_LIMIT)],
            _ => 0,
        }
    }

    fn configure(&mut self, value: u16) {
        if value & RESET != 0 {
            self.state = State {
                pointer: self.state.pointer,
                ..State::after_reset()
            };
        }
        self.state.config = value & !RESET;
    }

    /// The first channel of a new selection comes after the result that is ready already.
    fn select(&mut self, channels: u8) {
        self.state.enabled = channels & 0xf;
    }

    /// The bytes of a register are complete: what follows is another register's number.
    fn take_written(&mut self) {
        match (self.state.pointer, &self.written[..]) {
            (CHANNEL, &[channels]) => self.select(channels),
            (CHANNEL, _) | (_, [] | [_]) => return,
            (CONFIG, &[high, low]) => self.configure(u16::from_be_bytes([high, low])),
            (pointer @ FIRST_LIMIT..=LAST_LIMIT, &[high, low]) => {
                self.state.limits[usize::from(pointer - FIRST_LIMIT)] =
                    u16::from_be_bytes([high, low]) & 0xfff;
            }
            _ => {}
        }
        self.written.clear();
        self.pointer_was_sent = false;
    }
}

impl I2cDevice for Ad7091r5 {
    fn start(&mut self, _direction: I2cDirection, _now: Cycle) -> Ack {
        self.written.clear();
        self.pointer_was_sent = false;
        self.half_read = None;
        Ack::Ack
    }

    fn write(&mut self, byte: u8) -> Ack {
        if self.pointer_was_sent {
            self.written.push(byte);
            self.take_written();
        } else {
            self.state.pointer = byte;
            self.pointer_was_sent = true;
        }
        Ack::Ack
    }

    fn read(&mut self) -> u8 {
        if let Some(low) = self.half_read.take() {
            return low;
        }
        let [high, low] = self.read_word().to_be_bytes();
        self.half_read = Some(low);
        high
    }
}

#[cfg(test)]
mod tests {
    use super::super::register_map::driver::read;
    use super::*;

    fn send(device: &mut Ad7091r5, bytes: &[u8]) {
        device.start(I2cDirection::Write, 0);
        for &byte in bytes {
            assert_eq!(device.write(byte), Ack::Ack);
        }
        device.stop();
    }

    /// Results with their channels, read without setting the pointer.
    fn results(device: &mut Ad7091r5, count: usize) -> Vec<(u16, u16)> {
        device.start(I2cDirection::Read, 0);
        let mut word = || u16::from_be_bytes([device.read(), device.read()]);
        (0..count)
            .map(|_| word())
            .map(|word| (word >> 13, word & 0xfff))
            .collect()
    }

    /// 3.3 V is 4096 steps of 805.7 uV.
    fn example() -> Ad7091r5 {
        let mut device = Ad7091r5::new(Reference::External(3.3));
        for (channel, volts) in [0.0, 0.825, 1.65, 3.3].into_iter().enumerate() {
            device.set(channel, volts);
        }
        device
    }

    #[test]
    fn one_write_sets_it_up_and_eight_bytes_are_all_channels() {
        // What ArduPilot sends: command mode and reset; then CONFIG, CHANNEL, and a pointer to RESULT.
        let mut device = example();
        send(&mut device, &[0x02, 0x06, 0x00]);
        send(&mut device, &[0x02, 0x04, 0x00, 0x01, 0x0f, 0x00]);
        let expected = [(0, 0), (1, 1024), (2, 2048), (3, 4095)];
        assert_eq!(results(&mut device, 4), expected);
        assert_eq!(results(&mut device, 4), expected);
        assert_eq!(read(&mut device, CONFIG, 2), 0x0400);
        assert_eq!(read(&mut device, CHANNEL, 1), 0x0f);
    }

    #[test]
    fn a_changed_selection_comes_one_result_later() {
        let mut device = example();
        send(&mut device, &[0x02, 0x04, 0x00, 0x01, 0b0101, 0x00]);
        assert_eq!(results(&mut device, 3), [(0, 0), (2, 2048), (0, 0)]);
        send(&mut device, &[0x01, 0b1000, 0x00]);
        assert_eq!(results(&mut device, 3), [(2, 2048), (3, 4095), (3, 4095)]);
    }

    #[test]
    fn the_reference_decides_what_a_volt_is() {
        let mut device = example();
        send(&mut device, &[0x02, 0x04, 0x01, 0x01, 0b0010, 0x00]);
        assert_eq!(results(&mut device, 2)[1], (1, 1352), "0.825 V of 2.5 V");
        let mut device = Ad7091r5::new(Reference::None);
        device.set(1, 0.825);
        send(&mut device, &[0x02, 0x04, 0x00, 0x01, 0b0010, 0x00]);
        assert_eq!(results(&mut device, 2)[1], (1, 0), "there is none");
    }

    #[test]
    fn without_command_mode_nothing_is_converted() {
        let mut device = example();
        send(&mut device, &[0x01, 0x0f, 0x00]);
        assert_eq!(results(&mut device, 2), [(0, 0), (0, 0)]);
    }

    #[test]
    fn reset_and_power_cycle_forget_what_was_written() {
        let set_up = |device: &mut Ad7091r5| {
            send(device, &[0x02, 0x04, 0x01, 0x01, 0x0f, 0x05, 0x01, 0x23]);
            assert_eq!(read(device, 0x05, 2), 0x123);
        };
        let mut device = example();
        set_up(&mut device);
        send(&mut device, &[0x02, 0x02, 0x00]);
        assert_eq!(read(&mut device, CONFIG, 2), 0, "what was written with it");
        assert_eq!(read(&mut device, 0x05, 2), 0xfff);
        set_up(&mut device);
        device.power_cycle();
        assert_eq!(read(&mut device, CONFIG, 2), 0x00c0);
        assert_eq!(read(&mut device, CHANNEL, 1), 0);
        assert_eq!(read(&mut device, 0x05, 2), 0xfff);
    }
}
