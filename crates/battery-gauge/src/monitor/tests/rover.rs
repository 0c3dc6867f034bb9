//! A rover with a pack whose charge is known.

use super::*;
use crate::MeasuringScale;

/// The board's own consumption, in amperes.
pub const IDLE_A: f32 = 0.1;

const TICK_S: f32 = 0.1;

/// Time constants, in seconds, and shares of the slow sag.
const SLOW: [(f32, f32); 3] = [(10.0, 0.25), (100.0, 0.25), (1000.0, 0.5)];

/// A pack of three cells whose charge is known.
#[derive(Clone, Debug)]
pub struct Pack {
    pub chemistry: Chemistry,
    pub capacity_ah: f32,
    pub soc: f32,
    pub slow_a: [f32; 3],
    pub slow_share: f32,
    /// How far the curve is above that of its chemistry when empty and full, in volts.
    pub offsets_v: [f32; 2],
    /// Surface charge of a cell, in volts.
    pub surface_v: f32,
    /// Resistance relative to that of a warm cell.
    pub resistance: f32,
    /// Charge below which the resistance grows.
    pub weak_below: f32,
}

/// Growth of a weak pack's resistance, relative to it, for each unit of charge below that.
const WEAKNESS: f32 = 40.0;

/// Time in which a surface charge relaxes, in seconds, and charge whose drawing takes it away.
const SURFACE_S: f32 = 600.0;
const SURFACE_SOC: f32 = 0.03;

impl Pack {
    pub fn rested(chemistry: Chemistry, soc: f32) -> Self {
        Self {
            chemistry,
            capacity_ah: 2.2,
            soc,
            slow_a: [0.0; 3],
            slow_share: chemistry.cell().slow_share,
            offsets_v: [0.0; 2],
            surface_v: 0.0,
            resistance: 1.0,
            weak_below: 0.0,
        }
    }

    /// As strong or weak, charged and rested.
    pub fn recharged(&self) -> Self {
        Self {
            resistance: self.resistance,
            weak_below: self.weak_below,
            ..Self::rested(self.chemistry, 1.0)
        }
    }

    pub fn draw(&mut self, current_a: f32, dt_s: f32) {
        self.soc = (self.soc - current_a * dt_s / 3600.0 / self.capacity_ah).clamp(0.0, 1.0);
        let drawn = (current_a * dt_s / 3600.0 / self.capacity_ah).max(0.0);
        self.surface_v *= (-dt_s / SURFACE_S - drawn / SURFACE_SOC).exp();
        for (slow_a, (time_constant_s, _)) in self.slow_a.iter_mut().zip(SLOW) {
            *slow_a += (current_a - *slow_a) * (1.0 - (-dt_s / time_constant_s).exp());
        }
    }

    pub fn voltage_v(&self, current_a: f32) -> f32 {
        let cell = self.chemistry.cell();
        let slow_a: f32 = self
            .slow_a
            .iter()
            .zip(SLOW)
            .map(|(slow_a, (_, share))| slow_a * share)
            .sum();
        let weakness = WEAKNESS * (self.weak_below - self.soc).max(0.0);
        let ohm = self.resistance * (1.0 + weakness) * cell.ohmic_drop_v / self.capacity_ah;
        let sag_v = ohm * (current_a + self.slow_share * slow_a);
        let [empty_v, full_v] = self.offsets_v;
        let offset_v = empty_v + (full_v - empty_v) * self.soc;
        3.0 * (cell.curve.voltage_v(self.soc) + offset_v + self.surface_v - sag_v)
    }
}

/// The scale by which a rover measures its pack right.
pub const TRUE_SCALE: MeasuringScale = MeasuringScale {
    volt_multiplier: 3.95,
    volt_offset_v: 0.0,
    amperes_per_volt: 17.0,
};

/// A rover that stays on by USB, with a pack that may be taken out.
pub struct Rover {
    pub bench: MonitorBench,
    pub pack: Pack,
    pub sensors: Sensors,
    pub measuring: Measuring,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sensors {
    VoltageAndCurrent,
    VoltageAndReversedCurrent,
    /// The board's own consumption is none to it.
    VoltageAndInsensitiveCurrent,
    /// It ends at [`CLIPPED_A`].
    VoltageAndClippedCurrent,
    Voltage,
}

/// End of a current sensor whose shunt is too large, in amperes.
pub const CLIPPED_A: f32 = 1.1;

impl Rover {
    pub fn with(pack: Pack) -> Self {
        let mut bench = MonitorBench::new();
        bench.settings.chemistry = pack.chemistry;
        bench.monitor.restore_learnt(LearntPack::UNKNOWN);
        Self {
            bench,
            pack,
            sensors: Sensors::VoltageAndCurrent,
            measuring: Measuring {
                scale: TRUE_SCALE,
                voltage_pin: 26,
            },
        }
    }

    /// A rover that has found its pack.
    pub fn parked(pack: Pack) -> Self {
        let mut rover = Self::with(pack);
        rover.run(40.0, IDLE_A);
        rover
    }

