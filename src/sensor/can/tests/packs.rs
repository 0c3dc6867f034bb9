//! Readings of packs, and solar chargers.

use proptest::prelude::*;

use super::golden::{self, frames};
use super::{Battery, CanBench, charger, message, node, pack};
use crate::battery::{
    ChargeState, Faults, Gauge, GaugeReading, GaugeReport, Measurement, Modes, Supply, Thermometer,
};
use crate::memory::identity::Identity;
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, Parameters, VehicleParameter};
use crate::sensor::can::messages::{DataType, TEMPERATURE};
use crate::sensor::can::packs::CAN_TIMEOUT_US;
use crate::sensor::{
    CanEvent, CanFrame, CanNotice, CanOptions, CanPack, CanSettings, CanSetup, ChargerPower,
    TemperatureMessages,
};
use crate::vehicle::ArmState;

fn with(options: CanOptions) -> CanPack {
    CanPack {
        options,
        ..pack(Pack::First)
    }
}

fn of_battery(number: Pack, battery_id: i32) -> CanPack {
    CanPack {
        battery_id: Some(battery_id),
        ..pack(number)
    }
}

/// The reading of a pack of which only this is known.
fn reading_of(battery: Battery) -> Measurement {
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    bench.receive(&battery.frames(0));
    bench.take_reading()
}

fn is_close(value: Option<f32>, expected: f32) -> bool {
    value.is_some_and(|value| (value - expected).abs() < 2e-3 * expected.abs())
}

#[test]
fn battery_of_the_reference_is_read() {
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    bench.receive(&frames(golden::BATTERY_INFO));
    let source = CanEvent::Announce(CanNotice::Source(Pack::First, node(42)));
    assert_eq!(bench.events[0], source);
    let alone = bench.take_reading();
    assert!(is_close(alone.voltage_v, 12.6), "{alone:?}");
    assert_eq!(alone.current_a, Some(-3.5));
    assert!(is_close(alone.temperature_c, 25.1), "{alone:?}");
    assert_eq!(alone.state_of_charge, Some(0.8));
    assert_eq!(alone.gauge, GaugeReading::Missing, "no nominal voltage is known");
    assert_eq!(alone.details.state_of_health_pct, Some(97));
    assert_eq!(
        alone.reported.gauge,
        GaugeReport {
            error_pct: Some(3),
            over_discharges: None,
            energies_wh: Some([40.0, 50.0]),
        }
    );
    assert_eq!(alone.details.device.as_bytes(), b"Smart LiPo 3S");
    assert_eq!((alone.cells.millivolts(), alone.supply), (&[][..], Supply::On));

    bench.receive(&frames(golden::BATTERY_AUX));
    bench.receive(&frames(golden::BATTERY_INFO));
    let whole = bench.take_reading();
    // As floats of 16 bits: in steps of 4 mV.
    assert_eq!(whole.cells.millivolts(), [4199, 4195, 4180]);
    assert_eq!(whole.details.cycle_count, Some(123));
    assert_eq!(whole.reported.gauge.over_discharges, Some(4));
    assert_eq!(whole.supply, Supply::PoweringOff);
    let gauge = whole.gauge.read().expect("a gauge");
    assert!(
        is_close(Some(gauge.remaining_mah), 40.0 / 11.1 * 1000.0),
        "{gauge:?}"
    );
    assert!(is_close(Some(gauge.full_mah), 50.0 / 11.1 * 1000.0), "{gauge:?}");
}

#[test]
fn motor_controller_of_the_reference_is_read() {
    let mut bench = CanBench::with_packs(&[]);
    bench.receive(&frames(golden::CONTROLLER));
    let [CanEvent::Controller(19, reading)] = bench.events[..] else {
        panic!("{:?}", bench.events);
    };
    assert_eq!((reading.voltage_v, reading.current_a), (Some(23.5), Some(-1.25)));
    assert!(is_close(reading.temperature_c, 40.1), "{reading:?}");
}

