//! Tests of the circuit against figures that are computed by hand, and at the pins of a board.

use std::cell::RefCell;
use std::rc::Rc;

use rp2040_emu::core::CoreBus;

use super::super::adc::{AdcCurve, AdcInput, Conversion};
use super::super::bench::*;
use super::super::board::Board;
use super::super::clock::{CLK_SYS_HZ, Cycle, cycles};
use super::super::i2c::I2cDevice;
use super::super::i2c::devices::{Ad7091r5, Ina219, Ina226, Ina228, Ltc2946, driver};
use super::super::thumb::{adds, back, board, idle_board, store};
use super::*;

/// 500 Hz.
const PERIOD: Cycle = cycles(2_000);
const PACK: Supply = Supply {
    open_circuit_v: 8.0,
    resistance_ohm: 0.25,
    base_a: 0.1,
};
const IDEAL: Switches = Switches {
    resistance_ohm: 0.0,
    diode_v: 0.0,
};
const COAST: [bool; 2] = [false, false];
const FORWARD: [bool; 2] = [true, false];
const REVERSE: [bool; 2] = [false, true];
const BRAKE: [bool; 2] = [true, true];

fn held(back_emf_v: f64) -> Motor {
    Motor {
        shaft: Shaft::Held { back_emf_v },
        ..Motor::TT
    }
}

fn bridge(number: usize, motor: Motor) -> Bridge {
    Bridge {
        pins: [2 * number, 2 * number + 1],
        switches: Switches::DRV8837,
        motor: Some(motor),
    }
}

/// Drives the bridges, in their order, with these levels for this number of cycles.
fn drive(circuit: &mut Circuit, levels: &[[bool; 2]], cycles: Cycle) {
    circuit.connect_inputs(|[in1, _]| levels[in1 / 2].map(PinSignal::Level));
    circuit.advance(circuit.totals().at + cycles);
}

fn pulse(circuit: &mut Circuit, on: [bool; 2], duty: f64) {
    let high = (duty * PERIOD as f64) as Cycle;
    drive(circuit, &[on], high);
    drive(circuit, &[COAST], PERIOD - high);
}

#[track_caller]
fn assert_close(actual: f64, expected: f64, tolerance: f64) {
    assert!((actual - expected).abs() <= tolerance, "{actual}, not {expected}");
}

/// Mean current of the pack and mean power, for pulses of one motor at a constant speed, by the exponentials of a winding that
/// has no current at the beginning and the end of a period.
fn by_hand(supply: Supply, switches: Switches, back_emf_v: f64, duty: f64) -> (f64, f64) {
    let Motor {
        resistance_ohm,
        inductance_h,
        ..
    } = Motor::TT;
    let (period, on) = (2e-3, duty * 2e-3);
    let source_v = supply.open_circuit_v - supply.resistance_ohm * supply.base_a;
    // While it drives, and while it feeds back: resistance, current at the end of time, time constant.
    let driving_ohm = resistance_ohm + supply.resistance_ohm + switches.resistance_ohm;
    let driving_a = (source_v - back_emf_v) / driving_ohm;
    let driving_s = inductance_h / driving_ohm;
    let peak_a = driving_a * (1.0 - (-on / driving_s).exp());
    let coasting_ohm = resistance_ohm + supply.resistance_ohm;
    let coasting_a = (source_v + back_emf_v + 2.0 * switches.diode_v) / coasting_ohm;
    let coasting_s = inductance_h / coasting_ohm;
    let off = coasting_s * (1.0 + peak_a / coasting_a).ln();
    assert!(on + off < period, "the current ends");
    let taken = driving_a * on - driving_s * peak_a;
    let given_back = coasting_s * peak_a - coasting_a * off;
    // The squares, for the loss in the pack: of `end + (start - end) exp(-t / constant)`.
    let square = |end: f64, start: f64, constant: f64, time: f64| {
        let rest = start - end;
        let decayed = |times: f64| constant / times * (1.0 - (-times * time / constant).exp());
        end * end * time + 2.0 * end * rest * decayed(1.0) + rest * rest * decayed(2.0)
    };
    let squares = square(driving_a, 0.0, driving_s, on) + square(-coasting_a, peak_a, coasting_s, off);
    let motor_a = (taken - given_back) / period;
    let mean_a = supply.base_a + motor_a;
    let mean_square = supply.base_a * (supply.base_a + 2.0 * motor_a) + squares / period;
    (
        mean_a,
        supply.open_circuit_v * mean_a - supply.resistance_ohm * mean_square,
    )
}

