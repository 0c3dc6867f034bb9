//! One of the eight slices: a counter, two outputs.

use super::super::clock::{CLK_SYS_HZ, Cycle, NEVER};
use super::super::register::{RegisterWrite, bit, field};
use super::PwmOutput;

pub const CSR: u32 = 0x00;
pub const DIV: u32 = 0x04;
pub const CTR: u32 = 0x08;
pub const CC: u32 = 0x0c;
pub const TOP: u32 = 0x10;

const CSR_ENABLE: u32 = 0;
/// PH_CORRECT, A_INV, B_INV, DIVMODE other than free-running, PH_RET and PH_ADV.
const CSR_NOT_MODELLED: u32 = 0xfe;
const CSR_MASK: u32 = 0xff;
const DIV_MASK: u32 = 0xfff;
const HALF: u32 = 0xffff;

/// The divisor, and with it time within a period, is in sixteenths of a cycle.
const SIXTEENTHS: u64 = 16;

/// What is double-buffered: "one copy which software can modify, and another, internal copy which
/// is updated from the first register at the instant the counter wraps" (4.5.2.3).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Levels {
    top: u32,
    /// CC: channel B in the upper half.
    compare: u32,
}

impl Levels {
    const AT_RESET: Self = Self {
        top: HALF,
        compare: 0,
    };

    fn of_channel(self, channel: usize) -> u64 {
        u64::from(field(self.compare, 16 * channel as u32, 16))
    }

    /// From 0 to TOP.
    fn counts(self) -> u64 {
        u64::from(self.top) + 1
    }
}

/// A slice as it was at a moment; what it does from then on follows from that.
#[derive(Clone, Copy, Debug)]
pub struct Slice {
    csr: u32,
    div: u32,
    written: Levels,
    latched: Levels,
    /// How far it was into its period at `moment`, in sixteenths of a cycle.
    elapsed: u64,
    moment: Cycle,
}

impl Slice {
    pub fn after_reset(now: Cycle) -> Self {
        Self {
            csr: 0,
            div: SIXTEENTHS as u32,
            written: Levels::AT_RESET,
            latched: Levels::AT_RESET,
            elapsed: 0,
            moment: now,
        }
    }

    /// This slice later.
    pub fn at(mut self, now: Cycle) -> Self {
        self.advance(now);
        self
    }

    pub fn advance(&mut self, now: Cycle) {
        if self.is_enabled() {
            self.elapsed += SIXTEENTHS * (now - self.moment);
        }
        if self.elapsed >= self.period() {
            self.elapsed -= self.period();
            self.latched = self.written;
            self.elapsed %= self.period();
        }
        self.moment = now;
    }

    /// When what was written comes into force, if it has not.
    pub fn next_latch(&self) -> Cycle {
        if !self.is_enabled() || self.written == self.latched {
            return NEVER;
        }
        self.moment + (self.period() - self.elapsed).div_ceil(SIXTEENTHS)
    }

    /// When the level of a channel may be another one than now: when the counter reaches the compare level, or wraps.
    pub fn next_change(&self, channel: usize) -> Cycle {
        let (counts, compare) = (self.latched.counts(), self.latched.of_channel(channel));
        let never_changes = compare == 0 || compare >= counts;
        if !self.is_enabled() || never_changes && self.written == self.latched {
            return NEVER;
        }
        let reached = compare * self.divisor();
        let change = if self.elapsed < reached && compare < counts {
            reached
        } else {
            self.period()
        };
        self.moment + (change - self.elapsed).div_ceil(SIXTEENTHS)
    }

    fn is_enabled(&self) -> bool {
        bit(self.csr, CSR_ENABLE)
    }

    fn divisor(&self) -> u64 {
        u64::from(self.div)
    }

    /// A period is (TOP + 1) × DIV cycles (4.5.2.6).
    fn period(&self) -> u64 {
        self.latched.counts() * self.divisor()
    }

    /// Up from 0 to TOP.
    fn counter(&self) -> u64 {
        self.elapsed / self.divisor()
    }

    /// High while the counter is below the compare level (4.5.2.2): never for 0, always for TOP + 1. A
    /// slice that is disabled stands still, and so do its outputs.
    pub fn level(&self, channel: usize) -> bool {
        self.counter() < self.latched.of_channel(channel)
    }

    pub fn output(&self, channel: usize) -> PwmOutput {
        if !self.is_enabled() {
            return PwmOutput {
                frequency_hz: 0.0,
                duty: f64::from(u8::from(self.level(channel))),
            };
        }
        let counts = self.latched.counts();
        PwmOutput {
            frequency_hz: (CLK_SYS_HZ * SIXTEENTHS) as f64 / self.period() as f64,
            duty: self.latched.of_channel(channel).min(counts) as f64 / counts as f64,
        }
    }

    pub fn read(&self, register: u32) -> u32 {
        match register {
            CSR => self.csr,
            DIV => self.div,
            CTR => self.counter() as u32,
            CC => self.written.compare,
            TOP => self.written.top,
            _ => 0,
        }
    }

    /// Panics at what is not modelled: a test that relied on it would show nothing.
    pub fn write(&mut self, register: u32, write: RegisterWrite) {
        match register {
            CSR => write.update(&mut self.csr, CSR_MASK),
            DIV => self.set_divisor(write.applied_to(self.div) & DIV_MASK),
            CTR => self.set_counter(write.applied_to(self.counter() as u32) & HALF),
            CC => write.update(&mut self.written.compare, u32::MAX),
            TOP => write.update(&mut self.written.top, HALF),
            _ => {}
        }
        assert!(
            self.csr & CSR_NOT_MODELLED == 0,
            "PWM: CSR {:#x} is not modelled: only a free-running counter upwards is",
            self.csr
        );
        self.latch_if_disabled();
    }

    pub fn set_enabled(&mut self, enabled: bool) {
        self.csr = self.csr & !(1 << CSR_ENABLE) | u32::from(enabled) << CSR_ENABLE;
    }

    /// "If the PWM is not running, the write is latched in immediately" (Pico SDK, pwm_set_wrap and
    /// pwm_set_chan_level).
    fn latch_if_disabled(&mut self) {
        if !self.is_enabled() {
            self.latched = self.written;
        }
    }

    /// The count stays.
    fn set_divisor(&mut self, div: u32) {
        assert!(
            div >= SIXTEENTHS as u32,
            "PWM: a divisor below 1 is not modelled: {div:#x}"
        );
        if div != self.div {
            self.elapsed = self.elapsed / self.divisor() * u64::from(div);
            self.div = div;
        }
    }

    fn set_counter(&mut self, count: u32) {
        assert!(
            count <= self.latched.top,
            "PWM: a counter past TOP is not modelled: {count}"
        );
        self.elapsed = u64::from(count) * self.divisor();
    }
}