#[test]
fn current_is_multiplied() {
    let settings = CanPack {
        current_multiplier: 2.5,
        ..pack(Pack::First)
    };
    let mut bench = CanBench::with_packs(&[settings]);
    bench.receive(&Battery::new(42, 0).frames(0));
    assert_eq!(bench.take_reading().current_a, Some(5.0));
}

#[test]
// AP_Periph sends 0 for all that it does not know, and never sends energies.
fn no_charge_beside_no_energies_is_unknown_until_another_charge_was_reported() {
    let of = |charge_pct, remaining_wh, full_wh| Battery {
        charge_pct,
        remaining_wh,
        full_wh,
        ..Battery::new(42, 0)
    };
    let mut bench = CanBench::with_packs(&[with(CanOptions::DYNAMIC_NODE)]);
    for (place, (battery, expected)) in [
        (of(0, 0.0, 0.0), None),
        (of(0, 0.0, 60.0), Some(0.0)),
        (of(0, f32::NAN, f32::NAN), Some(0.0)),
        (of(0, 0.0, 0.0), None),
        (of(127, 0.0, 0.0), None),
        (of(0, 0.0, 0.0), None),
        (of(1, 0.0, 0.0), Some(0.01)),
        (of(0, 0.0, 0.0), Some(0.0)),
    ]
    .into_iter()
    .enumerate()
    {
        bench.receive(&battery.frames(0));
        assert_eq!(bench.take_reading().state_of_charge, expected, "{place}");
    }
    // Silence changes nothing; another battery is another one.
    bench.run_ms(CAN_TIMEOUT_US / 1000 + 100);
    bench.receive(&of(0, 0.0, 0.0).frames(0));
    assert_eq!(bench.take_reading().state_of_charge, Some(0.0));
    bench.run_ms(CAN_TIMEOUT_US / 1000 + 100);
    let other = Battery {
        node: 43,
        ..of(0, 0.0, 0.0)
    };
    bench.receive(&other.frames(0));
    assert_eq!(bench.take_reading().state_of_charge, None);
}

#[test]
fn charge_is_ignored_by_option() {
    let mut bench = CanBench::with_packs(&[with(CanOptions::IGNORE_CHARGE)]);
    let battery = Battery::new(42, 0);
    bench.receive(&battery.frames(0));
    assert_eq!(bench.take_reading().state_of_charge, None);
    bench.receive(&battery.aux(&[4.0, 4.0], 8.0));
    bench.receive(&battery.frames(1));
    let reading = bench.take_reading();
    assert_eq!(reading.gauge, GaugeReading::Absent);
    assert_eq!(reading.state_of_charge, None);
    assert_eq!(reading.cells.millivolts(), [4000, 4000]);
}

#[test]
fn energies_are_a_gauge_if_they_make_sense() {
    let battery = Battery::new(42, 0);
    let gauge = |remaining_mah, full_mah| {
        GaugeReading::Read(Gauge {
            remaining_mah,
            full_mah,
        })
    };
    let missing = GaugeReading::Missing;
    let having = |remaining_wh, full_wh, charge_pct| Battery {
        remaining_wh,
        full_wh,
        charge_pct,
        ..battery
    };
    for (changed, nominal_v, expected) in [
        (battery, 12.0, gauge(2500.0, 5000.0)),
        (battery, 0.0, missing),
        (battery, f32::NAN, missing),
        (having(30.0, 0.0, 50), 12.0, missing),
        (having(30.0, f32::NAN, 50), 12.0, missing),
        (having(0.0, 60.0, 50), 12.0, missing),
        (having(0.0, 60.0, 0), 12.0, gauge(0.0, 5000.0)),
        (having(-1.0, 60.0, 50), 12.0, missing),
    ] {
        let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
        bench.receive(&battery.frames(0));
        bench.take_readings();
        bench.receive(&battery.aux(&[], nominal_v));
        bench.receive(&changed.frames(1));
        assert_eq!(bench.take_reading().gauge, expected, "{changed:?} {nominal_v}");
    }
}

