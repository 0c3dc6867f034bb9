//! The ways the chip starts again, and what each of them leaves as it was (datasheet 2.12, 2.13).

use super::board::Board;
use super::boot_loader::{WatchdogBoot, take_watchdog_boot};
use super::boot_rom::{SECOND_STAGE, START_SECOND_STAGE, WAIT_FOR_FLASH};
use super::chip_reset::{ChipLevelReset, ChipReset};
use super::clock::micros;
use super::cpu::Cpu;
use super::firmware::{SECOND_STAGE_BYTES, has_second_stage};
use super::memory::{FLASH_BASE, RAM_BASE};
use super::random::Random;
use super::ssi::Ssi;
use super::watchdog::WatchdogReset;

/// Why the chip was reset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ResetCause {
    /// Power was switched off and on: new RAM contents.
    PowerCycle,
    /// The RUN pin was pulled low.
    RunPin,
    /// The watchdog's countdown reached zero.
    WatchdogTimer,
    /// WATCHDOG.CTRL.TRIGGER.
    WatchdogForce,
    /// AIRCR.SYSRESETREQ, which on the RP2040 resets the processor alone (2.4.2.9): peripherals,
    /// watchdog and REASON stay as they are, only TIMER is reset by the boot ROM on its way.
    ProcessorOnly,
}

/// An entry of the reset log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ResetRecord {
    pub time_us: u64,
    pub cause: ResetCause,
}

/// RAM the boot ROM copies the second stage to, as offsets. Its stack lies below, as its vector table says.
const BOOT_ROM_RAM: std::ops::Range<usize> = (SECOND_STAGE - RAM_BASE) as usize..0x4_2000;
/// The program's vector table, behind the second stage.
const VECTOR_TABLE: u32 = FLASH_BASE + 0x100;

impl Board {
    /// Switch the power off. What the flash chip has under way is torn. Time passes on, with
    /// nothing happening on the board, until [`Self::power_cycle`].
    pub fn cut_power(&mut self) {
        self.bus.memory.flash.lose_power(self.bus.now);
        self.bus.flash_has_changed();
        self.bus.soc.ssi.chip.lose_power();
        self.bus.soc.watchdog.forget(self.bus.now);
        self.bus.reset();
        self.powered = false;
    }

    /// Switch the power off, if it was on, and on again: RAM holds other garbage, nothing is
    /// remembered. Flash stays, but for what is being erased or programmed: that is torn.
    pub fn power_cycle(&mut self) {
        self.cut_power();
        self.powered = true;
        let mut random = Random::new(self.next_seed());
        random.fill(&mut self.bus.memory.ram);
        self.reset(ResetCause::PowerCycle);
    }

    /// Switch the power off and on again so soon that RAM keeps its content, but for this many random bits.
    pub fn dip_power(&mut self, lost_bits: usize) {
        self.cut_power();
        self.powered = true;
        let mut random = Random::new(self.next_seed());
        for _ in 0..lost_bits {
            let ram = &mut self.bus.memory.ram;
            let bit = random.below(8 * ram.len());
            ram[bit / 8] ^= 1 << (bit % 8);
        }
        self.reset(ResetCause::PowerCycle);
    }

    /// Press and release a button at the RUN pin.
    pub fn press_run(&mut self) {
        assert!(self.powered, "without power the RUN pin does nothing");
        self.reset(ResetCause::RunPin);
    }

    /// Reset the processor alone, as a debugger does by AIRCR.SYSRESETREQ.
    pub fn reset_processor(&mut self) {
        self.reset(ResetCause::ProcessorOnly);
    }

    /// Resets the chip itself has asked for.
    pub(super) fn reset_if_requested(&mut self) {
        if std::mem::take(&mut self.bus.system_control.reset_requested) {
            self.reset(ResetCause::ProcessorOnly);
        }
        if let Some(request) = self.bus.soc.watchdog.take_request()
            && self.bus.soc.power_state.watchdog_resets_processor()
        {
            self.reset(match request {
                WatchdogReset::Timer => ResetCause::WatchdogTimer,
                WatchdogReset::Force => ResetCause::WatchdogForce,
            });
        }
    }

    pub(super) fn reset(&mut self, cause: ResetCause) {
        self.bus.advance_stream();
        self.resets.push(ResetRecord {
            time_us: micros(self.bus.now),
            cause,
        });
        if cause != ResetCause::ProcessorOnly {
            self.halt_cores(0);
        }
        self.reset_hardware(cause);
        self.boot();
    }

