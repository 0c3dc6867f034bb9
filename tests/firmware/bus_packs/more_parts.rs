//! The rest of the family: what each of them measures arrives on the wire within a step of its register.

use std::cell::RefCell;
use std::rc::Rc;

use super::values::assert_measures;
use super::{
    BUS, DIVIDER_CODE, Second, after_a_second, assert_survives_unplugging, shared, with_second_pack,
};
use emulator::LogLevel;
use emulator::i2c_devices::{Ad7091r5, Bebop, Garbled, Ina231, Ina238, Ltc2946, Reads, Reference};
use emulator::spi_devices::Ina239;
use support::frames::{last_of, texts_of};
use support::monitor_types::INA2XX;
use workbench::bench::{Bench, SECOND};

const BEBOP: f32 = 6.0;
const LTC2946: f32 = 22.0;
const INA239: f32 = 26.0;
const AD7091R5: f32 = 28.0;

/// Chip select of the SPI bus.
const SELECT: usize = 22;

#[test]
fn an_ina238_measures_with_16_bits() {
    let part = shared(Ina238::new(0.0005));
    part.borrow_mut().set(12.5, 30.0, 60.0);
    let mut bench = with_second_pack(INA2XX, 0x44, &part, &[]);
    after_a_second(&mut bench, |status| {
        // 5 uV over 0.5 mOhm.
        assert_measures(&status, 12.5, 3.125e-3, 30.0, 10e-3);
        assert_eq!(status.temperature_cdegc(), i16::MAX);
    });
    assert_survives_unplugging(&mut bench, 0x44, &part, |part| part.power_cycle());
}

#[test]
fn an_ina231_measures_the_voltage_of_the_pack_and_not_of_its_shunt() {
    let part = shared(Ina231::new(0.002));
    part.borrow_mut().set(11.1, 4.0);
    let mut bench = with_second_pack(INA2XX, 0x40, &part, &[("BATT2_SHUNT", 0.002)]);
    after_a_second(&mut bench, |status| {
        assert_measures(&status, 11.1, 1.25e-3, 4.0, 1.25e-3);
    });
    // The board restarts, the part does not: it is still as it was set up.
    bench.reboot();
    after_a_second(&mut bench, |status| {
        assert_measures(&status, 11.1, 1.25e-3, 4.0, 1.25e-3);
    });
    assert_survives_unplugging(&mut bench, 0x40, &part, |part| part.power_cycle());
}

fn with_ina239(part: &Rc<RefCell<Ina239>>) -> Bench {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.spi1().attach(SELECT, Box::new(Rc::clone(part)));
    bench.set("BATT2_MONITOR", INA239);
    bench.set("BATT2_SHUNT", 0.0002);
    bench.set("SR0_EXTRA1", 10.0);
    bench.reboot();
    bench
}

#[test]
// Requirement: AP-6
fn an_ina239_is_read_by_spi() {
    let part = shared(Ina239::new(0.0002));
    part.borrow_mut().set(24.0, -12.0, 25.0);
    let mut bench = with_ina239(&part);
    after_a_second(&mut bench, |status| {
        // 5 uV over 0.2 mOhm.
        assert_measures(&status, 24.0, 3.125e-3, -12.0, 25e-3);
    });
    assert!(bench.bus_errors().is_empty());
}

#[test]
fn an_unplugged_ina239_is_announced_and_recovers() {
    let part = shared(Ina239::new(0.0002));
    part.borrow_mut().set(24.0, 12.0, 25.0);
    let mut bench = with_ina239(&part);
    bench.run_for(SECOND);
    bench.spi1().detach(SELECT);
    bench.run_for(3 * SECOND);
    let unhealthy = "Battery 2 unhealthy: unknown part";
    assert_eq!(
        texts_of(&bench.frames())
            .iter()
            .filter(|text| *text == unhealthy)
            .count(),
        1
    );
    part.borrow_mut().power_cycle();
    bench.spi1().attach(SELECT, Box::new(part));
    bench.run_for(7 * SECOND);
    assert!(texts_of(&bench.frames()).contains(&"Battery 2 healthy again".into()));
}

