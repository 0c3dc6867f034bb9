//! Model of a pack.

use rover_battmon::battery::Chemistry;

/// Points of a table of resting voltages: 0 %, 5 %, …, 100 %.
const POINTS: usize = 21;

/// The usual "LiPo voltage chart" of chargers and pack manufacturers (0.05 C discharge at room temperature).
static LIPO_RESTING_V: [f32; POINTS] = [
    3.27, 3.61, 3.69, 3.71, 3.73, 3.75, 3.77, 3.79, 3.80, 3.82, 3.84, 3.85, 3.87, 3.91, 3.95, 3.98, 4.02,
    4.08, 4.11, 4.15, 4.20,
];

/// LG M50: Chen et al. 2020 (doi:10.1149/1945-7111/ab9050), from 2.5 to 4.2 V.
static LI_ION_RESTING_V: [f32; POINTS] = [
    2.50, 3.11, 3.30, 3.43, 3.49, 3.53, 3.58, 3.63, 3.67, 3.71, 3.75, 3.80, 3.84, 3.89, 3.95, 3.99, 4.04,
    4.08, 4.10, 4.12, 4.20,
];

/// LiFePO4 of Afshar et al. 2017 (arXiv:1709.03970), against graphite of Mohtat et al. 2020 (doi:10.1149/1945-7111/aba5d1).
static LIFE_RESTING_V: [f32; POINTS] = [
    2.17, 3.08, 3.17, 3.20, 3.24, 3.27, 3.273, 3.274, 3.275, 3.276, 3.277, 3.28, 3.30, 3.309, 3.31, 3.311,
    3.312, 3.313, 3.314, 3.315, 3.55,
];

/// An eneloop AA of 2 Ah in the equation of Tremblay and Dessaint 2009 (doi:10.3390/wevj3020289).
static NIMH_RESTING_V: [f32; POINTS] = [
    0.90, 1.054, 1.179, 1.22, 1.241, 1.254, 1.262, 1.268, 1.272, 1.276, 1.279, 1.282, 1.284, 1.287, 1.291,
    1.296, 1.304, 1.318, 1.342, 1.386, 1.466,
];

const SECONDS_PER_HOUR: f32 = 3600.0;

/// Parameters of a pack.
#[derive(Clone, Copy, Debug)]
pub struct PackModel {
    /// Resting voltage of a cell from 0 % to 100 % charge in steps of 5 %, in volts.
    pub cell_resting_v: &'static [f32; POINTS],
    /// Cells in series.
    pub cells: u8,
    /// Full capacity, in ampere-hours.
    pub capacity_ah: f32,
    /// Resistance of the immediate voltage drop, in ohms.
    pub ohmic_resistance_ohm: f32,
    /// Resistance of the slow voltage drop, in ohms.
    pub polarization_resistance_ohm: f32,
    /// Time constant of the slow voltage drop, in seconds.
    pub polarization_time_s: f32,
}

/// How many times as large the resistances are at −10 °C as at 25 °C: as many times as the conductivity of the electrolyte
/// (1 mol/l) is smaller, 0.546 instead of 1.194 S/m in `electrolyte_conductivity_Ai2020` of PyBaMM's `Ai2020`. Reactions in a real
/// pack slow down further.
const COLD_RESISTANCE_FACTOR: f32 = 2.19;

impl PackModel {
    /// A 3S pack of 2200 mAh, with typical resistances of 25 C hobby packs.
    pub const LIPO_3S_2200: Self = Self {
        cell_resting_v: &LIPO_RESTING_V,
        cells: 3,
        capacity_ah: 2.2,
        ohmic_resistance_ohm: 0.036,
        polarization_resistance_ohm: 0.018,
        polarization_time_s: 8.0,
    };

    /// [`LIPO_3S_2200`](Self::LIPO_3S_2200) at −10 °C. Its capacity there is a parameter: `SIM_BATT_CAP_AH`.
    pub const LIPO_3S_2200_COLD: Self = Self {
        ohmic_resistance_ohm: Self::LIPO_3S_2200.ohmic_resistance_ohm * COLD_RESISTANCE_FACTOR,
        polarization_resistance_ohm: Self::LIPO_3S_2200.polarization_resistance_ohm * COLD_RESISTANCE_FACTOR,
        ..Self::LIPO_3S_2200
    };