    fn reset_hardware(&mut self, cause: ResetCause) {
        match cause {
            ResetCause::PowerCycle => self.chip_level_reset(ChipLevelReset::PowerOn),
            ResetCause::RunPin => self.chip_level_reset(ChipLevelReset::RunPin),
            ResetCause::WatchdogTimer | ResetCause::WatchdogForce => self.bus.reset(),
            ResetCause::ProcessorOnly => {
                self.bus.reset_processor();
                self.bus.chip.nvic.reset();
                self.bus.chip.ppb = Default::default();
            }
        }
    }

    fn chip_level_reset(&mut self, reset: ChipLevelReset) {
        self.bus.soc.watchdog.forget(self.bus.now);
        self.bus.reset();
        self.bus.soc.chip_reset = ChipReset::after(reset);
    }

    /// What the boot ROM does after a reset.
    pub(super) fn boot(&mut self) {
        let random = Random::new(self.next_seed());
        match take_watchdog_boot(&mut self.bus) {
            Some(WatchdogBoot { stack_pointer, entry }) => self.start_processor(stack_pointer, entry, random),
            None => self.start_firmware(random),
        }
    }

    /// The boot ROM, up to the second stage's first instruction; or, for images without one, as tests of the emulator itself
    /// have, up to the program's.
    fn start_firmware(&mut self, mut random: Random) {
        random.fill(&mut self.bus.memory.ram[BOOT_ROM_RAM]);
        self.reset_timer_as_the_boot_rom_does();
        self.bus.all_code_is_stale = true;
        self.bus.soc.xip_control.flush();
        if has_second_stage(self.bus.memory.flash.bytes()) {
            self.start_second_stage(random);
        } else {
            self.start_program(random);
        }
        // The flash chip is not reset with the RP2040: it completes the running operation, and the boot ROM finds no second
        // stage with a valid checksum until it has (2.8.1.3.1).
        if self.bus.memory.flash.is_busy() {
            let entry = self.cpu.core.reg(15);
            self.cpu.core.set_reg(14, entry);
            self.cpu.core.set_reg(15, WAIT_FOR_FLASH);
        }
    }

    fn start_second_stage(&mut self, random: Random) {
        let second_stage = &self.bus.memory.flash.bytes()[..SECOND_STAGE_BYTES];
        self.bus.memory.ram[BOOT_ROM_RAM].copy_from_slice(second_stage);
        self.bus.soc.set_up_flash(Ssi::set_up_for_commands, self.bus.now);
        self.start_processor(SECOND_STAGE, START_SECOND_STAGE, random);
    }

    /// Starts the program as a second stage does.
    fn start_program(&mut self, random: Random) {
        let word = |address| {
            self.bus
                .memory
                .load(address, super::bus::Width::Word)
                .unwrap_or(0)
        };
        let (stack_pointer, entry) = (word(VECTOR_TABLE), word(VECTOR_TABLE + 4));
        self.bus
            .soc
            .set_up_flash(Ssi::set_up_for_quad_reads, self.bus.now);
        self.start_processor(stack_pointer, entry, random);
        self.bus.chip.ppb.vtor = VECTOR_TABLE;
    }

    fn start_processor(&mut self, stack_pointer: u32, entry: u32, mut random: Random) {
        self.cpu = Cpu::at_reset(stack_pointer, entry, &mut random);
        self.bus.chip.event_flag = false;
        self.bus.chip.wfe_waiting = false;
        self.lines.forget_levels();
        self.log.restart();
        self.bus.attention = true;
    }

    /// The boot ROM resets TIMER and both QSPI blocks and takes them out of reset.
    fn reset_timer_as_the_boot_rom_does(&mut self) {
        const RESETS_SET: u32 = 0x4000_e000;
        const RESETS_CLEAR: u32 = 0x4000_f000;
        const IO_QSPI_PADS_QSPI_TIMER: u32 = 1 << 6 | 1 << 9 | 1 << 21;
        for alias in [RESETS_SET, RESETS_CLEAR] {
            let stored = self
                .bus
                .store(alias, IO_QSPI_PADS_QSPI_TIMER, super::bus::Width::Word);
            debug_assert!(stored.is_ok(), "RESETS is mapped");
        }
    }
}
