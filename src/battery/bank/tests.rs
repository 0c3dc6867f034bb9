use core::mem;

use proptest::prelude::*;

use super::*;
use crate::battery::{
    BusError, ChargeSource, CurrentRange, FailsafeSettings, Faults, Gauge, GaugeReading, PackEvent,
    PackSettings, Thermometer, Thresholds, Tick,
};
use crate::parameter::Parameters;
use crate::time::{Instant, at_us};
use crate::vehicle::FailsafeAction;

mod lost_current;

/// Two packs in parallel, and a third that is their sum.
struct BankBench {
    bank: BatteryBank,
    /// `BATT_SUM_MASK`.
    mask: u16,
    settings: PackSettings,
    sum_settings: PackSettings,
    now: Instant,
    load_state: LoadState,
    /// Those of the sum.
    events: Vec<PackEvent>,
}

const SUM: Pack = Pack::Third;

/// Its members.
const BOTH: PackSet = PackSet::from_bits(0b11);

/// Time for which the charge of a sum is held when a member is lost, in seconds.
const TIMEOUT_S: f32 = 12.0;

type Readings = [Result<Measurement, ReadError>; 2];

const SILENT: Result<Measurement, ReadError> = Err(ReadError::Bus(BusError::NoAnswer));

impl BankBench {
    /// Of 3S packs with 2200 mAh each.
    fn new() -> Self {
        let settings = PackSettings {
            cell_count: Some(3),
            capacity_mah: Some(2200.0),
            ..PackSettings::default()
        };
        Self {
            bank: BatteryBank::default(),
            mask: 0b11,
            settings,
            sum_settings: PackSettings {
                capacity_mah: None,
                ..settings
            },
            now: Instant::EPOCH,
            load_state: LoadState::On,
            events: Vec::new(),
        }
    }

    /// A bench after a battery reset, with these readings.
    fn reset_to(remaining_pct: f32, readings: &Readings) -> Self {
        let mut bench = Self::new();
        bench.run(1.0, readings);
        for pack in [Pack::First, Pack::Second, SUM] {
            let (monitor, state) = bench.bank.get_mut(pack);
            monitor.reset(state, LoadState::Off, remaining_pct, &bench.settings);
        }
        bench.run(1.0, readings);
        bench
    }

    /// Updates the packs whose reading is there, and their sum.
    fn tick(&mut self, readings: &[Option<Result<Measurement, ReadError>>; 2]) {
        self.now = self.now.after_us(100_000);
        let tick = Tick {
            now: self.now,
            load_state: self.load_state,
        };
        for (pack, reading) in [Pack::First, Pack::Second].into_iter().zip(readings) {
            if let Some(reading) = reading {
                let _ = self.bank.update(pack, tick, *reading, &self.settings);
            }
        }
        let sum = self.sum_of(SUM, self.mask, SumVoltage::Mean);
        let update = self.bank.update(SUM, tick, sum, &self.sum_settings);
        self.events.extend(update.events);
    }

    /// Repeats readings of both, and returns the state of the sum.
    fn run(&mut self, seconds: f32, readings: &Readings) -> BatteryState {
        for _ in 0..(seconds * 10.0).round() as u32 {
            self.tick(&readings.map(Some));
        }
        self.sum()
    }

    fn sum(&self) -> BatteryState {
        *self.bank.state(SUM)
    }

    fn remaining_pct(&self) -> f32 {
        self.sum().readings.remaining_pct.expect("known")
    }

    /// The sum of the packs of `mask` at this moment, as `own`.
    fn sum_of(&self, own: Pack, mask: u16, voltage: SumVoltage) -> Result<Measurement, ReadError> {
        let named = PackSet::from_bits(mask);
        self.bank.sum(own, named, PackSet::ALL, voltage, self.load_state)
    }
}

#[track_caller]
fn assert_about(value: f32, expected: f32, tolerance: f32) {
    assert!(
        (value - expected).abs() < tolerance,
        "{value} instead of {expected}"
    );
}

