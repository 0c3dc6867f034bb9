//! The processor's own registers at 0xe0000000: NVIC and System Control Block (datasheet 2.4.8).
//!
//! The crate `rp2040-emu` keeps them; what it gets wrong is put right here: the six software
//! interrupts 26 to 31 (2.3.2), ICSR.VECTACTIVE and AIRCR.SYSRESETREQ. The MPU is ours. SysTick and
//! SCR.SEVONPEND are not modelled: accesses to them are recorded.

use super::access_log::Direction;
use super::bus::{SystemBus, Width, lane};
use super::mpu::{self, Mpu};

const NVIC_ISER: u32 = 0xe000_e100;
const NVIC_ICER: u32 = 0xe000_e180;
const NVIC_ISPR: u32 = 0xe000_e200;
const NVIC_ICPR: u32 = 0xe000_e280;
const NVIC_IPR0: u32 = 0xe000_e400;
const NVIC_IPR7: u32 = 0xe000_e41c;
const CPUID: u32 = 0xe000_ed00;
const ICSR: u32 = 0xe000_ed04;
const VTOR: u32 = 0xe000_ed08;
const AIRCR: u32 = 0xe000_ed0c;
const SHPR2: u32 = 0xe000_ed1c;
const SHPR3: u32 = 0xe000_ed20;

/// An interrupt has four priorities (2.4.5.2).
const PRIORITIES: u32 = 0xc0c0_c0c0;

const AIRCR_KEY: u32 = 0x05fa << 16;
const AIRCR_SYSRESETREQ: u32 = 1 << 2;

/// The part of the processor's state that its own registers show or ask for.
#[derive(Clone, Default)]
pub struct SystemControl {
    /// AIRCR.SYSRESETREQ was written.
    pub reset_requested: bool,
    /// IPSR: the exception being handled, 0 in thread mode.
    pub active_exception: u32,
    pub mpu: Mpu,
}

impl SystemBus {
    pub(super) fn load_system_control(&mut self, address: u32, width: Width) -> u32 {
        let register = address & !3;
        let nvic = &mut self.chip.nvic;
        let word = match register {
            ICSR => self.chip.ppb.read32(register) | self.system_control.active_exception,
            mpu::TYPE..=mpu::RASR => self.system_control.mpu.read(register),
            NVIC_ISER | NVIC_ICER => nvic.enabled,
            NVIC_ISPR | NVIC_ICPR => nvic.pending,
            NVIC_IPR0..=NVIC_IPR7 => u32::from_le_bytes(*priorities(&mut nvic.priority, register)),
            CPUID | VTOR | AIRCR | SHPR2 | SHPR3 => self.chip.ppb.read32(register),
            _ => {
                self.note_unmodelled("PPB", register, Direction::Read);
                self.chip.ppb.read32(register)
            }
        };
        lane(word, address, width)
    }

    /// The PPB takes words only; what a narrow store does is not defined (ARMv6-M B3.1.1).
    pub(super) fn store_system_control(&mut self, address: u32, value: u32) {
        self.attention = true;
        let nvic = &mut self.chip.nvic;
        match address {
            NVIC_ISER => nvic.enabled |= value,
            NVIC_ICER => nvic.enabled &= !value,
            NVIC_ISPR => nvic.pending |= value,
            NVIC_ICPR => nvic.pending &= !value,
            AIRCR => self.request_reset(value),
            mpu::TYPE..=mpu::RASR => self.system_control.mpu.write(address, value),
            NVIC_IPR0..=NVIC_IPR7 => {
                *priorities(&mut nvic.priority, address) = (value & PRIORITIES).to_le_bytes();
            }
            ICSR | VTOR | SHPR2 | SHPR3 => self.chip.ppb.write32(address, value),
            _ => self.note_unmodelled("PPB", address, Direction::Write),
        }
    }

    fn request_reset(&mut self, aircr: u32) {
        let has_key = aircr & 0xffff_0000 == AIRCR_KEY;
        self.system_control.reset_requested |= has_key && aircr & AIRCR_SYSRESETREQ != 0;
    }
}

/// The priorities of four interrupts, in one of IPR0 to IPR7.
fn priorities(all: &mut [u8; 32], register: u32) -> &mut [u8; 4] {
    let first = (register - NVIC_IPR0) as usize & !3;
    let four = all[first..].first_chunk_mut();
    four.expect("eight registers hold 32 priorities")
}
