//! AD7091R-5: 12-bit converter with four inputs.
//!
//! In command mode the next enabled channel is converted when a result has been read (figure 41 of the AD7291, its sibling), so the
//! first result of a read is as old as the read before, and after a reset none; a changed selection comes one result later, as
//! drivers have found. Each conversion is of an instant: codes end at 0 and 4095. Left out: the CONVST pin, autocycle mode,
//! alerts, conversion times. What is not confirmed is said where it stands.

use super::super::super::circuit::{Circuit, Probe};
use super::super::super::clock::Cycle;
use super::super::device::{Ack, I2cDevice, I2cDirection};
use super::unsigned_code;

const RESULT: u8 = 0x00;
const CHANNEL: u8 = 0x01;
const CONFIG: u8 = 0x02;

/// From memory, not confirmed.
const CONFIG_RESET: u16 = 0x00c0;
const CMD: u16 = 1 << 10;
const RESET: u16 = 1 << 9;
const INTERNAL_REFERENCE: u16 = 1;
const INTERNAL_REFERENCE_V: f64 = 2.5;

const CHANNELS: u8 = 4;
const RESULT_BITS: u32 = 12;
const CHANNEL_SHIFT: u32 = 13;

struct State {
    enabled: u8,
    config: u16,
    pointer: u8,
    /// The channel of the result that is ready.
    converted: u8,
    /// Its code.
    result: u16,
}

impl State {
    fn after_reset() -> Self {
        Self {
            enabled: 0,
            config: CONFIG_RESET,
            pointer: RESULT,
            converted: 0,
            result: 0,
        }
    }
}

pub struct Ad7091r5 {
    /// The voltage at the REF pin while the internal reference is off.
    external_reference_v: f64,
    volts: [f64; CHANNELS as usize],
    /// Of the inputs that are connected to the pack of the board's circuit.
    probes: [Option<Probe>; CHANNELS as usize],
    state: State,
    /// Bytes since the START that were not used yet.
    written: Vec<u8>,
    pointer_was_sent: bool,
    /// The low byte of the word that is being read.
    half_read: Option<u8>,
}

impl Ad7091r5 {
    pub fn new(external_reference_v: f64) -> Self {
        Self {
            external_reference_v,
            volts: [0.0; CHANNELS as usize],
            probes: [None; CHANNELS as usize],
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

    /// Input VIN0 to VIN3, connected to the pack of the board's circuit: each result is of the instant at which it is read.
    pub fn connect(&mut self, channel: usize, probe: Probe) {
        self.probes[channel] = Some(probe);
    }

    /// The supply of the device is gone and back. What it is connected to stays.
    pub fn power_cycle(&mut self) {
        self.state = State::after_reset();
        self.written.clear();
    }

    fn code(&self, channel: u8) -> u16 {
        let reference_v = match self.state.config & INTERNAL_REFERENCE {
            0 => self.external_reference_v,
            _ => INTERNAL_REFERENCE_V,
        };
        let step_v = reference_v / f64::from(1 << RESULT_BITS);
        unsigned_code(self.volts[usize::from(channel)], step_v, RESULT_BITS) as u16
    }

    /// The enabled channel after the one converted last, in ascending order and round again.
    fn next_channel(&self) -> Option<u8> {
        (1..=CHANNELS)
            .map(|step| (self.state.converted + step) % CHANNELS)
            .find(|channel| self.state.enabled >> channel & 1 != 0)
    }

    fn take_result(&mut self) -> u16 {
        let State {
            converted, result, ..
        } = self.state;
        if self.state.config & CMD != 0
            && let Some(next) = self.next_channel()
        {
            (self.state.converted, self.state.result) = (next, self.code(next));
        }
        u16::from(converted) << CHANNEL_SHIFT | result
    }

    fn read_word(&mut self) -> u16 {
        match self.state.pointer {
            RESULT => self.take_result(),
            // Eight bits; that both bytes are the same is an assumption.
            CHANNEL => u16::from_be_bytes([self.state.enabled; 2]),
            CONFIG => self.state.config,
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

    /// The bytes of a register are complete: what follows is another register's number.
    fn take_written(&mut self) {
        match (self.state.pointer, &self.written[..]) {
            // The first channel of a new selection comes after the result that is ready already.
            (CHANNEL, &[channels]) => self.state.enabled = channels & 0xf,
            (CHANNEL, _) | (_, [] | [_]) => return,
            (CONFIG, &[high, low]) => self.configure(u16::from_be_bytes([high, low])),
            _ => {}
        }
        self.written.clear();
        self.pointer_was_sent = false;
    }
}

impl I2cDevice for Ad7091r5 {
    fn sense(&mut self, circuit: &Circuit) {
        for (volts, probe) in self.volts.iter_mut().zip(self.probes) {
            *volts = probe.map_or(*volts, |probe| probe.volts(circuit.terminals()));
        }
    }

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
        let mut device = Ad7091r5::new(3.3);
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
    fn the_first_result_was_converted_at_the_end_of_the_read_before() {
        let mut device = example();
        send(&mut device, &[0x02, 0x04, 0x00, 0x01, 0b0010, 0x00]);
        device.set(1, 3.0);
        assert_eq!(results(&mut device, 2), [(0, 0), (1, 3724)]);
        device.set(1, 0.825);
        assert_eq!(results(&mut device, 3), [(1, 3724), (1, 1024), (1, 1024)]);
        device.power_cycle();
        assert_eq!(read(&mut device, CONFIG, 2), 0x00c0);
        device.pointer_was_sent = false;
        assert_eq!(results(&mut device, 1), [(0, 192)], "the register at the pointer");
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
    }

    #[test]
    fn without_command_mode_nothing_is_converted() {
        let mut device = example();
        send(&mut device, &[0x01, 0x0f, 0x00]);
        assert_eq!(results(&mut device, 2), [(0, 0), (0, 0)]);
    }

    #[test]
    fn a_reset_forgets_what_was_written() {
        let mut device = example();
        assert_eq!(read(&mut device, CONFIG, 2), 0x00c0);
        send(&mut device, &[0x02, 0x04, 0x00, 0x01, 0x0f, 0x00]);
        send(&mut device, &[0x02, 0x02, 0x00]);
        assert_eq!(read(&mut device, CONFIG, 2), 0, "what was written with it");
        assert_eq!(read(&mut device, CHANNEL, 1), 0);
    }
}
