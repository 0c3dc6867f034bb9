//! Fuel flow sensor with a fixed volume per pulse.

use super::Pulses;
use crate::battery::{Consumed, Contents, Counted, Measurement};
use crate::time::Instant;

/// Time without a pulse after which the flow is zero, in microseconds.
const MAX_PERIOD_US: u64 = 10_000_000;

/// Litres per hour in one millilitre per second.
const LITRES_PER_HOUR: f32 = 3.6;

/// Flow meter: volume and flow rate from pulses.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FlowMeter {
    /// The pulses at the previous call.
    previous: Pulses,
    pulses_per_s: f32,
}

impl FlowMeter {
    /// Volume since the previous call, and the present flow rate.
    pub fn measure(&mut self, pulses: &Pulses, ml_per_pulse: f32, now: Instant) -> Measurement {
        let before = core::mem::replace(&mut self.previous, *pulses);
        let new = pulses.count.wrapping_sub(before.count) as f32;
        self.pulses_per_s = match (before.last_rise, pulses.last_rise) {
            (Some(from), Some(to)) if to > from => new / seconds(to.us_since(from)),
            (_, Some(last)) => self.decayed_rate(now.us_since(last)),
            (_, None) => 0.0,
        };
        Measurement {
            contents: Contents::Fuel,
            current_a: Some(self.pulses_per_s * ml_per_pulse * LITRES_PER_HOUR),
            counted: Some(Counted::Increment(Consumed {
                charge_mah: new * ml_per_pulse,
                energy_wh: 0.0,
            })),
            ..Measurement::default()
        }
    }

    /// The rate decays while no pulse arrives: at most that of a pulse right now.
    fn decayed_rate(&self, pause_us: u64) -> f32 {
        if pause_us >= MAX_PERIOD_US {
            return 0.0;
        }
        // A division by 0 gives infinity, which the minimum ignores.
        self.pulses_per_s.min(1.0 / seconds(pause_us))
    }
}

fn seconds(us: u64) -> f32 {
    us as f32 * 1e-6
}

#[cfg(test)]
mod tests {
    use super::*;

    const TICK_US: u64 = 100_000;

    /// A sensor of 0.5 ml per pulse with its meter.
    struct Bench {
        meter: FlowMeter,
        pulses: Pulses,
        now: Instant,
        volume_ml: f32,
        flow_l_h: f32,
    }

    impl Bench {
        fn new() -> Self {
            Self {
                meter: FlowMeter::default(),
                pulses: Pulses::NONE,
                now: Instant::EPOCH,
                volume_ml: 0.0,
                flow_l_h: 0.0,
            }
        }

        /// Runs for seconds with a pulse every `period_us`, the first at once.
        fn run(&mut self, seconds: u64, period_us: Option<u64>) {
            let start = self.now;
            let mut next = period_us.map(|_| start);
            for _ in 0..seconds * 10 {
                self.now = self.now.after_us(TICK_US);
                while let Some(due) = next.filter(|due| *due < self.now) {
                    self.pulses.rise(due);
                    next = period_us.map(|period_us| due.after_us(period_us));
                }
                self.tick();
            }
        }

        fn tick(&mut self) {
            let measurement = self.meter.measure(&self.pulses, 0.5, self.now);
            assert_eq!(measurement.contents, Contents::Fuel);
            assert_eq!(measurement.voltage_v, None);
            let Some(Counted::Increment(consumed)) = measurement.counted else {
                panic!("{measurement:?}");
            };
            assert_eq!(consumed.energy_wh, 0.0);
            self.volume_ml += consumed.charge_mah;
            self.flow_l_h = measurement.current_a.unwrap();
        }
    }

    #[test]
    fn steady_flow_is_exact_at_any_pulse_rate() {
        // 8.3 pulses per tick, one in most ticks, and one in every 25th.
        for period_us in [12_000, 150_000, 2_500_000] {
            let mut bench = Bench::new();
            bench.run(60, Some(period_us));
            let flow_l_h = 0.5 * 3.6e6 / period_us as f32;
            assert!(
                (bench.flow_l_h - flow_l_h).abs() < 0.001 * flow_l_h,
                "{} instead of {flow_l_h}",
                bench.flow_l_h
            );
            let volume_ml = 0.5 * 60e6 / period_us as f32;
            assert!(
                (bench.volume_ml - volume_ml).abs() <= 0.5,
                "{} instead of {volume_ml}",
                bench.volume_ml
            );
        }
    }

    #[test]
    fn stopped_flow_decays_to_zero_in_ten_seconds() {
        let mut bench = Bench::new();
        bench.run(10, Some(100_000));
        assert!((bench.flow_l_h - 18.0).abs() < 0.1);
        bench.run(4, None);
        assert!((0.4..0.5).contains(&bench.flow_l_h), "{}", bench.flow_l_h);
        bench.run(6, None);
        assert_eq!(bench.flow_l_h, 0.0);
        assert_eq!(bench.volume_ml, 50.0);
    }

    #[test]
    fn flow_rate_needs_two_pulses() {
        let mut bench = Bench::new();
        bench.run(5, None);
        assert_eq!((bench.flow_l_h, bench.volume_ml), (0.0, 0.0));
        bench.pulses.rise(bench.now);
        bench.tick();
        assert_eq!((bench.flow_l_h, bench.volume_ml), (0.0, 0.5));
    }

    #[test]
    fn pulse_counter_may_wrap() {
        let mut bench = Bench::new();
        bench.pulses.count = u32::MAX;
        bench.meter.previous = bench.pulses;
        bench.run(1, Some(100_000));
        assert_eq!(bench.volume_ml, 5.0);
    }
}
