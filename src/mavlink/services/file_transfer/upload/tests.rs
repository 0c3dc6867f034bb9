use std::vec::Vec;

use proptest::prelude::*;

use super::super::packed::HAS_DEFAULT;
use super::*;
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, VehicleParameter};

const EXTRA1: ParameterId = ParameterId::Vehicle(VehicleParameter::Sr0Extra1);
const CAPACITY: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::Capacity);

fn record(packed_type: u8, common: u8, own: &str, value: &[u8]) -> Vec<u8> {
    let lengths = common | ((own.len() - 1) as u8) << 4;
    [&[packed_type, lengths][..], own.as_bytes(), value].concat()
}

/// A file as MAVProxy packs it: the type is the smallest for the value, the last number of the header the file's length.
fn file_of(records: &[Vec<u8>]) -> Vec<u8> {
    let records_bytes = records.concat();
    let bytes = (HEADER_BYTES + records_bytes.len()) as u16;
    let header = [MAGIC, records.len() as u16, bytes].map(u16::to_le_bytes);
    [header.concat(), records_bytes].concat()
}

fn three() -> Vec<u8> {
    file_of(&[
        record(2, 0, "BATT_CAPACITY", &2500u16.to_le_bytes()),
        record(4, 5, "VOLT_MULT", &7.5f32.to_le_bytes()),
        record(1, 0, "SR0_EXTRA1", &[7]),
    ])
}

fn write(upload: &mut Upload, file: &[u8], block: usize, parameters: &mut Parameters) -> Vec<ParameterId> {
    let mut set = Vec::new();
    for (place, bytes) in file.chunks(block).enumerate() {
        let offset = (place * block) as u32;
        let written = upload.write(offset, bytes.iter().copied(), parameters, |id| set.push(id));
        assert_eq!(written, Ok(()));
    }
    set
}

#[test]
fn a_file_in_blocks_of_any_size_sets_its_parameters() {
    for block in [1, 2, 7, 80, 239] {
        let mut parameters = Parameters::defaults();
        let mut upload = Upload::default();
        let set = write(&mut upload, &three(), block, &mut parameters);
        assert_eq!(
            set,
            [CAPACITY, BatteryParameter::VoltMult.of(Pack::First), EXTRA1]
        );
        assert_eq!(parameters.get(CAPACITY), 2500.0);
        assert_eq!(parameters.get(BatteryParameter::VoltMult.of(Pack::First)), 7.5);
        assert_eq!(parameters.get(EXTRA1), 7.0);
        assert!(upload.is_complete());
        assert_eq!(upload.not_set(), None);
    }
}

#[test]
fn lost_and_repeated_blocks_are_put_right() {
    let file = three();
    let (first, second) = file.split_at(20);
    let mut parameters = Parameters::defaults();
    let mut upload = Upload::default();
    let mut put = |offset: u32, bytes: &[u8], upload: &mut Upload| {
        upload.write(offset, bytes.iter().copied(), &mut parameters, |_| {})
    };
    assert_eq!(put(20, second, &mut upload), Err(BlockError::TooEarly));
    assert_eq!(put(0, first, &mut upload), Ok(()));
    assert_eq!(put(0, first, &mut upload), Ok(()), "its answer was lost");
    assert!(!upload.is_complete());
    assert_eq!(put(10, &file[10..], &mut upload), Ok(()), "overlaps");
    assert!(upload.is_complete());
    assert_eq!(parameters.get(EXTRA1), 7.0);
}

#[test]
fn what_does_not_exist_or_is_out_of_range_is_counted_and_the_rest_is_set() {
    let file = file_of(&[
        record(1, 0, "NOPE", &[1]),
        record(4, 0, "SR0_EXTRA1", &1e9f32.to_le_bytes()),
        // It shows something, and so may be in a file that was downloaded.
        record(1, 0, "BATT_LRN_CAP", &[1]),
        record(1, 9, "ERASE", &[1]),
        record(2, 5, "CAPACITY", &2500u16.to_le_bytes()),
    ]);
    let mut parameters = Parameters::defaults();
    let mut upload = Upload::default();
    assert_eq!(write(&mut upload, &file, 80, &mut parameters), [CAPACITY]);
    assert!(upload.is_complete());
    let text = upload.not_set().unwrap().text();
    assert_eq!(text, "Parameters not set: SR0_EXTRA1, 1 unknown");
}

