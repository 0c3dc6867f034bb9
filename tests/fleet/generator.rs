//! Logs of a fleet whose truth is known: packs that age and packs that do not, driven in stepped time through the monitor that
//! the board runs, and recorded as the board records.

use std::fs;
use std::path::Path;

use rover_battmon::battery::{BatteryMonitor, BatteryState, Extremes, LearntPack, Measurement, Tick};
use rover_battmon::memory::identity::BoardId;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, Parameters, VehicleParameter};
use rover_battmon::recorder::dataflash::{ArmingMethod, Record, opening_record};
use rover_battmon::time::{Instant, Utc};
use rover_battmon::vehicle::ArmState;
use rover_battmon_tools::sim::{PackModel, SimulatedPack};

/// Drives of each pack.
pub const DRIVES: usize = 20;

/// One in this many packs ages.
const ONE_AGES_OF: usize = 5;

/// What an ageing pack has lost after this many drives, relative to the first, and what another one has. From then on it stays.
const AGEING_DRIVES: usize = 12;
const LOST_BY_AGEING: f32 = 0.3;
const LOST_BY_OTHERS: f32 = 0.02;

const RATED_MAH: f32 = 2200.0;

/// A better pack than a typical one: the board takes one with 1.5 times the resistance of that for cold, and learns nothing.
const NEW_OHM: f32 = 0.024;

const TICK_US: u64 = 100_000;
const TICK_S: f32 = 0.1;

/// Ticks from one BAT to the next, and readings from one BATX to the next.
const TICKS_OF_READING: u64 = 2;
const READINGS_OF_ESTIMATE: u64 = 5;

/// When the rover is armed and disarmed, when the log ends and when the board is switched off, in ticks.
const ARMED: u64 = 600;
const DISARMED: u64 = ARMED + 6_000;
const LOG_END: u64 = DISARMED + 150;
const OFF: u64 = DISARMED + 1_200;

const DRIVE_H: f32 = 600.0 / 3600.0;

/// 2026-01-01, in seconds since 1970.
const FIRST_DAY_S: u64 = 1_767_225_600;
const DAY_S: u64 = 86_400;

/// What is drawn of the true capacity in a drive. In between the cells of a simulated pack and those that the board expects
/// differ more.
const DRAWN: f32 = 0.95;

/// A load of two currents by turns, relative to its mean.
const HIGH: f32 = 1.25;
const LOW: f32 = 0.75;

const AT_REST_A: f32 = 0.1;

/// A pack, and the rover that it is in.
pub struct Owned {
    number: usize,
    known: LearntPack,
    driven: usize,
}

impl Owned {
    /// The pack with this number, from 0.
    pub fn new(number: usize) -> Self {
        Self {
            number,
            known: LearntPack::UNKNOWN,
            driven: 0,
        }
    }

    pub fn serial_number(&self) -> i32 {
        1000 + self.number as i32
    }

    fn id(&self) -> BoardId {
        let [.., high, middle, low] = self.number.to_be_bytes();
        BoardId([0xe6, 0x60, 0x38, 0xb7, 0x13, high, middle, low])
    }

    pub fn board_id(&self) -> String {
        self.id().serial_number().to_string()
    }

    pub fn system_id(&self) -> u8 {
        (self.number % 250 + 1) as u8
    }

    /// Whether it ages.
    pub fn ages(&self) -> bool {
        self.number % ONE_AGES_OF == 3
    }

    /// What it has lost in a drive, from 0 on.
    fn lost(&self, drive: usize) -> f32 {
        let most = if self.ages() {
            LOST_BY_AGEING
        } else {
            LOST_BY_OTHERS
        };
        most * drive.min(AGEING_DRIVES) as f32 / AGEING_DRIVES as f32
    }

    /// Its true capacity in a drive, in milliampere-hours.
    pub fn capacity_mah(&self, drive: usize) -> f32 {
        RATED_MAH * (1.0 - self.lost(drive))
    }

    /// Its true resistance in a drive, in ohms.
    pub fn resistance_ohm(&self, drive: usize) -> f32 {
        NEW_OHM * (1.0 + 2.0 * self.lost(drive))
    }

    /// What a drive draws, in milliampere-hours.
    pub fn drawn_mah(&self, drive: usize) -> f32 {
        DRAWN * self.capacity_mah(drive)
    }

    fn model(&self) -> PackModel {
        let resistance_ohm = self.resistance_ohm(self.driven);
        PackModel {
            capacity_ah: self.capacity_mah(self.driven) / 1e3,
            ohmic_resistance_ohm: resistance_ohm,
            polarization_resistance_ohm: 0.5 * resistance_ohm,
            ..PackModel::LIPO_3S_2200
        }
    }

