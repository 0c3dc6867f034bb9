//! Cells: chemistries, their limits and their discharge curves.

use core::ops::RangeInclusive;

/// A cell that rests within this of its last rest was neither charged nor used, in volts: some percent of its charge.
pub const SAME_VOLTAGE_V: f32 = 0.015;

/// Points of a curve: 0 %, 5 %, …, 100 %.
pub const POINTS: usize = 21;

/// Open-circuit voltage of a cell, in volts, in steps of 5 %; strictly increasing.
#[derive(Debug)]
pub struct Curve(pub [f32; POINTS]);

const SEGMENTS: usize = POINTS - 1;

impl Curve {
    /// The voltage at a state of charge from 0 to 1, in volts.
    pub fn voltage_v(&self, state_of_charge: f32) -> f32 {
        let position = state_of_charge.clamp(0.0, 1.0) * SEGMENTS as f32;
        let segment = (position as usize).min(SEGMENTS - 1);
        let (low_v, high_v) = self.ends(segment);
        low_v + (position - segment as f32) * (high_v - low_v)
    }

    fn ends(&self, segment: usize) -> (f32, f32) {
        let point = |number: usize| self.0.get(number).copied().unwrap_or_default();
        (point(segment), point(segment + 1))
    }
}

/// Cell chemistry, with the numbers of MAVLink's `MAV_BATTERY_TYPE` and `BATT_CHEM`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum Chemistry {
    /// Lithium polymer.
    #[default]
    LiPo = 1,
    /// Lithium iron phosphate.
    LiFe = 2,
    /// Lithium ion, in cylindrical cells such as the 18650.
    LiIon = 3,
    /// Nickel metal hydride.
    NiMh = 4,
}

/// Typical parameters of a cell, fresh, at about 25 °C. Curves are from machine-readable copies of the papers; in brackets their
/// names in PyBaMM. Voltage limits are the usual ones of data sheets.
#[derive(Debug)]
pub struct Cell {
    /// Resting voltage against state of charge.
    pub curve: Curve,
    /// Standard deviation of curves of different makes, with half the hysteresis, in volts.
    pub curve_sigma_v: f32,
    /// By how much cells of other makes rest below the curve at most, in volts.
    pub lowest_make_v: f32,
    /// Ohmic resistance times capacity, in Ω·Ah: the immediate voltage drop at 1 C.
    pub ohmic_drop_v: f32,
    /// The additional slow drop of a lasting load, relative to that.
    pub slow_share: f32,
    /// Standard deviation of that.
    pub slow_share_sigma: f32,
    /// Mean sag relative to the standard deviation of the voltage while driving.
    pub sag_by_variation: f32,
    /// Limits of the reserve for a sag: how much the sag grows towards the end, in volts, and the reserve itself. Where the curve
    /// is flat a little more sag would take away half of the charge.
    pub max_growth_v: f32,
    pub max_reserve: f32,
    /// Nominal voltage as printed on packs, in volts.
    pub nominal_v: f32,
    /// Usual end-of-charge voltage, in volts; `None` where chargers do not end by voltage.
    pub charged_v: Option<f32>,
    /// Only a full cell keeps this voltage for half a minute at rest, in volts; `None` where the curve is steep enough to show that,
    /// or no such voltage is known.
    pub full_v: Option<f32>,
    /// Maximum voltage of a sound cell, in volts.
    pub max_v: f32,
    /// Usual threshold of a low pack under a moderate load, in volts: about a fifth of the charge is left.
    pub low_v: f32,
    /// Usual threshold of a critical pack under a moderate load, in volts: far below, cells are damaged.
    pub critical_v: f32,
    /// Deep discharge: below this a cell at rest takes damage, in volts.
    pub deep_discharge_v: f32,
    /// Minimum plausible voltage at rest, in volts: below it, chemistry or cell count are set wrong.
    pub min_v: f32,
}

/// Error of the charge that a gauge reports, relative to the capacity: assumed.
const GAUGE_ERROR: f32 = 0.1;

impl Cell {
    /// The lowest resting voltage at this state of charge, from 0 to 1, in volts: of any make, of a gauge that is a tenth
    /// off, and as long as a cell recovers from a load of 1 C.
    pub fn lowest_resting_v(&self, state_of_charge: f32) -> f32 {
        let charge = (state_of_charge - GAUGE_ERROR).max(0.0);
        self.curve.voltage_v(charge) - self.lowest_make_v - self.lasting_drop_v()
    }

