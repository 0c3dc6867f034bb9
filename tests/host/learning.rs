//! A pack is learnt from its drives: simulated cells at the pins, frames on the wire, and flash that outlasts power cycles.

use std::collections::HashMap;

use rover_battmon::autopilot::{FlashJob, FlashStore, Start};
use rover_battmon::battery::{BatteryState, LEARNT_WORDS};
use rover_battmon::pack::Pack;
use rover_battmon::sensor::{AnalogPin, AnalogReadings};
use rover_battmon::vehicle::ArmState;
use rover_battmon_tools::sim::{PackModel, SimulatedPack};
use support::commands::{BATTERY_RESET, FAILED};
use support::desk::{DIVIDER, Desk, conversions, id_of, start_with};
use support::frames::texts_of;
use support::requests::{
    VEHICLE_ID, arm, arm_by_force, command_long_2, disarm_by_force, manual_control, param_set,
};

use crate::simulated_packs::assert_about;

const AMPERES_PER_VOLT: f32 = 2.0;

const TICK_S: f32 = 0.1;

/// Loads of a drive, and at rest, in amperes.
const LOW_A: f32 = 1.5;
const HIGH_A: f32 = 5.5;
const RESTING_A: f32 = 0.1;

/// A pack of three cells at rest.
fn pack_of(capacity_ah: f32, charge: f32) -> SimulatedPack {
    let model = PackModel {
        capacity_ah,
        ..PackModel::LIPO_3S_2200
    };
    let mut pack = SimulatedPack::full(model);
    pack.draw((1.0 - charge) * capacity_ah, 3600.0);
    pack.draw(0.0, 10_000.0);
    pack
}

fn full() -> SimulatedPack {
    pack_of(2.2, 1.0)
}

/// A rover with a pack at its pins.
struct Rover {
    desk: Desk,
    pack: SimulatedPack,
    flash: HashMap<u32, [u32; LEARNT_WORDS]>,
    writes: usize,
    texts: Vec<String>,
    /// Current that the sensor adds, in amperes.
    zero_a: f32,
}

impl Rover {
    fn new(parameters: &[(&str, f32)], pack: SimulatedPack) -> Self {
        let basis = [
            ("BATT_MONITOR", 4.0),
            ("BATT_CURR_PIN", 27.0),
            ("BATT_AMP_PERVLT", AMPERES_PER_VOLT),
            ("BATT_CELLS", 3.0),
            ("BATT_CAPACITY", 2200.0),
        ];
        Self {
            desk: Desk::starting(start_with(&[&basis[..], parameters].concat())),
            pack,
            flash: HashMap::new(),
            writes: 0,
            texts: Vec::new(),
            zero_a: 0.0,
        }
    }

    fn tick(&mut self, load_a: f32) {
        self.pack.draw(load_a, TICK_S);
        self.measure(self.pack.voltage_v(), load_a);
    }

    fn measure(&mut self, voltage_v: f32, current_a: f32) {
        let mut readings = AnalogReadings::NONE;
        readings.set(AnalogPin::Gp26, Ok(conversions(voltage_v / DIVIDER)));
        readings.set(
            AnalogPin::Gp27,
            Ok(conversions((current_a + self.zero_a) / AMPERES_PER_VOLT)),
        );
        self.desk.now_us += 100_000;
        self.desk.sample(readings);
        self.desk.drive();
        self.run_jobs();
        self.desk.post_due(self.desk.now_us);
        self.texts.extend(texts_of(&self.desk.sent()));
    }

    /// A pack at this voltage, with this current.
    fn hold(&mut self, voltage_v: f32, current_a: f32, seconds: usize) {
        for _ in 0..10 * seconds {
            self.measure(voltage_v, current_a);
        }
    }

