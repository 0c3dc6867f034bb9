//! Samples the packs at 10 Hz.

use embassy_futures::yield_now;
use embassy_time::{Duration, Instant, Timer, with_timeout};

use super::drive::say;
use super::{Shared, mark};
use crate::battery::{
    BatteryBank, FAILED_READS_UNTIL_UNHEALTHY, FailsafeLevel, MAX_PACKS, Measurement, PackEvent,
    PackSettings, PackStatus, ReadError, RetainedMemory, SumVoltage, Tick, recall, retain,
};
use crate::cadence::Cadence;
use crate::liveness::CheckIn;
use crate::log::{info, warn};
use crate::mavlink::dialect::MavSeverity;
use crate::mavlink::pack_announcement;
use crate::parameter::{BatteryParameter, Pack, Parameters};
use crate::sensor::{
    AnalogIn, AnalogPin, AnalogReadings, AnalogWiring, FuelMeter, FuelReadings, MonitorKind, read_mean,
};
use crate::vehicle::FailsafeAction;

/// 10 Hz, ArduPilot's rate of `AP_BattMonitor::read`.
const SAMPLING_INTERVAL_US: u64 = 100_000;

/// Ticks are due, and readings are taken to be of, a whole millisecond: so intervals are nearly always alike, and the filters
/// need not divide anew.
const RESOLUTION_US: u64 = 1_000;

/// A read that takes longer counts as failed.
const READ_TIMEOUT: Duration = Duration::from_millis(2);

/// Of the failed reads of an unhealthy pack one in so many is logged.
const LOGGED_FAILURE: u32 = 10;

/// Once a second what has to survive a reset is written down.
const TICKS_PER_RECORD: u32 = 10;

/// For the owner, when nothing would ever count as low.
const FAILSAFES_OFF: &str = "Battery failsafes are off: set BATT_LOW_VOLT";

/// Reads the packs' pins every 100 ms, lets the monitors judge, publishes the states, and lets the vehicle act on a
/// failsafe within the tick. Ticks that could not be kept are skipped, not made up for. What was consumed goes on from
/// `memory`, if that has survived a reset.
pub async fn sample_batteries(
    mut input: impl AnalogIn,
    memory: &mut RetainedMemory,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    let kinds = shared.with_parameters(|parameters| Pack::ALL.map(|pack| MonitorKind::of(parameters, pack)));
    let mut bank = BatteryBank::new();
    if let Some(remembered) = recall(memory) {
        bank.restore(&remembered);
        info!("battery: consumption kept over the reset");
    }
    if shared.with_parameters(|parameters| are_failsafes_off(parameters, &kinds)) {
        shared.notice(MavSeverity::MAV_SEVERITY_WARNING, FAILSAFES_OFF);
    }
    let mut sensors = Sensors {
        readings: AnalogReadings::NONE,
        meters: [FuelMeter::default(); MAX_PACKS],
    };
    let start_us = Instant::now().as_micros().next_multiple_of(RESOLUTION_US);
    let mut ticks = Cadence::starting_at(start_us, SAMPLING_INTERVAL_US);
    loop {
        Timer::at(Instant::from_micros(ticks.due_us())).await;
        let now_us = Instant::now().as_micros();
        ticks.take(now_us);
        sensors.readings = read_pins(&mut input, shared, &kinds).await;
        let tick = Tick {
            now_us: now_us - now_us % RESOLUTION_US,
            arm_state: shared.with_vehicle(|vehicle| vehicle.arm_state()),
        };
        // Sums come last: they are of this tick's states.
        let in_order = || Pack::ALL.into_iter().zip(kinds);
        let measured = in_order().filter(|(_, kind)| kind.is_some_and(|kind| kind != MonitorKind::Sum));
        let sums = in_order().filter(|(_, kind)| *kind == Some(MonitorKind::Sum));
        for (pack, kind) in measured.chain(sums) {
            update(&mut bank, pack, kind, tick, &mut sensors, shared);
            // Nine packs take 3 ms: no other task should wait so long.
            yield_now().await;
        }
        shared.with_vehicle(|vehicle| vehicle.update_batteries(bank.worst_failsafe()));
        if shared.samples().is_multiple_of(TICKS_PER_RECORD) {
            retain(memory, &bank.memory());
        }
        shared.count_sample();
        mark(check_in);
    }
}

/// What the pins read in a tick, and what is remembered of tanks, by the instance of their packs.
struct Sensors {
    readings: AnalogReadings,
    meters: [FuelMeter; MAX_PACKS],
}

/// Whether packs are monitored, and none of them ever counts as low.
fn are_failsafes_off(parameters: &Parameters, kinds: &[Option<MonitorKind>; MAX_PACKS]) -> bool {
    let monitored = || {
        let packs = Pack::ALL.into_iter().zip(kinds);
        packs.filter(|(_, kind)| kind.is_some())
    };
    let is_off = |pack| {
        PackSettings::from_parameters(parameters, pack)
            .failsafe
            .is_disabled()
    };
    monitored().next().is_some() && monitored().all(|(pack, _)| is_off(pack))
}