#[test]
fn pulses_take_the_current_that_is_computed_by_hand() {
    let ideal_pack = Supply {
        resistance_ohm: 0.0,
        base_a: 0.0,
        ..PACK
    };
    for (supply, switches) in [(ideal_pack, IDEAL), (PACK, Switches::DRV8837)] {
        for (back_emf_v, duty) in [(0.0, 0.1), (2.0, 0.4), (4.0, 0.5), (6.0, 0.8), (1.0, 0.02)] {
            for on in [FORWARD, REVERSE] {
                let sign = if on == FORWARD { 1.0 } else { -1.0 };
                let motor = held(sign * back_emf_v);
                let mut circuit = Circuit::new(
                    supply,
                    &[Bridge {
                        switches,
                        ..bridge(0, motor)
                    }],
                );
                let start = circuit.totals();
                (0..10).for_each(|_| pulse(&mut circuit, on, duty));
                let means = circuit.totals().since(start).expect("20 ms");
                let (amperes, watts) = by_hand(supply, switches, back_emf_v, duty);
                assert_close(means.amperes, amperes, 2e-5);
                assert_close(means.watts, watts, 2e-4);
                let volts = supply.open_circuit_v - supply.resistance_ohm * amperes;
                assert_close(means.volts, volts, 1e-5);
            }
        }
    }
}

#[test]
fn a_stalled_motor_takes_what_its_resistances_let_through() {
    let mut circuit = Circuit::new(PACK, &[bridge(0, Motor::TT.stalled()), bridge(1, Motor::TT)]);
    circuit.plug_in(1, None);
    drive(&mut circuit, &[FORWARD, FORWARD], cycles(20_000));
    let motor_a = (8.0 - 0.1 * 0.25) / (4.0 + 0.28 + 0.25);
    assert_close(circuit.motor_amperes(0), motor_a, 1e-6);
    assert_close(circuit.terminals().amperes, 0.1 + motor_a, 1e-6);
    assert_close(circuit.terminals().volts, 8.0 - 0.25 * (0.1 + motor_a), 1e-6);
    assert_eq!(
        (circuit.mode(0), circuit.motor_amperes(1)),
        (BridgeMode::Forward, 0.0)
    );
}

#[test]
fn a_coasting_winding_feeds_its_current_back_until_it_has_ended() {
    for (on, sign) in [(FORWARD, 1.0), (REVERSE, -1.0)] {
        let mut circuit = Circuit::new(PACK, &[bridge(0, Motor::TT.stalled())]);
        drive(&mut circuit, &[on], cycles(20_000));
        let peak = circuit.motor_amperes(0);
        assert!(sign * peak > 1.7);
        drive(&mut circuit, &[COAST], 0);
        let terminals = circuit.terminals();
        assert_close(terminals.amperes, 0.1 - peak.abs(), 1e-9);
        assert!(
            terminals.volts > 8.3,
            "above its open-circuit voltage: {}",
            terminals.volts
        );
        let ends_after = 1.5e-3 / 4.25 * (1.0 + peak.abs() * 4.25 / (8.0 - 0.025 + 1.6)).ln();
        let just_before = (ends_after * CLK_SYS_HZ as f64) as Cycle - 20;
        drive(&mut circuit, &[COAST], just_before);
        assert!(circuit.motor_amperes(0) * sign > 0.0);
        drive(&mut circuit, &[COAST], 40);
        assert_eq!(circuit.motor_amperes(0), 0.0);
        assert_close(circuit.terminals().volts, 7.975, 1e-9);
        assert_close(circuit.extremes().least.amperes, 0.1 - peak.abs(), 1e-9);
    }
}