    /// A rover whose full pack has relaxed: on a curve with a plateau it is certain only then.
    pub fn rested(chemistry: Chemistry) -> Self {
        let mut rover = Self::with(Pack::rested(chemistry, 1.0));
        rover.run(4.0 * 3600.0, 0.0);
        rover
    }

    fn reading(&self, current_a: f32) -> Measurement {
        let scale = &self.measuring.scale;
        let pin_v = self.pack.voltage_v(current_a) / TRUE_SCALE.volt_multiplier;
        let voltage_v = (pin_v - scale.volt_offset_v) * scale.volt_multiplier;
        let by_current = scale.amperes_per_volt / TRUE_SCALE.amperes_per_volt;
        match self.sensors {
            Sensors::VoltageAndCurrent => loaded(voltage_v, current_a * by_current),
            Sensors::VoltageAndReversedCurrent => loaded(voltage_v, -current_a * by_current),
            Sensors::VoltageAndInsensitiveCurrent if current_a <= IDLE_A => loaded(voltage_v, 0.0),
            Sensors::VoltageAndInsensitiveCurrent => loaded(voltage_v, current_a),
            Sensors::VoltageAndClippedCurrent if current_a < CLIPPED_A => loaded(voltage_v, current_a),
            Sensors::VoltageAndClippedCurrent => Measurement {
                current_range: CurrentRange::Over,
                ..loaded(voltage_v, CLIPPED_A)
            },
            Sensors::Voltage => volts(voltage_v),
        }
    }

    pub fn run(&mut self, seconds: f32, current_a: f32) {
        for tick in 0..(seconds / TICK_S).round() as u32 {
            if tick % 10 == 0 {
                self.bench
                    .monitor
                    .follow(&self.measuring, self.bench.state.cell_count);
            }
            // The sign and the highest digits.
            let current_source = (self.measuring.scale.amperes_per_volt.to_bits() >> 16) as u16;
            self.bench.monitor.follow_current(current_source);
            self.pack.draw(current_a, TICK_S);
            let reading = self.reading(current_a);
            assert_eq!(self.bench.tick(Ok(reading)), None);
        }
    }

    /// Drives by fits and starts until this charge is left, and parks.
    pub fn drive_to(&mut self, soc: f32) {
        self.bench.load_state = LoadState::On;
        while self.pack.soc > soc {
            self.run(5.0, 4.4);
            self.run(5.0, 1.1);
        }
        self.bench.load_state = LoadState::Off;
    }

    /// Board and pack are switched off and on: only flash is kept.
    pub fn power_cycle(&mut self) {
        let kept = *self.bench.monitor.learnt().expect("restored");
        self.bench.restart();
        self.bench.monitor.restore_learnt(kept);
    }

    /// The board restarts with what RAM and flash hold.
    pub fn restart(&mut self, memory: Option<&PackMemory>) {
        self.power_cycle();
        self.bench.load_state = LoadState::Off;
        if let Some(memory) = memory {
            self.bench.monitor.restore(memory);
        }
    }

    /// Power fails for a time that RAM outlasts, in which the pack rests.
    pub fn dip_power(&mut self, seconds: f32) {
        let memory = self.bench.record_without_power();
        self.pack.draw(0.0, seconds);
        self.restart(Some(&memory));
    }

    /// The pack is out for this time.
    pub fn unplug(&mut self, seconds: f32) {
        for _ in 0..(seconds / TICK_S).round() as u32 {
            self.bench.tick(Ok(loaded(0.3, 0.0)));
        }
        self.pack.draw(0.0, seconds);
    }

    pub fn swap(&mut self, pack: Pack, seconds: f32) {
        self.unplug(seconds);
        self.pack = pack;
    }

    pub fn reported_pct(&self) -> f32 {
        self.bench.state.readings.remaining_pct.expect("known")
    }

    pub fn error_pct(&self) -> f32 {
        self.reported_pct() - 100.0 * self.pack.soc
    }

    #[track_caller]
    pub fn assert_error_below(&self, limit_pct: f32, what: &str) {
        let error_pct = self.error_pct();
        assert!(error_pct.abs() < limit_pct, "{what}: off by {error_pct} %");
    }

    pub fn restarts(&self) -> usize {
        self.bench.count_of(PackEvent::EstimateRestarted)
    }

    pub fn kept_charge(&self) -> Option<f32> {
        let learnt = self.bench.monitor.learnt()?;
        learnt.last_charge().map(|charge| charge.soc)
    }

    /// The charge that was counted.
    pub fn count_mah(&self) -> f32 {
        self.bench.state.consumed_mah().expect("counted")
    }

    pub fn retained_charge(&self) -> Option<f32> {
        self.bench.record().estimate.charge.map(|charge| charge.soc)
    }
}

/// Chemistries whose voltage says what is left.
pub const STEEP: [Chemistry; 2] = [Chemistry::LiPo, Chemistry::LiIon];
