//! Nine packs of nine kinds at once, on every bus and line the board has.

use std::cell::RefCell;
use std::rc::Rc;

use emulator::i2c_devices::{Ina226, Ina3221, Pec, RegisterMap, SmartBattery};
use emulator::spi_devices::Ina239;
use emulator::{AdcInput, UartPins};
use support::frames::{
    BatteryStatus, Frame, HEARTBEAT, SYS_STATUS, SysStatus, assert_no_sequence_gap, of_message, statuses_of,
    texts_of,
};
use support::pack_report::PackReport;
use workbench::bench::{Bench, CYCLES_PER_US, DIVIDER_CODE, MILLISECOND, PACK, TestedVehicle};
use workbench::can::transfers::{A, A_LATER, STATUS_A};
use workbench::can::{BITS_PER_SECOND, CRYSTAL_HZ, CanRig, Peer, Transfer};
use workbench::i2c_bus::{BUS, shared};
use workbench::runs::exact_rates::assert_sampled_at_every_tick;

const TICK: u64 = 100 * MILLISECOND;
const TICKS_PER_SECOND: usize = 10;
const HALF_S: usize = 10;

const SERIAL_PORT: usize = 1;
const SERIAL_BAUD: u32 = 9_600;
/// Chip select of the INA239.
const SELECT: usize = 22;
const SHUNT_OHM: f64 = 0.0005;

/// A tenth of a volt below [`DIVIDER_CODE`].
const LATER_CODE: u16 = 2450;

const PARAMETERS: [(&str, f32); 15] = [
    ("BATT_MONITOR", 3.0),
    ("BATT2_MONITOR", 21.0),
    ("BATT3_MONITOR", 26.0),
    ("BATT4_MONITOR", 7.0),
    ("BATT5_MONITOR", 30.0),
    ("BATT6_MONITOR", 8.0),
    ("BATT6_SERIAL_NUM", 1.0),
    ("CAN_P1_DRIVER", 1.0),
    ("BATT7_MONITOR", 17.0),
    ("SERIAL1_PROTOCOL", 30.0),
    ("GEN_TYPE", 3.0),
    ("BATT8_MONITOR", 29.0),
    ("BATT9_MONITOR", 10.0),
    ("BATT9_SUM_MASK", 6.0),
    ("SR0_EXTRA1", 10.0),
];

/// Volts and amperes at a pack's terminals; no amperes if they are not measured.
type Terminals = (f64, Option<f64>);

/// The packs' terminals, and their sources, during half of the time.
struct Half {
    divider_code: u16,
    battery: Transfer,
    /// From the second pack on: those that are not at the divider.
    others: [(f64, f64); 8],
}

impl Half {
    fn terminals(&self, pack: usize) -> Terminals {
        match pack {
            0 => (f64::from(self.divider_code) / 4095.0 * 3.3 * 3.95, None),
            _ => {
                let (volts, amperes) = self.others[pack - 1];
                (volts, Some(amperes))
            }
        }
    }
}

const HALVES: [Half; 2] = [
    Half {
        divider_code: DIVIDER_CODE,
        battery: A,
        others: [
            (12.0, 1.0),
            (11.0, 2.0),
            (11.1, 2.5),
            (8.0, 4.0),
            (12.5, 3.25),
            (49.95, 12.34),
            (11.8, 2.75),
            // The mean, and the sum, of the second and the third one.
            (11.5, 3.0),
        ],
    },
    Half {
        divider_code: LATER_CODE,
        battery: A_LATER,
        others: [
            (11.5, 6.0),
            (10.5, 7.0),
            (10.8, 9.5),
            (7.2, 1.6),
            (12.25, 8.5),
            (48.2, 20.1),
            (11.2, 5.25),
            (11.0, 13.0),
        ],
    },
];

/// A step of each pack's sensor, in mV and in cA: a count of the converter; 1.25 mV and 2.5 uV at the shunt; 3.125 mV and
/// 5 uV; 1 mV and 1 mA; 8 mV and 40 uV; half-precision numbers, exact here; 10 mV and 10 mA; 1 mV and 10 mA; the steps of
/// the packs in the sum.
const STEPS: [(f64, f64); 9] = [
    (3.2, 0.0),
    (1.25, 1.0),
    (3.125, 1.0),
    (1.0, 1.0),
    (8.0, 8.0),
    (1.0, 1.0),
    (10.0, 1.0),
    (1.0, 1.0),
    (3.125, 2.0),
];