#[test]
fn flags_of_a_battery_are_in_its_readings() {
    // IN_USE, CHARGING, CHARGED, TEMP_HOT and BAD_BATTERY.
    let flags = 1 | 2 | 4 | 8 | 64;
    let battery = Battery {
        flags,
        ..Battery::new(42, 0)
    };
    let reported = reading_of(battery).reported;
    assert_eq!(reported.faults, Faults::OVER_TEMPERATURE | Faults::BAD_BATTERY);
    assert_eq!(reported.charge_state, Some(ChargeState::Charging));
    assert_eq!(reported.modes, Modes::FULL);
}

#[test]
fn gauge_outlasts_the_silence_of_what_reports_the_nominal_voltage() {
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    let battery = Battery::new(42, 0);
    bench.receive(&battery.frames(0));
    bench.receive(&battery.aux(&[], 12.0));
    bench.run_with(60, &battery.frames(0));
    bench.take_readings();
    bench.receive(&battery.frames(0));
    let gauge = GaugeReading::Read(Gauge {
        remaining_mah: 2500.0,
        full_mah: 5000.0,
    });
    assert_eq!(bench.take_reading().gauge, gauge);
}

#[test]
fn all_cells_count_or_none() {
    let mut low = vec![4.0; 22];
    low[21] = 2.0;
    for (cells_v, count, lowest_v) in [
        (vec![4.0; 14], 14, Some(4.0)),
        (vec![4.0; 15], 15, Some(4.0)),
        (low, 22, Some(2.0)),
        (vec![4.0, f32::NAN, 4.0], 0, None),
        (vec![4.0, -1.0], 0, None),
    ] {
        let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
        let battery = Battery::new(42, 0);
        bench.receive(&battery.frames(0));
        bench.receive(&battery.aux(&cells_v, 0.0));
        bench.take_readings();
        bench.receive(&battery.frames(1));
        let reading = bench.take_reading();
        assert_eq!(reading.cells.count(), count);
        assert_eq!(reading.cells.lowest_v(), lowest_v);
        assert_eq!(reading.details.cycle_count, Some(17));
    }
}

#[test]
// Requirement: L-20
fn cells_are_dropped_when_they_are_old() {
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    let battery = Battery::new(42, 0);
    bench.receive(&battery.frames(0));
    bench.receive(&battery.aux(&[4.0, 4.0], 0.0));
    bench.run_with(12, &battery.frames(0));
    bench.take_readings();
    bench.receive(&battery.frames(0));
    assert_eq!(bench.take_reading().cells.millivolts().len(), 2, "after 12 s");
    bench.run_ms(100);
    bench.receive(&battery.frames(0));
    assert_eq!(bench.take_reading().cells.millivolts().len(), 0);
}

#[test]
fn batteries_go_to_the_packs_with_their_ids() {
    let mut bench = CanBench::with_packs(&[of_battery(Pack::First, 7), of_battery(Pack::Second, 3)]);
    for (node, battery_id, voltage_v) in [
        (40, 3, 13.0),
        (41, 7, 14.0),
        (42, 9, 15.0),
        // An id that another node has.
        (43, 7, 16.0),
    ] {
        let battery = Battery {
            voltage_v,
            ..Battery::new(node, battery_id)
        };
        bench.receive(&battery.frames(0));
    }
    assert_eq!(bench.take_voltages(), [(Pack::Second, 13.0), (Pack::First, 14.0)]);
}

