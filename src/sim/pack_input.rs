//! The board's analog input, with a simulated pack behind the divider.

use std::cell::RefCell;

use embassy_time::{Duration, Instant};

use super::{SimulatedPack, load_current_a};
use crate::battery::ReadError;
use crate::sensor::{ADC_FULL_SCALE, ADC_REFERENCE_V, AdcCount, AnalogIn, AnalogPin};

/// The divider of the Freenove board, as its maker's battery example has it.
const DIVIDER: f32 = 3.95;

/// A current sensor of the kind ArduPilot's defaults describe, on GP27 (`BATT_CURR_PIN` = 27, `BATT_MONITOR` = 4).
const AMPERES_PER_VOLT: f32 = 17.0;

/// Peak noise at the pack's terminals, in volts: ripple of the rail and the converter's own.
const NOISE_V: f32 = 0.008;

/// Longer steps are cut, so that the pack's slow voltage stays right when the simulator is fast.
const MAX_STEP: Duration = Duration::from_millis(100);

/// The pins behind the divider and the current sensor. Each conversion first lets the pack live up to the present.
pub struct SimulatedPackInput<'a> {
    pack: &'a RefCell<SimulatedPack>,
    random: fastrand::Rng,
    lived_until: Instant,
}

impl<'a> SimulatedPackInput<'a> {
    /// An input that drives `pack` through the drive cycle from now on. The noise is the same in every run.
    pub fn new(pack: &'a RefCell<SimulatedPack>) -> Self {
        Self {
            pack,
            random: fastrand::Rng::with_seed(1),
            lived_until: Instant::now(),
        }
    }

    fn live_until(&mut self, now: Instant) {
        let mut pack = self.pack.borrow_mut();
        while self.lived_until < now {
            let step = (now - self.lived_until).min(MAX_STEP);
            pack.draw(
                load_current_a(seconds(self.lived_until - Instant::MIN)),
                seconds(step),
            );
            self.lived_until += step;
        }
    }
}

fn seconds(duration: Duration) -> f32 {
    (duration.as_micros() as f64 / 1e6) as f32
}

impl AnalogIn for SimulatedPackInput<'_> {
    async fn convert(&mut self, pin: AnalogPin) -> Result<AdcCount, ReadError> {
        self.live_until(Instant::now());
        let noise_v = (self.random.f32() * 2.0 - 1.0) * NOISE_V;
        let pin_v = match pin {
            AnalogPin::Gp26 => (self.pack.borrow().voltage_v() + noise_v) / DIVIDER,
            AnalogPin::Gp27 => self.pack.borrow().current_a() / AMPERES_PER_VOLT,
            AnalogPin::Gp28 | AnalogPin::Gp29 => 0.0,
        };
        let count = pin_v / ADC_REFERENCE_V * f32::from(ADC_FULL_SCALE);
        Ok(AdcCount(
            (count + 0.5).clamp(0.0, f32::from(ADC_FULL_SCALE)) as u16
        ))
    }
}
