use proptest::prelude::*;

use super::*;
use crate::time::{Instant, at_us};
use crate::{
    Amount, BusError, CellVoltages, ChargeState, Chemistry, Contents, Counted, FailsafeLevel, Faults, Gauge,
    GaugeReading, LEARNT_WORDS, LessonObstacle, LoadState, PackDetails, Reported, Supply, Thermometer,
    Thresholds,
};

mod another_pack;
mod changed_scale;
mod collapse;
mod counters;
mod current_range;
mod doubtful_cells;
mod lost_current;
mod missing_voltage;
mod rests;
mod rover;
mod sources;

/// A monitor with its settings and clock.
struct MonitorBench {
    monitor: BatteryMonitor,
    state: BatteryState,
    settings: PackSettings,
    now: Instant,
    load_state: LoadState,
    events: Vec<PackEvent>,
}

impl MonitorBench {
    /// A 3S LiPo pack of 2200 mAh.
    fn new() -> Self {
        Self {
            monitor: BatteryMonitor::new(),
            state: BatteryState::default(),
            settings: PackSettings {
                cell_count: Some(3),
                capacity_mah: Some(2200.0),
                ..PackSettings::default()
            },
            now: Instant::EPOCH,
            load_state: LoadState::Off,
            events: Vec::new(),
        }
    }

    fn tick(&mut self, reading: Result<Measurement, ReadError>) -> Option<ReadError> {
        self.tick_after(0.1, reading)
    }

    /// Takes a reading some seconds after the tick before.
    fn tick_after(&mut self, seconds: f32, reading: Result<Measurement, ReadError>) -> Option<ReadError> {
        self.now = self.now.after_us((seconds * 1e6) as u64);
        let tick = Tick {
            now: self.now,
            load_state: self.load_state,
        };
        let update = self
            .monitor
            .update(&mut self.state, tick, reading, &self.settings);
        self.events.extend(update.events);
        update.error
    }

    /// Repeats a reading for some seconds, and returns the state.
    fn run(&mut self, seconds: f32, measurement: Measurement) -> BatteryState {
        for _ in 0..(seconds * 10.0) as u32 {
            self.tick(Ok(measurement));
        }
        self.state
    }

    /// A battery reset.
    fn reset(&mut self, remaining_pct: f32) {
        self.monitor
            .reset(&mut self.state, self.load_state, remaining_pct, &self.settings);
    }

    /// The record of the pack in RAM.
    fn record(&self) -> PackMemory {
        let memory = self.monitor.memory(self.state.status, PackSource::default());
        PackMemory::from_words(&memory.to_words())
    }

    /// The record after a loss of power.
    fn record_without_power(&self) -> PackMemory {
        let mut memory = self.record();
        memory.lose_power();
        memory
    }

    /// Another one that starts with this memory.
    fn started(&self, memory: &PackMemory) -> Self {
        let mut after = Self::new();
        after.settings = self.settings;
        after.monitor.restore(memory);
        after
    }

    /// Another one after a processor reset, with what is retained.
    fn after_processor_reset(&self) -> Self {
        self.started(&self.record())
    }

    /// Another one after a loss of power that RAM has outlasted.
    fn after_power_loss(&self) -> Self {
        self.started(&self.record_without_power())
    }

    /// The board restarts; nothing is retained.
    fn restart(&mut self) {
        self.monitor = BatteryMonitor::new();
        self.state = BatteryState::default();
    }

    /// The number of its announcements.
    fn count_of(&self, event: PackEvent) -> usize {
        self.events.iter().filter(|other| **other == event).count()
    }
}

#[track_caller]
fn assert_about(value: Option<f32>, expected: f32, tolerance: f32) {
    let is_about = value.is_some_and(|value| (value - expected).abs() < tolerance);
    assert!(is_about, "{value:?} instead of {expected}");
}

fn volts(voltage_v: f32) -> Measurement {
    Measurement {
        voltage_v: Some(voltage_v),
        ..Measurement::default()
    }
}

fn loaded(voltage_v: f32, current_a: f32) -> Measurement {
    Measurement {
        current_a: Some(current_a),
        ..volts(voltage_v)
    }
}

#[test]
// Requirement: AP-14
fn fifth_failed_read_in_a_row_is_unhealthy_and_values_are_held() {
    let since_boot = (None, PackStatus::Unknown);
    for (voltage_v, before) in [since_boot, (Some(11.1), PackStatus::Healthy)] {
        let mut bench = MonitorBench::new();
        if let Some(voltage_v) = voltage_v {
            bench.tick(Ok(volts(voltage_v)));
        }
        for failure in 1..=7 {
            assert_eq!(bench.tick(Err(ReadError::Timeout)), Some(ReadError::Timeout));
            let expected = if failure < 5 {
                before
            } else {
                PackStatus::Unhealthy
            };
            assert_eq!(bench.state.status, expected, "failure {failure}");
            assert_eq!(bench.state.readings.voltage_v, voltage_v);
        }
        assert_eq!(bench.state.charge_state, ChargeState::Unhealthy);
        assert_eq!(bench.tick(Ok(volts(10.9))), None);
        assert_eq!(bench.state.readings.voltage_v, Some(10.9));
        for _ in 1..=4 {
            assert_eq!(bench.state.status, PackStatus::Healthy);
            bench.tick(Err(ReadError::Conversion));
        }
        assert_eq!(bench.state.status, PackStatus::Healthy);
    }
}

