//! What each part measures arrives on the wire within a step of its register.

use super::{Second, after_a_second, shared, with_second_pack};
use emulator::i2c_devices::{Ina226, Ina228, Ina260, Ina3221, Pec, SmartBattery};
use support::frames::{BatteryStatus, last_of, texts_of};
use support::monitor_types::{INA2XX, SMART_BATTERY};
use workbench::bench::{Bench, SECOND};

const INA3221: f32 = 30.0;

/// A step of 1.25 mV may round to either side.
pub fn assert_measures(status: &BatteryStatus<'_>, volts: f64, step_v: f64, amperes: f64, step_a: f64) {
    let off_v = (f64::from(status.voltage_mv(0)) / 1000.0 - volts).abs();
    assert!(off_v <= step_v.max(0.0005), "{} mV", status.voltage_mv(0));
    let off_a = (f64::from(status.current_ca()) / 100.0 - amperes).abs();
    assert!(off_a <= step_a.max(0.005) + 1e-9, "{} cA", status.current_ca());
}

#[test]
// Requirement: AP-6
fn an_ina226_is_found_and_measures_as_its_datasheet_says() {
    // The datasheet's example: 10 A through 2 mOhm at 11.98 V. In 2.5 uV over 2 mOhm there are 1.25 mA.
    let part = shared(Ina226::new(0.002));
    part.borrow_mut().set(11.98, 10.0);
    let mut bench = with_second_pack(INA2XX, 0x40, &part, &[("BATT2_SHUNT", 0.002)]);
    after_a_second(&mut bench, |status| {
        assert_measures(&status, 11.98, 1.25e-3, 10.0, 1.25e-3)
    });
    part.borrow_mut().set(7.3, -2.5);
    after_a_second(&mut bench, |status| {
        assert_measures(&status, 7.3, 1.25e-3, -2.5, 1.25e-3)
    });
}

#[test]
fn an_ina260_has_its_shunt_inside() {
    let part = shared(Ina260::new());
    part.borrow_mut().set(12.345, 4.2);
    let mut bench = with_second_pack(INA2XX, 0x45, &part, &[("BATT2_SHUNT", 0.5)]);
    after_a_second(&mut bench, |status| {
        assert_measures(&status, 12.345, 1.25e-3, 4.2, 1.25e-3)
    });
}

#[test]
fn an_ina228_counts_charge_and_energy_itself() {
    let part = shared(Ina228::new(0.0005));
    part.borrow_mut().set(12.0, 36.0, 60.0);
    let parameters = [("BATT2_I2C_ADDR", 74.0), ("BATT2_MAX_AMPS", 100.0)];
    let mut bench = with_second_pack(INA2XX, 74, &part, &parameters);
    let (before_mah, before_hj) = after_a_second(&mut bench, |status| {
        // 312.5 nV over 0.5 mOhm.
        assert_measures(&status, 12.0, 195.3e-6, 36.0, 0.625e-3);
        assert_eq!(
            status.temperature_cdegc(),
            i16::MAX,
            "the chip's is not the pack's"
        );
        (status.consumed_mah(), status.energy_hj())
    });
    bench.run_for(19 * SECOND);
    after_a_second(&mut bench, |status| {
        // 36 A are 10 mAh a second, 12 V times that 432 J or 4.32 hJ.
        assert!((status.consumed_mah() - before_mah).abs_diff(200) <= 1);
        assert!((status.energy_hj() - before_hj).abs_diff(86) <= 1);
    });
    // It charges now.
    part.borrow_mut().set(12.0, -36.0, 60.0);
    let (full_mah, full_hj) =
        after_a_second(&mut bench, |status| (status.consumed_mah(), status.energy_hj()));
    bench.run_for(9 * SECOND);
    after_a_second(&mut bench, |status| {
        assert!((full_mah - status.consumed_mah()).abs_diff(100) <= 1);
        assert!((full_hj - status.energy_hj()).abs_diff(43) <= 1);
    });
}

