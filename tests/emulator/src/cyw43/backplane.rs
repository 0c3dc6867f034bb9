//! F1: the backplane. Its own registers from 0x10000 on; below, a window of 32 KB into what is behind it: the chip's
//! identity, the wrappers that hold its cores in reset, and the RAM that the WLAN core's program runs from.

use std::collections::BTreeMap;

use super::super::clock::{Cycle, cycles};
use super::fault::ChipPart;
use super::program::{Program, RAM_BYTES};

const OWN_REGISTERS: u32 = 0x1_0000;
const WINDOW_LOW: u32 = 0x1_000a;
const WINDOW_HIGH: u32 = 0x1_000c;
const CLOCK: u32 = 0x1_000e;
const WINDOW_MASK: u32 = 0x7fff;

/// Low-power and high-throughput clock: asked for, and there.
const LOW_POWER_REQUEST: u8 = 0x08;
const LOW_POWER_AVAILABLE: u8 = 0x40;
const HIGH_AVAILABLE: u8 = 0x80;

const CHIP_ID_ADDRESS: u32 = 0x1800_0000;
const CHIP_ID: u32 = 43_439;

const WLAN_WRAPPER: u32 = 0x1810_3000;
const SOCSRAM_WRAPPER: u32 = 0x1810_4000;
const WRAPPER_BYTES: u32 = 0x1000;
const IO_CONTROL: u32 = 0x408;
const RESET_CONTROL: u32 = 0x800;
const CLOCK_ENABLED: u8 = 0x01;
const CLOCK_FORCED: u8 = 0x02;
const HALTED: u8 = 0x20;

/// "Takes about 29 ms" (driver cyw43, where it waits for the clock that the program starts).
const HIGH_CLOCK_AFTER: Cycle = cycles(29_000);
/// Until the program takes packets.
const PACKETS_AFTER: Cycle = cycles(40_000);

/// A core's reset and clock.
#[derive(Clone, Copy, Debug)]
struct Wrapper {
    io_control: u8,
    reset_control: u8,
}

impl Wrapper {
    const HELD: Self = Self {
        io_control: 0,
        reset_control: 1,
    };

    fn has_clock(self) -> bool {
        self.reset_control & 1 == 0 && self.io_control & CLOCK_ENABLED != 0
    }

    fn runs(self) -> bool {
        self.has_clock() && self.io_control & (CLOCK_FORCED | HALTED) == 0
    }

    fn register(&mut self, offset: u32) -> Option<&mut u8> {
        match offset {
            IO_CONTROL => Some(&mut self.io_control),
            RESET_CONTROL => Some(&mut self.reset_control),
            _ => None,
        }
    }
}

#[derive(Clone)]
pub struct Backplane {
    own: BTreeMap<u32, u8>,
    window: u32,
    wlan: Wrapper,
    socsram: Wrapper,
    /// Registers behind the backplane that only keep what is written to them.
    others: BTreeMap<u32, u8>,
    program: Program,
    started_at: Option<Cycle>,
    /// What never gets ready.
    missing: Option<ChipPart>,
}

impl Backplane {
    pub fn new(program: Program) -> Self {
        Self {
            own: BTreeMap::new(),
            window: 0,
            wlan: Wrapper::HELD,
            socsram: Wrapper::HELD,
            others: BTreeMap::new(),
            program,
            started_at: None,
            missing: None,
        }
    }

    /// This part does not get ready from now on.
    pub fn set_missing(&mut self, part: Option<ChipPart>) {
        self.missing = part;
    }

    /// One in this many writes to the RAM flips a bit.
    pub fn set_flips(&mut self, one_in: Option<u32>) {
        self.program.set_flips(one_in);
    }

    /// When the program takes packets, if it was started.
    pub fn packets_from(&self) -> Option<Cycle> {
        let start = self
            .started_at
            .filter(|_| self.missing != Some(ChipPart::Packets));
        start.map(|start| start + PACKETS_AFTER)
    }