#[test]
// Requirement: PX-5
fn usb_power_alone_is_not_connected() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, volts(2.09));
    assert_eq!(bench.state.status, PackStatus::NotConnected);
    assert_eq!(bench.state.readings.voltage_v, None);
    assert_eq!(bench.state.readings.remaining_pct, None);
    assert_eq!(bench.state.charge_state, ChargeState::Undefined);
    bench.tick(Ok(volts(11.1)));
    assert_eq!(bench.state.status, PackStatus::Healthy);
    assert!(
        bench.events.is_empty(),
        "the first pack is not a swap: {:?}",
        bench.events
    );
}

#[test]
// Requirement: S-3
fn impossible_values_count_as_failed_reads() {
    let impossible_count = Measurement {
        counted: Some(Counted::TotalCharge(i32::MAX as f32)),
        ..volts(6.0)
    };
    for measurement in [volts(f32::NAN), loaded(11.1, f32::INFINITY), impossible_count] {
        let mut bench = MonitorBench::new();
        bench.tick(Ok(volts(11.1)));
        assert_eq!(bench.tick(Ok(measurement)), Some(ReadError::Implausible));
        assert_eq!(bench.state.readings.voltage_v, Some(11.1));
        assert_eq!(bench.monitor.failed_reads(), 1);
    }
}

#[test]
fn armed_without_current_sensor_charge_takes_30_seconds() {
    let mut bench = MonitorBench::new();
    bench.load_state = LoadState::On;
    assert_eq!(bench.run(29.0, volts(10.9)).readings.remaining_pct, None);
    assert!(bench.run(2.0, volts(11.3)).readings.remaining_pct.is_some());
}

#[test]
fn charge_is_unknown_on_the_flat_part_of_a_curve() {
    let mut bench = MonitorBench::new();
    bench.settings.chemistry = Chemistry::LiFe;
    assert_eq!(bench.run(2.0, volts(3.0 * 3.295)).readings.remaining_pct, None);
    let mut bench = MonitorBench::new();
    bench.settings.chemistry = Chemistry::LiFe;
    let readings = bench.run(2.0, volts(3.0 * 3.05)).readings;
    let nearly_empty_pct = readings.remaining_pct.expect("known at the steep end");
    assert!(nearly_empty_pct < 8.0, "{nearly_empty_pct}");
}

#[test]
fn without_voltage_only_a_battery_reset_sets_the_charge() {
    let current_only = Measurement {
        current_a: Some(2.2),
        ..Measurement::default()
    };
    let mut bench = MonitorBench::new();
    assert_eq!(bench.run(10.0, current_only).readings.remaining_pct, None);
    bench.reset(50.0);
    // 36 s at 1 C are one percent.
    let readings = bench.run(36.0, current_only).readings;
    assert_about(readings.remaining_pct, 49.0, 0.05);
}

#[test]
// Requirement: AP-15
fn remaining_time_follows_the_average_load() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, loaded(12.6, 0.2));
    bench.reset(100.0);
    let readings = bench.run(600.0, loaded(11.9, 2.2)).readings;
    // One hour at this load, less ten minutes and the reserve for a sag of a quarter of a volt a cell: a sixth.
    assert_about(readings.time_remaining_s, 2400.0, 100.0);
    assert_about(readings.average_current_a, 2.2, 0.01);
}

#[test]
// Requirement: PX-6, L-11
fn another_resting_voltage_after_a_contact_loss_while_disarmed_is_a_swap() {
    let no_pack = Ok(loaded(0.3, 0.0));
    let no_sensor = Err(ReadError::Bus(BusError::NoAnswer));
    for (lost, ticks, load_state, rests_at_v, is_swap) in [
        // 9 % higher and 9 % lower.
        (no_pack, 10, LoadState::Off, 12.2, true),
        (no_pack, 10, LoadState::Off, 10.2, true),
        (no_sensor, 20, LoadState::Off, 12.2, true),
        // It may have recovered from its load meanwhile.
        (no_pack, 100, LoadState::Off, 12.0, false),
        (no_sensor, 100, LoadState::Off, 12.0, false),
        (no_pack, 8, LoadState::Off, 12.2, false),
        (no_pack, 0, LoadState::Off, 12.2, false),
        (no_pack, 20, LoadState::On, 12.2, false),
    ] {
        let mut bench = MonitorBench::new();
        bench.run(60.0, loaded(11.1, 5.0));
        bench.run(5.0, loaded(11.2, 0.0));
        bench.load_state = load_state;
        for _ in 0..ticks {
            bench.tick(lost);
        }
        bench.load_state = LoadState::Off;
        // It is found at its rest.
        let state = bench.run(1.5, loaded(rests_at_v, 0.2));
        assert!(state.consumed_mah().expect("counted") > 80.0);
        let state = bench.run(5.0, loaded(rests_at_v, 0.2));
        let what = format!("{lost:?} {ticks} {load_state:?} {rests_at_v}: {:?}", bench.events);
        assert_eq!(bench.events.contains(&PackEvent::Swapped), is_swap, "{what}");
        assert_eq!(state.consumed_mah().expect("counted") < 1.0, is_swap, "{what}");
    }
}

#[test]
// Requirement: PX-7, S-7, L-8
fn pack_lost_while_armed_is_unhealthy_after_5_seconds() {
    let mut bench = MonitorBench::new();
    bench.load_state = LoadState::On;
    bench.run(10.0, loaded(11.5, 5.0));
    bench.run(4.9, loaded(0.4, 0.0));
    assert_eq!(bench.state.failsafe, FailsafeLevel::None);
    bench.run(0.3, loaded(0.4, 0.0));
    assert_eq!(bench.state.failsafe, FailsafeLevel::Unhealthy);
    assert_eq!(bench.events[0], PackEvent::ContactLost);
    let PackEvent::Failsafe {
        level: FailsafeLevel::Unhealthy,
        voltage_v: Some(11.5),
        consumed: Some(Amount::Mah(drawn_mah)),
    } = bench.events[1]
    else {
        panic!("{:?}", bench.events);
    };
    assert_about(Some(drawn_mah), 14.0, 0.5);
}