fn at(voltage_v: f32, current_a: f32) -> Measurement {
    Measurement {
        voltage_v: Some(voltage_v),
        current_a: Some(current_a),
        ..Measurement::default()
    }
}

/// A pack without a voltage: its charge is counted only.
fn counted(current_a: f32) -> Measurement {
    Measurement {
        current_a: Some(current_a),
        ..Measurement::default()
    }
}

/// Percentage left after this charge, from 80 % of both packs.
fn after_pct(drawn_mah: f32) -> f32 {
    80.0 - drawn_mah / 44.0
}

/// A second's charge at 10 A, in milliampere-hours.
const MAH_PER_SECOND: f32 = 10.0 / 3.6;

#[test]
// Requirement: AP-4
fn parallel_packs_have_mean_voltage_and_summed_current() {
    let mut bench = BankBench::new();
    let state = bench.run(36.0, &[Ok(at(12.0, 2.0)), Ok(at(11.0, 3.0))]);
    let readings = state.readings;
    assert_eq!((readings.voltage_v, readings.current_a), (Some(11.5), Some(5.0)));
    assert_about(state.consumed_mah().expect("counted"), 49.9, 0.1);
    let mut parameters = Parameters::defaults();
    assert_eq!(
        SumVoltage::from_parameters(parameters.pack(SUM)),
        SumVoltage::Mean
    );
    parameters.set(BatteryParameter::Options.of(SUM), 512.0).unwrap();
    let sum = bench.sum_of(SUM, 0b11, SumVoltage::from_parameters(parameters.pack(SUM)));
    assert_eq!(sum.map(|sum| sum.voltage_v), Ok(Some(11.0)));
}

#[test]
// Requirement: L-12
fn a_member_whose_voltage_is_missing_is_lost_for_its_voltage_only() {
    let mut bench = BankBench::reset_to(80.0, &[Ok(at(11.6, 5.0)), Ok(at(11.4, 5.0))]);
    let before_mah = bench.sum().consumed_mah().expect("counted");
    let state = bench.run(60.0, &[Ok(at(0.2, 5.0)), Ok(at(11.4, 5.0))]);
    let readings = state.readings;
    assert_eq!((readings.voltage_v, readings.current_a), (Some(11.4), Some(10.0)));
    let drawn_mah = state.consumed_mah().expect("counted") - before_mah;
    assert_about(drawn_mah, 60.0 * MAH_PER_SECOND, 1.0);
    assert_about(bench.remaining_pct(), after_pct(60.0 * MAH_PER_SECOND), 1.0);
    // Standing for longer than a lost member is waited for.
    let state = bench.run(30.0, &[Ok(at(0.2, 0.2)), Ok(at(11.6, 0.2))]);
    assert_about(state.readings.current_a.expect("of both"), 0.4, 0.01);
    let drawn_mah = 60.0 * MAH_PER_SECOND + 30.0 * 0.4 / 3.6;
    assert_about(
        state.consumed_mah().expect("counted") - before_mah,
        drawn_mah,
        1.0,
    );
    assert_about(bench.remaining_pct(), after_pct(drawn_mah), 1.0);
}

#[test]
fn sum_has_only_electric_packs_as_members() {
    let mut bench = BankBench::new();
    let tank = Measurement {
        contents: Contents::Fuel,
        ..at(3.0, 9.0)
    };
    let state = bench.run(1.0, &[Ok(at(12.0, 2.0)), Ok(tank)]);
    let readings = state.readings;
    assert_eq!((readings.voltage_v, readings.current_a), (Some(12.0), Some(2.0)));
    assert_eq!(state.members, 0b1);
    let members = |own, mask| {
        let sum = bench.bank.sum(
            own,
            PackSet::from_bits(mask),
            PackSet::ALL,
            SumVoltage::Mean,
            LoadState::On,
        );
        sum.map(|sum| sum.members)
    };
    assert_eq!(members(Pack::Ninth, 0b11), Ok(0b1));
    // All behind it, and never itself.
    assert_eq!(members(Pack::Second, 0), Ok(0b100));
    assert_eq!(members(Pack::First, 0b101), Ok(0b100));
    assert_eq!(members(Pack::Ninth, 0b10), Err(ReadError::NoHealthyMember));
}