#[test]
fn a_braking_motor_takes_nothing_from_the_pack_and_slows_down() {
    let mut circuit = Circuit::new(PACK, &[bridge(0, Motor::TT)]);
    drive(&mut circuit, &[FORWARD], cycles(2_000_000));
    // Idling: its current is what friction takes.
    assert_close(circuit.motor_amperes(0), 0.15, 1e-4);
    let speed_v = 8.0 - 0.25 * 0.25 - 0.15 * 4.28;
    assert_close(circuit.back_emf_volts(0), speed_v, 1e-3);
    let before = circuit.totals();
    drive(&mut circuit, &[BRAKE], cycles(5_000));
    assert_close(circuit.totals().since(before).expect("5 ms").amperes, 0.1, 1e-9);
    assert!(circuit.motor_amperes(0) < -1.5, "{}", circuit.motor_amperes(0));
    drive(&mut circuit, &[BRAKE], cycles(2_000_000));
    assert_eq!(circuit.back_emf_volts(0), 0.0);
}

#[test]
fn a_shaft_follows_the_voltage_in_its_time_and_friction_stops_it() {
    let mut circuit = Circuit::new(PACK, &[bridge(0, Motor::TT)]);
    drive(&mut circuit, &[FORWARD], cycles(2_000_000));
    let full_v = circuit.back_emf_volts(0);
    // Driven from a standstill with all resistances, it has 1 - 1/e of its speed after their share of the time constant.
    let mut circuit = Circuit::new(PACK, &[bridge(0, Motor::TT)]);
    drive(&mut circuit, &[FORWARD], cycles((150_000.0 * 4.53 / 4.0) as u64));
    let share = circuit.back_emf_volts(0) / full_v;
    assert_close(share, 1.0 - (-1.0_f64).exp(), 0.005);
    // A coasting motor loses friction × resistance each time constant.
    let before = circuit.back_emf_volts(0);
    drive(&mut circuit, &[COAST], cycles(150_000));
    assert_close(before - circuit.back_emf_volts(0), 0.15 * 4.0, 0.005);
    drive(&mut circuit, &[COAST], cycles(10_000_000));
    assert_eq!(circuit.back_emf_volts(0), 0.0);
    // A current below that of friction does not start it.
    let weak = Supply {
        open_circuit_v: 0.5,
        ..PACK
    };
    circuit.set_supply(weak);
    drive(&mut circuit, &[REVERSE], cycles(1_000_000));
    assert_eq!(circuit.back_emf_volts(0), 0.0);
    assert!(circuit.motor_amperes(0) < -0.05);
}

/// The pack gives as much as windings, switches, diodes, shafts and the board take.
#[test]
fn no_energy_is_lost() {
    let motors = [held(3.0), Motor::TT, held(-1.0), Motor::TT.stalled()];
    let bridges: Vec<Bridge> = (0..4).map(|number| bridge(number, motors[number])).collect();
    let mut circuit = Circuit::new(PACK, &bridges);
    let on = [FORWARD, FORWARD, REVERSE, FORWARD];
    let duties = [0.3, 0.95, 0.6, 0.1];
    let mut taken = 0.0;
    let power = |circuit: &Circuit| -> f64 {
        let of_motor = |number: usize| {
            let (amperes, speed_v) = (circuit.motor_amperes(number), circuit.back_emf_volts(number));
            let (switches_ohm, diodes_v) = match circuit.mode(number) {
                BridgeMode::Coast => (0.0, 1.6),
                _ => (0.28, 0.0),
            };
            amperes * amperes * (4.0 + switches_ohm) + amperes.abs() * diodes_v + amperes * speed_v
        };
        (0..4).map(of_motor).sum::<f64>() + 0.1 * circuit.terminals().volts
    };
    const STEP: Cycle = 125;
    for number in 0..20_000_u64 {
        let place = (number * STEP % PERIOD) as f64 / PERIOD as f64;
        let levels: Vec<[bool; 2]> = (0..4)
            .map(|motor| {
                let phase = (place + motor as f64 / 4.0) % 1.0;
                if phase < duties[motor] { on[motor] } else { COAST }
            })
            .collect();
        drive(&mut circuit, &levels, 0);
        let before = power(&circuit);
        drive(&mut circuit, &levels, STEP);
        taken += (before + power(&circuit)) / 2.0 * 1e-6;
    }
    let in_windings: f64 = (0..4)
        .map(|number| 0.5 * 1.5e-3 * circuit.motor_amperes(number).powi(2))
        .sum();
    let given = circuit.totals().joules;
    assert!(given > 0.1, "{given} J");
    assert_close((taken + in_windings) / given, 1.0, 1e-3);
}