/// A bench with a latched critical level, disarmed and at rest.
fn latched() -> MonitorBench {
    let mut bench = MonitorBench::new();
    bench.settings.failsafe.timer_s = Some(1.0);
    bench.settings.failsafe.low.voltage_v = Some(10.5);
    bench.settings.failsafe.critical.voltage_v = Some(9.9);
    bench.load_state = LoadState::On;
    bench.run(10.0, loaded(9.5, 5.0));
    assert_eq!(bench.state.failsafe, FailsafeLevel::Critical);
    bench.load_state = LoadState::Off;
    bench.run(10.0, loaded(10.0, 0.0));
    bench
}

#[test]
// Requirement: L-5
fn failsafe_level_is_cleared_only_by_a_fuller_pack() {
    let cases: [(&[f32], FailsafeLevel); 5] = [
        (&[10.0], FailsafeLevel::Critical),
        // Above all thresholds, but within recovery, also after a low reading through a bad wire.
        (&[10.7], FailsafeLevel::Critical),
        (&[8.0, 10.7, 8.5, 10.7], FailsafeLevel::Critical),
        (&[9.0], FailsafeLevel::Critical),
        (&[11.5], FailsafeLevel::None),
    ];
    for (rests_at_v, expected) in cases {
        let mut bench = latched();
        for rests_at_v in rests_at_v {
            bench.run(3.0, loaded(0.3, 0.0));
            bench.run(10.0, loaded(*rests_at_v, 0.0));
        }
        assert_eq!(bench.state.failsafe, expected, "{rests_at_v:?}");
    }
}

#[test]
// Requirement: L-7
fn one_reading_without_a_pack_does_not_trip_charge() {
    let mut bench = MonitorBench::new();
    bench.settings.failsafe.critical.remaining_mah = Some(300.0);
    // Empty by its count, but not by its voltage: it was charged meanwhile.
    bench.reset(0.0);
    bench.monitor.estimator = Estimator::new();
    bench.run(3.0, loaded(12.2, 0.1));
    bench.load_state = LoadState::On;
    bench.run(1.0, loaded(12.2, 1.0));
    bench.tick(Ok(loaded(0.3, 0.0)));
    assert_eq!(bench.state.failsafe, FailsafeLevel::None);
}

#[test]
fn battery_reset_sets_charge_and_consumption() {
    let mut bench = MonitorBench::new();
    bench.run(60.0, loaded(11.4, 5.0));
    bench.reset(56.0);
    bench.tick(Ok(loaded(11.4, 0.0)));
    assert_about(bench.state.readings.remaining_pct, 56.0, 0.01);
    assert_about(bench.state.consumed_mah(), 0.44 * 2200.0, 0.1);
    assert_about(bench.state.consumed_wh, 0.44 * 2.2 * 11.4, 0.01);
}

#[test]
fn critical_voltage_setting_is_in_the_state() {
    let mut bench = MonitorBench::new();
    bench.tick(Ok(volts(11.4)));
    assert_eq!(bench.state.critical_voltage_v, None);
    bench.settings.failsafe.critical.voltage_v = Some(9.9);
    bench.tick(Err(ReadError::Timeout));
    assert_eq!(bench.state.critical_voltage_v, Some(9.9));
}

#[test]
fn gap_in_readings_is_counted_and_announced() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, loaded(11.4, 3.6));
    let before_mah = bench.state.consumed_mah().unwrap();
    for _ in 0..100 {
        bench.tick(Err(ReadError::Timeout));
    }
    bench.tick(Ok(loaded(11.4, 3.6)));
    assert_about(bench.state.consumed_mah(), before_mah + 10.1, 0.01);
    assert!(
        matches!(bench.events[..], [PackEvent::SensorFailed(_), PackEvent::Gap(_)]),
        "{:?}",
        bench.events
    );
}

#[test]
// Requirement: PX-8, AP-10
fn faults_begin_and_end() {
    let at_c = |temperature_c| Measurement {
        temperature_c: Some(temperature_c),
        ..volts(11.4)
    };
    let of_device = |temperature_c| Measurement {
        thermometer: Thermometer::Device,
        ..at_c(temperature_c)
    };
    let cases = [
        (volts(3.0 * 2.8), Faults::DEEP_DISCHARGE),
        (volts(3.0 * 4.4), Faults::SPIKES | Faults::CELLS_CONFIGURATION),
        (
            volts(3.0 * 1.9),
            Faults::DEEP_DISCHARGE | Faults::CELLS_CONFIGURATION,
        ),
        (loaded(11.1, 20.0), Faults::OVER_CURRENT),
        (at_c(70.0), Faults::OVER_TEMPERATURE),
        (at_c(-30.0), Faults::UNDER_TEMPERATURE),
        (of_device(90.0), Faults::empty()),
        (of_device(-30.0), Faults::empty()),
        (
            Measurement {
                cells: CellVoltages::from_millivolts(&[3900, 3900, 3500]),
                ..volts(11.3)
            },
            Faults::CELL_FAIL,
        ),
    ];
    for (measurement, expected) in cases {
        let mut bench = MonitorBench::new();
        bench.settings.overload_w = Some(200.0);
        assert_eq!(bench.run(1.0, loaded(11.4, 1.0)).readings.faults, Faults::empty());
        assert_eq!(bench.run(3.5, measurement).readings.faults, expected);
        let sound = Measurement {
            current_a: Some(1.0),
            ..at_c(25.0)
        };
        let after = bench.run(3.5, sound).readings.faults;
        assert_eq!(after, Faults::empty(), "{expected:?} stays");
    }
}

