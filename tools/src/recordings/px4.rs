//! PX4's parameters by the names that the monitor has for them.

use rover_battmon::pack::Pack;
use rover_battmon::parameter::BatteryParameter;

/// MAV_AUTOPILOT_PX4.
pub const AUTOPILOT: u8 = 12;

/// A share of 1 in percent.
const PERCENT: f64 = 100.0;

/// PX4's thresholds hold for all packs.
const OF_ALL: [(&str, BatteryParameter, f64); 3] = [
    ("BAT_LOW_THR", BatteryParameter::LowPct, PERCENT),
    ("BAT_CRIT_THR", BatteryParameter::CrtPct, PERCENT),
    ("BAT_EMERGEN_THR", BatteryParameter::EmrPct, PERCENT),
];

/// These have the number of a pack behind `BAT`; older versions have one pack only.
const OF_PACK: [(&str, BatteryParameter); 2] = [
    ("_N_CELLS", BatteryParameter::Cells),
    ("_CAPACITY", BatteryParameter::Capacity),
];

/// Parameters of PX4 up to 1.10, with those that replace them. Later versions keep the older ones, whose values mean nothing.
const REPLACED: [(&str, &str); 2] = [("BAT_N_CELLS", "BAT1_N_CELLS"), ("BAT_CAPACITY", "BAT1_CAPACITY")];

/// The older parameter that a parameter replaces.
pub fn replaced_by(name: &str) -> Option<&'static str> {
    let (older, _) = REPLACED.iter().find(|(_, newer)| name == *newer)?;
    Some(older)
}

/// Whether a parameter counts only if another one is missing.
pub fn is_older(name: &str) -> bool {
    REPLACED.iter().any(|(older, _)| name == *older)
}

/// The parameters of packs that a parameter of PX4 is, with their values; negative is unknown.
pub fn translated(name: &str, value: f64) -> Vec<(String, f64)> {
    let named =
        |pack: Pack, parameter: BatteryParameter, value| (parameter.of(pack).name().to_string(), value);
    if let Some((_, parameter, factor)) = OF_ALL.iter().find(|(of_all, ..)| *of_all == name) {
        let packs = Pack::ALL.into_iter();
        // A share of 0.15 is a single of 32 bits.
        let value = (value * factor * 1e4).round() / 1e4;
        return packs.map(|pack| named(pack, *parameter, value)).collect();
    }
    let of_pack = || {
        let rest = name.strip_prefix("BAT")?;
        let (end, parameter) = OF_PACK.iter().find(|(end, _)| rest.ends_with(end))?;
        let number = rest.strip_suffix(end)?;
        let number = if number.is_empty() { "1" } else { number };
        let mut packs = Pack::ALL.into_iter();
        let pack = packs.find(|pack| pack.number().to_string() == number)?;
        Some(named(pack, *parameter, value))
    };
    of_pack().filter(|_| value > 0.0).into_iter().collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn thresholds_are_of_all_packs_and_cells_of_one() {
        let low = translated("BAT_LOW_THR", f64::from(0.15_f32));
        assert_eq!(low.len(), Pack::ALL.len());
        assert_eq!(low[1], ("BATT2_LOW_PCT".into(), 15.0));
        let one = |name, value| translated(name, value).pop();
        assert_eq!(one("BAT2_N_CELLS", 4.0), Some(("BATT2_CELLS".into(), 4.0)));
        assert_eq!(one("BAT_N_CELLS", 3.0), Some(("BATT_CELLS".into(), 3.0)));
        assert_eq!(
            one("BAT1_CAPACITY", 5200.0),
            Some(("BATT_CAPACITY".into(), 5200.0))
        );
        for (name, value) in [
            ("BAT1_CAPACITY", -1.0),
            ("BAT1_R_INTERNAL", 0.01),
            ("COM_N_CELLS", 3.0),
        ] {
            assert_eq!(one(name, value), None, "{name}");
        }
    }
}
