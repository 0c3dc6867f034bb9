//! The columns of the table: everything that is said of them, and the file's schema, derives from these.

use super::identity::Identity;
use super::row::Row;

/// A column.
pub struct Column {
    /// Its name, with the unit.
    pub name: &'static str,
    /// Its meaning and unit.
    pub meaning: &'static str,
    /// Its content in a row.
    pub value: Value,
}

/// The type of a column, and how a row's value is found. `None` is unknown.
pub enum Value {
    /// Text.
    Text(fn(&Row) -> Option<String>),
    /// A whole number.
    Whole(fn(&Row) -> Option<i32>),
    /// A number.
    Number(fn(&Row) -> Option<f64>),
    /// Whether something is so.
    Flag(fn(&Row) -> Option<bool>),
    /// A moment of UTC, in seconds since 1970.
    Moment(fn(&Row) -> Option<f64>),
}

/// Separator of the texts of a list.
const SEPARATOR: &str = "; ";

const fn column(name: &'static str, meaning: &'static str, value: Value) -> Column {
    Column { name, meaning, value }
}

/// All columns, in their order.
pub const COLUMNS: &[Column] = &[
    column("path", "the log", Value::Text(|row| Some(row.path.clone()))),
    column(
        "vehicle",
        "as rover, boat, copter",
        Value::Text(|row| row.vehicle.kind.clone()),
    ),
    column(
        "firmware",
        "rover-battmon, ArduPilot, PX4",
        Value::Text(|row| row.vehicle.firmware.clone()),
    ),
    column(
        "version",
        "its version",
        Value::Text(|row| row.vehicle.version.clone()),
    ),
    column(
        "board_id",
        "the board's USB serial number",
        Value::Text(|row| row.board_id.clone()),
    ),
    column(
        "system_id",
        "MAVLink's id of the rover (`SYSID_THISMAV`)",
        Value::Whole(|row| row.system_id),
    ),
    column(
        "pack",
        "number of the pack on this rover, 1 to 9",
        Value::Whole(|row| Some(row.pack.into())),
    ),
    column(
        "pack_id",
        "serial number of the pack, of its gauge or as set (`BATT_SERIAL_NUM`)",
        Value::Text(|row| row.serial_number.map(|number| number.to_string())),
    ),
    column(
        "pack_key",
        "the pack by `pack_id`, else `board_id` and `pack`, else folder and `pack`; never NULL",
        Value::Text(|row| Some(Identity::of(row).to_string())),
    ),
    column("start_utc", "arming, UTC", Value::Moment(|row| row.start_utc_s)),
    column(
        "duration_s",
        "from arming to disarming or the end, s",
        Value::Number(|row| Some(row.duration_s)),
    ),
    column(
        "armed_before",
        "why the log is taken to begin armed",
        Value::Text(|row| Some(row.armed_before?.to_string())),
    ),
    column(
        "complete",
        "neither damage nor backward times up to the disarming",
        Value::Flag(|row| Some(row.complete)),
    ),
    column(
        "drawn_mah",
        "charge drawn, mAh",
        Value::Number(|row| row.drawn_mah),
    ),
    column("drawn_wh", "energy drawn, Wh", Value::Number(|row| row.drawn_wh)),
    column(
        "rest_min_v",
        "lowest resting voltage, V",
        Value::Number(|row| row.rest_min_v),
    ),
    column(
        "sag_max_v",
        "most that the voltage was below it, V",
        Value::Number(|row| row.sag_max_v),
    ),
    column(
        "temperature_min_c",
        "lowest temperature of the pack, °C",
        Value::Number(|row| row.temperature_min_c),
    ),
    column(
        "temperature_max_c",
        "the highest, °C",
        Value::Number(|row| row.temperature_max_c),
    ),
    column(
        "resistance_mohm",
        "resistance of the pack by load steps, mean over the drive, mΩ",
        Value::Number(|row| row.resistance_mohm.value),
    ),
    column(
        "resistance_sigma_mohm",
        "its standard deviation over the drive, mΩ",
        Value::Number(|row| row.resistance_mohm.sigma),
    ),
    column(
        "capacity_mah",
        "learnt capacity by the next drive or the end, mAh",
        Value::Number(|row| row.capacity_mah.value),
    ),
    column(
        "capacity_sigma_mah",
        "its standard deviation, mAh",
        Value::Number(|row| row.capacity_mah.sigma),
    ),
    column(
        "health_pct",
        "state of health then, learnt, else recorded, %",
        Value::Number(|row| row.health_pct.value),
    ),
    column(
        "health_sigma_pct",
        "its standard deviation, by that of the capacity, %",
        Value::Number(|row| row.health_pct.sigma),
    ),
    column(
        "failsafes",
        "failsafes as recorded, with seconds since arming: `low 412 s; critical 530 s`, also `unhealthy`, `battery`, `sticks`, `ground station`",
        Value::Text(|row| Some(row.failsafes.join(SEPARATOR))),
    ),
    column(
        "arming_refusals",
        "why arming was refused since the drive before",
        Value::Text(|row| Some(row.arming_refusals.join(SEPARATOR))),
    ),
    column(
        "faults",
        "faults of the pack by MAVLink's names and the log's further ones",
        Value::Text(|row| {
            let names: Vec<&str> = row.faults.iter_names().map(|(name, _)| name).collect();
            Some(names.join(SEPARATOR))
        }),
    ),
    column(
        "low_s",
        "seconds from arming until the pack is low: recorded by this firmware, else replayed; NULL: it is not",
        Value::Number(|row| row.levels.low_s),
    ),
    column(
        "critical_s",
        "the same until it is critical",
        Value::Number(|row| row.levels.critical_s),
    ),
    column(
        "timers",
        "their timers, alike: `low started 402 s; low tripped 412 s`, also `reset`",
        Value::Text(|row| Some(row.timers.join(SEPARATOR))),
    ),
    column(
        "log_timers",
        "the same, if recorded",
        Value::Text(|row| (!row.recorded_timers.is_empty()).then(|| row.recorded_timers.join(SEPARATOR))),
    ),
    column(
        "failsafes_differ",
        "levels that a log of others has at another time than replayed",
        Value::Text(|row| Some(row.differences.join(SEPARATOR))),
    ),
    column(
        "remaining_pct",
        "remaining charge at the end, replayed, %",
        Value::Number(|row| row.remaining.replayed_pct),
    ),
    column(
        "log_remaining_pct",
        "the same, recorded, %",
        Value::Number(|row| row.remaining.recorded_pct),
    ),
    column(
        "low_remaining_pct",
        "at `low_s`, %",
        Value::Number(|row| row.remaining_low.replayed_pct),
    ),
    column(
        "log_low_remaining_pct",
        "the same, recorded, %",
        Value::Number(|row| row.remaining_low.recorded_pct),
    ),
    column(
        "critical_remaining_pct",
        "at `critical_s`, %",
        Value::Number(|row| row.remaining_critical.replayed_pct),
    ),
    column(
        "log_critical_remaining_pct",
        "the same, recorded, %",
        Value::Number(|row| row.remaining_critical.recorded_pct),
    ),
    column(
        "what_if",
        "the parameters of `--param`",
        Value::Text(|row| Some(row.what_if.as_ref()?.parameters.clone())),
    ),
    column(
        "what_if_low_s",
        "`low_s` with these, replayed: good to one reading",
        Value::Number(|row| row.what_if.as_ref()?.levels.low_s),
    ),
    column(
        "what_if_critical_s",
        "`critical_s` with these",
        Value::Number(|row| row.what_if.as_ref()?.levels.critical_s),
    ),
];

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::path::Path;

    /// Has the columns.
    const PAGE: &str = "../docs/fleet.md";

    #[test]
    fn the_page_has_these_columns() {
        let rows = COLUMNS.iter().map(|column| {
            let (name, meaning) = (column.name, column.meaning);
            format!("- `{name}`: {meaning}\n")
        });
        let list: String = rows.collect();
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join(PAGE);
        let page = fs::read_to_string(path).expect("the page");
        assert!(page.contains(&list), "{PAGE} has to have\n{list}");
    }

    #[test]
    fn what_is_unknown_of_a_drive_is_null() {
        let row = Row::default();
        let unknown = COLUMNS.iter().filter(|column| match column.value {
            Value::Text(value) => value(&row).is_none(),
            Value::Whole(value) => value(&row).is_none(),
            Value::Number(value) | Value::Moment(value) => value(&row).is_none(),
            Value::Flag(value) => value(&row).is_none(),
        });
        let known = [
            "path",
            "pack",
            "pack_key",
            "duration_s",
            "complete",
            "failsafes",
            "timers",
            "failsafes_differ",
            "arming_refusals",
            "faults",
        ];
        assert_eq!(unknown.count(), COLUMNS.len() - known.len());
    }
}