#[test]
// Requirement: L-21
fn a_hot_pack_stays_hot_while_its_temperature_is_unknown() {
    let at_c = |temperature_c| Measurement {
        temperature_c,
        ..loaded(11.4, 0.1)
    };
    let hot = || {
        let mut bench = MonitorBench::new();
        bench.run(3.0, at_c(Some(70.0)));
        bench
    };
    let faults = |bench: &MonitorBench| bench.state.readings.faults;
    // Unknown, of a device, failed, and unplugged.
    let device = Measurement {
        thermometer: Thermometer::Device,
        ..at_c(Some(30.0))
    };
    for reading in [
        Ok(at_c(None)),
        Ok(device),
        Err(ReadError::Timeout),
        Ok(loaded(0.2, 0.0)),
    ] {
        for load_state in [LoadState::Off, LoadState::On] {
            let mut bench = hot();
            bench.load_state = load_state;
            for _ in 0..600 {
                bench.tick(reading);
            }
            assert_eq!(faults(&bench), Faults::OVER_TEMPERATURE, "{reading:?}");
            bench.run(3.0, at_c(None));
            assert_eq!(faults(&bench), Faults::OVER_TEMPERATURE, "{reading:?}");
            bench.run(3.0, at_c(Some(40.0)));
            assert_eq!(faults(&bench), Faults::empty(), "{reading:?}");
        }
    }
    let mut bench = hot().after_processor_reset();
    assert_eq!(
        bench.run(3.0, at_c(None)).readings.faults,
        Faults::OVER_TEMPERATURE
    );
    bench.monitor.forget_temperature();
    assert_eq!(bench.run(0.1, at_c(None)).readings.faults, Faults::empty());
    // Another pack.
    let mut bench = hot();
    bench.run(2.0, loaded(0.2, 0.0));
    bench.run(5.0, volts(12.5));
    assert_eq!(faults(&bench), Faults::empty());
}

#[test]
fn cells_that_differ_at_rest_are_a_fault_until_the_next_rest_and_refuse_nothing() {
    let mut bench = MonitorBench::new();
    let with = |lowest_mv, current_a| Measurement {
        cells: CellVoltages::from_millivolts(&[3900, 3900, lowest_mv]),
        ..loaded(11.5, current_a)
    };
    let under_load = bench.run(10.0, with(3650, 5.0)).readings.faults;
    assert_eq!(under_load, Faults::empty());
    let at_rest = bench.run(10.0, with(3650, 0.0));
    assert_eq!(at_rest.readings.faults, Faults::CELL_DIFFERS);
    let under_load = bench.run(10.0, with(3900, 5.0)).readings.faults;
    assert_eq!(under_load, Faults::CELL_DIFFERS);
    assert_eq!(bench.run(10.0, with(3720, 0.0)).readings.faults, Faults::empty());
}

#[test]
// Requirement: S-3
fn an_impossible_temperature_is_unknown_and_the_rest_of_its_reading_counts() {
    use Thermometer::{Device, Pack};
    for (thermometer, temperature_c, is_possible) in [
        (Pack, -40.1, false),
        (Pack, -40.0, true),
        (Pack, 125.0, true),
        (Pack, 125.1, false),
        (Device, -40.1, false),
        (Device, 125.1, true),
        (Device, 200.0, true),
        (Device, 200.1, false),
        (Device, 6279.4, false),
        (Pack, f32::NAN, false),
        (Pack, f32::INFINITY, false),
    ] {
        let mut bench = MonitorBench::new();
        let measurement = Measurement {
            temperature_c: Some(temperature_c),
            thermometer,
            ..volts(11.1)
        };
        assert_eq!(bench.tick(Ok(measurement)), None);
        assert_eq!(bench.state.readings.voltage_v, Some(11.1));
        let expected = is_possible.then_some(temperature_c);
        assert_eq!(bench.state.temperature_c, expected, "{thermometer:?}");
        let of_pack = expected.filter(|_| thermometer == Pack);
        assert_eq!(bench.state.pack_temperature_c(), of_pack, "{thermometer:?}");
    }
}

#[test]
fn a_charge_is_not_that_of_other_cells_set_meanwhile_or_before_a_reset() {
    let mut before = MonitorBench::new();
    let remaining_pct =
        |bench: &mut MonitorBench| bench.run(1.1, volts(8.2)).readings.remaining_pct.expect("known");
    assert!(remaining_pct(&mut before) < 5.0);
    for (cell_count, expected_pct) in [(3, 0.0..5.0), (2, 80.0..100.0)] {
        let mut after = before.after_processor_reset();
        after.settings.cell_count = Some(cell_count);
        let after_pct = remaining_pct(&mut after);
        assert!(expected_pct.contains(&after_pct), "{cell_count}: {after_pct} %");
    }
    before.settings.cell_count = Some(2);
    assert!(remaining_pct(&mut before) > 80.0);
}

#[test]
// Requirement: PX-8
fn a_spike_is_a_short_fault_and_wrong_cells_are_none() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, volts(12.0));
    bench.settings.cell_count = Some(2);
    assert_eq!(bench.run(0.5, volts(12.0)).readings.faults, Faults::empty());
    let faults = bench.run(2.0, volts(12.0)).readings.faults;
    assert_eq!(faults, Faults::CELLS_CONFIGURATION);
    bench.settings.cell_count = Some(3);
    assert_eq!(bench.run(2.0, volts(12.0)).readings.faults, Faults::empty());
    assert_eq!(bench.run(0.1, volts(14.0)).readings.faults, Faults::SPIKES);
    assert_eq!(bench.state.charge_state, ChargeState::Ok);
    assert_eq!(bench.run(2.0, volts(12.0)).readings.faults, Faults::empty());
}