    /// A pack of usual cells; without a capacity, in ampere-hours, that of one such cell.
    ///
    /// Resistances times capacity, in Ω·Ah, by data sheets: 13 to 40 mΩ of 18650s with 3 to 3.5 Ah, 10 mΩ of an A123 26650 with
    /// 2.3 Ah; that of NiMH is assumed. The slow part of all but hobby packs is that of Chen and Rincón-Mora 2006
    /// (doi:10.1109/TEC.2006.874229), whose two resistances are one here.
    pub fn usual(chemistry: Chemistry, cells: u8, capacity_ah: Option<f32>) -> Self {
        let (cell_resting_v, usual_ah, ohm_ah) = match chemistry {
            Chemistry::LiPo => (&LIPO_RESTING_V, 2.2, 0.026),
            Chemistry::LiIon => (&LI_ION_RESTING_V, 2.6, 0.085),
            Chemistry::LiFe => (&LIFE_RESTING_V, 2.3, 0.023),
            Chemistry::NiMh => (&NIMH_RESTING_V, 2.0, 0.020),
        };
        let (slow_share, polarization_time_s) = match chemistry {
            Chemistry::LiPo => (0.5, 8.0),
            Chemistry::LiIon | Chemistry::LiFe | Chemistry::NiMh => (1.3, 130.0),
        };
        let capacity_ah = capacity_ah.unwrap_or(usual_ah);
        let ohmic_resistance_ohm = f32::from(cells) * ohm_ah / capacity_ah;
        Self {
            cell_resting_v,
            cells,
            capacity_ah,
            ohmic_resistance_ohm,
            polarization_resistance_ohm: slow_share * ohmic_resistance_ohm,
            polarization_time_s,
        }
    }

    fn resting_cell_voltage_v(&self, charge: f32) -> f32 {
        let table_v = self.cell_resting_v;
        let position = charge.clamp(0.0, 1.0) * (POINTS - 1) as f32;
        let below = (position as usize).min(POINTS - 2);
        let share = position - below as f32;
        table_v[below] * (1.0 - share) + table_v[below + 1] * share
    }
}

/// State of a pack.
#[derive(Clone, Debug)]
pub struct SimulatedPack {
    model: PackModel,
    charge: f32,
    polarization_v: f32,
    current_a: f32,
    /// Overrides the voltage by charge.
    open_circuit_v: Option<f32>,
    /// Difference of the first cell to the others, in volts below them.
    first_cell_drop_v: f32,
    /// It is connected to the rover.
    is_plugged_in: bool,
}

impl SimulatedPack {
    /// A full, rested pack.
    pub const fn full(model: PackModel) -> Self {
        Self::charged(model, 1.0)
    }

    /// A rested pack with this state of charge, 0 to 1.
    pub const fn charged(model: PackModel, charge: f32) -> Self {
        Self {
            model,
            charge,
            polarization_v: 0.0,
            current_a: 0.0,
            open_circuit_v: None,
            first_cell_drop_v: 0.0,
            is_plugged_in: true,
        }
    }

    /// Disconnects it: nothing is drawn from it any more, and there is no voltage to measure.
    pub fn unplug(&mut self) {
        self.is_plugged_in = false;
    }

    /// Connects it.
    pub fn plug_in(&mut self) {
        self.is_plugged_in = true;
    }

    /// Whether it is connected.
    pub fn is_plugged_in(&self) -> bool {
        self.is_plugged_in
    }

    /// Overrides the resting voltage, in volts; `None` follows the charge again.
    pub fn hold_open_circuit(&mut self, voltage_v: Option<f32>) {
        self.open_circuit_v = voltage_v;
    }

    /// Whether its voltage is overridden, so that it does not follow from the charge.
    pub fn is_held(&self) -> bool {
        self.open_circuit_v.is_some()
    }

    /// Puts the first cell below the others, by this many volts.
    pub fn lower_first_cell(&mut self, drop_v: f32) {
        self.first_cell_drop_v = drop_v;
    }

    /// Changes the full capacity, in ampere-hours, and keeps the state of charge.
    pub fn set_capacity_ah(&mut self, capacity_ah: f32) {
        self.model.capacity_ah = capacity_ah;
    }

    /// Draws `current_a` for `seconds`, unless it is unplugged.
    pub fn draw(&mut self, current_a: f32, seconds: f32) {
        let current_a = if self.is_plugged_in { current_a } else { 0.0 };
        let drawn = current_a * seconds / SECONDS_PER_HOUR / self.model.capacity_ah;
        self.charge = (self.charge - drawn).clamp(0.0, 1.0);
        let settled_v = current_a * self.model.polarization_resistance_ohm;
        let step = 1.0 - (-seconds / self.model.polarization_time_s).exp();
        self.polarization_v += (settled_v - self.polarization_v) * step;
        self.current_a = current_a;
    }

    /// State of charge, 0 to 1.
    pub fn charge(&self) -> f32 {
        self.charge
    }

    /// Cells in series.
    pub fn cells(&self) -> u8 {
        self.model.cells
    }