#[test]
fn a_pack_that_names_its_battery_comes_before_one_that_takes_any() {
    // One that takes any, and two that name theirs.
    let packs = [
        pack(Pack::First),
        of_battery(Pack::Second, 7),
        of_battery(Pack::Third, 3),
    ];
    let batteries =
        [(40, 7, 14.0), (41, 3, 13.0), (42, 9, 15.0)].map(|(node, battery_id, voltage_v)| Battery {
            voltage_v,
            ..Battery::new(node, battery_id)
        });
    let expected = [(Pack::First, 15.0), (Pack::Second, 14.0), (Pack::Third, 13.0)];
    for order in [[0, 1, 2], [0, 2, 1], [1, 0, 2], [1, 2, 0], [2, 0, 1], [2, 1, 0]] {
        let mut bench = CanBench::with_packs(&packs);
        let voltages = |bench: &mut CanBench, order: [usize; 3]| {
            for index in order {
                bench.receive(&batteries[index].frames(0));
            }
            let mut voltages = bench.take_voltages();
            voltages.sort_by_key(|(pack, _)| *pack);
            voltages
        };
        assert_eq!(voltages(&mut bench, order), expected, "{order:?}");
        // All nodes restart, and return in another order.
        bench.run_ms(20_000);
        let reversed = [order[2], order[1], order[0]];
        assert_eq!(voltages(&mut bench, reversed), expected, "{order:?} reversed");
    }
}

#[test]
fn second_battery_with_a_named_id_is_any_battery() {
    let mut bench = CanBench::with_packs(&[pack(Pack::First), of_battery(Pack::Second, 7)]);
    for node in [40, 41, 42] {
        let voltage_v = node.into();
        bench.receive(
            &Battery {
                voltage_v,
                ..Battery::new(node, 7)
            }
            .frames(0),
        );
    }
    assert_eq!(bench.take_voltages(), [(Pack::Second, 40.0), (Pack::First, 41.0)]);
}

#[test]
// Requirement: L-20
fn battery_that_moves_to_another_node_waits_for_the_pack_that_names_it() {
    let named = CanPack {
        options: CanOptions::DYNAMIC_NODE,
        ..of_battery(Pack::Second, 7)
    };
    let mut bench = CanBench::with_packs(&[pack(Pack::First), named]);
    bench.receive(&Battery::new(40, 7).frames(0));
    bench.run_ms(2000);
    bench.take_readings();
    let moved = Battery {
        voltage_v: 13.0,
        ..Battery::new(41, 7)
    };
    bench.run_with(3, &moved.frames(0));
    assert_eq!(bench.take_voltages(), [], "the pack is not lost yet");
    bench.run_ms(100);
    bench.receive(&moved.frames(1));
    assert_eq!(bench.take_voltages(), [(Pack::Second, 13.0)]);
}

#[test]
fn batteries_take_the_packs_in_order_if_these_take_any() {
    let mut bench = CanBench::with_packs(&[pack(Pack::Second), pack(Pack::Fourth)]);
    // Two of one node, and one too many.
    let batteries = [Battery::new(40, 1), Battery::new(40, 0), Battery::new(41, 0)];
    for battery in batteries.iter().chain(&batteries) {
        bench.receive(&battery.frames(0));
    }
    let packs: Vec<Pack> = bench.take_voltages().into_iter().map(|(pack, _)| pack).collect();
    assert_eq!(packs, [Pack::Second, Pack::Fourth, Pack::Second, Pack::Fourth]);
}

#[test]
// Requirement: L-20
fn another_node_takes_a_lost_ones_place_by_option_only() {
    for (options, expected) in [
        (CanOptions::default(), None),
        (CanOptions::DYNAMIC_NODE, Some((Pack::First, 13.0))),
    ] {
        let mut bench = CanBench::with_packs(&[with(options)]);
        let other = Battery {
            voltage_v: 13.0,
            ..Battery::new(41, 0)
        };
        bench.receive(&Battery::new(40, 0).frames(0));
        bench.receive(&other.frames(0));
        assert_eq!(bench.take_voltages(), [(Pack::First, 12.0)], "the first is kept");
        bench.run_ms(CAN_TIMEOUT_US / 1000);
        bench.receive(&other.frames(1));
        assert_eq!(bench.take_voltages(), [], "until it is lost");
        bench.run_ms(100);
        bench.receive(&other.frames(2));
        assert_eq!(bench.take_voltages().first().copied(), expected);
    }
}

