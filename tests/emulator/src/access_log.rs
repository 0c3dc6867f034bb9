//! A record of the accesses a test may check: those to unmapped addresses, and those to unmodelled
//! blocks.

use std::collections::BTreeMap;

use super::clock::{Cycle, micros};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Direction {
    Read,
    Write,
}

/// A bus error as the test sees it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BusErrorRecord {
    pub time_us: u64,
    pub address: u32,
    /// The instruction that was running; for a failed instruction fetch, the address itself.
    pub pc: u32,
    pub direction: Direction,
}

/// Accesses to an unmodelled block.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct UnmodelledAccess {
    pub reads: u64,
    pub writes: u64,
    /// Address and instruction of the first access.
    pub first_address: u32,
    pub first_pc: u32,
}

/// How many bus errors are kept; a program that runs wild makes many.
const BUS_ERROR_RECORDS: usize = 1024;

#[derive(Clone, Default)]
pub struct AccessLog {
    pub bus_errors: Vec<BusErrorRecord>,
    pub unmodelled: BTreeMap<&'static str, UnmodelledAccess>,
    /// The register of which reads are recorded, by its address.
    pub watched: Option<u32>,
    pub reads: Vec<Cycle>,
}

impl AccessLog {
    pub fn note_read(&mut self, now: Cycle, address: u32) {
        if self.watched == Some(address) {
            self.reads.push(now);
        }
    }

    pub fn note_bus_error(&mut self, now: Cycle, pc: u32, address: u32, direction: Direction) {
        if self.bus_errors.len() < BUS_ERROR_RECORDS {
            self.bus_errors.push(BusErrorRecord {
                time_us: micros(now),
                address,
                pc,
                direction,
            });
        }
    }

    pub fn note_unmodelled(&mut self, block: &'static str, pc: u32, address: u32, direction: Direction) {
        let access = self.unmodelled.entry(block).or_insert(UnmodelledAccess {
            reads: 0,
            writes: 0,
            first_address: address,
            first_pc: pc,
        });
        match direction {
            Direction::Read => access.reads += 1,
            Direction::Write => access.writes += 1,
        }
    }
}