    /// Full capacity, in ampere-hours.
    pub fn capacity_ah(&self) -> f32 {
        self.model.capacity_ah
    }

    /// Present current, in amperes.
    pub fn current_a(&self) -> f32 {
        self.current_a
    }

    /// Terminal voltage under the present load, in volts; 0 behind a plug that is out.
    pub fn voltage_v(&self) -> f32 {
        if !self.is_plugged_in {
            return 0.0;
        }
        let by_charge_v = self.model.resting_cell_voltage_v(self.charge) * f32::from(self.model.cells);
        let resting_v = self.open_circuit_v.unwrap_or(by_charge_v);
        let sag_v = self.current_a * self.model.ohmic_resistance_ohm + self.polarization_v;
        resting_v - sag_v - self.first_cell_drop_v
    }

    /// Voltage of a cell under the present load, in volts; `None` if it has no such cell.
    pub fn cell_voltage_v(&self, index: u8) -> Option<f32> {
        let sound_v = (self.voltage_v() + self.first_cell_drop_v) / f32::from(self.model.cells);
        match index {
            0 => Some(sound_v - self.first_cell_drop_v),
            _ => (index < self.model.cells).then_some(sound_v),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn full_pack_at_rest_has_4_2_v_per_cell() {
        let pack = SimulatedPack::full(PackModel::LIPO_3S_2200);
        assert!((pack.voltage_v() - 12.6).abs() < 1e-4);
    }

    #[test]
    fn nothing_is_measured_of_an_unplugged_pack_and_nothing_drawn() {
        let mut pack = SimulatedPack::charged(PackModel::LIPO_3S_2200, 0.5);
        pack.unplug();
        pack.draw(10.0, 100.0);
        assert_eq!(
            (pack.voltage_v(), pack.current_a(), pack.charge()),
            (0.0, 0.0, 0.5)
        );
        assert!(!pack.is_plugged_in());
    }

    #[test]
    fn a_cold_pack_sags_more() {
        let sag_v = |model| {
            let mut pack = SimulatedPack::full(model);
            pack.draw(4.2, 100.0);
            12.6 - pack.voltage_v()
        };
        let ratio = sag_v(PackModel::LIPO_3S_2200_COLD) / sag_v(PackModel::LIPO_3S_2200);
        // A tenth of the sag is the charge that was drawn.
        assert!((1.5..2.19).contains(&ratio), "{ratio}");
    }

    #[test]
    fn one_c_discharges_it_in_an_hour() {
        let mut pack = SimulatedPack::full(PackModel::LIPO_3S_2200);
        for _ in 0..1800 {
            pack.draw(2.2, 1.0);
        }
        assert!((pack.charge() - 0.5).abs() < 1e-3);
        for _ in 0..3600 {
            pack.draw(2.2, 1.0);
        }
        assert_eq!(pack.charge(), 0.0);
    }

    #[test]
    fn held_open_circuit_voltage_still_sags_under_load() {
        let mut pack = SimulatedPack::full(PackModel::LIPO_3S_2200);
        pack.hold_open_circuit(Some(10.0));
        assert_eq!(pack.voltage_v(), 10.0);
        for _ in 0..1800 {
            pack.draw(2.2, 1.0);
        }
        assert!((pack.voltage_v() - (10.0 - 2.2 * 0.054)).abs() < 1e-4);
        pack.hold_open_circuit(None);
        pack.draw(0.0, 1000.0);
        assert!(pack.voltage_v() > 11.3, "half charged");
    }

    #[test]
    fn pack_is_lower_by_what_its_first_cell_is_below_the_others() {
        let mut pack = SimulatedPack::full(PackModel::LIPO_3S_2200);
        pack.lower_first_cell(1.0);
        let cells_v: Vec<_> = (0..4).map_while(|cell| pack.cell_voltage_v(cell)).collect();
        for (cell_v, expected_v) in cells_v.iter().zip([3.2, 4.2, 4.2]) {
            assert!((cell_v - expected_v).abs() < 1e-4, "{cells_v:?}");
        }
        assert_eq!(cells_v.len(), 3);
        assert!((pack.voltage_v() - 11.6).abs() < 1e-4);
    }

    #[test]
    fn sag_has_an_immediate_and_a_slow_part() {
        let mut pack = SimulatedPack::full(PackModel::LIPO_3S_2200);
        let rest_v = pack.voltage_v();
        pack.draw(10.0, 0.01);
        let at_once_v = rest_v - pack.voltage_v();
        pack.draw(10.0, 40.0);
        let settled_v = rest_v - pack.voltage_v();
        assert!((at_once_v - 0.36).abs() < 0.01, "{at_once_v}");
        assert!(settled_v > at_once_v + 0.16, "{settled_v}");
    }
}
