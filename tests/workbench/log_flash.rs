//! The flash of the log as a board in use has it.

use std::convert::Infallible;

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{ErrorType, ReadNorFlash};
use rover_battmon::memory::flash_map;
use rover_battmon::recorder::{Erasure, PAYLOAD_BYTES, Ring, SECTOR_BYTES};

/// The ring of a board, and its flash.
pub struct LogFlash {
    ring: Ring,
    bytes: Vec<u8>,
}

impl LogFlash {
    /// One that was never used, erased ahead of the first drive.
    pub fn erased_ahead() -> Self {
        let mut flash = Self {
            ring: Ring::new(flash_map::LOG),
            bytes: vec![0xff; flash_map::LOG.len()],
        };
        while let Some(erasure) = flash.ring.next_erase(flash.ring.free_sectors()) {
            flash.erase(erasure);
        }
        flash
    }

    /// A full ring: two small files, then large ones, and nine sectors that are erased ahead.
    pub fn full() -> Self {
        let mut flash = Self::erased_ahead();
        for (seed, sectors) in (1..).zip([20, 20, 42, 50, 50, 50, 50]) {
            flash.add(&noise(seed, sectors));
        }
        flash
    }

    fn erase(&mut self, erasure: Erasure) {
        self.place(erasure.address(), SECTOR_BYTES as usize).fill(0xff);
        let mark = erasure.mark();
        self.place(erasure.mark_address(), mark.len())
            .copy_from_slice(&mark);
        self.ring.erased(erasure, Ok(()));
    }

    /// Adds a file.
    pub fn add(&mut self, content: &[u8]) {
        self.ring.open().expect("a sector is erased");
        let mut rest = content;
        while !rest.is_empty() {
            let program = self.ring.next_program(rest).expect("there is room");
            let start = (program.address() - flash_map::LOG.start) as usize;
            self.bytes[start..][..program.bytes().len()].copy_from_slice(program.bytes());
            rest = &rest[self.ring.programmed(Ok(()))..];
        }
        self.ring.close();
    }

    /// What is at [`flash_map::LOG`].
    pub fn bytes(&self) -> &[u8] {
        &self.bytes
    }

    fn place(&mut self, address: u32, length: usize) -> &mut [u8] {
        let start = (address - flash_map::LOG.start) as usize;
        &mut self.bytes[start..start + length]
    }
}

/// The content of a file that takes this many sectors.
pub fn noise(seed: u64, sectors: u32) -> Vec<u8> {
    let mut random = fastrand::Rng::with_seed(seed);
    // A file may end with any byte but that of erased flash.
    let bytes = sectors * PAYLOAD_BYTES - 100;
    (0..bytes).map(|_| random.u8(..255)).collect()
}

/// The files in the flash of a log, oldest first, as the next start finds them: number and content.
pub fn files_in(bytes: &[u8]) -> Vec<(u16, Vec<u8>)> {
    let range = 0..bytes.len() as u32;
    let ring = block_on(Ring::scan(&mut Content(bytes), range));
    let content = |number| {
        let mut content = Vec::new();
        while let Some(piece) = ring.locate(number, content.len() as u32) {
            content.extend_from_slice(&bytes[piece.address as usize..][..piece.bytes as usize]);
        }
        content
    };
    let files = ring.files().iter();
    files.map(|file| (file.number, content(file.number))).collect()
}

/// Flash that is only read.
struct Content<'a>(&'a [u8]);

impl ErrorType for Content<'_> {
    type Error = Infallible;
}

impl ReadNorFlash for Content<'_> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Infallible> {
        bytes.copy_from_slice(&self.0[offset as usize..][..bytes.len()]);
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.0.len()
    }
}
