//! A NOR flash for code that runs on the host and uses the traits of `embedded-storage-async`, with operation counters,
//! injected failures and power cuts: the chip of unit tests and of the simulator. A crate of its own, since the library's unit
//! tests can depend on none that depends on the library. The chip of an emulated board is part of the emulator.

use std::cell::{RefCell, RefMut};
use std::ops::Range;
use std::rc::Rc;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};
use fastrand::Rng;

/// Content around the region, which must not change.
const MARGIN_BYTE: u8 = 0x5A;

/// A NOR flash of `SECTORS` sectors of `SECTOR` bytes with program pages of `PAGE` bytes, and a sector on either side
/// outside the region. The region begins with the chip's sector number `FIRST`.
///
/// Panics on misuse: a byte programmed twice between erases, or an unaligned address.
#[derive(Clone, Debug)]
pub struct FlashModel<const SECTOR: usize, const PAGE: usize, const SECTORS: usize, const FIRST: usize = 1> {
    bytes: Vec<u8>,
    /// The fault that is to come, and the number of operations until then.
    fault: Option<(u64, Fault)>,
    /// The effect of programming a byte that is not erased.
    pub reprogramming: Reprogramming,
    /// Bits stuck at 0, as the distance from the start of the margin, and mask.
    pub stuck: Option<(usize, u8)>,
    pub reads: u64,
    pub programs: u64,
    pub erases: [u32; SECTORS],
    /// Sectors that refuse every operation.
    worn: [bool; SECTORS],
    /// Sectors of which the last erase was cut short, which may read as blank without retaining data.
    half_erased: [bool; SECTORS],
}

/// The effect of programming a byte that is not erased.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Reprogramming {
    /// It panics.
    Misuse,
    /// It clears more bits, as a chip does.
    ClearsBits,
}

#[derive(Clone, Debug)]
enum Fault {
    /// Power fails in the operation; what it has done by then is random.
    Cut(Rng),
    /// The operation does nothing and returns an error.
    Refuse,
    /// This and every later operation does nothing and returns an error.
    RefuseAll,
    /// The program returns success without writing its first byte.
    Slip,
    /// No power: every operation fails.
    PoweredOff,
}

