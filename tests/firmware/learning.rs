//! The board learns a pack: simulated cells at its pins, and power that is cut.

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::NorFlash;
use rover_battmon::autopilot::PackIdentity;
use rover_battmon::battery::LEARNT_WORDS;
use rover_battmon::memory::flash_map;
use rover_battmon::memory::storage::Storage;
use rover_battmon_tools::sim::{PackModel, SimulatedFlash, SimulatedPack};
use support::desk::DIVIDER;

use crate::learnt::{FIRST, FIRST_7, flash_with, full_sector};
use emulator::{AdcInput, FlashCut, LogLevel};
use support::commands::{BATTERY_RESET, REQUEST_MESSAGE};
use support::frames::{BATTERY_INFO, SMART_BATTERY_INFO, last_of, of_message, texts_of};
use support::requests::{
    VEHICLE_ID, arm_by_force, command_long, command_long_2, disarm_by_force, manual_control,
};
use workbench::bench::{
    Bench, CURRENT, DIVIDER_CODE, LEARNT_BYTES, LEARNT_OFFSET, MILLISECOND, PACK, SAVED_US, SECOND,
};
use workbench::runs::flash_cuts::Leader;

const AMPERES_PER_VOLT: f32 = 1.0;
const COUNTS_PER_VOLT: f32 = 4095.0 / 3.3;

const TICK_US: u64 = 100 * MILLISECOND;
const TICK_S: f32 = 0.1;

/// Two cells of 48 mAh; the label says 60.
const SMALL: PackModel = PackModel {
    cells: 2,
    capacity_ah: 0.048,
    ohmic_resistance_ohm: 0.2,
    polarization_resistance_ohm: 0.1,
    ..PackModel::LIPO_3S_2200
};
const LABEL_MAH: f32 = 60.0;

const SETTINGS: [(&str, f32); 5] = [
    ("BATT_MONITOR", 4.0),
    ("BATT_CURR_PIN", 27.0),
    ("BATT_AMP_PERVLT", AMPERES_PER_VOLT),
    ("BATT_CELLS", 2.0),
    ("BATT_CAPACITY", LABEL_MAH),
];

/// A board with a pack at its pins.
struct Stand {
    bench: Bench,
    pack: SimulatedPack,
}

impl Stand {
    /// Nothing but its settings is known to the board.
    fn new(pack: SimulatedPack) -> Self {
        let mut bench = Bench::configured(0, &SETTINGS);
        bench.run_for(SAVED_US);
        let mut stand = Self { bench, pack };
        stand.power_cycle();
        stand
    }

    fn hold(&mut self, voltage_v: f32, current_a: f32) {
        let code = |pin_v: f32| AdcInput::Code((pin_v * COUNTS_PER_VOLT).round() as u16);
        self.bench.adc_input(PACK, code(voltage_v / DIVIDER));
        self.bench.adc_input(CURRENT, code(current_a / AMPERES_PER_VOLT));
    }

    fn wait(&mut self, seconds: f32, load_a: f32) {
        for _ in 0..(seconds / TICK_S) as u32 {
            self.pack.draw(load_a, TICK_S);
            self.hold(self.pack.voltage_v(), load_a);
            self.bench.run_for(TICK_US);
        }
    }

    fn power_cycle(&mut self) {
        self.bench.forget_sent();
        self.hold(self.pack.voltage_v(), 0.0);
        self.bench.power_cycle();
        self.bench.forget_sent();
    }

    /// A whole drive from power-up to a rest. Returns the error of the estimate at its end, in percent.
    fn drive(&mut self) -> f32 {
        self.wait(3.0, 0.0);
        while self.pack.charge() > 0.03 {
            for load_a in [2.6, 0.8] {
                self.wait(4.0, load_a);
            }
        }
        let frames = self.bench.frames();
        let error_pct = f32::from(last_of(&frames, 0).remaining_pct()) - self.pack.charge() * 100.0;
        self.wait(34.0, 0.0);
        error_pct
    }

    fn texts(&mut self) -> Vec<String> {
        texts_of(&self.bench.frames())
    }