    /// The highest resting voltage at this state of charge, from 0 to 1, in volts, likewise: after a charge of 1 C.
    pub fn highest_resting_v(&self, state_of_charge: f32) -> f32 {
        let charge = (state_of_charge + GAUGE_ERROR).min(1.0);
        self.curve.voltage_v(charge) + self.lowest_make_v + self.lasting_drop_v()
    }

    /// Steady-state voltage drop at 1 C, in volts.
    pub fn lasting_drop_v(&self) -> f32 {
        self.ohmic_drop_v * (1.0 + self.slow_share)
    }
}

impl Chemistry {
    /// The chemistry with this `MAV_BATTERY_TYPE`.
    pub fn from_number(number: i32) -> Option<Self> {
        [Self::LiPo, Self::LiFe, Self::LiIon, Self::NiMh]
            .into_iter()
            .find(|chemistry| *chemistry as i32 == number)
    }

    /// Nominal cell voltage, in volts.
    pub fn nominal_cell_voltage_v(self) -> f32 {
        self.cell().nominal_v
    }

    /// Usual end-of-charge cell voltage, in volts; `None` where chargers do not end by voltage.
    pub fn charged_cell_voltage_v(self) -> Option<f32> {
        self.cell().charged_v
    }

    /// The voltages at which a sound cell can rest, in volts.
    pub fn resting_cell_voltages_v(self) -> RangeInclusive<f32> {
        let cell = self.cell();
        cell.min_v..=cell.max_v
    }

    pub(super) fn cell(self) -> &'static Cell {
        match self {
            Self::LiPo => &LIPO,
            Self::LiFe => &LIFE,
            Self::LiIon => &LIION,
            Self::NiMh => &NIMH,
        }
    }
}

/// Curve: mean of a graphite/LiCoO2 pouch cell of 2.28 Ah (Ai et al. 2020, doi:10.1149/2.0122001JES, `Ai2020`) and the hobbyists'
/// "LiPo voltage chart" (blog.ampow.com), which is 38 mV above it. The lowest make are NMC pouches, left out of the curve: 75 to
/// 120 mV lower at 50 %. The drop is some 9 mΩ for 2.2 Ah, and 3 mΩ of leads and plugs. 4.35 V is for high-voltage cells.
static LIPO: Cell = Cell {
    curve: Curve([
        3.135, 3.576, 3.665, 3.688, 3.712, 3.734, 3.752, 3.769, 3.781, 3.798, 3.817, 3.831, 3.853, 3.889,
        3.929, 3.966, 4.007, 4.061, 4.099, 4.144, 4.200,
    ]),
    curve_sigma_v: 0.030,
    lowest_make_v: 0.120,
    ohmic_drop_v: 0.026,
    slow_share: 0.5,
    slow_share_sigma: 0.5,
    sag_by_variation: 1.2,
    max_growth_v: 0.1,
    max_reserve: 0.5,
    nominal_v: 3.7,
    charged_v: Some(4.2),
    full_v: None,
    max_v: 4.35,
    low_v: 3.5,
    critical_v: 3.4,
    deep_discharge_v: 3.0,
    min_v: 2.0,
};

/// Curve: mean of three cells (a 26650 of 2.3 Ah, Safari and Delacourt 2011, doi:10.1149/1.3567007; Lithium Werks APR18650M1B,
/// Sunil et al. 2025; BPX's `lfp_18650_cell_BPX.json`, About:Energy 2022), up to 40 mV apart. The drop is 10 mΩ × 2.3 Ah, by
/// A123's data sheet. A cell at 70 % that has just left its charger shows 3.45 V.
static LIFE: Cell = Cell {
    curve: Curve([
        2.170, 3.092, 3.194, 3.218, 3.240, 3.260, 3.276, 3.284, 3.289, 3.292, 3.295, 3.299, 3.303, 3.310,
        3.318, 3.325, 3.330, 3.333, 3.337, 3.345, 3.589,
    ]),
    curve_sigma_v: 0.020,
    lowest_make_v: 0.040,
    ohmic_drop_v: 0.023,
    slow_share: 1.0,
    slow_share_sigma: 0.7,
    sag_by_variation: 1.7,
    max_growth_v: 0.1,
    max_reserve: 0.5,
    nominal_v: 3.2,
    charged_v: Some(3.65),
    full_v: Some(3.5),
    max_v: 3.8,
    low_v: 3.0,
    critical_v: 2.8,
    deep_discharge_v: 2.5,
    min_v: 1.8,
};

