//! A drive, its log, and what the wire carried meanwhile.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use ardupilot_binlog::Entry;

use crate::bench::{Bench, MILLISECOND, SECOND, TestedVehicle};
use crate::i2c_bus::{BUS, shared};
use crate::log_records::named;
use emulator::AdcInput;
use emulator::i2c_devices::{Ina226, Pec, RegisterMap, SmartBattery};
use support::commands::ACCEPTED;
use support::frames::{BATTERY_STATUS, BatteryStatus, Frame, HEARTBEAT, of_message, texts_of};
use support::requests::{VEHICLE_ID, arm_by_force, disarm, manual_control, manual_mode};

/// The converter's channels of the first two packs.
const DIVIDERS: [usize; 2] = [0, 2];

/// Three cells at 3.8 V there.
const FULL_CODE: u16 = 3582;

/// Interval at which stick input is sent and a drive looked at.
const STEP_US: u64 = 100 * MILLISECOND;

/// The voltages change after this many steps, so that each is on the wire.
const STEPS_BETWEEN_CHANGES: u32 = 5;

/// What was heard is taken after this many steps.
const STEPS_BETWEEN_LOOKS: u32 = 600;

/// A record is older than its BATTERY_STATUS: the next one of its pack, ten times a second, and the frames before it.
const ON_WIRE_AFTER_US: u64 = 150 * MILLISECOND;

/// The lower half of the time since the reset, in µs (RP2040 datasheet 4.6.5).
const TIMERAWL: u32 = 0x4005_4028;

/// The log goes on for 15 s after disarming, and is in flash a second later.
const WRITTEN_AFTER_US: u64 = 17 * SECOND;

/// What the wire carried.
#[derive(Default)]
pub struct Heard {
    /// By instance: time in µs and voltage in mV.
    voltages: BTreeMap<u8, Vec<(u64, u32)>>,
    pub texts: Vec<String>,
    pub heartbeats: usize,
}

impl Heard {
    fn take(&mut self, frames: &[Frame]) {
        for frame in of_message(frames, BATTERY_STATUS) {
            let status = BatteryStatus(frame);
            let voltages = self.voltages.entry(status.instance()).or_default();
            voltages.push((frame.at_us, status.sum_of_cells_mv()));
        }
        self.texts.extend(texts_of(frames));
        self.heartbeats += of_message(frames, HEARTBEAT).len();
    }

    /// Whether a pack had this voltage on the wire within [`ON_WIRE_AFTER_US`] of a time, or one below and one above: the mean of
    /// a tick in which the voltage changes may be of that tick only.
    fn has(&self, instance: u8, at_us: u64, voltage_mv: u32) -> bool {
        let voltages = &self.voltages[&instance];
        let within = |from_us: u64| {
            let from = voltages.partition_point(|(heard_us, _)| *heard_us < from_us);
            let heard = voltages[from..].iter();
            heard
                .take_while(|(heard_us, _)| *heard_us < at_us + ON_WIRE_AFTER_US)
                .map(|(_, heard_mv)| *heard_mv)
        };
        let around = || within(at_us - ON_WIRE_AFTER_US);
        let is_between =
            around().any(|heard_mv| heard_mv < voltage_mv) && around().any(|heard_mv| heard_mv > voltage_mv);
        is_between || within(at_us).any(|heard_mv| heard_mv == voltage_mv)
    }
}

/// A rover that drives on two packs on the converter, or on those, a power monitor and a smart battery.
pub struct LoggedDrive {
    pub bench: Bench,
    pub heard: Heard,
    monitor: Rc<RefCell<RegisterMap<Ina226>>>,
    battery: Rc<RefCell<SmartBattery>>,
    steps: u32,
}

impl LoggedDrive {
    /// A board that runs, disarmed, with two or four packs.
    pub fn on_packs(packs: usize) -> Self {
        let settings: [&[(&str, f32)]; 4] = [
            &[("BATT_CELLS", 3.0)],
            &[
                ("BATT2_MONITOR", 3.0),
                ("BATT2_VOLT_PIN", 28.0),
                ("BATT2_CELLS", 3.0),
            ],
            &[("BATT3_MONITOR", 21.0)],
            &[("BATT4_MONITOR", 7.0)],
        ];
        let mut parameters = settings[..packs].concat();
        parameters.push(("SR0_EXTRA1", 10.0));
        let mut drive = Self {
            bench: Bench::configured(FULL_CODE, &parameters),
            heard: Heard::default(),
            monitor: shared(Ina226::new(0.0005)),
            battery: shared(SmartBattery::new(Pec::Right)),
            steps: 0,
        };
        let (monitor, battery) = (Rc::clone(&drive.monitor), Rc::clone(&drive.battery));
        drive.bench.i2c(BUS).attach(0x40, Box::new(monitor));
        drive.bench.i2c(BUS).attach(0x0b, Box::new(battery));
        drive.change_voltages();
        // The parts of the other packs are found meanwhile, which is announced.
        drive.bench.run_for(10 * SECOND);
        drive.bench.run_until_silent();
        drive.bench.forget_sent();
        drive
    }

