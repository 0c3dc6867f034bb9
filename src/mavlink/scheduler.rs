//! When which message of one link is due.

use super::slowdown::Slowdown;
use super::{DefaultRate, StreamGroup, StreamKind};
use crate::time::{Cadence, Instant};

/// The interval of what is sent once a second.
const SECOND_US: u32 = 1_000_000;

const MICROSECONDS_PER_SECOND: f32 = 1e6;

/// The default interval of messages whose content hardly ever changes.
const RARELY_US: u32 = 10_000_000;

/// 50 Hz, the highest rate a stream is sent at.
const SHORTEST_INTERVAL_US: u32 = 20_000;

/// Half an hour: not much more can be reported by MESSAGE_INTERVAL.
const LONGEST_INTERVAL_US: u32 = 1_800_000_000;

/// Rate of a message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Interval {
    /// By the message's [`DefaultRate`].
    #[default]
    Default,
    /// Never.
    Off,
    /// At this interval, in microseconds.
    Every(u32),
}

/// Decides when which message of one link is due. It reads no clock: the time comes in.
#[derive(Clone, Debug)]
pub struct StreamScheduler {
    /// Of each message, in the order of [`StreamKind::ALL`].
    entries: [Entry; StreamKind::COUNT],
    slowdown: Slowdown,
}

/// When the streams of one message are due. They are due together.
#[derive(Clone, Debug)]
struct Entry {
    kind: StreamKind,
    interval: Interval,
    /// The interval by default, in µs; `None` is never.
    default_us: Option<u32>,
    /// `None` while it is off.
    cadence: Option<Cadence>,
    /// Earliest time at which it may be due again: toggling it must not exceed the highest rate.
    earliest: Instant,
}

impl Entry {
    fn sends(&self, message_id: u32) -> bool {
        self.kind.message_id() == message_id
    }

    /// Whether the message may be sent at this interval.
    fn allows(&self, interval: Interval) -> bool {
        match (self.kind.default_rate(), interval) {
            (_, Interval::Default) => true,
            (DefaultRate::EverySecond, Interval::Off) => false,
            (DefaultRate::EverySecond, Interval::Every(interval_us)) => interval_us == SECOND_US,
            (_, Interval::Off) => true,
            (_, Interval::Every(interval_us)) => {
                (SHORTEST_INTERVAL_US..=LONGEST_INTERVAL_US).contains(&interval_us)
            }
        }
    }

    /// The interval that was asked for, before any slow-down.
    fn asked_interval_us(&self) -> Option<u64> {
        match self.interval {
            Interval::Default => self.default_us.map(u64::from),
            Interval::Off => None,
            Interval::Every(interval_us) => Some(u64::from(interval_us)),
        }
    }

    /// Makes the due times follow an interval.
    fn follow(&mut self, interval_us: Option<u64>, now: Instant) {
        match (interval_us, &mut self.cadence) {
            (Some(interval_us), Some(running)) => running.set_interval(interval_us, now),
            (Some(interval_us), None) => {
                let start = now.max(self.earliest);
                self.cadence = Some(Cadence::starting_at(start, interval_us));
            }
            (None, _) => self.cadence = None,
        }
    }

    /// The message if it is due.
    fn take(&mut self, now: Instant) -> Option<StreamKind> {
        if !self.cadence.as_mut()?.take(now) {
            return None;
        }
        self.earliest = now.after_us(SHORTEST_INTERVAL_US.into());
        Some(self.kind)
    }
}

