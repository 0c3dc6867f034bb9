//! The RAM of the WLAN core, and whether what was written there is its program.

use sha2::{Digest, Sha256};

use super::super::random::Random;

pub const RAM_BYTES: usize = 512 * 1024;
/// What the program has to be.
#[derive(Clone, Copy, Debug)]
pub struct Expected {
    pub bytes: usize,
    pub sha_256: [u8; 32],
}

impl Expected {
    /// `43439A0.bin` in the crate cyw43-firmware 0.1.0.
    pub const PUBLISHED: Self = Self {
        bytes: 231_077,
        sha_256: [
            0x55, 0x55, 0xe0, 0x26, 0x1d, 0xa2, 0x61, 0x0a, 0x50, 0x0d, 0x68, 0xc1, 0x8d, 0x89, 0x5c,
            0xac, //
            0xe0, 0x15, 0x2b, 0xbe, 0xfb, 0xf7, 0x6f, 0x4a, 0xa6, 0x83, 0xeb, 0xce, 0x77, 0xe3, 0xd7, 0xeb,
        ],
    };

    fn is(&self, ram: &[u8]) -> bool {
        Sha256::digest(&ram[..self.bytes])[..] == self.sha_256
    }
}

/// The last word of the RAM: how many words of NVRAM are before it, and their complement in the upper half.
const NVRAM_LENGTH: usize = RAM_BYTES - 4;

#[derive(Clone)]
pub struct Program {
    expected: Expected,
    ram: Vec<u8>,
    /// It was written to since it was looked at.
    is_new: bool,
    /// One in this many writes flips a bit.
    flips_one_in: Option<u32>,
    random: Random,
}

impl Program {
    pub fn new(expected: Expected, random: Random) -> Self {
        Self {
            expected,
            ram: vec![0; RAM_BYTES],
            is_new: false,
            flips_one_in: None,
            random,
        }
    }

    pub fn ram(&self) -> &[u8] {
        &self.ram
    }

    pub fn set_flips(&mut self, one_in: Option<u32>) {
        self.flips_one_in = one_in;
    }

    pub fn store(&mut self, start: usize, bytes: &[u8]) {
        self.is_new = true;
        let end = RAM_BYTES.min(start + bytes.len());
        self.ram[start..end].copy_from_slice(&bytes[..end - start]);
        if let Some(one_in) = self.flips_one_in
            && self.random.below(one_in as usize) == 0
        {
            let index = start + self.random.below(end - start);
            self.ram[index] ^= 1 << self.random.below(8);
        }
    }

    pub fn is_new(&self) -> bool {
        self.is_new
    }

    /// Whether it is the expected program, with a length of the NVRAM that can be right.
    pub fn is_the_chips(&mut self) -> bool {
        self.is_new = false;
        let length = u32::from_le_bytes([0, 1, 2, 3].map(|index| self.ram[NVRAM_LENGTH + index]));
        let words = length & 0xffff;
        let has_nvram = words != 0 && length >> 16 == !words & 0xffff;
        has_nvram && self.expected.is(&self.ram)
    }
}
