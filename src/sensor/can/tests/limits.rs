//! Every field of every message that is read, at and beyond its ends: its value comes out, or it is unknown. Other fields
//! keep theirs.

use super::{Battery, CanBench, Fields, message, node, pack, status};
use crate::battery::{Faults, Gauge, GaugeReading, Measurement, Supply};
use crate::pack::Pack;
use crate::sensor::can::frame::{CanFrame, Tail};
use crate::sensor::can::messages::{
    BATTERY_AUX, BATTERY_INFO, CHARGER, CONTROLLER, DataType, NODE_STATUS, TEMPERATURE,
};
use crate::sensor::{CanEvent, CanNotice, CanOptions, CanPack, ControllerReading};

/// The node that sends them.
const NODE: u8 = 42;

/// The bits and the width of each field.
type Layout = &'static [(u64, usize)];

/// Of a field that is changed.
type Set<T> = fn(&mut T, Option<f32>);

fn payload_with(layout: Layout, changed: usize, raw: u64) -> Vec<u8> {
    let add = |fields: Fields, (place, (value, bits)): (usize, &(u64, usize))| {
        fields.bits(if place == changed { raw } else { *value }, *bits)
    };
    layout.iter().enumerate().fold(Fields::default(), add).bytes()
}

/// Floats of 16 bits: 0, -0, the smallest, 1, -1, the greatest, the least, infinities, NaN, all ones.
const HALVES: [u64; 11] = [
    0x0000, 0x8000, 0x0001, 0x3c00, 0xbc00, 0x7bff, 0xfbff, 0x7c00, 0xfc00, 0x7e00, 0xffff,
];

/// The values of these.
type Values = [Option<f32>; HALVES.len()];

const SMALLEST: f32 = 5.960_464_5e-8;

const fn values(of: [Option<f32>; 7]) -> Values {
    let [zero, negative_zero, smallest, one, minus_one, greatest, least] = of;
    [
        zero,
        negative_zero,
        smallest,
        one,
        minus_one,
        greatest,
        least,
        None,
        None,
        None,
        None,
    ]
}

const NOT_NEGATIVE: Values = values([
    Some(0.0),
    Some(0.0),
    Some(SMALLEST),
    Some(1.0),
    None,
    Some(65504.0),
    None,
]);

const ABOVE_ZERO: Values = values([None, None, Some(SMALLEST), Some(1.0), None, Some(65504.0), None]);

const SIGNED: Values = values([
    Some(0.0),
    Some(0.0),
    Some(SMALLEST),
    Some(1.0),
    Some(-1.0),
    Some(65504.0),
    Some(-65504.0),
]);

/// Kelvin, as degrees Celsius.
const TEMPERATURES: Values = values([
    None,
    None,
    Some(-273.15),
    Some(-272.15),
    None,
    Some(65230.85),
    None,
]);

/// Checks fields of floats: their place, their values, and what these are in what comes out.
fn check_halves<T: Copy + PartialEq + core::fmt::Debug>(
    read: impl Fn(usize, u64) -> T,
    known: T,
    fields: &[(usize, Values, Set<T>)],
) {
    for (place, values, set) in fields {
        for (raw, value) in HALVES.into_iter().zip(values) {
            let mut expected = known;
            set(&mut expected, *value);
            assert_eq!(read(*place, raw), expected, "field {place}: {raw:#x}");
        }
    }
}

/// 300 K, 12 V, 2 A, its power, 30 of 60 Wh, hours, in use, unknown health, 50 %, unknown deviation, id and instance.
const BATTERY: Layout = &[
    (0x5cb0, 16),
    (0x4a00, 16),
    (0x4000, 16),
    (0, 16),
    (0x4f80, 16),
    (0x5380, 16),
    (0, 16),
    (1, 11),
    (127, 7),
    (50, 7),
    (0, 7),
    (0, 8),
    (0, 32),
];

fn battery_with(changed: usize, raw: u64) -> Measurement {
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    let payload = payload_with(BATTERY, changed, raw);
    bench.receive(&message(NODE, BATTERY_INFO, DataType::BatteryInfo, 0, &payload));
    bench.take_reading()
}

