//! The rover does not arm with parameters that are not its owner's: damaged, half loaded, or out of this firmware's range.

use embassy_futures::block_on;
use nor_flash::SmallFlash;
use rover_battmon::autopilot::{FlashJob, FlashStore};
use rover_battmon::crash::ParameterSource;
use rover_battmon::mavlink::{Endpoint, LinkKind};
use rover_battmon::memory::storage::{Erase, Storage};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{
    Access, BatteryParameter, Bearing, ParameterId, Parameters, Unsaved, VehicleParameter,
};
use rover_battmon::vehicle::ArmState;
use support::commands::{PREFLIGHT_STORAGE, RESET, RUN_PREARM_CHECKS};
use support::desk::{Desk, EXTRA1, LOW_VOLT, id_of};
use support::frames::texts_of;
use support::requests::{
    VEHICLE, arm, arm_by_force, command_long, disarm, ftp, param_request_list, param_set,
};

use crate::regions::Regions;

const DAMAGED: &str = "Parameters damaged: check them, then set PARAM_CHECKED 1";
const HALF_LOADED: &str = "Parameters half loaded: check them, then set PARAM_CHECKED 1";

fn half_loaded(missing: usize) -> String {
    match missing {
        0 => HALF_LOADED.into(),
        _ => format!("Parameters half loaded, {missing} missing: check them, then set PARAM_CHECKED 1"),
    }
}

const CREATE: u8 = 6;
const WRITE: u8 = 7;
const TERMINATE: u8 = 1;

/// Nothing else keeps this rover from arming: it checks nothing.
const OWNERS: [(ParameterId, f32); 6] = [
    (EXTRA1, 4.0),
    (ParameterId::Vehicle(VehicleParameter::ArmingCheck), 0.0),
    (LOW_VOLT, 10.5),
    (ParameterId::Battery(Pack::First, BatteryParameter::CrtVolt), 10.2),
    (ParameterId::Battery(Pack::First, BatteryParameter::FsLowAct), 2.0),
    (ParameterId::Battery(Pack::First, BatteryParameter::Cells), 3.0),
];

/// A rover, and the chip that has its parameters.
struct Rover {
    chip: SmallFlash,
    desk: Desk,
    sequence: u16,
}

impl Rover {
    fn start_from(chip: SmallFlash, source: ParameterSource) -> Self {
        let regions = Regions {
            parameters: chip.clone(),
            ..Regions::blank()
        };
        Self {
            chip,
            desk: Desk::with_own_drivers(regions.started(source)),
            sequence: 0,
        }
    }

    fn start(chip: SmallFlash) -> Self {
        Self::start_from(chip, ParameterSource::Stored)
    }

    fn restart(self) -> Self {
        self.chip.chip().power_up();
        Self::start(self.chip)
    }

    /// With its owner's values, after a move to another sector.
    fn owned() -> Self {
        let chip = SmallFlash::blank();
        for number in 0..20 {
            store(&chip, EXTRA1.key(), 5.0 + number as f32);
            store(&chip, LOW_VOLT.key(), 5.0 + number as f32);
        }
        for (id, value) in OWNERS {
            store(&chip, id.key(), value);
        }
        let mut rover = Self::start(chip);
        assert!(rover.has_owners_values());
        rover.assert_arms();
        rover
    }

    fn has_owners_values(&self) -> bool {
        OWNERS
            .iter()
            .all(|(id, value)| self.desk.parameters().get(*id) == *value)
    }

    /// Writes what has to be written, as the task does.
    fn save(&mut self) {
        while let Some(FlashJob::Parameter(unsaved)) = self.desk.next_flash_job(FlashStore::Parameters) {
            let mut storage = Storage::new(self.chip.clone(), SmallFlash::REGION);
            let written = block_on(async {
                match unsaved {
                    Unsaved::Reset => {
                        let kept = VehicleParameter::SignUsbAllow.row().key;
                        storage.clear_but(kept, &Erase::always).await
                    }
                    Unsaved::Value(id, value) => {
                        let stored = storage.store(id.key(), value.to_bits(), &Erase::always);
                        stored.await.map(drop)
                    }
                }
            });
            let job = FlashJob::Parameter(unsaved);
            self.desk.flash_done(&job, written.map(|()| None));
        }
    }

    fn set(&mut self, id: ParameterId, value: f32) {
        self.desk.ask(&param_set(&id.name(), value));
        self.save();
    }