#[test]
fn how_often_it_is_looked_at_makes_no_difference() {
    let bridges = [bridge(0, Motor::TT), bridge(1, held(2.0))];
    let run = |looks: Cycle| {
        let mut circuit = Circuit::new(PACK, &bridges);
        for number in 0..20 {
            let levels = [[FORWARD, COAST][number % 2], [COAST, REVERSE][number % 2]];
            (0..looks).for_each(|_| drive(&mut circuit, &levels, 80_000 / looks));
        }
        circuit.totals()
    };
    let (rarely, often) = (run(1), run(100));
    assert_close(rarely.coulombs, often.coulombs, 1e-4 * often.coulombs);
    assert_close(rarely.joules, often.joules, 1e-4 * often.joules);
}

// ----- At the pins of a board -----------------------------------------------------------------------

const ADC_CS: u32 = 0x4004_c000;
const ADC_DIV: u32 = 0x4004_c010;
const PWM_CC: u32 = 0x4005_0020;
const PWM_CSR: u32 = 0x4005_0014;

const SENSOR: CurrentSensor = CurrentSensor {
    volts_per_ampere: 0.1,
    offset_v: 1.65,
    range: SensorRange::BothWays,
};

/// Slice 1 drives GP18 and GP19 with 500 Hz; voltage and current are converted in turn, 8,180 times a second each.
fn start(board: &mut Board, circuit: Circuit, level: u32) {
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    for (offset, value) in [(4, 4 << 4), (0x10, 62_499), (0xc, level)] {
        board.write_register(PWM_CSR + offset, value);
    }
    board.attach_circuit(circuit);
    board.adc_curve(AdcCurve::Ideal);
    board.adc_input(0, AdcInput::PackVoltage(0.25));
    board.adc_input(1, AdcInput::PackCurrent(SENSOR));
    board.write_register(ADC_DIV, 2933 << 8);
    board.write_register(ADC_CS, 1);
    board.run_for(10);
    board.write_register(PWM_CSR, 1);
    for pin in [18, 19] {
        select_function(board, pin, FUNCTION_PWM);
    }
    board.write_register(ADC_CS, 1 | 1 << 3 | 0b11 << 16);
}

fn stalled_motor() -> Circuit {
    let motor = Bridge {
        pins: [18, 19],
        ..bridge(0, Motor::TT.stalled())
    };
    Circuit::new(PACK, &[motor])
}

/// Volts and amperes at the pack, from the codes.
fn measured(record: &[Conversion], channel: usize) -> Vec<(Cycle, f64)> {
    let of_channel = record.iter().filter(|conversion| conversion.channel == channel);
    let volts = |code: u16| (f64::from(code) + 0.5) * 3.3 / 4096.0;
    of_channel
        .map(|conversion| match channel {
            0 => (conversion.start, volts(conversion.code) / 0.25),
            _ => (conversion.start, (volts(conversion.code) - 1.65) / 0.1),
        })
        .collect()
}

#[test]
fn each_conversion_sees_the_circuit_at_its_own_instant() {
    let mut board = idle_board();
    start(&mut board, stalled_motor(), 25_000);
    let began = board.time_cycles();
    board.run_for(100_000);
    let record = board.take_adc_record();
    // 40 % of the time it drives: 0.8 ms, in which the current rises, and then flows back.
    let (end_a, driving_s): (f64, f64) = (7.975 / 4.53, 1.5e-3 / 4.53);
    let (back_a, coasting_s) = ((7.975 + 1.6) / 4.25, 1.5e-3 / 4.25);
    let peak_a = end_a * (1.0 - (-0.8e-3 / driving_s).exp());
    let expected = |start: Cycle| {
        let place = ((start - began) % PERIOD) as f64 / CLK_SYS_HZ as f64;
        0.1 + if place < 0.8e-3 {
            end_a * (1.0 - (-place / driving_s).exp())
        } else {
            (back_a - (back_a + peak_a) * (-(place - 0.8e-3) / coasting_s).exp()).min(0.0)
        }
    };
    let amperes = measured(&record, 1);
    assert!(amperes.len() > 800);
    // Half a step of the converter each.
    for (start, amperes) in amperes {
        assert_close(amperes, expected(start), 0.0041);
    }
    for (start, volts) in measured(&record, 0) {
        assert_close(volts, 8.0 - 0.25 * expected(start), 0.0017);
    }
}

