//! Simulated packs of one cell. Neither curves nor sags are those of the estimators.

use std::f64::consts::PI;

use battery_gauge::Chemistry;
use fastrand::Rng;

use crate::drive::{Cell, Drive, End, Origin};
use crate::sample::Sample;

/// Interval of the samples, in seconds.
pub const DT_S: f64 = 0.5;

const fn cell(name: &'static str, chemistry: Chemistry, label_ah: f64, critical_v: f32) -> Cell {
    Cell {
        origin: Origin::Simulated,
        name,
        chemistry,
        label_ah: Some(label_ah),
        critical_v,
        end: End::Critical,
        is_life: false,
    }
}

/// A chemistry as others have measured it.
#[derive(Clone, Copy, Debug)]
pub struct Chemical {
    pub cell: Cell,
    /// Voltage at a state of charge from 0 to 1, in volts.
    curve: fn(f64) -> f64,
    /// Standard deviation of makes, in volts.
    spread_v: f64,
    /// Fast resistance times capacity, in Ω·Ah, and the standard deviation of its logarithm.
    ohm_ah: f64,
    ohm_spread: f64,
    /// Time by which the surface of the particles is ahead of their mean charge, in seconds.
    diffusion_s: f64,
    /// At which a charger holds its voltage, in volts.
    charged_v: f64,
}

/// Resistances by data sheets: 13 to 40 mΩ of cells with 3 to 3.5 Ah; 10 mΩ of an A123 26650 with 2.3 Ah, of which makes differ less.
/// Diffusion: the mean of R²/15D of both electrodes, of Mohtat 2020 for NMC, of Marquis et al. 2019 (doi:10.1149/2.0341915jes) for
/// the LiPo's LCO; that of LiFe is assumed.
pub const CHEMICALS: [Chemical; 4] = [
    Chemical {
        cell: cell("LiPo", Chemistry::LiPo, 2.2, 3.4),
        curve: polymer_v,
        spread_v: 0.02,
        ohm_ah: 0.03,
        ohm_spread: 0.3,
        diffusion_s: 119.0,
        charged_v: 4.2,
    },
    Chemical {
        cell: cell("LiFe", Chemistry::LiFe, 2.3, 2.8),
        curve: iron_v,
        spread_v: 0.012,
        ohm_ah: 0.023,
        ohm_spread: 0.2,
        diffusion_s: 80.0,
        charged_v: 3.6,
    },
    Chemical {
        cell: cell("Li-ion", Chemistry::LiIon, 3.0, 3.0),
        curve: nmc_v,
        spread_v: 0.03,
        ohm_ah: 0.085,
        ohm_spread: 0.3,
        diffusion_s: 92.0,
        charged_v: 4.2,
    },
    Chemical {
        cell: cell("NiMH", Chemistry::NiMh, 2.0, 1.0),
        curve: hydride_v,
        spread_v: 0.015,
        ohm_ah: 0.02,
        ohm_spread: 0.2,
        diffusion_s: 40.0,
        charged_v: 1.5,
    },
];

/// Chen and Rincón-Mora 2006 (doi:10.1109/TEC.2006.874229): a polymer cell of 850 mAh that was charged to 4.1 V. Charged to
/// 4.2 V, it goes on along the curve.
fn polymer_v(charge: f64) -> f64 {
    let s = 1.097 * charge;
    3.685 + 0.2156 * s - 0.1178 * s * s + 0.3201 * s.powi(3) - 1.031 * (-35.0 * s).exp()
}

/// Graphite of Mohtat et al. 2020 (doi:10.1149/1945-7111/aba5d1), against lithium.
fn graphite_v(x: f64) -> f64 {
    let step = |height: f64, middle: f64, width: f64| height * ((x - middle) / width).tanh();
    0.063 + 0.8 * (-75.0 * (x + 0.001)).exp()
        - step(0.0120, 0.127, 0.016)
        - step(0.0118, 0.155, 0.016)
        - step(0.0035, 0.220, 0.020)
        - step(0.0095, 0.190, 0.013)
        - step(0.0145, 0.490, 0.020)
        - step(0.0800, 1.030, 0.055)
}

/// Graphite/NMC532 pouch of 5 Ah, by the same: from 2.8 to 4.2 V.
fn nmc_v(charge: f64) -> f64 {
    let (x, y) = (0.0017 + 0.832 * charge, 0.8907 - 0.8575 * charge);
    let cathode_v = 4.3452 - 1.6518 * y + 1.6225 * y.powi(2) - 2.0843 * y.powi(3) + 3.5146 * y.powi(4)
        - 2.2166 * y.powi(5)
        - 0.5623e-4 * (109.451 * y - 100.006).exp();
    cathode_v - graphite_v(x)
}

/// LiFePO4 of Afshar et al. 2017 (arXiv:1709.03970) against that graphite.
fn iron_v(charge: f64) -> f64 {
    let y = 0.97 - 0.965 * charge;
    let cathode_v = 3.4077 - 0.020269 * y + 0.5 * (-150.0 * y).exp() - 0.9 * (-30.0 * (1.0 - y)).exp();
    cathode_v - graphite_v(0.0017 + 0.83 * charge)
}