#[test]
fn fields_of_a_battery() {
    let known = battery_with(0, 0x5cb0);
    check_halves(
        battery_with,
        known,
        &[
            (0, TEMPERATURES, |battery, value| battery.temperature_c = value),
            (1, NOT_NEGATIVE, |battery, value| battery.voltage_v = value),
            (2, SIGNED, |battery, value| battery.current_a = value),
            (3, SIGNED, |_, _| {}),
            (4, NOT_NEGATIVE, |battery, value| {
                battery.reported.gauge.energies_wh = value.map(|remaining_wh| [remaining_wh, 60.0]);
            }),
            (5, ABOVE_ZERO, |battery, value| {
                battery.reported.gauge.energies_wh = value.map(|full_wh| [30.0, full_wh]);
            }),
            (6, SIGNED, |_, _| {}),
        ],
    );
    // Health, charge and deviation.
    for (raw, health_pct, charge, deviation_pct) in [
        (0, Some(0), Some(0.0), None),
        (1, Some(1), Some(0.01), Some(1)),
        (100, Some(100), Some(1.0), Some(100)),
        (101, Some(100), Some(1.0), Some(100)),
        (126, Some(100), Some(1.0), Some(100)),
        (127, None, None, None),
    ] {
        assert_eq!(battery_with(8, raw).details.state_of_health_pct, health_pct);
        assert_eq!(battery_with(9, raw).state_of_charge, charge);
        assert_eq!(battery_with(10, raw).reported.gauge.error_pct, deviation_pct);
    }
    // Id and instance.
    for (place, greatest) in [(11, 0xff), (12, 0xffff_ffff)] {
        for raw in [0, 1, greatest] {
            assert_eq!(battery_with(place, raw), known, "field {place}: {raw:#x}");
        }
    }
}

/// Its time, one cell of 4 V, 17 cycles, 3 over-discharges, a maximum of 1 A, nominal 12 V, on, id.
const AUX: Layout = &[
    (0, 56),
    (1, 8),
    (0x4400, 16),
    (17, 16),
    (3, 16),
    (0x3c00, 16),
    (0x4a00, 16),
    (0, 1),
    (0, 8),
];

/// The next reading of the battery behind this.
fn battery_behind(aux: &[CanFrame]) -> Measurement {
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    let battery = Battery::new(NODE, 0);
    bench.receive(&battery.frames(0));
    bench.take_readings();
    bench.receive(aux);
    bench.receive(&battery.frames(1));
    bench.take_reading()
}

fn aux_with(changed: usize, raw: u64) -> Measurement {
    let payload = payload_with(AUX, changed, raw);
    battery_behind(&message(NODE, BATTERY_AUX, DataType::BatteryAux, 0, &payload))
}

#[test]
fn fields_of_what_a_battery_reports_beside_its_reading() {
    let known = aux_with(0, 0);
    for (place, greatest) in [(0, 0xff_ffff_ffff_ffff), (5, 0xffff)] {
        for raw in [0, 1, greatest] {
            assert_eq!(aux_with(place, raw), known, "field {place}: {raw:#x}");
        }
    }
    // The greatest voltage of a cell that is a number of millivolts, and the next.
    let cells = [
        Some(0),
        Some(0),
        Some(0),
        Some(1000),
        None,
        None,
        None,
        None,
        None,
        None,
        None,
    ];
    let cells = HALVES.into_iter().zip(cells);
    for (raw, cell_mv) in cells.chain([(0x5418, Some(65_500)), (0x5419, None)]) {
        let reading = aux_with(2, raw);
        assert_eq!(reading.cells.millivolts(), Vec::from_iter(cell_mv), "{raw:#x}");
        assert_eq!(reading.details.cycle_count, Some(17));
    }
    for raw in [0, 1, 0xffff] {
        assert_eq!(aux_with(3, raw).details.cycle_count, Some(raw as u16));
        assert_eq!(aux_with(4, raw).reported.gauge.over_discharges, Some(raw as u16));
    }
    let missing = GaugeReading::Missing;
    let at_1_v = GaugeReading::Read(Gauge {
        remaining_mah: 30_000.0,
        full_mah: 60_000.0,
    });
    for raw in HALVES {
        let expected = if raw == 0x3c00 { at_1_v } else { missing };
        assert_eq!(aux_with(6, raw).gauge, expected, "{raw:#x}");
    }
    assert_eq!(aux_with(7, 1).supply, Supply::PoweringOff);
    for raw in [1, 0xff] {
        assert_eq!(aux_with(8, raw).details.cycle_count, None, "of battery {raw}");
    }
}

