//! When which stream is due.

use super::Stream;
use crate::cadence::Cadence;

/// Once a second, so that a ground station notices within a few seconds that the link is gone.
const HEARTBEAT_INTERVAL_US: u64 = 1_000_000;

const MICROSECONDS_PER_SECOND: f32 = 1e6;

/// The streams whose rate is `SR0_EXTRA1`.
const EXTRA1: [Stream; 2] = [Stream::SysStatus, Stream::BatteryStatus(0)];

/// Decides when which message of one link is due. It reads no clock: the time comes in.
#[derive(Clone, Debug)]
pub struct StreamScheduler {
    heartbeat: Cadence,
    /// `None` while the rate is 0.
    extra1: [Option<Cadence>; EXTRA1.len()],
}

impl StreamScheduler {
    /// A scheduler whose HEARTBEAT is due at `now_us`, and everything else off.
    pub fn new(now_us: u64) -> Self {
        Self {
            heartbeat: Cadence::starting_at(now_us, HEARTBEAT_INTERVAL_US),
            extra1: [None; EXTRA1.len()],
        }
    }

    /// Sets the rate of SYS_STATUS and BATTERY_STATUS, in Hz (`SR0_EXTRA1`); 0 turns them off.
    pub fn set_extra1_rate(&mut self, rate_hz: f32, now_us: u64) {
        let interval_us = (rate_hz > 0.0).then(|| (MICROSECONDS_PER_SECOND / rate_hz) as u64);
        for cadence in &mut self.extra1 {
            match (interval_us, cadence.as_mut()) {
                (Some(interval_us), Some(running)) => running.set_interval(interval_us, now_us),
                (Some(interval_us), None) => {
                    *cadence = Some(Cadence::starting_at(now_us, interval_us));
                }
                (None, _) => *cadence = None,
            }
        }
    }

    /// The next stream that is due at `now_us`. Called until it answers `None`; each due time is given once.
    pub fn poll(&mut self, now_us: u64) -> Option<Stream> {
        if self.heartbeat.take(now_us) {
            return Some(Stream::Heartbeat);
        }
        EXTRA1
            .into_iter()
            .zip(&mut self.extra1)
            .find_map(|(stream, cadence)| cadence.as_mut()?.take(now_us).then_some(stream))
    }

    /// When the next stream is due, in µs.
    pub fn next_due_us(&self) -> u64 {
        self.extra1
            .iter()
            .flatten()
            .map(Cadence::due_us)
            .fold(self.heartbeat.due_us(), u64::min)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Runs the scheduler as its task does, waking `late_us` after each due time, and collects what was due when.
    fn run(
        scheduler: &mut StreamScheduler,
        until_us: u64,
        mut late_us: impl FnMut() -> u64,
    ) -> Vec<(u64, Stream)> {
        let mut sent = Vec::new();
        loop {
            let now_us = scheduler.next_due_us() + late_us();
            if now_us >= until_us {
                return sent;
            }
            while let Some(stream) = scheduler.poll(now_us) {
                sent.push((now_us, stream));
            }
        }
    }

    fn count(sent: &[(u64, Stream)], stream: Stream) -> usize {
        sent.iter().filter(|(_, s)| *s == stream).count()
    }

    #[test]
    fn rates_are_exact_over_ten_minutes_of_late_service() {
        for rate_hz in [1.0, 2.0, 10.0, 50.0] {
            let mut scheduler = StreamScheduler::new(0);
            scheduler.set_extra1_rate(rate_hz, 0);
            let mut k = 0;
            let sent = run(&mut scheduler, 600_000_000, || {
                k = (k * 31 + 7) % 1000;
                k
            });
            let expected = (600.0 * rate_hz) as usize;
            assert_eq!(count(&sent, Stream::Heartbeat), 600);
            assert_eq!(count(&sent, Stream::SysStatus), expected);
            assert_eq!(count(&sent, Stream::BatteryStatus(0)), expected);
        }
    }

    #[test]
    fn a_rate_of_zero_sends_heartbeats_only() {
        let mut scheduler = StreamScheduler::new(0);
        scheduler.set_extra1_rate(2.0, 0);
        scheduler.set_extra1_rate(0.0, 0);
        let sent = run(&mut scheduler, 10_000_000, || 0);
        assert_eq!(sent.len(), 10);
        assert_eq!(count(&sent, Stream::Heartbeat), 10);
    }

    #[test]
    fn a_late_tick_is_not_made_up_for_by_a_burst() {
        let mut scheduler = StreamScheduler::new(0);
        scheduler.set_extra1_rate(50.0, 0);
        while scheduler.poll(0).is_some() {}
        let mut after_a_stall = Vec::new();
        while let Some(stream) = scheduler.poll(3_400_001) {
            after_a_stall.push(stream);
        }
        assert_eq!(
            after_a_stall,
            [Stream::Heartbeat, Stream::SysStatus, Stream::BatteryStatus(0)]
        );
        assert_eq!(scheduler.next_due_us(), 3_420_000);
    }

    #[test]
    fn repeating_the_rate_changes_nothing() {
        let mut scheduler = StreamScheduler::new(0);
        scheduler.set_extra1_rate(2.0, 0);
        while scheduler.poll(0).is_some() {}
        let before = scheduler.next_due_us();
        scheduler.set_extra1_rate(2.0, 499_999);
        assert_eq!(scheduler.next_due_us(), before);
    }

    proptest! {
        #[test]
        fn whatever_rates_are_asked_for_the_next_due_time_lies_ahead_of_what_was_served(
            changes in prop::collection::vec((any::<f32>(), 0u64..5_000_000), 1..50),
        ) {
            let mut scheduler = StreamScheduler::new(0);
            let mut now_us = 0;
            for (rate_hz, wait_us) in changes {
                scheduler.set_extra1_rate(rate_hz, now_us);
                for _ in 0..=EXTRA1.len() {
                    scheduler.poll(now_us);
                }
                prop_assert_eq!(scheduler.poll(now_us), None);
                prop_assert!(scheduler.next_due_us() > now_us);
                now_us += wait_us;
            }
        }
    }
}
