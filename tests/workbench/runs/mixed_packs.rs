//! Packs of all kinds at once, each reported ten times a second.

use crate::bench::{Bench, CYCLES_PER_US, DIVIDER_CODE, SECOND, TestedVehicle};
use crate::i2c_bus::BUS;
use emulator::i2c_devices::{Ina226, Ina228, Ina3221, Pec, SmartBattery};
use emulator::{AdcInput, LogLevel};
use support::frames::{HEARTBEAT, SYS_STATUS, of_message, statuses_of};

const CURRENT_PIN: usize = 1;

/// Nine packs of all kinds.
pub const MIXED: [(&str, f32); 13] = [
    ("BATT_MONITOR", 4.0),
    ("BATT_CURR_PIN", 27.0),
    ("BATT2_MONITOR", 21.0),
    ("BATT3_MONITOR", 21.0),
    ("BATT4_MONITOR", 21.0),
    ("BATT5_MONITOR", 30.0),
    ("BATT6_MONITOR", 30.0),
    ("BATT6_CHANNEL", 2.0),
    ("BATT7_MONITOR", 30.0),
    ("BATT7_CHANNEL", 3.0),
    ("BATT8_MONITOR", 7.0),
    ("BATT9_MONITOR", 10.0),
    ("BATT9_SUM_MASK", 6.0),
];

/// What each of [`MIXED`] is expected to report.
pub const MIXED_MV: [u32; 9] = [7_901, 12_000, 11_000, 10_000, 8_000, 8_400, 7_200, 11_100, 11_500];

/// Keeps the rate of all packs for this time, with what each is expected to report.
pub fn run(parameters: &[(&str, f32)], voltages_mv: &[u32], length_us: u64) {
    let seconds = (length_us / SECOND) as usize;
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.adc_input(CURRENT_PIN, AdcInput::Code(100));
    plug_in(&mut bench);
    bench.set_all(parameters);
    bench.set("SR0_EXTRA1", 10.0);
    bench.reboot();
    bench.run_for(SECOND);

    let (from_us, awake) = (bench.time_us(), bench.awake_cycles());
    bench.run_for(length_us);
    let awake_permille = (bench.awake_cycles() - awake) * 1000 / (length_us * CYCLES_PER_US);
    let transfers = bench.i2c(BUS).take_transactions().len();
    println!(
        "{} packs, SR0_EXTRA1 10: awake {awake_permille} permille of the time, {transfers} transfers on the bus",
        voltages_mv.len()
    );
    let frames = bench.frames_since(from_us);
    for (instance, voltage_mv) in (0u8..).zip(voltages_mv) {
        let reports = statuses_of(&frames, instance);
        let count = reports.len();
        assert!(
            count.abs_diff(10 * seconds) <= 1,
            "{count} of pack {instance} in {seconds} s"
        );
        let reported_mv = reports[count - 1].sum_of_cells_mv();
        assert!(
            reported_mv.abs_diff(*voltage_mv) <= 8,
            "pack {instance}: {reported_mv} mV"
        );
    }
    assert!(of_message(&frames, SYS_STATUS).len().abs_diff(10 * seconds) <= 1);
    assert_eq!(of_message(&frames, HEARTBEAT).len(), seconds);
    let failed = bench.logged(LogLevel::Warn, "read failed");
    assert!(failed.is_empty(), "{failed:?}");
    let rates = bench.logged(LogLevel::Info, "samples/s");
    let rates: Vec<_> = rates
        .iter()
        .filter(|(time_us, _)| *time_us > from_us + SECOND)
        .collect();
    assert!(rates.len() + 2 >= seconds && rates.iter().all(|(_, line)| line.contains("10 samples/s")));
}

/// The parts on the bus for [`MIXED`].
pub fn plug_in(bench: &mut Bench) {
    let (mut monitor, mut inside, mut counting) =
        (Ina226::new(0.0005), Ina226::ina260(), Ina228::new(0.0005));
    monitor.set(12.0, 1.0);
    inside.set(11.0, 2.0);
    counting.set(10.0, 3.0, 25.0);
    let mut channels = Ina3221::new(0.0005);
    for (channel, volts) in [(1, 8.0), (2, 8.4), (3, 7.2)] {
        channels.set(channel, volts, 0.5);
    }
    let mut battery = SmartBattery::new(Pec::Right);
    battery.set(11.1, 2.0, 25.0);
    bench.i2c(BUS).attach(0x40, Box::new(monitor));
    bench.i2c(BUS).attach(0x41, Box::new(inside));
    bench.i2c(BUS).attach(0x44, Box::new(counting));
    bench.i2c(BUS).attach(0x42, Box::new(channels));
    bench.i2c(BUS).attach(0x0b, Box::new(battery));
}