#[test]
// Requirement: S-5, L-20
fn changed_id_releases_the_battery() {
    let mut bench = CanBench::with_packs(&[of_battery(Pack::First, 7)]);
    bench.receive(&Battery::new(40, 7).frames(0));
    bench.settings.packs[0].battery_id = Some(300);
    bench.run_ms(100);
    bench.receive(&Battery::new(40, 7).frames(1));
    assert_eq!(bench.take_voltages().len(), 1, "no battery has this id");
    bench.settings.packs[0].battery_id = Some(8);
    bench.run_ms(100);
    bench.receive(&Battery::new(41, 8).frames(0));
    assert_eq!(bench.take_voltages().len(), 1);
}

#[test]
// Requirement: L-20
fn changed_id_releases_a_silent_battery_and_keeps_one_that_reports() {
    let mut bench = CanBench::with_packs(&[of_battery(Pack::First, 7)]);
    bench.receive(&Battery::new(40, 7).frames(0));
    bench.settings.packs[0].battery_id = None;
    bench.run_ms(100);
    bench.receive(&Battery::new(41, 8).frames(0));
    assert_eq!(bench.take_voltages().len(), 1, "the first still reports");

    bench.settings.packs[0].battery_id = Some(7);
    bench.run_ms(CAN_TIMEOUT_US / 1000);
    bench.settings.packs[0].battery_id = None;
    bench.run_ms(100);
    bench.take_readings();
    bench.receive(&Battery::new(41, 8).frames(1));
    assert_eq!(bench.take_voltages().len(), 1, "the first is silent");

    // Set within the time-out, and silent from then on.
    bench.settings.packs[0].battery_id = Some(8);
    bench.run_ms(1000);
    bench.settings.packs[0].battery_id = None;
    bench.run_ms(CAN_TIMEOUT_US / 1000 + 100);
    bench.take_readings();
    bench.receive(&Battery::new(40, 7).frames(2));
    assert_eq!(bench.take_voltages().len(), 1, "the second is silent");
}

#[test]
fn aux_of_another_node_counts_by_option_only() {
    for (options, cells) in [(CanOptions::default(), 0), (CanOptions::SPLIT_AUX, 2)] {
        let settings = CanPack {
            options,
            ..of_battery(Pack::First, 7)
        };
        let mut bench = CanBench::with_packs(&[settings]);
        let aux = Battery::new(50, 7).aux(&[4.0, 4.0], 0.0);
        bench.receive(&aux);
        bench.receive(&Battery::new(40, 7).frames(0));
        bench.receive(&aux);
        bench.receive(&Battery::new(40, 7).frames(1));
        let readings = bench.take_readings();
        let counts = readings
            .iter()
            .map(|(_, reading)| reading.cells.millivolts().len());
        assert_eq!(counts.collect::<Vec<_>>(), [0, cells]);
    }
}