/// A longer message than this board sends.
fn long_message(type_id: u32, data_type: DataType, payload: &[u8]) -> Vec<CanFrame> {
    let crc = data_type.crc().of_transfer(payload).to_le_bytes();
    let content = [&crc, payload].concat();
    let parts: Vec<&[u8]> = content.chunks(7).collect();
    let frame = |(index, part): (usize, &&[u8])| {
        let data = [*part, &[Tail::of_frame(index, parts.len(), 0).0]].concat();
        CanFrame::new(24 << 24 | type_id << 8 | u32::from(NODE), &data).expect("a frame")
    };
    parts.iter().enumerate().map(frame).collect()
}

#[test]
fn numbers_of_cells() {
    // Stated, sent, and read; one more than 31 does not fit.
    for (stated, sent, count) in [
        (0, 0, 0),
        (1, 1, 1),
        (31, 31, 31),
        (32, 32, 0),
        (255, 31, 0),
        (255, 255, 0),
    ] {
        let mut fields = Fields::default().bits(0, 56).bits(stated, 8);
        for _ in 0..sent {
            fields = fields.bits(0x4400, 16);
        }
        let payload = fields.bits(17, 16).bits(0, 16).bits(0, 32).bits(0, 9).bytes();
        let aux = long_message(BATTERY_AUX.into(), DataType::BatteryAux, &payload);
        let reading = battery_behind(&aux);
        assert_eq!(reading.cells.count(), count, "{stated}, {sent}");
        let is_read = stated == sent && sent < 32;
        assert_eq!(
            reading.details.cycle_count,
            is_read.then_some(17),
            "{stated}, {sent}"
        );
    }
}

/// Errors, 12 V, 2 A, 300 K, speed, power, index.
const ESC: Layout = &[
    (0, 32),
    (0x4a00, 16),
    (0x4000, 16),
    (0x5cb0, 16),
    (0, 18),
    (0, 7),
    (5, 5),
];

fn controller_with(changed: usize, raw: u64) -> (u8, ControllerReading) {
    let mut bench = CanBench::with_packs(&[]);
    let payload = payload_with(ESC, changed, raw);
    bench.receive(&message(NODE, CONTROLLER, DataType::Controller, 0, &payload));
    match bench.events[..] {
        [CanEvent::Controller(index, reading)] => (index, reading),
        _ => panic!("{:?}", bench.events),
    }
}

#[test]
fn fields_of_a_motor_controller() {
    let known = controller_with(0, 0);
    check_halves(
        controller_with,
        known,
        &[
            (1, NOT_NEGATIVE, |(_, reading), value| reading.voltage_v = value),
            (2, SIGNED, |(_, reading), value| reading.current_a = value),
            (3, TEMPERATURES, |(_, reading), value| {
                reading.temperature_c = value
            }),
        ],
    );
    for (place, greatest) in [(0, 0xffff_ffff), (4, 0x3_ffff), (5, 0x7f)] {
        for raw in [0, 1, greatest] {
            assert_eq!(controller_with(place, raw), known, "field {place}: {raw:#x}");
        }
    }
    for raw in [0, 1, 31] {
        assert_eq!(controller_with(6, raw), (raw as u8, known.1));
    }
}

/// Faults, 30 °C, 40 V, 1 A and their power at the input, 24 V, 2 A and theirs at the output.
const MPPT: Layout = &[
    (0, 8),
    (30, 8),
    (0x5100, 16),
    (0x3c00, 16),
    (0x5100, 16),
    (0x4e00, 16),
    (0x4000, 16),
    (0x5200, 16),
];

fn charger_with(options: CanOptions, changed: usize, raw: u64) -> Measurement {
    let mut bench = CanBench::with_packs(&[CanPack {
        battery_id: Some(NODE.into()),
        options,
        ..pack(Pack::First)
    }]);
    let payload = payload_with(MPPT, changed, raw);
    bench.receive(&message(NODE, CHARGER, DataType::Charger, 0, &payload));
    bench.take_reading()
}

