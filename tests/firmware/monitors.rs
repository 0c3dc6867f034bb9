//! Every kind of monitor, on all buses, lines and pins: what is set while the board runs freezes no pack, and a source that
//! falls silent makes its pack unhealthy.

use crate::serial::protocol_4;
use crate::serial_engine::Peer;
use crate::serial_engine::mega_squirt::Unit;
use crate::serial_engine::torqeedo::{Battery, Echo};
use emulator::i2c_devices::{
    Ad7091r5, Bebop, Bq76952, Ina226, Ina3221, Ltc2946, Pec, Reference, SmartBattery,
};
use emulator::spi_devices::Ina239;
use emulator::{AdcFault, AdcInput, PinWire, UartPins};
use rover_battmon::parameter::{BatteryParameter, Range};
use support::charge_states::UNHEALTHY;
use support::commands::ACCEPTED;
use support::frames::{BATTERY_STATUS, BatteryStatus, COMMAND_ACK, last_of, of_message, texts_of};
use support::pack_report::PackReport;
use support::requests::{arm, arm_by_force, do_set_mode, manual_control, param_set};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND, value_of};
use workbench::can::transfers::{A, ESC_0};
use workbench::can::{BITS_PER_SECOND, CRYSTAL_HZ, CanRig, Peer as CanPeer};
use workbench::i2c_bus::BUS;

const TICK: u64 = 100 * MILLISECOND;

/// Time between two turns of a device that is asked.
const TURN: u64 = MILLISECOND;

const UART: usize = 1;
const GENERATOR_BAUD: u32 = 9_600;

/// Chip select of the INA239, and the pulse input.
const SELECT: usize = 22;
const PULSES: usize = 17;

const SHUNT_OHM: f64 = 0.0005;

/// The longest time-out of all kinds, and a second.
const SILENCE: u64 = 6 * SECOND;

const MANUAL: f32 = 0.0;

/// A flow without pulses is zero: a value that stands still.
const FUEL_FLOW: u8 = 11;

/// A board with packs of these kinds, in the order of their instances.
struct Rig {
    bench: Bench,
    kinds: &'static [u8],
    sources: Sources,
    is_silent: bool,
    drives: bool,
}

/// What is connected and reports by itself, or is asked by the board; the rest is read.
enum Sources {
    Parts(Vec<u8>),
    Links(CanPeer),
    Boat(Battery),
    Engine(Unit),
}

impl Rig {
    fn new(
        kinds: &'static [u8],
        parameters: &[(&str, f32)],
        plug_in: impl FnOnce(&mut Bench) -> Sources,
    ) -> Self {
        let mut bench = Bench::running(DIVIDER_CODE);
        bench.adc_input(1, AdcInput::Code(600));
        bench.adc_input(2, AdcInput::Code(1800));
        let sources = plug_in(&mut bench);
        for (kind, number) in kinds.iter().zip(1..) {
            bench.set(&name(number, "MONITOR"), f32::from(*kind));
        }
        bench.set_all(parameters);
        bench.reboot();
        bench.uart(UART).take_sent();
        bench.forget_sent();
        Self {
            bench,
            kinds,
            sources,
            is_silent: false,
            drives: false,
        }
    }

    fn run_for(&mut self, duration_us: u64) {
        for _ in 0..duration_us / TICK {
            let now_us = self.bench.time_us();
            if self.drives {
                self.bench.uart_send(0, now_us, &manual_control(1, 0, 500));
            }
            if !self.is_silent {
                self.report(now_us);
            }
            match &mut self.sources {
                Sources::Boat(battery) if !self.is_silent => turns(&mut self.bench, battery),
                Sources::Engine(unit) if !self.is_silent => turns(&mut self.bench, unit),
                _ => self.bench.run_for(TICK),
            }
        }
    }

    fn report(&mut self, now_us: u64) {
        let bench = &mut self.bench;
        match &mut self.sources {
            Sources::Links(battery) => {
                battery.send(now_us, A);
                battery.send(now_us, ESC_0);
                let mut report = PackReport::of_voltage(2, 12_000);
                report.current_ca = 100;
                bench.uart_send(0, now_us, &report.frame());
                if (now_us / TICK).is_multiple_of(5) {
                    let sentence = protocol_4("48,6.1,49.9,1200,1300,0,-499,2,0,0,");
                    bench.uart_send_at_baud(UART, now_us, &sentence, GENERATOR_BAUD);
                }
            }
            Sources::Boat(_) => {
                bench.pulses(PULSES, now_us, 1_500, 20 * MILLISECOND, 5);
            }
            Sources::Parts(_) | Sources::Engine(_) => {}
        }
    }

