//! What each fault does to a board.

use super::fault::Fault;
use super::line::Condition;
use super::motors::Motors;
use super::packs::Packs;
use super::rig::{Radio, Rig};
use crate::bench::{CYCLES_PER_US, MILLISECOND, SECOND};
use crate::i2c_bus::BUS;
use emulator::can::CanWires;
use emulator::i2c_devices::{Pec, Reads};
use emulator::{AdcFault, Board, FlashCut, RadioFault, Random, ResetCause};
use rover_battmon::memory::flash_map;
use support::requests::arm_by_force;

/// With more crashes in a row it is the program that is broken, and a board may start with other parameters than its own.
const MOST_CRASHES: u32 = 4;

const CYCLES_PER_MS: u64 = MILLISECOND * CYCLES_PER_US;

/// The watchdog's second.
const HANG_US: u64 = 1_050 * MILLISECOND;

/// The watchdog's quarter of a second while armed.
const HANG_WHILE_DRIVING_US: u64 = 350 * MILLISECOND;

/// A parameter that is set is written within this.
const WRITING_US: u64 = 300 * MILLISECOND;

/// The log has begun this long after arming, and one of its next three pages is written within the other.
const LOGGING_US: u64 = 500 * MILLISECOND;
const LOG_CUT_WITHIN_US: u64 = 5 * SECOND;

/// Shares of the frames.
const CAN_NOISE: f64 = 0.1;
const AIR_LOSS: f64 = 0.5;

/// Faults that can come while another one lasts.
const SUDDEN: [Fault; 3] = [Fault::BrownOut, Fault::RunPin, Fault::ProgramHangs];

impl Rig {
    /// A fault, from its beginning until nothing is left of it.
    pub fn suffer(&mut self, fault: Fault) {
        self.use_radio(fault);
        self.calm_since_us = None;
        self.packs.watch(fault.spares());
        let starts = self.resets;
        self.begin(fault);
        if !fault.restarts() {
            self.last();
        }
        self.end(fault);
        self.use_radio(fault);
        self.packs.change_voltages(fault.hits(), &mut self.bench);
        self.recover(fault);
        if self.resets > starts {
            self.read_back();
        }
    }

    /// Restarts a board that leaves its radio off, where the fault is one of the radio's.
    fn use_radio(&mut self, fault: Fault) {
        if fault.hits_wifi() && self.radio == Radio::Unused {
            self.tally.injected(Fault::RunPin);
            self.suffer(Fault::RunPin);
        }
    }

    /// Time of a fault that lasts; in one of four the board restarts in it.
    fn last(&mut self) {
        let length_us = 200 * MILLISECOND + self.random.below(6_000_000) as u64;
        self.run_for(length_us);
        if self.random.below(4) == 0 {
            let sudden = self.random.pick(&SUDDEN);
            self.packs.watch(&[]);
            self.begin(sudden);
            self.tally.sudden += 1;
            self.run_for(length_us);
        }
    }

    fn begin(&mut self, fault: Fault) {
        match fault {
            Fault::AdcGlitches => self.packs.glitch(&mut self.bench),
            Fault::AdcErrors => self.break_converter(AdcFault::ConversionError),
            Fault::AdcStalls => self.break_converter(AdcFault::Stalled),
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
            Fault::CanNoise => self.packs.can.bus(&mut self.bench).set_noise(CAN_NOISE),
            Fault::CanShorted => self.packs.can.set_wires(&mut self.bench, CanWires::Shorted),
            Fault::CanUnplugged => self.packs.can.unplug(&mut self.bench),
            Fault::CanReset => {
                self.bench.spi1();
                self.packs.can.chip.borrow_mut().reset();
            }
            Fault::CanSilent => self.packs.can_is_silent = true,
            Fault::RadioSilent => {
                let after = self.random.below(50) as u64;
                self.bench.wifi().set_fault(Some(RadioFault::SilentAfter(after)));
            }
            Fault::RadioNoise => self.bench.wifi().set_fault(Some(RadioFault::Noise)),
            Fault::AirLossy => self.wifi.lose(AIR_LOSS),
            Fault::AirHostile => self.wifi.flood(self.random.next_u64(), &mut self.bench),
            Fault::BrownOut => self.lose_power(),
            Fault::RunPin => self.press_run(),
            Fault::FlashCut => self.lose_power_while_writing(),
            Fault::LogCut => self.lose_power_while_logging(),
            Fault::ProgramHangs => self.crash(Board::hang_program),
            Fault::ProgramCrashes => self.crash(Board::run_undefined_instruction),
        }
    }

