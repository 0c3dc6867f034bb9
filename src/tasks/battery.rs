//! Samples the pack at 10 Hz.

use embassy_time::{Duration, Instant, Timer, with_timeout};

use super::{Shared, mark};
use crate::battery::{BatteryMonitor, BatteryState, Measurement, PackStatus, ReadError};
use crate::cadence::Cadence;
use crate::liveness::CheckIn;
use crate::log::{info, warn};
use crate::parameter::ParameterId;
use crate::sensor::{AnalogIn, AnalogPin, VoltageDivider, read_mean};

/// 10 Hz, ArduPilot's rate of `AP_BattMonitor::read`.
const SAMPLING_INTERVAL_US: u64 = 100_000;

/// A read that takes longer counts as failed.
const READ_TIMEOUT: Duration = Duration::from_millis(2);

/// `BATT_MONITOR`: the battery is not monitored.
const MONITOR_DISABLED: i32 = 0;

/// Reads the pack's pin every 100 ms, lets the monitor judge, publishes the state. Ticks that could not be kept are
/// skipped, not made up for.
pub async fn sample_battery(mut input: impl AnalogIn, shared: &Shared, check_in: &CheckIn) -> ! {
    let disabled = shared.whole_parameter(ParameterId::BattMonitor) == MONITOR_DISABLED;
    let mut monitor = BatteryMonitor::new();
    let mut ticks = Cadence::starting_at(Instant::now().as_micros(), SAMPLING_INTERVAL_US);
    loop {
        Timer::at(Instant::from_micros(ticks.due_us())).await;
        ticks.take(Instant::now().as_micros());
        if disabled {
            shared.publish_battery(0, &BatteryState::disabled());
        } else {
            sample(&mut input, shared, &mut monitor).await;
        }
        shared.count_sample();
        mark(check_in);
    }
}

async fn sample(input: &mut impl AnalogIn, shared: &Shared, monitor: &mut BatteryMonitor) {
    let reading = read(input, shared).await;
    let before = monitor.state().status;
    if let Err(error) = monitor.update(reading) {
        let failed_reads = monitor.failed_reads();
        warn!("battery 1: read failed, {:?}, {} in a row", error, failed_reads);
    }
    log_change(before, monitor.state().status);
    shared.publish_battery(0, &monitor.state());
}

async fn read(input: &mut impl AnalogIn, shared: &Shared) -> Result<Measurement, ReadError> {
    let pin =
        AnalogPin::from_gpio(shared.whole_parameter(ParameterId::BattVoltPin)).ok_or(ReadError::NoPin)?;
    let divider = VoltageDivider {
        multiplier: shared.parameter(ParameterId::BattVoltMult),
        offset_v: shared.parameter(ParameterId::BattVltOffset),
    };
    let count = with_timeout(READ_TIMEOUT, read_mean(input, pin))
        .await
        .map_err(|_| ReadError::Timeout)??;
    Ok(Measurement {
        voltage_v: Some(divider.pack_voltage_v(count)),
        ..Measurement::default()
    })
}

fn log_change(before: PackStatus, now: PackStatus) {
    if before == now {
        return;
    }
    match now {
        PackStatus::Unhealthy => warn!("battery 1: unhealthy, keeping the last good value"),
        PackStatus::NotConnected => warn!("battery 1: not connected"),
        PackStatus::Disabled | PackStatus::Unknown | PackStatus::Healthy => info!("battery 1: {:?}", now),
    }
}