    /// Nothing is connected any more, or nothing works.
    fn fall_silent(&mut self) {
        self.is_silent = true;
        self.bench.adc_fault(AdcFault::ConversionError);
        if let Sources::Parts(addresses) = &self.sources {
            addresses
                .iter()
                .for_each(|address| self.bench.i2c(BUS).detach(*address));
            self.bench.spi1().detach(SELECT);
        }
    }

    fn ask(&mut self, request: &[u8]) -> u8 {
        let asked_us = self.bench.time_us();
        self.bench.request(request);
        self.run_for(2 * TICK);
        of_message(&self.bench.frames_since(asked_us), COMMAND_ACK)[0].u8(2)
    }

    /// Sets another kind for every pack.
    fn change_kinds(&mut self) {
        let others: Vec<_> = (1..)
            .zip(self.kinds)
            .map(|(number, kind)| (name(number, "MONITOR"), if *kind == 3 { 31.0 } else { 3.0 }))
            .collect();
        let from_us = self.bench.time_us();
        let requests: Vec<_> = others
            .iter()
            .map(|(name, value)| param_set(name, *value))
            .collect();
        self.bench.request(&requests.concat());
        self.run_for(SECOND);
        let answers = self.bench.frames_since(from_us);
        for (name, value) in others {
            assert_eq!(value_of(&answers, &name), Some(value), "{name}");
        }
    }

    /// For each pack whether it was unhealthy in one of the reports since then.
    fn were_unhealthy_since(&mut self, from_us: u64) -> Vec<bool> {
        let frames = self.bench.frames_since(from_us);
        let reports = of_message(&frames, BATTERY_STATUS);
        let of_pack = |instance: usize| {
            let statuses = reports.iter().map(|frame| BatteryStatus(frame));
            let mut states = statuses
                .filter(|status| usize::from(status.instance()) == instance)
                .map(|status| status.charge_state())
                .peekable();
            assert!(states.peek().is_some(), "pack {} is not reported", instance + 1);
            states.any(|state| state == UNHEALTHY)
        };
        (0..self.kinds.len()).map(of_pack).collect()
    }

    fn assert_never_frozen(mut self, drives: bool) {
        let case = format!("kinds {:?}, drives: {drives}", self.kinds);
        self.run_for(3 * SECOND);
        if drives {
            // Some of these packs fail arming checks.
            assert_eq!(self.ask(&arm_by_force()), ACCEPTED, "{case}");
            self.ask(&do_set_mode(MANUAL));
            self.bench.ask(&manual_control(1, 0, 0));
            self.drives = true;
        }
        self.bench.run_until_silent();
        let from_us = self.bench.time_us();
        self.change_kinds();
        self.run_for(SILENCE);
        self.bench.run_until_silent();
        let unhealthy = self.were_unhealthy_since(from_us);
        assert_eq!(
            unhealthy,
            vec![false; self.kinds.len()],
            "{case}: measured as before"
        );

        self.fall_silent();
        self.run_for(SILENCE);
        self.bench.run_until_silent();
        let from_us = self.bench.time_us();
        self.run_for(SECOND);
        let unhealthy = self.were_unhealthy_since(from_us);
        let expected: Vec<_> = self.kinds.iter().map(|kind| *kind != FUEL_FLOW).collect();
        assert_eq!(unhealthy, expected, "{case}");
        if !drives {
            assert_ne!(self.ask(&arm()), ACCEPTED, "{case}");
            return;
        }
        self.run_for(6 * SECOND);
        let texts = texts_of(&self.bench.frames());
        for (number, is_missing) in (1..).zip(expected) {
            let text = format!("Battery {number} is missing");
            let is_announced = texts.iter().any(|announced| announced.starts_with(&text));
            assert_eq!(is_announced, is_missing, "{case}, pack {number}: {texts:?}");
        }
    }
}