/// A smart battery with 2000 of 2600 mAh left.
fn smart(voltage_v: f32) -> Measurement {
    Measurement {
        voltage_v: Some(voltage_v),
        current_a: Some(3.6),
        gauge: GaugeReading::Read(Gauge {
            remaining_mah: 2000.0,
            full_mah: 2600.0,
        }),
        cells: CellVoltages::from_millivolts(&[3900, 3900, 3900]),
        details: PackDetails {
            serial_number: Some(4711),
            chemistry: Some(Chemistry::LiIon),
            ..PackDetails::default()
        },
        ..Measurement::default()
    }
}

#[test]
fn smart_battery_overrides_charge_capacity_and_cells_and_a_battery_reset() {
    let mut bench = MonitorBench::new();
    for _ in 0..100 {
        assert_eq!(bench.tick(Ok(smart(11.7))), None);
    }
    let state = bench.state;
    assert_eq!(state.consumed_mah(), Some(600.0));
    assert_eq!(state.capacity_mah(), Some(2600.0));
    assert_about(state.readings.remaining_pct, 76.92, 0.01);
    assert_eq!(state.charge_source, ChargeSource::Gauge);
    assert_eq!((state.cell_count, state.serial_number), (Some(3), Some(4711)));
    assert_eq!(state.chemistry, Chemistry::LiIon);
    // Its energy is integrated: 9.9 s of 42.12 W.
    assert_about(state.consumed_wh, 9.9 * 42.12 / 3600.0, 1e-4);
    // 2 Ah at 3.6 A.
    assert_about(state.readings.time_remaining_s, 2000.0, 0.1);
    bench.reset(100.0);
    bench.tick(Ok(smart(11.7)));
    assert_eq!(bench.state.consumed_mah(), Some(600.0));
}

#[test]
fn reported_charge_is_used_without_a_capacity_and_its_count_without_energy() {
    let mut bench = MonitorBench::new();
    bench.settings.capacity_mah = None;
    let reported = Measurement {
        counted: Some(Counted::TotalCharge(800.0)),
        state_of_charge: Some(0.42),
        ..loaded(11.1, 3.6)
    };
    bench.run(10.0, reported);
    let state = bench.state;
    assert_eq!(state.readings.remaining_pct, Some(42.0));
    assert_eq!(state.charge_source, ChargeSource::Reported);
    assert_eq!((state.consumed_mah(), state.capacity), (Some(800.0), None));
    // 9.9 s of 39.96 W.
    assert_about(state.consumed_wh, 9.9 * 39.96 / 3600.0, 1e-4);
    bench.reset(100.0);
    assert_eq!(bench.run(0.1, reported).readings.remaining_pct, Some(42.0));
    for out_of_range in [-0.01, 1.01, f32::NAN] {
        let measurement = Measurement {
            state_of_charge: Some(out_of_range),
            ..reported
        };
        assert_eq!(bench.tick(Ok(measurement)), Some(ReadError::Implausible));
    }
}

#[test]
fn a_solar_charger_at_dusk_does_not_ground_a_rover() {
    let mut bench = MonitorBench::new();
    bench.settings.cell_count = None;
    // Too little voltage, as DroneCAN chargers report it.
    let dusk = Measurement {
        reported: Reported {
            faults: Faults::INCOMPATIBLE_VOLTAGE,
            ..Reported::NONE
        },
        ..loaded(14.0, 0.0)
    };
    let state = bench.run(60.0, dusk);
    assert_eq!(state.readings.faults, Faults::empty());
    assert_eq!(state.charge_state, ChargeState::Ok);
    assert_eq!(state.faults_to_show(), Faults::INCOMPATIBLE_VOLTAGE);
    let announced = bench
        .events
        .iter()
        .filter(|event| matches!(event, PackEvent::ReportedFaults(_)));
    assert_eq!(announced.count(), 1);
}

#[test]
fn what_a_pack_reports_ends_with_the_pack() {
    let mut bench = MonitorBench::new();
    let hot = Measurement {
        reported: Reported {
            faults: Faults::OVER_TEMPERATURE,
            ..Reported::NONE
        },
        time_remaining_s: Some(60.0),
        ..volts(11.7)
    };
    assert_eq!(bench.run(2.0, hot).readings.time_remaining_s, Some(60.0));
    let state = bench.run(1.0, volts(0.0));
    assert_eq!(state.readings.reported, Reported::NONE);
    assert_eq!(state.readings.time_remaining_s, None);
}

fn with_serial_number(serial_number: i32, voltage_v: f32) -> Measurement {
    let mut measurement = smart(voltage_v);
    measurement.details.serial_number = Some(serial_number);
    measurement
}

#[test]
// Requirement: AP-20
fn a_pack_that_powers_off_is_announced_once_each_time() {
    let mut bench = MonitorBench::new();
    for supply in [Supply::On, Supply::PoweringOff, Supply::On, Supply::PoweringOff] {
        bench.events.clear();
        let reading = Measurement {
            supply,
            ..smart(11.7)
        };
        bench.run(1.0, reading);
        let announced = bench.count_of(PackEvent::PoweringOff);
        assert_eq!(announced, usize::from(supply == Supply::PoweringOff));
    }
}

