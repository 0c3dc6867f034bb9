//! Reader of RTT up-channel 0, as a debug probe that never falls behind.
//!
//! The control block is the `_SEGGER_RTT` symbol of the ELF. A store to the channel's write offset
//! is noticed by the bus, so every byte is taken at the instruction that published it.

use super::bus::Width;
use super::memory::Memory;

const IDENTIFIER: &[u8; 16] = b"SEGGER RTT\0\0\0\0\0\0";
/// Offsets in the control block: identifier (16 bytes), two counts, then the first up-channel.
const BUFFER: u32 = 28;
const SIZE: u32 = 32;
const WRITE_OFFSET: u32 = 36;
const READ_OFFSET: u32 = 40;
const FLAGS: u32 = 44;

/// "Block if FIFO full", which a host that reads sets.
const BLOCKING: u32 = 2;

#[derive(Clone, Default)]
pub struct RttWatch {
    control_block: Option<u32>,
    /// The firmware has moved the write offset and the bytes were not taken yet.
    pub written: bool,
    /// Nothing reads any more.
    cable_is_pulled: bool,
    /// The firmware has initialised the channel since the last reset.
    channel_known: bool,
}

impl RttWatch {
    pub fn new(control_block: Option<u32>) -> Self {
        Self {
            control_block,
            ..Self::default()
        }
    }

    /// The probe has set up blocking mode, and reads no more.
    pub fn pull_cable(&mut self, memory: &mut Memory) {
        self.cable_is_pulled = true;
        if let Some(control_block) = self.control_block {
            memory.store(control_block + FLAGS, BLOCKING, Width::Word);
        }
    }

    pub fn note_stored(&mut self, address: u32) {
        if let Some(control_block) = self.control_block {
            self.written |= address == control_block + WRITE_OFFSET;
        }
    }

    /// The address of a store that has to be noted; none that a store can have when there is none.
    pub fn watched(&self) -> u32 {
        self.control_block
            .map_or(1, |control_block| control_block + WRITE_OFFSET)
    }

    /// After a reset the offsets are those of the life before, until the start-up code has
    /// initialised them.
    pub fn forget_channel(&mut self) {
        self.channel_known = false;
        self.written = false;
    }

    /// Take the bytes between the read and the write offset, and move the read offset.
    pub fn take(&mut self, memory: &mut Memory) -> Vec<u8> {
        self.written = false;
        let Some(control_block) = self.control_block.filter(|_| !self.cable_is_pulled) else {
            return Vec::new();
        };
        let word = |offset| memory.load(control_block + offset, Width::Word).unwrap_or(0);
        let (buffer, size) = (word(BUFFER), word(SIZE));
        let (write, read) = (word(WRITE_OFFSET), word(READ_OFFSET));
        // The start-up code writes zero here; the first message makes it something else.
        self.channel_known |= write != 0 && is_initialised(memory, control_block);
        if !self.channel_known || write >= size || read >= size {
            return Vec::new();
        }
        let taken =
            ring(read, write, size).map(|at| memory.load(buffer + at, Width::Byte).unwrap_or(0) as u8);
        let taken = taken.collect();
        memory.store(control_block + READ_OFFSET, write, Width::Word);
        taken
    }
}

fn is_initialised(memory: &Memory, control_block: u32) -> bool {
    (0..IDENTIFIER.len()).all(|index| {
        memory.load(control_block + index as u32, Width::Byte) == Some(u32::from(IDENTIFIER[index]))
    })
}

/// The positions from `read` up to `write` in a ring buffer.
fn ring(read: u32, write: u32, size: u32) -> impl Iterator<Item = u32> {
    let length = (write + size - read) % size;
    (0..length).map(move |index| (read + index) % size)
}

#[cfg(test)]
mod tests {
    use super::super::flash::FlashChip;
    use super::super::memory::{FLASH_SIZE, RAM_BASE, ROM_SIZE};
    use super::*;

    const BLOCK: u32 = RAM_BASE + 0x100;
    const RING: u32 = RAM_BASE + 0x200;

    fn initialised() -> (Memory, RttWatch) {
        let mut memory = Memory::new(vec![0; ROM_SIZE], FlashChip::new(vec![0; FLASH_SIZE], 1));
        for (index, &byte) in IDENTIFIER.iter().enumerate() {
            memory.store(BLOCK + index as u32, u32::from(byte), Width::Byte);
        }
        memory.store(BLOCK + BUFFER, RING, Width::Word);
        memory.store(BLOCK + SIZE, 8, Width::Word);
        (0..8).for_each(|index| {
            memory.store(RING + index, index, Width::Byte);
        });
        (memory, RttWatch::new(Some(BLOCK)))
    }

    fn publish(memory: &mut Memory, watch: &mut RttWatch, write: u32) -> Vec<u8> {
        memory.store(BLOCK + WRITE_OFFSET, write, Width::Word);
        watch.note_stored(BLOCK + WRITE_OFFSET);
        assert!(watch.written);
        watch.take(memory)
    }

    #[test]
    fn bytes_are_taken_once_and_across_the_end_of_the_ring() {
        let (mut memory, mut watch) = initialised();
        assert_eq!(publish(&mut memory, &mut watch, 6), [0, 1, 2, 3, 4, 5]);
        assert_eq!(publish(&mut memory, &mut watch, 2), [6, 7, 0, 1]);
        assert_eq!(memory.load(BLOCK + READ_OFFSET, Width::Word), Some(2));
        assert!(watch.take(&mut memory).is_empty());
    }

    #[test]
    fn what_a_life_before_the_reset_left_is_not_taken_for_a_message() {
        let (mut memory, mut watch) = initialised();
        publish(&mut memory, &mut watch, 6);
        watch.forget_channel();
        assert!(
            publish(&mut memory, &mut watch, 0).is_empty(),
            "start-up code, read offset still 6"
        );
        memory.store(BLOCK + READ_OFFSET, 0, Width::Word);
        assert_eq!(publish(&mut memory, &mut watch, 2), [0, 1]);
    }
}