#[test]
fn settings_are_those_of_the_parameters() {
    let mut parameters = Parameters::defaults();
    assert_eq!(CanSetup::from_parameters(&parameters, &Default::default()), None);
    parameters.set(VehicleParameter::CanP1Driver, 1.0).unwrap();
    let set_up =
        |parameters: &Parameters| CanSetup::from_parameters(parameters, &Default::default()).unwrap();
    assert_eq!(set_up(&parameters).node_id, Some(node(10)));
    parameters.set(VehicleParameter::CanD1UcNode, 0.0).unwrap();
    assert_eq!(set_up(&parameters).node_id, None);

    for (parameter, value) in [
        (BatteryParameter::SerialNum, 7.0),
        (BatteryParameter::CurrMult, 0.5),
        (BatteryParameter::Options, 1025.0),
    ] {
        parameters.set(parameter.of(Pack::Third), value).unwrap();
    }
    let settings = CanSettings::new([Pack::Third], &parameters, &Identity::default(), ArmState::Armed);
    let expected = CanPack {
        pack: Pack::Third,
        battery_id: Some(7),
        current_multiplier: 0.5,
        options: CanOptions::from_bits(1025),
    };
    assert_eq!(
        (&settings.packs[..], settings.arm_state),
        (&[expected][..], ArmState::Armed)
    );
    let options = expected.options;
    assert!(options.has(CanOptions::IGNORE_CHARGE) && options.has(CanOptions::DYNAMIC_NODE));
    assert!(!options.has(CanOptions::SPLIT_AUX));
}

proptest! {
    /// Whatever batteries send, in any order: a pack's readings are those of one battery until that is lost.
    #[test]
    fn pack_never_alternates(
        steps in prop::collection::vec((40u8..44, 0u8..3, 0u64..3_000), 1..60),
        options in prop_oneof![Just(CanOptions::default()), Just(CanOptions::DYNAMIC_NODE)],
    ) {
        let mut bench = CanBench::with_packs(&[with(options), pack(Pack::Second), of_battery(Pack::Third, 1)]);
        let mut last = std::collections::HashMap::new();
        for (node, battery_id, pause_ms) in steps {
            bench.run_ms(pause_ms / 100 * 100);
            bench.events.clear();
            let voltage_v = f32::from(node) + f32::from(battery_id) / 4.0;
            bench.receive(&Battery { voltage_v, ..Battery::new(node, battery_id) }.frames(0));
            for (pack, read_v) in bench.take_voltages() {
                prop_assert_eq!(read_v, voltage_v);
                let before = last.insert(pack.number(), (read_v, bench.now));
                if let Some((before_v, heard)) = before {
                    prop_assert!(before_v == read_v || bench.now.us_since(heard) > CAN_TIMEOUT_US);
                }
            }
        }
    }
}

#[test]
// Requirement: AP-30
fn a_temperature_is_that_of_its_device_and_passes_the_filters_when_it_is_wanted() {
    // Device 1234 at 293.15 K: single precision 0x43929333, rounded to half 0x5c95.
    let thermometer = message(
        33,
        TEMPERATURE,
        DataType::Temperature,
        0,
        &[0xd2, 0x04, 0x95, 0x5c, 0],
    );
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    let passes = |bench: &CanBench| bench.can.acceptance().second.pass(thermometer[0].id());
    assert!(!passes(&bench));
    bench.settings.temperatures = TemperatureMessages::Wanted;
    bench.run_ms(100);
    assert!(passes(&bench));
    bench.receive(&thermometer);
    let [CanEvent::Temperature(1234, temperature_c)] = bench.events[..] else {
        panic!("{:?}", bench.events);
    };
    assert!((temperature_c - 20.0).abs() < 0.2, "{temperature_c}");
}

/// Requests of node 10 to the charger, node 33.
const SWITCH: u32 = 0x00f0_a18a;

/// A pack that names the charger.
fn charger_with(options: &[i32]) -> CanBench {
    let bits = options.iter().map(|bit| 1 << bit).sum();
    CanBench::with_packs(&[CanPack {
        options: CanOptions::from_bits(bits),
        ..of_battery(Pack::First, 33)
    }])
}

/// What the charger is switched to, in order.
fn switched(bench: &mut CanBench) -> Vec<u8> {
    bench
        .sent_of(SWITCH)
        .iter()
        .map(|frame| frame.data()[0])
        .collect()
}

fn answer(request: &CanFrame, is_on: u8) -> CanFrame {
    CanFrame::new(0x18f0_0aa1, &[is_on, request.data()[1]]).unwrap()
}

