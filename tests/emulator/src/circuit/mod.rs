//! The circuit around the board: a pack, and motors at H-bridges that pins of the chip drive.
//!
//! A motor takes current while its bridge drives it. While the bridge coasts, the winding's current flows on through the diodes,
//! back into the pack, until it has ended; while it brakes, within the bridge. All currents share the pack's resistance, so its
//! voltage moves with every edge at the pins. Levels are those of PWM and SIO at each instant; a pin that a PIO drives is looked at
//! only when a register is written.
//!
//! ```ignore
//! let before = board.circuit().totals();
//! board.run_for(100_000);
//! let means = board.circuit().totals().since(before).expect("100 ms");
//! assert!(means.amperes < 2.5);
//! ```
//!
//! The converter's inputs and monitors at the I2C bus measure the circuit by themselves. For another device, at the CAN bus for
//! instance, a test takes its figures from [`Circuit::totals`].
//!
//! Left out: capacitors, commutation, dead time and switching times, a shaft fast enough to drive current through the diodes, the
//! pack's state of charge and dynamics, the bandwidth of sensors, and a brown-out of the board at a low voltage.

mod bridge;
mod probe;
mod signal;
mod solver;
#[cfg(test)]
mod tests;
mod totals;

use super::clock::{CLK_SYS_HZ, Cycle, NEVER};
use bridge::{Branch, Drive};
pub use bridge::{Bridge, Mode as BridgeMode, Motor, Shaft, Switches};
pub use probe::{CurrentSensor, Meter, Probe, SensorRange};
pub use signal::PinSignal;
pub use solver::Supply;
use solver::{BRIDGES, Currents, Network};
pub use totals::{Extremes, Means, Terminals, Totals};

/// Pack, bridges and motors, from the moment at which they are attached to a board.
#[derive(Clone, Debug)]
pub struct Circuit {
    supply: Supply,
    drives: Vec<Drive>,
    network: Network,
    longest_step_s: f64,
    /// Largest current that the monitors convert, in amperes.
    monitored_amperes: f64,
    next_edge: Cycle,
    totals: Totals,
    terminals: Terminals,
    extremes: Extremes,
}

impl Circuit {
    /// Panics with more than four bridges.
    pub fn new(supply: Supply, bridges: &[Bridge]) -> Self {
        assert!(bridges.len() <= BRIDGES, "at most {BRIDGES} bridges");
        let mut circuit = Self {
            supply,
            drives: bridges.iter().copied().map(Drive::new).collect(),
            network: Network {
                supply,
                branches: [None; BRIDGES],
            },
            longest_step_s: 0.0,
            monitored_amperes: f64::INFINITY,
            next_edge: NEVER,
            totals: Totals::default(),
            terminals: Terminals::default(),
            extremes: Extremes::of(Terminals::default()),
        };
        circuit.follow_inputs();
        circuit.restart_extremes();
        circuit
    }

    /// Begins at `now`.
    pub(super) fn begin(&mut self, now: Cycle) {
        self.totals.at = now;
        self.follow_inputs();
        self.restart_extremes();
    }

    /// The drive of each bridge's pins, from now on.
    pub(super) fn connect_inputs(&mut self, signals_of: impl Fn([usize; 2]) -> [PinSignal; 2]) {
        for drive in &mut self.drives {
            drive.set_signals(signals_of(drive.bridge.pins));
        }
        self.follow_inputs();
    }

    /// Lets time pass. Does nothing for the past.
    pub(super) fn advance(&mut self, now: Cycle) {
        while self.totals.at < now {
            let end = self.next_edge.min(now);
            self.pass_to(end);
            if end == self.next_edge {
                self.follow_inputs();
            }
        }
    }

    /// At the terminals of the pack.
    pub fn terminals(&self) -> Terminals {
        self.terminals
    }

    pub fn totals(&self) -> Totals {
        self.totals
    }

    /// The extremes since [`Self::restart_extremes`], of the moments at which an input changed or the circuit was looked at.
    pub fn extremes(&self) -> Extremes {
        self.extremes
    }

