//! Solar chargers.

use super::bench::{Bench, charger, node, pack};
use super::golden::{self, frames};
use crate::battery::{Faults, GaugeReading};
use crate::pack::Pack;
use crate::sensor::{CanFrame, CanNotice, CanOptions, CanPack, ChargerPower};
use crate::vehicle::ArmState;

/// Requests of node 10 to the charger, node 33.
const SWITCH: u32 = 0x00f0_a18a;

fn with(options: &[i32]) -> Bench {
    let bits = options.iter().map(|bit| 1 << bit).sum();
    Bench::with_packs(&[CanPack {
        options: CanOptions::from_bits(bits),
        ..pack(Pack::First)
    }])
}

/// What the charger is switched to, in order.
fn switched(bench: &mut Bench) -> Vec<u8> {
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
        let mut bench = with(options);
        bench.receive(&frames(golden::CHARGER));
        let readings = bench.take_readings();
        let reading = readings[0].1;
        assert!(
            (reading.voltage_v.unwrap() - voltage_v).abs() < 0.01,
            "{reading:?}"
        );
        assert_eq!(
            (reading.current_a, reading.temperature_c),
            (Some(current_a), Some(-5.0))
        );
        assert_eq!(
            (reading.state_of_charge, reading.gauge),
            (None, GaugeReading::Absent)
        );
    }
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
        let mut bench = with(&[]);
        bench.receive(&charger(33, flags));
        let readings = bench.take_readings();
        assert_eq!(readings[0].1.reported.faults, faults, "{flags}");
    }
}

#[test]
fn it_is_left_alone_without_options() {
    let mut bench = with(&[]);
    bench.run_with(3, &charger(33, 0));
    bench.settings.arm_state = ArmState::Armed;
    bench.run_with(3, &charger(33, 0));
    assert_eq!(switched(&mut bench), []);
}

#[test]
fn it_is_switched_when_it_is_found_as_by_the_reference() {
    let mut bench = with(&[5, 4]);
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

    let mut bench = with(&[4]);
    bench.receive(&charger(33, 0));
    bench.run_ms(100);
    assert_eq!(switched(&mut bench), [0b01]);
}

#[test]
fn it_is_asked_each_second_until_it_confirms() {
    let mut bench = with(&[5]);
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
fn it_follows_arming_by_options() {
    for (options, armed, disarmed) in [
        (&[2][..], &[][..], &[0b01][..]),
        (&[3], &[0b10], &[]),
        (&[2, 3], &[0b10], &[0b01]),
    ] {
        let mut bench = with(options);
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
