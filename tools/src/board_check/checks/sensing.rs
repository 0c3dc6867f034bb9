//! Measurements of the board.

use rover_battmon::mavlink::dialect::{MavSysStatusSensor, SYS_STATUS_DATA};
use rover_battmon::parameter::{BatteryParameter, MonitorKind};
use rover_battmon::sensor::ADC_REFERENCE_V;

use super::check::{Check, Outcome, failed, judge_trial, not_measured, outcome, passed};
use crate::board_check::evidence::{Calibration, Evidence, boards_own, mean};

/// The board's report of its sensors.
pub(super) const SENSORS: Check = Check {
    name: "sensor health",
    measures: "battery and motor outputs in SYS_STATUS's sensor bits",
    expected: "present, enabled and healthy",
    advice: "The board's texts name the reason; see docs/troubleshooting.md.",
    judge: judge_sensors,
};

const EXPECTED_SENSORS: [(MavSysStatusSensor, &str); 2] = [
    (MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_BATTERY, "battery"),
    (
        MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS,
        "motor outputs",
    ),
];

fn judge_sensors(evidence: &Evidence) -> Outcome {
    let mut statuses = evidence.sys_statuses().peekable();
    if statuses.peek().is_none() {
        return not_measured("no SYS_STATUS");
    }
    let unhealthy = statuses.find_map(unhealthy);
    outcome(
        unhealthy.map_or("healthy".into(), |name| format!("{name} not healthy")),
        unhealthy.map(|name| format!("The {name} is absent, off or not healthy.")),
    )
}

fn unhealthy(status: &SYS_STATUS_DATA) -> Option<&'static str> {
    let fit = status.onboard_control_sensors_present
        & status.onboard_control_sensors_enabled
        & status.onboard_control_sensors_health;
    let mut expected = EXPECTED_SENSORS.into_iter();
    expected
        .find(|(sensor, _)| !fit.contains(*sensor))
        .map(|(_, name)| name)
}

/// A pack that reads this share of full scale, 3.3 V behind the divider, is beyond it.
const END_OF_SCALE: f32 = 0.99;

/// Per cell, of any chemistry.
const LOWEST_CELL_V: f32 = 0.9;
const HIGHEST_CELL_V: f32 = 4.4;

/// Is the voltage plausible?
pub(super) const VOLTAGE: Check = Check {
    name: "voltage",
    measures: "the first pack's mean voltage",
    expected: "below the converter's end (3.3 V × `BATT_VOLT_MULT`), and 0.9 to 4.4 V a cell if `BATT_CELLS` is set",
    advice: "Set `BATT_CELLS` and `BATT_VOLT_PIN`; measure the pack with a multimeter and run with `--multimeter`.",
    judge: judge_voltage,
};

/// The kind of monitor of the first pack.
fn monitor_kind(evidence: &Evidence) -> Option<MonitorKind> {
    MonitorKind::from_number(evidence.parameter("BATT_MONITOR")? as i32)
}

fn judge_voltage(evidence: &Evidence) -> Outcome {
    let Some(mean_v) = mean(&evidence.voltages_v()) else {
        return not_measured("no pack is connected");
    };
    let is_analog = matches!(
        monitor_kind(evidence),
        Some(MonitorKind::AnalogVoltage | MonitorKind::AnalogVoltageAndCurrent)
    );
    let multiplier = evidence.parameter("BATT_VOLT_MULT").filter(|_| is_analog);
    let is_at_end =
        multiplier.is_some_and(|multiplier| mean_v >= END_OF_SCALE * ADC_REFERENCE_V * multiplier);
    let cells = evidence.parameter("BATT_CELLS").filter(|cells| *cells > 0.0);
    let cell_v = cells.map(|cells| mean_v / cells);
    let against = if is_at_end {
        Some("The voltage is at the end of the converter's range.")
    } else {
        let is_off = cell_v.is_some_and(|cell_v| !(LOWEST_CELL_V..=HIGHEST_CELL_V).contains(&cell_v));
        is_off.then_some("The voltage does not fit the number of cells.")
    };
    let of_cell = cell_v.map_or("cells not set".into(), |cell_v| format!("{cell_v:.2} V a cell"));
    outcome(format!("{mean_v:.2} V, {of_cell}"), against)
}

/// Do the motor drivers stand the pack?
pub(super) const MOTOR_DRIVERS: Check = Check {
    name: "motor drivers",
    measures: "the first pack's mean voltage beside `MOT_DRV_VOLT`",
    expected: "not above, if the pack is at the board's divider",
    advice: "Switch off. Find the driver chips, read their marking, and look up the motor supply that they stand: \
             docs/hardware.md, Motors. Unless they stand the pack, give the motors another supply; then set `MOT_DRV_VOLT`.",
    judge: judge_motor_drivers,
};

