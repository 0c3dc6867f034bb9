//! Shares of packs in the log, and of drives in the ring.
//!
//! Half of the ring is kept erased for the next drive, and the oldest files go for that. A drive that was longer stays while
//! a fifth is free; so a file takes at most four fifths, which is nearly an hour, and the log goes on at the next arming.

use crate::recorder::{LogFile, PAYLOAD_BYTES, Ring, SECTOR_BYTES};
use crate::time::Instant;

/// Share of the packs' records in the log, in bytes per sampling tick: 250 bytes per second, which four fifths of the ring
/// hold for an hour.
const BYTES_PER_TICK: i16 = 25;

/// Records that may follow at once after a pause.
const MOST_BYTES: i16 = 100;

/// Debt by records that can't wait for their turn, at most: a second of the share.
const MOST_DEBT_BYTES: i16 = 250;

/// Cells and details of a pack are recorded in one round of this many.
const DETAILED_ROUND: u8 = 5;

/// Records of the pack whose turn it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Detail {
    /// Voltage, current and what was consumed.
    Readings,
    /// Cell voltages and the estimate of the charge, too.
    Everything,
}

/// Divides the log between packs: they take turns, so that more packs are recorded less often each, and a drive's record is
/// no shorter.
#[derive(Debug, Default)]
pub struct Share {
    /// Negative once a record took more than was left.
    credit_bytes: i16,
    /// Position of the next pack in the order of sampling.
    turn: usize,
    round: u8,
    round_began: Option<Instant>,
}

impl Share {
    /// A sampling tick has passed.
    pub fn tick(&mut self) {
        self.credit_bytes = (self.credit_bytes + BYTES_PER_TICK).min(MOST_BYTES);
    }

    /// The next pack to record at `now`, by its position among `packs`, if there is anything left of the share. Each pack has
    /// at most one turn in `round_us`.
    pub fn next(&mut self, packs: usize, round_us: u64, now: Instant) -> Option<(usize, Detail)> {
        if self.credit_bytes <= 0 || packs == 0 {
            return None;
        }
        if self.turn >= packs {
            self.turn = 0;
            self.round = (self.round + 1) % DETAILED_ROUND;
        }
        if self.turn == 0 {
            if self
                .round_began
                .is_some_and(|began| now.us_since(began) < round_us)
            {
                return None;
            }
            self.round_began = Some(now);
        }
        let turn = self.turn;
        self.turn += 1;
        let detail = match self.round {
            0 => Detail::Everything,
            _ => Detail::Readings,
        };
        Some((turn, detail))
    }

    /// Whether so much was used ahead that nothing more is recorded for now.
    pub fn is_overdrawn(&self) -> bool {
        self.credit_bytes <= -MOST_DEBT_BYTES
    }

    /// This many bytes were recorded of a pack.
    pub fn spend(&mut self, bytes: usize) {
        self.credit_bytes = self.credit_bytes.saturating_sub(bytes as i16);
    }
}

/// Number of sectors to erase while disarmed.
pub fn erase_target(ring: &Ring) -> u32 {
    let free = ring.free_sectors();
    let half = ring.sectors() / 2;
    let is_long_drive = ring.files().first().is_some_and(|oldest| sectors(oldest) > half);
    if is_long_drive && free >= least_free(ring) {
        free
    } else {
        free.max(half)
    }
}

/// Whether the open file ends here while armed. What it is to end with still has room.
pub fn is_full(ring: &Ring) -> bool {
    let most = ring.sectors().saturating_sub(least_free(ring) + 1);
    ring.room() < SECTOR_BYTES || ring.open_file().is_some_and(|file| sectors(&file) >= most)
}

/// Whether the open file is long enough for the next drive to have more room in a new one.
pub fn is_long(ring: &Ring) -> bool {
    ring.open_file()
        .is_some_and(|file| sectors(&file) > least_free(ring))
}

fn least_free(ring: &Ring) -> u32 {
    ring.sectors() / 5
}

fn sectors(file: &LogFile) -> u32 {
    file.bytes.div_ceil(PAYLOAD_BYTES)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    const TICK_US: u64 = 100_000;

    /// Turns of each pack in 100 seconds, of `bytes` each.
    fn turns(packs: usize, round_us: u64, bytes: usize) -> Vec<usize> {
        let mut share = Share::default();
        let mut turns = vec![0; packs];
        for tick in 0..1000 {
            share.tick();
            while let Some((pack, _)) = share.next(packs, round_us, at_us(tick * TICK_US)) {
                turns[pack] += 1;
                share.spend(bytes);
            }
        }
        turns
    }

    #[test]
    // Requirement: AP-21, W-2
    fn packs_share_the_bytes_of_the_log_equally() {
        for packs in 1..=9 {
            let turns = turns(packs, 0, 41);
            let bytes_per_s = turns.iter().sum::<usize>() as f32 * 41.0 / 100.0;
            assert!((240.0..=260.0).contains(&bytes_per_s), "{packs}: {bytes_per_s}");
            let (least, most) = (turns.iter().min().unwrap(), turns.iter().max().unwrap());
            assert!(most - least <= 1, "{turns:?}");
        }
    }

    #[test]
    // Requirement: AP-22
    fn no_pack_is_recorded_more_often_than_allowed() {
        assert_eq!(turns(1, 1_000_000, 41), [100]);
        assert_eq!(turns(2, 1_000_000, 41), [100, 100]);
    }

    #[test]
    fn every_fifth_round_has_the_details_of_all_packs() {
        let mut share = Share::default();
        let mut detailed = Vec::new();
        for tick in 0..200 {
            share.tick();
            if let Some((pack, detail)) = share.next(2, 0, at_us(tick * TICK_US)) {
                detailed.push((pack, detail == Detail::Everything));
            }
        }
        assert_eq!(detailed[..2], [(0, true), (1, true)]);
        assert!(detailed[2..10].iter().all(|(_, everything)| !everything));
        assert_eq!(detailed[10..12], [(0, true), (1, true)]);
    }
}