    fn run_jobs(&mut self) {
        let mut jobs = 0;
        while let Some(job) = self.desk.next_flash_job(FlashStore::Learnt) {
            jobs += 1;
            assert!(jobs < 40, "{job:?}");
            let stored = match &job {
                FlashJob::ReadLearnt(identity) => self.flash.get(&identity.key()).copied(),
                FlashJob::WriteLearnt(identity, learnt) => {
                    self.flash.insert(identity.key(), learnt.to_words());
                    self.writes += 1;
                    None
                }
                _ => panic!("{job:?}"),
            };
            self.desk.flash_done(&job, Ok(stored));
        }
    }

    fn wait(&mut self, seconds: f32, load_a: f32) {
        for _ in 0..(seconds / TICK_S) as u32 {
            self.tick(load_a);
        }
    }

    /// The wire that measures the voltage is loose.
    fn wait_without_voltage(&mut self, seconds: f32, load_a: f32) {
        for _ in 0..(seconds / TICK_S) as u32 {
            self.pack.draw(load_a, TICK_S);
            self.measure(0.2, load_a);
        }
    }

    /// Drives by fits and starts until this share of the pack is left. Returns the largest error of the estimate, in percent.
    fn drive_to(&mut self, charge: f32) -> f32 {
        let mut largest_pct = 0.0_f32;
        while self.pack.charge() > charge {
            for load_a in [HIGH_A, LOW_A] {
                self.wait(5.0, load_a);
                largest_pct = largest_pct.max(self.error_pct().abs());
            }
        }
        largest_pct
    }

    /// A whole drive with this pack, from power-up to a rest. Returns the largest error.
    fn learn(&mut self, pack: SimulatedPack) -> f32 {
        self.pack = pack;
        self.wait(5.0, RESTING_A);
        let largest_pct = self.drive_to(0.05);
        self.wait(40.0, RESTING_A);
        largest_pct
    }

    fn remaining_pct(&self) -> f32 {
        self.state().readings.remaining_pct.expect("an estimate")
    }

    fn error_pct(&self) -> f32 {
        self.remaining_pct() - self.pack.charge() * 100.0
    }

    fn learnt_mah(&self) -> f32 {
        self.parameter("BATT_LRN_CAP")
    }

    fn set(&mut self, name: &str, value: f32) {
        self.desk.ask(&param_set(name, value));
        self.wait(1.0, RESTING_A);
    }

    fn arm(&mut self) {
        self.desk.ask(&manual_control(VEHICLE_ID, 0, 0));
        self.desk.ask(&arm_by_force());
    }

    fn disarm(&mut self) {
        self.desk.ask(&disarm_by_force());
    }

    /// Asserts that a pack was announced to be learnt this often.
    #[track_caller]
    fn assert_announced(&self, times: usize) {
        let announced = self.texts.iter().filter(|text| text.contains("learnt"));
        assert_eq!(announced.count(), times, "{:?}", self.texts);
    }

    fn says(&self, start: &str) -> bool {
        self.texts.iter().any(|text| text.starts_with(start))
    }

    #[track_caller]
    fn assert_learnt_about(&self, expected_mah: f32, tolerance_mah: f32) {
        assert_about(Some(self.learnt_mah()), expected_mah, tolerance_mah);
    }

    fn state(&self) -> &BatteryState {
        self.desk.autopilot.battery(Pack::First)
    }

    fn power_cycle(&mut self) {
        let parameters = self.desk.parameters().clone();
        self.desk = Desk::starting(Start::with_parameters(parameters));
    }

    fn parameter(&self, name: &str) -> f32 {
        self.desk.parameters().get(id_of(name))
    }
}

#[test]
fn wrong_label_is_absorbed_from_the_second_drive_on() {
    // Labels 25 % above and 17 % below what the pack has.
    for capacity_ah in [1.76, 2.64] {
        let mut rover = Rover::new(&[], full());
        let first = rover.learn(pack_of(capacity_ah, 1.0));
        rover.assert_learnt_about(capacity_ah * 1e3, 70.0 * capacity_ah);
        rover.power_cycle();
        let second = rover.learn(pack_of(capacity_ah, 1.0));
        assert!(
            second < 0.4 * first,
            "{capacity_ah} Ah: {first} %, then {second} %"
        );
        rover.assert_announced(1);
    }
}

