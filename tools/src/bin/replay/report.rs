//! The estimates for a trace, as CSV: one row a reading.
//!
//! | column | |
//! |---|---|
//! | `t_s` | as in the trace |
//! | `voltage_v`, `current_a`, `consumed_mah`, `consumed_wh`, `resistance_ohm`, `time_remaining_s` | empty while unknown |
//! | `voltage_resting_v` | while it is unknown, the voltage between the terminals |
//! | `remaining_pct` | −1 while unknown |
//! | `remaining_sigma_pct` | its standard deviation; empty while unknown |
//! | `usable_pct` | what the load can still draw, of what it can from a full pack; empty while unknown |
//! | `charge_state` | MAVLink's `MAV_BATTERY_CHARGE_STATE` |
//! | `failsafe` | 0 none, 1 unhealthy, 2 low, 3 critical |
//! | `reported_consumed_mah`, `reported_remaining_pct`, `reported_charge_state` | what the board reported then; in rows of a log of its own only, empty while unknown |
//! | `events` | what would be announced to a ground station, separated by `;`, without commas |

use rover_battmon::pack::Pack;
use std::fmt::Write;

use rover_battmon::battery::{BatteryState, PackEvent, PackNotice, ReachedLevels};
use rover_battmon_tools::recordings::entry::Reported;

const COLUMNS: &str = "t_s,voltage_v,current_a,consumed_mah,consumed_wh,resistance_ohm,voltage_resting_v,\
                       remaining_pct,remaining_sigma_pct,usable_pct,time_remaining_s,charge_state,failsafe";
const REPORTED_COLUMNS: &str = ",reported_consumed_mah,reported_remaining_pct,reported_charge_state";
const LAST_COLUMN: &str = ",events\n";

/// State after one reading.
#[derive(Clone, Debug)]
pub struct Row {
    /// Seconds since the trace's start.
    pub time_s: f64,
    /// The pack.
    pub pack: Pack,
    /// Its state.
    pub state: BatteryState,
    /// The failsafe levels that were just reached.
    pub reached: ReachedLevels,
    /// Events of this moment.
    pub events: Vec<PackEvent>,
    /// The board's own report at this moment, in a log of its own.
    pub reported: Option<Reported>,
}

/// Events, with their times in seconds since the trace's start.
pub fn events(rows: &[Row]) -> impl Iterator<Item = (f64, PackNotice<'_>)> {
    rows.iter().flat_map(|row| {
        row.events
            .iter()
            .map(|event| (row.time_s, PackNotice(row.pack, event)))
    })
}

/// The text of an event, behind the name of its pack.
fn text(event: PackNotice<'_>) -> String {
    event
        .to_string()
        .splitn(3, ' ')
        .last()
        .unwrap_or_default()
        .to_owned()
}

fn header(reported_columns: &str) -> String {
    [COLUMNS, reported_columns, LAST_COLUMN].concat()
}

/// Whether this is the beginning of such a text.
pub fn is_csv(head: &str) -> bool {
    ["", REPORTED_COLUMNS]
        .into_iter()
        .any(|reported_columns| head.starts_with(&header(reported_columns)))
}

/// The rows as text, behind a header.
pub fn csv(rows: &[Row]) -> String {
    let has_reported = rows.iter().any(|row| row.reported.is_some());
    let header = header(if has_reported { REPORTED_COLUMNS } else { "" });
    rows.iter().fold(header, |mut text, row| {
        // A String takes everything.
        let _ = writeln!(text, "{}", line(row));
        text
    })
}

fn line(row: &Row) -> String {
    let state = &row.state;
    let mut fields = vec![
        row.time_s.to_string(),
        field(state.readings.voltage_v),
        field(state.readings.current_a),
        field(state.consumed_mah()),
        field(state.consumed_wh),
        field(state.resistance_ohm),
        field(state.resting_or_terminal_voltage_v()),
        state.readings.remaining_pct.unwrap_or(-1.0).to_string(),
        field(state.readings.remaining_sigma_pct),
        field(state.readings.usable_pct),
        field(state.readings.time_remaining_s),
        (state.charge_state as u8).to_string(),
        (state.failsafe as u8).to_string(),
    ];
    if let Some(reported) = &row.reported {
        fields.extend([
            field(reported.consumed_mah),
            field(reported.remaining_pct),
            reported
                .charge_state
                .map(|state| state.to_string())
                .unwrap_or_default(),
        ]);
    }
    let events: Vec<String> = row
        .events
        .iter()
        .map(|event| text(PackNotice(row.pack, event)))
        .collect();
    fields.push(events.join(";").replace(',', ""));
    fields.join(",")
}

fn field(value: Option<f32>) -> String {
    value.map(|value| value.to_string()).unwrap_or_default()
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use rover_battmon::battery::{Amount, ChargeState, FailsafeLevel, Faults, Readings};

    /// A row of which this is known.
    pub fn row(time_s: f64, failsafe: FailsafeLevel) -> Row {
        Row {
            pack: Pack::First,
            time_s,
            state: BatteryState {
                failsafe,
                ..BatteryState::default()
            },
            reached: [failsafe].into_iter().collect(),
            events: vec![],
            reported: None,
        }
    }

    #[test]
    fn what_is_unknown_is_empty_and_the_resting_voltage_falls_back() {
        let mut row = row(0.1, FailsafeLevel::None);
        row.state.readings.voltage_v = Some(11.1);
        assert_eq!(
            csv(&[row]),
            format!("{COLUMNS}{LAST_COLUMN}0.1,11.1,,,,,11.1,-1,,,,0,0,\n")
        );
    }

    #[test]
    fn every_value_has_its_column() {
        let row = Row {
            state: BatteryState {
                readings: Readings {
                    voltage_v: Some(11.0),
                    current_a: Some(2.0),
                    resting_voltage_v: Some(12.0),
                    remaining_pct: Some(6.0),
                    remaining_sigma_pct: Some(1.5),
                    usable_pct: Some(5.0),
                    time_remaining_s: Some(7.0),
                    ..Readings::NONE
                },
                consumed: Some(Amount::Mah(3.0)),
                consumed_wh: Some(4.0),
                resistance_ohm: Some(0.5),
                charge_state: ChargeState::Critical,
                failsafe: FailsafeLevel::Low,
                ..BatteryState::default()
            },
            events: vec![
                PackEvent::Faults(Faults::CELL_FAIL | Faults::SPIKES),
                PackEvent::Charging,
            ],
            ..row(2.0, FailsafeLevel::Low)
        };
        assert_eq!(
            csv(&[row]),
            format!(
                "{COLUMNS}{LAST_COLUMN}2,11,2,3,4,0.5,12,6,1.5,5,7,3,2,fault: cell failed voltage spikes;charging\n"
            )
        );
    }

    #[test]
    fn what_the_board_reported_stands_before_the_events() {
        let row = Row {
            events: vec![PackEvent::Charging],
            reported: Some(Reported {
                consumed_mah: Some(3.5),
                charge_state: Some(2),
                ..Reported::default()
            }),
            ..row(2.0, FailsafeLevel::None)
        };
        assert_eq!(
            csv(&[row]),
            format!("{COLUMNS}{REPORTED_COLUMNS}{LAST_COLUMN}2,,,,,,,-1,,,,0,0,3.5,,2,charging\n")
        );
    }
}
