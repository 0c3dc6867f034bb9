//! Age of what the rover's own page sends, by the page's clocks.
//!
//! A connection may hold messages back for seconds. The page states its time (SYSTEM_TIME) each second and before each command
//! and each position of the sticks, so what follows a statement was sent after it. The difference between our clock and the
//! sender's is taken from the statement that came quickest; a delay that is constant can't be seen.
//!
//! Neither clock of a browser is steady: `time_boot_ms` stops while a phone sleeps, and `time_unix_usec` is corrected. Only what
//! both show as late is late.

use heapless::Vec;

use super::Peer;
use crate::time::Instant;

/// Senders that are watched at a time. Others have no known age.
const SENDERS: usize = 2;

/// A difference between the clocks counts for one to two intervals in which the sender is heard, in milliseconds.
const INTERVAL_MS: u32 = 16_384;

/// Longest silence between two statements that counts as time in which the sender is heard, in milliseconds: what comes late
/// after a longer one is measured by the differences from before.
const HEARD_MS: u32 = 2_000;

/// Differences between our clock and one of a sender, in milliseconds. They wrap, as the clocks do.
#[derive(Clone, Copy, Debug)]
struct ClockDifference {
    /// By the latest statement.
    latest_ms: u32,
    /// The least one in the present interval, and in the one before.
    least_ms: [u32; 2],
}

impl ClockDifference {
    fn new(difference_ms: u32) -> Self {
        Self {
            latest_ms: difference_ms,
            least_ms: [difference_ms; 2],
        }
    }

    fn begin_interval(&mut self, difference_ms: u32) {
        let [present_ms, _] = self.least_ms;
        self.least_ms = [difference_ms, present_ms];
    }

    fn state(&mut self, difference_ms: u32) {
        self.latest_ms = difference_ms;
        let [least_ms, _] = &mut self.least_ms;
        if (difference_ms.wrapping_sub(*least_ms) as i32) < 0 {
            *least_ms = difference_ms;
        }
    }

    /// Delay of the latest statement beyond the least one.
    fn delay_ms(&self) -> u32 {
        let beyond = |least_ms: u32| (self.latest_ms.wrapping_sub(least_ms) as i32).max(0) as u32;
        let [present_ms, before_ms] = self.least_ms;
        beyond(present_ms).max(beyond(before_ms))
    }
}

/// The clocks of a sender.
#[derive(Clone, Copy, Debug)]
struct SenderClock {
    sender: Peer,
    /// When it was stated last, by our clock.
    stated_at_ms: u32,
    /// For how long the sender was heard in the present interval.
    heard_ms: u16,
    /// By `time_boot_ms` and by `time_unix_usec`.
    differences: [ClockDifference; 2],
}

impl SenderClock {
    fn state(&mut self, differences_ms: [u32; 2], now_ms: u32) {
        let silence_ms = now_ms.wrapping_sub(self.stated_at_ms).min(HEARD_MS);
        self.stated_at_ms = now_ms;
        let heard_ms = u32::from(self.heard_ms) + silence_ms;
        // Below two intervals.
        self.heard_ms = (heard_ms % INTERVAL_MS) as u16;
        for (difference, difference_ms) in self.differences.iter_mut().zip(differences_ms) {
            if heard_ms >= INTERVAL_MS {
                difference.begin_interval(difference_ms);
            }
            difference.state(difference_ms);
        }
    }

    fn age_ms(&self, now_ms: u32) -> u32 {
        let [by_boot, by_unix] = &self.differences;
        let delay_ms = by_boot.delay_ms().min(by_unix.delay_ms());
        delay_ms.saturating_add(now_ms.wrapping_sub(self.stated_at_ms))
    }
}

/// The clocks of those who send on one link.
#[derive(Debug, Default)]
pub struct SenderClocks {
    clocks: Vec<SenderClock, SENDERS>,
}

impl SenderClocks {
    /// A sender states its time: in milliseconds since some start of its own, and in microseconds since 1970. With 0 of the first
    /// nothing is stated; 0 of the second is no word against the first.
    pub fn state(&mut self, sender: Peer, boot_ms: u32, unix_us: u64, now: Instant) {
        if boot_ms == 0 {
            return;
        }
        let now_ms = milliseconds(now);
        let unix_ms = if unix_us == 0 {
            boot_ms
        } else {
            (unix_us / 1_000) as u32
        };
        let differences_ms = [boot_ms, unix_ms].map(|stated_ms| now_ms.wrapping_sub(stated_ms));
        if let Some(clock) = self.clocks.iter_mut().find(|clock| clock.sender == sender) {
            clock.state(differences_ms, now_ms);
        } else {
            // Without room its age stays unknown.
            let _ = self.clocks.push(SenderClock {
                sender,
                stated_at_ms: now_ms,
                heard_ms: 0,
                differences: differences_ms.map(ClockDifference::new),
            });
        }
    }

    /// Upper bound of the age of a sender's message, in milliseconds; `None` of one that has not stated its time.
    pub fn age_ms(&self, sender: Peer, now: Instant) -> Option<u32> {
        let clock = self.clocks.iter().find(|clock| clock.sender == sender)?;
        Some(clock.age_ms(milliseconds(now)))
    }
}