#[test]
fn the_mean_of_the_conversions_is_that_of_the_circuit() {
    for level in [3_000, 20_000, 45_000, 62_500] {
        let mut board = idle_board();
        start(&mut board, stalled_motor(), level);
        board.adc_noise(0.002);
        board.run_for(20_000);
        board.take_adc_record();
        let start = board.circuit().totals();
        board.run_for(1_000_000);
        let record = board.take_adc_record();
        let means = board.circuit().totals().since(start).expect("a second");
        let mean = |channel| {
            let values = measured(&record, channel);
            values.iter().map(|(_, value)| value).sum::<f64>() / values.len() as f64
        };
        assert_close(mean(0), means.volts, 0.004);
        assert_close(mean(1), means.amperes, 0.004);
    }
}

#[test]
fn a_bridge_coasts_while_nothing_drives_its_pins() {
    let mut board = idle_board();
    start(&mut board, stalled_motor(), 62_500);
    board.run_for(10_000);
    assert_eq!(board.circuit().mode(0), BridgeMode::Forward);
    board.press_run();
    board.run_for(10_000);
    assert_eq!(board.circuit().mode(0), BridgeMode::Coast);
    assert_eq!(board.circuit().terminals().amperes, 0.1);
    start(&mut board, stalled_motor(), 62_500);
    board.cut_power();
    assert_eq!(board.circuit().mode(0), BridgeMode::Coast);
}

#[test]
fn pins_that_are_set_by_hand_drive_a_bridge() {
    const SIO_OUT: u32 = 0xd000_0010;
    const SIO_OUT_ENABLE: u32 = 0xd000_0020;
    let mut board = idle_board();
    start(&mut board, stalled_motor(), 0);
    for pin in [18, 19] {
        select_function(&mut board, pin, FUNCTION_SIO);
    }
    board.bus.write32(SIO_OUT_ENABLE, 0b11 << 18);
    for (levels, mode) in [
        (0b01, BridgeMode::Forward),
        (0b10, BridgeMode::Reverse),
        (0b11, BridgeMode::Brake),
        (0b00, BridgeMode::Coast),
    ] {
        board.bus.write32(SIO_OUT, levels << 18);
        assert_eq!(board.circuit().mode(0), mode);
    }
    board.bus.write32(SIO_OUT, 0b01 << 18);
    board.run_for(100);
    board.bus.write32(SIO_OUT, 0);
    assert_close(board.circuit().totals().coulombs - 0.1 * 110e-6, 24e-6, 2e-6);
}

/// A processor that sets another duty every 1.6 ms, at different places of the period.
fn run(pieces: impl Iterator<Item = u64>) -> (Board, Vec<Conversion>) {
    const COPY_R5_TO_R4: u16 = 0x002c;
    const COUNT_R4_DOWN: [u16; 2] = [0x3c01, 0xd1fd];
    let [subtract, branch] = COUNT_R4_DOWN;
    let wait = [COPY_R5_TO_R4, subtract, branch];
    let program = [&wait[..], &[adds(1, 250), store(1, 2), back(5)]].concat();
    let mut board = board(&program, &[]);
    set_registers(&mut board, [(1, 20_000), (2, PWM_CC), (5, 50_000)]);
    start(&mut board, stalled_motor(), 20_000);
    pieces.for_each(|micros| board.run_for(micros));
    let record = board.take_adc_record();
    (board, record)
}

