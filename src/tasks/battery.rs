//! Samples the pack at 10 Hz.

use embassy_time::{Duration, Instant, Timer, with_timeout};

use super::{Shared, mark};
use crate::battery::{BatteryMonitor, Measurement, PackStatus, ReadError};
use crate::cadence::Cadence;
use crate::liveness::CheckIn;
use crate::log::{info, warn};
use crate::parameter::ParameterId;
use crate::sensor::{AnalogIn, pack_voltage_v, read_mean};

/// 10 Hz, ArduPilot's rate of `AP_BattMonitor::read`.
const SAMPLING_INTERVAL_US: u64 = 100_000;

/// A read that takes longer counts as failed.
const READ_TIMEOUT: Duration = Duration::from_millis(2);

/// Reads `input` every 100 ms, lets the monitor judge, publishes the state. Ticks that could not be kept are skipped,
/// not made up for.
pub async fn sample_battery(mut input: impl AnalogIn, shared: &Shared, check_in: &CheckIn) -> ! {
    let mut monitor = BatteryMonitor::new();
    let mut ticks = Cadence::starting_at(Instant::now().as_micros(), SAMPLING_INTERVAL_US);
    loop {
        Timer::at(Instant::from_micros(ticks.due_us())).await;
        ticks.take(Instant::now().as_micros());

        let reading = read(&mut input, shared.parameter(ParameterId::BattVoltMult)).await;
        let before = monitor.state().status;
        if let Err(error) = monitor.update(reading) {
            let failed_reads = monitor.failed_reads();
            warn!("battery 1: read failed, {:?}, {} in a row", error, failed_reads);
        }
        log_change(before, monitor.state().status);
        shared.publish_battery(monitor.state());
        mark(check_in);
    }
}

async fn read(input: &mut impl AnalogIn, multiplier: f32) -> Result<Measurement, ReadError> {
    let count = with_timeout(READ_TIMEOUT, read_mean(input))
        .await
        .map_err(|_| ReadError::Timeout)??;
    Ok(Measurement {
        voltage_v: pack_voltage_v(count, multiplier),
    })
}

fn log_change(before: PackStatus, now: PackStatus) {
    if before == now {
        return;
    }
    match now {
        PackStatus::Unhealthy => warn!("battery 1: unhealthy, keeping the last good value"),
        PackStatus::NotConnected => warn!("battery 1: not connected"),
        PackStatus::Unknown | PackStatus::Healthy => info!("battery 1: {:?}", now),
    }
}
