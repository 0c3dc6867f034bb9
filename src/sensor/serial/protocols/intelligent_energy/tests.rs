use crate::sensor::Urgency;
use proptest::prelude::*;

use super::*;
use crate::time::at_us;

/// The format of the simulated 2.4 kW cell (ArduPilot/ardupilot, libraries/SITL/SIM_IntelligentEnergy24.cpp), with the figures of
/// the maker's manual of the FCPM, section 7.4.
const LEGACY: &[u8] = b"<300,48.7,1600,1700,100,2,0>\n";

fn fuel_cell(model: &'static FuelCell) -> IntelligentEnergy {
    IntelligentEnergy::new(model)
}

fn read(protocol: &mut IntelligentEnergy, bytes: &[u8]) -> std::vec::Vec<SerialReading> {
    let mut readings = std::vec::Vec::new();
    for byte in bytes {
        protocol.push(*byte, Instant::EPOCH, &mut |reading| readings.push(reading));
    }
    readings
}

fn is_notice(reading: &SerialReading) -> bool {
    matches!(reading, SerialReading::Notice(_))
}

/// Voltage, current, charge of the battery and share of the tank, without the notices.
fn values(readings: &[SerialReading]) -> (Option<f32>, Option<f32>, Option<f32>, Option<f32>) {
    let values: std::vec::Vec<_> = readings.iter().filter(|reading| !is_notice(reading)).collect();
    let [
        SerialReading::GeneratorElectrical(electrical),
        SerialReading::GeneratorFuel(fuel),
    ] = values[..]
    else {
        panic!("{readings:?}");
    };
    assert_eq!(fuel.contents, Contents::Fuel);
    (
        electrical.voltage_v,
        electrical.current_a,
        electrical.state_of_charge,
        fuel.state_of_charge,
    )
}

fn notices(readings: &[SerialReading]) -> std::vec::Vec<(String, Urgency)> {
    let notice = |reading: &SerialReading| match reading {
        SerialReading::Notice(notice) => Some((notice.to_string(), notice.urgency())),
        _ => None,
    };
    readings.iter().filter_map(notice).collect()
}

/// A sentence of protocol 4: its checksum is the inverted sum of what is before it.
fn of_protocol_4(terms: &str) -> std::vec::Vec<u8> {
    let body = format!("<{terms},");
    let sum = body.bytes().fold(0u8, u8::wrapping_add);
    format!("{body}{}>\n", 255 - sum).into_bytes()
}

#[test]
fn large_cell_has_voltage_current_and_tank_pressure() {
    let mut protocol = fuel_cell(&FuelCell::Kilowatts2);
    let (voltage_v, current_a, charge, tank) = values(&read(&mut protocol, LEGACY));
    assert_eq!((voltage_v, charge, tank), (Some(48.7), None, Some(1.0)));
    // 100 W charge the battery.
    assert!((current_a.unwrap() + 100.0 / 48.7).abs() < 1e-4);
    let (_, current_a, _, tank) = values(&read(&mut protocol, b"<152.5,50.0,10,10,-500,2,0>"));
    assert_eq!((current_a, tank), (Some(10.0), Some(0.5)));
    let (_, current_a, _, tank) = values(&read(&mut protocol, b"<2,0,10,10,-500,2,0>"));
    assert_eq!((current_a, tank), (None, Some(0.0)));
}

#[test]
fn protocol_4_is_recognised_by_its_checksum() {
    let mut protocol = fuel_cell(&FuelCell::Kilowatts2);
    let sentence = of_protocol_4("48,6.1,49.9,1200,1300,0,-499,2,0,0,");
    let (voltage_v, current_a, _, tank) = values(&read(&mut protocol, &sentence));
    assert_eq!((voltage_v, current_a, tank), (Some(49.9), Some(10.0), Some(0.48)));
    for place in 1..sentence.len() - 2 {
        let mut damaged = sentence.clone();
        damaged[place] ^= 1;
        assert_eq!(
            read(&mut fuel_cell(&FuelCell::Kilowatts2), &damaged),
            [],
            "{place}"
        );
    }
    assert_eq!(read(&mut protocol, b"[PCM,1.2,4,SN1234,77]\n"), []);
}

#[test]
fn small_cell_has_shares_only() {
    let mut protocol = fuel_cell(&FuelCell::Watts650);
    let readings = read(&mut protocol, b"<76,91.5,2,0x0>");
    assert_eq!(
        values(&readings),
        (None, None, Some(91.5 * 0.01), Some(76.0 * 0.01))
    );
    assert_eq!(values(&read(&mut protocol, b"<0,100,2,0>")).3, Some(0.0));
    for wrong in [
        "<101,50,2,0>",
        "<-1,50,2,0>",
        "<50,101,2,0>",
        "<50,50,2>",
        "<50,50,2,0,0>",
        "<50,50,2,>",
        "<50,50,2,0xfffffffff>",
        "<50,,2,0>",
        "<50,5 0,2,0>",
        "<50,50,2,xyz>",
        "[50,50,2,0>",
        "50,50,2,0>",
        "<300,48.7,1600,1700,100,2,0>",
    ] {
        assert_eq!(read(&mut protocol, wrong.as_bytes()), [], "{wrong}");
    }
}