/// An eneloop AA of 2 Ah in the equation of Tremblay and Dessaint 2009 (doi:10.3390/wevj3020289), by the parameters of the
/// Modelica library EnergyHarvestingWSN.
fn hydride_v(charge: f64) -> f64 {
    1.3036 - 0.0125 / charge.max(0.01) + 0.175 * (-12.0 * (1.0 - charge)).exp()
}

/// Points of a tabulated curve, less one.
const SEGMENTS: usize = 400;

/// A random number with standard deviation 1, at most 4.2.
pub fn deviation(random: &mut Rng) -> f64 {
    let sum: f64 = (0..6).map(|_| random.f64() - 0.5).sum();
    sum * 2.0_f64.sqrt()
}

/// A cell with its sag: Chen and Rincón-Mora's three resistances, which grow near empty, and the diffusion in its particles.
#[derive(Clone, Debug)]
pub struct Pack {
    pub chemical: Chemical,
    curve: Vec<f64>,
    pub capacity_ah: f64,
    ohm: f64,
    diffusion_s: f64,
    /// Mean state of charge, from 0 to 1.
    pub charge: f64,
    /// By how much the surface's is lower.
    deficit: f64,
    /// Voltages of the slower two.
    slow_v: [f64; 2],
}

/// Slower resistances relative to the fast one, and their time constants, in seconds, in the middle of the charge.
const SLOW: [(f64, f64); 2] = [(0.627, 33.0), (0.669, 223.0)];

impl Pack {
    /// One of any make, full.
    pub fn any(chemical: Chemical, random: &mut Rng) -> Self {
        let label_ah = chemical.cell.label_ah.expect("a label");
        // Makers' tolerance.
        let capacity_ah = label_ah * (1.0 + 0.02 * deviation(random).clamp(-2.0, 2.0));
        let [tilt_v, bend_v] = [0.7, 0.7].map(|share| share * chemical.spread_v * deviation(random));
        let curve = (0..=SEGMENTS)
            .map(|segment| {
                let charge = segment as f64 / SEGMENTS as f64;
                // A full cell has the voltage of its charger.
                let make_v = tilt_v * (1.0 - charge) + bend_v * (PI * charge).sin();
                (chemical.curve)(charge) + make_v
            })
            .collect();
        Self {
            chemical,
            curve,
            capacity_ah,
            ohm: chemical.ohm_ah / capacity_ah * (chemical.ohm_spread * deviation(random)).exp(),
            diffusion_s: chemical.diffusion_s * (0.4 * deviation(random)).exp(),
            charge: 1.0,
            deficit: 0.0,
            slow_v: [0.0; 2],
        }
    }

    /// As cold as near freezing: resistances as measured at 0 °C, by 2.2, and diffusion by Arrhenius (35 kJ/mol), by 3.
    pub fn cooled(mut self) -> Self {
        self.ohm *= 2.2;
        self.diffusion_s *= 3.0;
        self
    }

    fn open_v(&self, charge: f64) -> f64 {
        let position = charge * SEGMENTS as f64;
        let segment = (position.max(0.0) as usize).min(SEGMENTS - 1);
        let (low_v, high_v) = (self.curve[segment], self.curve[segment + 1]);
        let inside = position - segment as f64;
        // Beyond its ends a curve is as steep as at 0, and as flat as a charger that holds its voltage permits.
        let slope_v = if inside > 1.0 { 0.002 } else { high_v - low_v };
        let end_v = if inside > 1.0 { high_v - 0.002 } else { low_v };
        end_v + inside * slope_v
    }

    fn growth(&self) -> f64 {
        1.0 + 2.1 * (-24.4 * self.charge.max(0.0)).exp()
    }

    /// Voltage under a load, in volts.
    pub fn voltage_v(&self, current_a: f64) -> f64 {
        let fast_v = self.growth() * self.ohm * current_a;
        self.open_v(self.charge - self.deficit) - fast_v - self.slow_v.iter().sum::<f64>()
    }

    /// Draws a current.
    pub fn draw(&mut self, current_a: f64, dt_s: f64) {
        let rate = current_a / (3600.0 * self.capacity_ah);
        self.charge -= rate * dt_s;
        // A sphere's first mode has three quarters of that time.
        let target = rate * self.diffusion_s;
        self.deficit += (target - self.deficit) * (1.0 - (-dt_s / (0.75 * self.diffusion_s)).exp());
        let grown = self.growth() * self.ohm * current_a;
        for (slow_v, (share, time_s)) in self.slow_v.iter_mut().zip(SLOW) {
            *slow_v += (share * grown - *slow_v) * (1.0 - (-dt_s / time_s).exp());
        }
    }