/// Curve: mean of five sources, up to 126 mV apart (LG M50: Chen et al. 2020, doi:10.1149/1945-7111/ab9050, `Chen2020`, and
/// O'Regan et al. 2022, doi:10.1016/j.electacta.2022.140700, `ORegan2022`; Molicel P42A and Samsung 40T: Sunil et al. 2025, IEEE
/// Trans. Instrum. Meas., `soorajsunil/Piecewise-Battery-OCV`; graphite/NCA: Kim et al. 2011, doi:10.1149/1.3597614,
/// `NCA_Kim2011`). The drop is 50 mΩ × 2.9 Ah sustained, two thirds of it at once. The slow share is measured: load steps of an
/// 18650 reach 1, 1.5, 1.9 and 3.1 times the sag of the first second after 10, 100 and 1000 s, from 25 to −20 °C. That of the
/// other chemistries is assumed.
#[expect(clippy::approx_constant, reason = "3.141 V is not π")]
static LIION: Cell = Cell {
    curve: Curve([
        2.541, 3.141, 3.295, 3.395, 3.449, 3.502, 3.555, 3.599, 3.638, 3.676, 3.720, 3.766, 3.816, 3.869,
        3.921, 3.969, 4.018, 4.063, 4.089, 4.117, 4.199,
    ]),
    curve_sigma_v: 0.055,
    lowest_make_v: 0.126,
    ohmic_drop_v: 0.09,
    slow_share: 1.75,
    slow_share_sigma: 0.9,
    sag_by_variation: 2.2,
    max_growth_v: 1.0,
    max_reserve: 1.0,
    nominal_v: 3.6,
    charged_v: Some(4.2),
    full_v: None,
    max_v: 4.35,
    low_v: 3.3,
    critical_v: 3.0,
    deep_discharge_v: 2.5,
    min_v: 1.8,
};

/// Curve: mean of NREL's ADVISOR data sets `ESS_NiMH7_rc_temp.m` (Panasonic 6.5 Ah, measured), `ESS_AnnexVII_SHEV_NIMH28.m` (Ovonic
/// 28 Ah, without its charge-increasing branch) and `ESS_NIMH93.m` (calculated by A. F. Burke), up to 50 mV apart; the lowest make
/// has half of the hysteresis of 90 mV. The drop is some 6 mΩ × 3 Ah, an estimate for a sub-C cell. At 1.45 V a charge of 14 to 16 h
/// ends, relaxed cells have at most 1.4 V (VARTA V 250 H, definitions).
static NIMH: Cell = Cell {
    curve: Curve([
        1.193, 1.218, 1.244, 1.258, 1.272, 1.282, 1.292, 1.299, 1.305, 1.308, 1.310, 1.316, 1.321, 1.327,
        1.332, 1.338, 1.344, 1.358, 1.372, 1.388, 1.404,
    ]),
    curve_sigma_v: 0.050,
    lowest_make_v: 0.095,
    ohmic_drop_v: 0.018,
    slow_share: 1.0,
    slow_share_sigma: 0.7,
    sag_by_variation: 1.7,
    max_growth_v: 0.1,
    max_reserve: 0.5,
    nominal_v: 1.2,
    charged_v: None,
    full_v: Some(1.45),
    max_v: 1.65,
    low_v: 1.1,
    critical_v: 1.0,
    deep_discharge_v: 0.9,
    min_v: 0.8,
};

/// All of them.
#[cfg(test)]
pub const CHEMISTRIES: [Chemistry; 4] = [
    Chemistry::LiPo,
    Chemistry::LiFe,
    Chemistry::LiIon,
    Chemistry::NiMh,
];

#[cfg(test)]
mod tests {
    use super::CHEMISTRIES;

    #[test]
    // Requirement: PX-2
    fn every_curve_is_strictly_increasing() {
        for chemistry in CHEMISTRIES {
            let points = &chemistry.cell().curve.0;
            assert!(points.is_sorted_by(|low, high| low < high), "{chemistry:?}");
        }
    }
}