    fn confirm(&mut self) {
        self.desk.ask(&param_set("PARAM_CHECKED", 1.0));
        let checked = ParameterId::Vehicle(VehicleParameter::ParamChecked);
        assert_eq!(self.desk.parameters().get(checked), 0.0);
        self.save();
    }

    /// The texts that come with the answer.
    fn file(&mut self, opcode: u8, offset: usize, data: &[u8]) -> Vec<String> {
        self.sequence += 1;
        let request = ftp(self.sequence, opcode, data.len() as u8, offset as u32, data);
        texts_of(&self.desk.ask(&request))
    }

    /// Loads a file in blocks, but for its end, with something after each block.
    fn upload(&mut self, file: &[u8], block_bytes: usize, mut after_each: impl FnMut(&mut Self)) {
        self.file(CREATE, 0, b"@PARAM/param.pck");
        for (number, block) in file.chunks(block_bytes).enumerate() {
            self.file(WRITE, number * block_bytes, block);
            after_each(self);
        }
    }

    /// Loads a whole file, and returns the texts that come at its end.
    fn load(&mut self, file: &[u8]) -> Vec<String> {
        self.upload(file, file.len(), Self::save);
        let texts = self.file(TERMINATE, 0, &[]);
        self.save();
        texts
    }

    /// Does something on another link.
    fn on(&mut self, link: &mut Endpoint, act: impl FnOnce(&mut Self)) {
        std::mem::swap(&mut self.desk.endpoint, link);
        act(self);
        std::mem::swap(&mut self.desk.endpoint, link);
    }

    /// The texts that come with a list of the parameters.
    fn said_with_a_list(&mut self) -> Vec<String> {
        texts_of(&self.desk.ask(&param_request_list(VEHICLE)))
    }

    /// The reason that an attempt to arm is refused; `None` if the rover was armed, which it is not any more.
    fn refusal(&mut self) -> Option<String> {
        let texts = texts_of(&self.desk.ask(&arm()));
        if self.desk.vehicle().arm_state() == ArmState::Armed {
            self.desk.ask(&disarm());
            return None;
        }
        Some(texts.concat())
    }

    fn assert_arms(&mut self) {
        assert_eq!(self.refusal(), None);
    }

    fn assert_refuses(&mut self, text: &str) {
        assert_eq!(self.refusal(), Some(format!("Arm: {text}")));
    }
}

fn store(chip: &SmallFlash, key: u16, value: f32) {
    let mut storage = Storage::new(chip.clone(), SmallFlash::REGION);
    block_on(storage.store(key, value.to_bits(), &Erase::always)).unwrap();
}

/// The bytes of the newest record and of the first blank slot, one behind the other.
fn newest_and_blank(chip: &SmallFlash) -> std::ops::Range<usize> {
    let bytes = chip.bytes();
    let is_active = |sector: &usize| {
        bytes[sector * 512..].starts_with(b"PAR1") && bytes[sector * 512 + 12..][..4] == [0xff; 4]
    };
    let start = (0..2).find(is_active).expect("one is active") * 512 + 16;
    let used = (0..40).rfind(|slot| bytes[start + slot * 12..][..12] != [0xff; 12]);
    let newest = start + used.expect("there are records") * 12;
    newest..newest + 24
}

#[test]
fn each_flipped_bit_leaves_the_owners_values_or_refuses_arming_until_they_are_confirmed() {
    let rover = Rover::owned();
    let excepted = newest_and_blank(&rover.chip);
    let mut refused = 0;
    for bit in 0..SmallFlash::REGION_BYTES * 8 {
        let mut spoiled = Rover::start(rover.chip.with_flipped_bit(bit));
        if excepted.contains(&(bit / 8)) {
            spoiled.assert_arms();
            continue;
        }
        if spoiled.has_owners_values() && spoiled.refusal().is_none() {
            continue;
        }
        refused += 1;
        // As many stores as move everything to another sector, for some.
        let stores = if bit % 61 == 0 { 50 } else { 1 };
        for number in 0..stores {
            spoiled.assert_refuses(DAMAGED);
            spoiled.set(EXTRA1, 5.0 + (number % 20) as f32);
            spoiled = spoiled.restart();
        }
        spoiled.assert_refuses(DAMAGED);
        spoiled.confirm();
        // It may be what was lost.
        spoiled.set(VehicleParameter::ArmingCheck.into(), 0.0);
        spoiled.assert_arms();
        spoiled.restart().assert_arms();
    }
    assert!(refused > 500, "{refused}");
}