impl StreamScheduler {
    /// A scheduler whose HEARTBEAT is due at `now`, and everything else off.
    pub fn new(now: Instant) -> Self {
        let entry = |kind: StreamKind| Entry {
            kind,
            interval: match kind.default_rate() {
                DefaultRate::EverySecond | DefaultRate::Extra1(_) => Interval::Default,
                DefaultRate::OnRequest | DefaultRate::OnChange => Interval::Off,
            },
            default_us: match kind.default_rate() {
                DefaultRate::EverySecond => Some(SECOND_US),
                DefaultRate::OnChange => Some(RARELY_US),
                DefaultRate::Extra1(_) | DefaultRate::OnRequest => None,
            },
            cadence: None,
            earliest: now,
        };
        let mut scheduler = Self {
            entries: StreamKind::ALL.map(entry),
            slowdown: Slowdown::default(),
        };
        scheduler.apply(now);
        scheduler
    }

    /// Sets the default rate of both groups of streams, in Hz, as [`Self::set_group_rate`] does.
    pub fn set_extra1_rate(&mut self, rate_hz: f32, now: Instant) {
        for group in [StreamGroup::ExtendedStatus, StreamGroup::Extra3] {
            self.set_group_rate(group, rate_hz, now);
        }
    }

    /// Sets the default rate of the messages of a group of streams, in Hz; 0 turns them off. They are sent every half hour
    /// at least.
    pub fn set_group_rate(&mut self, group: StreamGroup, rate_hz: f32, now: Instant) {
        let interval_us =
            (rate_hz > 0.0).then(|| ((MICROSECONDS_PER_SECOND / rate_hz) as u32).min(LONGEST_INTERVAL_US));
        for entry in &mut self.entries {
            if entry.kind.default_rate() == DefaultRate::Extra1(group) {
                entry.default_us = interval_us;
            }
        }
        self.apply(now);
    }

    /// Sets the interval of a message, for all its instances and names.
    ///
    /// # Errors
    /// The message is not one that is streamed, or the interval not one it can have.
    pub fn set_interval(
        &mut self,
        message_id: u32,
        interval: Interval,
        now: Instant,
    ) -> Result<(), IntervalRefused> {
        let mut result = Err(IntervalRefused::NotStreamed);
        for entry in self.entries.iter_mut().filter(|entry| entry.sends(message_id)) {
            if !entry.allows(interval) {
                return Err(IntervalRefused::OutOfRange);
            }
            entry.interval = interval;
            result = Ok(());
        }
        self.apply(now);
        result
    }

    /// The interval of a message at present, in µs: `None` while it is off.
    ///
    /// # Errors
    /// The message is not one that is streamed.
    pub fn interval_us(&self, message_id: u32) -> Result<Option<u64>, IntervalRefused> {
        let entry = self.entries.iter().find(|entry| entry.sends(message_id));
        entry
            .map(Entry::asked_interval_us)
            .ok_or(IntervalRefused::NotStreamed)
    }

    /// A radio reports how much of its transmit buffer is free, in percent: streams are slowed down when it fills up,
    /// until it is empty again or the radio silent for five seconds.
    pub fn radio_buffer_free(&mut self, percent: u8, now: Instant) {
        self.end_stale_slowdown(now);
        self.slowdown.report(percent, now);
        self.apply(now);
    }

    fn end_stale_slowdown(&mut self, now: Instant) {
        if self.slowdown.is_stale(now) {
            self.slowdown = Slowdown::default();
            self.apply(now);
        }
    }

    /// The next message that is due at `now`. Called until it answers `None`; each due time is given once.
    pub fn poll(&mut self, now: Instant) -> Option<StreamKind> {
        self.end_stale_slowdown(now);
        self.entries.iter_mut().find_map(|entry| entry.take(now))
    }

    /// When the next message is due.
    pub fn next_due(&self) -> Instant {
        let due = self
            .entries
            .iter()
            .filter_map(|entry| entry.cadence.as_ref())
            .map(Cadence::due);
        due.min().unwrap_or(Instant::MAX)
    }

    /// Makes the due times follow what was asked for.
    fn apply(&mut self, now: Instant) {
        for entry in &mut self.entries {
            let delay_us = match entry.kind.default_rate() {
                DefaultRate::EverySecond => 0,
                _ => self.slowdown.delay_us(),
            };
            let interval_us = entry
                .asked_interval_us()
                .map(|asked_us| asked_us.saturating_add(delay_us));
            entry.follow(interval_us, now);
        }
    }
}

