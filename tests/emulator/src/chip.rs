//! What is here of the crate `rp2040-emu`: clocks, PLLs, RESETS, IO_BANK0, PADS_BANK0, NVIC and the rest of the PPB; and SIO.
//!
//! The crate's own bus has all of them, but neither a copy of it can be made, nor can it be given to another thread.

use rp2040_emu::bus::clocks::{
    self, ClockTree, ClocksRegs, PLL_RESET, PllRegs, RoscRegs, XoscRegs, pll_write,
};
use rp2040_emu::bus::io_bank0::IoBank0;
use rp2040_emu::bus::pads_bank0::PadsBank0;
use rp2040_emu::bus::ppb::Ppb;
use rp2040_emu::bus::resets::Resets;
use rp2040_emu::core::Nvic;

use super::clock::{CLK_SYS_HZ, Cycle};
use super::memory_map::{Block, IO_BANK0_BASE, PADS_BANK0_BASE, RESETS_BASE};
use super::sio::Sio;

const SYSINFO_BASE: u32 = 0x4000_0000;
const CLOCKS_BASE: u32 = 0x4000_8000;
const XOSC_BASE: u32 = 0x4002_4000;
const PLL_SYS_BASE: u32 = 0x4002_8000;
const PLL_USB_BASE: u32 = 0x4002_c000;
const ROSC_BASE: u32 = 0x4006_0000;

pub struct Chip {
    pub ppb: Ppb,
    pub nvic: Nvic,
    pub sio: Sio,
    pub resets: Resets,
    pub io_bank0: IoBank0,
    pub pads_bank0: PadsBank0,
    pub event_flag: bool,
    pub wfe_waiting: bool,
    clocks: ClocksRegs,
    clock_tree: ClockTree,
    xosc: XoscRegs,
    rosc: RoscRegs,
    pll_sys: Pll,
    pll_usb: Pll,
}

impl Chip {
    /// After reset. Its clocks are those of our time base until they are set.
    pub fn new() -> Self {
        Self {
            ppb: Ppb::new(),
            nvic: Nvic::new(),
            sio: Sio::default(),
            resets: Resets::new(),
            io_bank0: IoBank0::new(),
            pads_bank0: PadsBank0::new(),
            event_flag: false,
            wfe_waiting: false,
            clocks: ClocksRegs::new(),
            clock_tree: ClockTree {
                sys_clk_hz: CLK_SYS_HZ as u32,
                ref_clk_hz: CLK_SYS_HZ as u32,
                ..ClockTree::default()
            },
            xosc: XoscRegs::new(),
            rosc: RoscRegs::new(),
            pll_sys: Pll::default(),
            pll_usb: Pll::default(),
        }
    }

    /// What the program has made of `clk_sys`.
    pub fn sys_clk_hz(&self) -> u32 {
        self.clock_tree.sys_clk_hz
    }

    /// Read a register of one of its blocks.
    pub fn read(&self, block: &Block, address: u32, now: Cycle) -> u32 {
        let offset = address & 0xfff;
        match block.base {
            // CHIP_ID
            SYSINFO_BASE => u32::from(offset == 0),
            CLOCKS_BASE => self.clocks.read32(offset),
            RESETS_BASE => self.resets.read32(offset),
            IO_BANK0_BASE => self.io_bank0.read32(offset),
            PADS_BANK0_BASE => self.pads_bank0.read32(offset),
            XOSC_BASE => self.xosc.read32(offset),
            PLL_SYS_BASE => self.pll_sys.read(offset, now),
            PLL_USB_BASE => self.pll_usb.read(offset, now),
            ROSC_BASE => self.rosc.read32(offset),
            _ => 0,
        }
    }