    fn learnt_texts(&mut self) -> Vec<String> {
        let mut texts = self.texts();
        texts.retain(|text| text.contains("learnt"));
        texts
    }

    fn parameter(&mut self, name: &str) -> f32 {
        self.bench.parameter(name)
    }

    /// Rated and full capacity in mAh and the state of health, as BATTERY_INFO has them.
    fn battery_info(&mut self) -> (f32, f32, u8) {
        let answers = self
            .bench
            .ask(&command_long(REQUEST_MESSAGE, BATTERY_INFO as f32));
        let info = of_message(&answers, BATTERY_INFO)[0];
        (info.f32(32) * 1e3, info.f32(36) * 1e3, info.u8(47))
    }

    /// Rated and full capacity in mAh, as SMART_BATTERY_INFO has them.
    fn smart_battery_info(&mut self) -> (i32, i32) {
        let answers = self
            .bench
            .ask(&command_long(REQUEST_MESSAGE, SMART_BATTERY_INFO as f32));
        let info = of_message(&answers, SMART_BATTERY_INFO)[0];
        (info.i32(0), info.i32(4))
    }
}

fn full() -> SimulatedPack {
    SimulatedPack::full(SMALL)
}

#[test]
fn a_wrong_label_is_absorbed_over_two_drives_and_a_power_cut() {
    let mut stand = Stand::new(full());
    let first_pct = stand.drive();
    let texts = stand.learnt_texts();
    assert_eq!(texts.len(), 1, "{:?}", stand.texts());
    let learnt_mah = stand.parameter("BATT_LRN_CAP");
    let learnt_mohm = stand.parameter("BATT_LRN_RES");
    assert!(
        texts[0].starts_with(&format!("Battery 1 learnt: {learnt_mah} mAh, ")),
        "{texts:?}"
    );
    assert!((44.0..=53.0).contains(&learnt_mah), "{learnt_mah} of 48 mAh");
    assert!(
        (190.0..=220.0).contains(&learnt_mohm),
        "{learnt_mohm} of 200 mOhm"
    );
    let (rated_mah, full_mah, health_pct) = stand.battery_info();
    assert_eq!(rated_mah.round(), LABEL_MAH);
    assert!((full_mah - learnt_mah).abs() <= 0.5, "{full_mah}");
    assert!(
        (f32::from(health_pct) - full_mah / 0.6).abs() <= 1.0,
        "{health_pct} %"
    );
    assert_eq!(stand.smart_battery_info(), (LABEL_MAH as i32, learnt_mah as i32));

    stand.pack = full();
    stand.power_cycle();
    let second_pct = stand.drive();
    println!("error at the end: {first_pct} %, then {second_pct} %; {texts:?}");
    assert!(
        first_pct.abs() > 8.0 && second_pct.abs() < 0.5 * first_pct.abs(),
        "{first_pct} %, {second_pct} %"
    );
    assert_eq!(stand.learnt_texts().len(), 0, "it was announced before");
    let learnt_again_mah = stand.parameter("BATT_LRN_CAP");
    assert!(
        (learnt_again_mah - 48.0).abs() <= (learnt_mah - 48.0).abs() + 1.0,
        "{learnt_again_mah}"
    );

    stand.bench.set("BATT_SERIAL_NUM", 7.0);
    stand.wait(1.0, 0.0);
    assert_eq!(stand.parameter("BATT_LRN_CAP"), 0.0, "another pack");
    stand.bench.set("BATT_SERIAL_NUM", -1.0);
    stand.wait(1.0, 0.0);
    assert_eq!(stand.parameter("BATT_LRN_CAP"), learnt_again_mah, "found again");

    // Unplugged while disarmed, and a full one plugged in.
    stand.hold(0.0, 0.0);
    stand.bench.run_for(2 * SECOND);
    stand.pack = full();
    stand.wait(5.0, 0.0);
    assert!(
        stand
            .texts()
            .iter()
            .any(|text| text.starts_with("Battery 1 swapped"))
    );
    assert_eq!(stand.parameter("BATT_LRN_CAP"), 0.0, "it does not inherit");
    let (_, full_mah, _) = stand.battery_info();
    assert_ne!(full_mah.round(), learnt_again_mah);
    let mut warnings = stand.bench.logged(LogLevel::Warn, "");
    warnings.retain(|(_, text)| text != "battery 1: not connected");
    assert!(warnings.is_empty(), "{warnings:?}");
}