#[test]
// Requirement: L-11
fn another_serial_number_is_a_swap_after_five_readings_in_a_row_while_disarmed() {
    let other = with_serial_number(4712, 11.7);
    for between in [
        Ok(smart(11.7)),
        Ok(with_serial_number(4713, 11.7)),
        Err(ReadError::Bus(BusError::Checksum)),
    ] {
        let mut bench = MonitorBench::new();
        bench.tick(Ok(smart(11.7)));
        bench.events.clear();
        for _ in 0..10 {
            for _ in 0..4 {
                bench.tick(Ok(other));
            }
            bench.tick(between);
        }
        assert_eq!(bench.events, [], "{between:?}");
    }
    let mut bench = MonitorBench::new();
    bench.tick(Ok(smart(11.7)));
    bench.load_state = LoadState::On;
    for _ in 0..100 {
        bench.tick(Ok(other));
    }
    assert_eq!(bench.events, []);
    bench.load_state = LoadState::Off;
    for _ in 0..4 {
        bench.tick(Ok(other));
    }
    assert_eq!(
        (&bench.events[..], bench.state.serial_number),
        (&[][..], Some(4711))
    );
    bench.tick(Ok(other));
    assert_eq!(bench.events, [PackEvent::Swapped]);
    bench.run(10.0, other);
    assert_eq!(bench.events.len(), 1, "once");
    assert_eq!(bench.state.serial_number, Some(4712));
}

#[test]
fn swapped_smart_battery_clears_a_level_at_rest() {
    for (voltage_v, expected) in [(9.7, FailsafeLevel::Critical), (11.7, FailsafeLevel::None)] {
        let mut bench = latched();
        let at_rest = |serial_number| Measurement {
            current_a: Some(0.0),
            ..with_serial_number(serial_number, voltage_v)
        };
        bench.tick(Ok(at_rest(4711)));
        bench.run(10.0, at_rest(4711));
        assert_eq!(bench.state.failsafe, FailsafeLevel::Critical);
        bench.run(1.0, at_rest(4712));
        assert_eq!(bench.state.failsafe, FailsafeLevel::Critical, "not at rest yet");
        bench.run(5.0, at_rest(4712));
        assert_eq!(bench.state.failsafe, expected, "{voltage_v}");
    }
}

/// A reading of a flow sensor: increment in millilitres, flow in litres per hour.
fn fuel_flow(volume_ml: f32, flow_l_h: f32) -> Measurement {
    Measurement {
        contents: Contents::Fuel,
        fuel_l_h: Some(flow_l_h),
        counted: Some(Counted::Volume(volume_ml)),
        ..Measurement::default()
    }
}

#[test]
fn tank_with_flow_sensor_starts_full() {
    let mut bench = MonitorBench::new();
    bench.tick(Ok(fuel_flow(0.0, 0.0)));
    assert_eq!(bench.state.readings.remaining_pct, Some(100.0));
    // At 1 l/h a tick is 27.8 µl: 550 of 2200 ml take 1980 s.
    let state = bench.run(1980.0, fuel_flow(1.0 / 36.0, 1.0));
    assert_about(state.consumed_ml(), 550.0, 0.1);
    assert_about(state.readings.remaining_pct, 75.0, 0.01);
    assert_about(state.readings.time_remaining_s, 1.65 * 3600.0, 1.0);
    assert_eq!((state.readings.voltage_v, state.consumed_wh), (None, None));
    assert_eq!(
        (state.contents, state.status),
        (Contents::Fuel, PackStatus::Healthy)
    );
}

#[test]
fn fill_level_is_set_by_a_reset_clamped_at_zero_and_needs_a_capacity() {
    let mut bench = MonitorBench::new();
    bench.tick(Ok(fuel_flow(2000.0, 1.0)));
    bench.reset(50.0);
    bench.tick(Ok(fuel_flow(110.0, 1.0)));
    assert_about(bench.state.readings.remaining_pct, 45.0, 0.01);
    assert_about(bench.state.consumed_ml(), 1210.0, 0.01);
    bench.tick(Ok(fuel_flow(1290.0, 1.0)));
    assert_eq!(bench.state.readings.remaining_pct, Some(0.0));
    bench.settings.capacity_mah = None;
    bench.tick(Ok(fuel_flow(0.0, 1.0)));
    assert_eq!(bench.state.readings.remaining_pct, None);
    assert_about(bench.state.consumed_ml(), 2500.0, 0.01);
    assert_eq!(bench.state.consumed_wh, None);
}

#[test]
fn an_engine_whose_control_unit_is_silent_is_off() {
    // 6 l/h, which its control unit does not count: 100 ml a minute.
    let running = Measurement {
        counted: None,
        ..fuel_flow(0.0, 6.0)
    };
    for silent_ticks in [10, 11, 19, 21, 450, 700] {
        let mut bench = MonitorBench::new();
        bench.load_state = LoadState::On;
        bench.run(21.0, running);
        for _ in 1..silent_ticks {
            bench.tick(Err(ReadError::Timeout));
        }
        bench.run(0.1, running);
        // A unit that is late, but not silent, still drives its engine.
        let late_s = if silent_ticks <= 10 { 1.0 } else { 0.0 };
        assert_about(bench.state.consumed_ml(), (20.9 + late_s) / 0.6, 0.01);
        let is_gap = |event: &PackEvent| matches!(event, PackEvent::Gap(_));
        assert!(!bench.events.iter().any(is_gap), "{:?}", bench.events);
        // The pauses belong to the average, as stops of a rover do.
        bench.run(60.0, running);
        let average_l_h = bench.state.readings.average_current_a.unwrap_or(0.0);
        assert!(average_l_h < 6.01, "{average_l_h}");
    }
}

#[test]
fn charge_failsafe_applies_to_a_tank() {
    let mut bench = MonitorBench::new();
    bench.settings.failsafe.low.remaining_mah = Some(500.0);
    bench.load_state = LoadState::On;
    bench.tick(Ok(fuel_flow(1700.0, 1.0)));
    assert_eq!(bench.state.failsafe, FailsafeLevel::None);
    bench.tick(Ok(fuel_flow(1.0, 1.0)));
    assert_eq!(bench.state.failsafe, FailsafeLevel::Low);
    let PackEvent::Failsafe {
        level: FailsafeLevel::Low,
        voltage_v: None,
        consumed: Some(Amount::Ml(used_ml)),
    } = bench.events[0]
    else {
        panic!("{:?}", bench.events);
    };
    assert_about(Some(used_ml), 1701.0, 0.5);
}

