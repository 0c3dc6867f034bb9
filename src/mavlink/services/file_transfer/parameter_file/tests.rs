use std::vec::Vec;

use proptest::prelude::*;

use super::*;
use crate::pack::Pack;
use crate::parameter::BatteryParameter;

/// The parameters in a file, as MAVProxy reads it: name, value, default.
fn decoded(file: &[u8]) -> Vec<(String<MAX_NAME_LENGTH>, f32, f32)> {
    let (header, mut rest) = file.split_at(HEADER_BYTES);
    let with_defaults = u16::from_le_bytes([header[0], header[1]]) == MAGIC_WITH_DEFAULTS;
    let mut decoded = Vec::new();
    let mut name: Vec<u8> = Vec::new();
    loop {
        while rest.first() == Some(&0) {
            rest = &rest[1..];
        }
        let [first, lengths, ..] = *rest else {
            break;
        };
        let packed_type = PackedType::from_number(first & 0xf).expect("a type");
        let own_bytes = usize::from(lengths >> 4) + 1;
        name.truncate(usize::from(lengths & 0xf));
        name.extend(&rest[2..2 + own_bytes]);
        rest = &rest[2 + own_bytes..];
        let (value, behind) = rest.split_at(packed_type.value_bytes());
        let (default, behind) = if with_defaults && first & HAS_DEFAULT != 0 {
            behind.split_at(packed_type.value_bytes())
        } else {
            (value, behind)
        };
        rest = behind;
        decoded.push((
            core::str::from_utf8(&name).unwrap().try_into().unwrap(),
            packed_type.unpack(value),
            packed_type.unpack(default),
        ));
    }
    let count = u16::from_le_bytes([header[2], header[3]]);
    assert_eq!(usize::from(count), decoded.len());
    decoded
}

fn whole(file: &mut ParameterFile, block_bytes: u8, parameters: &Parameters) -> Vec<u8> {
    let mut whole = Vec::new();
    loop {
        let block = file.read(whole.len() as u32, block_bytes, parameters).unwrap();
        if block.is_empty() {
            return whole;
        }
        whole.extend(block);
    }
}

fn some_set() -> Parameters {
    let mut parameters = Parameters::defaults();
    for pack in [Pack::Second, Pack::Ninth] {
        parameters.set(BatteryParameter::Monitor.of(pack), 4.0).unwrap();
        parameters
            .set(BatteryParameter::VoltMult.of(pack), 12.34)
            .unwrap();
    }
    parameters
}

fn selection(start: u16, count: Option<u16>, with_defaults: bool) -> Selection {
    Selection {
        start,
        count,
        with_defaults,
    }
}

#[test]
fn it_has_every_listed_parameter_with_its_default() {
    let parameters = some_set();
    for (with_defaults, block_bytes) in [(true, 80), (true, 239), (false, 80), (false, 239)] {
        let mut file = ParameterFile::open(selection(0, None, with_defaults), &parameters).unwrap();
        let bytes = whole(&mut file, block_bytes, &parameters);
        let expected: Vec<_> = parameters
            .listed()
            .map(|id| {
                let value = parameters.get(id);
                let default = if with_defaults { id.default_value() } else { value };
                (id.name(), value, default)
            })
            .collect();
        assert_eq!(decoded(&bytes), expected);
        let total = u16::from_le_bytes([bytes[4], bytes[5]]);
        assert_eq!(usize::from(total), parameters.listed_count());
    }
}

#[test]
fn its_length_is_that_in_the_largest_blocks() {
    let parameters = some_set();
    for with_defaults in [true, false] {
        let mut file = ParameterFile::open(selection(0, None, with_defaults), &parameters).unwrap();
        let bytes = file.bytes(&parameters);
        assert_eq!(whole(&mut file, 239, &parameters).len() as u32, bytes);
    }
}

#[test]
fn a_part_has_its_own_count() {
    let parameters = Parameters::defaults();
    let names: Vec<_> = parameters.listed().map(ParameterId::name).collect();
    for (start, count, expected) in [
        (0, Some(1), 0..1),
        (1, Some(3), 1..4),
        (5, None, 5..names.len()),
        (names.len() as u16 - 2, Some(9), names.len() - 2..names.len()),
    ] {
        let selection = selection(start, count, true);
        let mut file = ParameterFile::open(selection, &parameters).unwrap();
        let read = decoded(&whole(&mut file, 239, &parameters));
        let read: Vec<_> = read.into_iter().map(|(name, ..)| name).collect();
        assert_eq!(read, names[expected]);
    }
    let behind = selection(names.len() as u16, None, true);
    assert_eq!(ParameterFile::open(behind, &parameters), None);
}

#[test]
fn a_value_that_is_set_meanwhile_moves_nothing_and_is_in_one_block() {
    let mut parameters = some_set();
    let everything = selection(0, None, true);
    for block_bytes in [10, 11, 37, 80, 239] {
        let mut file = ParameterFile::open(everything, &parameters).unwrap();
        let before = whole(&mut file, block_bytes, &parameters);
        for id in parameters.listed().collect::<Vec<_>>() {
            let value = parameters.get(id);
            let listed = parameters.listed_count();
            let _ = parameters.set(id, value + 1.0);
            if parameters.listed_count() != listed {
                // What it sets up is in use now: reading a file starts over.
                let _ = parameters.set(id, value);
                continue;
            }
            let after = whole(&mut file, block_bytes, &parameters);
            let changed = (0..before.len()).filter(|at| before[*at] != after[*at]);
            let blocks: Vec<_> = changed.map(|at| at / usize::from(block_bytes)).collect();
            assert!(
                blocks.iter().all(|block| *block == blocks[0]),
                "{} in {blocks:?}",
                id.name()
            );
            let _ = parameters.set(id, value);
        }
    }
}

proptest! {
    /// Lost blocks are read again in any order.
    #[test]
    fn any_block_is_the_same_at_any_time(
        block_bytes in 1u8..=239,
        places in prop::collection::vec(0usize..600, 1..40),
        start in 0u16..40,
    ) {
        let parameters = some_set();
        let selection = selection(start, None, true);
        let mut file = ParameterFile::open(selection, &parameters).unwrap();
        let whole = whole(&mut file.clone(), block_bytes, &parameters);
        for place in places {
            let offset = place * usize::from(block_bytes);
            let expected: Vec<u8> = whole.iter().copied().skip(offset).take(usize::from(block_bytes)).collect();
            let block = file.read(offset as u32, block_bytes, &parameters).unwrap();
            prop_assert_eq!(block.as_slice(), expected);
        }
    }
}