#[test]
// Requirement: AP-29
fn of_two_names_of_a_parameter_the_later_counts() {
    let values = |file: &[Vec<u8>]| {
        let mut parameters = Parameters::defaults();
        let mut upload = Upload::default();
        write(&mut upload, &file_of(file), 80, &mut parameters);
        upload.end(&mut parameters);
        assert_eq!(upload.not_set(), None);
        [VehicleParameter::SysidThismav, VehicleParameter::ArmingCheck].map(|id| parameters.get(id))
    };
    let older = [
        record(1, 0, "SYSID_THISMAV", &[3]),
        record(1, 0, "ARMING_CHECK", &[64]),
    ];
    let newer = [
        record(1, 0, "MAV_SYSID", &[4]),
        record(2, 0, "ARMING_SKIPCHK", &64i16.to_le_bytes()),
    ];
    assert_eq!(values(&newer), [4.0, 1280.0]);
    assert_eq!(values(&[older.clone(), newer.clone()].concat()), [4.0, 1280.0]);
    assert_eq!(values(&[newer, older].concat()), [3.0, 64.0]);
}

/// The text about a file with these values.
fn text_about(values: &[(&str, f32)]) -> String<NOT_SET_BYTES> {
    let records: Vec<_> = values
        .iter()
        .map(|(name, value)| record(4, 0, name, &value.to_le_bytes()))
        .collect();
    let mut upload = Upload::default();
    write(&mut upload, &file_of(&records), 80, &mut Parameters::defaults());
    upload.not_set().unwrap().text()
}

#[test]
fn what_is_known_and_refused_comes_before_the_count_of_what_is_unknown() {
    let mut values = vec![("ACRO_TURN_RATE", 180.0); 1252];
    assert_eq!(text_about(&values), "Parameters not set: 1252 unknown");
    values.push(("BATT_VOLT_PIN", 13.0));
    let refused = "Parameters not set: BATT_VOLT_PIN, 1252 unknown";
    assert_eq!(text_about(&values), refused);
    values.rotate_right(1);
    assert_eq!(text_about(&values), refused);
}

#[test]
fn a_factor_that_is_taken_is_named_with_its_refused_pin() {
    for (values, expected) in [
        (
            &[("BATT_VOLT_MULT", 10.1), ("BATT_VOLT_PIN", 13.0)][..],
            "Parameters not set: BATT_VOLT_PIN (but BATT_VOLT_MULT)",
        ),
        (
            &[
                ("BATT2_CURR_PIN", 14.0),
                ("BATT2_AMP_PERVLT", 17.0),
                ("NOPE", 1.0),
            ],
            "Parameters not set: BATT2_CURR_PIN (but BATT2_AMP_PERVLT), 1 unknown",
        ),
        (
            &[("BATT_FL_PIN", 13.0), ("BATT_FL_V_MULT", 0.5)],
            "Parameters not set: BATT_FL_PIN (but BATT_FL_V_MULT)",
        ),
        // Another pack's, one that is refused itself, and none.
        (
            &[("BATT2_VOLT_MULT", 10.1), ("BATT_VOLT_PIN", 13.0)],
            "Parameters not set: BATT_VOLT_PIN",
        ),
        (
            &[("BATT_VOLT_MULT", f32::NAN), ("BATT_VOLT_PIN", 13.0)],
            "Parameters not set: BATT_VOLT_MULT, BATT_VOLT_PIN",
        ),
        (
            &[
                ("BATT_VOLT_MULT", 10.1),
                ("BATT_VOLT_PIN", 26.0),
                ("SR0_EXTRA1", 1e9),
            ],
            "Parameters not set: SR0_EXTRA1",
        ),
    ] {
        assert_eq!(text_about(values), expected);
    }
}