#[test]
fn a_duty_that_changes_while_conversions_wait_changes_later_ones_only() {
    let (mut board, record) = run([30_000].into_iter());
    assert_eq!(board.register(1), 20_000 + 18 * 250);
    let (mut in_pieces, record_in_pieces) = run([1; 30_000].into_iter());
    assert!(record == record_in_pieces);
    let [whole, pieces] = [&mut board, &mut in_pieces].map(|board| board.circuit().totals().coulombs);
    assert_close(whole, pieces, 1e-6);
}

#[test]
fn a_copy_of_the_board_has_a_circuit_of_its_own() {
    let mut board = idle_board();
    start(&mut board, stalled_motor(), 20_000);
    board.adc_noise(0.002);
    board.run_for(12_345);
    let mut copy = board.clone();
    for board in [&mut board, &mut copy] {
        board.run_for(20_000);
    }
    assert_eq!(board.circuit().totals(), copy.circuit().totals());
    assert!(board.take_adc_record() == copy.take_adc_record());
    copy.circuit().plug_in(0, None);
    assert_ne!(board.circuit().terminals(), copy.circuit().terminals());
}

#[test]
fn a_sensor_for_one_direction_shows_no_current_that_flows_back() {
    let mut board = idle_board();
    start(&mut board, stalled_motor(), 25_000);
    let sensor = CurrentSensor {
        range: SensorRange::FromZero,
        ..SENSOR
    };
    board.adc_input(1, AdcInput::PackCurrent(sensor));
    board.run_for(100_000);
    let extremes = board.circuit().extremes();
    assert!(extremes.least.amperes < -1.0, "{extremes:?}");
    let amperes = measured(&board.take_adc_record(), 1);
    let least = amperes.iter().map(|(_, amperes)| *amperes).fold(1.0, f64::min);
    assert_close(least, 0.0, 0.005);
}

// ----- Devices at a bus -----------------------------------------------------------------------------

/// Runs a board with a stalled motor at 40 %, with this device at I2C0, and returns the means of the last half second.
fn run_with<D: I2cDevice + 'static>(device: &Rc<RefCell<D>>) -> (Board, Means) {
    run_circuit_with(stalled_motor(), device)
}

fn run_circuit_with<D: I2cDevice + 'static>(circuit: Circuit, device: &Rc<RefCell<D>>) -> (Board, Means) {
    let mut board = idle_board();
    start(&mut board, circuit, 25_000);
    board.i2c(0).attach(0x40, Box::new(Rc::clone(device)));
    (0..500).for_each(|_| board.run_for(1_000));
    let start = board.circuit().totals();
    (0..500).for_each(|_| board.run_for(1_000));
    let means = board.circuit().totals().since(start).expect("half a second");
    (board, means)
}

#[test]
fn monitors_give_the_means_of_their_conversions() {
    // Sixteen samples of 1.1 ms of both.
    let mut ina226 = Ina226::new(0.01).measuring_circuit();
    driver::write_at(&mut ina226, 0, 0x4527, 0);
    let device = Rc::new(RefCell::new(ina226));
    let (board, means) = run_with(&device);
    let now = board.time_cycles();
    let (by_hand_a, _) = by_hand(PACK, Switches::DRV8837, 0.0, 0.4);
    assert_close(means.amperes, by_hand_a, 1e-4);
    let read = |pointer| driver::read_at(&mut *device.borrow_mut(), pointer, 2, now) as f64;
    // 35.2 ms are no whole number of periods.
    assert_close(read(1) * 2.5e-6 / 0.01, means.amperes, 0.03 * means.amperes);
    assert_close(read(2) * 1.25e-3, means.volts, 0.01);

    // Sixteen samples of 532 us of both: 17 ms are no whole number of periods, either.
    let mut ina219 = Ina219::new(0.01).measuring_circuit();
    driver::write_at(&mut ina219, 0, 0x3e67, 0);
    let device = Rc::new(RefCell::new(ina219));
    let (board, means) = run_with(&device);
    let now = board.time_cycles();
    let read = |pointer| driver::read_at(&mut *device.borrow_mut(), pointer, 2, now);
    let (shunt, bus) = (read(1) as f64, (read(2) >> 3) as f64);
    assert_close(shunt * 10e-6 / 0.01, means.amperes, 0.06 * means.amperes);
    assert_close(bus * 4e-3, means.volts, 0.02);

    let device = Rc::new(RefCell::new(Ltc2946::new(0.01).measuring_circuit()));
    let (board, means) = run_with(&device);
    let now = board.time_cycles();
    let read = |pointer| driver::read_at(&mut *device.borrow_mut(), pointer, 2, now) as f64 / 16.0;
    assert_close(
        read(0x14) * 0.1024 / 4095.0 / 0.01,
        means.amperes,
        0.06 * means.amperes,
    );
    assert_close(read(0x1e) * 102.4 / 4095.0, means.volts, 0.03);
}