#[test]
// Requirement: AP-4
fn current_is_unknown_unless_known_of_every_member() {
    let voltage_only = Measurement {
        current_a: None,
        ..at(11.0, 0.0)
    };
    let mut bench = BankBench::new();
    let state = bench.run(1.0, &[Ok(at(12.0, 2.0)), Ok(voltage_only)]);
    assert_eq!(state.readings.current_a, None);
}

#[test]
// Requirement: AP-14
fn unhealthy_pack_counts_only_in_the_consumption() {
    let both = [Ok(at(11.0, 10.0)), Ok(at(11.2, 10.0))];
    let mut bench = BankBench::reset_to(80.0, &both);
    let before = bench.run(10.0, &both);
    assert_eq!(before.readings.current_a, Some(20.0));
    let state = bench.run(10.0, &[both[0], SILENT]);
    let readings = state.readings;
    assert_eq!((readings.voltage_v, readings.current_a), (Some(11.0), None));
    assert!(state.consumed_mah() > before.consumed_mah());
    assert_eq!(state.status, PackStatus::Healthy);
    assert!(state.readings.remaining_pct.is_some());
    let sum = bench.sum_of(SUM, 0b10, SumVoltage::Mean);
    assert_eq!(sum, Err(ReadError::NoHealthyMember));
}

#[test]
// Requirement: AP-4, S-8
fn charge_is_unknown_12_s_after_a_member_was_lost() {
    let both = [Ok(at(11.4, 10.0)), Ok(at(11.4, 10.0))];
    // Unhealthy, and gone while armed.
    for lost in [SILENT, Ok(at(0.3, 0.0))] {
        let mut bench = BankBench::reset_to(80.0, &both);
        let state = bench.run(TIMEOUT_S, &[both[0], lost]);
        assert!(state.readings.remaining_pct.is_some() && state.readings.current_a.is_none());
        let state = bench.run(2.0, &[both[0], lost]);
        let readings = state.readings;
        assert_eq!((readings.remaining_pct, readings.usable_pct), (None, None));
        assert_eq!(
            (readings.remaining_sigma_pct, readings.time_remaining_s),
            (None, None)
        );
        assert_eq!(state.charge_source, ChargeSource::Estimated);
        assert!(state.consumed_mah().is_some(), "it is kept");
        assert_eq!(state.status, PackStatus::Healthy, "no threshold needs it");
        let state = bench.run(1.0, &both);
        assert_eq!(state.readings.current_a, Some(20.0));
        assert!(state.readings.remaining_pct.is_some());
        assert_eq!(bench.events, []);
    }
}

#[test]
// Requirement: S-8
fn a_sum_without_its_charge_is_unhealthy_while_a_threshold_needs_it() {
    let both = [Ok(at(11.4, 10.0)), Ok(at(11.4, 10.0))];
    let mut bench = BankBench::new();
    // Far above what half of the packs' charge would be.
    bench.sum_settings.failsafe.timer_s = Some(1.0);
    bench.sum_settings.failsafe.low.remaining_mah = Some(100.0);
    bench.sum_settings.failsafe.critical.voltage_v = Some(10.2);
    bench.run(10.0, &both);
    bench.run(TIMEOUT_S, &[both[0], SILENT]);
    assert_eq!(bench.events, []);
    let state = bench.run(2.0, &[both[0], SILENT]);
    assert_eq!(state.status, PackStatus::Unhealthy);
    assert_eq!(bench.events, [PackEvent::SensorFailed(ReadError::LostMember)]);
    let state = bench.run(6.0, &[both[0], SILENT]);
    assert_eq!(state.failsafe, FailsafeLevel::Unhealthy);
    // Its voltage is measured all the same.
    let state = bench.run(3.0, &[Ok(at(10.0, 10.0)), SILENT]);
    assert_eq!(
        (state.failsafe, state.readings.voltage_v),
        (FailsafeLevel::Critical, Some(10.0))
    );
    let state = bench.run(6.0, &both);
    assert_eq!(state.status, PackStatus::Healthy);
    assert_eq!(bench.events.last(), Some(&PackEvent::SensorRecovered));
}

