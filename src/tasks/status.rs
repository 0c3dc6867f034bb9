//! Log lines of each second, and the processor's load.

use embassy_time::{Duration, Ticker};

use super::{CheckIn, Link, Shared, mark, now};
use crate::battery::{BatteryState, PackStatus};
use crate::log::info;
use crate::pack::Pack;

const REPORT_INTERVAL: Duration = Duration::from_secs(1);

/// Measures the load over each second and logs voltage, rates and load. `idle_us` says for how many microseconds the processor
/// had nothing to do since boot, modulo 2^32.
pub async fn report_status(idle_us: fn() -> u32, shared: &Shared, link: &Link<'_>, check_in: &CheckIn) -> ! {
    let mut seconds = Ticker::every(REPORT_INTERVAL);
    let mut before = Snapshot::take(idle_us(), shared, link);
    loop {
        seconds.next().await;
        let now = Snapshot::take(idle_us(), shared, link);
        shared.with(|autopilot| autopilot.set_load(now.load_permille_since(&before)));
        log(shared, link, &now, &before);
        before = now;
        mark(check_in);
    }
}

struct Snapshot {
    time_us: u32,
    idle_us: u32,
    samples: u32,
    sent: u32,
    sent_bytes: u32,
    dropped: u32,
}

impl Snapshot {
    fn take(idle_us: u32, shared: &Shared, link: &Link<'_>) -> Self {
        let statistics = link.statistics();
        Self {
            time_us: now().as_micros() as u32,
            idle_us,
            samples: shared.with(|autopilot| autopilot.samples()),
            sent: statistics.sent,
            sent_bytes: statistics.sent_bytes,
            dropped: statistics.dropped,
        }
    }

    fn load_permille_since(&self, before: &Self) -> u16 {
        let elapsed_us = self.time_us.wrapping_sub(before.time_us).max(1);
        let idle_us = self.idle_us.wrapping_sub(before.idle_us).min(elapsed_us);
        let busy_us = elapsed_us - idle_us;
        // At most 1000, and a second of microseconds times 1000 fits u32 with room for a late tick.
        let load_permille = busy_us.checked_div(elapsed_us.div_ceil(1000));
        load_permille.unwrap_or(0).min(1000) as u16
    }
}

fn log(shared: &Shared, link: &Link<'_>, now: &Snapshot, before: &Snapshot) {
    shared.with(|autopilot| {
        let packs = Pack::ALL.into_iter();
        packs.for_each(|pack| log_pack(pack, autopilot.battery(pack)));
    });
    info!(
        "{} samples/s; {}: {} frames/s, {} bytes/s, {} dropped; load {} permille",
        now.samples.wrapping_sub(before.samples),
        link.name(),
        now.sent.wrapping_sub(before.sent),
        now.sent_bytes.wrapping_sub(before.sent_bytes),
        now.dropped.wrapping_sub(before.dropped),
        shared.with(|autopilot| autopilot.load_permille()),
    );
}

fn log_pack(pack: Pack, battery: &BatteryState) {
    if battery.status == PackStatus::Disabled {
        return;
    }
    let voltage_v = battery.readings.voltage_v;
    let voltage_mv = voltage_v.map(|voltage_v| (voltage_v * 1000.0) as u32);
    info!(
        "battery {}: {:?} {:?} mV",
        pack.number(),
        battery.status,
        voltage_mv
    );
}
