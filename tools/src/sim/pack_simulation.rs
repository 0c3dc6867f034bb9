//! The simulated pack over time, updated to the present before every measurement, and the analog inputs that measure it.

use std::cell::{Cell, RefCell};

use embassy_time::{Duration, Instant};
use rover_battmon::battery::ReadError;
use rover_battmon::parameter::SimulationParameter;
use rover_battmon::sensor::{
    ADC_FULL_SCALE, ADC_REFERENCE_V, AnalogIn, AnalogPin, AnalogReadings, Conversions, WantedReadings,
};
use rover_battmon::tasks::Shared;

use super::{SimulatedPack, SimulatedRover};

/// Longer steps are divided, for the accuracy of the slow voltage at high speedups.
const MAX_STEP: Duration = Duration::from_millis(100);

/// Difference of the cell of [`Fault::WeakCell`] to the others, in volts below them.
const WEAK_CELL_DROP_V: f32 = 1.0;

/// Fault of the simulated pack or its sensors (`SIM_BATT_FAULT`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Fault {
    None,
    /// The ADC does not answer.
    Stalled,
    /// The divider's sense wire is disconnected.
    WireOff,
    /// The rail is noisy.
    Noisy,
    /// One cell of the pack is far below the others.
    WeakCell,
    /// A wire of the I2C bus is disconnected: no device answers.
    BusOff,
}

impl Fault {
    /// The one that is set now.
    fn now(shared: &Shared) -> Self {
        match shared.with(|autopilot| autopilot.parameters().get_whole(SimulationParameter::BattFault)) {
            1 => Self::Stalled,
            2 => Self::WireOff,
            3 => Self::Noisy,
            4 => Self::WeakCell,
            5 => Self::BusOff,
            _ => Self::None,
        }
    }
}

/// Simulates the pack of a rover, for all simulated sensors.
pub struct PackSimulation<'a> {
    pack: &'a RefCell<SimulatedPack>,
    rover: &'a SimulatedRover,
    shared: &'a Shared,
    lived_until: Cell<Instant>,
    integrals: Cell<Integrals>,
}

/// Flow since it was taken last.
#[derive(Clone, Copy, Debug, Default)]
struct Integrals {
    seconds: f32,
    volt_seconds: f32,
    coulombs: f32,
    joules: f32,
}

impl Integrals {
    fn add(&mut self, pack: &SimulatedPack, seconds: f32) {
        self.seconds += seconds;
        self.volt_seconds += pack.voltage_v() * seconds;
        self.coulombs += pack.current_a() * seconds;
        self.joules += pack.voltage_v() * pack.current_a() * seconds;
    }
}

impl<'a> PackSimulation<'a> {
    /// A pack simulated from now on, with the simulation parameters in `shared`.
    pub fn new(pack: &'a RefCell<SimulatedPack>, rover: &'a SimulatedRover, shared: &'a Shared) -> Self {
        Self {
            pack,
            rover,
            shared,
            lived_until: Cell::new(Instant::now()),
            integrals: Cell::default(),
        }
    }

    /// A copy of the pack in its present state.
    pub fn now(&self) -> SimulatedPack {
        self.update_until(Instant::now());
        self.pack.borrow().clone()
    }

    /// Its present fault, or its sensors'.
    pub(super) fn fault(&self) -> Fault {
        Fault::now(self.shared)
    }

    fn update_until(&self, now: Instant) {
        let parameter = |parameter| {
            self.shared
                .with(|autopilot| autopilot.parameters().get(parameter))
        };
        let held_v = parameter(SimulationParameter::BattVoltage);
        let load_a = self.rover.current_a() + parameter(SimulationParameter::BattCurrent);
        let is_weak = self.fault() == Fault::WeakCell;
        let mut pack = self.pack.borrow_mut();
        pack.lower_first_cell(if is_weak { WEAK_CELL_DROP_V } else { 0.0 });
        pack.hold_open_circuit((held_v > 0.0).then_some(held_v));
        pack.set_capacity_ah(parameter(SimulationParameter::BattCapAh));
        while self.lived_until.get() < now {
            let step = (now - self.lived_until.get()).min(MAX_STEP);
            pack.draw(load_a, seconds(step));
            let mut integrals = self.integrals.get();
            integrals.add(&pack, seconds(step));
            self.integrals.set(integrals);
            self.lived_until.set(self.lived_until.get() + step);
        }
    }
}

fn seconds(duration: Duration) -> f32 {
    (duration.as_micros() as f64 / 1e6) as f32
}

/// Divider of the Freenove board, as in the manufacturer's battery example.
const DIVIDER: f32 = 3.95;

/// Current sensor with ArduPilot's default scale, on GP27 (`BATT_CURR_PIN` = 27, `BATT_MONITOR` = 4).
const AMPERES_PER_VOLT: f32 = 17.0;