#[test]
fn what_is_counted_of_a_sum_with_a_lost_member_trips_no_threshold() {
    let both = [Ok(counted(10.0)), Ok(counted(10.0))];
    let mut bench = BankBench::reset_to(25.0, &both);
    bench.sum_settings.failsafe.low.remaining_mah = Some(1000.0);
    // What the other one has counted by then leaves less.
    let state = bench.run(60.0, &[both[0], SILENT]);
    assert!(state.consumed_mah() > Some(3450.0));
    assert!(state.failsafe <= FailsafeLevel::Unhealthy, "{state:?}");
}

#[test]
fn a_pack_unplugged_while_disarmed_leaves_the_sum_until_it_measures() {
    let both = [Ok(at(11.4, 1.0)), Ok(at(11.4, 1.0))];
    let unplugged = [both[0], Ok(at(0.3, 0.0))];
    let mut bench = BankBench::new();
    bench.load_state = LoadState::Off;
    bench.run(5.0, &both);
    let state = bench.run(20.0, &unplugged);
    assert_eq!(bench.events, [PackEvent::MembersLeft(0b10)]);
    assert_eq!((state.members, state.readings.current_a), (0b1, Some(1.0)));
    assert_eq!(state.capacity_mah(), Some(2200.0));
    assert!(state.readings.remaining_pct.is_some());
    // It is not lost.
    bench.load_state = LoadState::On;
    assert_eq!(bench.run(20.0, &unplugged).readings.current_a, Some(1.0));
    let state = bench.run(1.0, &both);
    assert_eq!((state.members, state.readings.current_a), (0b11, Some(2.0)));
    assert_eq!(state.capacity_mah(), Some(4400.0));
    // Unplugged while armed it is, and leaves when disarmed.
    assert_eq!(bench.run(1.0, &unplugged).readings.current_a, None);
    assert_eq!(bench.events.len(), 1);
    bench.load_state = LoadState::Off;
    assert_eq!(bench.run(1.0, &unplugged).readings.current_a, Some(1.0));
    assert_eq!(bench.events[1..], [PackEvent::MembersLeft(0b10)]);
}

#[test]
fn a_pack_that_was_never_plugged_in_is_no_lost_member() {
    let mut bench = BankBench::new();
    let state = bench.run(20.0, &[Ok(at(11.4, 1.0)), Ok(at(0.3, 0.0))]);
    assert_eq!((state.members, state.readings.current_a), (0b1, Some(1.0)));
    assert_eq!(bench.events, []);
}

#[test]
fn a_member_that_returns_is_counted_once() {
    let both = [Ok(counted(10.0)), Ok(counted(10.0))];
    for lost_s in [5.0, 40.0] {
        let mut bench = BankBench::reset_to(80.0, &both);
        let before_pct = bench.remaining_pct();
        bench.run(lost_s, &[both[0], SILENT]);
        let state = bench.run(20.0, &both);
        // The load of the other one alone was not taken for that of both.
        println!("{lost_s} s");
        assert_about(state.readings.average_current_a.expect("known"), 20.0, 0.1);
        // The returning pack's gap is filled.
        let drawn_mah = 2.0 * MAH_PER_SECOND * (lost_s + 20.0);
        assert_about(bench.remaining_pct(), before_pct - drawn_mah / 44.0, 0.1);
    }
}

/// A pack of 2200 mAh from which this was drawn, with a gauge.
fn gauged(drawn_mah: f32, current_a: f32) -> Measurement {
    Measurement {
        gauge: GaugeReading::Read(Gauge {
            remaining_mah: 1760.0 - drawn_mah,
            full_mah: 2200.0,
        }),
        ..counted(current_a)
    }
}

