//! The flash chip's identity, read at the start before anything else uses the chip.
#![expect(
    unsafe_code,
    reason = "the second stage is executed, and a register read, while no program can be read from flash"
)]

use core::ptr;

use cortex_m::interrupt;
use defmt::info;
use embassy_rp::rom_data;

use super::flash::{FlashDriver, SECOND_STAGE_BYTES};
use crate::memory::flash_chip::{JedecId, RegisterWear, UNIQUE_ID_BYTES};
use crate::memory::identity::BoardId;

/// Identity of the flash chip.
#[derive(Clone, Copy, Debug, Default)]
pub struct FlashChip {
    /// The board's id, which is that of the chip.
    pub board_id: Option<BoardId>,
    /// The wear by writing a page to it.
    pub wear: RegisterWear,
}

impl FlashChip {
    /// Reads it, by commands during which no program can be read from it.
    // Its buffers must not add to the stack of `main`.
    #[inline(never)]
    pub fn read(driver: &FlashDriver) -> Self {
        let Ok(mut driver) = driver.try_borrow_mut() else {
            return Self::default();
        };
        let Ok(jedec_id) = driver.blocking_jedec_id().map(JedecId) else {
            return Self::default();
        };
        let mut unique_id = [0; UNIQUE_ID_BYTES];
        let unique_id = unique_id
            .get_mut(..jedec_id.unique_id_bytes())
            .unwrap_or_default();
        let board_id = match driver.blocking_unique_id(unique_id) {
            Ok(()) => jedec_id.board_id(unique_id),
            Err(_) => None,
        };
        let status_2 = status_register_2();
        info!(
            "flash chip {:06X}, status register 2 {:#04x}",
            jedec_id.0, status_2
        );
        Self {
            board_id,
            wear: RegisterWear::of(status_2),
        }
    }
}

/// The second stage is there.
const FLASH_BASE: *const u32 = 0x1000_0000 as *const u32;

/// "Read Status Register-2" (W25Q16JV, 8.2).
const READ_STATUS_2: u32 = 0x35;

/// XIP_SSI (RP2040, 4.10.13).
const CTRLR0: *mut u32 = 0x1800_0000 as *mut u32;
const CTRLR1: *mut u32 = 0x1800_0004 as *mut u32;
const SSIENR: *mut u32 = 0x1800_0008 as *mut u32;
const SR: *mut u32 = 0x1800_0028 as *mut u32;
const DR0: *mut u32 = 0x1800_0060 as *mut u32;
const TMOD_EEPROM_READ: u32 = 3 << 8;
const SR_RX_NOT_EMPTY: u32 = 1 << 3;

/// Reads the register, for which the driver has no function, as that reads an id: the command is sent, and one byte is
/// received behind it.
fn status_register_2() -> u8 {
    // SAFETY: the second core is not started, no DMA reads flash yet, and no interrupt comes.
    interrupt::free(|_| unsafe { status_register_2_from_ram() })
}

/// # Safety
///
/// Nothing else may read flash meanwhile.
#[inline(never)]
#[unsafe(link_section = ".data.ram_func")]
unsafe fn status_register_2_from_ram() -> u8 {
    let connect_internal_flash = rom_data::connect_internal_flash::ptr();
    let flash_exit_xip = rom_data::flash_exit_xip::ptr();
    // SAFETY: every image begins with its second stage. The registers and the ROM's functions are there for this. From
    // here on nothing in flash is called: reads and writes of registers are inlined in an optimised build.
    unsafe {
        let mut second_stage = [0; SECOND_STAGE_BYTES / 4];
        // By the ROM: the compiler would drop a copy of its own, which to it nothing reads.
        rom_data::memcpy44(second_stage.as_mut_ptr(), FLASH_BASE, SECOND_STAGE_BYTES as u32);
        connect_internal_flash();
        flash_exit_xip();
        SSIENR.write_volatile(0);
        CTRLR0.write_volatile(CTRLR0.read_volatile() | TMOD_EEPROM_READ);
        // One frame.
        CTRLR1.write_volatile(0);
        SSIENR.write_volatile(1);
        DR0.write_volatile(READ_STATUS_2);
        while SR.read_volatile() & SR_RX_NOT_EMPTY == 0 {}
        let status = DR0.read_volatile();
        SSIENR.write_volatile(0);
        // Its first instruction, in Thumb state.
        let entry = ptr::from_ref(&second_stage).cast::<u8>().add(1);
        let enter_xip: unsafe extern "C" fn() = core::mem::transmute(entry);
        enter_xip();
        status as u8
    }
}
