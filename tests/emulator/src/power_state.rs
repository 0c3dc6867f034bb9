//! PSM, the power-on state machine's registers (datasheet 2.13): which blocks are held off and
//! which of them a watchdog reset restarts.

use super::clock::Cycle;
use super::peripheral::Peripheral;
use super::register::{RegisterWrite, bit};

const FRCE_ON: u32 = 0x0;
const FRCE_OFF: u32 = 0x4;
const WDSEL: u32 = 0x8;
const DONE: u32 = 0xc;

const STAGES: u32 = 17;
const STAGE_MASK: u32 = (1 << STAGES) - 1;
const SIO: u32 = 14;
const PROC0: u32 = 15;

#[derive(Clone, Default)]
pub struct PowerState {
    force_on: u32,
    force_off: u32,
    watchdog_select: u32,
}

impl PowerState {
    /// Stages that are up: one is down when it is forced off, or when the stage before it is down
    /// and it is not forced on.
    fn done(&self) -> u32 {
        let mut done = 0;
        let mut previous_is_up = true;
        for stage in 0..STAGES {
            let follows = previous_is_up || bit(self.force_on, stage);
            previous_is_up = follows && !bit(self.force_off, stage);
            done |= u32::from(previous_is_up) << stage;
        }
        done
    }

    /// The single-cycle IO block is held off.
    pub fn sio_is_down(&self) -> bool {
        !bit(self.done(), SIO)
    }

    /// A watchdog reset reaches processor 0. WDSEL is 0 after reset: a firmware that forgets it has
    /// a watchdog that restarts nothing.
    pub fn watchdog_resets_processor(&self) -> bool {
        bit(self.watchdog_select, PROC0)
    }
}

impl Peripheral for PowerState {
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        match offset {
            FRCE_ON => self.force_on,
            FRCE_OFF => self.force_off,
            WDSEL => self.watchdog_select,
            DONE => self.done(),
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, _now: Cycle) {
        match offset {
            FRCE_ON => write.update(&mut self.force_on, STAGE_MASK),
            FRCE_OFF => write.update(&mut self.force_off, STAGE_MASK),
            WDSEL => write.update(&mut self.watchdog_select, STAGE_MASK),
            _ => {}
        }
    }

    fn reset(&mut self, _now: Cycle) {
        *self = Self::default();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_stage_forced_off_takes_the_later_ones_with_it_unless_forced_on() {
        let mut psm = PowerState::default();
        psm.write(FRCE_OFF, RegisterWrite::plain(1 << SIO), 0);
        assert_eq!(psm.read(DONE, 0), (1 << SIO) - 1);
        psm.write(FRCE_ON, RegisterWrite::plain(1 << PROC0), 0);
        assert_eq!(psm.read(DONE, 0), STAGE_MASK & !(1 << SIO));
        assert!(psm.sio_is_down());
    }
}
