//! The commands of the flash chip, how long they take, and the record that is kept of them.

use std::ops::Range;

use super::super::clock::{Cycle, cycles};
use super::cut::FlashCut;

/// The smallest part that can be erased (W25Q16JV, Sector Erase 20h).
pub const SECTOR_SIZE: u32 = 4096;
/// The larger part that the boot ROM erases at once, if requested (64 KB Block Erase D8h).
pub const BLOCK_SIZE: u32 = 64 * 1024;
/// What is programmed at once (Page Program 02h).
pub const PAGE_SIZE: u32 = 256;

/// How long the chip is busy. What the boot ROM takes to send it a command comes on top.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashTiming {
    pub sector_erase_us: u64,
    pub block_erase_us: u64,
    pub page_program_us: u64,
}

impl FlashTiming {
    /// Typical tSE, tBE2 and tPP (W25Q16JV, AC Electrical Characteristics).
    pub const TYPICAL: Self = Self {
        sector_erase_us: 45_000,
        block_erase_us: 150_000,
        page_program_us: 400,
    };
    /// Their maxima.
    pub const MAXIMUM: Self = Self {
        sector_erase_us: 400_000,
        block_erase_us: 2_000_000,
        page_program_us: 3_000,
    };

    pub(super) fn of(self, command: &Command) -> Cycle {
        cycles(match command.kind() {
            FlashOperationKind::SectorErase => self.sector_erase_us,
            FlashOperationKind::BlockErase => self.block_erase_us,
            FlashOperationKind::PageProgram => self.page_program_us,
        })
    }
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FlashOperationKind {
    /// 4 KB.
    SectorErase,
    /// 64 KB at once. A ROM function called without block erase erases sector by sector instead.
    BlockErase,
    /// 256 bytes.
    PageProgram,
}

/// An operation of the flash chip that is over. In worn sectors it changes nothing, and the chip reports no error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashOperation {
    /// When it began.
    pub time_us: u64,
    /// How long it lasted.
    pub duration_us: u64,
    pub kind: FlashOperationKind,
    /// From the beginning of flash.
    pub offset: u32,
    pub length: u32,
    /// The moment at which the power failed, if it did.
    pub cut: Option<FlashCut>,
}

/// A command the chip is carrying out.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Command {
    EraseSector { offset: u32 },
    EraseBlock { offset: u32 },
    ProgramPage { offset: u32, data: Vec<u8> },
}

impl Command {
    pub fn kind(&self) -> FlashOperationKind {
        match self {
            Self::EraseSector { .. } => FlashOperationKind::SectorErase,
            Self::EraseBlock { .. } => FlashOperationKind::BlockErase,
            Self::ProgramPage { .. } => FlashOperationKind::PageProgram,
        }
    }

    /// Bytes that go to the chip for it: write enable, command, address and data, and the two of the status read that finds
    /// it ready.
    pub fn bytes_sent(&self) -> u64 {
        let data = match self {
            Self::EraseSector { .. } | Self::EraseBlock { .. } => 0,
            Self::ProgramPage { data, .. } => data.len() as u64,
        };
        1 + 4 + data + 2
    }

    /// The part of flash it is about.
    pub fn range(&self) -> Range<u32> {
        match *self {
            Self::EraseSector { offset } => offset..offset + SECTOR_SIZE,
            Self::EraseBlock { offset } => offset..offset + BLOCK_SIZE,
            Self::ProgramPage { offset, .. } => offset..offset + PAGE_SIZE,
        }
    }

    /// What that part holds when all has gone well: erasing makes every bit 1, programming only
    /// makes bits 0.
    pub fn result(&self, before: &[u8]) -> Vec<u8> {
        match self {
            Self::EraseSector { .. } | Self::EraseBlock { .. } => vec![0xff; before.len()],
            Self::ProgramPage { data, .. } => before.iter().zip(data).map(|(old, new)| old & new).collect(),
        }
    }
}
