//! What each fault does to a board.

use super::fault::Fault;
use super::line::Condition;
use super::packs::Packs;
use super::rig::Rig;
use crate::bench::{CYCLES_PER_US, MILLISECOND, SECOND};
use crate::i2c_bus::BUS;
use emulator::i2c_devices::{Pec, Reads};
use emulator::{AdcFault, Board, FlashCut, Random, ResetCause};

/// With more crashes in a row it is the program that is broken, and a board may start with other parameters than its own.
const MOST_CRASHES: u32 = 4;

const CYCLES_PER_MS: u64 = MILLISECOND * CYCLES_PER_US;

/// The watchdog's second, and a look at the tasks every 100 ms.
const HANG_US: u64 = 1_050 * MILLISECOND;

/// A parameter that is set is written within this.
const WRITING_US: u64 = 300 * MILLISECOND;

impl Rig {
    /// A fault, from its beginning until nothing is left of it.
    pub fn suffer(&mut self, fault: Fault) {
        self.calm_since_us = None;
        self.packs.watch(fault.spares());
        let starts = self.resets;
        self.begin(fault);
        if !fault.restarts() {
            self.last();
        }
        self.end(fault);
        self.packs.change_voltages(fault.hits(), &mut self.bench);
        self.recover(fault);
        if self.resets > starts {
            self.read_back();
        }
    }

    /// Time of a fault that lasts; in one of four the board starts anew in it.
    fn last(&mut self) {
        let length_us = 200 * MILLISECOND + self.random.below(6_000_000) as u64;
        self.run_for(length_us);
        if self.random.below(4) == 0 {
            let sudden = self.random.pick(&Fault::SUDDEN);
            self.packs.watch(&[]);
            self.begin(sudden);
            self.tally.sudden += 1;
            self.run_for(length_us);
        }
    }

    fn begin(&mut self, fault: Fault) {
        match fault {
            Fault::AdcGlitches => self.packs.glitch(&mut self.bench),
            Fault::AdcErrors => self.bench.adc_fault(AdcFault::ConversionError),
            Fault::AdcStalls => self.bench.adc_fault(AdcFault::Stalled),
            Fault::LineNoise => self.line.condition = Condition::Noisy,
            Fault::LostBytes => self.line.condition = Condition::Lossy,
            Fault::LineDead => self.line.condition = Condition::Dead,
            Fault::HostileFrames => self.line.condition = Condition::Shared,
            Fault::BusClockHeld => self.bench.i2c(BUS).hold_scl(),
            Fault::BusDataHeld => self.bench.i2c(BUS).hold_sda(u32::MAX),
            Fault::PartsUnplugged => Packs::unplug(&mut self.bench),
            Fault::PartsGarbled => {
                let noise = Reads::Noise(Random::new(self.random.next_u64()));
                self.packs.monitor.borrow_mut().set_reads(noise);
                self.packs.battery.borrow_mut().set_pec(Pec::Wrong);
            }
            Fault::PartHangs => self.packs.battery.borrow_mut().set_stretch(50 * CYCLES_PER_MS),
            Fault::BrownOut => self.lose_power(),
            Fault::RunPin => self.press_run(),
            Fault::FlashCut => self.lose_power_while_writing(),
            Fault::ProgramHangs => self.crash(Board::hang_program),
            Fault::ProgramCrashes => self.crash(Board::run_undefined_instruction),
        }
    }

    fn end(&mut self, fault: Fault) {
        match fault {
            Fault::AdcErrors | Fault::AdcStalls => self.bench.adc_fault(AdcFault::None),
            Fault::LineNoise | Fault::LostBytes | Fault::LineDead | Fault::HostileFrames => {
                self.line.condition = Condition::Clean;
            }
            Fault::BusClockHeld => self.bench.i2c(BUS).release_scl(),
            Fault::BusDataHeld => self.bench.i2c(BUS).release_sda(),
            Fault::PartsUnplugged => self.packs.plug_in(&mut self.bench),
            Fault::PartsGarbled => {
                self.packs.monitor.borrow_mut().set_reads(Reads::Own);
                self.packs.battery.borrow_mut().set_pec(Pec::Right);
            }
            Fault::PartHangs => self.packs.battery.borrow_mut().set_stretch(0),
            // Those end when the voltages are changed, or with the start.
            Fault::AdcGlitches
            | Fault::BrownOut
            | Fault::RunPin
            | Fault::FlashCut
            | Fault::ProgramHangs
            | Fault::ProgramCrashes => {}
        }
    }

    fn press_run(&mut self) {
        self.bench.press_run();
        self.look_at_reset(&[ResetCause::RunPin]);
        self.crashes = 0;
    }

    /// The power goes, for between a millisecond and three seconds.
    fn lose_power(&mut self) {
        self.bench.cut_power();
        let off_us = match self.random.below(2) {
            0 => MILLISECOND + self.random.below(100_000) as u64,
            _ => self.random.below(3_000_000) as u64,
        };
        self.bench.run_for(off_us);
        self.bench.power_cycle();
        self.look_at_reset(&[ResetCause::PowerCycle]);
        self.crashes = 0;
    }

    /// The power goes in one of the next operations of the flash chip.
    fn lose_power_while_writing(&mut self) {
        let operation = 1 + self.random.below(3) as u64;
        let cut = self.random.pick(&FlashCut::ALL);
        self.bench.cut_power_at_flash_operation(operation, cut);
        for _ in 0..operation {
            let now_us = self.now_us();
            let setting = self.station.set_something(now_us, &mut self.ledger);
            self.send(&setting);
            self.bench.run_for(WRITING_US);
            if !self.bench.is_powered() {
                break;
            }
        }
        assert!(!self.bench.is_powered(), "flash was not written");
        self.lose_power();
    }

    fn crash(&mut self, derail: impl FnOnce(&mut Board)) {
        if self.crashes == MOST_CRASHES {
            self.press_run();
            // The watchdog is not started yet.
            self.run_for(SECOND);
        }
        self.crashes += 1;
        derail(&mut self.bench);
        self.wait_for_watchdog();
    }

    /// Nothing more is sent, so that no stick input follows the driver's last one.
    fn wait_for_watchdog(&mut self) {
        let begun_us = self.now_us();
        let resets = self.resets;
        let reset = self
            .bench
            .run_until(2 * SECOND, |board| board.resets().len() > resets);
        assert!(reset, "no reset");
        let after_us = self.now_us() - begun_us;
        assert!(after_us <= HANG_US, "reset after {after_us} us");
        self.look_at_reset(&[ResetCause::WatchdogTimer, ResetCause::WatchdogForce]);
    }
}