/// A full pack whose resistances are this many times as large.
fn with_resistance(factor: f32) -> SimulatedPack {
    let model = PackModel::LIPO_3S_2200;
    SimulatedPack::full(PackModel {
        ohmic_resistance_ohm: factor * model.ohmic_resistance_ohm,
        polarization_resistance_ohm: factor * model.polarization_resistance_ohm,
        ..model
    })
}

#[test]
fn a_pack_whose_contacts_double_its_resistance_is_learnt() {
    let mut rover = Rover::new(&[], full());
    rover.learn(with_resistance(2.4));
    rover.assert_learnt_about(2200.0, 110.0);
    let mohm = 2.4 * 36.0;
    assert_about(Some(rover.parameter("BATT_LRN_RES")), mohm, 0.2 * mohm);
}

#[test]
fn a_pack_that_was_met_cold_first_keeps_its_capacity_and_shows_its_resistance_warm() {
    let mut rover = Rover::new(&[], full());
    rover.learn(with_resistance(2.2));
    let (cold_mah, cold_mohm) = (rover.learnt_mah(), rover.parameter("BATT_LRN_RES"));
    rover.power_cycle();
    rover.learn(full());
    let (warm_mah, warm_mohm) = (rover.learnt_mah(), rover.parameter("BATT_LRN_RES"));
    rover.assert_learnt_about(cold_mah, 0.05 * cold_mah);
    assert!(warm_mohm < 0.6 * cold_mohm, "{cold_mohm}, then {warm_mohm}");
    // It is that pack.
    rover.assert_announced(1);
    // Cold once more, it spoils nothing.
    rover.power_cycle();
    rover.learn(with_resistance(2.2));
    assert_about(Some(rover.parameter("BATT_LRN_RES")), warm_mohm, 0.03 * warm_mohm);
    rover.assert_learnt_about(warm_mah, 0.05 * warm_mah);
}

#[test]
fn equal_drives_with_short_rests_do_not_raise_the_capacity() {
    for rest_s in [60.0, 120.0] {
        let mut rover = Rover::new(&[], full());
        for drive in 0..14 {
            rover.power_cycle();
            rover.pack = full();
            rover.wait(5.0, RESTING_A);
            rover.drive_to(0.15);
            let error_pct = rover.error_pct();
            assert!(error_pct.abs() <= 4.0, "{rest_s} s, drive {drive}: {error_pct}");
            rover.wait(rest_s, RESTING_A);
        }
        rover.assert_learnt_about(2200.0, 110.0);
    }
}

#[test]
fn erased_knowledge_does_not_return_from_the_same_drive() {
    let mut rover = Rover::new(&[], full());
    rover.learn(full());
    assert!(rover.learnt_mah() > 0.0);
    rover.set("BATT_LRN_ERASE", 1.0);
    rover.wait(1000.0, RESTING_A);
    assert_eq!(rover.learnt_mah(), 0.0);
    // In the middle of a drive.
    rover.power_cycle();
    rover.pack = full();
    rover.wait(5.0, RESTING_A);
    rover.drive_to(0.5);
    rover.set("BATT_LRN_ERASE", 1.0);
    rover.drive_to(0.4);
    rover.wait(1000.0, RESTING_A);
    assert_eq!(rover.learnt_mah(), 0.0);
}