/// Reads each pin that a pack needs, once; packs may share a pin.
async fn read_pins(
    input: &mut impl AnalogIn,
    shared: &Shared,
    kinds: &[Option<MonitorKind>; MAX_PACKS],
) -> AnalogReadings {
    let needed = shared.with_parameters(|parameters| needed_pins(parameters, kinds));
    let mut readings = AnalogReadings::NONE;
    for (pin, _) in AnalogPin::ALL
        .into_iter()
        .zip(needed)
        .filter(|(_, is_needed)| *is_needed)
    {
        let count = with_timeout(READ_TIMEOUT, read_mean(input, pin)).await;
        readings.set(pin, count.unwrap_or(Err(ReadError::Timeout)));
    }
    readings
}

fn needed_pins(
    parameters: &Parameters,
    kinds: &[Option<MonitorKind>; MAX_PACKS],
) -> [bool; AnalogPin::ALL.len()] {
    let mut needed = [false; AnalogPin::ALL.len()];
    for (pack, kind) in Pack::ALL.into_iter().zip(kinds) {
        let Some(kind) = *kind else { continue };
        for pin in AnalogWiring::from_parameters(parameters, pack).pins(kind) {
            if let Some(is_needed) = needed.get_mut(pin as usize) {
                *is_needed = true;
            }
        }
    }
    needed
}

/// Takes one pack through a tick.
fn update(
    bank: &mut BatteryBank,
    pack: Pack,
    kind: Option<MonitorKind>,
    tick: Tick,
    sensors: &mut Sensors,
    shared: &Shared,
) {
    let instance = pack.instance();
    let Some(kind) = kind else { return };
    let settings = shared.with_parameters(|parameters| PackSettings::from_parameters(parameters, pack));
    let Some(reading) = measure(bank, pack, kind, tick.now_us, sensors, shared) else {
        return;
    };
    let monitor = bank.monitor(pack);
    if let Some(percent) = shared.take_battery_reset(instance) {
        monitor.reset(percent, &settings);
    }
    let before = monitor.state().status;
    let (events, error) = monitor.update(tick, reading, &settings);
    if let Some(error) = error {
        log_failure(pack, error, monitor.failed_reads());
    }
    log_change(pack, before, monitor.state().status);
    for event in events {
        let (severity, text) = pack_announcement(pack, &event);
        info!("{}", text.as_str());
        shared.announce(severity, &text);
        if let PackEvent::Failsafe { level, .. } = event {
            act(pack, level, shared);
        }
    }
    shared.publish_battery(instance, monitor.state());
}

/// Does what the owner wants done when `pack` reaches `level`.
fn act(pack: Pack, level: FailsafeLevel, shared: &Shared) {
    let action =
        shared.with_parameters(|parameters| FailsafeAction::from_parameters(parameters, pack, level));
    if let Some(event) = shared.with_vehicle(|vehicle| vehicle.battery_failsafe(action)) {
        say(event, shared);
    }
    shared.to_drive.signal(());
}

/// `None` as long as there is nothing to measure by: a part on the bus or a motor controller that has not been asked yet, or a sum in the first
/// tick, when parts on the bus have no reading yet.
fn measure(
    bank: &BatteryBank,
    pack: Pack,
    kind: MonitorKind,
    now_us: u64,
    sensors: &mut Sensors,
    shared: &Shared,
) -> Option<Result<Measurement, ReadError>> {
    match kind {
        MonitorKind::Bus(_) | MonitorKind::Esc => return shared.take_samples(pack),
        MonitorKind::Sum if shared.samples() == 0 => return None,
        _ => {}
    }
    let Sensors { readings, meters } = sensors;
    let throttle = shared.with_vehicle(|vehicle| vehicle.effort());
    Some(shared.with_parameters(|parameters| match kind {
        MonitorKind::Sum => {
            let mask = parameters.get_whole(BatteryParameter::SumMask.of(pack)) as u16;
            bank.sum(pack, mask, SumVoltage::from_parameters(parameters, pack))
        }
        MonitorKind::Fuel(kind) => {
            let meter = meters.get_mut(usize::from(pack.instance()));
            let readings = FuelReadings {
                pins: readings,
                pulses: &shared.pulses(),
                now_us,
            };
            meter
                .ok_or(ReadError::NoPin)?
                .measure(kind, parameters, pack, &readings)
        }
        _ => AnalogWiring::from_parameters(parameters, pack).measure(kind, readings, throttle),
    }))
}

/// Once it is unhealthy, a pack's failed reads are no news; one in a second shows that they go on.
fn log_failure(pack: Pack, error: ReadError, failed_reads: u32) {
    if failed_reads <= FAILED_READS_UNTIL_UNHEALTHY || failed_reads.is_multiple_of(LOGGED_FAILURE) {
        warn!(
            "battery {}: read failed, {:?}, {} in a row",
            pack.instance() + 1,
            error,
            failed_reads
        );
    }
}

fn log_change(pack: Pack, before: PackStatus, now: PackStatus) {
    if before == now {
        return;
    }
    let number = pack.instance() + 1;
    match now {
        PackStatus::Unhealthy => warn!("battery {}: unhealthy, keeping the last good value", number),
        PackStatus::NotConnected => warn!("battery {}: not connected", number),
        PackStatus::Disabled | PackStatus::Unknown | PackStatus::Healthy => {
            info!("battery {}: {:?}", number, now)
        }
    }
}