#[test]
fn what_a_silent_gauge_counts_meanwhile_is_counted_once() {
    // With its current, and with nothing.
    let without_gauge = Measurement {
        gauge: GaugeReading::Missing,
        ..counted(1.0)
    };
    for silent in [Ok(without_gauge), SILENT] {
        let mut bench = BankBench::reset_to(80.0, &[Ok(counted(1.0)), Ok(gauged(0.0, 1.0))]);
        bench.run(600.0, &[Ok(counted(1.0)), silent]);
        let drawn_mah = 600.0 / 3.6;
        bench.run(1.0, &[Ok(counted(1.0)), Ok(gauged(drawn_mah, 1.0))]);
        println!("{silent:?}");
        assert_about(bench.remaining_pct(), after_pct(2.0 * drawn_mah), 0.2);
    }
}

#[test]
fn packs_that_report_seldom_are_counted_once() {
    // Each 0.5, 1 or 5 s, measured here or by a gauge.
    for (interval, is_gauged) in [(5, false), (10, false), (50, false), (10, true), (50, true)] {
        let reading = |tick: u32| {
            let drawn_mah = MAH_PER_SECOND * tick as f32 * 0.1;
            if is_gauged {
                gauged(drawn_mah, 10.0)
            } else {
                counted(10.0)
            }
        };
        let mut bench = BankBench::reset_to(80.0, &[Ok(reading(0)); 2]);
        let before_pct = bench.remaining_pct();
        for tick in 1..=600 {
            let is_due = tick % interval == 0;
            bench.tick(&[is_due.then(|| Ok(reading(tick))); 2]);
        }
        println!("{interval} {is_gauged}");
        let drawn_pct = before_pct - bench.remaining_pct();
        assert_about(drawn_pct, 2.0 * MAH_PER_SECOND * 60.0 / 44.0, 0.7);
    }
}

#[test]
fn a_sum_holds_what_its_packs_hold_now() {
    let mut bench = BankBench::new();
    let learnt = "cells 3\ndrives 1\ncapacity_mah_sigma 1800 0.03\nresistance_ohm_now_first 0.02 0.02\n";
    let learnt = learnt.parse().expect("a pack");
    bench.bank.get_mut(Pack::First).0.restore_learnt(learnt);
    let gauge = Measurement {
        gauge: GaugeReading::Read(Gauge {
            remaining_mah: 2000.0,
            full_mah: 2500.0,
        }),
        ..at(11.4, 1.0)
    };
    let state = bench.run(5.0, &[Ok(at(11.4, 1.0)), Ok(gauge)]);
    assert_eq!(state.capacity_mah(), Some(4300.0));
    // Of the first one nothing is known.
    let mut bench = BankBench::new();
    bench.settings.capacity_mah = None;
    let state = bench.run(5.0, &[Ok(at(11.4, 1.0)), Ok(gauge)]);
    assert_eq!(state.capacity, None);
}

#[test]
fn a_sum_follows_the_counts_of_its_packs() {
    let counted_to = |total_mah: u16| Measurement {
        current_a: None,
        counted: Some(Counted::TotalCharge(total_mah.into())),
        ..at(12.0, 0.0)
    };
    let mut bench = BankBench::new();
    bench.load_state = LoadState::Off;
    for total_mah in 0..=2200 {
        bench.tick(&[Some(Ok(counted_to(total_mah))); 2]);
    }
    assert_eq!(bench.sum().consumed_mah(), Some(4400.0));
    assert_eq!(bench.remaining_pct().round(), 0.0);
}

#[test]
fn a_sums_temperature_is_its_packs_unless_a_device_has_a_part_in_it() {
    let hot = |thermometer| Measurement {
        temperature_c: Some(70.0),
        thermometer,
        ..at(11.4, 1.0)
    };
    let without = Measurement {
        temperature_c: None,
        ..hot(Thermometer::Device)
    };
    for (first, second, expected) in [
        (hot(Thermometer::Device), hot(Thermometer::Pack), Faults::empty()),
        (without, hot(Thermometer::Pack), Faults::OVER_TEMPERATURE),
    ] {
        let state = BankBench::new().run(5.0, &[Ok(first), Ok(second)]);
        assert_eq!(
            (state.temperature_c, state.readings.faults),
            (Some(70.0), expected)
        );
    }
}