#[test]
fn a_serial_number_has_only_what_was_learnt_under_it() {
    let mut rover = Rover::new(&[], full());
    rover.learn(pack_of(1.76, 1.0));
    let learnt_mah = rover.learnt_mah();
    assert!(learnt_mah > 0.0);
    rover.set("BATT_SERIAL_NUM", 7.0);
    rover.wait(1000.0, RESTING_A);
    assert_eq!(rover.learnt_mah(), 0.0, "the drive was that of another pack");
    rover.set("BATT_SERIAL_NUM", -1.0);
    assert_eq!(rover.learnt_mah(), learnt_mah);
    // In the middle of a drive.
    rover.power_cycle();
    rover.pack = full();
    rover.wait(5.0, RESTING_A);
    rover.arm();
    rover.drive_to(0.5);
    let before = rover.remaining_pct();
    rover.set("BATT_SERIAL_NUM", 7.0);
    assert!((rover.remaining_pct() - before).abs() < 1.0, "counting goes on");
    rover.disarm();
    rover.wait(1000.0, RESTING_A);
    assert_eq!(rover.learnt_mah(), 0.0);
    // Set before the drive, as usual.
    rover.power_cycle();
    rover.pack = full();
    rover.set("BATT_SERIAL_NUM", 8.0);
    rover.learn(full());
    assert!(rover.learnt_mah() > 0.0);
}

#[test]
fn settings_of_another_pack_hide_what_is_learnt_until_they_are_put_right() {
    for (name, mistake) in [("BATT_CHEM", 3.0), ("BATT_CELLS", 2.0), ("BATT_CAPACITY", 6000.0)] {
        let mut rover = Rover::new(&[], full());
        rover.learn(full());
        let (learnt_mah, right) = (rover.learnt_mah(), rover.parameter(name));
        assert!(rover.state().state_of_health_pct.is_some());
        rover.set(name, mistake);
        rover.wait(100.0, RESTING_A);
        assert_eq!(rover.state().state_of_health_pct, None, "{name}");
        assert_eq!(rover.state().learnt_capacity_mah, None, "{name}");
        rover.set(name, right);
        rover.wait(100.0, RESTING_A);
        rover.assert_learnt_about(learnt_mah, 0.02 * learnt_mah);
        assert!(rover.state().state_of_health_pct.is_some(), "{name}");
    }
}

#[test]
fn a_pack_of_another_capacity_is_learnt_in_place_of_the_one_before() {
    let mut rover = Rover::new(&[("BATT_CAPACITY", 1000.0)], full());
    rover.learn(pack_of(1.0, 1.0));
    rover.assert_learnt_about(1000.0, 100.0);
    rover.set("BATT_CAPACITY", 2200.0);
    rover.power_cycle();
    rover.learn(full());
    rover.assert_learnt_about(2200.0, 300.0);
    rover.assert_announced(2);
}

#[test]
fn a_swapped_pack_does_not_inherit() {
    let mut rover = Rover::new(&[], full());
    rover.learn(full());
    let writes = rover.writes;
    rover.hold(0.0, 0.0, 4);
    rover.pack = full();
    rover.wait(100.0, RESTING_A);
    assert!(rover.says("Battery 1 swapped"), "{:?}", rover.texts);
    assert_eq!(rover.state().learnt_capacity_mah, None);
    assert_eq!(rover.learnt_mah(), 0.0);
    assert_eq!(
        rover.writes, writes,
        "flash keeps what it has until this pack is learnt"
    );
}

#[test]
fn an_over_discharged_pack_is_not_taken_for_a_full_smaller_one() {
    let mut rover = Rover::new(&[], full());
    rover.wait(100.0, RESTING_A);
    rover.set("BATT_CELLS", 0.0);
    rover.power_cycle();
    rover.texts.clear();
    // Three cells are kept, and two are detected.
    rover.hold(8.5, RESTING_A, 10);
    assert!(rover.says("Battery 1 cells unclear at 8.5"), "{:?}", rover.texts);
    assert!(!rover.says("Set BATT_LOW_VOLT"), "{:?}", rover.texts);
    let answers = rover.desk.ask(&arm());
    assert_eq!(
        texts_of(&answers),
        ["Arm: Battery 1 cells unclear: set BATT_CELLS"]
    );
    let reset = command_long_2(BATTERY_RESET, 65535.0, 100.0);
    assert_eq!(rover.desk.result_of(&reset), FAILED);
    assert_eq!(rover.state().cell_count, None);
    rover.hold(8.5, RESTING_A, 100);
    assert_eq!(rover.state().readings.remaining_pct, None);
    assert_eq!(rover.writes, 1, "what is kept stays");
    rover.arm();
    assert_eq!(rover.desk.vehicle().arm_state(), ArmState::Armed, "forced");
}

