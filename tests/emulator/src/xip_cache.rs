//! The cache in front of the flash (datasheet 2.6.3.1, 2.6.3.2): 16 KB, two ways, lines of 8 bytes.
//!
//! A miss is counted, and the processor waits for it. What is read is what the flash holds. Which way a
//! miss replaces is not documented; here it is the one that was used longer ago. The processor fetches
//! some words ahead of a branch that it then takes: those are left out.

use std::num::NonZeroU32;

use super::clock::Cycle;

/// "16 kB total size / 8 bytes per line / 2 ways per set" (2.6.3.2).
pub const LINE_BYTES: u32 = 8;
const SETS: u32 = 16 * 1024 / LINE_BYTES / 2;

/// A line's address by its number; `None` for none, as no flash is there.
type Line = Option<NonZeroU32>;

/// Which lines of flash the cache holds, how often it held another than the one that was read, and what that costs.
#[derive(Clone)]
pub struct XipCache {
    /// Two lines each, the one that was used last first.
    sets: Vec<[Line; 2]>,
    /// The line that was read last.
    last: Line,
    misses: u64,
    /// Cost of a miss.
    line_cycles: Cycle,
    waiting: Cycle,
}

impl Default for XipCache {
    fn default() -> Self {
        Self {
            sets: vec![[None; 2]; SETS as usize],
            last: None,
            misses: 0,
            line_cycles: 0,
            waiting: 0,
        }
    }
}

impl XipCache {
    /// A read of flash: within a line, so of a word at most.
    #[inline(always)]
    pub fn read(&mut self, address: u32) {
        let line = NonZeroU32::new(address / LINE_BYTES);
        if line != self.last {
            self.last = line;
            self.look_up(line, address / LINE_BYTES % SETS);
        }
    }

    #[inline]
    fn look_up(&mut self, line: Line, set: u32) {
        let set = &mut self.sets[set as usize];
        let [recent, other] = *set;
        if recent == line {
            return;
        }
        *set = [line, recent];
        if other != line {
            self.misses += 1;
            self.waiting += self.line_cycles;
        }
    }

    /// Reading a line from the flash chip takes this long from now on.
    pub fn set_line_cycles(&mut self, cycles: Cycle) {
        self.line_cycles = cycles;
    }

    /// How long the reads since this was taken last make their reader wait.
    #[inline(always)]
    pub fn take_waiting(&mut self) -> Cycle {
        std::mem::take(&mut self.waiting)
    }

    /// Drop every line (2.6.3.2).
    pub fn flush(&mut self) {
        self.sets.fill([None; 2]);
        self.last = None;
    }

    /// Lines that had to be read from the flash chip.
    pub fn misses(&self) -> u64 {
        self.misses
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FLASH: u32 = 0x1000_0000;
    /// Addresses this far apart share a set.
    const WAY_BYTES: u32 = 8 * 1024;

    fn misses(addresses: impl IntoIterator<Item = u32>) -> u64 {
        let mut cache = XipCache::default();
        addresses.into_iter().for_each(|address| cache.read(address));
        cache.misses()
    }

    #[test]
    fn a_line_is_8_bytes() {
        assert_eq!(misses([FLASH, FLASH + 2, FLASH + 6, FLASH]), 1);
        assert_eq!(misses([FLASH + 6, FLASH + 8]), 2);
    }

    #[test]
    fn sixteen_kilobytes_stay_and_more_do_not() {
        let twice = |bytes: u32| (0..2).flat_map(move |_| (FLASH..FLASH + bytes).step_by(4));
        assert_eq!(misses(twice(2 * WAY_BYTES)), 2048);
        assert_eq!(
            misses(twice(2 * WAY_BYTES + 8)),
            2049 + 3,
            "three lines share one set"
        );
        assert_eq!(misses(twice(3 * WAY_BYTES)), 2 * 3072);
    }

    #[test]
    fn the_line_that_was_used_longer_ago_is_replaced() {
        let [a, b, c] = [0, 1, 2].map(|number| FLASH + number * WAY_BYTES);
        assert_eq!(misses([a, b, a, c, a]), 3, "b was replaced");
        assert_eq!(misses([a, b, a, c, b]), 4);
    }

    #[test]
    fn nothing_stays_over_a_flush() {
        let mut cache = XipCache::default();
        cache.read(FLASH);
        cache.flush();
        cache.read(FLASH);
        assert_eq!(cache.misses(), 2);
    }

    #[test]
    fn each_miss_is_waited_for_once() {
        let mut cache = XipCache::default();
        cache.set_line_cycles(56);
        cache.read(FLASH);
        cache.read(FLASH + 8);
        cache.read(FLASH);
        assert_eq!(cache.take_waiting(), 112);
        cache.read(FLASH + 8);
        assert_eq!(cache.take_waiting(), 0);
    }
}
