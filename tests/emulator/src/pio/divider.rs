//! A state machine's clock divider: 16 bits integer, 8 bits fraction (datasheet 3.5.5).

use super::super::clock::Cycle;
use super::super::register::field;

const ONE: u64 = 256;
const LONGEST: u64 = 65_536;

#[derive(Clone, Debug)]
pub struct Divider {
    register: u32,
    /// It runs on from here, whether the state machine is enabled or not.
    origin: Cycle,
}

impl Divider {
    pub fn new() -> Self {
        Self {
            register: 1 << 16,
            origin: 0,
        }
    }

    pub fn register(&self) -> u32 {
        self.register
    }

    pub fn set_register(&mut self, value: u32, now: Cycle) {
        self.register = value & 0xffff_ff00;
        self.origin = now;
    }

    /// CTRL.CLKDIV_RESTART.
    pub fn restart(&mut self, now: Cycle) {
        self.origin = now;
    }

    /// In 256ths of a cycle. "Value of 0 is interpreted as 65536. If INT is 0, FRAC must also be 0" (3.7).
    fn period(&self) -> u64 {
        match u64::from(field(self.register, 16, 16)) {
            0 => LONGEST * ONE,
            whole => whole * ONE + u64::from(field(self.register, 8, 8)),
        }
    }

    /// The next cycle after `now` in which the state machine's clock is enabled. With a fraction some periods are one
    /// cycle longer than others.
    pub fn next_after(&self, now: Cycle) -> Cycle {
        let wanted = (now + 1 - self.origin) * ONE;
        let periods = wanted.div_ceil(self.period());
        self.origin + periods * self.period() / ONE
    }

    /// This many periods after one of its cycles, at the earliest.
    pub fn later_by(&self, cycle: Cycle, periods: u64) -> Cycle {
        cycle + periods * self.period() / ONE
    }
}