/// Outcome of an operation.
enum OperationOutcome {
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

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize, const FIRST: usize>
    FlashModel<SECTOR, PAGE, SECTORS, FIRST>
{
    /// The region that may be used.
    pub const REGION: Range<u32> = (SECTOR * FIRST) as u32..(SECTOR * (FIRST + SECTORS)) as u32;

    /// The address of the margin in front of the region.
    const START: usize = SECTOR * (FIRST - 1);

    /// Erased, as from the factory.
    pub fn blank() -> Self {
        let mut bytes = vec![MARGIN_BYTE; SECTOR * (SECTORS + 2)];
        bytes[SECTOR..SECTOR * (SECTORS + 1)].fill(0xFF);
        Self {
            bytes,
            fault: None,
            reprogramming: Reprogramming::Misuse,
            stuck: None,
            reads: 0,
            programs: 0,
            erases: [0; SECTORS],
            worn: [false; SECTORS],
            half_erased: [false; SECTORS],
        }
    }

    /// Programs and erases so far. A program counts once for each page it touches.
    pub fn operations(&self) -> u64 {
        self.programs + self.erases.iter().map(|&count| u64::from(count)).sum::<u64>()
    }

    /// The content of the region, for tests to damage.
    pub fn region(&mut self) -> &mut [u8] {
        &mut self.bytes[SECTOR..SECTOR * (SECTORS + 1)]
    }

    pub fn cut_power_after(&mut self, operations: u64, seed: u64) {
        self.fault = Some((operations, Fault::Cut(Rng::with_seed(seed))));
    }

    pub fn refuse_after(&mut self, operations: u64) {
        self.fault = Some((operations, Fault::Refuse));
    }

    /// From the operation after `operations` more on, until power is restored.
    pub fn refuse_all_after(&mut self, operations: u64) {
        self.fault = Some((operations, Fault::RefuseAll));
    }

    pub fn slip_after(&mut self, operations: u64) {
        self.fault = Some((operations, Fault::Slip));
    }

    pub fn is_powered_off(&self) -> bool {
        matches!(self.fault, Some((_, Fault::PoweredOff)))
    }

    /// Restores power and clears injected failures.
    pub fn power_up(&mut self) {
        self.fault = None;
    }

    /// Whether the last erase of the sector with `address` was cut short.
    pub fn is_half_erased(&self, address: u32) -> bool {
        self.half_erased[address as usize / SECTOR - FIRST]
    }

    pub fn assert_margins_are_untouched(&self) {
        let (before, rest) = self.bytes.split_at(SECTOR);
        let after = &rest[SECTOR * SECTORS..];
        assert!(
            before.iter().chain(after).all(|&byte| byte == MARGIN_BYTE),
            "write outside the region"
        );
    }

    /// From now on this sector of the region refuses every operation.
    pub fn wear_out(&mut self, sector: usize) {
        self.worn[sector] = true;
    }

    fn outcome(&mut self, address: usize) -> Result<OperationOutcome, FlashFailed> {
        if self.worn.get(address / SECTOR - 1) == Some(&true) {
            return Err(FlashFailed);
        }
        let fault = match &mut self.fault {
            None => return Ok(OperationOutcome::Done),
            Some((0, fault)) => fault.clone(),
            Some((operations, _)) => {
                *operations -= 1;
                return Ok(OperationOutcome::Done);
            }
        };
        match fault {
            Fault::PoweredOff | Fault::RefuseAll => Err(FlashFailed),
            Fault::Cut(random) => {
                self.fault = Some((0, Fault::PoweredOff));
                Ok(OperationOutcome::Torn(random))
            }
            Fault::Refuse => {
                self.fault = None;
                Err(FlashFailed)
            }
            Fault::Slip => {
                self.fault = None;
                Ok(OperationOutcome::Slipped)
            }
        }
    }

    fn read_now(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailed> {
        if self.is_powered_off() {
            return Err(FlashFailed);
        }
        self.reads += 1;
        let offset = offset as usize - Self::START;
        assert!(
            offset.is_multiple_of(4) && bytes.len().is_multiple_of(4),
            "unaligned read"
        );
        bytes.copy_from_slice(&self.bytes[offset..offset + bytes.len()]);
        Ok(())
    }

    fn erase_now(&mut self, from: u32, to: u32) -> Result<(), FlashFailed> {
        let (from, to) = (from as usize - Self::START, to as usize - Self::START);
        assert!(
            from.is_multiple_of(SECTOR) && to.is_multiple_of(SECTOR),
            "unaligned erase"
        );
        (from..to)
            .step_by(SECTOR)
            .try_for_each(|address| self.erase_sector(address))
    }

    fn write_now(&mut self, offset: u32, mut bytes: &[u8]) -> Result<(), FlashFailed> {
        let mut address = offset as usize - Self::START;
        while !bytes.is_empty() {
            let (page, rest) = bytes.split_at(bytes.len().min(PAGE - address % PAGE));
            self.program_page(address, page)?;
            address += page.len();
            bytes = rest;
        }
        Ok(())
    }

    fn program_page(&mut self, address: usize, data: &[u8]) -> Result<(), FlashFailed> {
        let outcome = self.outcome(address)?;
        self.programs += 1;
        let cells = &mut self.bytes[address..address + data.len()];
        assert!(
            self.reprogramming == Reprogramming::ClearsBits || cells.iter().all(|&cell| cell == 0xFF),
            "a byte at {address:#x} is programmed twice"
        );
        let mut random = match outcome {
            OperationOutcome::Torn(random) => random,
            OperationOutcome::Done => {
                cells.iter_mut().zip(data).for_each(|(cell, byte)| *cell &= byte);
                return Ok(());
            }
            OperationOutcome::Slipped => {
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
        let outcome = self.outcome(address)?;
        let sector = address / SECTOR - 1;
        self.erases[sector] += 1;
        self.half_erased[sector] = matches!(outcome, OperationOutcome::Torn(_));
        let cells = &mut self.bytes[address..address + SECTOR];
        match outcome {
            OperationOutcome::Done | OperationOutcome::Slipped => cells.fill(0xFF),
            OperationOutcome::Torn(mut random) => match random.u8(..6) {
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
        if self.is_powered_off() {
            Err(FlashFailed)
        } else {
            Ok(())
        }
    }
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize, const FIRST: usize> ErrorType
    for FlashModel<SECTOR, PAGE, SECTORS, FIRST>
{
    type Error = FlashFailed;
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize, const FIRST: usize> ReadNorFlash
    for FlashModel<SECTOR, PAGE, SECTORS, FIRST>
{
    // As embassy-rp's asynchronous flash; writes have any length.
    const READ_SIZE: usize = 4;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailed> {
        self.read_now(offset, bytes)
    }

    fn capacity(&self) -> usize {
        Self::START + self.bytes.len()
    }
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize, const FIRST: usize> NorFlash
    for FlashModel<SECTOR, PAGE, SECTORS, FIRST>
{
    const WRITE_SIZE: usize = 1;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailed> {
        self.erase_now(from, to)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailed> {
        self.write_now(offset, bytes)
    }
}

/// A sector takes 40 records of 12 bytes, so that a few minutes go round both.
pub type SmallFlash = SharedFlash<512, 256, 2>;

/// A [`FlashModel`] that outlasts restarts of what uses it: a clone is the same chip.
#[derive(Clone, Debug)]
pub struct SharedFlash<const SECTOR: usize, const PAGE: usize, const SECTORS: usize, const FIRST: usize = 1>(
    Rc<RefCell<FlashModel<SECTOR, PAGE, SECTORS, FIRST>>>,
);

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize, const FIRST: usize>
    SharedFlash<SECTOR, PAGE, SECTORS, FIRST>
{
    /// The region that may be used.
    pub const REGION: Range<u32> = FlashModel::<SECTOR, PAGE, SECTORS, FIRST>::REGION;
    pub const REGION_BYTES: usize = SECTOR * SECTORS;

    pub fn blank() -> Self {
        Self(Rc::new(RefCell::new(FlashModel::blank())))
    }

    /// A chip with this content in its region.
    pub fn with(bytes: &[u8]) -> Self {
        let flash = Self::blank();
        flash.chip().region().copy_from_slice(bytes);
        flash
    }

    pub fn chip(&self) -> RefMut<'_, FlashModel<SECTOR, PAGE, SECTORS, FIRST>> {
        self.0.borrow_mut()
    }

    /// The content of the region.
    pub fn bytes(&self) -> Vec<u8> {
        self.chip().region().to_vec()
    }

    /// This content in a chip that works.
    pub fn repaired(&self) -> Self {
        Self::with(&self.bytes())
    }

    /// This content in a chip that works, with one bit changed.
    pub fn with_flipped_bit(&self, bit: usize) -> Self {
        let mut bytes = self.bytes();
        bytes[bit / 8] ^= 1 << (bit % 8);
        Self::with(&bytes)
    }
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize, const FIRST: usize> ErrorType
    for SharedFlash<SECTOR, PAGE, SECTORS, FIRST>
{
    type Error = FlashFailed;
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize, const FIRST: usize> ReadNorFlash
    for SharedFlash<SECTOR, PAGE, SECTORS, FIRST>
{
    const READ_SIZE: usize = FlashModel::<SECTOR, PAGE, SECTORS, FIRST>::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashFailed> {
        self.0.borrow_mut().read_now(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.borrow().capacity()
    }
}

impl<const SECTOR: usize, const PAGE: usize, const SECTORS: usize, const FIRST: usize> NorFlash
    for SharedFlash<SECTOR, PAGE, SECTORS, FIRST>
{
    const WRITE_SIZE: usize = FlashModel::<SECTOR, PAGE, SECTORS, FIRST>::WRITE_SIZE;
    const ERASE_SIZE: usize = FlashModel::<SECTOR, PAGE, SECTORS, FIRST>::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashFailed> {
        self.0.borrow_mut().erase_now(from, to)
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashFailed> {
        self.0.borrow_mut().write_now(offset, bytes)
    }
}