#[test]
fn lost_parameters_are_said_and_refuse_arming_whatever_is_checked_unless_forced() {
    let rover = Rover::owned();
    for fill in [0x00, 0x5a] {
        let chip = SmallFlash::with(&[fill; SmallFlash::REGION_BYTES]);
        let mut rover = Rover::start(chip);
        rover.set(VehicleParameter::ArmingCheck.into(), 0.0);
        rover = rover.restart();
        rover.assert_refuses(DAMAGED);
        let said = texts_of(&rover.desk.ask(&command_long(RUN_PREARM_CHECKS, 0.0)));
        assert_eq!(said.concat(), format!("PreArm: {DAMAGED}"));
        let said = rover.said_with_a_list();
        assert!(said.concat().contains(DAMAGED), "{said:?}");
        rover.desk.ask(&arm_by_force());
        assert_eq!(rover.desk.vehicle().arm_state(), ArmState::Armed);
    }
    let mut blank = rover.chip.bytes();
    blank.fill(0xff);
    let mut rover = Rover::start(SmallFlash::with(&blank));
    rover.set(VehicleParameter::ArmingCheck.into(), 0.0);
    rover.assert_arms();
}

#[test]
fn damage_that_a_start_with_defaults_finds_is_not_hidden_by_what_it_stores() {
    let rover = Rover::owned();
    let active = newest_and_blank(&rover.chip).start / 512 * 512;
    let chip = rover.chip.with_flipped_bit((active + 16) * 8);
    let mut rover = Rover::start_from(chip, ParameterSource::Defaults);
    rover.assert_refuses("Stored parameters not read: restart");
    // They were not shown yet.
    rover.confirm();
    rover.set(EXTRA1, 9.0);
    rover.restart().assert_refuses(DAMAGED);
}

#[test]
fn a_power_cut_in_a_store_is_said_and_is_no_obstacle() {
    let rover = Rover::owned();
    let newest = newest_and_blank(&rover.chip).start;
    let mut rover = Rover::start(rover.chip.with_flipped_bit((newest + 5) * 8));
    rover.assert_arms();
    let said = rover.said_with_a_list();
    let text = "Parameter storage damaged: check parameters";
    assert!(said.iter().any(|said| said == text), "{said:?}");
    rover.set(EXTRA1, 9.0);
    let said = rover.restart().said_with_a_list();
    assert!(said.iter().all(|said| said != text), "{said:?}");
}

/// A value that no row has in its range.
const NEVER_IN_RANGE: f32 = 1e30;

#[test]
fn each_row_out_of_range_refuses_arming_by_name_until_it_is_set_if_it_bears_on_the_drive() {
    let owned = Rover::owned();
    let in_use = Parameters::clone(owned.desk.parameters());
    let settings = ParameterId::all().filter(|id| matches!(id.row().access, Access::Setting(_)));
    let mut seen = [0, 0];
    for id in settings {
        let chip = owned.chip.repaired();
        store(&chip, id.key(), NEVER_IN_RANGE);
        let mut rover = Rover::start(chip);
        if id == ParameterId::Vehicle(VehicleParameter::ArmingCheck) {
            // The checks of the default pass without packs.
            rover.desk.set(BatteryParameter::Monitor.of(Pack::First), 0.0);
        }
        let is_used = in_use.listed_index(id).is_some();
        if id.row().access == Access::Setting(Bearing::Service) || !is_used {
            seen[0] += 1;
            rover.assert_arms();
            continue;
        }
        seen[1] += 1;
        let text = format!(
            "Stored {} does not fit: check them, then set PARAM_CHECKED 1",
            id.name()
        );
        rover.assert_refuses(&text);
        rover.set(VehicleParameter::Sr0Params.into(), 11.0);
        rover = rover.restart();
        rover.assert_refuses(&text);
        let waits_for_check = |rover: &mut Rover| {
            let refusal = rover.refusal();
            refusal.is_some_and(|why| why.contains("PARAM_CHECKED"))
        };
        let mut confirmed = Rover::start(rover.chip.repaired());
        confirmed.confirm();
        assert!(!waits_for_check(&mut confirmed), "{text}");
        assert!(!waits_for_check(&mut confirmed.restart()), "{text}");
        // Even to what is live.
        rover.set(id, id.default_value());
        assert!(!waits_for_check(&mut rover.restart()), "{text}");
    }
    assert!(seen.iter().all(|count| *count > 10), "{seen:?}");
}