/// Runs for a tick with a device that is asked.
fn turns<P: Peer>(bench: &mut Bench, device: &mut P) {
    for _ in 0..TICK / TURN {
        bench.run_for(TURN);
        let sent: Vec<u8> = bench
            .uart(UART)
            .take_sent()
            .iter()
            .map(|sent| sent.byte)
            .collect();
        let now_us = bench.time_us();
        let answer = device.turn(&sent, now_us);
        if !answer.is_empty() {
            bench.uart_send_at_baud(UART, now_us, &answer, P::BAUD);
        }
    }
}

/// The name of a parameter of this pack, from 1.
fn name(pack: u8, parameter: &str) -> String {
    match pack {
        1 => format!("BATT_{parameter}"),
        _ => format!("BATT{pack}_{parameter}"),
    }
}

/// Seven smart batteries from 0x0b on, and two power monitors.
fn smart_batteries() -> Rig {
    const KINDS: [u8; 9] = [7, 5, 13, 14, 15, 16, 19, 21, 22];
    let addresses = [0x0b, 0x0c, 0x0d, 0x0e, 0x0f, 0x10, 0x11, 0x40, 0x6f];
    let places: Vec<_> = (1..)
        .zip(addresses)
        .map(|(pack, address)| (name(pack, "I2C_ADDR"), f32::from(address)))
        .collect();
    let parameters: Vec<_> = places
        .iter()
        .map(|(name, address)| (name.as_str(), *address))
        .collect();
    Rig::new(&KINDS, &parameters, |bench| {
        for (kind, address) in KINDS.into_iter().zip(addresses).take(7) {
            bench
                .i2c(BUS)
                .attach(address, Box::new(smart_battery(kind, address)));
        }
        let (mut ina226, mut ltc2946) = (Ina226::new(SHUNT_OHM), Ltc2946::new(SHUNT_OHM));
        ina226.set(12.0, 1.0);
        ltc2946.set(12.0, 1.0);
        bench.i2c(BUS).attach(0x40, Box::new(ina226));
        bench.i2c(BUS).attach(0x6f, Box::new(ltc2946));
        Sources::Parts(addresses.to_vec())
    })
}

fn smart_battery(kind: u8, address: u8) -> SmartBattery {
    let pec = if [13, 14, 16].contains(&kind) {
        Pec::None
    } else {
        Pec::Right
    };
    let mut battery = SmartBattery::new(pec);
    battery.set_address(address);
    battery.set(11.1, 1.0, 25.0);
    let cells = [3700u16; 4].map(u16::to_le_bytes).concat();
    battery.set_block(0x28, &cells);
    let current = (-1000i32).to_le_bytes();
    match kind {
        5 => battery.set_block(0x2a, &current),
        _ => battery.set_bare(0x2a, &current),
    }
    battery.set_block(0x23, &[0; 6]);
    battery.set_word(0x5c, 3);
    (0x30..0x33).for_each(|cell| battery.set_word(cell, 3700));
    battery
}

/// Other parts, and the board's own converter.
fn parts_and_pins() -> Rig {
    let parameters = [
        ("BATT2_VOLT_PIN", 50.0),
        ("BATT2_CURR_PIN", 51.0),
        ("BATT2_VOLT_MULT", 6.0),
        ("BATT4_I2C_ADDR", 8.0),
        ("BATT5_I2C_ADDR", 9.0),
        ("BATT7_CURR_PIN", 27.0),
        ("BATT9_CURR_PIN", 27.0),
    ];
    Rig::new(&[26, 28, 30, 32, 6, 3, 4, 25, 31], &parameters, |bench| {
        let mut ina239 = Ina239::new(SHUNT_OHM);
        ina239.set(12.0, 1.0, 25.0);
        bench.spi1().attach(SELECT, Box::new(ina239));
        let mut converter = Ad7091r5::new(Reference::External(3.3));
        converter.set(0, 2.0);
        converter.set(1, 1.0);
        let mut ina3221 = Ina3221::new(SHUNT_OHM);
        ina3221.set(1, 8.0, 1.0);
        let mut stack = Bq76952::new();
        stack.set(&[3700; 3], 1.0, 25.0);
        let mut motors = Bebop::new(4);
        motors.set(11_400);
        bench.i2c(BUS).attach(0x2f, Box::new(converter));
        bench.i2c(BUS).attach(0x42, Box::new(ina3221));
        bench.i2c(BUS).attach(0x08, Box::new(stack));
        bench.i2c(BUS).attach(0x09, Box::new(motors));
        Sources::Parts(vec![0x2f, 0x42, 0x08, 0x09])
    })
}

