//! A small NOR flash that outlasts restarts, fails when it is asked to, and whose bits a test can change.

use std::cell::RefCell;
use std::rc::Rc;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use fastrand::Rng;

/// A sector takes 40 records, so that a few minutes go round both.
const SECTOR: usize = 512;
pub const FLASH_BYTES: usize = 2 * SECTOR;

/// A clone is the same chip.
#[derive(Clone)]
pub struct SmallFlash(Rc<RefCell<Chip>>);

struct Chip {
    bytes: Vec<u8>,
    fault: Fault,
    /// A sector that does not change any more.
    worn: Option<usize>,
    erases: u32,
}

/// What happens to writes and erases.
#[derive(Clone)]
pub enum Fault {
    None,
    /// After this many more they change nothing and return an error.
    Refuses {
        after: u64,
    },
    /// Power fails in the middle of the one after this many more.
    PowerCut {
        after: u64,
        random: Rng,
    },
    /// There is no power.
    Dark,
}

#[derive(Debug)]
pub struct FlashFailed;

impl NorFlashError for FlashFailed {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

enum Course {
    Done,
    Torn(Rng),
}

impl SmallFlash {
    pub fn blank() -> Self {
        Self::with(vec![0xFF; FLASH_BYTES])
    }

    pub fn with(bytes: Vec<u8>) -> Self {
        Self(Rc::new(RefCell::new(Chip {
            bytes,
            fault: Fault::None,
            worn: None,
            erases: 0,
        })))
    }

    pub fn bytes(&self) -> Vec<u8> {
        self.0.borrow().bytes.clone()
    }

    pub fn set_fault(&self, fault: Fault) {
        self.0.borrow_mut().fault = fault;
    }

    /// Sectors erased so far, with or without success.
    pub fn erases(&self) -> u32 {
        self.0.borrow().erases
    }

    pub fn wear_out(&self, sector: usize) {
        self.0.borrow_mut().worn = Some(sector);
    }

    pub fn is_dark(&self) -> bool {
        matches!(self.0.borrow().fault, Fault::Dark)
    }

    /// The same content in a chip that works.
    pub fn repaired(&self) -> Self {
        Self::with(self.bytes())
    }

    /// The same content with one bit changed.
    pub fn with_flipped_bit(&self, bit: usize) -> Self {
        let mut bytes = self.bytes();
        bytes[bit / 8] ^= 1 << (bit % 8);
        Self::with(bytes)
    }
}

impl Chip {
    fn course(&mut self, address: u32) -> Result<Course, FlashFailed> {
        if self.worn == Some(address as usize / SECTOR) {
            return Err(FlashFailed);
        }
        match &mut self.fault {
            Fault::None => Ok(Course::Done),
            Fault::Refuses { after: 0 } | Fault::Dark => Err(FlashFailed),
            Fault::PowerCut { after: 0, random } => {
                let random = random.clone();
                self.fault = Fault::Dark;
                Ok(Course::Torn(random))
            }
            Fault::Refuses { after } | Fault::PowerCut { after, .. } => {
                *after -= 1;
                Ok(Course::Done)
            }
        }
    }

    fn result(&self) -> Result<(), FlashFailed> {
        if matches!(self.fault, Fault::Dark) {
            return Err(FlashFailed);
        }
        Ok(())
    }
}

impl ErrorType for SmallFlash {
    type Error = FlashFailed;
}

impl ReadNorFlash for SmallFlash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailed> {
        let chip = self.0.borrow();
        chip.result()?;
        bytes.copy_from_slice(&chip.bytes[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        FLASH_BYTES
    }
}

impl NorFlash for SmallFlash {
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailed> {
        let mut chip = self.0.borrow_mut();
        chip.erases += 1;
        let course = chip.course(from)?;
        let cells = &mut chip.bytes[from as usize..to as usize];
        match course {
            Course::Done => cells.fill(0xFF),
            Course::Torn(mut random) => cells.iter_mut().for_each(|cell| *cell |= random.u8(..)),
        }
        chip.result()
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailed> {
        let mut chip = self.0.borrow_mut();
        let course = chip.course(offset)?;
        let cells = &mut chip.bytes[offset as usize..][..bytes.len()];
        let mut random = match course {
            Course::Done => None,
            Course::Torn(random) => Some(random),
        };
        for (cell, byte) in cells.iter_mut().zip(bytes) {
            *cell &= byte | random.as_mut().map_or(0, |random| random.u8(..));
        }
        chip.result()
    }
}
