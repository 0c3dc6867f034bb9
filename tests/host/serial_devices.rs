//! Devices on the second serial port: frames among garbage, the state of their packs at the ends of each field, and after any
//! frame that is damaged, late or missing. The limits are the tables' own.

use std::ops::Range;

use proptest::prelude::*;
use rover_battmon::battery::{BatteryState, ChargeSource, CurrentRange, ReadError};
use rover_battmon::pack::Pack;
use rover_battmon::sensor::{AnalogReadings, SerialDevice, SerialReading};
use rover_battmon::time::Instant;
use support::desk::{Desk, start_with};
use support::time::SECOND;

const TICK_US: u64 = 100_000;

type Settings = [(&'static str, f32)];

const KISS: &Settings = &[("BATT_MONITOR", 9.0), ("SERIAL1_PROTOCOL", 16.0)];
const TILLER: &Settings = &[
    ("BATT_MONITOR", 23.0),
    ("SERIAL1_PROTOCOL", 39.0),
    ("TRQD1_TYPE", 1.0),
];
const BOAT_MOTOR: &Settings = &[
    ("BATT_MONITOR", 23.0),
    ("SERIAL1_PROTOCOL", 39.0),
    ("TRQD1_TYPE", 2.0),
];
const RICHEN_POWER: &Settings = &[
    ("BATT_MONITOR", 17.0),
    ("SERIAL1_PROTOCOL", 30.0),
    ("GEN_TYPE", 3.0),
];
const MEGA_SQUIRT: &Settings = &[
    ("BATT_MONITOR", 27.0),
    ("BATT_CAPACITY", 50_000.0),
    ("SERIAL1_PROTOCOL", 24.0),
    ("EFI_TYPE", 1.0),
    ("EFI_COEF1", 1.0),
];
const SMALL_CELL: &Settings = &[
    ("BATT_MONITOR", 17.0),
    ("BATT2_MONITOR", 18.0),
    ("BATT2_CAPACITY", 100.0),
    ("SERIAL1_PROTOCOL", 30.0),
    ("GEN_TYPE", 1.0),
];
const LARGE_CELL: &Settings = &[
    ("BATT_MONITOR", 17.0),
    ("BATT2_MONITOR", 18.0),
    ("BATT2_CAPACITY", 100.0),
    ("SERIAL1_PROTOCOL", 30.0),
    ("GEN_TYPE", 2.0),
];

/// The vehicle and what its device sends.
struct Wire {
    desk: Desk,
    device: SerialDevice,
}

impl Wire {
    fn new(settings: &Settings) -> Self {
        let desk = Desk::starting(start_with(settings));
        let device = SerialDevice::from_parameters(desk.parameters()).expect("a device");
        Self { desk, device }
    }

    fn receive(&mut self, bytes: &[u8]) {
        let now = self.desk.now();
        let autopilot = &mut self.desk.autopilot;
        self.device
            .receive(bytes, now, |reading| autopilot.add_serial_reading(reading, now));
    }

    fn states(&self) -> [BatteryState; 2] {
        [Pack::First, Pack::Second].map(|pack| *self.desk.autopilot.battery(pack))
    }
}

/// CRC-8 of a polynomial, the highest bit first.
fn crc8(bytes: &[u8], polynomial: u8) -> u8 {
    let step = |crc: u8, _| crc << 1 ^ if crc & 0x80 != 0 { polynomial } else { 0 };
    bytes.iter().fold(0, |crc, byte| (0..8).fold(crc ^ byte, step))
}

fn kiss(temperature: u8, voltage: u16, current: u16, counted: u16) -> Vec<u8> {
    let mut frame = vec![temperature];
    for word in [voltage, current, counted, 10] {
        frame.extend(word.to_be_bytes());
    }
    frame.push(crc8(&frame, 0x07));
    frame
}

/// A frame of the TQ bus.
fn framed(content: &[u8]) -> Vec<u8> {
    // The checksum takes the lowest bit first.
    let reversed: Vec<u8> = content.iter().map(|byte| byte.reverse_bits()).collect();
    let mut frame = vec![0xAC];
    for byte in content
        .iter()
        .copied()
        .chain([crc8(&reversed, 0x31).reverse_bits()])
    {
        match byte {
            0xAC..=0xAE => frame.extend([0xAE, byte ^ 0x80]),
            _ => frame.push(byte),
        }
    }
    frame.push(0xAD);
    frame
}

fn system_state(charge_pct: u8, voltage: u16, current: u16, temperature: u8) -> Vec<u8> {
    let mut content = vec![0x20, 0x41, 0x02, 0x00];
    content.extend([0; 12]);
    content.push(charge_pct);
    content.extend(voltage.to_be_bytes());
    content.extend(current.to_be_bytes());
    content.extend([0; 6]);
    content.extend([0, temperature]);
    framed(&content)
}

fn motor_parameters(voltage: u16, current: u16, temperature: i16) -> Vec<u8> {
    let mut content = vec![0; 6];
    content.extend(voltage.to_be_bytes());
    content.extend(current.to_be_bytes());
    content.extend([i16::MIN, temperature].map(i16::to_be_bytes).concat());
    framed(&content)
}

fn richen_power(voltage: u16, current: u16) -> Vec<u8> {
    let mut frame = vec![0; 70];
    frame[..2].copy_from_slice(&[0xaa, 0x55]);
    frame[3] = 0x0a;
    frame[20..22].copy_from_slice(&voltage.to_be_bytes());
    frame[22..24].copy_from_slice(&current.to_be_bytes());
    frame[67] = 0x0a;
    frame[68..].copy_from_slice(&[0x55, 0xaa]);
    frame
}

fn mega_squirt(injection_us: u16, speed_rpm: u16) -> Vec<u8> {
    let ([i1, i0], [s1, s0]) = (injection_us.to_be_bytes(), speed_rpm.to_be_bytes());
    let content = [0, i1, i0, 0, 0, s1, s0];
    let mut crc = flate2::Crc::new();
    crc.update(&content);
    [&[0, 7][..], &content, &crc.sum().to_be_bytes()].concat()
}

fn small_cell(tank_pct: i64, battery_pct: i64) -> Vec<u8> {
    format!("<{tank_pct},{battery_pct},2,0>").into_bytes()
}

fn large_cell(tank_bar: i64, voltage_v: i64, power_w: i64) -> Vec<u8> {
    format!("<{tank_bar},{voltage_v},0,0,{power_w},2,0>").into_bytes()
}

fn protocol_4(tank_pct: i64, voltage_v: i64, power_w: i64) -> Vec<u8> {
    let body = format!("<{tank_pct},6.1,{voltage_v},0,0,0,{power_w},2,0,0,,");
    let sum = body.bytes().fold(0u8, u8::wrapping_add);
    format!("{body}{}>", 255 - sum).into_bytes()
}

/// Outcome of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Found {
    Is(f32),
    OverRange,
    Unknown,
}

use Found::{Is, OverRange, Unknown};

/// A field of a device: its frame with this number in it, where it comes out, and what is expected of which number.
struct Field {
    name: &'static str,
    settings: &'static Settings,
    frame: fn(i64) -> Vec<u8>,
    found: fn(&[BatteryState; 2]) -> Found,
    expected: &'static [(i64, Found)],
}

fn known(state: &BatteryState, value: Option<f32>) -> Found {
    match (state.read_error, value) {
        (Some(ReadError::OverRange), _) => OverRange,
        (None, Some(value)) => Is(value),
        _ => Unknown,
    }
}

fn voltage([first, _]: &[BatteryState; 2]) -> Found {
    known(first, first.readings.voltage_v)
}

fn current([first, _]: &[BatteryState; 2]) -> Found {
    match first.current_range {
        CurrentRange::Within => known(first, first.readings.current_a),
        _ => OverRange,
    }
}

fn temperature([first, _]: &[BatteryState; 2]) -> Found {
    known(first, first.temperature_c)
}

fn charge([first, _]: &[BatteryState; 2]) -> Found {
    let reported = first.readings.remaining_pct;
    known(
        first,
        reported.filter(|_| first.charge_source == ChargeSource::Reported),
    )
}

fn flow([first, _]: &[BatteryState; 2]) -> Found {
    known(first, first.readings.fuel_l_h)
}

fn tank([_, second]: &[BatteryState; 2]) -> Found {
    known(second, second.readings.remaining_pct)
}

/// Below 2.1 V no pack is connected.
const OF_VOLTAGE: &[(i64, Found)] = &[
    (0, Unknown),
    (209, Unknown),
    (210, Is(2.1)),
    (65_534, Is(655.34)),
    (65_535, OverRange),
];

const OF_HUNDREDTHS: &[(i64, Found)] = &[
    (0, Is(0.0)),
    (1, Is(0.01)),
    (65_534, Is(655.34)),
    (65_535, OverRange),
];

const OF_TENTHS: &[(i64, Found)] = &[
    (0, Is(0.0)),
    (1, Is(0.1)),
    (65_534, Is(6553.4)),
    (65_535, OverRange),
];

/// Of the fuel cells of 2.4 kW, in whole volts and watts at 50 V.
const OF_CELL_VOLTAGE: &[(i64, Found)] = &[
    (-1, Unknown),
    (0, Unknown),
    (3, Is(3.0)),
    (100, Is(100.0)),
    (101, Unknown),
    (65_535, Unknown),
    (4_294_967_295, Unknown),
];

const OF_CELL_POWER: &[(i64, Found)] = &[
    (-10_001, Unknown),
    (-10_000, Is(200.0)),
    (0, Is(0.0)),
    (10_000, Is(-200.0)),
    (10_001, Unknown),
    (65_535, Unknown),
];

/// Without a checksum.
const OF_PERCENT: &[(i64, Found)] = &[
    (-1, Unknown),
    (0, Is(0.0)),
    (1, Is(1.0)),
    (100, Is(100.0)),
    (101, Is(100.0)),
    (110, Is(100.0)),
    (111, Unknown),
    (255, Unknown),
];

const FIELDS: &[Field] = &[
    Field {
        name: "KISS temperature",
        settings: KISS,
        frame: |raw| kiss(raw as u8, 1600, 100, 0),
        found: temperature,
        // Up to 200 °C, and below zero from 216 on.
        expected: &[
            (0, Is(0.0)),
            (200, Is(200.0)),
            (201, Unknown),
            (215, Unknown),
            (216, Is(-40.0)),
            (255, Is(-1.0)),
        ],
    },
    Field {
        name: "KISS voltage",
        settings: KISS,
        frame: |raw| kiss(25, raw as u16, 100, 0),
        found: voltage,
        expected: &[
            (0, Unknown),
            (209, Unknown),
            (210, Is(2.1)),
            (65_534, Is(655.34)),
            (65_535, Unknown),
        ],
    },
    Field {
        name: "KISS current",
        settings: KISS,
        frame: |raw| kiss(25, 1600, raw as u16, 0),
        found: current,
        expected: OF_HUNDREDTHS,
    },
    Field {
        name: "KISS charge, after 65,000 mAh",
        settings: KISS,
        frame: |raw| [kiss(25, 1600, 100, 65_000), kiss(25, 1600, 100, raw as u16)].concat(),
        found: |[first, _]| known(first, first.consumed_mah()),
        // Up to 5,000 mAh between two frames, over the end of the word: else it has restarted. At 0 it may be none: the
        // current counts instead, from now on.
        expected: &[
            (65_000, Is(0.0)),
            (65_001, Is(1.0)),
            (65_535, Is(535.0)),
            (0, Is(0.0)),
            (4_464, Is(5000.0)),
            (4_465, Is(0.0)),
            (64_999, Is(0.0)),
        ],
    },
    Field {
        name: "Torqeedo charge",
        settings: TILLER,
        frame: |raw| system_state(raw as u8, 2400, 100, 30),
        found: charge,
        expected: &[
            (0, Is(0.0)),
            (1, Is(1.0)),
            (100, Is(100.0)),
            (101, Is(100.0)),
            (254, Is(100.0)),
            (255, Unknown),
        ],
    },
    Field {
        name: "Torqeedo voltage",
        settings: TILLER,
        frame: |raw| system_state(50, raw as u16, 100, 30),
        found: voltage,
        expected: OF_VOLTAGE,
    },
    Field {
        name: "Torqeedo current",
        settings: TILLER,
        frame: |raw| system_state(50, 2400, raw as u16, 30),
        found: current,
        expected: OF_TENTHS,
    },
    Field {
        name: "Torqeedo temperature",
        settings: TILLER,
        frame: |raw| system_state(50, 2400, 100, raw as u8),
        found: temperature,
        expected: &[(0, Is(0.0)), (200, Is(200.0)), (201, Unknown), (255, Unknown)],
    },
    Field {
        name: "Torqeedo motor's voltage",
        settings: BOAT_MOTOR,
        frame: |raw| motor_parameters(raw as u16, 100, 300),
        found: voltage,
        expected: OF_VOLTAGE,
    },
    Field {
        name: "Torqeedo motor's current",
        settings: BOAT_MOTOR,
        frame: |raw| motor_parameters(2400, raw as u16, 300),
        found: current,
        expected: OF_TENTHS,
    },
    Field {
        name: "Torqeedo motor's temperature",
        settings: BOAT_MOTOR,
        frame: |raw| motor_parameters(2400, 100, raw as i16),
        found: temperature,
        expected: &[
            (-32_768, Unknown),
            (-401, Unknown),
            (-400, Is(-40.0)),
            (-1, Is(-0.1)),
            (0, Is(0.0)),
            (2000, Is(200.0)),
            (2001, Unknown),
            (32_767, Unknown),
        ],
    },
    Field {
        name: "RichenPower voltage",
        settings: RICHEN_POWER,
        frame: |raw| richen_power(raw as u16, 100),
        found: voltage,
        expected: &[
            (0, Unknown),
            (209, Unknown),
            (210, Is(2.1)),
            (10_000, Is(100.0)),
            (10_001, Unknown),
            (65_535, OverRange),
        ],
    },
    Field {
        name: "RichenPower current",
        settings: RICHEN_POWER,
        frame: |raw| richen_power(4800, raw as u16),
        found: current,
        expected: &[
            (0, Is(0.0)),
            (1, Is(0.01)),
            (20_000, Is(200.0)),
            (20_001, Unknown),
            (65_534, Unknown),
            (65_535, OverRange),
        ],
    },
    Field {
        name: "MegaSquirt injection, in each 20 ms",
        settings: MEGA_SQUIRT,
        frame: |raw| mega_squirt(raw as u16, 3000),
        found: flow,
        expected: &[
            (0, Is(0.0)),
            (1, Is(0.0003)),
            (65_534, Is(19.6602)),
            (65_535, OverRange),
        ],
    },
    Field {
        name: "MegaSquirt speed, with 10 ms",
        settings: MEGA_SQUIRT,
        frame: |raw| mega_squirt(10_000, raw as u16),
        found: flow,
        // Up to 100 rpm it stands.
        expected: &[
            (0, Is(0.0)),
            (100, Is(0.0)),
            (101, Is(0.101)),
            (65_534, Is(65.534)),
            (65_535, OverRange),
        ],
    },
    Field {
        name: "small cell's battery",
        settings: SMALL_CELL,
        frame: |raw| small_cell(50, raw),
        found: charge,
        expected: OF_PERCENT,
    },
    Field {
        name: "small cell's tank",
        settings: SMALL_CELL,
        frame: |raw| small_cell(raw, 50),
        found: tank,
        expected: OF_PERCENT,
    },
    Field {
        name: "large cell's tank, in bar",
        settings: LARGE_CELL,
        frame: |raw| large_cell(raw, 48, 0),
        found: tank,
        expected: &[
            (-1, Unknown),
            (0, Is(0.0)),
            (5, Is(0.0)),
            (300, Is(100.0)),
            (301, Is(100.0)),
            (329, Is(100.0)),
            (330, Unknown),
            (65_535, Unknown),
        ],
    },
    Field {
        name: "large cell's voltage",
        settings: LARGE_CELL,
        frame: |raw| large_cell(150, raw, 0),
        found: voltage,
        expected: OF_CELL_VOLTAGE,
    },
    Field {
        name: "large cell's power",
        settings: LARGE_CELL,
        frame: |raw| large_cell(150, 50, raw),
        found: current,
        expected: OF_CELL_POWER,
    },
    Field {
        name: "protocol 4's tank",
        settings: LARGE_CELL,
        frame: |raw| protocol_4(raw, 48, 0),
        found: tank,
        expected: &[
            (-1, Unknown),
            (0, Is(0.0)),
            (100, Is(100.0)),
            (101, Is(100.0)),
            (255, Is(100.0)),
        ],
    },
    Field {
        name: "protocol 4's voltage",
        settings: LARGE_CELL,
        frame: |raw| protocol_4(50, raw, 0),
        found: voltage,
        expected: OF_CELL_VOLTAGE,
    },
    Field {
        name: "protocol 4's power",
        settings: LARGE_CELL,
        frame: |raw| protocol_4(50, 50, raw),
        found: current,
        expected: OF_CELL_POWER,
    },
];

#[test]
// Requirement: S-3
fn each_field_at_its_ends_is_its_value_over_range_or_unknown() {
    let mut wrong = Vec::new();
    for field in FIELDS {
        for (raw, expected) in field.expected {
            let mut wire = Wire::new(field.settings);
            wire.desk.now_us += TICK_US;
            wire.receive(&(field.frame)(*raw));
            wire.desk.sample(AnalogReadings::NONE);
            let found = (field.found)(&wire.states());
            let is_same = match (found, *expected) {
                (Is(found), Is(expected)) => (found - expected).abs() <= 1e-4 * expected.abs().max(0.1),
                (found, expected) => found == expected,
            };
            if !is_same {
                wrong.push(format!("{} {raw}: {found:?} instead of {expected:?}", field.name));
            }
        }
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

/// A device in use, whose values change from frame to frame.
#[derive(Debug)]
struct Stream {
    settings: &'static Settings,
    period_us: u64,
    /// Answers a request that ends so; others are not answered.
    answers: Option<&'static [u8]>,
    /// Bytes of a frame that no checksum protects.
    unprotected: Range<usize>,
    /// The longest pause within a frame, in us, if a longer one ends it.
    longest_pause_us: Option<u64>,
    frame: fn(u16) -> Vec<u8>,
}

const STREAMS: &[Stream] = &[
    Stream {
        settings: KISS,
        period_us: 30_000,
        answers: None,
        unprotected: 0..0,
        longest_pause_us: Some(5_000),
        frame: |index| kiss(30, 1600 + index % 7, 500 + index % 5, index),
    },
    Stream {
        settings: TILLER,
        period_us: 500_000,
        answers: None,
        unprotected: 0..0,
        longest_pause_us: None,
        frame: |index| system_state(80, 2400 + index % 7, 50 + index % 5, 30),
    },
    Stream {
        settings: BOAT_MOTOR,
        period_us: 400_000,
        // For parameters.
        answers: Some(&[0x30, 0x03, 0xCF, 0xAD]),
        unprotected: 0..0,
        longest_pause_us: None,
        frame: |index| motor_parameters(2400 + index % 7, 50 + index % 5, 300),
    },
    Stream {
        settings: RICHEN_POWER,
        period_us: 1_000_000,
        answers: None,
        unprotected: 12..66,
        longest_pause_us: Some(200_000),
        frame: |index| richen_power(4800 + index % 7, 500 + index % 5),
    },
    Stream {
        settings: MEGA_SQUIRT,
        period_us: 100_000,
        answers: Some(&[]),
        unprotected: 0..0,
        longest_pause_us: None,
        frame: |index| mega_squirt(3000 + index % 7, 3000),
    },
    Stream {
        settings: SMALL_CELL,
        period_us: 500_000,
        answers: None,
        unprotected: 0..usize::MAX,
        longest_pause_us: Some(200_000),
        frame: |index| small_cell(50 + i64::from(index % 7), 60),
    },
    Stream {
        settings: LARGE_CELL,
        period_us: 500_000,
        answers: None,
        unprotected: 0..usize::MAX,
        longest_pause_us: Some(200_000),
        frame: |index| large_cell(150, 48 + i64::from(index % 7), -500),
    },
    Stream {
        settings: LARGE_CELL,
        period_us: 500_000,
        answers: None,
        unprotected: 0..0,
        longest_pause_us: Some(200_000),
        frame: |index| protocol_4(50 + i64::from(index % 7), 48, -500),
    },
];

impl Stream {
    /// Readings of bytes that are received at these times, by a device that was not heard before; its own state is left out.
    fn readings(&self, received: &[(u64, &[u8])]) -> Vec<SerialReading> {
        let parameters = start_with(self.settings).parameters;
        let mut device = SerialDevice::from_parameters(&parameters).expect("a device");
        let mut readings = Vec::new();
        for (at_us, bytes) in received {
            device.receive(bytes, Instant::from_micros(*at_us), |reading| {
                readings.push(reading)
            });
        }
        readings.retain(|reading| !matches!(reading, SerialReading::Notice(_)));
        readings
    }
}

#[test]
fn of_two_frames_at_once_both_are_read_and_a_damaged_one_or_a_line_held_low_is_none() {
    for stream in STREAMS {
        let [first, second] = [1, 2].map(stream.frame);
        let expected = stream.readings(&[(SECOND, &first), (2 * SECOND, &second)]);
        let both = [&first[..], &second].concat();
        assert_eq!(stream.readings(&[(SECOND, &both)]), expected, "{stream:?}");
        assert!(!expected.is_empty(), "{stream:?}");
        for (place, bit) in (0..first.len()).flat_map(|place| (0..8).map(move |bit| (place, bit))) {
            let mut damaged = first.clone();
            damaged[place] ^= 1 << bit;
            if !stream.unprotected.contains(&place) {
                assert_eq!(
                    stream.readings(&[(SECOND, &damaged)]),
                    [],
                    "{stream:?} {place}.{bit}"
                );
            }
        }
        assert_eq!(stream.readings(&[(SECOND, &[0; 500])]), [], "{stream:?}");
    }
}

#[test]
fn a_frame_is_read_with_the_longest_pause_in_it_and_dropped_with_a_longer_one() {
    for stream in STREAMS {
        let frame = (stream.frame)(1);
        let expected = stream.readings(&[(SECOND, &frame)]);
        for cut in 1..frame.len() {
            let (start, rest) = frame.split_at(cut);
            let after = |pause_us| stream.readings(&[(SECOND, start), (SECOND + pause_us, rest)]);
            match stream.longest_pause_us {
                Some(longest_us) => {
                    assert_eq!(after(longest_us), expected, "{stream:?} {cut}");
                    assert_eq!(after(longest_us + 1), [], "{stream:?} {cut}");
                }
                None => assert_eq!(after(10 * SECOND), expected, "{stream:?} {cut}"),
            }
        }
    }
}

proptest! {
    #[test]
    fn a_frame_is_read_right_behind_garbage_and_a_part_of_another_one(
        garbage in prop::collection::vec(
            prop_oneof![any::<u8>(), prop::sample::select(b"<>[],.-0123456789x\xAC\xAD\xAE\xAA\x55\0\x07".to_vec())],
            0..100,
        ),
        index: u16,
        share: u8,
    ) {
        for stream in STREAMS {
            let frame = (stream.frame)(index);
            let part = &frame[..frame.len() * usize::from(share) / 256];
            let before = [&garbage[..], part].concat();
            // By chance garbage is a frame, which takes the beginning of this one along.
            let all_but_its_end = [&before[..], &frame[..frame.len() - 1]].concat();
            if !stream.readings(&[(SECOND, &all_but_its_end)]).is_empty() {
                continue;
            }
            let expected = stream.readings(&[(SECOND, &frame)]);
            let found = stream.readings(&[(SECOND, &[&before[..], &frame].concat())]);
            prop_assert_eq!(&found, &expected, "{:?}", stream);
            let after_a_pause = stream.readings(&[(SECOND, &before), (2 * SECOND, &frame)]);
            prop_assert_eq!(after_a_pause, expected, "{:?}", stream);
        }
    }
}

/// Fault of one frame.
#[derive(Clone, Copy, Debug)]
enum Fault {
    Missing,
    /// It ends before this share of it, in 1/256.
    CutOff(u8),
    /// The byte at this share of it changes by these bits.
    Corrupt(u8, u8),
    /// By this share of two periods.
    Late(u8),
}

const STEP_US: u64 = 10_000;
const DURATION_US: u64 = 11_000_000;

/// A frame with this index may fail until then.
const LAST_FAULT_US: u64 = 4_000_000;

/// Three seconds, as long as three of the longest periods.
const SETTLING_US: u64 = 3_000_000;

impl Stream {
    /// The states after each tick, with a fault of the frame with this index, and when that one is over.
    fn run(&self, fault: Option<(u16, Fault)>) -> (Vec<[BatteryState; 2]>, u64) {
        let mut wire = Wire::new(self.settings);
        let mut under_way: Vec<(u64, Vec<u8>)> = Vec::new();
        let (mut index, mut due_us, mut over_us) = (0, STEP_US, 0);
        let mut states = Vec::new();
        while wire.desk.now_us < DURATION_US {
            wire.desk.now_us += STEP_US;
            let now_us = wire.desk.now_us;
            let request = wire.device.next_request(wire.desk.now());
            let sends = match (self.answers, request) {
                (Some(end), request) => request.is_some_and(|request| request.ends_with(end)),
                (None, _) => now_us >= due_us,
            };
            if sends {
                due_us += self.period_us;
                let mut frame = (self.frame)(index);
                let mut at_us = now_us;
                let place = |share: u8| frame.len() * usize::from(share) / 256;
                if let Some((_, fault)) = fault.filter(|(failing, _)| *failing == index) {
                    match fault {
                        Fault::Missing => frame.clear(),
                        Fault::CutOff(share) => frame.truncate(place(share)),
                        Fault::Corrupt(share, bits) => {
                            let place = place(share);
                            frame[place] ^= bits;
                        }
                        Fault::Late(share) => at_us += 2 * self.period_us * u64::from(share) / 256,
                    }
                    // By then it has answered again.
                    over_us = now_us + 2 * self.period_us;
                }
                under_way.push((at_us, frame));
                index += 1;
            }
            under_way.retain(|(at_us, frame)| {
                let is_there = *at_us <= now_us;
                if is_there && !frame.is_empty() {
                    wire.receive(frame);
                }
                !is_there
            });
            if now_us.is_multiple_of(TICK_US) {
                wire.desk.sample(AnalogReadings::NONE);
                states.push(wire.states());
            }
        }
        (states, over_us)
    }
}

/// Report of a device on a pack. A charge that is estimated here depends on when it was read.
fn reported(state: &BatteryState) -> impl PartialEq + std::fmt::Debug + use<> {
    let is_reported = state.charge_source != ChargeSource::Estimated;
    (
        (state.status, state.read_error),
        (
            state.readings.voltage_v,
            state.readings.current_a,
            state.current_range,
        ),
        (state.readings.fuel_l_h, state.temperature_c),
        state.readings.remaining_pct.filter(|_| is_reported),
    )
}

fn any_fault() -> impl Strategy<Value = Fault> {
    prop_oneof![
        Just(Fault::Missing),
        any::<u8>().prop_map(Fault::CutOff),
        (any::<u8>(), 1..=u8::MAX).prop_map(|(place, bits)| Fault::Corrupt(place, bits)),
        any::<u8>().prop_map(Fault::Late),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(96))]

    #[test]
    fn three_seconds_after_any_frame_failed_a_device_is_known_like_one_that_never_failed(
        stream in 0..STREAMS.len(),
        share: u8,
        fault in any_fault(),
    ) {
        let stream = &STREAMS[stream];
        prop_assume!(stream.unprotected.is_empty() || !matches!(fault, Fault::Corrupt(..)));
        let frames = LAST_FAULT_US / stream.period_us;
        let index = (frames * u64::from(share) / 256) as u16;
        let (expected, _) = stream.run(None);
        let (found, over_us) = stream.run(Some((index, fault)));
        let settled = ((over_us + SETTLING_US) / TICK_US) as usize;
        prop_assert!(settled + 10 < found.len());
        for (tick, (found, expected)) in found.iter().zip(&expected).enumerate().skip(settled) {
            for (found, expected) in found.iter().zip(expected) {
                prop_assert_eq!(reported(found), reported(expected), "tick {}", tick);
                // The charge of two frames.
                let amount = |state: &BatteryState| state.consumed.map_or(0.0, |amount| amount.number());
                let of_frames = 3.0 * amount(expected).abs() * stream.period_us as f32 / (tick as f32 * TICK_US as f32);
                let error = (amount(found) - amount(expected)).abs();
                prop_assert!(error <= of_frames, "{} instead of {}", amount(found), amount(expected));
            }
        }
    }
}
