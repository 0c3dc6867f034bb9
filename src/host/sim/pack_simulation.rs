//! The simulated pack over time, updated to the present before every measurement.

use std::cell::{Cell, RefCell};

use embassy_time::{Duration, Instant};

use super::fault::Fault;
use super::{SimulatedPack, SimulatedRover};
use crate::parameter::SimulationParameter;
use crate::tasks::Shared;

/// Longer steps are divided, for the accuracy of the slow voltage at high speedups.
const MAX_STEP: Duration = Duration::from_millis(100);

/// How far the cell of [`Fault::WeakCell`] is below the others, in volts.
const WEAK_CELL_DROP_V: f32 = 1.0;

/// Simulates the pack of a rover, for all simulated sensors.
pub struct PackSimulation<'a> {
    pack: &'a RefCell<SimulatedPack>,
    rover: &'a SimulatedRover,
    shared: &'a Shared,
    lived_until: Cell<Instant>,
}

impl<'a> PackSimulation<'a> {
    /// A pack simulated from now on, with the simulation parameters in `shared`.
    pub fn new(pack: &'a RefCell<SimulatedPack>, rover: &'a SimulatedRover, shared: &'a Shared) -> Self {
        Self {
            pack,
            rover,
            shared,
            lived_until: Cell::new(Instant::now()),
        }
    }

    /// A copy of the pack in its present state.
    pub fn now(&self) -> SimulatedPack {
        self.update_until(Instant::now());
        self.pack.borrow().clone()
    }

    /// What is wrong with it or its sensors now.
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
        let weak_cell_drop_v = match self.fault() {
            Fault::WeakCell => WEAK_CELL_DROP_V,
            Fault::None | Fault::Stalled | Fault::WireOff | Fault::Noisy | Fault::BusOff => 0.0,
        };
        let mut pack = self.pack.borrow_mut();
        pack.lower_first_cell(weak_cell_drop_v);
        pack.hold_open_circuit((held_v > 0.0).then_some(held_v));
        pack.set_capacity_ah(parameter(SimulationParameter::BattCapAh));
        while self.lived_until.get() < now {
            let step = (now - self.lived_until.get()).min(MAX_STEP);
            pack.draw(load_a, seconds(step));
            self.lived_until.set(self.lived_until.get() + step);
        }
    }
}

fn seconds(duration: Duration) -> f32 {
    (duration.as_micros() as f64 / 1e6) as f32
}

#[cfg(test)]
mod tests {
    use embassy_time::Timer;

    use super::super::{PackModel, clock};
    use super::*;
    use crate::autopilot::Start;
    use crate::parameter::Parameters;

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
