//! Ready parameter files of docs/params/ for sensors that the simulator does not have, with these sensors.

use emulator::i2c_devices::Bq76952;
use emulator::{AdcInput, UartPins};
use support::charge_states::OK;
use support::frames::{last_of, texts_of};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, PACK, SECOND, TestedVehicle};
use workbench::can::CanRig;
use workbench::can::transfers::A;
use workbench::i2c_bus::{BUS, shared};

const SERIAL_PORT: usize = 1;

/// A board that was given a file and restarted, with what `plug_in` connects.
fn loaded<R>(file: &str, plug_in: impl FnOnce(&mut Bench) -> R) -> (Bench, R) {
    let mut bench = Bench::running(DIVIDER_CODE);
    let connected = plug_in(&mut bench);
    let settings = file.lines().filter(|line| !line.starts_with('#'));
    for (name, value) in settings.filter_map(|line| line.split_once(',')) {
        bench.set(name, value.parse().unwrap());
    }
    bench.reboot();
    (bench, connected)
}

#[track_caller]
fn assert_healthy(bench: &mut Bench) {
    let texts = texts_of(&bench.frames());
    assert!(!texts.iter().any(|text| text.contains("unhealthy")), "{texts:?}");
}

#[test]
fn a_battery_on_the_can_bus_is_measured_with_its_file() {
    let file = include_str!("../../docs/params/dronecan.param");
    let (mut bench, rig) = loaded(file, |bench| CanRig::new(bench, 16_000_000, 1_000_000));
    let mut battery = rig.peer();
    rig.run_with(
        &mut bench,
        4 * SECOND,
        100 * MILLISECOND,
        &mut [(&mut battery, &[A])],
    );
    assert_healthy(&mut bench);
    let frames = bench.frames();
    let status = last_of(&frames, 0);
    assert_eq!((status.voltage_mv(0), status.current_ca()), (12_500, 325));
    assert_eq!((status.remaining_pct(), status.charge_state()), (76, OK));
}

#[test]
fn a_fuel_cell_is_measured_with_its_file() {
    let file = include_str!("../../docs/params/generator.param");
    let plug_in = |bench: &mut Bench| bench.wire_uart(SERIAL_PORT, UartPins { tx: 4, rx: 5 });
    let (mut bench, ()) = loaded(file, plug_in);
    for _ in 0..8 {
        let now_us = bench.time_us();
        // The figures of the maker's manual of the FCPM, section 7.4, with an emptier tank.
        bench.uart_send_at_baud(SERIAL_PORT, now_us, b"<152.5,48.7,1600,1700,100,2,0>\n", 9_600);
        bench.run_for(500 * MILLISECOND);
    }
    assert_healthy(&mut bench);
    let frames = bench.frames();
    let (output, tank) = (last_of(&frames, 1), last_of(&frames, 2));
    assert_eq!((output.voltage_mv(0), output.current_ca()), (48_700, -205));
    assert_eq!((tank.remaining_pct(), tank.charge_state()), (50, OK));
}

#[test]
fn a_stack_of_cells_is_measured_with_its_file() {
    let file = include_str!("../../docs/params/bq76952.param");
    let (mut bench, _) = loaded(file, |bench| {
        // Nothing is at the divider.
        bench.adc_input(PACK, AdcInput::Code(0));
        bench.run_for(SECOND);
        let part = shared(Bq76952::new());
        part.borrow_mut().set(&[4000; 6], 7.2, 31.0);
        bench.i2c(BUS).attach(0x08, Box::new(part.clone()));
        part
    });
    bench.run_for(2 * SECOND);
    assert_healthy(&mut bench);
    let frames = bench.frames();
    let status = last_of(&frames, 0);
    assert_eq!((status.sum_of_cells_mv(), status.current_ca()), (24_000, 720));
    assert_eq!(status.charge_state(), OK);
}