#[test]
fn an_ina228_counts_on_while_it_is_not_read() {
    let part = shared(Ina228::new(0.001));
    part.borrow_mut().set(12.0, 36.0, 25.0);
    let parameters = [("BATT2_I2C_ADDR", 64.0), ("BATT2_SHUNT", 0.001)];
    let mut bench = with_second_pack(INA2XX, 0x40, &part, &parameters);
    let before_mah = after_a_second(&mut bench, |status| status.consumed_mah());
    bench.i2c(super::BUS).detach(0x40);
    bench.run_for(10 * SECOND);
    bench.i2c(super::BUS).attach(0x40, Box::new(part));
    after_a_second(&mut bench, |status| {
        assert!(
            (status.consumed_mah() - before_mah).abs_diff(110) <= 4,
            "{} mAh",
            status.consumed_mah()
        );
    });
    assert!(
        !texts_of(&bench.frames())
            .iter()
            .any(|text| text.contains("not measured"))
    );
}

#[test]
// Requirement: AP-6
fn an_ina3221_measures_three_packs_with_one_set_of_transfers() {
    let part = shared(Ina3221::new(0.001));
    for (channel, volts, amperes) in [(1, 12.6, 1.2), (2, 7.4, -0.4), (3, 5.0, 10.0)] {
        part.borrow_mut().set(channel, volts, amperes);
    }
    let mut parameters = vec![("BATT2_SHUNT", 0.001)];
    parameters.extend([
        ("BATT3_MONITOR", INA3221),
        ("BATT3_SHUNT", 0.001),
        ("BATT3_CHANNEL", 2.0),
    ]);
    parameters.extend([
        ("BATT4_MONITOR", INA3221),
        ("BATT4_SHUNT", 0.001),
        ("BATT4_CHANNEL", 3.0),
    ]);
    let mut bench = with_second_pack(INA3221, 0x42, &part, &parameters);
    bench.run_for(SECOND);
    let frames = bench.frames();
    for (instance, volts, amperes) in [(1, 12.6, 1.2), (2, 7.4, -0.4), (3, 5.0, 10.0)] {
        assert_measures(&last_of(&frames, instance), volts, 8e-3, amperes, 40e-3);
    }
    bench.i2c(super::BUS).take_transactions();
    bench.run_for(SECOND);
    let transfers = bench.i2c(super::BUS).take_transactions().len();
    assert!(
        transfers.abs_diff(10 * 7) <= 7,
        "{transfers} in a second: two for each channel, and a check"
    );
}

#[test]
// Requirement: AP-5
fn a_smart_battery_reports_all_values() {
    let part = shared(SmartBattery::new(Pec::Right));
    part.borrow_mut().set(11.1, 2.5, 31.0);
    part.borrow_mut().set_capacity(2600, 5000);
    let mut bench = with_second_pack(SMART_BATTERY, 0x0b, &part, &[]);
    after_a_second(&mut bench, |status| {
        assert_eq!(
            [0, 1, 2, 3].map(|cell| status.voltage_mv(cell)),
            [3700, 3700, 3700, 65535]
        );
        assert_eq!((status.current_ca(), status.temperature_cdegc()), (250, 3105));
        assert_eq!((status.consumed_mah(), status.remaining_pct()), (2400, 52));
        assert_eq!(status.time_remaining_s(), 2600 * 3600 / 2500);
        assert_eq!(status.battery_type(), 3, "it says LION");
    });
    part.borrow_mut().set(11.1, -2.5, 25.0);
    part.borrow_mut().set_capacity(2700, 5000);
    after_a_second(&mut bench, |status| {
        assert_eq!(
            (status.current_ca(), status.consumed_mah(), status.remaining_pct()),
            (-250, 2300, 54)
        );
    });
}