fn any_number() -> impl Strategy<Value = f32> {
    prop_oneof![
        any::<f32>(),
        Just(f32::NAN),
        Just(f32::INFINITY),
        Just(f32::MAX),
        Just(f32::MIN_POSITIVE),
        Just(0.0),
        -30.0f32..30.0,
        9.0f32..13.0,
    ]
}

fn any_gauge() -> impl Strategy<Value = GaugeReading> {
    let read = (any_number(), any_number()).prop_map(|(remaining_mah, full_mah)| {
        GaugeReading::Read(Gauge {
            remaining_mah,
            full_mah,
        })
    });
    prop_oneof![2 => read, 1 => Just(GaugeReading::Absent), 1 => Just(GaugeReading::Missing)]
}

prop_compose! {
    fn any_counted()(charge_mah in any_number(), energy_wh in any_number(), kind in 0..4) -> Counted {
        let consumed = Consumed { charge_mah, energy_wh };
        match kind {
            0 => Counted::Total(consumed),
            1 => Counted::Increment(consumed),
            2 => Counted::Members { consumed, drawn_mah: Some(energy_wh) },
            _ => Counted::TotalCharge(charge_mah),
        }
    }
}

prop_compose! {
    fn any_measurement()(
        voltage_v in prop::option::of(any_number()),
        current_a in prop::option::of(any_number()),
        temperature_c in prop::option::of(any_number()),
        cells in prop::collection::vec(any::<u16>(), 0..20),
        gauge in any_gauge(),
        counted in prop::option::weighted(0.25, any_counted()),
        state_of_charge in prop::option::of(any_number()),
    ) -> Measurement {
        let cells = CellVoltages::from_millivolts(&cells);
        Measurement { voltage_v, current_a, temperature_c, cells, gauge, counted, state_of_charge, ..Measurement::default() }
    }
}

fn any_reading() -> impl Strategy<Value = Result<Measurement, ReadError>> {
    prop_oneof![8 => any_measurement().prop_map(Ok), 1 => Just(Err(ReadError::Timeout))]
}

fn any_step_us() -> impl Strategy<Value = u64> {
    prop_oneof![8 => Just(100_000u64), 2 => 0..20_000_000u64, 1 => Just(0), 1 => 0..u64::MAX / 1000]
}

/// Anything that flash may hold.
fn any_learnt() -> impl Strategy<Value = LearntPack> {
    // Any bits, or a finite value that is not negative, of any magnitude.
    let word = prop_oneof![
        any::<u32>(),
        (0.0f32..1.0).prop_map(f32::to_bits),
        (-7.0f32..7.5).prop_map(|exponent| 10f32.powf(exponent).to_bits()),
    ];
    let words = prop::array::uniform::<_, LEARNT_WORDS>(word);
    (words, 1u32..=4, 0u32..=255).prop_map(|(mut words, chemistry, cells)| {
        words[0] = words[0] & !0xffff | cells << 8 | chemistry;
        LearntPack::from_words(&words).expect("a chemistry")
    })
}