#[test]
fn a_pack_that_is_enabled_has_all_of_its_owners_values() {
    let owned = Rover::owned();
    let second = |parameter: BatteryParameter| parameter.of(Pack::Second);
    let of_second = [BatteryParameter::LowVolt, BatteryParameter::CrtVolt].map(second);
    for id in of_second {
        store(&owned.chip, id.key(), NEVER_IN_RANGE);
    }
    let mut rover = owned.restart();
    rover.assert_arms();
    rover.set(second(BatteryParameter::Monitor), 3.0);
    rover = rover.restart();
    rover.assert_refuses("Stored BATT2_LOW_VOLT, BATT2_CRT_VOLT do not fit: check, then set PARAM_CHECKED 1");
    rover.set(of_second[0], 10.0);
    rover.assert_refuses("Stored BATT2_CRT_VOLT does not fit: check them, then set PARAM_CHECKED 1");
    rover.set(of_second[1], 9.0);
    rover.assert_arms();
    rover.restart().assert_arms();
}

#[test]
fn each_value_that_does_not_fit_is_named_before_a_confirmation_replaces_it() {
    let owned = Rover::owned();
    let of_first = |parameter: BatteryParameter| parameter.of(Pack::First);
    let misfits = [
        BatteryParameter::VoltMult,
        BatteryParameter::LowVolt,
        BatteryParameter::CrtVolt,
        BatteryParameter::FsLowAct,
        BatteryParameter::Cells,
    ]
    .map(of_first);
    let hidden = BatteryParameter::Cells.of(Pack::Second);
    for id in misfits.into_iter().chain([hidden]) {
        store(&owned.chip, id.key(), NEVER_IN_RANGE);
    }
    let mut rover = owned.restart();
    let mut unnamed = misfits.to_vec();
    while let Some(refusal) = rover.refusal() {
        let before = unnamed.len();
        let is_named = |id: &ParameterId| refusal.contains(&*id.name());
        unnamed.retain(|id| !is_named(id));
        assert!(unnamed.len() < before, "{refusal}");
        // Only what was named is replaced, and what is left is named at once.
        let text = texts_of(&rover.desk.ask(&param_set("PARAM_CHECKED", 1.0))).concat();
        rover.save();
        assert!(
            unnamed.iter().take(2).all(|id| text.contains(&*id.name())),
            "{text}"
        );
        rover = rover.restart();
    }
    assert_eq!(unnamed, []);
    rover.set(BatteryParameter::Monitor.of(Pack::Second), 3.0);
    rover
        .restart()
        .assert_refuses("Stored BATT2_CELLS does not fit: check them, then set PARAM_CHECKED 1");
}

#[test]
fn keys_of_another_version_are_kept_and_counted_and_are_no_obstacle() {
    let mut rover = Rover::owned();
    for key in [900, 901, 1900] {
        store(&rover.chip, key, 1.0);
    }
    rover.desk = Rover::start(rover.chip.clone()).desk;
    rover.assert_arms();
    let said = rover.said_with_a_list();
    let text = "3 stored parameters unknown: kept";
    assert_eq!(said.iter().filter(|said| *said == text).count(), 1, "{said:?}");
    for number in 0..50 {
        rover.set(EXTRA1, (number % 20) as f32);
    }
    let said = rover.restart().said_with_a_list();
    assert!(said.iter().any(|said| said == text), "{said:?}");
}

/// As MAVProxy packs it: whole numbers in a byte.
fn file_of(values: &[(&str, i8)]) -> Vec<u8> {
    let mut records = Vec::new();
    for (name, value) in values {
        records.extend([1, (name.len() as u8 - 1) << 4]);
        records.extend(name.as_bytes());
        records.extend(value.to_le_bytes());
    }
    let header = [0x671b, values.len() as u16, 6 + records.len() as u16];
    [header.map(u16::to_le_bytes).concat(), records].concat()
}

const LOADED: [(&str, i8); 5] = [
    ("SR0_EXTRA1", 6),
    ("BATT_CELLS", 2),
    ("BATT_CRT_VOLT", 6),
    ("BATT_LOW_VOLT", 7),
    ("BATT_FS_LOW_ACT", 3),
];

fn values(rover: &Rover) -> [f32; 5] {
    LOADED.map(|(name, _)| rover.desk.parameters().get(id_of(name)))
}

