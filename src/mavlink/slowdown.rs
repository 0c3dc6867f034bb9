//! How much streams are slowed down for a radio that can't keep up.

const MICROSECONDS_PER_MILLISECOND: u64 = 1000;

/// Streams are not slowed down by more than this.
const MOST_MS: u16 = 2000;

/// What is added to every stream's interval, by what a radio says of its transmit buffer (RADIO_STATUS). The steps are
/// ArduPilot's, so that radios tuned for it behave the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Slowdown {
    delay_ms: u16,
}

impl Slowdown {
    /// What is added to an interval, in µs.
    pub fn delay_us(self) -> u64 {
        u64::from(self.delay_ms) * MICROSECONDS_PER_MILLISECOND
    }

    /// `percent` of the radio's transmit buffer is free.
    pub fn radio_buffer_free(&mut self, percent: u8) {
        let delay_ms = self.delay_ms;
        self.delay_ms = match percent {
            0..20 if delay_ms < MOST_MS => delay_ms + 60,
            20..50 if delay_ms < MOST_MS => delay_ms + 20,
            96.. if delay_ms > 200 => delay_ms - 40,
            91.. => delay_ms.saturating_sub(20),
            _ => delay_ms,
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_grows_while_the_buffer_is_full_and_shrinks_while_it_is_empty() {
        let mut slowdown = Slowdown::default();
        for _ in 0..1000 {
            slowdown.radio_buffer_free(0);
        }
        assert!((2000..=2060).contains(&slowdown.delay_ms));
        slowdown.radio_buffer_free(70);
        assert!(slowdown.delay_ms >= 2000, "neither full nor empty");
        for _ in 0..60 {
            slowdown.radio_buffer_free(100);
        }
        assert_eq!(slowdown.delay_us(), 0);
    }
}