    fn end(&mut self, fault: Fault) {
        match fault {
            Fault::AdcErrors | Fault::AdcStalls => self.break_converter(AdcFault::None),
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
            Fault::CanNoise => self.packs.can.bus(&mut self.bench).set_noise(0.0),
            Fault::CanShorted => self.packs.can.set_wires(&mut self.bench, CanWires::Sound),
            Fault::CanUnplugged => self.packs.can.plug(&mut self.bench),
            Fault::CanSilent => self.packs.can_is_silent = false,
            Fault::RadioSilent | Fault::RadioNoise => self.bench.wifi().set_fault(None),
            Fault::AirLossy => self.wifi.lose(0.0),
            Fault::AirHostile => self.wifi.calm(),
            // These end when the voltages are changed, or with the start.
            Fault::AdcGlitches | Fault::CanReset => {}
            _ => assert!(fault.restarts(), "{fault:?}"),
        }
    }

    /// From now on.
    fn break_converter(&mut self, fault: AdcFault) {
        self.bench.adc_fault(fault);
        self.converter_works = fault == AdcFault::None;
    }

    fn press_run(&mut self) {
        self.bench.press_run();
        self.look_at_reset(&[ResetCause::RunPin]);
        self.crashes = 0;
    }

    /// The power goes, for between a millisecond and three seconds.
    fn lose_power(&mut self) {
        self.bench.cut_power();
        self.packs.can.chip.borrow_mut().set_powered(false);
        let off_us = match self.random.below(2) {
            0 => MILLISECOND + self.random.below(100_000) as u64,
            _ => self.random.below(3_000_000) as u64,
        };
        self.bench.run_for(off_us);
        self.packs.can.chip.borrow_mut().set_powered(true);
        self.bench.power_cycle();
        self.look_at_reset(&[ResetCause::PowerCycle]);
        self.crashes = 0;
    }

    /// Has the power fail in one of the next operations of the flash chip, and returns its number, from 1 on.
    fn cut_power_soon(&mut self) -> u64 {
        let operation = 1 + self.random.below(3) as u64;
        let cut = self.random.pick(&FlashCut::ALL);
        self.bench.cut_power_at_flash_operation(operation, cut);
        operation
    }

    /// The power goes in one of the next operations of the flash chip.
    fn lose_power_while_writing(&mut self) {
        for _ in 0..self.cut_power_soon() {
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

    /// The power goes in one of the next operations of the flash chip after the log of a drive has begun. The driver leaves the
    /// sticks alone.
    fn lose_power_while_logging(&mut self) {
        let now_us = self.now_us();
        self.orders.arm(now_us);
        self.send(&arm_by_force());
        self.bench.run_for(LOGGING_US);
        self.cut_power_soon();
        let is_off = |board: &mut Board| !board.is_powered();
        assert!(
            self.bench.run_until(LOG_CUT_WITHIN_US, is_off),
            "nothing was logged"
        );
        let cut_off = self.bench.flash_operations().last().map(|last| last.offset);
        let is_of_log = cut_off.is_some_and(|offset| flash_map::LOG.contains(&offset));
        assert!(is_of_log, "{cut_off:?}");
        self.lose_power();
    }

    fn crash(&mut self, derail: impl FnOnce(&mut Board)) {
        if self.crashes == MOST_CRASHES {
            self.press_run();
            // The watchdog is not started yet.
            self.run_for(SECOND);
        }
        self.crashes += 1;
        let hang_us = if Motors::are_on(&self.bench) {
            HANG_WHILE_DRIVING_US
        } else {
            HANG_US
        };
        derail(&mut self.bench);
        self.wait_for_watchdog(hang_us);
    }

    /// Nothing more is sent, so that no stick input follows the driver's last one.
    fn wait_for_watchdog(&mut self, hang_us: u64) {
        let begun_us = self.now_us();
        let resets = self.resets;
        let reset = self
            .bench
            .run_until(2 * SECOND, |board| board.resets().len() > resets);
        assert!(reset, "no reset");
        let after_us = self.now_us() - begun_us;
        assert!(after_us <= hang_us, "reset after {after_us} us");
        self.look_at_reset(&[ResetCause::WatchdogTimer, ResetCause::WatchdogForce]);
    }
}