#[test]
fn a_file_that_is_cut_at_any_block_refuses_arming_until_a_whole_one_or_a_confirmation() {
    const BLOCK: usize = 8;
    let file = file_of(&LOADED);
    let owned = Rover::owned();
    let before = values(&owned);
    let mut refused = 0;
    for cut in 0..=file.len().div_ceil(BLOCK) {
        let bytes = &file[..file.len().min(cut * BLOCK)];
        let mut rover = Rover::start(owned.chip.repaired());
        rover.upload(bytes, BLOCK, Rover::save);
        let mut values_but_rate = values(&rover);
        values_but_rate[0] = before[0];
        if values_but_rate == before {
            rover.assert_arms();
            rover.restart().assert_arms();
            continue;
        }
        refused += 1;
        let came = (0..=LOADED.len()).rfind(|count| file_of(&LOADED[..*count]).len() <= bytes.len());
        let missing = LOADED.len() - came.expect("the header");
        rover.assert_refuses(&half_loaded(missing));
        let mut restarted = Rover::start(rover.chip.repaired());
        for _ in 0..3 {
            restarted.assert_refuses(HALF_LOADED);
            restarted.set(VehicleParameter::Sr0Params.into(), 11.0);
            restarted = restarted.restart();
        }
        // Nor is it known which parameters a whole one would have to have.
        let said = restarted.load(&file).concat();
        assert!(said.contains(HALF_LOADED), "{said}");
        let said = restarted.said_with_a_list().concat();
        assert!(said.contains(HALF_LOADED), "{said}");
        restarted.confirm();
        restarted.assert_arms();
        restarted.restart().assert_arms();

        rover.upload(&file, BLOCK, Rover::save);
        rover.assert_refuses(HALF_LOADED);
        let said = rover.file(TERMINATE, 0, &[]);
        assert_eq!(said, [""; 0]);
        rover.assert_arms();
        rover.save();
        rover.restart().assert_arms();
    }
    assert!(refused > 5, "{refused}");
}

/// This file, whose header announces another number of parameters.
fn announcing(parameters: u16, mut file: Vec<u8>) -> Vec<u8> {
    file[2..4].copy_from_slice(&parameters.to_le_bytes());
    file
}

const CELLS: (&str, i8) = ("BATT_CELLS", 2);
const LOW: (&str, i8) = ("BATT_LOW_VOLT", 7);
const ACTION: (&str, i8) = ("BATT_FS_LOW_ACT", 3);

#[test]
fn only_a_whole_file_with_all_that_the_half_one_had_and_announced_ends_it() {
    let owned = Rover::owned();
    let unknown = ("NOPE", 1);
    let refused = ("BATT_CELLS", 100);
    for (half, announced, whole, missing) in [
        (&[CELLS][..], 2, &[CELLS, LOW][..], 0),
        (&[CELLS], 2, &[LOW, ACTION, CELLS], 0),
        // Its order, and what is not known here, do not matter.
        (&[CELLS, unknown], 3, &[unknown, LOW, CELLS], 0),
        // One that has changed nothing came before.
        (&[("SR0_EXTRA1", 9)], 300, &[CELLS], 0),
        (&[CELLS], 2, &[CELLS], 1),
        (&[CELLS], 3, &[CELLS], 2),
        (&[CELLS], 491, &[CELLS, LOW], 489),
        (&[CELLS], u16::MAX, &[CELLS], 65_534),
        (&[CELLS, LOW], 3, &[ACTION], 2),
        (&[CELLS, LOW], 3, &[ACTION, unknown, ("SR0_EXTRA1", 9)], 2),
        (&[CELLS], 2, &[refused, LOW], 1),
    ] {
        let mut rover = Rover::start(owned.chip.repaired());
        let half = announcing(announced, file_of(half));
        rover.upload(&half, half.len(), Rover::save);
        let said = rover.load(&file_of(whole)).concat();
        let case = format!("{announced} announced, {whole:?}: {said:?}");
        if missing == 0 {
            assert_eq!(rover.refusal(), None, "{case}");
            rover.restart().assert_arms();
            continue;
        }
        let text = half_loaded(missing);
        assert!(said.contains(&text), "{case}");
        rover.assert_refuses(&text);
        rover.confirm();
        rover.assert_arms();
        rover.restart().assert_arms();
    }
}