#[test]
fn state_and_error_are_reported_when_they_change() {
    let mut protocol = fuel_cell(&FuelCell::Watts650);
    let mut after = |sentence: &[u8]| notices(&read(&mut protocol, sentence));
    let notice = |text: &str, urgency| (text.to_string(), urgency);
    assert_eq!(
        after(b"<50,50,2,0>"),
        [notice("Fuel cell running", Urgency::Info)]
    );
    assert_eq!(after(b"<50,50,2,0>"), []);
    assert_eq!(
        after(b"<50,50,3,0x20000>"),
        [
            notice("Fuel cell has failed", Urgency::Warning),
            notice("Fuel cell error 0x20000", Urgency::Warning),
        ]
    );
    assert_eq!(
        after(b"<50,50,3,0x80020000>"),
        [notice("Fuel cell error 0x80020000", Urgency::Critical)]
    );
    // A flag without a meaning.
    assert_eq!(
        after(b"<50,50,3,0x1>"),
        [notice("Fuel cell: no error any more", Urgency::Info)]
    );

    let mut protocol = fuel_cell(&FuelCell::Kilowatts2);
    let mut after = |sentence: &[u8]| notices(&read(&mut protocol, sentence));
    after(LEGACY);
    for (error, urgency) in [
        (1, Urgency::Info),
        (20, Urgency::Warning),
        (21, Urgency::Critical),
    ] {
        let sentence = format!("<300,48.7,1600,1700,100,2,{error}>");
        let expected = notice(&format!("Fuel cell error {error}"), urgency);
        assert_eq!(after(sentence.as_bytes()), [expected]);
    }
    let sentence = of_protocol_4("48,6.1,49.9,1200,1300,0,-499,3,33,7,LOW PRESSURE");
    assert_eq!(
        after(&sentence),
        [
            notice("Fuel cell stopping", Urgency::Info),
            notice("Fuel cell error 33.7", Urgency::Critical),
        ]
    );
}

#[test]
fn gap_drops_a_partial_sentence() {
    let mut protocol = fuel_cell(&FuelCell::Kilowatts2);
    protocol.begin(at_us(1_000_000));
    read(&mut protocol, &LEGACY[..10]);
    protocol.begin(at_us(1_200_000));
    assert!(!read(&mut protocol, &LEGACY[10..]).is_empty());
    read(&mut protocol, &LEGACY[..10]);
    protocol.begin(at_us(1_400_001));
    assert_eq!(read(&mut protocol, &LEGACY[10..]), []);
}

#[test]
fn decimals_are_read_as_written() {
    for (text, expected) in [
        ("0", Some(0.0)),
        ("-12.5", Some(-12.5)),
        ("300", Some(300.0)),
        ("0.0625", Some(0.0625)),
        ("", None),
        ("-", None),
        (".5", None),
        ("5.", None),
        ("1.00001", None),
        ("1e3", None),
        ("--1", None),
        ("99999999999", None),
    ] {
        assert_eq!(decimal(text.as_bytes()), expected, "{text}");
    }
}

fn any_line() -> impl Strategy<Value = std::vec::Vec<u8>> {
    // Bytes of sentences and any others.
    let byte = prop_oneof![prop::sample::select(b"<>[],.-0123456789x".to_vec()), any::<u8>()];
    prop::collection::vec(byte, 0..300)
}

proptest! {
    #[test]
    fn valid_sentence_is_found_right_after_garbage(garbage in any_line(), centivolts in 1u32..6000) {
        let mut protocol = fuel_cell(&FuelCell::Kilowatts2);
        read(&mut protocol, &garbage);
        let sentence = format!("<150,{}.{:02},0,0,0,2,0>", centivolts / 100, centivolts % 100);
        let (voltage_v, ..) = values(&read(&mut protocol, sentence.as_bytes()));
        prop_assert!((voltage_v.unwrap() - centivolts as f32 * 0.01).abs() < 1e-4);
    }

    #[test]
    fn garbage_is_no_sentence(garbage in any_line()) {
        // What is read has to be a sentence of numbers.
        for (model, commas) in [(&FuelCell::Watts650, 3), (&FuelCell::Kilowatts2, 6)] {
            let readings = read(&mut fuel_cell(model), &garbage);
            let sentences = garbage.split(|byte| *byte == b'>').filter(|piece| {
                let start = piece.iter().rposition(|byte| matches!(byte, b'<' | b'['));
                start.is_some_and(|start| {
                    let sentence = &piece[start..];
                    sentence[0] == b'<' && sentence.iter().filter(|byte| **byte == b',').count() >= commas
                })
            });
            let electrical = readings.iter().filter(|reading| matches!(reading, SerialReading::GeneratorElectrical(_)));
            prop_assert!(electrical.count() <= sentences.count());
        }
    }
}