#[test]
fn a_current_above_the_range_of_a_monitor_is_cut_off_before_it_is_averaged() {
    // 81.92 mV over 0.1 Ohm.
    let mut circuit = stalled_motor();
    circuit.set_range_of_monitors(0.8192);
    let device = Rc::new(RefCell::new(Ina226::new(0.1).measuring_circuit()));
    let (board, means) = run_circuit_with(circuit, &device);
    let now = board.time_cycles();
    let shown = driver::read_at(&mut *device.borrow_mut(), 1, 2, now) as f64 * 2.5e-6 / 0.1;
    assert_close(shown, means.shown_amperes, 0.05);
    assert!(
        shown < 0.6 && means.amperes < 0.8 && means.amperes > 1.15 * shown,
        "{means:?}"
    );
}

#[test]
fn a_monitor_that_counts_charge_counts_that_of_the_circuit() {
    const SHUNT_CAL: u8 = 0x02;
    const CHARGE: u8 = 0x0a;
    // Steps of 20 µA.
    let mut ina228 = Ina228::new(0.01).measuring_circuit();
    driver::write_at(&mut ina228, SHUNT_CAL, 2621, 0);
    let device = Rc::new(RefCell::new(ina228));
    let (mut board, _) = run_with(&device);
    let now = board.time_cycles();
    let counted = driver::read_at(&mut *device.borrow_mut(), CHARGE, 5, now) as f64 * 20e-6;
    let given = board.circuit().totals().coulombs;
    assert_close(counted, given, 0.01 * given);
}

/// Results of 58 µs each, at instants that are spread over the period of the PWM after 29 of them.
#[test]
fn a_converter_at_the_bus_gives_the_instant_of_each_result() {
    const I2C0: u32 = 0x4004_4000;
    const DATA_CMD: u32 = I2C0 + 0x10;
    const READ: u32 = 1 << 8;
    const FUNCTION_I2C: u32 = 3;
    let mut device = Ad7091r5::new(2.5);
    device.connect(0, Probe::Current(SENSOR));
    let (mut board, means) = run_with(&Rc::new(RefCell::new(device)));
    for pin in [4, 5] {
        select_function(&mut board, pin, FUNCTION_I2C);
    }
    for (offset, value) in [(0x1c, 126), (0x20, 187), (0xa0, 11), (0x04, 0x40), (0x6c, 1)] {
        board.write_register(I2C0 + offset, value);
    }
    // One channel in command mode, then results of two bytes each.
    for byte in [0x02, 0x04, 0xc0, 0x01, 0x01, 0x00] {
        board.write_register(DATA_CMD, byte);
    }
    board.run_for(200);
    // The first one comes after the address.
    let times = [100].into_iter().chain([29; 1999]);
    let bytes = times.map(|micros| {
        board.write_register(DATA_CMD, READ);
        board.run_for(micros);
        board.read_register(DATA_CMD) as u8
    });
    let bytes: Vec<u8> = bytes.collect();
    // The first was there before.
    let amperes: Vec<f64> = bytes
        .chunks(2)
        .skip(1)
        .map(|pair| f64::from(u16::from_be_bytes([pair[0], pair[1]]) & 0xfff))
        .map(|code| (code * 2.5 / 4096.0 - 1.65) / 0.1)
        .collect();
    let mean = amperes.iter().sum::<f64>() / amperes.len() as f64;
    assert_close(mean, means.amperes, 0.005);
    let extremes = board.circuit().extremes();
    let least = amperes.iter().copied().fold(f64::INFINITY, f64::min);
    let most = amperes.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    assert!(most > 0.9 * extremes.most.amperes && least < 0.5 * extremes.least.amperes);
}