#[test]
// Requirement: AP-6
fn an_ltc2946_counts_charge_and_energy_itself() {
    let part = shared(Ltc2946::new(0.0005));
    part.borrow_mut().set(12.0, 36.0);
    let mut bench = with_second_pack(LTC2946, 0x6f, &part, &[]);
    let (before_mah, before_hj) = after_a_second(&mut bench, |status| {
        assert_measures(&status, 12.0, 25e-3, 36.0, 50e-3);
        (status.consumed_mah(), status.energy_hj())
    });
    bench.i2c(BUS).detach(0x6f);
    bench.run_for(10 * SECOND);
    bench.i2c(BUS).attach(0x6f, Box::new(Rc::clone(&part)));
    bench.run_for(9 * SECOND);
    after_a_second(&mut bench, |status| {
        // 10 mAh and 4.32 hJ a second, also while it was not read.
        let (mah, hj) = (status.consumed_mah() - before_mah, status.energy_hj() - before_hj);
        assert!(mah.abs_diff(200) <= 2, "{mah} mAh");
        assert!(hj.abs_diff(86) <= 2, "{hj} hJ");
    });
    // It restarts: what it counted is lost, and what the board knows is not.
    let before_mah = after_a_second(&mut bench, |status| status.consumed_mah());
    part.borrow_mut().power_cycle();
    after_a_second(&mut bench, |status| {
        let mah = status.consumed_mah() - before_mah;
        assert!((5..=15).contains(&mah), "{mah} mAh");
    });
}

#[test]
// Requirement: AP-6
fn a_converter_on_the_bus_is_four_more_analog_pins() {
    let part = shared(Ad7091r5::new(Reference::External(3.3)));
    for (channel, volts) in [(0, 2.0), (1, 1.0), (2, 3.0), (3, 0.5)] {
        part.borrow_mut().set(channel, volts);
    }
    let second = [
        ("BATT2_VOLT_PIN", 50.0),
        ("BATT2_CURR_PIN", 51.0),
        ("BATT2_VOLT_MULT", 6.0),
        ("BATT2_AMP_PERVLT", 10.0),
    ];
    let third = [
        ("BATT3_MONITOR", AD7091R5),
        ("BATT3_VOLT_PIN", 52.0),
        ("BATT3_CURR_PIN", 53.0),
        ("BATT3_VOLT_MULT", 4.0),
    ];
    let parameters: Vec<_> = second.into_iter().chain(third).collect();
    let mut bench = with_second_pack(AD7091R5, 0x2f, &part, &parameters);
    after_a_second(&mut bench, |status| {
        assert_measures(&status, 12.0, 4.9e-3, 10.0, 8.1e-3)
    });
    let frames = bench.frames();
    let third = last_of(&frames, 2);
    assert_measures(&third, 12.0, 3.3e-3, 8.5, 14e-3);
    // One set of transfers for both: a check, and all four results.
    bench.i2c(BUS).take_transactions();
    bench.run_for(SECOND);
    assert!(bench.i2c(BUS).take_transactions().len().abs_diff(20) <= 2);

    bench.i2c(BUS).detach(0x2f);
    bench.run_for(3 * SECOND);
    let announced = texts_of(&bench.frames());
    for pack in [2, 3] {
        assert!(
            announced.contains(&format!("Battery {pack} unhealthy: no answer")),
            "{announced:?}"
        );
    }
    part.borrow_mut().power_cycle();
    bench.i2c(BUS).attach(0x2f, Box::new(part));
    bench.run_for(7 * SECOND);
    assert!(texts_of(&bench.frames()).contains(&"Battery 3 healthy again".into()));
}

#[test]
// Requirement: S-3
fn a_pin_of_the_converter_at_full_scale_is_no_voltage_and_a_current_over_range() {
    let part = shared(Ad7091r5::new(Reference::External(3.3)));
    part.borrow_mut().set(0, 2.0);
    part.borrow_mut().set(1, 3.4);
    let parameters = [("BATT2_VOLT_PIN", 50.0), ("BATT2_CURR_PIN", 51.0)];
    let mut bench = with_second_pack(AD7091R5, 0x2f, &part, &parameters);
    bench.run_for(2 * SECOND);
    let announced = texts_of(&bench.frames());
    let over_range = "Battery 2 current over range: consumption too low";
    assert!(announced.contains(&over_range.into()), "{announced:?}");
    part.borrow_mut().set(0, 3.4);
    bench.run_for(2 * SECOND);
    let announced = texts_of(&bench.frames());
    assert!(
        announced.contains(&"Battery 2 unhealthy: over range".into()),
        "{announced:?}"
    );
}