/// Peak noise referred to the pack's terminals, in volts: ripple of the rail and ADC noise.
const NOISE_V: f32 = 0.008;

/// Peak noise with the noise fault of `SIM_BATT_FAULT`, in volts.
const FAULTY_NOISE_V: f32 = 0.5;

/// Conversions of a pin in a tick.
const CONVERSIONS: u16 = 64;

/// Pins connected to the divider and the current sensor.
pub struct SimulatedPackInput<'a> {
    pack: &'a PackSimulation<'a>,
    random: fastrand::Rng,
}

impl<'a> SimulatedPackInput<'a> {
    /// An input that measures `pack`, with reproducible noise.
    pub fn new(pack: &'a PackSimulation<'a>) -> Self {
        Self {
            pack,
            random: fastrand::Rng::with_seed(1),
        }
    }

    /// Conversions of a pin whose voltage has this mean and this peak noise, in volts.
    fn conversions(&mut self, mean_v: f32, noise_v: f32) -> Conversions {
        let full_scale = f32::from(ADC_FULL_SCALE);
        let codes = (0..CONVERSIONS).map(|index| {
            let noise_v = (self.random.f32() * 2.0 - 1.0) * noise_v;
            // Fractions of a count are in the mean.
            let dither = (index as f32 + 0.5) / CONVERSIONS as f32;
            let count = (mean_v + noise_v) / ADC_REFERENCE_V * full_scale + dither;
            count.clamp(0.0, full_scale) as u16
        });
        let codes: Vec<_> = codes.collect();
        Conversions::from_codes(codes.into_iter()).expect("there are some")
    }
}

impl AnalogIn for SimulatedPackInput<'_> {
    fn read(&mut self, _: rover_battmon::time::Instant, _: WantedReadings) -> AnalogReadings {
        // Updates the pack, even if the ADC does not answer.
        let pack = self.pack.now();
        let fault = self.pack.fault();
        let flowed = self.pack.integrals.take();
        if fault == Fault::Stalled {
            return AnalogReadings::failed(ReadError::Timeout);
        }
        let mean = |integral: f32, now: f32| {
            if flowed.seconds > 0.0 {
                integral / flowed.seconds
            } else {
                now
            }
        };
        let voltage_v = mean(flowed.volt_seconds, pack.voltage_v());
        let current_a = mean(flowed.coulombs, pack.current_a());
        let power_w = mean(flowed.joules, pack.voltage_v() * pack.current_a());
        let divider_v = match fault {
            Fault::WireOff => 0.0,
            _ => voltage_v / DIVIDER,
        };
        let noise_v = match fault {
            Fault::Noisy => FAULTY_NOISE_V,
            _ => NOISE_V,
        };
        let mut readings = AnalogReadings::NONE;
        for (pin, mean_v, noise_v) in [
            (AnalogPin::Gp26, divider_v, noise_v / DIVIDER),
            (AnalogPin::Gp27, current_a / AMPERES_PER_VOLT, 0.0),
            (AnalogPin::Gp28, 0.0, 0.0),
            (AnalogPin::Gp29, 0.0, 0.0),
        ] {
            readings.set(pin, Ok(self.conversions(mean_v, noise_v)));
        }
        let covariance_va = power_w - voltage_v * current_a;
        let counts_per_volt = f32::from(ADC_FULL_SCALE) / ADC_REFERENCE_V;
        let covariance = covariance_va / (DIVIDER * AMPERES_PER_VOLT) * counts_per_volt * counts_per_volt;
        readings.set_covariance(AnalogPin::Gp26, AnalogPin::Gp27, Some(covariance));
        readings
    }
}

#[cfg(test)]
mod tests {
    use embassy_time::Timer;

    use super::super::{PackModel, clock};
    use super::*;
    use rover_battmon::autopilot::Start;
    use rover_battmon::parameter::Parameters;

    #[test]
    fn charge_does_not_depend_on_the_number_of_measurements() {
        let charge_after = |asked: u64| {
            let pack = RefCell::new(SimulatedPack::full(PackModel::LIPO_3S_2200));
            let (rover, shared) = (
                SimulatedRover::default(),
                Shared::new(&Start::with_parameters(Parameters::defaults())),
            );
            let hour = async {
                let simulation = PackSimulation::new(&pack, &rover, &shared);
                for _ in 0..asked {
                    Timer::after(Duration::from_secs(3600) / asked as u32).await;
                    assert_eq!(simulation.now().charge(), simulation.now().charge());
                }
            };
            clock::run_for(Duration::from_secs(3601), hour).expect("it ends");
            pack.borrow().charge()
        };
        let expected = 1.0 - 0.2 / 2.2;
        for asked in [1, 36_000] {
            let charge = charge_after(asked);
            assert!((charge - expected).abs() < 2e-3, "{asked} times: {charge}");
        }
    }
}
