//! The cache in front of the flash (datasheet 2.6.3.1, 2.6.3.2): 16 KB, two ways, lines of 8 bytes.
//!
//! It counts and nothing more: a miss takes no time here, and what is read is what the flash holds.
//! Which way a miss replaces is not documented; here it is the one that was used longer ago. The
//! processor fetches some words ahead of a branch that it then takes: those are not counted.

/// "16 kB total size / 8 bytes per line / 2 ways per set" (2.6.3.2).
const LINE_BYTES: u32 = 8;
const SETS: u32 = 16 * 1024 / LINE_BYTES / 2;

/// Two lines of flash, the one that was used last first.
type Set = [Option<u32>; 2];

/// Which lines of flash the cache holds, and how often it held another than the one that was read.
#[derive(Clone)]
pub struct XipCache {
    sets: Vec<Set>,
    misses: u64,
}

impl Default for XipCache {
    fn default() -> Self {
        Self {
            sets: vec![[None; 2]; SETS as usize],
            misses: 0,
        }
    }
}

impl XipCache {
    /// A read of flash: within a line, so of a word at most.
    pub fn read(&mut self, address: u32) {
        let line = address / LINE_BYTES;
        let set = &mut self.sets[(line % SETS) as usize];
        let [recent, other] = *set;
        if recent == Some(line) {
            return;
        }
        if other != Some(line) {
            self.misses += 1;
        }
        *set = [Some(line), recent];
    }

    /// Drop every line (2.6.3.2).
    pub fn flush(&mut self) {
        self.sets.fill([None; 2]);
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
}