#[test]
fn charger_of_the_reference_is_read_at_its_output_or_input() {
    for (options, voltage_v, current_a) in [(&[][..], 25.2, 5.75), (&[1], 36.5, 4.25)] {
        let mut bench = charger_with(options);
        bench.receive(&frames(golden::CHARGER));
        let readings = bench.take_readings();
        let reading = readings[0].1;
        assert!(
            (reading.voltage_v.unwrap() - voltage_v).abs() < 0.01,
            "{reading:?}"
        );
        assert_eq!(reading.current_a, Some(current_a));
        assert_eq!(reading.temperature_c, Some(-5.0));
        assert_eq!(reading.thermometer, Thermometer::Device);
        assert_eq!(reading.state_of_charge, None);
        assert_eq!(reading.gauge, GaugeReading::Absent);
    }
}

/// Voltage of the output of `charger`.
const CHARGER_V: f32 = 24.0;

#[test]
fn it_gets_a_pack_that_takes_any_after_ten_seconds_without_a_battery() {
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    bench.run_with(10, &charger(33, 0));
    assert_eq!(bench.take_voltages(), []);
    bench.receive(&charger(33, 0));
    assert_eq!(bench.take_voltages(), [(Pack::First, CHARGER_V)]);
    // A battery does not displace it, not even after its silence.
    bench.run_with(20, &Battery::new(40, 0).frames(0));
    assert_eq!(bench.take_voltages(), []);
    bench.receive(&charger(33, 0));
    assert_eq!(bench.take_voltages(), [(Pack::First, CHARGER_V)]);
}

#[test]
fn it_leaves_the_first_pack_to_a_battery_that_comes_later() {
    let mut bench = CanBench::with_packs(&[pack(Pack::First), pack(Pack::Second)]);
    bench.run_with(9, &charger(33, 0));
    bench.receive(&Battery::new(40, 0).frames(0));
    bench.run_with(2, &charger(33, 0));
    let expected = [(Pack::First, 12.0), (Pack::Second, CHARGER_V)];
    assert_eq!(bench.take_voltages(), expected);
    // Its battery is silent for a minute, and returns.
    bench.run_with(60, &charger(33, 0));
    assert!(
        bench
            .take_voltages()
            .iter()
            .all(|reading| *reading == expected[1])
    );
    bench.receive(&Battery::new(40, 0).frames(1));
    assert_eq!(bench.take_voltages(), [expected[0]]);
}

#[test]
// Requirement: L-20
fn it_takes_a_lost_batterys_place_by_option_after_ten_seconds() {
    let mut bench = CanBench::with_packs(&[with(CanOptions::DYNAMIC_NODE)]);
    bench.run_ms(20_000);
    bench.receive(&Battery::new(40, 0).frames(0));
    bench.take_readings();
    bench.run_with(10, &charger(33, 0));
    assert_eq!(bench.take_voltages(), []);
    bench.receive(&charger(33, 0));
    assert_eq!(bench.take_voltages(), [(Pack::First, CHARGER_V)]);
}

#[test]
fn its_faults_are_in_its_readings() {
    for (flags, faults) in [
        (0, Faults::empty()),
        (1, Faults::INCOMPATIBLE_VOLTAGE),
        (2, Faults::INCOMPATIBLE_VOLTAGE),
        (9, Faults::INCOMPATIBLE_VOLTAGE | Faults::OVER_TEMPERATURE),
        (4, Faults::OVER_CURRENT),
        (0xf0, Faults::empty()),
    ] {
        let mut bench = charger_with(&[]);
        bench.receive(&charger(33, flags));
        let readings = bench.take_readings();
        assert_eq!(readings[0].1.reported.faults, faults, "{flags}");
    }
}