fn any_settings() -> impl Strategy<Value = PackSettings> {
    let cells = prop::option::of(prop_oneof![1u8..=6, 1u8..=255]);
    let capacity = prop::option::of((0.0f32..7.0).prop_map(|exponent| 10f32.powf(exponent)));
    (1..=4, cells, capacity).prop_map(|(chemistry, cell_count, capacity_mah)| PackSettings {
        chemistry: Chemistry::from_number(chemistry).expect("a chemistry"),
        cell_count,
        capacity_mah,
        ..PackSettings::default()
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]
    #[test]
    fn every_value_is_finite_and_in_range(
        settings in any_settings(),
        learnt in any_learnt(),
        contents in prop::sample::select(vec![Contents::Charge, Contents::Charge, Contents::Fuel]),
        steps in prop::collection::vec(
            (any_step_us(), any_reading(), any::<bool>(), prop_oneof![4 => Just(1), 1 => 1..100]), 1..200),
        reset in any_number(),
    ) {
        let mut bench = MonitorBench::new();
        bench.settings = settings;
        bench.monitor.restore_learnt(learnt);
        for (number, (step_us, reading, armed, repeated)) in steps.into_iter().enumerate() {
            bench.load_state = if armed { LoadState::On } else { LoadState::Off };
            bench.events.clear();
            if number % 50 == 20 {
                bench.reset(reset);
            }
            for _ in 0..repeated {
                bench.now = bench.now.after_us(step_us).min(at_us(u64::MAX / 2));
                bench.tick(reading.map(|measurement| Measurement { contents, ..measurement }));
            }
            let state = bench.state;
            let readings = state.readings;
            let values = [
                readings.voltage_v, readings.resting_voltage_v, readings.current_a, readings.average_current_a,
                state.resistance_ohm, state.consumed.map(Amount::number), state.consumed_wh, readings.time_remaining_s,
                state.temperature_c,
            ];
            for value in values.into_iter().flatten() {
                prop_assert!(value.is_finite(), "{state:?}");
            }
            for percent in [readings.remaining_pct, readings.usable_pct].into_iter().flatten() {
                prop_assert!((0.0..=100.0).contains(&percent), "{state:?}");
            }
            // A count beyond the capacity leaves nothing for certain, and a battery reset is certain until a reading.
            let has_failed = state.read_error.is_some() || state.status != PackStatus::Healthy;
            let is_exact = readings.remaining_pct == Some(0.0) || has_failed;
            let is_sigma = |sigma: f32| (sigma > 0.0 || is_exact) && (0.0..=50.0).contains(&sigma);
            prop_assert!(readings.remaining_sigma_pct.is_none_or(is_sigma), "{state:?}");
            prop_assert!(state.contents == Contents::Charge || state.consumed_wh.is_none(), "{state:?}");
            prop_assert!(state.resistance_ohm.is_none_or(|ohm| ohm > 0.0), "{state:?}");
            prop_assert!(readings.time_remaining_s.is_none_or(|seconds| seconds >= 0.0), "{state:?}");
            prop_assert!(readings.voltage_v.is_none_or(|v| v >= MIN_CONNECTED_VOLTAGE_V), "{state:?}");
            prop_assert!(state.learnt_capacity_mah.is_none_or(|mah| mah >= 1.0), "{state:?}");
            let learnt = *bench.monitor.learnt().expect("restored");
            prop_assert_eq!(LearntPack::from_words(&learnt.to_words()), Some(learnt));
        }
    }
}

/// A number of equal readings or failed reads.
#[derive(Clone, Copy, Debug)]
struct Stretch {
    ticks: u32,
    load_state: LoadState,
    reading: Result<Measurement, ReadError>,
}

prop_compose! {
    fn any_stretch()(
        ticks in 1u32..40,
        load_state in prop_oneof![1 => Just(LoadState::On), 6 => Just(LoadState::Off)],
        voltage_v in prop::sample::select(vec![0.3f32, 6.0, 8.8, 9.5, 10.2, 10.7, 11.5, 12.4]),
        current_a in prop::sample::select(vec![None, Some(0.0f32), Some(5.0)]),
        serial_number in prop::sample::select(vec![None, None, Some(1), Some(2)]),
        is_read in prop::bool::weighted(0.9),
    ) -> Stretch {
        let details = PackDetails { serial_number, ..PackDetails::default() };
        let measurement = Measurement { current_a, details, ..volts(voltage_v) };
        let reading = if is_read { Ok(measurement) } else { Err(ReadError::Bus(BusError::NoAnswer)) };
        Stretch { ticks, load_state, reading }
    }
}

/// Evidence since disarming that allows a level to be cleared.
#[derive(Debug, Default)]
struct Evidence {
    contact_loss_ticks: u32,
    /// The highest voltage of the previous pack.
    highest_v: f32,
    serial_number: Option<i32>,
    /// Consecutive readings of another one.
    other_readings: u32,
    is_other_confirmed: bool,
    /// Ticks at the same voltage.
    stable_ticks: u32,
    voltage_v: f32,
}

impl Evidence {
    fn update(&mut self, load_state: LoadState, reading: Result<Measurement, ReadError>) {
        let connected = reading
            .ok()
            .filter(|m| m.voltage_v.is_some_and(|v| v >= MIN_CONNECTED_VOLTAGE_V));
        let read = reading.ok().and_then(|m| m.details.serial_number);
        let known = *self.serial_number.get_or_insert(read.unwrap_or(-1));
        if known == -1 {
            self.serial_number = read;
        }
        let is_other = load_state == LoadState::Off && read.is_some_and(|read| known != -1 && read != known);
        self.other_readings = if is_other { self.other_readings + 1 } else { 0 };
        if self.other_readings >= 5 {
            (self.is_other_confirmed, self.serial_number, self.other_readings) = (true, read, 0);
            // The voltages are those of the previous battery.
            self.highest_v = 0.0;
        }
        if load_state == LoadState::On {
            (self.contact_loss_ticks, self.is_other_confirmed) = (0, false);
            self.highest_v = connected.map_or(self.highest_v, |m| m.voltage_v.unwrap_or(0.0));
        }
        match connected.and_then(|m| m.voltage_v) {
            None => (self.contact_loss_ticks, self.stable_ticks) = (self.contact_loss_ticks + 1, 0),
            Some(voltage_v) if voltage_v == self.voltage_v && load_state == LoadState::Off => {
                self.stable_ticks += 1;
            }
            Some(voltage_v) => (self.voltage_v, self.stable_ticks) = (voltage_v, 0),
        }
    }

    /// Whether a swapped pack rests above `threshold_v`.
    fn allows_clearing(&self, load_state: LoadState, threshold_v: f32) -> bool {
        let is_fuller = self.contact_loss_ticks >= 10 && self.voltage_v > 1.07 * self.highest_v;
        load_state == LoadState::Off
            && self.stable_ticks >= 15
            && self.voltage_v >= threshold_v
            && (self.is_other_confirmed || is_fuller)
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    // Requirement: L-5
    fn level_is_cleared_only_by_reset_or_by_a_swap_above_it(
        stretches in prop::collection::vec((any_stretch(), prop::bool::weighted(0.02)), 1..40),
    ) {
        let mut bench = latched();
        let mut evidence = Evidence { highest_v: 9.5, ..Evidence::default() };
        for (Stretch { ticks, load_state, reading }, reset) in stretches {
            if reset {
                bench.reset(50.0);
                prop_assert_eq!(bench.monitor.evaluation.failsafe.level(), FailsafeLevel::None);
            }
            bench.load_state = load_state;
            for _ in 0..ticks {
                let before = bench.monitor.evaluation.failsafe.level();
                bench.events.clear();
                bench.tick(reading);
                evidence.update(load_state, reading);
                let is_cleared = bench.state.failsafe < before;
                prop_assert!(!is_cleared || evidence.allows_clearing(load_state, 10.5), "{evidence:?}");
                let raises = bench.state.failsafe > before;
                prop_assert!(!raises || load_state == LoadState::On);
            }
        }
    }
}