#[test]
fn every_half_file_counts_until_one_has_all_of_them() {
    let mut rover = Rover::owned();
    for (file, announced) in [([CELLS], 3), ([LOW], 2)] {
        let half = announcing(announced, file_of(&file));
        rover.upload(&half, half.len(), Rover::save);
    }
    // As many as the first one announced, less what has come of the latest.
    rover.assert_refuses(&half_loaded(2));
    rover.load(&file_of(&[LOW, ACTION, ("SR0_EXTRA1", 9)]));
    rover.assert_refuses(&half_loaded(1));
    rover.load(&file_of(&[LOW, CELLS]));
    rover.assert_refuses(&half_loaded(1));
    rover.load(&file_of(&[LOW, CELLS, ACTION]));
    rover.assert_arms();
    // Another one that begins is by itself.
    rover.upload(&announcing(2, file_of(&[("BATT_CELLS", 3)])), 99, Rover::save);
    rover.assert_refuses(&half_loaded(1));
    rover.load(&file_of(&[CELLS, LOW]));
    rover.assert_arms();
}

#[test]
fn a_whole_file_of_another_link_ends_a_half_one_that_is_still_open() {
    let mut rover = Rover::owned();
    let mut other = Endpoint::new("other", LinkKind::Wifi, 100_000, rover.desk.now());
    rover.desk.autopilot.open(&mut other);
    let file = file_of(&[CELLS, LOW, ACTION]);
    let half = file_of(&[CELLS, LOW]).len();
    rover.upload(&file[..half], 99, Rover::save);
    rover.on(&mut other, |rover| {
        let said = rover.load(&file_of(&[CELLS])).concat();
        assert!(said.contains(&half_loaded(2)), "{said}");
        rover.load(&file_of(&[("BATT_CELLS", 4), ("BATT_LOW_VOLT", 8), ACTION]));
    });
    rover.assert_arms();
    // The rest of the first one leaves it whole, too.
    rover.file(WRITE, half, &file[half..]);
    rover.file(TERMINATE, 0, &[]);
    rover.save();
    rover.assert_arms();
    rover.restart().assert_arms();
}

#[test]
fn a_reset_ends_a_half_file() {
    let mut rover = Rover::owned();
    rover.upload(&announcing(2, file_of(&[CELLS])), 99, Rover::save);
    rover.desk.ask(&command_long(PREFLIGHT_STORAGE, RESET));
    rover.desk.set(BatteryParameter::Monitor.of(Pack::First), 0.0);
    rover.desk.set(VehicleParameter::ArmingCheck, 0.0);
    rover.save();
    rover.assert_arms();
    rover.restart().assert_arms();
}

#[test]
fn a_power_cut_anywhere_in_the_storing_of_a_file_leaves_all_of_before_or_of_the_file_or_refuses() {
    let file = file_of(&LOADED);
    let owned = Rover::owned();
    let before = values(&owned);
    let loaded = LOADED.map(|(_, value)| f32::from(value));
    let mut kinds = [0; 3];
    for is_saved_at_the_end in [false, true] {
        for cut in 0.. {
            let mut rover = Rover::start(owned.chip.repaired());
            rover.chip.chip().cut_power_after(cut, cut);
            rover.upload(&file, 20, |rover| {
                if !is_saved_at_the_end {
                    rover.save();
                }
            });
            rover.file(TERMINATE, 0, &[]);
            rover.save();
            let is_cut = rover.chip.chip().is_powered_off();
            rover = rover.restart();
            let mut now = values(&rover);
            let refusal = rover.refusal();
            // A rate may be the file's.
            now[0] = before[0];
            let whole = now[1..] == loaded[1..];
            if refusal.is_some() {
                kinds[0] += 1;
                rover.assert_refuses(HALF_LOADED);
            } else if whole {
                kinds[1] += 1;
            } else {
                assert_eq!(now, before, "{cut}");
                kinds[2] += 1;
            }
            if !is_cut {
                assert!(whole && refusal.is_none());
                break;
            }
        }
    }
    assert!(kinds.iter().all(|count| *count > 1), "{kinds:?}");
}

#[test]
fn a_whole_file_of_equal_values_or_of_rates_writes_no_mark() {
    let mut rover = Rover::owned();
    let equal = file_of(&[("BATT_CELLS", 3), ("BATT_FS_LOW_ACT", 2)]);
    let programs = |rover: &Rover| rover.chip.chip().programs;
    let before = programs(&rover);
    rover.upload(&equal, equal.len(), Rover::save);
    rover.assert_arms();
    rover.file(TERMINATE, 0, &[]);
    rover.save();
    assert_eq!(programs(&rover), before);
    let rates = file_of(&[("SR0_EXTRA1", 9), ("LOG_DISARMED", 1)]);
    rover.upload(&rates[..20], 20, Rover::save);
    rover.assert_arms();
    rover.restart().assert_arms();
}
