//! The parts of the flash chip that are written while the firmware runs.
#![expect(unsafe_code, reason = "the second stage has a section of its own")]

use core::cell::{RefCell, RefMut};

use embassy_futures::yield_now;
use embassy_rp::Peri;
use embassy_rp::flash::{Blocking, ERASE_SIZE, Error, Flash};
use embassy_rp::peripherals::FLASH;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};

use crate::memory::flash_map;
use crate::recorder::{LogSource, ReadFailed};

/// Size of the second stage and its checksum.
pub(super) const SECOND_STAGE_BYTES: usize = 256;

/// The second stage, assembled from `second_stage.s`: it runs at the start and after each operation, so that the program can
/// be read.
// SAFETY: the linker puts this section, and nothing else, at the beginning of flash.
#[unsafe(link_section = ".boot2")]
#[used]
static SECOND_STAGE: [u8; SECOND_STAGE_BYTES] = *include_bytes!("second_stage.bin");

const CHIP_BYTES: usize = flash_map::CHIP_BYTES as usize;

/// The driver of the flash chip, which everyone who writes to it shares.
pub type FlashDriver = RefCell<Driver>;

type Driver = Flash<'static, FLASH, Blocking, CHIP_BYTES>;

/// The driver of the flash chip.
pub fn flash_driver(peripheral: Peri<'static, FLASH>) -> FlashDriver {
    RefCell::new(Flash::new_blocking(peripheral))
}

/// The flash chip.
///
/// While it erases or programs, the processor can't read its program from it: interrupts are off and everything stands
/// still, typically 45 ms for an erase and 0.6 ms for a page, of which the chip takes 0.4 ms. So one sector is erased at a
/// time, only while disarmed, and after each operation everybody else gets a turn, the one who feeds the watchdog too.
#[derive(Clone, Copy)]
pub struct BoardFlash(&'static FlashDriver);

impl BoardFlash {
    /// The chip behind `driver`.
    pub fn new(driver: &'static FlashDriver) -> Self {
        Self(driver)
    }

    /// The driver, for one operation. It is never held across an await, so it can't be borrowed twice.
    fn driver(&self) -> Result<RefMut<'_, Driver>, Error> {
        self.0.try_borrow_mut().map_err(|_| Error::Other)
    }

    // Everyone who waits for a read would have a copy of it.
    #[inline(never)]
    fn read_at(&self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.driver()?.blocking_read(offset, bytes)
    }

    fn program(&self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        let mut driver = self.driver()?;
        // The driver copies the second stage first, with interrupts off: 14 µs less if the flash cache holds it.
        driver.blocking_read(0, &mut [0; SECOND_STAGE_BYTES])?;
        driver.blocking_write(offset, bytes)
    }
}

impl LogSource for BoardFlash {
    fn read_log(&self, address: u32, bytes: &mut [u8]) -> Result<(), ReadFailed> {
        self.read_at(address, bytes).map_err(|_| ReadFailed)
    }
}

impl ErrorType for BoardFlash {
    type Error = Error;
}

impl ReadNorFlash for BoardFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Error> {
        self.read_at(offset, bytes)
    }

    fn capacity(&self) -> usize {
        CHIP_BYTES
    }
}

impl NorFlash for BoardFlash {
    const WRITE_SIZE: usize = embassy_rp::flash::WRITE_SIZE;
    const ERASE_SIZE: usize = ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        for sector in (from..to).step_by(ERASE_SIZE) {
            self.driver()?
                .blocking_erase(sector, sector + ERASE_SIZE as u32)?;
            yield_now().await;
        }
        Ok(())
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        self.program(offset, bytes)?;
        yield_now().await;
        Ok(())
    }
}