#[test]
fn a_live_change_of_the_members_draws_nothing() {
    let both = [Ok(counted(10.0)), Ok(counted(10.0))];
    let mut bench = BankBench::reset_to(80.0, &both);
    bench.mask = 0b1;
    bench.run(120.0, &both);
    let before_pct = bench.remaining_pct();
    bench.mask = 0b11;
    bench.run(0.5, &both);
    assert_about(bench.remaining_pct(), before_pct, 0.2);
    bench.mask = 0b10;
    bench.run(0.5, &both);
    assert_about(bench.remaining_pct(), before_pct, 0.4);
}

#[test]
fn the_cells_of_a_sum_are_unclear_while_those_of_a_member_are() {
    let mut bank = BatteryBank::default();
    let kept = "chemistry 1\ncells 3".parse().expect("a pack");
    bank.get_mut(Pack::Second).0.restore_learnt(kept);
    let settings = PackSettings::default();
    let run = |bank: &mut BatteryBank, from: u64| {
        for number in from..from + 40 {
            let tick = Tick {
                now: at_us(number * 100_000),
                ..Tick::default()
            };
            let reading = Measurement {
                voltage_v: Some(8.5),
                ..Measurement::default()
            };
            let _ = bank.update(Pack::First, tick, Ok(reading), &settings);
            let _ = bank.update(Pack::Second, tick, Ok(reading), &settings);
            let sum = bank.sum(Pack::Third, BOTH, PackSet::ALL, SumVoltage::Mean, tick.load_state);
            let _ = bank.update(Pack::Third, tick, sum, &settings);
        }
        let [first, second, third, ..] = bank.states().map(|state| state.cell_count);
        [first, second, third]
    };
    assert_eq!(run(&mut bank, 1), [Some(2), None, None]);
    let sum = *bank.state(Pack::Third);
    assert!(
        sum.has_unclear_cells() && sum.readings.remaining_pct.is_none(),
        "{sum:?}"
    );
    bank.get_mut(Pack::Second).0.erase_learnt();
    assert_eq!(run(&mut bank, 41), [Some(2); 3]);
}

#[test]
fn cells_of_a_sum_follow_a_member_that_is_charged_in_place() {
    let mut bank = BatteryBank::default();
    bank.get_mut(Pack::First)
        .0
        .restore_learnt("chemistry 1\ncells 3".parse().expect("a pack"));
    let mut number = 0;
    let mut run = |voltage_v, current_a| {
        for _ in 0..40 {
            number += 1;
            let tick = Tick {
                now: at_us(number * 100_000),
                ..Tick::default()
            };
            let settings = PackSettings::default();
            let _ = bank.update(Pack::First, tick, Ok(at(voltage_v, current_a)), &settings);
            let sum = bank.sum(
                Pack::Third,
                PackSet::from_bits(1),
                PackSet::ALL,
                SumVoltage::Mean,
                tick.load_state,
            );
            let _ = bank.update(Pack::Third, tick, sum, &settings);
        }
        bank.state(Pack::Third).cell_count
    };
    assert_eq!(run(8.5, 0.1), None);
    assert_eq!(run(12.5, -2.0), None, "being charged");
    assert_eq!(run(12.5, 0.1), Some(3));
}