    /// A program that is not the chip's was started.
    pub fn has_refused_program(&self) -> bool {
        self.wlan.runs() && self.started_at.is_none()
    }

    pub fn read(&mut self, address: u32, count: usize, now: Cycle) -> Vec<u8> {
        let addresses = (0..count as u32).map(|offset| address + offset);
        addresses.map(|address| self.read_byte(address, now)).collect()
    }

    pub fn write(&mut self, address: u32, bytes: &[u8], now: Cycle) {
        if address < OWN_REGISTERS {
            self.write_behind(self.behind(address), bytes);
        } else {
            (address..)
                .zip(bytes)
                .for_each(|(address, &byte)| self.write_own(address, byte));
        }
        self.start_or_stop(now);
    }

    fn behind(&self, address: u32) -> u32 {
        self.window | address & WINDOW_MASK
    }

    fn read_byte(&mut self, address: u32, now: Cycle) -> u8 {
        match address {
            CLOCK => self.clock(now),
            OWN_REGISTERS.. => self.own.get(&address).copied().unwrap_or(0),
            _ => self.read_behind(self.behind(address)),
        }
    }

    fn clock(&self, now: Cycle) -> u8 {
        let requests = self.own.get(&CLOCK).copied().unwrap_or(0);
        let has_clock = self.missing != Some(ChipPart::LowPowerClock);
        let low_power = if has_clock && requests & LOW_POWER_REQUEST != 0 {
            LOW_POWER_AVAILABLE
        } else {
            0
        };
        let is_high = self
            .started_at
            .is_some_and(|start| now >= start + HIGH_CLOCK_AFTER);
        requests | low_power | if is_high { HIGH_AVAILABLE } else { 0 }
    }

    fn write_own(&mut self, address: u32, byte: u8) {
        if let WINDOW_LOW..=WINDOW_HIGH = address {
            let shift = 8 * (address - WINDOW_LOW + 1);
            self.window = (self.window & !(0xff << shift) | u32::from(byte) << shift) & !WINDOW_MASK;
        }
        self.own.insert(address, byte);
    }

    fn wrapper(&mut self, address: u32) -> Option<&mut u8> {
        match address & !(WRAPPER_BYTES - 1) {
            WLAN_WRAPPER => self.wlan.register(address % WRAPPER_BYTES),
            SOCSRAM_WRAPPER => self.socsram.register(address % WRAPPER_BYTES),
            _ => None,
        }
    }

    fn read_behind(&mut self, address: u32) -> u8 {
        if let Some(register) = self.wrapper(address) {
            return *register;
        }
        let index = address as usize;
        match address {
            _ if index < RAM_BYTES => self.program.ram().get(index).copied().unwrap_or(0),
            CHIP_ID_ADDRESS.. if address - CHIP_ID_ADDRESS < 4 => CHIP_ID.to_le_bytes()[index % 4],
            _ => self.others.get(&address).copied().unwrap_or(0),
        }
    }

    fn write_behind(&mut self, address: u32, bytes: &[u8]) {
        if (address as usize) < RAM_BYTES {
            // Without a clock the RAM takes nothing.
            if self.socsram.has_clock() {
                self.program.store(address as usize, bytes);
            }
            return;
        }
        for (address, &byte) in (address..).zip(bytes) {
            let is_stuck =
                self.missing == Some(ChipPart::WlanCore) && address == WLAN_WRAPPER + RESET_CONTROL;
            match self.wrapper(address) {
                Some(_) if is_stuck => {}
                Some(register) => *register = byte,
                None => {
                    self.others.insert(address, byte);
                }
            }
        }
    }

    /// The WLAN core runs what is in the RAM, or holds.
    fn start_or_stop(&mut self, now: Cycle) {
        if !self.wlan.runs() {
            self.started_at = None;
        } else if self.started_at.is_none() && self.program.is_new() && self.program.is_the_chips() {
            self.started_at = Some(now);
        }
    }
}
