//! A NOR flash for tests: counts its operations, fails where it is told to, and loses power half way through one.

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use fastrand::Rng;

/// What stands around the region: no operation may touch it.
const MARGIN_BYTE: u8 = 0x5A;

/// A NOR flash of `SECTORS` sectors of `SECTOR` bytes with program pages of `PAGE` bytes, and a sector on either side
/// that belongs to somebody else.
///
/// It panics at what a real one would take silently or spoil: a byte that is programmed twice between two erases, an
/// address that is not aligned.
#[derive(Clone)]
pub struct FlashModel<const SECTOR: usize, const PAGE: usize, const SECTORS: usize> {
    bytes: Vec<u8>,
    trouble: Trouble,
    /// Bits an erase does not raise any more, as address and mask.
    pub stuck: Option<(usize, u8)>,
    pub reads: u64,
    pub programs: u64,
    pub erases: [u32; SECTORS],
}

#[derive(Clone)]
enum Trouble {
    None,
    /// Power fails in the operation after `operations` more; what it has done by then is random.
    Cut {
        operations: u64,
        random: Rng,
    },
    /// The operation after `operations` more does nothing and returns an error.
    Refuse {
        operations: u64,
    },
    /// The program after `operations` more claims to be done, and has not written its first byte.
    Slip {
        operations: u64,
    },
    /// No power: nothing works.
    Dark,
}

/// How far an operation goes.
enum Course {
    Done,
    Slipped,
    Torn(Rng),
}

#[derive(Debug)]
pub struct FlashFailed;

impl NorFlashError for FlashFailed {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize> FlashModel<SECTOR, PAGE, SECTORS> {
    /// The region the storage may use.
    pub const REGION: core::ops::Range<u32> = SECTOR as u32..(SECTOR * (SECTORS + 1)) as u32;

    /// As from the factory.
    pub fn blank() -> Self {
        let mut bytes = vec![MARGIN_BYTE; SECTOR * (SECTORS + 2)];
        bytes[SECTOR..SECTOR * (SECTORS + 1)].fill(0xFF);
        Self {
            bytes,
            trouble: Trouble::None,
            stuck: None,
            reads: 0,
            programs: 0,
            erases: [0; SECTORS],
        }
    }

    /// Programs and erases so far. A program counts once for each page it touches.
    pub fn operations(&self) -> u64 {
        self.programs + self.erases.iter().map(|&count| u64::from(count)).sum::<u64>()
    }

    /// The content of the region, for a test to spoil.
    pub fn region(&mut self) -> &mut [u8] {
        &mut self.bytes[SECTOR..SECTOR * (SECTORS + 1)]
    }

    pub fn cut_power_after(&mut self, operations: u64, seed: u64) {
        self.trouble = Trouble::Cut {
            operations,
            random: Rng::with_seed(seed),
        };
    }

    pub fn refuse_after(&mut self, operations: u64) {
        self.trouble = Trouble::Refuse { operations };
    }

    pub fn slip_after(&mut self, operations: u64) {
        self.trouble = Trouble::Slip { operations };
    }

    pub fn is_dark(&self) -> bool {
        matches!(self.trouble, Trouble::Dark)
    }

    /// Power comes back, and no further trouble is planned.
    pub fn power_up(&mut self) {
        self.trouble = Trouble::None;
    }

    pub fn assert_margins_are_untouched(&self) {
        let (before, rest) = self.bytes.split_at(SECTOR);
        let after = &rest[SECTOR * SECTORS..];
        assert!(
            before.iter().chain(after).all(|&byte| byte == MARGIN_BYTE),
            "wrote outside its region"
        );
    }