#[test]
fn of_many_refused_names_the_first_five_are_listed_and_the_others_counted() {
    let names: Vec<_> = Pack::ALL
        .into_iter()
        .flat_map(|pack| {
            [BatteryParameter::AmpPervlt, BatteryParameter::CurrPin].map(|id| id.of(pack).name())
        })
        .collect();
    let value_of = |name: &str| if name.ends_with("PIN") { 99.0 } else { 17.0 };
    let values: Vec<_> = names.iter().map(|name| (name.as_str(), value_of(name))).collect();
    let pairs = ["", "2", "3", "4", "5"].map(|n| std::format!(" BATT{n}_CURR_PIN (but BATT{n}_AMP_PERVLT)"));
    let five = std::format!("Parameters not set:{}", pairs.join(","));
    assert_eq!(text_about(&values[..10]), five.as_str());
    assert_eq!(text_about(&values), std::format!("{five}, 4 more").as_str());
    let long = vec![values[17]; 2000];
    let text = text_about(&long);
    assert!(text.ends_with(", BATT9_CURR_PIN, 1995 more"), "{text}");
}

#[test]
fn a_system_id_is_set_at_the_end_and_refused_out_of_range() {
    let system_id = ParameterId::Vehicle(VehicleParameter::SysidThismav);
    let with_id = |id: u16| {
        let mut parameters = Parameters::defaults();
        let mut upload = Upload::default();
        let file = file_of(&[
            record(2, 0, "SYSID_THISMAV", &id.to_le_bytes()),
            record(1, 0, "SR0_EXTRA1", &[7]),
        ]);
        assert_eq!(write(&mut upload, &file, 80, &mut parameters), [EXTRA1]);
        assert_eq!(parameters.get(system_id), 1.0);
        upload.end(&mut parameters);
        (parameters.get(system_id), upload.not_set().map(NotSet::text))
    };
    assert_eq!(with_id(42), (42.0, None));
    let refused = "Parameters not set: SYSID_THISMAV".try_into().unwrap();
    assert_eq!(with_id(256), (1.0, Some(refused)));
}

#[test]
fn anything_else_is_no_file_of_parameters() {
    let good = record(1, 0, "SR0_EXTRA1", &[7]);
    let with_default = record(1 | HAS_DEFAULT, 0, "SR0_EXTRA1", &[7, 2]);
    let common_with_none = record(1, 11, "X", &[7]);
    let unknown_type = record(5, 0, "SR0_EXTRA1", &[7]);
    let too_long = [record(1, 0, "SIXTEEN_LETTERS_", &[1]), record(1, 15, "AB", &[1])].concat();
    for records in [with_default, common_with_none, unknown_type, too_long] {
        let file = file_of(&[good.clone(), records]);
        let written = Upload::default().write(0, file.into_iter(), &mut Parameters::defaults(), |_| {});
        assert_eq!(written, Err(BlockError::BadFormat));
    }
    let written = Upload::default().write(0, [0; 6].into_iter(), &mut Parameters::defaults(), |_| {});
    assert_eq!(written, Err(BlockError::BadFormat));
}

#[test]
fn a_file_is_complete_with_its_last_byte() {
    let file = three();
    for bytes in 0..file.len() {
        let mut upload = Upload::default();
        let _ = upload.write(
            0,
            file[..bytes].iter().copied(),
            &mut Parameters::defaults(),
            |_| {},
        );
        assert!(!upload.is_complete(), "{bytes}");
    }
}

proptest! {
    #[test]
    fn any_blocks_are_taken_or_refused(
        blocks in prop::collection::vec((0u32..300, prop::collection::vec(any::<u8>(), 0..239)), 1..10),
        begins_well in any::<bool>(),
    ) {
        let mut parameters = Parameters::defaults();
        let mut upload = Upload::default();
        if begins_well {
            write(&mut upload, &three(), 80, &mut parameters);
        }
        for (offset, bytes) in blocks {
            let _ = upload.write(offset, bytes.into_iter(), &mut parameters, |_| {});
        }
        for id in ParameterId::all() {
            prop_assert!(id.row().range.contains(parameters.get(id)));
        }
    }
}