#[test]
fn it_is_left_alone_without_options() {
    let mut bench = charger_with(&[]);
    bench.run_with(3, &charger(33, 0));
    bench.settings.arm_state = ArmState::Armed;
    bench.run_with(3, &charger(33, 0));
    assert!(switched(&mut bench).is_empty());
}

#[test]
fn it_is_switched_when_it_is_found_as_by_the_reference() {
    let mut bench = charger_with(&[5, 4]);
    bench.run_ms(2000);
    assert_eq!(switched(&mut bench), [], "it was not found yet");
    bench.receive(&charger(33, 0));
    bench.run_ms(100);
    assert_eq!(bench.sent_of(SWITCH), frames(golden::SWITCH_ON));
    assert!(
        bench
            .take_notices()
            .contains(&CanNotice::Charger(Pack::First, ChargerPower::On))
    );
    bench.receive(&frames(golden::IS_ON));
    bench.run_ms(5000);
    assert_eq!(switched(&mut bench), [], "it has confirmed");

    let mut bench = charger_with(&[4]);
    bench.receive(&charger(33, 0));
    bench.run_ms(100);
    assert_eq!(switched(&mut bench), [0b01]);
}

#[test]
// Requirement: L-20
fn it_is_asked_each_second_until_it_confirms() {
    let mut bench = charger_with(&[5]);
    bench.receive(&charger(33, 0));
    bench.run_ms(3000);
    let requests = bench.sent_of(SWITCH);
    assert_eq!(requests.len(), 3);
    // An answer that it is still off, one to an older request, and one of another node.
    bench.receive(&[answer(&requests[2], 0), answer(&requests[1], 1)]);
    bench.receive(&[CanFrame::new(0x18f0_0aa2, &[1, requests[2].data()[1]]).unwrap()]);
    bench.run_ms(1000);
    let requests = bench.sent_of(SWITCH);
    assert_eq!(requests.len(), 1);
    bench.receive(&[answer(&requests[0], 1)]);
    bench.run_ms(5000);
    assert_eq!(switched(&mut bench), []);
    let notices = bench.take_notices();
    let switched = notices
        .iter()
        .filter(|notice| matches!(notice, CanNotice::Charger(..)));
    assert_eq!(switched.count(), 1, "announced once");
    assert!(notices.contains(&CanNotice::Source(Pack::First, node(33))));
}

#[test]
fn it_is_switched_by_a_ground_station() {
    let mut bench = charger_with(&[]);
    bench.receive(&charger(33, 0));
    for (power, expected) in [(ChargerPower::Off, 0b01), (ChargerPower::On, 0b10)] {
        bench.settings.switched = Some(power);
        bench.run_ms(100);
        bench.settings.switched = None;
        let requests = bench.sent_of(SWITCH);
        assert_eq!(requests.len(), 1);
        assert_eq!(requests[0].data()[0], expected);
        bench.receive(&[answer(&requests[0], expected >> 1)]);
        bench.run_ms(5000);
        assert_eq!(switched(&mut bench), [], "it has confirmed");
    }
}

#[test]
fn it_follows_arming_by_options() {
    for (options, armed, disarmed) in [
        (&[2][..], &[][..], &[0b01][..]),
        (&[3], &[0b10], &[]),
        (&[2, 3], &[0b10], &[0b01]),
    ] {
        let mut bench = charger_with(options);
        bench.receive(&charger(33, 0));
        bench.run_ms(100);
        assert_eq!(switched(&mut bench), []);
        for (arm_state, expected) in [(ArmState::Armed, armed), (ArmState::Disarmed, disarmed)] {
            bench.settings.arm_state = arm_state;
            bench.run_ms(100);
            let requests = bench.sent_of(SWITCH);
            let values: Vec<u8> = requests.iter().map(|frame| frame.data()[0]).collect();
            assert_eq!(values, expected, "{options:?} {arm_state:?}");
            for request in &requests {
                bench.receive(&[answer(request, request.data()[0] >> 1)]);
            }
        }
    }
}