/// All that is connected.
struct Rig {
    can: CanRig,
    battery: Peer,
    monitor: Rc<RefCell<RegisterMap<Ina226>>>,
    at_spi: Rc<RefCell<Ina239>>,
    smart: Rc<RefCell<SmartBattery>>,
    channels: Rc<RefCell<RegisterMap<Ina3221>>>,
}

impl Rig {
    fn plug_in(bench: &mut Bench) -> Self {
        let can = CanRig::new(bench, CRYSTAL_HZ, BITS_PER_SECOND);
        let rig = Self {
            battery: can.peer(),
            can,
            monitor: shared(Ina226::new(SHUNT_OHM)),
            at_spi: shared(Ina239::new(SHUNT_OHM)),
            smart: shared(SmartBattery::new(Pec::Right)),
            channels: shared(Ina3221::new(SHUNT_OHM)),
        };
        bench.spi1().attach(SELECT, Box::new(rig.at_spi.clone()));
        bench.i2c(BUS).attach(0x40, Box::new(rig.monitor.clone()));
        bench.i2c(BUS).attach(0x42, Box::new(rig.channels.clone()));
        bench.i2c(BUS).attach(0x0b, Box::new(rig.smart.clone()));
        bench.wire_uart(SERIAL_PORT, UartPins { tx: 4, rx: 5 });
        rig
    }

    /// Sets what is measured by the board or by a part that it reads.
    fn set(&self, bench: &mut Bench, half: &Half) {
        bench.adc_input(PACK, AdcInput::Code(half.divider_code));
        let [monitor, at_spi, smart, channel, ..] = half.others;
        self.monitor.borrow_mut().set(monitor.0, monitor.1);
        self.at_spi.borrow_mut().set(at_spi.0, at_spi.1, 25.0);
        self.smart.borrow_mut().set(smart.0, smart.1, 25.0);
        self.channels.borrow_mut().set(1, channel.0, channel.1);
    }

    /// The others report by themselves: the battery on the CAN bus and the companion computer ten times a second, the
    /// generator twice.
    fn report(&mut self, bench: &mut Bench, half: &Half, tick: usize) {
        let now_us = bench.time_us();
        if tick.is_multiple_of(TICKS_PER_SECOND) {
            self.battery.send(now_us, STATUS_A);
        }
        self.battery.send(now_us, half.battery);
        if tick.is_multiple_of(TICKS_PER_SECOND / 2) {
            let bytes = richen_power(half.others[5]);
            bench.uart_send_at_baud(SERIAL_PORT, now_us, &bytes, SERIAL_BAUD);
        }
        bench.uart_send(0, now_us, &companion(half.others[6]).frame());
    }

    /// Runs for this many seconds, and returns when packs were sampled.
    fn run(&mut self, bench: &mut Bench, half: &Half, seconds: usize) -> Vec<u64> {
        let mut ticks = Vec::new();
        for tick in 0..seconds * TICKS_PER_SECOND {
            self.report(bench, half, tick);
            bench.run_for(TICK);
            ticks.extend(bench.take_ticks());
        }
        ticks
    }
}

fn in_hundredths(value: f64) -> u16 {
    (value * 100.0).round() as u16
}

/// A report of RichenPower's generator: the bytes that a controller of an H2 sent (ArduPilot/ardupilot, a comment in
/// libraries/AP_Generator/AP_Generator_RichenPower.cpp), with no error and this voltage and current.
fn richen_power((volts, amperes): (f64, f64)) -> Vec<u8> {
    let mut frame = vec![
        0xaa, 0x55, 0x00, 0x0a, 0x00, 0x00, 0x00, 0x00, 0x00, 0x04, 0x1e, 0xb0,
    ];
    let output = [volts, amperes].map(in_hundredths);
    for word in [0, 0, 0x237a, 0x237a, output[0], output[1], 0, 0x0100] {
        frame.extend(word.to_be_bytes());
    }
    frame.resize(66, 0);
    frame.extend([0x1e, 0xbe, 0x55, 0xaa]);
    frame
}