#[test]
fn every_pack_learns_but_a_sum_does_not() {
    let mut rover = Rover::new(
        &[
            ("BATT9_MONITOR", 4.0),
            ("BATT9_VOLT_PIN", 26.0),
            ("BATT9_CURR_PIN", 27.0),
            ("BATT9_AMP_PERVLT", AMPERES_PER_VOLT),
            ("BATT9_CELLS", 3.0),
            ("BATT9_CAPACITY", 2200.0),
            ("BATT2_MONITOR", 10.0),
            ("BATT2_CELLS", 3.0),
            ("BATT2_CAPACITY", 2200.0),
            ("BATT2_SUM_MASK", 1.0),
        ],
        full(),
    );
    rover.learn(full());
    assert!(rover.learnt_mah() > 0.0);
    assert_eq!(rover.parameter("BATT9_LRN_CAP"), rover.learnt_mah());
    assert_eq!(rover.parameter("BATT2_LRN_CAP"), 0.0);
    assert_eq!(rover.flash.len(), 2);
}

#[test]
fn a_parked_rover_spares_flash() {
    for monitor in [3.0, 4.0] {
        let mut rover = Rover::new(&[("BATT_MONITOR", monitor)], pack_of(2.2, 0.6));
        rover.wait(3600.0, RESTING_A);
        assert!((1..=5).contains(&rover.writes), "{} in an hour", rover.writes);
        let parked = rover.writes;
        for _ in 0..300 {
            rover.arm();
            rover.wait(1.0, RESTING_A);
            rover.disarm();
            rover.wait(1.0, RESTING_A);
        }
        let writes = rover.writes - parked;
        assert!(writes <= 6, "{writes} while armed and disarmed 300 times");
    }
}

#[test]
fn the_offset_of_a_sensor_is_not_learnt_while_parked() {
    let mut rover = Rover::new(&[("BATT_AMP_OFFSET", -0.05)], full());
    rover.learn(full());
    let learnt_mah = rover.learnt_mah();
    rover.wait(5.0 * 3600.0, 0.0);
    // The offset alone counts 0.5 Ah.
    rover.assert_learnt_about(learnt_mah, 0.02 * learnt_mah);
}

#[test]
// Requirement: L-11
fn a_loose_wire_at_the_voltage_in_stop_and_go_invents_no_charge() {
    let mut rover = Rover::new(&[], full());
    rover.wait(5.0, RESTING_A);
    rover.arm();
    rover.drive_to(0.8);
    while rover.pack.charge() > 0.4 {
        rover.wait_without_voltage(20.0, HIGH_A);
        rover.wait_without_voltage(30.0, RESTING_A);
    }
    let drawn_mah = (1.0 - rover.pack.charge()) * 2200.0;
    assert_about(rover.state().consumed_mah(), drawn_mah, 0.03 * drawn_mah);
    rover.drive_to(0.2);
    rover.disarm();
    rover.wait(40.0, RESTING_A);
    rover.assert_learnt_about(2200.0, 200.0);
}

#[test]
// Requirement: L-11
fn what_was_assumed_of_a_drive_is_not_learnt() {
    let mut rover = Rover::new(&[], full());
    rover.wait(5.0, RESTING_A);
    rover.arm();
    // The wire holds while the rover drives, and is loose while it stands.
    while rover.pack.charge() > 0.6 {
        rover.wait(5.0, LOW_A);
        rover.wait(15.0, HIGH_A);
        rover.wait_without_voltage(30.0, RESTING_A);
    }
    rover.drive_to(0.25);
    rover.disarm();
    rover.wait(100.0, RESTING_A);
    assert_eq!(rover.learnt_mah(), 0.0);
}