#[test]
fn a_sum_learns_at_once_that_a_member_was_exchanged() {
    // LiPo cells at 90, 60 and 10 %.
    let [high_v, middle_v, low_v] = [4.099, 3.853, 3.665];
    let rested = |cell_v: f32| Ok(at(3.0 * cell_v, 0.1));
    let unplugged = Ok(at(0.3, 0.0));
    let mut bench = BankBench::new();
    bench.load_state = LoadState::Off;
    bench.run(60.0, &[rested(high_v), rested(high_v)]);
    assert_about(bench.remaining_pct(), 90.0, 3.0);
    bench.run(3.0, &[rested(high_v), unplugged]);
    // Too similar to be another pack by its voltage, and one that is.
    for (cell_v, expected_pct) in [(middle_v, 77.0), (low_v, 60.0)] {
        bench.run(3.0, &[rested(high_v), unplugged]);
        bench.events.clear();
        bench.run(3.0, &[rested(high_v), rested(cell_v)]);
        let restarts = bench
            .events
            .iter()
            .filter(|event| **event == PackEvent::EstimateRestarted);
        assert_eq!(restarts.count(), 1, "{:?}", bench.events);
        assert_about(bench.remaining_pct(), expected_pct, 6.0);
        // Driven off at once.
        bench.load_state = LoadState::On;
        bench.run(20.0, &[rested(high_v), rested(cell_v)]);
        assert_about(bench.remaining_pct(), expected_pct, 6.0);
        bench.load_state = LoadState::Off;
        assert_eq!(bench.sum().failsafe, FailsafeLevel::None);
    }
}

#[test]
fn a_sum_is_over_range_while_a_healthy_member_is() {
    let mut member = BatteryState::UNKNOWN;
    member.status = PackStatus::Healthy;
    member.readings.voltage_v = Some(12.0);
    let mut members = [member; 2];
    let range = |members: &[BatteryState]| sum(members.iter(), SumVoltage::Mean).unwrap().current_range;
    assert_eq!(range(&members), CurrentRange::Within);
    members[1].current_range = CurrentRange::Over;
    assert_eq!(range(&members), CurrentRange::Over);
    members[1].status = PackStatus::Unhealthy;
    assert_eq!(range(&members), CurrentRange::Within);
}

/// Severity of an action.
fn severity(action: FailsafeAction) -> u8 {
    match action {
        FailsafeAction::Warn => 0,
        FailsafeAction::Terminate => 2,
        _ => 1,
    }
}

/// Observations of a pack from outside, and the most severe action taken.
#[derive(Clone, Debug, Default)]
struct Watched {
    low: Passing,
    critical: Passing,
    /// Ticks since a healthy reading.
    lost_ticks: u32,
    most_severe: u8,
}

#[derive(Clone, Debug, Default)]
struct Passing {
    below_ticks: u32,
    unusable_ticks: u32,
    has_passed: bool,
}

impl Passing {
    /// Whether the threshold of voltage or charge is passed for the first time, at the latest.
    fn is_first(
        &mut self,
        state: Option<&BatteryState>,
        thresholds: &Thresholds,
        timer_s: Option<f32>,
    ) -> bool {
        let is_below = |value: Option<f32>, threshold: Option<f32>| {
            value
                .zip(threshold)
                .is_some_and(|(value, threshold)| value < threshold)
        };
        let readings = state.map(|state| state.readings);
        let voltage_v = readings.and_then(|readings| readings.voltage_v);
        let is_voltage_below = is_below(voltage_v, thresholds.voltage_v);
        self.below_ticks = if is_voltage_below { self.below_ticks + 1 } else { 0 };
        let is_unusable = is_below(
            readings.and_then(|readings| readings.usable_pct),
            thresholds.usable_pct,
        );
        self.unusable_ticks = if is_unusable { self.unusable_ticks + 1 } else { 0 };
        let most_pct =
            readings.and_then(|now| Some(now.remaining_pct? + 2.0 * now.remaining_sigma_pct.unwrap_or(0.0)));
        let is_certain = is_below(
            most_pct,
            thresholds.usable_pct.map(|percentage| percentage + 19.9),
        );
        let lasts = |ticks: u32| timer_s.is_some_and(|timer_s| ticks as f32 > timer_s * 10.0 + 2.0);
        let has_lasted = lasts(self.below_ticks)
            || is_certain && (lasts(self.unusable_ticks) || timer_s.is_none() && is_unusable);
        // Without a current it is an estimate with bounds.
        let counted = state.filter(|state| state.readings.current_a.is_some());
        let remaining_mah = counted.and_then(BatteryState::remaining);
        let is_passed = has_lasted || is_below(remaining_mah, thresholds.remaining_mah.map(|mah| mah - 1.0));
        is_passed && !mem::replace(&mut self.has_passed, true)
    }
}