#[test]
fn a_sum_adds_up_packs_of_any_kind() {
    let part = shared(SmartBattery::new(Pec::Right));
    part.borrow_mut().set(12.0, 2.0, 30.0);
    part.borrow_mut().set_capacity(2600, 5000);
    let other = shared(Ina226::new(0.0005));
    other.borrow_mut().set(11.0, 3.0);
    let mut bench = Bench::running(super::DIVIDER_CODE);
    bench.i2c(super::BUS).attach(0x44, Box::new(other));
    let parameters = [("BATT_MONITOR", 10.0), ("BATT3_MONITOR", INA2XX)];
    Second {
        kind: SMART_BATTERY,
        address: 0x0b,
    }
    .configure(&mut bench, &part, &parameters);
    bench.run_for(10 * SECOND);
    let frames = bench.frames();
    let [sum, smart, monitor] = [0, 1, 2].map(|instance| last_of(&frames, instance));
    assert_eq!((sum.voltage_mv(0), sum.current_ca()), (11500, 500));
    assert_eq!(sum.consumed_mah(), smart.consumed_mah() + monitor.consumed_mah());
    assert!(sum.energy_hj().abs_diff(smart.energy_hj() + monitor.energy_hj()) <= 1 && sum.energy_hj() > 4);
    assert_eq!(sum.temperature_cdegc(), 3005);
}

#[test]
fn several_power_monitors_are_found_one_after_the_other() {
    let parts = [0x40, 0x41, 0x45].map(|address| (address, shared(Ina226::new(0.0005))));
    let mut bench = Bench::running(super::DIVIDER_CODE);
    for (place, (address, part)) in parts.iter().enumerate().skip(1) {
        part.borrow_mut().set(10.0 + place as f64, 1.0);
        bench
            .i2c(super::BUS)
            .attach(*address, Box::new(std::rc::Rc::clone(part)));
    }
    parts[0].1.borrow_mut().set(10.0, 1.0);
    let parameters = [("BATT3_MONITOR", INA2XX), ("BATT4_MONITOR", INA2XX)];
    Second {
        kind: INA2XX,
        address: 0x40,
    }
    .configure(&mut bench, &parts[0].1, &parameters);
    bench.run_for(SECOND);
    let frames = bench.frames();
    let volts = [1, 2, 3].map(|instance| last_of(&frames, instance).voltage_mv(0));
    assert_eq!(volts, [10_000, 11_000, 12_000]);
}

/// START, address and pointer, RESTART, address and two bytes, STOP.
const BITS_OF_A_READ: u64 = 1 + 18 + 1 + 27 + 1;
const CYCLES_PER_S: u64 = 125_000_000;

fn clock_hz(bench: &mut Bench) -> u64 {
    bench.i2c(super::BUS).take_transactions();
    bench.run_for(SECOND);
    let transfers = bench.i2c(super::BUS).take_transactions();
    let shortest = transfers
        .iter()
        .filter(|transfer| transfer.acked && transfer.written.len() == 1 && transfer.read.len() == 2)
        .map(|transfer| transfer.end - transfer.start)
        .min()
        .expect("something is read");
    BITS_OF_A_READ * CYCLES_PER_S / shortest
}

#[test]
fn the_clock_is_as_fast_as_the_slowest_part_stands() {
    let part = shared(Ina226::new(0.0005));
    part.borrow_mut().set(12.0, 1.0);
    let mut bench = with_second_pack(INA2XX, 0x40, &part, &[]);
    let fast_hz = clock_hz(&mut bench);
    assert!((350_000..=400_000).contains(&fast_hz), "{fast_hz} Hz");

    bench
        .i2c(super::BUS)
        .attach(0x0b, Box::new(SmartBattery::new(Pec::None)));
    bench.set("BATT3_MONITOR", SMART_BATTERY);
    bench.reboot();
    let slow_hz = clock_hz(&mut bench);
    assert!((90_000..=100_000).contains(&slow_hz), "{slow_hz} Hz");
}