#[test]
// Requirement: S-7
fn a_corrected_current_sensor_starts_the_lesson_over() {
    let mut rover = Rover::new(&[], full());
    // Read 1 A too high.
    rover.zero_a = 1.0;
    rover.wait(5.0, RESTING_A);
    rover.drive_to(0.6);
    rover.set("BATT_AMP_OFFSET", 1.0 / AMPERES_PER_VOLT);
    rover.drive_to(0.1);
    rover.wait(100.0, RESTING_A);
    let learnt_mah = rover.learnt_mah();
    assert!(
        learnt_mah == 0.0 || (learnt_mah - 2200.0).abs() < 220.0,
        "{learnt_mah} mAh"
    );
}

#[test]
// Requirement: S-7
fn a_lesson_in_flash_does_not_go_on_with_another_source_of_the_current() {
    let mut before = Rover::new(&[], full());
    before.wait(5.0, RESTING_A);
    before.arm();
    before.drive_to(0.3);
    before.disarm();
    before.wait(3.0, LOW_A);
    let mut rested = before.pack;
    rested.draw(0.0, 3600.0);
    for (change, is_learnt) in [
        (None, true),
        (Some(("BATT_LOW_VOLT", 10.5)), true),
        (Some(("BATT_AMP_OFFSET", 0.01)), false),
        (Some(("BATT_SHUNT", 0.001)), false),
    ] {
        let mut after = Rover::new(change.as_slice(), rested.clone());
        after.flash = before.flash.clone();
        after.wait(60.0, RESTING_A);
        assert_eq!(after.learnt_mah() > 0.0, is_learnt, "{change:?}");
    }
}

#[test]
fn a_gap_counts_in_the_estimate_as_in_the_consumption() {
    let mut rover = Rover::new(&[], full());
    rover.wait(5.0, RESTING_A);
    for _ in 0..3 {
        rover.desk.now_us += 50_000_000;
        rover.wait(0.1, 10.0);
        rover.wait(2.0, RESTING_A);
    }
    let consumed_mah = rover.state().consumed_mah().expect("counted");
    let counted_pct = 100.0 - consumed_mah / 22.0;
    assert_about(Some(rover.remaining_pct()), counted_pct, 0.5);
}

#[test]
fn charged_in_place_it_learns_the_next_drive() {
    // Half of the sensor's range is for charging.
    let mut rover = Rover::new(&[("BATT_AMP_OFFSET", 1.5)], full());
    rover.zero_a = 1.5 * AMPERES_PER_VOLT;
    rover.pack = pack_of(2.2, 0.5);
    rover.wait(60.0, 0.0);
    while rover.pack.charge() < 1.0 {
        rover.wait(10.0, -1.1);
    }
    rover.wait(60.0, -0.2);
    rover.wait(60.0, 0.0);
    assert_about(Some(rover.error_pct()), 0.0, 1.0);
    while rover.pack.charge() > 0.2 {
        // It brakes by regeneration.
        for load_a in [3.4, 3.4, 3.4, -2.0] {
            rover.wait(5.0, load_a);
        }
    }
    rover.wait(40.0, 0.0);
    rover.assert_learnt_about(2200.0, 220.0);
}