/// Why the interval of a message was not set.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum IntervalRefused {
    /// No stream sends this message.
    NotStreamed,
    /// It is shorter than 20 ms or longer than half an hour, or another one than a second for HEARTBEAT.
    OutOfRange,
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;
    use proptest::prelude::*;

    const SYS_STATUS: u32 = 1;
    const BATTERY_STATUS: u32 = 147;

    /// Runs the scheduler as its task does, waking `late_us` after each due time, and collects what was due when.
    fn run(
        scheduler: &mut StreamScheduler,
        until_us: u64,
        mut late_us: impl FnMut() -> u64,
    ) -> Vec<(Instant, StreamKind)> {
        let mut sent = Vec::new();
        loop {
            let now = scheduler.next_due().after_us(late_us());
            if now >= at_us(until_us) {
                return sent;
            }
            while let Some(message) = scheduler.poll(now) {
                sent.push((now, message));
            }
        }
    }

    fn with_rate(rate_hz: f32) -> StreamScheduler {
        let mut scheduler = StreamScheduler::new(Instant::EPOCH);
        scheduler.set_extra1_rate(rate_hz, Instant::EPOCH);
        scheduler
    }

    fn set(scheduler: &mut StreamScheduler, message_id: u32, interval: Interval, us: u64) {
        scheduler.set_interval(message_id, interval, at_us(us)).unwrap();
    }

    fn count(sent: &[(Instant, StreamKind)], message: StreamKind) -> usize {
        sent.iter().filter(|(_, m)| *m == message).count()
    }

    #[test]
    // Requirement: FR-2
    fn rates_are_exact_over_ten_minutes_of_late_service() {
        for rate_hz in [1.0, 2.0, 10.0, 50.0] {
            let mut scheduler = with_rate(rate_hz);
            let mut k = 0;
            let sent = run(&mut scheduler, 600_000_000, || {
                k = (k * 31 + 7) % 1000;
                k
            });
            let expected = (600.0 * rate_hz) as usize;
            assert_eq!(count(&sent, StreamKind::Heartbeat), 600);
            assert_eq!(count(&sent, StreamKind::SysStatus), expected);
            assert_eq!(count(&sent, StreamKind::BatteryStatus), expected);
        }
    }

    #[test]
    fn one_message_can_be_turned_off_sped_up_and_put_back() {
        let mut scheduler = with_rate(2.0);
        set(&mut scheduler, BATTERY_STATUS, Interval::Every(100_000), 0);
        set(&mut scheduler, SYS_STATUS, Interval::Off, 0);
        assert_eq!(scheduler.interval_us(BATTERY_STATUS), Ok(Some(100_000)));
        assert_eq!(scheduler.interval_us(SYS_STATUS), Ok(None));
        // The rate of the others does not matter to them.
        scheduler.set_extra1_rate(50.0, Instant::EPOCH);
        let sent = run(&mut scheduler, 10_000_000, || 0);
        assert_eq!(count(&sent, StreamKind::BatteryStatus), 100);
        assert_eq!(count(&sent, StreamKind::SysStatus), 0);

        scheduler.set_extra1_rate(2.0, at_us(10_000_000));
        set(&mut scheduler, BATTERY_STATUS, Interval::Default, 10_000_000);
        assert_eq!(scheduler.interval_us(BATTERY_STATUS), Ok(Some(500_000)));
        let answer = scheduler.set_interval(30, Interval::Off, Instant::EPOCH);
        assert_eq!(answer, Err(IntervalRefused::NotStreamed));
    }

    #[test]
    fn a_radio_whose_buffer_fills_slows_the_streams_until_it_is_empty_again() {
        let mut scheduler = with_rate(10.0);
        for _ in 0..5 {
            scheduler.radio_buffer_free(10, Instant::EPOCH);
        }
        let slowed = count(&run(&mut scheduler, 4_000_000, || 0), StreamKind::SysStatus);
        assert_eq!(slowed, 10, "every 100 + 5 × 60 ms");
        for _ in 0..20 {
            scheduler.radio_buffer_free(100, at_us(4_000_000));
        }
        let sent = run(&mut scheduler, 14_000_000, || 0);
        assert!(count(&sent, StreamKind::SysStatus) >= 99);
    }

    /// SYS_STATUS sent in a second, with a change every millisecond.
    fn sent_while(mut change: impl FnMut(&mut StreamScheduler, Instant)) -> usize {
        let mut scheduler = StreamScheduler::new(Instant::EPOCH);
        let mut sent = 0;
        for now in (0..1_000_000).step_by(1000).map(at_us) {
            change(&mut scheduler, now);
            while let Some(message) = scheduler.poll(now) {
                sent += usize::from(message == StreamKind::SysStatus);
            }
        }
        sent
    }

    #[test]
    // Requirement: L-17
    fn intervals_that_alternate_do_not_exceed_the_highest_rate() {
        for other in [
            Interval::Off,
            Interval::Default,
            Interval::Every(LONGEST_INTERVAL_US),
        ] {
            let sent = sent_while(|scheduler, now| {
                for interval in [other, Interval::Every(SHORTEST_INTERVAL_US)] {
                    scheduler.set_interval(SYS_STATUS, interval, now).unwrap();
                }
            });
            assert_eq!(sent, 50, "{other:?}");
        }
        for other_hz in [0.0, f32::MIN_POSITIVE] {
            let sent = sent_while(|scheduler, now| {
                for rate_hz in [other_hz, 50.0] {
                    scheduler.set_extra1_rate(rate_hz, now);
                }
            });
            assert_eq!(sent, 50, "{other_hz} Hz");
        }
    }

    #[test]
    fn a_late_tick_is_not_made_up_for_by_a_burst() {
        let mut scheduler = with_rate(50.0);
        while scheduler.poll(Instant::EPOCH).is_some() {}
        let mut after_a_stall = Vec::new();
        while let Some(message) = scheduler.poll(at_us(3_400_001)) {
            after_a_stall.push(message);
        }
        assert_eq!(
            after_a_stall,
            [
                StreamKind::Heartbeat,
                StreamKind::SysStatus,
                StreamKind::BatteryStatus
            ]
        );
        assert_eq!(scheduler.next_due(), at_us(3_420_000));
    }

    #[test]
    fn repeating_the_rate_changes_nothing() {
        let mut scheduler = with_rate(2.0);
        while scheduler.poll(Instant::EPOCH).is_some() {}
        let before = scheduler.next_due();
        scheduler.set_extra1_rate(2.0, at_us(499_999));
        assert_eq!(scheduler.next_due(), before);
    }

    proptest! {
        #[test]
        fn whatever_rates_are_asked_for_the_next_due_time_lies_ahead_of_what_was_served(
            changes in prop::collection::vec((any::<f32>(), any::<u32>(), any::<u8>(), 0u64..5_000_000), 1..50),
        ) {
            let mut scheduler = StreamScheduler::new(Instant::EPOCH);
            let mut now = Instant::EPOCH;
            for (rate_hz, interval_us, percent, wait_us) in changes {
                scheduler.set_extra1_rate(rate_hz, now);
                let _ = scheduler.set_interval(BATTERY_STATUS, Interval::Every(interval_us), now);
                scheduler.radio_buffer_free(percent, now);
                for _ in 0..=StreamKind::COUNT {
                    scheduler.poll(now);
                }
                prop_assert_eq!(scheduler.poll(now), None);
                prop_assert!(scheduler.next_due() > now);
                now = now.after_us(wait_us);
            }
        }
    }
}
