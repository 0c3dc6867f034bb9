//! How much fuel flows, from a sensor that gives a pulse for each so many millilitres.

use super::Pulses;
use crate::battery::{Consumed, Contents, Counted, Measurement};

/// After so long without a pulse nothing flows.
const LONGEST_PAUSE_US: u64 = 10_000_000;

/// A millilitre a second, in litres an hour.
const LITRES_PER_HOUR: f32 = 3.6;

/// Counts what flows into an engine.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct FlowMeter {
    /// What was known in the tick before.
    seen: Pulses,
    pulses_per_s: f32,
}

impl FlowMeter {
    /// What has flowed since the last call, and how fast.
    pub fn measure(&mut self, pulses: &Pulses, ml_per_pulse: f32, now_us: u64) -> Measurement {
        let before = core::mem::replace(&mut self.seen, *pulses);
        let new = pulses.count.wrapping_sub(before.count) as f32;
        self.pulses_per_s = match (before.last_rise_us, pulses.last_rise_us) {
            (Some(from_us), Some(to_us)) if to_us > from_us => new / seconds(to_us - from_us),
            (_, Some(last_us)) => self.after_pause(now_us.saturating_sub(last_us)),
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

    /// As long as the next pulse has not come, it is no faster than if it came now.
    fn after_pause(&self, pause_us: u64) -> f32 {
        if pause_us >= LONGEST_PAUSE_US {
            return 0.0;
        }
        // Dividing by 0 gives infinity, of which the lower of both is never made.
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

    /// A sensor of 0.5 ml a pulse and its meter.
    struct Bench {
        meter: FlowMeter,
        pulses: Pulses,
        now_us: u64,
        volume_ml: f32,
        flow_l_h: f32,
    }

    impl Bench {
        fn new() -> Self {
            Self {
                meter: FlowMeter::default(),
                pulses: Pulses::NONE,
                now_us: 0,
                volume_ml: 0.0,
                flow_l_h: 0.0,
            }
        }

        /// Seconds with a pulse every so often, the first at once.
        fn run(&mut self, seconds: u64, period_us: Option<u64>) {
            let start_us = self.now_us;
            let mut next_us = period_us.map(|_| start_us);
            for _ in 0..seconds * 10 {
                self.now_us += TICK_US;
                while let Some(due_us) = next_us.filter(|due_us| *due_us < self.now_us) {
                    self.pulses.rise(due_us);
                    next_us = period_us.map(|period_us| due_us + period_us);
                }
                self.tick();
            }
        }

        fn tick(&mut self) {
            let measurement = self.meter.measure(&self.pulses, 0.5, self.now_us);
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
    fn a_steady_flow_is_measured_exactly_whatever_falls_into_a_tick() {
        // 12 ms is 8.3 pulses a tick, 150 ms one in most ticks, 2.5 s one in every 25th.
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
    fn a_flow_that_ends_fades_and_is_nothing_after_ten_seconds() {
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
    fn without_a_pulse_nothing_flows_and_one_alone_tells_no_speed() {
        let mut bench = Bench::new();
        bench.run(5, None);
        assert_eq!((bench.flow_l_h, bench.volume_ml), (0.0, 0.0));
        bench.pulses.rise(bench.now_us);
        bench.tick();
        assert_eq!((bench.flow_l_h, bench.volume_ml), (0.0, 0.5));
    }

    #[test]
    fn the_counter_may_wrap() {
        let mut bench = Bench::new();
        bench.pulses.count = u32::MAX;
        bench.meter.seen = bench.pulses;
        bench.run(1, Some(100_000));
        assert_eq!(bench.volume_ml, 5.0);
    }
}
