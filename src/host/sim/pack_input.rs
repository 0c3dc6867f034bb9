//! Simulated analog inputs: divider and current sensor of the simulated pack.

use std::future::pending;

use super::fault::Fault;
use super::{PackSimulation, SimulatedPack};
use crate::battery::ReadError;
use crate::sensor::{ADC_FULL_SCALE, ADC_REFERENCE_V, AdcCount, AnalogIn, AnalogPin};
use crate::tasks::Shared;

/// Divider of the Freenove board, as in the manufacturer's battery example.
const DIVIDER: f32 = 3.95;

/// Current sensor with ArduPilot's default scale, on GP27 (`BATT_CURR_PIN` = 27, `BATT_MONITOR` = 4).
const AMPERES_PER_VOLT: f32 = 17.0;

/// Peak noise referred to the pack's terminals, in volts: ripple of the rail and ADC noise.
const NOISE_V: f32 = 0.008;

/// The same with the noise fault of `SIM_BATT_FAULT`.
const FAULTY_NOISE_V: f32 = 0.5;

/// Pins connected to the divider and the current sensor.
pub struct SimulatedPackInput<'a> {
    pack: &'a PackSimulation<'a>,
    shared: &'a Shared,
    random: fastrand::Rng,
}

impl<'a> SimulatedPackInput<'a> {
    /// An input that measures `pack`, with reproducible noise.
    pub fn new(pack: &'a PackSimulation<'a>, shared: &'a Shared) -> Self {
        Self {
            pack,
            shared,
            random: fastrand::Rng::with_seed(1),
        }
    }

    fn pin_voltage_v(&mut self, pack: &SimulatedPack, pin: AnalogPin, fault: Fault) -> f32 {
        let noise_v = match fault {
            Fault::Noisy => FAULTY_NOISE_V,
            Fault::None | Fault::Stalled | Fault::WireOff | Fault::WeakCell | Fault::BusOff => NOISE_V,
        };
        let noise_v = (self.random.f32() * 2.0 - 1.0) * noise_v;
        match pin {
            AnalogPin::Gp26 if fault == Fault::WireOff => 0.0,
            AnalogPin::Gp26 => (pack.voltage_v() + noise_v) / DIVIDER,
            AnalogPin::Gp27 => pack.current_a() / AMPERES_PER_VOLT,
            AnalogPin::Gp28 | AnalogPin::Gp29 => 0.0,
        }
    }
}

impl AnalogIn for SimulatedPackInput<'_> {
    async fn convert(&mut self, pin: AnalogPin) -> Result<AdcCount, ReadError> {
        // Updates the pack, even if the ADC does not answer.
        let pack = self.pack.now();
        let fault = Fault::now(self.shared);
        if fault == Fault::Stalled {
            pending::<()>().await;
        }
        let count = self.pin_voltage_v(&pack, pin, fault) / ADC_REFERENCE_V * f32::from(ADC_FULL_SCALE);
        Ok(AdcCount(
            (count + 0.5).clamp(0.0, f32::from(ADC_FULL_SCALE)) as u16
        ))
    }
}