/// Nodes on the CAN bus, a companion computer, a fuel cell, a tank at a pin, and a sum of the first pack.
fn links() -> Rig {
    let parameters = [
        ("CAN_P1_DRIVER", 1.0),
        ("SERIAL1_PROTOCOL", 30.0),
        ("GEN_TYPE", 2.0),
        ("BATT5_CAPACITY", 100.0),
        ("BATT6_SUM_MASK", 1.0),
        ("BATT7_FL_PIN", 28.0),
    ];
    Rig::new(&[8, 9, 29, 17, 18, 10, 24], &parameters, |bench| {
        bench.wire_uart(UART, UartPins { tx: 4, rx: 5 });
        let can = CanRig::new(bench, CRYSTAL_HZ, BITS_PER_SECOND);
        Sources::Links(can.peer())
    })
}

/// A boat's battery, and pulses of 1500 us, which are a level, and which are counted.
fn boat() -> Rig {
    let parameters = [
        ("SERIAL1_PROTOCOL", 39.0),
        ("TRQD1_TYPE", 1.0),
        ("BATT2_CURR_PIN", 17.0),
        ("BATT3_CURR_PIN", 17.0),
    ];
    Rig::new(&[23, 12, FUEL_FLOW], &parameters, |bench| {
        bench.wire_uart(UART, UartPins { tx: 4, rx: 5 });
        bench.drive_pin(PULSES, PinWire::Low);
        Sources::Boat(Battery::new(Echo::None))
    })
}

fn engine() -> Rig {
    let parameters = [("SERIAL1_PROTOCOL", 24.0), ("EFI_TYPE", 1.0), ("EFI_COEF1", 0.8)];
    Rig::new(&[27], &parameters, |bench| {
        bench.wire_uart(UART, UartPins { tx: 4, rx: 5 });
        Sources::Engine(Unit::new(2_000, 3000))
    })
}

const RIGS: [fn() -> Rig; 5] = [smart_batteries, parts_and_pins, links, boat, engine];

#[test]
// Requirement: S-4, S-11
fn changed_kinds_freeze_no_pack_while_disarmed() {
    let mut kinds = Vec::new();
    for rig in RIGS {
        let rig = rig();
        kinds.extend(rig.kinds.iter().map(|kind| i32::from(*kind)));
        rig.assert_never_frozen(false);
    }
    let Range::OneOf(choices) = BatteryParameter::Monitor.row().range else {
        panic!("a list of kinds");
    };
    let mut all: Vec<_> = choices
        .iter()
        .map(|(number, _)| *number)
        .filter(|number| *number != 0)
        .collect();
    all.sort_unstable();
    kinds.sort_unstable();
    assert_eq!(kinds, all, "every kind is tried");
}

#[test]
// Requirement: S-1, S-4
fn changed_kinds_freeze_no_pack_while_driving() {
    for rig in RIGS {
        rig().assert_never_frozen(true);
    }
}

/// Kind 7 and its relatives are plugged in four seconds after the start.
#[test]
// Requirement: S-6
fn smart_batteries_that_are_plugged_in_later_are_introduced() {
    let mut rig = smart_batteries();
    let Sources::Parts(addresses) = &rig.sources else {
        panic!("parts");
    };
    let addresses: Vec<_> = addresses.iter().copied().take(7).collect();
    addresses
        .iter()
        .for_each(|address| rig.bench.i2c(BUS).detach(*address));
    rig.bench.power_cycle();
    rig.run_for(4 * SECOND);
    for (kind, address) in rig.kinds.iter().zip(addresses) {
        rig.bench
            .i2c(BUS)
            .attach(address, Box::new(smart_battery(*kind, address)));
    }
    rig.run_for(9 * SECOND);
    let frames = rig.bench.frames();
    for (instance, kind) in (0u8..).zip(rig.kinds).take(7) {
        let status = last_of(&frames, instance);
        let cells = (0..10)
            .take_while(|cell| status.voltage_mv(*cell) == 3700)
            .count();
        let expected = match kind {
            5 => 4,
            // It reports four of six, so none is reported.
            14 => 0,
            _ => 3,
        };
        assert_eq!(
            (cells, status.charge_state() != UNHEALTHY),
            (expected, true),
            "kind {kind}"
        );
    }
}