/// A rest in the flat middle of a curve, kept at disarm, is known after the power cycle.
fn starts_known(chemistry: f32, cell_v: f32) {
    let mut bench = Bench::configured(0, &[&SETTINGS[..], &[("BATT_CHEM", chemistry)]].concat());
    bench.run_for(SAVED_US);
    bench.power_cycle();
    let mut stand = Stand { bench, pack: full() };
    stand.hold(2.0 * cell_v, 0.0);
    stand.bench.run_for(3 * SECOND);
    stand.bench.ask(&command_long_2(BATTERY_RESET, 65535.0, 62.0));
    stand.bench.ask(&manual_control(VEHICLE_ID, 0, 0));
    stand.bench.ask(&arm_by_force());
    stand.bench.run_for(3 * SECOND);
    stand.bench.ask(&disarm_by_force());
    stand.bench.run_for(3 * SECOND);
    stand.bench.forget_sent();
    stand.bench.power_cycle();
    stand.bench.forget_sent();
    stand.bench.run_for(5 * SECOND);
    let remaining_pct = last_of(&stand.bench.frames(), 0).remaining_pct();
    assert!(
        (60..=64).contains(&remaining_pct),
        "chemistry {chemistry}: {remaining_pct} %"
    );
}

#[test]
fn flat_chemistries_start_known_after_a_power_cycle() {
    starts_known(2.0, 3.303);
    starts_known(4.0, 1.325);
}

/// What a board's flash holds of a pack.
fn stored(content: &[u8], identity: PackIdentity) -> Option<[u32; LEARNT_WORDS]> {
    let mut flash = SimulatedFlash::open(None).expect("it needs no file");
    let region = flash_map::LEARNT;
    block_on(async {
        flash
            .erase(region.start, region.end)
            .await
            .expect("a sound flash");
        flash.write(region.start, content).await.expect("a sound flash");
        let mut storage = Storage::new(flash, region);
        storage.read(identity.key()).await.expect("a sound flash")
    })
}

#[test]
fn a_power_cut_in_any_flash_operation_keeps_what_was_learnt() {
    const CAPACITY: usize = 2;
    const CHARGE: usize = 6;
    let before = flash_with(full_sector());
    let mut bench = Bench::power_up_with_flash(DIVIDER_CODE, LEARNT_OFFSET, &before);
    // The cells are detected.
    bench.run_for(3 * SECOND);
    bench.ask(&manual_control(VEHICLE_ID, 0, 0));
    bench.ask(&arm_by_force());
    bench.run_for(SECOND);
    for cut in [FlashCut::Prefix, FlashCut::ScatteredBits] {
        let disarm_and_keep_the_charge = |bench: &mut Bench| {
            let now_us = bench.time_us();
            bench.uart_send(0, now_us, &disarm_by_force());
            bench.run_for(1500 * MILLISECOND);
        };
        let after_cut = |mut bench: Bench, operation| {
            bench.power_cycle();
            let content = bench.read_flash(LEARNT_OFFSET, LEARNT_BYTES);
            let words = stored(&content, FIRST).expect("old or new");
            assert_eq!(
                f32::from_bits(words[CAPACITY]),
                2950.0,
                "operation {operation}, {cut:?}"
            );
            let charge = f32::from_bits(words[CHARGE]);
            assert!(
                charge == -1.0 || (0.5..0.9).contains(&charge),
                "operation {operation}, {cut:?}: {charge}"
            );
            let other = stored(&content, FIRST_7).expect("another pack");
            assert_eq!(
                f32::from_bits(other[CAPACITY]),
                1000.0,
                "operation {operation}, {cut:?}"
            );
        };
        let mut leader = Leader::new(bench.clone(), cut, 1..);
        leader.step(disarm_and_keep_the_charge, after_cut);
        assert!(leader.begun() >= 6, "an erase and five programs, or more");
    }
}