    fn course(&mut self) -> Result<Course, FlashFailed> {
        match &mut self.trouble {
            Trouble::None => Ok(Course::Done),
            Trouble::Dark => Err(FlashFailed),
            Trouble::Cut {
                operations: 0,
                random,
            } => {
                let random = random.clone();
                self.trouble = Trouble::Dark;
                Ok(Course::Torn(random))
            }
            Trouble::Refuse { operations: 0 } => {
                self.trouble = Trouble::None;
                Err(FlashFailed)
            }
            Trouble::Slip { operations: 0 } => {
                self.trouble = Trouble::None;
                Ok(Course::Slipped)
            }
            Trouble::Cut { operations, .. }
            | Trouble::Refuse { operations }
            | Trouble::Slip { operations } => {
                *operations -= 1;
                Ok(Course::Done)
            }
        }
    }

    fn program_page(&mut self, address: usize, data: &[u8]) -> Result<(), FlashFailed> {
        let course = self.course()?;
        self.programs += 1;
        let cells = &mut self.bytes[address..address + data.len()];
        assert!(
            cells.iter().all(|&cell| cell == 0xFF),
            "a byte at {address:#x} is programmed twice"
        );
        let mut random = match course {
            Course::Torn(random) => random,
            Course::Done => {
                cells.copy_from_slice(data);
                return Ok(());
            }
            Course::Slipped => {
                cells[1..].copy_from_slice(&data[1..]);
                return Ok(());
            }
        };
        let reached = random.usize(..=data.len());
        // Most parts program the bits of a page together, others one byte after the other.
        let bit_by_bit = random.bool();
        for (index, (cell, &byte)) in cells.iter_mut().zip(data).enumerate() {
            *cell = match (bit_by_bit, index < reached) {
                (true, _) => byte | random.u8(..),
                (false, true) => byte,
                (false, false) => 0xFF,
            };
        }
        Err(FlashFailed)
    }

    fn erase_sector(&mut self, address: usize) -> Result<(), FlashFailed> {
        let course = self.course()?;
        self.erases[address / SECTOR - 1] += 1;
        let cells = &mut self.bytes[address..address + SECTOR];
        match course {
            Course::Done | Course::Slipped => cells.fill(0xFF),
            Course::Torn(mut random) => match random.u8(..6) {
                0 => {}
                // Parts program every bit before they erase.
                1 => cells.fill(0),
                2 => cells.fill(0xFF),
                3 => {
                    let reached = random.usize(..SECTOR);
                    cells[..reached].fill(0xFF);
                }
                4 => cells.iter_mut().for_each(|cell| *cell |= random.u8(..)),
                _ => cells.iter_mut().for_each(|cell| *cell = random.u8(..)),
            },
        }
        if let Some((stuck, mask)) = self.stuck {
            self.bytes[stuck] &= !mask;
        }
        if self.is_dark() { Err(FlashFailed) } else { Ok(()) }
    }
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize> ErrorType
    for FlashModel<SECTOR, PAGE, SECTORS>
{
    type Error = FlashFailed;
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize> ReadNorFlash
    for FlashModel<SECTOR, PAGE, SECTORS>
{
    // What embassy-rp's asynchronous flash wants; its writes take any length.
    const READ_SIZE: usize = 4;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailed> {
        if self.is_dark() {
            return Err(FlashFailed);
        }
        self.reads += 1;
        let offset = offset as usize;
        assert!(
            offset.is_multiple_of(4) && bytes.len().is_multiple_of(4),
            "a read that is not aligned"
        );
        bytes.copy_from_slice(&self.bytes[offset..offset + bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize> NorFlash
    for FlashModel<SECTOR, PAGE, SECTORS>
{
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailed> {
        let (from, to) = (from as usize, to as usize);
        assert!(
            from.is_multiple_of(SECTOR) && to.is_multiple_of(SECTOR),
            "an erase that is not aligned"
        );
        (from..to)
            .step_by(SECTOR)
            .try_for_each(|address| self.erase_sector(address))
    }

    async fn write(&mut self, offset: u32, mut bytes: &[u8]) -> Result<(), FlashFailed> {
        let mut address = offset as usize;
        while !bytes.is_empty() {
            let (page, rest) = bytes.split_at(bytes.len().min(PAGE - address % PAGE));
            self.program_page(address, page)?;
            address += page.len();
            bytes = rest;
        }
        Ok(())
    }
}
