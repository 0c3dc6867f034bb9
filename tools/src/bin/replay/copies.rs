//! Copies among logs: a file that equals another, or is the beginning of it, has no drive of its own.
//!
//! Of each log one block is read and kept as hashes. Logs of which these agree are read twice more: for the hash of each, and
//! for those of its beginnings that are as long as another log. Each is read on its own, however many begin alike.

use std::cmp::Reverse;
use std::collections::{BTreeSet, HashMap, HashSet};
use std::fs::File;
use std::hash::{DefaultHasher, Hasher};
use std::io::{self, BufRead, BufReader, Read};
use std::path::{Path, PathBuf};

use rayon::iter::{IntoParallelIterator, IntoParallelRefIterator, ParallelIterator};
use rover_battmon_tools::recordings::readable_bytes;

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
    let copies = copies(&alike(&beginnings), all);
    let mut index = 0..;
    logs.retain(|_| index.next().is_some_and(|log| !copies.contains(&log)));
    copies.len()
}

/// Sorted beginnings that may be copies, or have some.
fn alike(sorted: &[Beginning]) -> Vec<&Beginning> {
    let mut found = vec![false; sorted.len()];
    let mut alike_until = 0;
    for (place, first) in sorted.iter().enumerate() {
        let others = sorted.iter().skip(place + 1);
        let others = others.take_while(|other| other.hashes.starts_with(&first.hashes));
        let end = place + 1 + others.count();
        if end > place + 1 && end > alike_until {
            found[place..end].fill(true);
            alike_until = end;
        }
    }
    let found = sorted.iter().zip(found).filter(|(_, is_alike)| *is_alike);
    found.map(|(beginning, _)| beginning).collect()
}

/// The copies among logs that begin alike, by index.
fn copies(alike: &[&Beginning], logs: &[PathBuf]) -> HashSet<usize> {
    let lengths: BTreeSet<u64> = alike.iter().map(|beginning| beginning.log_bytes).collect();
    let whole = alike.par_iter().filter_map(|beginning| {
        let lengths = [beginning.log_bytes].into();
        let hash = *beginning_hashes(&logs[beginning.log.0], &lengths).ok()?.first()?;
        Some((hash, beginning.log.0))
    });
    let mut by_hash: HashMap<(u64, u64), Vec<usize>> = HashMap::new();
    for (hash, log) in whole.collect::<Vec<_>>() {
        by_hash.entry(hash).or_default().push(log);
    }
    let begun = alike.par_iter().flat_map_iter(|beginning| {
        let shorter = lengths.range(..beginning.log_bytes).copied().collect();
        let hashes = beginning_hashes(&logs[beginning.log.0], &shorter).unwrap_or_default();
        let found = hashes.into_iter().filter_map(|hash| by_hash.get(&hash));
        found.flatten().copied().collect::<Vec<_>>()
    });
    let mut copies: HashSet<usize> = begun.collect();
    for equal in by_hash.values() {
        let first = equal.iter().min();
        copies.extend(equal.iter().filter(|log| Some(*log) != first));
    }
    copies
}

/// Length and hash of each of these beginnings of a file that it has.
fn beginning_hashes(path: &Path, lengths: &BTreeSet<u64>) -> io::Result<Vec<(u64, u64)>> {
    let mut file = BufReader::with_capacity(BLOCK_BYTES, File::open(path)?);
    // It takes bytes in pieces of any length.
    let mut hasher = DefaultHasher::new();
    let (mut position, mut hashes) = (0, vec![]);
    for length in lengths {
        while position < *length {
            let piece = file.fill_buf()?;
            let wanted = usize::try_from(length - position).unwrap_or(usize::MAX);
            let piece = &piece[..piece.len().min(wanted)];
            if piece.is_empty() {
                return Ok(hashes);
            }
            hasher.write(piece);
            let bytes = piece.len();
            file.consume(bytes);
            position += bytes as u64;
        }
        hashes.push((position, hasher.finish()));
    }
    Ok(hashes)
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