fn judge_motor_drivers(evidence: &Evidence) -> Outcome {
    let Some(mean_v) = mean(&evidence.voltages_v()) else {
        return not_measured("no pack is connected");
    };
    let Some(limit_v) = evidence.parameter("MOT_DRV_VOLT") else {
        return not_measured("it has no MOT_DRV_VOLT");
    };
    let is_at_divider = monitor_kind(evidence).is_some_and(MonitorKind::reads_voltage_pin)
        && evidence.parameter("BATT_VOLT_PIN") == Some(boards_own(BatteryParameter::VoltPin));
    let is_above = is_at_divider && limit_v > 0.0 && mean_v > limit_v;
    outcome(
        format!("{mean_v:.2} V, limit {limit_v:.2} V"),
        is_above.then_some("The pack may burn the motor drivers, armed or not."),
    )
}

const WORST_DEVIATION_V: f32 = 0.02;

/// Is the voltage steady?
pub(super) const VOLTAGE_NOISE: Check = Check {
    name: "voltage noise",
    measures: "standard deviation and span of the first pack's voltage, standing still",
    expected: "at most 20 mV: 8.7 effective bits behind the divider are 31 mV in one conversion, a quarter of that in the \
               mean of 16",
    advice: "Let the rover stand still, without a charger; check ground and plugs.",
    judge: judge_voltage_noise,
};

fn judge_voltage_noise(evidence: &Evidence) -> Outcome {
    let voltages_v = evidence.voltages_v();
    let Some(mean_v) = mean(&voltages_v) else {
        return not_measured("no pack is connected");
    };
    let squares: Vec<_> = voltages_v.iter().map(|v| (v - mean_v).powi(2)).collect();
    let deviation_v = mean(&squares).unwrap_or(0.0).sqrt();
    let (lowest_v, highest_v) = voltages_v
        .iter()
        .fold((f32::MAX, f32::MIN), |(lowest, highest), v| {
            (lowest.min(*v), highest.max(*v))
        });
    outcome(
        format!(
            "{:.1} mV, span {:.0} mV",
            deviation_v * 1e3,
            (highest_v - lowest_v) * 1e3
        ),
        (deviation_v > WORST_DEVIATION_V).then_some("The voltage is noisy."),
    )
}

const WORST_OFFSET_V: f32 = 0.2;

/// Once it is exact, noise and the multimeter's last digit remain.
const WORST_APPLIED_OFFSET_V: f32 = 0.05;

/// Is the voltage right?
pub(super) const CALIBRATION: Check = Check {
    name: "calibration",
    measures: "the voltage shown beside a multimeter's; offers the exact `BATT_VOLT_MULT`",
    expected: "within 0.2 V (docs/parity.md), within 0.05 V with `--apply`; `BATT_VOLT_MULT` within 15 % of the one in force, or of \
               the board's own divider",
    advice: "Run with `--apply`, or set the value that is offered; with `--divider-changed` if the divider is another one.",
    judge: judge_calibration,
};

fn judge_calibration(evidence: &Evidence) -> Outcome {
    judge_trial(&evidence.calibration, "--multimeter or --voltage", judge_measured)
}

fn judge_measured(calibration: &Calibration) -> Outcome {
    let Some(measured_v) = calibration.measured_v else {
        return not_measured("no voltage was given");
    };
    let (Some(shown_v), Some(old), Some(exact)) = (calibration.shown_v, calibration.old, calibration.exact())
    else {
        return not_measured("no pack is connected, or it has no BATT_VOLT_MULT");
    };
    let measured = format!(
        "{shown_v:.2} V shown, {measured_v:.2} V measured: BATT_VOLT_MULT {exact:.3} is exact, {old:.3} was set"
    );
    if let Some(applied) = calibration.applied {
        return judge_applied(
            &format!("{measured}, {applied:.3} is now"),
            calibration,
            measured_v,
        );
    }
    if calibration.believed().is_none() {
        return failed(
            measured,
            "The multimeter's value is not believed, so nothing was set.",
        );
    }
    let is_off = (shown_v - measured_v).abs() > WORST_OFFSET_V;
    outcome(
        measured,
        is_off.then(|| format!("The voltage is off: set BATT_VOLT_MULT to {exact:.3}.")),
    )
}

fn judge_applied(measured: &str, calibration: &Calibration, measured_v: f32) -> Outcome {
    match calibration.shown_since_v {
        Some(shown_v) if (shown_v - measured_v).abs() <= WORST_APPLIED_OFFSET_V => {
            passed(format!("{measured}, {shown_v:.2} V shown"))
        }
        _ => failed(measured, "The voltage is off although BATT_VOLT_MULT was set."),
    }
}
