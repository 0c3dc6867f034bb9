//! Faults and charge states, with the bits and numbers of MAVLink, and what a pack reports of them itself.

use bitflags::bitflags;

bitflags! {
    /// Faults of a pack, with the bits of MAVLink's `MAV_BATTERY_FAULT`, which has no others than [`Faults::MAVLINK`].
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Faults: u16 {
        /// The cells are discharged below their safe minimum.
        const DEEP_DISCHARGE = 1;
        /// The voltage exceeded the cells' maximum.
        const SPIKES = 2;
        /// The cells are out of balance, or one has failed.
        const CELL_FAIL = 4;
        /// The load exceeds `BATT_WATT_MAX` by a tenth, with the load limited as far as it can be.
        const OVER_CURRENT = 8;
        /// The pack is too hot.
        const OVER_TEMPERATURE = 16;
        /// The pack is too cold.
        const UNDER_TEMPERATURE = 32;
        /// The packs of a sum rest at different voltages.
        const INCOMPATIBLE_VOLTAGE = 64;
        /// The pack reports that its firmware does not fit.
        const INCOMPATIBLE_FIRMWARE = 128;
        /// The resting voltage does not fit `BATT_CELLS` cells of this chemistry, or may be that of more cells than it is usual for;
        /// or the pack reports other cells than it should have.
        const CELLS_CONFIGURATION = 256;
        /// The pack reports a short circuit.
        const SHORT_CIRCUIT = 1 << 9;
        /// The pack reports that its protection has switched it off.
        const SWITCHED_OFF = 1 << 10;
        /// Each cell rests higher than any of its chemistry does at the charge that the pack reports. It refuses nothing.
        const UNDERSTATED_CHARGE = 1 << 11;
        /// A cell differs from another at rest, without having failed yet.
        const CELL_DIFFERS = 1 << 12;
        /// The pack reports that it is bad: it must not be used.
        const BAD_BATTERY = 1 << 13;
        /// The pack reports that it has to be serviced.
        const NEEDS_SERVICE = 1 << 14;
        /// A cell rests lower than any of its chemistry does at the charge that the pack reports.
        const CONTRADICTED_CHARGE = 1 << 15;
    }
}

impl Faults {
    /// Faults with a bit in MAVLink.
    pub const MAVLINK: Self = Self::from_bits_retain(0x1ff);

    /// Faults that make a sufficiently charged pack FAILED: it must not be used.
    pub const FAILING: Self = Self::CELL_FAIL;

    /// Faults that make a sufficiently charged pack UNHEALTHY.
    pub const UNFIT: Self = Self::CELLS_CONFIGURATION.union(Self::OVER_TEMPERATURE);

    /// The charge that the pack reports does not fit its resting cells.
    pub const CONTRADICTIONS: Self = Self::CONTRADICTED_CHARGE.union(Self::UNDERSTATED_CHARGE);

    /// The faults by a device's own flags; the table has the mask of those that mean each.
    pub fn of_flags(flags: u32, table: &[(u32, Self)]) -> Self {
        let set = table.iter().filter(|(mask, _)| flags & mask != 0);
        set.fold(Self::empty(), |faults, (_, fault)| faults | *fault)
    }
}

/// Charge state, with the numbers of MAVLink's `MAV_BATTERY_CHARGE_STATE`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
pub enum ChargeState {
    /// Unknown.
    #[default]
    Undefined = 0,
    /// Sufficient.
    Ok = 1,
    /// Warn the driver.
    Low = 2,
    /// Stop soon.
    Critical = 3,
    /// Stop now to avoid damage to the pack.
    Emergency = 4,
    /// The pack has failed; see its faults.
    Failed = 5,
    /// The sensor or the pack has a fault; see its faults.
    Unhealthy = 6,
    /// The pack is being charged.
    Charging = 7,
}

impl ChargeState {
    /// The state with this number; `None` if that is unknown, or none.
    pub fn from_number(number: u8) -> Option<Self> {
        Some(match number {
            1 => Self::Ok,
            2 => Self::Low,
            3 => Self::Critical,
            4 => Self::Emergency,
            5 => Self::Failed,
            6 => Self::Unhealthy,
            7 => Self::Charging,
            _ => return None,
        })
    }
}

bitflags! {
    /// Modes of a pack, as it reports them.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
    pub struct Modes: u8 {
        /// It is fully charged.
        const FULL = 1;
        /// It balances its cells.
        const BALANCING = 2;
        /// It discharges itself to the level for storage.
        const STORING = 4;
        /// It switches itself off when its protection finds a fault.
        const PROTECTED = 8;
    }
}

/// Report of a pack's gauge beside its charge. It is logged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GaugeReport {
    /// Error of the state of charge, in percent: SBS's MaxError, or DroneCAN's standard deviation.
    pub error_pct: Option<u8>,
    /// Number of times that the pack was discharged too deeply.
    pub over_discharges: Option<u16>,
    /// Energy that is left, and that of the full pack, in watt-hours.
    pub energies_wh: Option<[f32; 2]>,
}

impl GaugeReport {
    /// Nothing.
    pub const NONE: Self = Self {
        error_pct: None,
        over_discharges: None,
        energies_wh: None,
    };
}

/// Condition as reported by the pack, or by another component that measures it. It is shown, and its faults are
/// announced; none of them changes what is found here. A failed cell, [`Faults::BAD_BATTERY`] and the states EMERGENCY,
/// FAILED and UNHEALTHY make a pack unfit for use. Chargers report none of these.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Reported {
    /// Faults.
    pub faults: Faults,
    /// Charge state.
    pub charge_state: Option<ChargeState>,
    /// Modes.
    pub modes: Modes,
    /// Report of its gauge.
    pub gauge: GaugeReport,
}

impl Reported {
    /// Nothing.
    pub const NONE: Self = Self {
        faults: Faults::empty(),
        charge_state: None,
        modes: Modes::empty(),
        gauge: GaugeReport::NONE,
    };

    /// Whether there is more than faults and a charge state.
    pub fn has_details(&self) -> bool {
        !self.modes.is_empty() || self.gauge != GaugeReport::NONE
    }
}