fn any_thresholds() -> impl Strategy<Value = Thresholds> {
    let voltage_v = prop::option::of(9.0f32..11.5);
    let remaining_mah = prop::option::of(10.0f32..200.0);
    let usable_pct = prop::option::of(5.0f32..90.0);
    (voltage_v, remaining_mah, usable_pct).prop_map(|(voltage_v, remaining_mah, usable_pct)| Thresholds {
        voltage_v,
        remaining_mah,
        usable_pct,
    })
}

/// Some ticks with these readings.
fn any_stretch() -> impl Strategy<Value = (u32, Readings)> {
    let reading = || {
        prop_oneof![
            6 => (8.0f32..12.6, 0.0f32..60.0).prop_map(|(voltage_v, current_a)| Ok(at(voltage_v, current_a))),
            1 => Just(SILENT),
        ]
    };
    (1u32..80, [reading(), reading()])
}

proptest! {
    #[test]
    // Requirement: AP-18
    fn no_level_is_passed_without_its_action_and_no_healthy_pack_is_lost(
        low in any_thresholds(),
        critical in any_thresholds(),
        timer_s in prop::option::of(0.5f32..3.0),
        actions in prop::array::uniform3(prop::sample::select(vec![0.0f32, 2.0, 5.0])),
        stretches in prop::collection::vec(any_stretch(), 1..40),
    ) {
        let mut parameters = Parameters::defaults();
        let named = [BatteryParameter::FsLowAct, BatteryParameter::FsCrtAct, BatteryParameter::FsUnhAct];
        for pack in [Pack::First, Pack::Second, SUM] {
            for (parameter, action) in named.into_iter().zip(actions) {
                parameters.set(parameter.of(pack), action).unwrap();
            }
        }
        let action = |pack, levels: &[_]| severity(FailsafeAction::from_parameters(parameters.pack(pack), levels));
        let failsafe = FailsafeSettings { timer_s, low, critical, ..FailsafeSettings::default() };
        let settings = PackSettings {
            cell_count: Some(3),
            capacity_mah: Some(200.0),
            failsafe,
            ..PackSettings::default()
        };
        let mut bank = BatteryBank::default();
        let mut watched = vec![Watched::default(); 3];
        let mut now = Instant::EPOCH;
        for (ticks, [first, second]) in stretches {
            for _ in 0..ticks {
                now = now.after_us(100_000);
                let tick = Tick { now, load_state: LoadState::On };
                for (pack, watched) in [Pack::First, Pack::Second, SUM].into_iter().zip(&mut watched) {
                    let reading = match pack {
                        Pack::First => first,
                        Pack::Second => second,
                        _ => bank.sum(SUM, BOTH, PackSet::ALL, SumVoltage::Mean, LoadState::On),
                    };
                    let update = bank.update(pack, tick, reading, &settings);
                    let state = bank.state(pack);
                    let seen = (reading.is_ok() && state.status == PackStatus::Healthy).then_some(state);
                    watched.lost_ticks = if seen.is_some() { 0 } else { watched.lost_ticks + 1 };
                    if update.failsafe.contains(&FailsafeLevel::Unhealthy) {
                        prop_assert!(watched.lost_ticks >= 50, "{pack:?} {watched:?}");
                    }
                    watched.most_severe = watched.most_severe.max(action(pack, &update.failsafe));
                    let is_critical = watched.critical.is_first(seen, &critical, timer_s);
                    let is_low = watched.low.is_first(seen, &low, timer_s) || (is_critical && failsafe.is_in_force(&low, state));
                    for (is_passed, level) in [(is_low, FailsafeLevel::Low), (is_critical, FailsafeLevel::Critical)] {
                        prop_assert!(
                            !is_passed || watched.most_severe >= action(pack, &[level]),
                            "{pack:?} {level:?} {state:?}"
                        );
                    }
                }
            }
        }
    }
}