fn companion((volts, amperes): (f64, f64)) -> PackReport {
    PackReport {
        current_ca: in_hundredths(amperes) as i16,
        ..PackReport::of_voltage(7, (volts * 1000.0).round() as u16)
    }
}

fn assert_within_a_step(
    status: &BatteryStatus<'_>,
    (volts, amperes): Terminals,
    (step_mv, step_ca): (f64, f64),
) {
    let pack = status.instance() + 1;
    let (mv, ca) = (status.sum_of_cells_mv(), status.current_ca());
    let off_mv = (f64::from(mv) - volts * 1000.0).abs();
    // What is reported are whole numbers.
    assert!(off_mv <= step_mv + 0.5, "pack {pack}: {mv} mV");
    let expected_ca = amperes.map_or(-1.0, |amperes| amperes * 100.0);
    let off_ca = (f64::from(ca) - expected_ca).abs();
    assert!(off_ca <= step_ca + 0.5, "pack {pack}: {ca} cA");
}

/// Each pack is reported ten times a second, with what it has once a second has passed.
fn assert_reported(frames: &[Frame], half: &Half) {
    for (instance, steps) in STEPS.into_iter().enumerate() {
        let of_pack = statuses_of(frames, instance as u8);
        assert_eq!(of_pack.len(), HALF_S * TICKS_PER_SECOND, "instance {instance}");
        // What has changed at the start of the half has to be there after a second.
        for status in &of_pack[TICKS_PER_SECOND..] {
            assert_within_a_step(status, half.terminals(instance), steps);
        }
    }
    assert_eq!(of_message(frames, SYS_STATUS).len(), HALF_S * TICKS_PER_SECOND);
    assert_eq!(of_message(frames, HEARTBEAT).len(), HALF_S);
}

#[test]
// Requirement: AP-6, AP-8, AP-13, FR-11
fn nine_packs_of_nine_kinds_are_each_reported_200_times_in_20_seconds() {
    let mut bench = Bench::running(DIVIDER_CODE);
    let mut rig = Rig::plug_in(&mut bench);
    rig.set(&mut bench, &HALVES[0]);
    bench.set_all(&PARAMETERS);
    bench.reboot();
    rig.run(&mut bench, &HALVES[0], 3);
    bench.forget_sent();
    bench.run_until_silent();

    let (from_us, awake) = (bench.time_us(), bench.awake_cycles());
    bench.take_ticks();
    let mut ticks = Vec::new();
    let mut frames = Vec::new();
    for half in &HALVES {
        rig.set(&mut bench, half);
        let half_from_us = bench.time_us();
        ticks.extend(rig.run(&mut bench, half, HALF_S));
        let of_half = bench.frames_since(half_from_us);
        assert_reported(&of_half, half);
        frames.extend(of_half);
    }
    let awake_cycles = bench.awake_cycles() - awake;
    let awake_permille = awake_cycles * 1000 / ((bench.time_us() - from_us) * CYCLES_PER_US);
    let loads = of_message(&frames, SYS_STATUS)
        .into_iter()
        .map(|frame| SysStatus(frame).load_permille());
    let highest_load = loads.max().unwrap();
    println!("awake {awake_permille} permille of the time, SYS_STATUS.load {highest_load} at most");

    assert_no_sequence_gap(&frames);
    assert_sampled_at_every_tick(&ticks, 2 * HALF_S * TICKS_PER_SECOND);
    assert_eq!(texts_of(&frames), [""; 0]);
    assert_eq!(rig.can.chip.borrow().lost_frames(), 0);
    assert_eq!(bench.resets().len(), 1, "the one for the parameters");
    assert!(bench.bus_errors().is_empty());
    // A third of it is spent waiting for lines of flash. With each reading parts are asked for their set-up, and batteries for
    // their mode.
    assert!(awake_permille < 168 && u64::from(highest_load) < 168);
}