    /// Write a register of one of its blocks, or an alias of it.
    pub fn write(&mut self, block: &Block, address: u32, value: u32, now: Cycle) {
        let (offset, alias) = (address & 0xfff, address >> 12 & 0b11);
        match block.base {
            CLOCKS_BASE => {
                self.clocks.write32(offset, value, alias);
            }
            RESETS_BASE => self.resets.write32(offset, value, alias),
            IO_BANK0_BASE => self.io_bank0.write32(offset, value, alias),
            PADS_BANK0_BASE => self.pads_bank0.write32(offset, value, alias),
            XOSC_BASE => self.xosc.write32(offset, value, alias),
            PLL_SYS_BASE => self.pll_sys.write(offset, value, alias, now),
            PLL_USB_BASE => self.pll_usb.write(offset, value, alias, now),
            ROSC_BASE => self.rosc.write32(offset, value, alias),
            _ => {}
        }
        if matches!(block.base, CLOCKS_BASE | PLL_SYS_BASE | PLL_USB_BASE) {
            let (sys, usb) = (&self.pll_sys.registers, &self.pll_usb.registers);
            clocks::recompute(&self.clocks, sys, usb, &mut self.clock_tree);
        }
    }
}

/// The crate's parts cannot be cloned, but for those of the processor: their registers can be copied.
impl Clone for Chip {
    fn clone(&self) -> Self {
        let mut copy = Self {
            ppb: self.ppb.clone(),
            nvic: self.nvic,
            sio: self.sio.clone(),
            event_flag: self.event_flag,
            wfe_waiting: self.wfe_waiting,
            clock_tree: self.clock_tree,
            pll_sys: self.pll_sys,
            pll_usb: self.pll_usb,
            ..Self::new()
        };
        (copy.resets.state, copy.resets.wdsel) = (self.resets.state, self.resets.wdsel);
        for offset in (0..0x1000).step_by(4) {
            copy.clocks.write32(offset, self.clocks.read32(offset), 0);
            copy.io_bank0.write32(offset, self.io_bank0.read32(offset), 0);
            copy.pads_bank0.write32(offset, self.pads_bank0.read32(offset), 0);
        }
        copy.xosc = XoscRegs { ..self.xosc };
        copy.rosc = RoscRegs { ..self.rosc };
        copy
    }
}

/// CS: locked.
const PLL_LOCK: u32 = 1 << 31;
/// PWR: powered down, its oscillator powered down.
const PLL_DOWN: u32 = 1 << 0 | 1 << 5;
/// Some time until it locks, which the datasheet does not give.
const PLL_LOCKS_AFTER: Cycle = 2_000;

/// CS, PWR, FBDIV_INT and PRIM of a PLL (datasheet 2.18).
#[derive(Clone, Copy)]
struct Pll {
    registers: PllRegs,
    locks_at: Option<Cycle>,
}

impl Default for Pll {
    fn default() -> Self {
        Self {
            registers: PLL_RESET,
            locks_at: None,
        }
    }
}

impl Pll {
    fn read(&self, offset: u32, now: Cycle) -> u32 {
        let value = clocks::pll_read(&self.registers, offset);
        match (offset, self.locks_at) {
            (0, Some(locks_at)) if locks_at <= now => value | PLL_LOCK,
            (0, _) => value & !PLL_LOCK,
            _ => value,
        }
    }

    /// It locks again when it is powered up or its frequency changes.
    fn write(&mut self, offset: u32, value: u32, alias: u32, now: Cycle) {
        let before = self.frequency();
        pll_write(&mut self.registers, offset, value, alias);
        if self.frequency() != before {
            self.locks_at = self.frequency().map(|_| now + PLL_LOCKS_AFTER);
        }
    }

    /// REFDIV and FBDIV, when it runs.
    fn frequency(&self) -> Option<(u32, u32)> {
        let [cs, pwr, fbdiv, _] = self.registers;
        let fbdiv = fbdiv & 0xfff;
        (pwr & PLL_DOWN == 0 && fbdiv != 0).then_some((cs & 0x3f, fbdiv))
    }
}