/// Two cells in the flat middle of the curve, where a voltage fits any charge from 30 to 70 %, and charged at last.
#[test]
fn a_chemistry_with_a_flat_curve_starts_known_after_a_power_cycle() {
    const LIFE: (f32, f32, f32) = (2.0, 3.297, 3.36);
    const NIMH: (f32, f32, f32) = (4.0, 1.325, 1.42);
    for (chemistry, flat_cell_v, charged_cell_v) in [LIFE, NIMH] {
        let flat_v = 2.0 * flat_cell_v;
        let mut rover = Rover::new(&[("BATT_CHEM", chemistry), ("BATT_CELLS", 2.0)], full());
        rover.hold(flat_v, 0.0, 60);
        let sigma_pct = rover.state().readings.remaining_sigma_pct;
        assert!(sigma_pct.is_none_or(|sigma_pct| sigma_pct > 8.0));
        rover.desk.ask(&command_long_2(BATTERY_RESET, 65535.0, 62.0));
        rover.hold(flat_v, 0.0, 3);
        rover.arm();
        rover.hold(flat_v, 0.0, 3);
        rover.disarm();
        rover.hold(flat_v, 0.0, 3);
        rover.power_cycle();
        rover.hold(flat_v, 0.0, 5);
        assert_about(Some(rover.remaining_pct()), 62.0, 2.0);
        let sigma_pct = rover.state().readings.remaining_sigma_pct;
        assert!(sigma_pct.is_some_and(|sigma_pct| sigma_pct < 5.0));
        // Charged meanwhile: the voltage says so.
        rover.power_cycle();
        rover.hold(2.0 * charged_cell_v, 0.0, 60);
        let remaining_pct = rover.state().readings.remaining_pct;
        assert!(remaining_pct.is_none_or(|remaining_pct| remaining_pct > 80.0));
    }
}

#[test]
fn voltage_only_believes_a_steady_voltage_within_half_a_minute_while_disarmed() {
    let mut rover = Rover::new(&[("BATT_MONITOR", 3.0)], full());
    rover.wait(60.0, RESTING_A);
    rover.pack = pack_of(2.2, 0.3);
    rover.wait(30.0, RESTING_A);
    let soon_pct = rover.remaining_pct();
    rover.wait(300.0, RESTING_A);
    let change_pct = rover.remaining_pct() - soon_pct;
    assert!(
        change_pct.abs() < 8.0 && soon_pct < 45.0,
        "{soon_pct} %, {change_pct} % later"
    );
}

#[test]
fn time_left_in_the_cold_ends_at_the_usable_charge() {
    // Ten times the resistance.
    let cold = PackModel {
        ohmic_resistance_ohm: 0.3,
        polarization_resistance_ohm: 0.15,
        ..PackModel::LIPO_3S_2200
    };
    let mut rover = Rover::new(&[], SimulatedPack::full(cold));
    rover.wait(5.0, RESTING_A);
    rover.drive_to(0.4);
    let state = *rover.state();
    let readings = &state.readings;
    let (remaining_pct, usable_pct) = (readings.remaining_pct.unwrap(), readings.usable_pct.unwrap());
    assert!(
        usable_pct < remaining_pct - 10.0,
        "{usable_pct} of {remaining_pct} %"
    );
    let absolute_s = remaining_pct / 100.0 * 2.2 / state.readings.average_current_a.unwrap() * 3600.0;
    let left_s = state.readings.time_remaining_s.unwrap();
    assert!(left_s < 0.9 * absolute_s, "{left_s} of {absolute_s} s");
    assert_eq!(rover.learnt_mah(), 0.0);
    rover.drive_to(0.3);
    rover.wait(60.0, RESTING_A);
    assert_eq!(rover.learnt_mah(), 0.0, "a cold pack is not learnt");
}

#[test]
fn a_battery_reset_sets_the_charge_and_is_kept() {
    for monitor in [3.0, 4.0] {
        let mut rover = Rover::new(&[("BATT_MONITOR", monitor)], pack_of(2.2, 0.6));
        rover.wait(30.0, RESTING_A);
        rover.desk.ask(&command_long_2(BATTERY_RESET, 65535.0, 70.0));
        rover.wait(1.0, RESTING_A);
        assert_about(Some(rover.remaining_pct()), 70.0, 1.5);
    }
}