    fn parameters(&self) -> Parameters {
        let mut parameters = Parameters::defaults();
        let of_pack = |parameter: BatteryParameter| parameter.of(Pack::First);
        for (id, value) in [
            (of_pack(BatteryParameter::Monitor), 4.0),
            (of_pack(BatteryParameter::Cells), 3.0),
            (of_pack(BatteryParameter::Capacity), RATED_MAH),
            (of_pack(BatteryParameter::SerialNum), self.serial_number() as f32),
            (of_pack(BatteryParameter::LowVolt), 10.8),
            (VehicleParameter::SysidThismav.into(), self.system_id().into()),
        ] {
            parameters.set(id, value).expect("in range");
        }
        parameters
    }

    /// The log of the next drive: charged, rested, driven for ten minutes, and rested.
    pub fn drive(&mut self) -> Vec<u8> {
        let parameters = self.parameters();
        let settings = parameters.pack(Pack::First).settings();
        let mut pack = SimulatedPack::full(self.model());
        let (mut monitor, mut battery) = (BatteryMonitor::new(), BatteryState::default());
        monitor.restore_learnt(self.known);
        let mut noise = fastrand::Rng::with_seed((self.number * DRIVES + self.driven) as u64);
        let mean_a = self.drawn_mah(self.driven) / 1e3 / DRIVE_H;
        let mut log = vec![];
        for tick in 1..=OFF {
            let is_driven = (ARMED..DISARMED).contains(&tick);
            let current_a = match (is_driven, tick / 80 % 2) {
                (false, _) => AT_REST_A,
                (true, 0) => HIGH * mean_a,
                (true, _) => LOW * mean_a,
            };
            pack.draw(current_a, TICK_S);
            let time_us = tick * TICK_US;
            let reading = Measurement {
                voltage_v: Some(pack.voltage_v() + 0.01 * (noise.f32() - 0.5)),
                current_a: Some(current_a + 0.04 * (noise.f32() - 0.5)),
                temperature_c: Some(20.0 + (tick as f32) / 600.0),
                ..Measurement::default()
            };
            let arm_state = if is_driven {
                ArmState::Armed
            } else {
                ArmState::Disarmed
            };
            let now = Instant::from_micros(time_us);
            let _ = monitor.update(
                &mut battery,
                Tick {
                    now,
                    load_state: arm_state.into(),
                },
                Ok(reading),
                &settings,
            );
            match tick {
                ARMED => {
                    log.extend(self.opening(time_us, &parameters, &battery));
                    log.extend(arming(ArmState::Armed, time_us));
                }
                DISARMED => log.extend(arming(ArmState::Disarmed, time_us)),
                _ => {}
            }
            if (ARMED..LOG_END).contains(&tick) && tick.is_multiple_of(TICKS_OF_READING) {
                log.extend(records(tick, &battery));
            }
        }
        if let Some(learnt) = monitor.unsaved_learnt() {
            self.known = *learnt;
        }
        self.driven += 1;
        log
    }

    /// What the file begins with.
    fn opening(&self, time_us: u64, parameters: &Parameters, state: &BatteryState) -> Vec<u8> {
        let mut bytes: Vec<u8> = (0..)
            .map_while(|index| opening_record(index, time_us))
            .flatten()
            .collect();
        let identity = [
            Record::Board(self.id()),
            Record::Pack(Pack::First, state, Some(&self.known)),
            Record::Curve(Pack::First, &self.known),
        ];
        bytes.extend(identity.iter().flat_map(|record| record.encode(time_us)));
        for id in parameters.listed() {
            let name = id.name();
            let record = Record::Parameter {
                name: name.as_str(),
                value: parameters.get(id),
                default: id.default_value(),
            };
            bytes.extend(record.encode(time_us));
        }
        let started_s = FIRST_DAY_S + self.driven as u64 * DAY_S;
        let utc = Utc::from_micros(started_s * 1_000_000 + time_us);
        bytes.extend(Record::Time(utc).encode(time_us));
        bytes
    }
}

pub fn arming(state: ArmState, time_us: u64) -> Vec<u8> {
    let record = Record::Arm {
        state,
        enabled_checks: 1,
        forced: false,
        method: ArmingMethod::Command,
    };
    record.encode(time_us).to_vec()
}

fn records(tick: u64, state: &BatteryState) -> Vec<u8> {
    let time_us = tick * TICK_US;
    let mut bytes = Record::Battery(Pack::First, state).encode(time_us).to_vec();
    if (tick / TICKS_OF_READING).is_multiple_of(READINGS_OF_ESTIMATE) {
        bytes.extend(Record::Estimate(Pack::First, state, Extremes::default()).encode(time_us));
    }
    bytes
}

/// Writes a folder with the logs of this many packs in folders of their own.
pub fn write_fleet(folder: &Path, packs: usize) -> Vec<Owned> {
    let write = |number: usize| {
        let mut pack = Owned::new(number);
        let below = folder.join(format!("rover-{number:03}"));
        fs::create_dir_all(&below).expect("a folder");
        for drive in 1..=DRIVES {
            fs::write(below.join(format!("{drive:08}.BIN")), pack.drive()).expect("a file");
        }
        pack
    };
    (0..packs).map(write).collect()
}