    pub fn restart_extremes(&mut self) {
        self.extremes = Extremes::of(self.terminals);
    }

    pub fn supply(&self) -> Supply {
        self.supply
    }

    /// Another pack, or another board, from now on.
    pub fn set_supply(&mut self, supply: Supply) {
        self.supply = supply;
        self.follow_inputs();
    }

    /// The monitors at the I2C bus cut a current off at the ends of their range, before they average it.
    pub fn set_range_of_monitors(&mut self, amperes: f64) {
        self.monitored_amperes = amperes;
    }

    /// Plugs another motor into a bridge, at a standstill and without current, or unplugs it.
    pub fn plug_in(&mut self, bridge: usize, motor: Option<Motor>) {
        self.drives[bridge].plug_in(motor);
        self.follow_inputs();
    }

    /// The switches of a bridge at this moment.
    pub fn mode(&self, bridge: usize) -> BridgeMode {
        self.drives[bridge].mode
    }

    /// The current through a motor, positive from OUT1 to OUT2.
    pub fn motor_amperes(&self, bridge: usize) -> f64 {
        self.drives[bridge].amperes
    }

    /// A motor's speed, as the voltage that it induces.
    pub fn back_emf_volts(&self, bridge: usize) -> f64 {
        self.drives[bridge].back_emf_v
    }

    /// Something was switched.
    fn follow_inputs(&mut self) {
        self.next_edge = NEVER;
        for drive in &mut self.drives {
            self.next_edge = self.next_edge.min(drive.follow_inputs(self.totals.at));
        }
        self.connect();
        self.longest_step_s = self.network.longest_step();
    }

    /// The windings that conduct from now on.
    fn connect(&mut self) {
        self.network = Network {
            supply: self.supply,
            branches: self.branches(),
        };
        self.terminals = self.network.terminals(&self.currents());
        self.extremes.include(self.terminals);
    }

    fn branches(&self) -> [Option<Branch>; BRIDGES] {
        std::array::from_fn(|number| self.drives.get(number)?.branch())
    }

    fn currents(&self) -> Currents {
        std::array::from_fn(|number| self.drives.get(number).map_or(0.0, |drive| drive.amperes))
    }

    /// A stretch of time in which no input changes.
    fn pass_to(&mut self, end: Cycle) {
        let mut left_s = (end - self.totals.at) as f64 / CLK_SYS_HZ as f64;
        while left_s > 0.0 {
            left_s -= if self.network.branches.iter().any(Option::is_some) {
                self.step(left_s.min(self.longest_step_s))
            } else {
                self.pass_without_motors(left_s)
            };
        }
        self.totals.at = end;
    }

    fn pass_without_motors(&mut self, seconds: f64) -> f64 {
        let Terminals { volts, amperes } = self.terminals;
        self.draw(amperes * seconds, seconds);
        self.totals.joules += amperes * volts * seconds;
        self.totals.volt_seconds += volts * seconds;
        self.drives.iter_mut().for_each(|drive| drive.turn(0.0, seconds));
        seconds
    }

    fn draw(&mut self, coulombs: f64, seconds: f64) {
        let most = self.monitored_amperes * seconds;
        self.totals.coulombs += coulombs;
        self.totals.shown_coulombs += coulombs.clamp(-most, most);
    }

    /// Returns how many seconds have passed.
    fn step(&mut self, seconds: f64) -> f64 {
        let step = self.network.step(&self.currents(), seconds);
        self.draw(step.pack_coulombs, step.seconds);
        self.totals.joules += step.pack_joules;
        let Supply {
            open_circuit_v,
            resistance_ohm,
            ..
        } = self.supply;
        self.totals.volt_seconds += open_circuit_v * step.seconds - resistance_ohm * step.pack_coulombs;
        for (number, drive) in self.drives.iter_mut().enumerate() {
            drive.amperes = step.currents[number];
            drive.turn(step.coulombs[number], step.seconds);
        }
        self.connect();
        step.seconds
    }
}
