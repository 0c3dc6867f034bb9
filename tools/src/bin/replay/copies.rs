//! Copies among logs: a file that equals another, or is the beginning of it, has no drive of its own.
//!
//! Of each log one block is read and kept as hashes; the rest is read only where these agree.

use std::cmp::Reverse;
use std::collections::HashSet;
use std::fs::File;
use std::hash::{DefaultHasher, Hasher};
use std::io::{self, Read};
use std::path::{Path, PathBuf};

use rayon::iter::{IntoParallelIterator, ParallelIterator};

use crate::recording::readable_bytes;

/// Length of the block that is hashed, as a power of two: logs of one firmware begin with the same formats, and differ behind.
const BLOCK_BITS: u32 = 16;
const BLOCK_BYTES: usize = 1 << BLOCK_BITS;

/// First block of a log. In their order a log stands before all that it may be a copy of, and these follow without a gap.
#[derive(PartialEq, Eq, PartialOrd, Ord)]
struct Beginning {
    /// Of the first 1, 2, 4, 8, … bytes, as far as the log goes.
    hashes: Vec<u64>,
    log_bytes: u64,
    /// Index of the log. Of equal logs the first is no copy.
    log: Reverse<usize>,
}

/// Takes the copies out of `logs`, and returns their number. Logs that can't be read are left as they are.
pub fn take_out(logs: &mut Vec<PathBuf>) -> usize {
    let all = logs.as_slice();
    let beginnings = (0..all.len()).into_par_iter();
    let mut beginnings: Vec<Beginning> = beginnings
        .filter_map(|log| Beginning::read(&all[log], log))
        .collect();
    beginnings.sort();
    let copies = (0..beginnings.len())
        .into_par_iter()
        .filter_map(|place| copy(&beginnings[place..], all));
    let copies: HashSet<usize> = copies.collect();
    let mut index = 0..;
    logs.retain(|_| index.next().is_some_and(|log| !copies.contains(&log)));
    copies.len()
}

/// Index of the first of these logs if it is a copy of one behind it.
fn copy(beginnings: &[Beginning], logs: &[PathBuf]) -> Option<usize> {
    let (first, others) = beginnings.split_first()?;
    let path = |beginning: &Beginning| logs[beginning.log.0].as_path();
    others
        .iter()
        .take_while(|other| other.hashes.starts_with(&first.hashes))
        .any(|other| begins_with(path(other), path(first)).unwrap_or(false))
        .then_some(first.log.0)
}

impl Beginning {
    /// `None` of a log that is empty or can't be read.
    fn read(path: &Path, log: usize) -> Option<Self> {
        let log_bytes = readable_bytes(path).ok().filter(|bytes| *bytes > 0)?;
        let mut block = vec![];
        let file = File::open(path).ok()?;
        file.take(BLOCK_BYTES as u64).read_to_end(&mut block).ok()?;
        Some(Self {
            hashes: hashes(&block),
            log_bytes,
            log: Reverse(log),
        })
    }
}

fn hashes(block: &[u8]) -> Vec<u64> {
    let mut hasher = DefaultHasher::new();
    let mut start = 0;
    let ends = (0..=BLOCK_BITS).map(|bits| 1 << bits);
    ends.map_while(|end| {
        hasher.write(block.get(start..end)?);
        start = end;
        Some(hasher.finish())
    })
    .collect()
}

/// Whether a file begins with all of another.
fn begins_with(long: &Path, short: &Path) -> io::Result<bool> {
    let (mut long, mut short) = (File::open(long)?, File::open(short)?);
    let (mut expected, mut found) = (vec![0; BLOCK_BYTES], vec![0; BLOCK_BYTES]);
    loop {
        let count = short.read(&mut expected)?;
        let found = &mut found[..count];
        long.read_exact(found)?;
        if *found != expected[..count] {
            return Ok(false);
        }
        if count == 0 {
            return Ok(true);
        }
    }
}