/// Wraps after 49 days.
fn milliseconds(now: Instant) -> u32 {
    (now.as_micros() / 1_000) as u32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;
    use proptest::prelude::*;

    const PAGE: Peer = Peer {
        system_id: 61,
        component_id: 190,
    };

    fn at_ms(ms: u64) -> Instant {
        at_us(ms * 1_000)
    }

    #[test]
    fn age_is_the_delay_beyond_the_least_one() {
        let mut clocks = SenderClocks::default();
        assert_eq!(clocks.age_ms(PAGE, at_ms(1_000)), None);
        clocks.state(PAGE, 500, 0, at_ms(1_000));
        assert_eq!(clocks.age_ms(PAGE, at_ms(1_000)), Some(0));
        clocks.state(PAGE, 1_500, 0, at_ms(1_980));
        assert_eq!(clocks.age_ms(PAGE, at_ms(1_980)), Some(0), "it came quicker");
        clocks.state(PAGE, 2_500, 0, at_ms(11_000));
        assert_eq!(clocks.age_ms(PAGE, at_ms(11_000)), Some(8_020));
        assert_eq!(
            clocks.age_ms(PAGE, at_ms(11_500)),
            Some(8_520),
            "what comes later may have been sent as early"
        );
    }

    #[test]
    fn a_difference_is_forgotten_after_half_a_minute() {
        let mut clocks = SenderClocks::default();
        clocks.state(PAGE, 1_000, 0, at_ms(1_000));
        for second in 2..=60u32 {
            // From here on each takes four seconds longer.
            clocks.state(PAGE, second * 1_000, 0, at_ms(u64::from(second) * 1_000 + 4_000));
        }
        assert_eq!(clocks.age_ms(PAGE, at_ms(64_000)), Some(0));
    }

    #[test]
    fn delays_are_seen_across_the_wrap_of_our_clock() {
        const WRAP_MS: u64 = 1 << 32;
        let mut clocks = SenderClocks::default();
        clocks.state(PAGE, 1_000, 0, at_ms(WRAP_MS - 1_000));
        clocks.state(PAGE, 2_000, 0, at_ms(WRAP_MS + 3_000));
        assert_eq!(clocks.age_ms(PAGE, at_ms(WRAP_MS + 3_000)), Some(3_000));
    }

    #[test]
    fn zero_is_no_statement() {
        let mut clocks = SenderClocks::default();
        clocks.state(PAGE, 0, 0, at_ms(1_000));
        assert_eq!(clocks.age_ms(PAGE, at_ms(9_000)), None);
    }

    #[test]
    fn each_sender_has_its_own_clock() {
        let other = |system_id| Peer { system_id, ..PAGE };
        let mut clocks = SenderClocks::default();
        clocks.state(PAGE, 1_000, 0, at_ms(1_000));
        clocks.state(other(7), 900_000, 0, at_ms(1_000));
        clocks.state(other(8), 5, 0, at_ms(1_000));
        assert_eq!(clocks.age_ms(PAGE, at_ms(1_000)), Some(0));
        assert_eq!(clocks.age_ms(other(7), at_ms(1_000)), Some(0));
        assert_eq!(clocks.age_ms(other(8), at_ms(1_000)), None);
    }

    proptest! {
        /// Whatever both clocks read, also where they wrap: the age is the delay, less the least one of a quarter of a minute or
        /// more.
        #[test]
        fn age_follows_the_delays(
            start_ms in prop_oneof![any::<u32>(), u32::MAX - 40_000..=u32::MAX],
            sender_ms in any::<u32>(),
            delays_ms in prop::collection::vec(0u32..20_000, 1..40),
        ) {
            let mut clocks = SenderClocks::default();
            let mut handled: Vec<(u64, u32), 64> = Vec::new();
            let mut now_ms = u64::from(start_ms);
            for (second, delay_ms) in (0u32..).zip(delays_ms) {
                let sent_ms = u64::from(start_ms) + u64::from(second) * 1_000;
                // One connection: nothing overtakes.
                now_ms = now_ms.max(sent_ms + u64::from(delay_ms));
                let delay_ms = (now_ms - sent_ms) as u32;
                let stated_ms = sender_ms.wrapping_add(second * 1_000);
                prop_assume!(stated_ms != 0);
                clocks.state(PAGE, stated_ms, 0, at_ms(now_ms));
                handled.push((now_ms, delay_ms)).expect("room");
                let least_ms = |window_ms: u64| {
                    let recent = handled.iter().filter(|(at_ms, _)| now_ms - at_ms <= window_ms);
                    recent.map(|(_, delay_ms)| *delay_ms).min().expect("the latest")
                };
                let age_ms = clocks.age_ms(PAGE, at_ms(now_ms)).expect("stated");
                prop_assert!(age_ms <= delay_ms - least_ms(u64::MAX));
                prop_assert!(age_ms >= delay_ms - least_ms(u64::from(INTERVAL_MS)));
            }
        }
    }
}
