//! Age of what the rover's own page sends, by the page's clock.
//!
//! A connection may hold messages back for seconds. The page states its time (SYSTEM_TIME, `time_boot_ms`) each second and
//! before each command, so what follows a statement was sent after it. The difference between the two clocks is taken from
//! the statement that came quickest; a delay that is constant can't be seen.

use heapless::Vec;

use super::Peer;
use crate::time::Instant;

/// Senders that are watched at a time. Others have no known age.
const SENDERS: usize = 2;

/// A difference between the clocks counts for four intervals of eight seconds.
const INTERVALS: u32 = 4;
const INTERVAL_MS: u32 = 8_192;

/// The numbers of intervals begin again with the clock, as its range is a multiple of an interval.
const INTERVAL_NUMBERS: u32 = (u32::MAX / INTERVAL_MS) + 1;

/// A sender's clock.
#[derive(Clone, Copy, Debug)]
struct SenderClock {
    sender: Peer,
    /// The time of the latest statement, by the sender's clock.
    stated_ms: u32,
    /// The number of the interval of the latest statement.
    interval: u32,
    /// The least difference between our clock and the sender's in each interval. It wraps, as the clocks do.
    least_ms: [u32; INTERVALS as usize],
}

impl SenderClock {
    fn state(&mut self, stated_ms: u32, now_ms: u32) {
        self.stated_ms = stated_ms;
        let interval = now_ms / INTERVAL_MS;
        let passed = interval.wrapping_sub(self.interval) % INTERVAL_NUMBERS;
        let passed = passed.min(INTERVALS);
        self.interval = interval;
        let difference_ms = now_ms.wrapping_sub(stated_ms);
        for back in 0..passed {
            *self.least(interval.wrapping_sub(back)) = difference_ms;
        }
        let least_ms = self.least(interval);
        if (difference_ms.wrapping_sub(*least_ms) as i32) < 0 {
            *least_ms = difference_ms;
        }
    }

    fn least(&mut self, interval: u32) -> &mut u32 {
        &mut self.least_ms[(interval % INTERVALS) as usize]
    }

    fn age_ms(&self, now_ms: u32) -> u32 {
        let difference_ms = now_ms.wrapping_sub(self.stated_ms);
        let beyond = |least_ms: u32| (difference_ms.wrapping_sub(least_ms) as i32).max(0) as u32;
        self.least_ms
            .into_iter()
            .fold(0, |age_ms, least_ms| age_ms.max(beyond(least_ms)))
    }
}

/// The clocks of those who send on one link.
#[derive(Debug, Default)]
pub struct SenderClocks {
    clocks: Vec<SenderClock, SENDERS>,
}

impl SenderClocks {
    /// A sender states its time, in milliseconds since some start of its own. 0 is no statement.
    pub fn state(&mut self, sender: Peer, stated_ms: u32, now: Instant) {
        if stated_ms == 0 {
            return;
        }
        let now_ms = milliseconds(now);
        if let Some(clock) = self.clocks.iter_mut().find(|clock| clock.sender == sender) {
            clock.state(stated_ms, now_ms);
        } else {
            // Without room its age stays unknown.
            let _ = self.clocks.push(SenderClock {
                sender,
                stated_ms,
                interval: now_ms / INTERVAL_MS,
                least_ms: [now_ms.wrapping_sub(stated_ms); INTERVALS as usize],
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
        clocks.state(PAGE, 500, at_ms(1_000));
        assert_eq!(clocks.age_ms(PAGE, at_ms(1_000)), Some(0));
        clocks.state(PAGE, 1_500, at_ms(1_980));
        assert_eq!(clocks.age_ms(PAGE, at_ms(1_980)), Some(0), "it came quicker");
        clocks.state(PAGE, 2_500, at_ms(11_000));
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
        clocks.state(PAGE, 1_000, at_ms(1_000));
        for second in 2..=60u32 {
            // From here on each takes four seconds longer.
            clocks.state(PAGE, second * 1_000, at_ms(u64::from(second) * 1_000 + 4_000));
        }
        assert_eq!(clocks.age_ms(PAGE, at_ms(64_000)), Some(0));
    }

    #[test]
    fn delays_are_seen_across_the_wrap_of_our_clock() {
        const WRAP_MS: u64 = 1 << 32;
        let mut clocks = SenderClocks::default();
        clocks.state(PAGE, 1_000, at_ms(WRAP_MS - 1_000));
        clocks.state(PAGE, 2_000, at_ms(WRAP_MS + 3_000));
        assert_eq!(clocks.age_ms(PAGE, at_ms(WRAP_MS + 3_000)), Some(3_000));
    }

    #[test]
    fn zero_is_no_statement() {
        let mut clocks = SenderClocks::default();
        clocks.state(PAGE, 0, at_ms(1_000));
        assert_eq!(clocks.age_ms(PAGE, at_ms(9_000)), None);
    }

    #[test]
    fn each_sender_has_its_own_clock() {
        let other = |system_id| Peer { system_id, ..PAGE };
        let mut clocks = SenderClocks::default();
        clocks.state(PAGE, 1_000, at_ms(1_000));
        clocks.state(other(7), 900_000, at_ms(1_000));
        clocks.state(other(8), 5, at_ms(1_000));
        assert_eq!(clocks.age_ms(PAGE, at_ms(1_000)), Some(0));
        assert_eq!(clocks.age_ms(other(7), at_ms(1_000)), Some(0));
        assert_eq!(clocks.age_ms(other(8), at_ms(1_000)), None);
    }

    proptest! {
        /// Whatever both clocks read, also where they wrap: the age is the delay, less the least one of the last half minute.
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
                clocks.state(PAGE, stated_ms, at_ms(now_ms));
                handled.push((now_ms, delay_ms)).expect("room");
                let least_ms = |window_ms: u64| {
                    let recent = handled.iter().filter(|(at_ms, _)| now_ms - at_ms <= window_ms);
                    recent.map(|(_, delay_ms)| *delay_ms).min().expect("the latest")
                };
                let age_ms = clocks.age_ms(PAGE, at_ms(now_ms)).expect("stated");
                prop_assert!(age_ms <= delay_ms - least_ms(4 * 8_192));
                prop_assert!(age_ms >= delay_ms - least_ms(3 * 8_192));
            }
        }
    }
}