#[test]
fn a_pack_without_a_pin_of_the_converter_does_not_take_the_next_one_along() {
    let part = shared(Ad7091r5::new(Reference::External(3.3)));
    part.borrow_mut().set(0, 2.0);
    let parameters = [
        ("BATT3_MONITOR", AD7091R5),
        ("BATT3_VOLT_PIN", 50.0),
        ("BATT3_VOLT_MULT", 6.0),
    ];
    let mut bench = with_second_pack(AD7091R5, 0x2f, &part, &parameters);
    bench.run_for(2 * SECOND);
    let announced = texts_of(&bench.frames());
    assert!(
        announced.contains(&"Battery 2 unhealthy: no pin set".into()),
        "{announced:?}"
    );
    assert!(
        !announced
            .iter()
            .any(|text| text.starts_with("Battery 3 unhealthy")),
        "{announced:?}"
    );
    let frames = bench.frames();
    assert!(last_of(&frames, 2).voltage_mv(0).abs_diff(12_000) <= 5);
}

#[test]
fn a_pin_of_the_converter_is_none_for_other_monitors() {
    let part = shared(Ad7091r5::new(Reference::External(3.3)));
    let mut bench = Bench::running(DIVIDER_CODE);
    let second = Second {
        kind: 3.0,
        address: 0x2f,
    };
    second.configure(&mut bench, &part, &[("BATT2_VOLT_PIN", 50.0)]);
    bench.run_for(2 * SECOND);
    assert!(texts_of(&bench.frames()).contains(&"Battery 2 unhealthy: no pin set".into()));
    assert!(bench.logged(LogLevel::Warn, "battery 1").is_empty());
}

fn with_bebop() -> (Bench, Rc<RefCell<Garbled<Bebop>>>) {
    let part = shared(Garbled::new(Bebop::new(4), Reads::Own));
    part.borrow_mut().set(11_432);
    let bench = with_second_pack(BEBOP, 0x08, &part, &[]);
    (bench, part)
}

#[test]
// Requirement: AP-6
fn the_motor_board_of_a_bebop_measures_the_voltage_alone() {
    let (mut bench, part) = with_bebop();
    after_a_second(&mut bench, |status| {
        assert_eq!((status.voltage_mv(0), status.voltage_mv(1)), (11_432, 65535));
        assert_eq!((status.current_ca(), status.consumed_mah()), (-1, -1));
    });
    assert_survives_unplugging(&mut bench, 0x08, &part, |_| {});
}

#[test]
fn damaged_answers_of_a_bebop_are_no_voltage() {
    let (mut bench, part) = with_bebop();
    bench.run_for(SECOND);
    part.borrow_mut().set_reads(Reads::Fixed(0x55));
    bench.run_for(3 * SECOND);
    part.borrow_mut().set_reads(Reads::Own);
    bench.run_for(7 * SECOND);
    let frames = bench.frames();
    let texts = texts_of(&frames);
    let of_pack: Vec<_> = texts.iter().filter(|text| text.contains("healthy")).collect();
    assert_eq!(
        of_pack,
        ["Battery 2 unhealthy: unknown part", "Battery 2 healthy again"]
    );
    assert_eq!(last_of(&frames, 1).voltage_mv(0), 11_432);
}

#[test]
fn a_motor_board_with_another_number_of_motors_is_none_of_a_bebop() {
    let part = shared(Bebop::new(1));
    part.borrow_mut().set(11_432);
    let mut bench = with_second_pack(BEBOP, 0x08, &part, &[]);
    bench.run_for(2 * SECOND);
    assert!(texts_of(&bench.frames()).contains(&"Battery 2 unhealthy: unknown part".into()));
}
