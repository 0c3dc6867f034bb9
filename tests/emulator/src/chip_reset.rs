//! VREG_AND_CHIP_RESET: which chip-level reset came last (datasheet 2.12.8).
//!
//! A watchdog reset and SYSRESETREQ are not chip-level resets: they leave these flags as they are.

use super::clock::Cycle;
use super::peripheral::Peripheral;
use super::register::RegisterWrite;

const VREG: u32 = 0x0;
const BOD: u32 = 0x4;
const CHIP_RESET: u32 = 0x8;

const VREG_RESET: u32 = 0xb1;
const VREG_MASK: u32 = 0xf3;
const BOD_RESET: u32 = 0x91;
const BOD_MASK: u32 = 0xf1;

/// A reset of the whole chip; the number is its flag in CHIP_RESET.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ChipLevelReset {
    /// Power-on or brown-out: HAD_POR.
    PowerOn = 1 << 8,
    /// The RUN pin was low: HAD_RUN.
    RunPin = 1 << 16,
}

#[derive(Clone)]
pub struct ChipReset {
    last: ChipLevelReset,
    vreg: u32,
    bod: u32,
}

impl ChipReset {
    pub fn after(last: ChipLevelReset) -> Self {
        Self {
            last,
            vreg: VREG_RESET,
            bod: BOD_RESET,
        }
    }
}

impl Peripheral for ChipReset {
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        match offset {
            VREG => self.vreg,
            BOD => self.bod,
            CHIP_RESET => self.last as u32,
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, _now: Cycle) {
        match offset {
            VREG => write.update(&mut self.vreg, VREG_MASK),
            BOD => write.update(&mut self.bod, BOD_MASK),
            _ => {}
        }
    }

    fn reset(&mut self, _now: Cycle) {
        *self = Self::after(self.last);
    }
}