#[test]
fn fields_of_a_charger() {
    for (options, [voltage, current], others) in [
        (CanOptions::default(), [5, 6], [2, 3, 4, 7]),
        (CanOptions::CHARGER_INPUT, [2, 3], [4, 5, 6, 7]),
    ] {
        let read = |changed, raw| charger_with(options, changed, raw);
        let ignored = others.map(|place| (place, SIGNED, (|_, _| {}) as Set<Measurement>));
        let known = read(0, 0);
        check_halves(read, known, &ignored);
        check_halves(
            read,
            known,
            &[
                (voltage, NOT_NEGATIVE, |reading, value| reading.voltage_v = value),
                (current, SIGNED, |reading, value| reading.current_a = value),
            ],
        );
        for (raw, temperature_c) in [(0, 0.0), (1, 1.0), (0x7f, 127.0), (0x80, -128.0), (0xff, -1.0)] {
            assert_eq!(read(1, raw).temperature_c, Some(temperature_c));
        }
        let all = Faults::INCOMPATIBLE_VOLTAGE | Faults::OVER_CURRENT | Faults::OVER_TEMPERATURE;
        for (raw, faults) in [
            (0, Faults::empty()),
            (0x0f, all),
            (0xf0, Faults::empty()),
            (0xff, all),
        ] {
            assert_eq!(read(0, raw).reported.faults, faults);
        }
    }
}

/// Device, 300 K, flags.
const THERMOMETER: Layout = &[(1234, 16), (0x5cb0, 16), (0, 8)];

fn temperature_with(changed: usize, raw: u64) -> Option<(u16, f32)> {
    let mut bench = CanBench::with_packs(&[]);
    let payload = payload_with(THERMOMETER, changed, raw);
    bench.receive(&message(NODE, TEMPERATURE, DataType::Temperature, 0, &payload));
    match bench.events[..] {
        [CanEvent::Temperature(device_id, temperature_c)] => Some((device_id, temperature_c)),
        [] => None,
        _ => panic!("{:?}", bench.events),
    }
}

#[test]
fn fields_of_a_thermometer() {
    let known = temperature_with(2, 0);
    check_halves(
        temperature_with,
        known,
        &[(1, TEMPERATURES, |reading, value| {
            *reading = value.map(|temperature_c| (1234, temperature_c));
        })],
    );
    for raw in [0, 1, 0xffff] {
        assert_eq!(
            temperature_with(0, raw),
            known.map(|(_, known_c)| (raw as u16, known_c))
        );
    }
    for raw in [1, 2, 0xff] {
        assert_eq!(temperature_with(2, raw), known);
    }
}

/// Seconds since its start, health, mode, sub-mode, the vendor's code.
const STATUS: Layout = &[(5, 32), (0, 2), (0, 3), (0, 3), (0, 16)];

/// Announcements of a battery's node, which was up for 5 s before.
fn notices_with(changed: usize, raw: u64) -> Vec<CanNotice> {
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    bench.receive(&Battery::new(NODE, 0).frames(0));
    bench.receive(&status(NODE, 5, 0));
    bench.take_notices();
    let payload = payload_with(STATUS, changed, raw);
    bench.receive(&message(NODE, NODE_STATUS, DataType::NodeStatus, 0, &payload));
    bench.take_notices()
}

#[test]
fn fields_of_a_nodes_status() {
    let restarted = CanNotice::Restarted(node(NODE));
    let critical = CanNotice::Critical(Pack::First, node(NODE));
    let lost = CanNotice::Lost(node(NODE));
    for (place, raw, expected) in [
        (0, 0, Some(restarted)),
        (0, 4, Some(restarted)),
        (0, 5, None),
        (0, 0xffff_ffff, None),
        (1, 0, None),
        (1, 1, None),
        (1, 2, None),
        (1, 3, Some(critical)),
        (2, 0, None),
        (2, 1, None),
        (2, 6, None),
        (2, 7, Some(lost)),
        (3, 7, None),
        (4, 0xffff, None),
    ] {
        assert_eq!(
            notices_with(place, raw),
            Vec::from_iter(expected),
            "field {place}: {raw:#x}"
        );
    }
}