    fn change_voltages(&mut self) {
        let change = self.steps / STEPS_BETWEEN_CHANGES % 50;
        for (channel, per_step) in DIVIDERS.into_iter().zip([3, 2]) {
            let code = FULL_CODE - per_step * change as u16;
            self.bench.adc_input(channel, AdcInput::Code(code));
        }
        let change = f64::from(change);
        self.monitor.borrow_mut().set(11.5 - 0.005 * change, 1.0);
        // Three cells.
        self.battery.borrow_mut().set(11.4 - 0.003 * change, 1.0, 25.0);
    }

    pub fn arm(&mut self) {
        assert_eq!(self.bench.result_of(&arm_by_force()), ACCEPTED);
        self.bench.ask(&manual_mode());
        self.bench.ask(&manual_control(VEHICLE_ID, 0, 0));
    }

    /// Drives for this time.
    pub fn drive_for(&mut self, length_us: u64) {
        for _ in 0..length_us / STEP_US {
            self.steps += 1;
            if self.steps.is_multiple_of(STEPS_BETWEEN_CHANGES) {
                self.change_voltages();
            }
            self.bench.request(&manual_control(VEHICLE_ID, 100, 500));
            self.bench.run_for(STEP_US);
            if self.steps.is_multiple_of(STEPS_BETWEEN_LOOKS) {
                self.listen();
            }
        }
    }

    /// Disarms, and lets time pass until everything is in flash.
    pub fn end(&mut self) {
        self.bench.ask(&disarm());
        self.bench.run_for(WRITTEN_AFTER_US);
        self.listen();
    }

    fn listen(&mut self) {
        self.bench.run_until_silent();
        let frames = self.bench.frames();
        self.heard.take(&frames);
        self.bench.forget_sent();
        self.bench.i2c(BUS).take_transactions();
    }

    /// Panics unless each BAT has the voltage that was on the wire at its time, and each pack has some. Returns how many
    /// were compared.
    pub fn compare_voltages(&mut self, records: &[Entry]) -> usize {
        let timer = u64::from(self.bench.read_register(TIMERAWL));
        let start_us = self.bench.time_us() - timer;
        let mut compared: BTreeMap<u8, usize> = BTreeMap::new();
        for record in named(records, "BAT") {
            let instance = record.get_i64("Inst").expect("a number") as u8;
            let voltage_v = record.get_f64("Volt").expect("a number") as f32;
            let at_us = start_us + record.get_u64("TimeUS").expect("a time");
            let voltage_mv = (voltage_v * 1000.0).round() as u32;
            assert!(
                self.heard.has(instance, at_us, voltage_mv),
                "pack {instance} at {at_us} us: {voltage_mv} mV was not on the wire: {record:?}"
            );
            *compared.entry(instance).or_default() += 1;
        }
        assert_eq!(compared.len(), self.heard.voltages.len(), "{compared:?}");
        compared.into_values().sum()
    }

    /// Panics unless the file has every parameter with its value, and nothing was left out.
    pub fn assert_complete(&mut self, records: &[Entry]) {
        let recorded: BTreeMap<_, _> = named(records, "PARM")
            .map(|record| {
                let name = record.get_str("Name").expect("a text").to_owned();
                (name, record.get_f64("Value").expect("a number") as f32)
            })
            .collect();
        assert_eq!(recorded, self.bench.list());
        let messages: Vec<_> = named(records, "MSG")
            .filter_map(|record| record.get_str("Message"))
            .collect();
        for text in &self.heard.texts {
            assert!(
                messages.contains(&text.as_str()),
                "{text:?} is not of {messages:?}"
            );
        }
        let dropped = named(records, "PM").map(|record| record.get_i64("LogDrop"));
        assert_eq!(dropped.last(), Some(Some(0)), "records were dropped");
    }
}
