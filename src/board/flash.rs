//! The parameters' part of the flash chip.

use core::ops::Range;

use embassy_futures::yield_now;
use embassy_rp::Peri;
use embassy_rp::flash::{Blocking, ERASE_SIZE, Error, Flash};
use embassy_rp::peripherals::FLASH;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

/// The Pico's flash chip, a W25Q16JV.
const FLASH_BYTES: usize = 2 * 1024 * 1024;

/// What `memory.x` keeps free at the end of the flash.
const PARAMETER_BYTES: usize = 16 * 1024;

/// Where the parameters are, as offsets from the start of the flash.
pub const PARAMETER_RANGE: Range<u32> = (FLASH_BYTES - PARAMETER_BYTES) as u32..FLASH_BYTES as u32;

/// The flash chip.
///
/// While it erases or programs, the processor can't read its program from it: interrupts are off and everything stands
/// still, typically 45 ms for an erase and 0.4 ms for a page. So one sector is erased at a time, and after each operation
/// everybody else gets a turn, the one who feeds the watchdog too.
pub struct BoardFlash(Flash<'static, FLASH, Blocking, FLASH_BYTES>);

impl BoardFlash {
    /// Takes the chip.
    pub fn new(peripheral: Peri<'static, FLASH>) -> Self {
        Self(Flash::new_blocking(peripheral))
    }
}

impl ErrorType for BoardFlash {
    type Error = Error;
}

impl ReadNorFlash for BoardFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.0.blocking_read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for BoardFlash {
    const WRITE_SIZE: usize = embassy_rp::flash::WRITE_SIZE;
    const ERASE_SIZE: usize = ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        for sector in (from..to).step_by(ERASE_SIZE) {
            self.0.blocking_erase(sector, sector + ERASE_SIZE as u32)?;
            yield_now().await;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.0.blocking_write(offset, bytes)?;
        yield_now().await;
        Ok(())
    }
}
