//! The currents of the windings over a short time, by the classical Runge-Kutta method.

use super::bridge::Branch;
use super::totals::Terminals;

pub const BRIDGES: usize = 4;
/// A diode whose current is below this has stopped conducting.
const NO_CURRENT_A: f64 = 1e-5;
/// Each try at the end of a diode's current is closer to it by a factor of ten or more.
const MAX_TRIES: usize = 8;

/// A pack, and the board that it supplies beside the motors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Supply {
    pub open_circuit_v: f64,
    /// Of cells, holder and wires.
    pub resistance_ohm: f64,
    /// The current of everything but the motors.
    pub base_a: f64,
}

/// Currents of the windings; those without a branch are 0.
pub type Currents = [f64; BRIDGES];

/// The course of a step.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    pub seconds: f64,
    pub currents: Currents,
    /// Charge through each winding.
    pub coulombs: Currents,
    /// Of the pack.
    pub pack_coulombs: f64,
    pub pack_joules: f64,
}

/// The windings that conduct, as they are connected during a step.
#[derive(Clone, Copy, Debug)]
pub struct Network {
    pub supply: Supply,
    pub branches: [Option<Branch>; BRIDGES],
}

impl Network {
    pub fn terminals(&self, currents: &Currents) -> Terminals {
        let of_branch = |(branch, amperes): (&Option<Branch>, &f64)| {
            branch.as_ref().map_or(0.0, |branch| branch.share * amperes)
        };
        let motors: f64 = self.branches.iter().zip(currents).map(of_branch).sum();
        let amperes = self.supply.base_a + motors;
        Terminals {
            volts: self.supply.open_circuit_v - self.supply.resistance_ohm * amperes,
            amperes,
        }
    }

    /// The longest step that is exact to some 10⁻⁵.
    pub fn longest_step(&self) -> f64 {
        const SHARE_OF_TIME_CONSTANT: f64 = 0.25;
        let pack_ohm = self.supply.resistance_ohm * BRIDGES as f64;
        let time_constant = |branch: &Branch| branch.inductance_h / (branch.resistance_ohm + pack_ohm);
        let shortest = self.branches.iter().flatten().map(time_constant);
        SHARE_OF_TIME_CONSTANT * shortest.fold(f64::INFINITY, f64::min)
    }

    fn slopes(&self, currents: &Currents, volts: f64) -> Currents {
        std::array::from_fn(|number| match &self.branches[number] {
            Some(branch) => {
                let driving = branch.share * volts + branch.volts - branch.resistance_ohm * currents[number];
                driving / branch.inductance_h
            }
            None => 0.0,
        })
    }

    /// A step of at most this many seconds: it ends early if a diode stops conducting.
    pub fn step(&self, currents: &Currents, seconds: f64) -> Step {
        let mut step = self.whole_step(currents, seconds);
        for _ in 0..MAX_TRIES {
            let Some((number, share)) = self.first_end(currents, &step.currents) else {
                break;
            };
            if step.currents[number].abs() <= NO_CURRENT_A {
                break;
            }
            step = self.whole_step(currents, step.seconds * share);
        }
        for (number, branch) in self.branches.iter().enumerate() {
            let conducts = step.currents[number] * currents[number] > 0.0;
            if branch.as_ref().is_some_and(|branch| branch.ends_at_zero) && !conducts {
                step.currents[number] = 0.0;
            }
        }
        step
    }

    /// The diode that stops first, and the share of the time after which it does, by linear interpolation. The true moment is
    /// earlier, as the current falls fastest at first.
    fn first_end(&self, before: &Currents, after: &Currents) -> Option<(usize, f64)> {
        let ends = self.branches.iter().enumerate().filter_map(|(number, branch)| {
            let (before, after) = (before[number], after[number]);
            let passes_zero = branch.as_ref()?.ends_at_zero && before * after < 0.0;
            passes_zero.then(|| (number, before / (before - after)))
        });
        ends.min_by(|one, other| one.1.total_cmp(&other.1))
    }

    fn whole_step(&self, start: &Currents, seconds: f64) -> Step {
        const WEIGHTS: [f64; 4] = [1.0 / 6.0, 1.0 / 3.0, 1.0 / 3.0, 1.0 / 6.0];
        const REACHES: [f64; 4] = [0.5, 0.5, 1.0, 0.0];
        let mut step = Step {
            seconds,
            currents: *start,
            coulombs: [0.0; BRIDGES],
            pack_coulombs: 0.0,
            pack_joules: 0.0,
        };
        let mut currents = *start;
        for (weight, reach) in WEIGHTS.into_iter().zip(REACHES) {
            let Terminals { volts, amperes } = self.terminals(&currents);
            let slopes = self.slopes(&currents, volts);
            let weight = weight * seconds;
            step.pack_coulombs += weight * amperes;
            step.pack_joules += weight * amperes * volts;
            for number in 0..BRIDGES {
                step.coulombs[number] += weight * currents[number];
                step.currents[number] += weight * slopes[number];
                currents[number] = start[number] + reach * seconds * slopes[number];
            }
        }
        step
    }
}