    /// Charges at half the capacity an hour up to a state of charge, or until the charger holds its voltage and a twentieth flows.
    pub fn charge_to(&mut self, charge: f64) {
        const DT_S: f64 = 5.0;
        let full_a = 0.5 * self.capacity_ah;
        while self.charge < charge {
            let above_v = self.chemical.charged_v - self.voltage_v(0.0);
            let current_a = (above_v / (self.growth() * self.ohm)).min(full_a);
            let is_held = self.chemical.cell.chemistry != Chemistry::NiMh;
            if is_held && current_a < 0.1 * full_a {
                break;
            }
            self.draw(if is_held { -current_a } else { -full_a }, DT_S);
        }
        if charge >= 1.0 {
            self.charge = 1.0;
        }
    }
}

/// How a pack is driven.
#[derive(Clone, Copy, Debug)]
pub struct Style {
    /// Mean load, in capacities per hour.
    pub load_per_h: f64,
    /// A standstill comes this often and lasts so long, in seconds.
    pub every_s: f64,
    pub stop_s: f64,
}

/// What the rover draws at a standstill, in capacities per hour.
const IDLE_PER_H: f64 = 0.03;

/// Rests before a drive and behind it, disarmed, in seconds.
pub const REST_S: f64 = 60.0;
pub const REST_AFTER_S: f64 = 300.0;

/// A drive as a sensor sees it, with the true charge at each sample, in percent.
#[derive(Clone, Debug, Default)]
pub struct Session {
    pub samples: Vec<Sample>,
    pub truth_pct: Vec<f64>,
}

impl Session {
    /// Drives down to a state of charge, or until the voltage is critical, or for a time.
    pub fn drive(pack: &mut Pack, style: &Style, until: f64, most_s: f64, random: &mut Rng) -> Self {
        let mut session = Self::default();
        session.rest(pack, REST_S, random);
        let label_ah = pack.chemical.cell.label_ah.expect("a label");
        let phase = random.f64() * 40.0;
        let (mut driven_s, mut below_s) = (0.0, 0.0);
        while pack.charge > until && driven_s < most_s && below_s < 20.0 {
            let stands = driven_s % style.every_s > style.every_s - style.stop_s;
            let swell = 1.0 + 0.5 * (0.31 * driven_s + phase).sin() + 0.25 * (1.7 * driven_s).sin();
            let spurt = if (driven_s + phase) % 37.0 < 5.0 { 1.6 } else { 0.9 };
            let load_per_h = if stands {
                IDLE_PER_H
            } else {
                style.load_per_h * swell * spurt
            };
            let current_a = load_per_h * label_ah;
            session.add(pack, current_a, true, random);
            let is_below = pack.voltage_v(current_a) < f64::from(pack.chemical.cell.critical_v);
            below_s = if is_below {
                below_s + DT_S
            } else {
                (below_s - DT_S).max(0.0)
            };
            driven_s += DT_S;
        }
        session.rest(pack, REST_AFTER_S, random);
        session
    }

    /// Rests with the load off.
    pub fn rest(&mut self, pack: &mut Pack, duration_s: f64, random: &mut Rng) {
        let idle_a = 0.2 * IDLE_PER_H * pack.capacity_ah;
        for _ in 0..(duration_s / DT_S) as u32 {
            self.add(pack, idle_a, false, random);
        }
    }

    /// A reading with the noise of a good sensor.
    fn add(&mut self, pack: &mut Pack, current_a: f64, armed: bool, random: &mut Rng) {
        pack.draw(current_a, DT_S);
        let t_s = self.samples.len() as f64 * DT_S;
        let voltage_v = pack.voltage_v(current_a) + 0.002 * deviation(random);
        let measured_a = current_a + 0.01 * deviation(random);
        self.samples
            .push(Sample::measured(t_s, voltage_v, measured_a, armed));
        self.truth_pct.push(100.0 * pack.charge);
    }
}

/// Makes of each chemistry.
const MAKES: u64 = 3;

/// Drives from full to the end: three makes of each chemistry, warm and cold.
pub fn drives() -> Vec<Drive> {
    let mut drives = Vec::new();
    for chemical in CHEMICALS {
        for make in 0..MAKES {
            for (temperature_c, ending) in [(25, ""), (0, " cold")] {
                let mut random = Rng::with_seed(17 * make + chemical.cell.chemistry as u64);
                let pack = Pack::any(chemical, &mut random);
                let mut pack = if temperature_c == 0 { pack.cooled() } else { pack };
                let style = Style {
                    load_per_h: 0.8,
                    every_s: 400.0,
                    stop_s: 60.0,
                };
                let Session { samples, truth_pct } =
                    Session::drive(&mut pack, &style, 0.01, f64::INFINITY, &mut random);
                let group = format!("{}{ending}", chemical.cell.name);
                let number = make as usize;
                let drive = Drive::new(
                    chemical.cell,
                    group,
                    number,
                    temperature_c,
                    samples,
                    Some(truth_pct),
                );
                drives.push(drive);
            }
        }
    }
    drives
}
