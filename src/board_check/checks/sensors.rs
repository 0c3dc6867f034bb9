//! What does it say of its sensors?

use super::check::{Check, Outcome, not_measured, outcome};
use crate::board_check::evidence::Evidence;
use crate::mavlink::dialect::{MavSysStatusSensor, SYS_STATUS_DATA};

pub(super) const CHECK: Check = Check {
    name: "sensor health",
    measures: "battery and motor outputs in SYS_STATUS's sensor bits",
    expected: "present, enabled and healthy",
    advice: "The board's texts name the reason; see docs/guides/troubleshooting.md.",
    judge,
};

const EXPECTED: [(MavSysStatusSensor, &str); 2] = [
    (MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_BATTERY, "battery"),
    (
        MavSysStatusSensor::MAV_SYS_STATUS_SENSOR_MOTOR_OUTPUTS,
        "motor outputs",
    ),
];

fn judge(evidence: &Evidence) -> Outcome {
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
    let mut expected = EXPECTED.into_iter();
    expected
        .find(|(sensor, _)| !fit.contains(*sensor))
        .map(|(_, name)| name)
}
