//! Readings of the drivers where a field of a part is at its ends: its value, *over range*, or nothing. The limits are those of
//! the data sheets.

use emulator::i2c_devices::{
    Ad7091r5, Bebop, Bq76952, Ina219, Ina226, Ina228, Ina3221, Ltc2946, Pec, SmartBattery,
};
use rover_battmon::battery::{Counted, CurrentRange, Supply, Thermometer};

use super::*;

type Setter = fn(&mut Bench, i64);

/// A field that a driver reads.
struct Field {
    name: &'static str,
    /// Sets its code.
    set: Setter,
    /// Its value in a reading.
    get: fn(&Measurement) -> Option<f32>,
    codes: &'static [(i64, Outcome)],
}

#[derive(Clone, Copy, Debug)]
enum Outcome {
    /// This value. A current is within its range.
    Is(f32),
    /// This current, over range.
    Over(f32),
    /// This current, over range, whose charge is counted all the same.
    Counted(f32),
    /// The reading does not have it.
    Unknown,
    /// A value that no pack has: it, or nothing.
    Odd(f32),
    /// There is no reading.
    Fails(ReadError),
}

use Outcome::{Fails, Is, Odd, Over, Unknown};
use ReadError::{Implausible, OtherPart, OverRange};

const fn field(
    name: &'static str,
    set: Setter,
    get: fn(&Measurement) -> Option<f32>,
    codes: &'static [(i64, Outcome)],
) -> Field {
    Field {
        name,
        set,
        get,
        codes,
    }
}

impl Bench {
    /// From now on these bytes are at the beginning of what is read of a register.
    fn alter(&mut self, register: u8, bytes: &[u8]) {
        self.alter_from(register, 0, bytes);
    }

    fn alter_from(&mut self, command: u8, place: usize, bytes: &[u8]) {
        let altered = Altered {
            command,
            place,
            bytes: bytes.to_vec(),
        };
        self.wires.0.borrow_mut().altered.push(altered);
    }

    /// The device, of this kind.
    fn device<D: I2cDevice + 'static>(&mut self, set: impl FnOnce(&mut D)) {
        let mut bus = self.wires.0.borrow_mut();
        let part = bus.part.any().downcast_mut::<Part<D>>();
        set(&mut part.expect("another kind of device").device);
    }

    fn word(&mut self, command: u8, word: i64) {
        self.device(|battery: &mut SmartBattery| battery.set_word(command, word as u16));
    }

    /// The second pack's reading once it has one that is no wait for another, at most four seconds from now.
    fn next_reading(&mut self) -> Result<Measurement, ReadError> {
        self.latest.clear();
        let until = self.now_us() + 4 * SECOND;
        while self.now_us() < until {
            self.turn();
            match self.latest.get(&Pack::Second.number()) {
                None | Some(Err(ReadError::Timeout)) => {}
                Some(reading) => return *reading,
            }
        }
        Err(ReadError::Timeout)
    }
}

fn volts(reading: &Measurement) -> Option<f32> {
    reading.voltage_v
}

fn amperes(reading: &Measurement) -> Option<f32> {
    reading.current_a
}

fn counted_mah(reading: &Measurement) -> Option<f32> {
    match reading.counted {
        Some(Counted::Increment(counted)) => Some(counted.charge_mah),
        _ => None,
    }
}

fn counted_wh(reading: &Measurement) -> Option<f32> {
    match reading.counted {
        Some(Counted::Increment(counted)) => Some(counted.energy_wh),
        _ => None,
    }
}

fn is_near(value: f32, expected: f32) -> bool {
    (value - expected).abs() <= expected.abs() * 2e-5 + 1e-7
}

fn matches(outcome: Outcome, reading: Result<Measurement, ReadError>, field: &Field) -> bool {
    let value = reading.map(|reading| (field.get)(&reading));
    let range = reading.map(|reading| reading.current_range);
    let is_current = field.name.ends_with("current");
    let is_in = |expected| range == Ok(expected);
    match (outcome, value) {
        (Is(expected), Ok(Some(value))) => {
            is_near(value, expected) && (!is_current || is_in(CurrentRange::Within))
        }
        (Over(expected), Ok(Some(value))) => is_near(value, expected) && is_in(CurrentRange::Over),
        (Outcome::Counted(expected), Ok(Some(value))) => {
            is_near(value, expected) && is_in(CurrentRange::OverAndCounted)
        }
        (Odd(expected), Ok(value)) => value.is_none_or(|value| is_near(value, expected)),
        (Unknown, Ok(None)) => true,
        (Fails(error), Err(failed)) => error == failed,
        _ => false,
    }
}

/// Reads each code of each field of a part in turn. `before`: a reading with the first code comes first, as counters need.
#[track_caller]
fn assert_fields(row: &Row, fields: &[Field], codes: usize) {
    let mut wrong = Vec::new();
    for field in fields {
        for (code, outcome) in field.codes {
            let mut bench = Bench::new(row);
            if field.name.starts_with("counted") {
                (field.set)(&mut bench, 0);
                bench.next_reading().expect("it answers");
                bench.wires.0.borrow_mut().altered.clear();
            }
            (field.set)(&mut bench, *code);
            let reading = bench.next_reading();
            if !matches(*outcome, reading, field) {
                let value = reading.map(|reading| ((field.get)(&reading), reading.current_range));
                wrong.push(format!(
                    "{} {code:#x}: {value:?} instead of {outcome:?}",
                    field.name
                ));
            }
        }
    }
    let read: usize = fields.iter().map(|field| field.codes.len()).sum();
    println!("{}: {} fields, {read} codes", row.name, fields.len());
    assert!(wrong.is_empty(), "{}: {wrong:#?}", row.name);
    assert_eq!(read, codes, "{}", row.name);
}

/// 2 mOhm, and 60 A for the counters.
const SHUNT: [(&str, f32); 3] = [
    ("BATT2_MONITOR", 21.0),
    ("BATT2_SHUNT", 0.002),
    ("BATT2_MAX_AMPS", 60.0),
];

fn word_at<const REGISTER: u8>(bench: &mut Bench, code: i64) {
    bench.alter(REGISTER, &(code as u16).to_be_bytes());
}

/// 20 bits in the upper ones of three bytes.
fn code_20_at<const REGISTER: u8>(bench: &mut Bench, code: i64) {
    bench.alter(REGISTER, &((code << 12) as i32).to_be_bytes()[..3]);
}

fn code_40_at<const REGISTER: u8>(bench: &mut Bench, code: i64) {
    bench.alter(REGISTER, &code.to_be_bytes()[3..]);
}

fn byte_at<const REGISTER: u8>(bench: &mut Bench, code: i64) {
    bench.alter(REGISTER, &[code as u8]);
}

/// Shunt voltage in 2.5 uV up to ±81.92 mV (SBOS547B 7.1.2), the same of an INA231 (SBOS644D 8.6.2).
const SHUNT_OF_226: &[(i64, Outcome)] = &[
    (0, Is(0.0)),
    (1, Is(1.25e-3)),
    (0x7ffe, Is(40.957_5)),
    (0x7fff, Over(40.958_75)),
    (-0x7fff, Is(-40.958_75)),
    (-0x8000, Over(-40.96)),
    // All ones.
    (-1, Is(-1.25e-3)),
];

/// Bus voltage in 1.25 mV, of which an INA226 and an INA260 stand 36 V, and an INA231 28 V.
const BUS_OF_226: &[(i64, Outcome)] = &[
    (0, Is(0.0)),
    (1, Is(1.25e-3)),
    (22_400, Is(28.0)),
    (22_401, Is(28.001_25)),
    (28_800, Is(36.0)),
    (28_801, Is(36.001_25)),
    (0x7ffe, Is(40.957_5)),
    (0x7fff, Fails(OverRange)),
    (-0x8000, Fails(Implausible)),
    (-1, Fails(Implausible)),
];

/// A field that is not as it was set up, or another part.
const CONFIGURATION_OF_226: &[(i64, Outcome)] = &[
    (0x44df, Is(12.0)),
    (0, Fails(OtherPart)),
    (0x4127, Fails(OtherPart)),
    (0xffff, Fails(OtherPart)),
];

#[test]
// Requirement: S-3, AP-6
fn an_ina226_at_its_ends() {
    let fields = [
        field("shunt current", word_at::<1>, amperes, SHUNT_OF_226),
        field("voltage", word_at::<2>, volts, BUS_OF_226),
        field("configuration", word_at::<0>, volts, CONFIGURATION_OF_226),
        // "TI"; any other is none of the parts that have numbers.
        field(
            "manufacturer",
            word_at::<0xfe>,
            volts,
            &[(0x5449, Is(12.0)), (0, Is(12.0)), (0xffff, Is(12.0))],
        ),
        // The last four bits are the revision.
        field(
            "die",
            word_at::<0xff>,
            volts,
            &[(0x2260, Is(12.0)), (0x226f, Is(12.0)), (0xffff, Is(12.0))],
        ),
    ];
    let part = row("INA226", 0x40, || monitor(Ina226::new(0.002)), &SHUNT);
    assert_fields(&part, &fields, 27);
}

#[test]
// Requirement: S-3, AP-6
fn an_ina231_at_its_ends() {
    let fields = [
        field("shunt current", word_at::<1>, amperes, SHUNT_OF_226),
        field("voltage", word_at::<2>, volts, BUS_OF_226),
    ];
    let part = row("INA231", 0x40, || monitor(Ina226::ina231(0.002)), &SHUNT);
    assert_fields(&part, &fields, 17);
}

#[test]
// Requirement: S-3, AP-6
fn an_ina219_at_its_ends() {
    let fields = [
        // 10 uV up to ±320 mV (SBOS448G 8.6.3.1).
        field(
            "shunt current",
            word_at::<1>,
            amperes,
            &[
                (0, Is(0.0)),
                (1, Is(5e-3)),
                (31_999, Is(159.995)),
                (32_000, Over(160.0)),
                (-31_999, Is(-159.995)),
                (-32_000, Over(-160.0)),
                (-0x8000, Over(-163.84)),
                // All ones.
                (-1, Is(-5e-3)),
            ],
        ),
        // 4 mV from bit 3 on, of which the part stands 26 V; below, a bit without a meaning, CNVR, and OVF.
        field(
            "voltage",
            word_at::<2>,
            volts,
            &[
                (0, Is(0.0)),
                (7, Is(0.0)),
                (3000 << 3, Is(12.0)),
                (3000 << 3 | 7, Is(12.0)),
                (6500 << 3, Is(26.0)),
                (8000 << 3, Is(32.0)),
                // All ones.
                (-1, Fails(OverRange)),
            ],
        ),
        field(
            "configuration",
            word_at::<0>,
            volts,
            &[
                (0x3e67, Is(12.0)),
                (0, Fails(OtherPart)),
                (0x399f, Fails(OtherPart)),
                (0xffff, Fails(OtherPart)),
            ],
        ),
    ];
    let part = row("INA219", 0x40, || monitor(Ina219::new(0.002)), &SHUNT);
    assert_fields(&part, &fields, 19);
}

#[test]
// Requirement: S-3, AP-6
fn an_ina260_at_its_ends() {
    let fields = [
        // 1.25 mA; its shunt stands 15 A.
        field(
            "current",
            word_at::<1>,
            amperes,
            &[
                (0, Is(0.0)),
                (1, Is(1.25e-3)),
                (12_000, Is(15.0)),
                (12_001, Is(15.001_25)),
                (-12_001, Is(-15.001_25)),
                (0x7ffe, Is(40.957_5)),
                (0x7fff, Over(40.958_75)),
                (-0x7fff, Is(-40.958_75)),
                (-0x8000, Over(-40.96)),
                (-1, Is(-1.25e-3)),
            ],
        ),
        field("voltage", word_at::<2>, volts, BUS_OF_226),
        field(
            "configuration",
            word_at::<0>,
            volts,
            &[
                (0x64df, Is(12.0)),
                (0, Fails(OtherPart)),
                (0x6127, Fails(OtherPart)),
                (0xffff, Fails(OtherPart)),
            ],
        ),
    ];
    let part = row("INA260", 0x40, || monitor(Ina226::ina260()), &SHUNT);
    assert_fields(&part, &fields, 24);
}

/// VBUS in 3.125 mV up to 85 V (SLYS025 table 8-1).
const VBUS_OF_238: &[(i64, Outcome)] = &[
    (0, Is(0.0)),
    (1, Is(3.125e-3)),
    (27_200, Is(85.0)),
    (27_201, Is(85.003_13)),
    (0x7ffe, Is(102.393_75)),
    (0x7fff, Fails(OverRange)),
    (-0x8000, Fails(Implausible)),
    (-1, Fails(Implausible)),
];

/// VSHUNT in 5 uV up to ±163.84 mV.
const VSHUNT_OF_238: &[(i64, Outcome)] = &[
    (0, Is(0.0)),
    (1, Is(2.5e-3)),
    (0x7ffe, Is(81.915)),
    (0x7fff, Over(81.917_5)),
    (-0x7fff, Is(-81.917_5)),
    (-0x8000, Over(-81.92)),
    (-1, Is(-2.5e-3)),
];

/// CONFIG: ADCRANGE is bit 4.
const CONFIG_OF_238: &[(i64, Outcome)] = &[
    (0, Is(12.0)),
    (1 << 4, Fails(OtherPart)),
    (0xffff, Fails(OtherPart)),
];

const ADC_CONFIG_OF_238: &[(i64, Outcome)] = &[
    (0xb92a, Is(12.0)),
    (0, Fails(OtherPart)),
    (0xfb68, Fails(OtherPart)),
    (0xffff, Fails(OtherPart)),
];

#[test]
// Requirement: S-3, AP-6
fn an_ina228_at_its_ends() {
    let fields = [
        // 312.5 nV; the counters end at 60 A, 384,000 steps, before it does at ±163.84 mV (SLYS021A table 8-1).
        field(
            "shunt current",
            code_20_at::<4>,
            amperes,
            &[
                (0, Is(0.0)),
                (1, Is(156.25e-6)),
                (383_999, Is(59.999_844)),
                (384_000, Over(60.0)),
                (0x7_fffe, Over(81.919_69)),
                (0x7_ffff, Over(81.919_84)),
                (-383_999, Is(-59.999_844)),
                (-384_000, Over(-60.0)),
                (-0x8_0000, Over(-81.92)),
                (-1, Is(-156.25e-6)),
            ],
        ),
        // 195.3125 uV up to 85 V.
        field(
            "voltage",
            code_20_at::<5>,
            volts,
            &[
                (0, Is(0.0)),
                (1, Is(195.312_5e-6)),
                (435_200, Is(85.0)),
                (435_201, Is(85.000_2)),
                (0x7_fffe, Is(102.399_61)),
                (0x7_ffff, Fails(OverRange)),
                (-0x8_0000, Fails(Implausible)),
                (-1, Fails(Implausible)),
            ],
        ),
        // 114.44 uC in 40 bits with their sign; a difference is the nearer one.
        field(
            "counted charge",
            code_40_at::<0x0a>,
            counted_mah,
            &[
                (0, Is(0.0)),
                (1, Is(31.789e-6)),
                (0x7f_ffff_ffff, Is(17_476_267.0)),
                (-0x80_0000_0000, Is(-17_476_267.0)),
                (-1, Is(-31.789e-6)),
            ],
        ),
        // 5.8594 mJ in 40 bits without a sign.
        field(
            "counted energy",
            code_40_at::<0x09>,
            counted_wh,
            &[
                (0, Is(0.0)),
                (1, Is(1.627_6e-6)),
                (0x7f_ffff_ffff, Is(894_785.0)),
                (-1, Is(-1.627_6e-6)),
            ],
        ),
        field("configuration", word_at::<0>, volts, CONFIG_OF_238),
        field("conversions", word_at::<1>, volts, ADC_CONFIG_OF_238),
        field(
            "calibration",
            word_at::<2>,
            volts,
            &[
                (3000, Is(12.0)),
                (0, Fails(OtherPart)),
                (0x1000, Fails(OtherPart)),
                (0xffff, Fails(OtherPart)),
            ],
        ),
    ];
    let part = row("INA228", 0x40, || monitor(Ina228::new(0.002)), &SHUNT);
    assert_fields(&part, &fields, 38);
}

const FIELDS_OF_238: [Field; 4] = [
    field("shunt current", word_at::<4>, amperes, VSHUNT_OF_238),
    field("voltage", word_at::<5>, volts, VBUS_OF_238),
    field("configuration", word_at::<0>, volts, CONFIG_OF_238),
    field("conversions", word_at::<1>, volts, ADC_CONFIG_OF_238),
];

#[test]
// Requirement: S-3, AP-6
fn an_ina238_and_an_ina239_at_their_ends() {
    let part = row("INA238", 0x40, || monitor(Ina228::ina238(0.002)), &SHUNT);
    assert_fields(&part, &FIELDS_OF_238, 22);
    let at_spi = row(
        "INA239",
        0,
        || Box::new(AtSpi(Ina239::new(0.002))),
        &[("BATT2_MONITOR", 26.0), ("BATT2_SHUNT", 0.002)],
    );
    assert_fields(&at_spi, &FIELDS_OF_238, 22);
}

/// 40 uV up to ±163.8 mV (7FF8), in the upper 13 of 16 bits (SBOS576C 7.6.2.2).
const SHUNT_OF_3221: &[(i64, Outcome)] = &[
    (0, Is(0.0)),
    (1 << 3, Is(0.02)),
    (0x7ff0, Is(81.88)),
    (0x7ff8, Over(81.9)),
    (0x7fff, Over(81.9)),
    (0x8010, Is(-81.88)),
    (0x8008, Over(-81.9)),
    (0x8000, Over(-81.92)),
    (0xffff, Is(-0.02)),
];

/// 8 mV up to 32.76 V, of which the part stands 26.
const BUS_OF_3221: &[(i64, Outcome)] = &[
    (0, Is(0.0)),
    (1 << 3, Is(8e-3)),
    (3250 << 3, Is(26.0)),
    (3251 << 3, Is(26.008)),
    (0x7ff0, Is(32.752)),
    (0x7ff8, Fails(OverRange)),
    (0x8000, Fails(Implausible)),
    (0xffff, Fails(Implausible)),
];

#[test]
// Requirement: S-3, AP-6
fn each_channel_of_an_ina3221_at_its_ends() {
    let make = || {
        wired(Ina3221::new(0.002), power_cycle, |device, amperes, _| {
            (1..=3).for_each(|channel| device.set(channel, VOLTS, amperes))
        })
    };
    let channels: [(Settings, [Setter; 2]); 3] = [
        (
            &[("BATT2_MONITOR", 30.0), ("BATT2_SHUNT", 0.002)],
            [word_at::<1>, word_at::<2>],
        ),
        (
            &[
                ("BATT2_MONITOR", 30.0),
                ("BATT2_SHUNT", 0.002),
                ("BATT2_CHANNEL", 2.0),
            ],
            [word_at::<3>, word_at::<4>],
        ),
        (
            &[
                ("BATT2_MONITOR", 30.0),
                ("BATT2_SHUNT", 0.002),
                ("BATT2_CHANNEL", 3.0),
            ],
            [word_at::<5>, word_at::<6>],
        ),
    ];
    for (settings, [shunt, bus]) in channels {
        let fields = [
            field("shunt current", shunt, amperes, SHUNT_OF_3221),
            field("voltage", bus, volts, BUS_OF_3221),
            field(
                "configuration",
                word_at::<0>,
                volts,
                &[
                    (0x74df, Is(12.0)),
                    (0, Fails(OtherPart)),
                    (0x7127, Fails(OtherPart)),
                    (0xffff, Fails(OtherPart)),
                ],
            ),
            field(
                "die",
                word_at::<0xff>,
                volts,
                &[
                    (0x3220, Is(12.0)),
                    (0, Fails(OtherPart)),
                    (0xffff, Fails(OtherPart)),
                ],
            ),
        ];
        assert_fields(&row("INA3221", 0x40, make, settings), &fields, 24);
    }
}

/// 12 bits in the upper ones of two bytes.
fn code_12_at<const REGISTER: u8>(bench: &mut Bench, code: i64) {
    bench.alter(REGISTER, &((code << 4) as u16).to_be_bytes());
}

fn code_32_at<const REGISTER: u8>(bench: &mut Bench, code: i64) {
    bench.alter(REGISTER, &(code as u32).to_be_bytes());
}

#[test]
// Requirement: S-3, AP-6
fn an_ltc2946_at_its_ends() {
    let fields = [
        // 25 uV up to 102.4 mV (2946fa, electrical characteristics).
        field(
            "sense current",
            code_12_at::<0x14>,
            amperes,
            &[
                (0, Is(0.0)),
                (1, Is(12.503e-3)),
                (0xffe, Is(51.187_5)),
                (0xfff, Over(51.2)),
            ],
        ),
        // The other four bits are not used.
        field(
            "sense word current",
            word_at::<0x14>,
            amperes,
            &[(0x000f, Is(0.0)), (0xffef, Is(51.187_5)), (0xffff, Over(51.2))],
        ),
        // 25 mV up to 102.4 V, of which the part stands 100.
        field(
            "voltage",
            code_12_at::<0x1e>,
            volts,
            &[
                (0, Is(0.0)),
                (1, Is(25.006e-3)),
                (3999, Is(99.999)),
                (4000, Is(100.024_4)),
                (0xffe, Is(102.375)),
                (0xfff, Fails(OverRange)),
            ],
        ),
        // 16 steps of the current, each for 16.404 ms; one that falls was reset.
        field(
            "counted charge",
            code_32_at::<0x38>,
            counted_mah,
            &[
                (0, Is(0.0)),
                (1, Is(911.55e-6)),
                (0x7fff_ffff, Is(1_957_536.0)),
                (0x8000_0000, Unknown),
                (0xffff_ffff, Unknown),
            ],
        ),
        // 65,536 steps of the power.
        field(
            "counted energy",
            code_32_at::<0x3c>,
            counted_wh,
            &[
                (0, Is(0.0)),
                (1, Is(93.366e-6)),
                (0x7fff_ffff, Is(200_502.0)),
                (0xffff_ffff, Unknown),
            ],
        ),
        field(
            "control",
            byte_at::<0>,
            volts,
            &[
                (0x98, Is(12.002_93)),
                (0x18, Fails(OtherPart)),
                (0, Fails(OtherPart)),
                (0xff, Fails(OtherPart)),
            ],
        ),
        field(
            "identity",
            byte_at::<0xe7>,
            volts,
            &[
                (0x60, Is(12.002_93)),
                (0, Fails(OtherPart)),
                (0xff, Fails(OtherPart)),
            ],
        ),
    ];
    let make = || {
        wired(Ltc2946::new(0.002), Ltc2946::power_cycle, |device, amperes, _| {
            device.set(VOLTS, amperes)
        })
    };
    let part = row(
        "LTC2946",
        0x6f,
        make,
        &[("BATT2_MONITOR", 22.0), ("BATT2_SHUNT", 0.002)],
    );
    assert_fields(&part, &fields, 29);
}

/// A code of an input; the others are at 2 V.
fn code_of_input<const CHANNEL: usize>(bench: &mut Bench, code: i64) {
    bench.device(|converter: &mut Ad7091r5| {
        (0..4).for_each(|channel| converter.set(channel, 2.0));
        converter.set(CHANNEL, code as f64 * 3.3 / 4096.0);
    });
}

#[test]
// Requirement: S-3, AP-6
fn an_ad7091r5_at_its_ends() {
    let fields = [
        // 3.3 V over 12 bits, times 6; a conversion above it is 4095, too.
        field(
            "voltage",
            code_of_input::<0>,
            volts,
            &[
                (0, Is(0.0)),
                (1, Is(4.834e-3)),
                (4094, Is(19.790_33)),
                (4095, Fails(OverRange)),
                (4200, Fails(OverRange)),
            ],
        ),
        // 10 A a volt from 0.5 V on.
        field(
            "current",
            code_of_input::<3>,
            amperes,
            &[
                (0, Is(-5.0)),
                (4094, Is(27.983_887)),
                (4095, Over(27.991_943)),
                (4200, Over(27.991_943)),
            ],
        ),
        // Bits 14 and 13 are the channel.
        field(
            "result",
            |bench, code| bench.alter(0, &(code as u16).to_be_bytes().repeat(101)),
            volts,
            &[(0, Fails(Implausible)), (0xffff, Fails(Implausible))],
        ),
        field(
            "configuration",
            word_at::<2>,
            volts,
            &[
                (0x0400, Is(11.997_95)),
                (0, Fails(OtherPart)),
                (0x00c0, Fails(OtherPart)),
                (0xffff, Fails(OtherPart)),
            ],
        ),
    ];
    let make = || {
        let mut device = Ad7091r5::new(3.3);
        (0..4).for_each(|channel| device.set(channel, 2.0));
        wired(device, Ad7091r5::power_cycle, |_, _, _| ())
    };
    let settings = &[
        ("BATT2_MONITOR", 28.0),
        ("BATT2_VOLT_PIN", 50.0),
        ("BATT2_CURR_PIN", 53.0),
        ("BATT2_VOLT_MULT", 6.0),
        ("BATT2_AMP_PERVLT", 10.0),
        ("BATT2_AMP_OFFSET", 0.5),
    ];
    assert_fields(&row("AD7091R-5", 0x2f, make, settings), &fields, 15);
}

/// A word of the block that is read from 0x02 on.
fn word_of_stack<const COMMAND: u8>(bench: &mut Bench, code: i64) {
    bench.alter_from(0x02, usize::from(COMMAND - 2), &(code as u16).to_le_bytes());
}

fn temperature_word<const COMMAND: u8>(bench: &mut Bench, code: i64) {
    bench.alter_from(0x68, usize::from(COMMAND - 0x68), &(code as u16).to_le_bytes());
}

fn first_cell_v(reading: &Measurement) -> Option<f32> {
    reading.cells.millivolts().first().map(|mv| f32::from(*mv) * 1e-3)
}

fn last_cell_v(reading: &Measurement) -> Option<f32> {
    reading.cells.millivolts().last().map(|mv| f32::from(*mv) * 1e-3)
}

fn celsius(reading: &Measurement) -> Option<f32> {
    reading.temperature_c
}

fn celsius_of_pack(reading: &Measurement) -> Option<f32> {
    celsius(reading).filter(|_| reading.thermometer == Thermometer::Pack)
}

fn faults(reading: &Measurement) -> Option<f32> {
    Some(reading.reported.faults.bits().into())
}

/// I2, in millivolts, up to 5.5 V (SLUUBY2B 12.1, SLUSDZ7 7.14); below zero a cell has failed.
const CELL_OF_STACK: &[(i64, Outcome)] = &[
    (0, Is(0.0)),
    (1, Is(0.001)),
    (5500, Is(5.5)),
    (5501, Is(5.501)),
    (0x7fff, Is(32.767)),
    (-200, Is(0.0)),
    (-0x8000, Is(0.0)),
    (-1, Is(0.0)),
];

fn units(bench: &mut Bench, code: i64) {
    bench.device(|stack: &mut Bq76952| stack.set_up_units(code as u8, 0xffff));
    bench.alter_from(0x02, 0x38, &(-1000i16).to_le_bytes());
}

#[test]
// Requirement: S-3, AP-7
fn a_bq76952_at_its_ends() {
    let fields = [
        field("first cell", word_of_stack::<0x14>, first_cell_v, CELL_OF_STACK),
        field("last cell", word_of_stack::<0x32>, last_cell_v, CELL_OF_STACK),
        // I2, in 10 mV, of which the part stands 80 V; it is fed by the stack.
        field(
            "voltage",
            word_of_stack::<0x34>,
            volts,
            &[
                (0, Fails(Implausible)),
                (1, Is(0.01)),
                (8000, Is(80.0)),
                (8001, Is(80.01)),
                (0x7ffe, Is(327.66)),
                (0x7fff, Fails(OverRange)),
                (-0x8000, Fails(Implausible)),
                (-1, Fails(Implausible)),
            ],
        ),
        // I2, in 1 mA, into the pack.
        field(
            "current",
            word_of_stack::<0x3a>,
            amperes,
            &[
                (0, Is(0.0)),
                (1, Is(-0.001)),
                (0x7ffe, Is(-32.766)),
                (0x7fff, Outcome::Counted(-32.767)),
                (-0x7fff, Is(32.767)),
                (-0x8000, Outcome::Counted(32.768)),
                (-1, Is(0.001)),
            ],
        ),
        // Tenths of a kelvin of the chip, for -40 to 85 °C.
        field(
            "temperature",
            temperature_word::<0x68>,
            celsius,
            &[
                (2332, Is(-39.95)),
                (2331, Odd(-40.05)),
                (3981, Is(124.95)),
                (3982, Odd(125.05)),
                (0, Odd(-273.15)),
                (-1, Odd(-273.25)),
                (-0x8000, Odd(-3_549.95)),
            ],
        ),
        // The figures of a thermistor of cells at TS1.
        field(
            "temperature of the pack",
            |bench, code| {
                bench.device(|stack: &mut Bq76952| stack.set_thermistors([(7, 20.0), (0, 0.0), (0, 0.0)]));
                bench.alter_from(0x68, 8, &(code as u16).to_le_bytes());
            },
            celsius_of_pack,
            &[
                (2332, Is(-39.95)),
                (2331, Unknown),
                (3981, Is(124.95)),
                (3982, Unknown),
                (0, Unknown),
                (0x7fff, Unknown),
                (-1, Unknown),
            ],
        ),
        // Safety status A: under- and overvoltage, currents, short circuit; the other bits are not used.
        field(
            "safety",
            |bench, code| bench.alter_from(0x02, 1, &[code as u8]),
            faults,
            &[
                (0, Is(0.0)),
                (0x03, Is(0.0)),
                (0x04, Is(1.0)),
                (0x08, Is(2.0)),
                (0x70, Is(8.0)),
                (0xff, Is((1 + 2 + 8 + 512) as f32)),
            ],
        ),
        // DA Configuration: 0.1, 1, 10 and 100 mA; the others say nothing of it.
        field(
            "unit of current",
            units,
            amperes,
            &[
                (4, Is(0.1)),
                (5, Is(1.0)),
                (6, Is(10.0)),
                (7, Is(100.0)),
                (0xff, Is(100.0)),
            ],
        ),
        // 2^-32 mAh in 64 bits, into the pack.
        field(
            "counted charge",
            |bench, code| bench.device(|stack: &mut Bq76952| stack.set_charge(code)),
            counted_mah,
            &[
                (0, Is(0.0)),
                (1 << 32, Is(-1.0)),
                (-(1 << 32), Is(1.0)),
                (i64::MAX, Is(-2_147_483_648.0)),
                (i64::MIN, Is(2_147_483_648.0)),
                (-1, Is(0.0)),
            ],
        ),
    ];
    let make = || {
        let mut device = Bq76952::new();
        device.set(&[1000; 12], 0.0, 25.0);
        device.set_up_units(5, 0xffff);
        wired(device, Bq76952::power_cycle, |_, _, _| ())
    };
    assert_fields(
        &row("BQ76952", 0x08, make, &[("BATT2_MONITOR", 32.0)]),
        &fields,
        62,
    );
}

#[test]
// Requirement: S-3, AP-6
fn a_motor_board_of_a_bebop_at_its_ends() {
    let fields = [field(
        "voltage",
        |bench, code| bench.device(|board: &mut Bebop| board.set(code as u16)),
        volts,
        &[
            (0, Fails(Implausible)),
            (1, Is(0.001)),
            (0xfffe, Is(65.534)),
            (0xffff, Fails(OverRange)),
        ],
    )];
    let make = || idle(Bebop::new(12_000));
    assert_fields(&row("Bebop", 0x08, make, &[("BATT2_MONITOR", 6.0)]), &fields, 4);
}

/// A battery with these words and blocks, whose charge does not change.
fn battery(set_up: fn(&mut SmartBattery)) -> Box<dyn Emulated> {
    let mut device = SmartBattery::new(Pec::Right);
    set_up(&mut device);
    idle(device)
}

fn word<const COMMAND: u8>(bench: &mut Bench, code: i64) {
    bench.word(COMMAND, code);
}

fn remaining_mah(reading: &Measurement) -> Option<f32> {
    reading.gauge.read().map(|gauge| gauge.remaining_mah)
}

fn full_mah(reading: &Measurement) -> Option<f32> {
    reading.gauge.read().map(|gauge| gauge.full_mah)
}

/// Words of the Smart Battery Data Specification 1.1, chapter 5.1; FFFF is one that is not filled in.
const WORDS: [Field; 15] = [
    // 0 to 65,535 mV. A battery that has none does not answer.
    field(
        "voltage",
        word::<0x09>,
        volts,
        &[
            (0, Is(0.0)),
            (1, Is(0.001)),
            (0xfffe, Is(65.534)),
            (0xffff, Fails(ReadError::Bus(BusError::NoAnswer))),
        ],
    ),
    // -32,768 to 32,767 mA, into the battery.
    field(
        "current",
        word::<0x0a>,
        amperes,
        &[
            (0, Is(0.0)),
            (1, Is(-0.001)),
            (0x7ffe, Is(-32.766)),
            (0x7fff, Outcome::Counted(-32.767)),
            (0x8001, Is(32.767)),
            (0x8000, Outcome::Counted(32.768)),
            (0xffff, Is(0.001)),
        ],
    ),
    // 0 to 6553.5 K; 0 is a sensor that is not fitted.
    field(
        "temperature",
        word::<0x08>,
        celsius,
        &[
            (0, Unknown),
            (1, Odd(-273.05)),
            (2332, Is(-39.95)),
            (3981, Is(124.95)),
            (3982, Odd(125.05)),
            (0x7fff, Odd(3003.55)),
            (0xffff, Unknown),
        ],
    ),
    // 0 to 65,535 mAh.
    field(
        "remaining",
        word::<0x0f>,
        remaining_mah,
        &[
            (0, Is(0.0)),
            (1, Is(1.0)),
            (5200, Is(5200.0)),
            (0xfffe, Is(65_534.0)),
            (0xffff, Unknown),
        ],
    ),
    field(
        "full",
        word::<0x10>,
        full_mah,
        &[
            (0, Unknown),
            (1, Is(1.0)),
            (0xfffe, Is(65_534.0)),
            (0xffff, Unknown),
        ],
    ),
    // 0 to 100 %.
    field(
        "error",
        word::<0x0c>,
        |reading| reading.reported.gauge.error_pct.map(f32::from),
        &[
            (0, Is(0.0)),
            (100, Is(100.0)),
            (101, Unknown),
            (0xfffe, Unknown),
            (0xffff, Unknown),
        ],
    ),
    // 0 to 65,534 cycles.
    field(
        "cycles",
        word::<0x17>,
        |reading| reading.details.cycle_count.map(f32::from),
        &[(0, Is(0.0)), (0xfffe, Is(65_534.0)), (0xffff, Unknown)],
    ),
    field(
        "design capacity",
        word::<0x18>,
        |reading| reading.details.design_capacity_mah,
        &[
            (0, Unknown),
            (1, Is(1.0)),
            (0xfffe, Is(65_534.0)),
            (0xffff, Unknown),
        ],
    ),
    // 7000 to 18,000 mV are those of the specification's batteries.
    field(
        "design voltage",
        word::<0x19>,
        |reading| reading.details.design_voltage_v,
        &[
            (0, Unknown),
            (6999, Is(6.999)),
            (18_001, Is(18.001)),
            (0xfffe, Is(65.534)),
            (0xffff, Unknown),
        ],
    ),
    // A state of health is that of the full capacity, 5200 mAh, in percent.
    field(
        "state of health",
        word::<0x18>,
        |reading| reading.details.state_of_health_pct.map(f32::from),
        &[
            (5199, Is(100.0)),
            (1, Is(100.0)),
            (10_400, Is(50.0)),
            (0xfffe, Is(8.0)),
            (0xffff, Unknown),
        ],
    ),
    // Powers of ten in bits 8 to 11 (voltages) and 12 to 15 (currents) up to 3, versions 1 to 3.
    field(
        "scale of voltages",
        word::<0x1a>,
        volts,
        &[
            (0x0031, Is(12.6)),
            (0x0131, Is(126.0)),
            (0x0331, Is(12_600.0)),
            (0x0431, Fails(OtherPart)),
            (0x4031, Fails(OtherPart)),
            (0xffff, Is(12.6)),
        ],
    ),
    // Year since 1980, month, day: 0 is none, nor is a month of 13.
    field(
        "date",
        word::<0x1b>,
        |reading| reading.details.manufactured.map(|date| date.year.into()),
        &[
            (0, Unknown),
            (1 << 5 | 1, Is(1980.0)),
            (0xff9f, Is(2107.0)),
            (44 << 9 | 13 << 5 | 1, Unknown),
            (0xffff, Unknown),
        ],
    ),
    field(
        "serial number",
        word::<0x1c>,
        |reading| reading.details.serial_number.map(|number| number as f32),
        &[
            (0, Unknown),
            (1, Is(1.0)),
            (0xfffe, Is(65_534.0)),
            (0xffff, Unknown),
        ],
    ),
    // Over temperature is its only fault; it is not filled in as FFFF.
    field(
        "status",
        word::<0x16>,
        faults,
        &[
            (0, Is(0.0)),
            (1 << 12, Is(16.0)),
            (0xfffe, Is(16.0)),
            (0xffff, Is(0.0)),
        ],
    ),
    // Bit 15: capacities in 10 mWh, of 11.1 V here.
    field(
        "mode",
        word::<0x03>,
        full_mah,
        &[
            (0, Is(5200.0)),
            (0x7fff, Is(5200.0)),
            (0x8000, Is(4684.685)),
            (0xfffe, Is(4684.685)),
            // Until it is settled.
            (0xffff, Unknown),
        ],
    ),
];

#[test]
// Requirement: S-3, AP-5
fn a_smart_battery_at_its_ends() {
    let make = || {
        battery(|battery| {
            battery.set_word(0x19, 11_100);
            battery.set_word(0x0c, 1);
        })
    };
    let part = row("smart battery", 0x0b, make, &[("BATT2_MONITOR", 7.0)]);
    assert_fields(&part, &WORDS, 73);
}

/// The first word of a block of cells; the others are 4 V.
fn cell_of_block(bench: &mut Bench, code: i64) {
    let words = [code as u16, 4000, 4000, 4000].map(u16::to_le_bytes);
    bench.device(|battery: &mut SmartBattery| battery.set_block(0x28, words.as_flattened()));
}

/// Four bytes with their sign, in milliamperes into the battery, which exceed every pack's.
const LONG_CURRENT: &[(i64, Outcome)] = &[
    (0, Is(0.0)),
    (1, Is(-0.001)),
    (-1, Is(0.001)),
    (-200_000, Is(200.0)),
    (i32::MAX as i64, Is(-2_147_483.6)),
    (i32::MIN as i64, Is(2_147_483.6)),
];

const FILLED_OR_NOT: &[(i64, Outcome)] = &[
    (0, Is(0.0)),
    (1, Is(0.001)),
    (4200, Is(4.2)),
    (0xffff, Fails(ReadError::Bus(BusError::NoAnswer))),
];

#[test]
// Requirement: S-3, AP-5
fn batteries_of_makers_at_their_ends() {
    let solo = [
        field("cell", cell_of_block, first_cell_v, FILLED_OR_NOT),
        field(
            "current",
            |bench, code| {
                let block = (code as i32).to_le_bytes();
                bench.device(|battery: &mut SmartBattery| battery.set_block(0x2a, &block));
            },
            amperes,
            LONG_CURRENT,
        ),
        field(
            "button",
            |bench, code| {
                bench.device(|battery: &mut SmartBattery| battery.set_block(0x23, &[code as u8; 6]));
            },
            |reading| Some(f32::from(reading.supply == Supply::PoweringOff)),
            &[(0, Is(0.0)), (0xff, Is(0.0))],
        ),
    ];
    let make_solo = || {
        battery(|battery| {
            battery.set_block(0x28, [4000u16; 4].map(u16::to_le_bytes).as_flattened());
            battery.set_block(0x2a, &[0; 4]);
            battery.set_block(0x23, &[0; 6]);
        })
    };
    let part = row("Solo", 0x0b, make_solo, &[("BATT2_MONITOR", 5.0)]);
    assert_fields(&part, &solo, 12);

    let bare = field(
        "current",
        |bench, code| {
            let bytes = (code as i32).to_le_bytes();
            bench.device(|battery: &mut SmartBattery| battery.set_bare(0x2a, &bytes));
        },
        amperes,
        LONG_CURRENT,
    );
    let make_sui = || {
        battery(|battery| {
            battery.set_pec(Pec::None);
            battery.set_block(0x28, [4000u16; 4].map(u16::to_le_bytes).as_flattened());
            battery.set_bare(0x2a, &[0; 4]);
        })
    };
    let of_three = [field("cell", cell_of_block, first_cell_v, FILLED_OR_NOT), bare];
    let part = row("SUI of 3 cells", 0x0b, make_sui, &[("BATT2_MONITOR", 13.0)]);
    assert_fields(&part, &of_three, 10);
    let [_, bare] = of_three;
    let part = row("SUI of 6 cells", 0x0b, make_sui, &[("BATT2_MONITOR", 14.0)]);
    let of_six = [
        field(
            "voltage",
            word::<0x09>,
            volts,
            &[
                (0, Is(0.0)),
                (0xfffe, Is(65.534)),
                (0xffff, Fails(ReadError::Bus(BusError::NoAnswer))),
            ],
        ),
        bare,
    ];
    assert_fields(&part, &of_six, 9);

    let cell_count = |reading: &Measurement| reading.cells.number().map(f32::from);
    let neo = [
        // Up to ten cells.
        field(
            "count",
            |bench, code| bench.word(0x5c, code),
            cell_count,
            &[
                (0, Unknown),
                (1, Unknown),
                (3, Is(3.0)),
                // As many as answer and add up.
                (10, Is(3.0)),
                (11, Is(3.0)),
                (0xffff, Is(3.0)),
            ],
        ),
        field(
            "cell",
            word::<0x30>,
            first_cell_v,
            &[
                (0, Unknown),
                (4199, Is(4.199)),
                (0xfffe, Unknown),
                (0xffff, Unknown),
            ],
        ),
    ];
    let make_neo = || {
        battery(|battery| {
            battery.set_word(0x5c, 3);
            (0x30..0x33).for_each(|command| battery.set_word(command, 4200));
        })
    };
    let part = row("NeoDesign", 0x0b, make_neo, &[("BATT2_MONITOR", 15.0)]);
    assert_fields(&part, &neo, 10);

    let maxell = [
        field(
            "remaining",
            word::<0x0f>,
            remaining_mah,
            &[
                (0, Is(0.0)),
                (1, Is(2.0)),
                (0xfffe, Is(131_068.0)),
                (0xffff, Unknown),
            ],
        ),
        field(
            "full",
            word::<0x10>,
            full_mah,
            &[
                (0, Unknown),
                (1, Is(2.0)),
                (0xfffe, Is(131_068.0)),
                (0xffff, Unknown),
            ],
        ),
    ];
    let part = row("Maxell", 0x0b, || battery(|_| ()), &[("BATT2_MONITOR", 16.0)]);
    assert_fields(&part, &maxell, 8);

    let rotoye = [
        // Tenths of an ampere; the word of milliamperes without.
        field(
            "current",
            word::<0x41>,
            amperes,
            &[
                (0, Is(0.0)),
                (1, Is(-0.1)),
                (0x7ffe, Is(-3276.6)),
                (0x7fff, Outcome::Counted(-3276.7)),
                (0x8001, Is(3276.7)),
                (0x8000, Outcome::Counted(3276.8)),
                (0xffff, Is(0.0)),
            ],
        ),
        // The hottest of three; 0 is not fitted.
        field(
            "temperature",
            word::<0x48>,
            celsius,
            &[
                (0, Is(25.05)),
                (2982, Is(25.05)),
                (3982, Odd(125.05)),
                (0xffff, Is(25.05)),
            ],
        ),
    ];
    let part = row("Rotoye", 0x0b, || battery(|_| ()), &[("BATT2_MONITOR", 19.0)]);
    assert_fields(&part, &rotoye, 11);
}

#[test]
// Requirement: S-3
fn a_current_that_nothing_else_counts_or_that_is_not_used_at_its_ends() {
    let milliamperes = |codes| [field("current", word::<0x0a>, amperes, codes)];
    let without_gauge = milliamperes(&[
        (0x7ffe, Is(-32.766)),
        (0x7fff, Over(-32.767)),
        (0x8001, Is(32.767)),
        (0x8000, Over(32.768)),
    ]);
    let make = || battery(|battery| battery.set_word(0x0f, 0xffff));
    let part = row("smart battery", 0x0b, make, &[("BATT2_MONITOR", 7.0)]);
    assert_fields(&part, &without_gauge, 4);
    // The word of tenths of an ampere is used alone.
    let in_tenths = milliamperes(&[(0x7fff, Is(80.0)), (0x8000, Is(80.0))]);
    let make = || battery(|battery| battery.set_word(0x41, -800i16 as u16));
    let part = row("Rotoye", 0x0b, make, &[("BATT2_MONITOR", 19.0)]);
    assert_fields(&part, &in_tenths, 2);
}

#[test]
fn more_than_the_full_charge_of_a_battery_is_100_percent() {
    let part = row(
        "smart battery",
        0x0b,
        || battery(|_| ()),
        &[("BATT2_MONITOR", 7.0)],
    );
    for (remaining, percent) in [
        (0, 0.0),
        (5199, 99.98),
        (5200, 100.0),
        (5201, 100.0),
        (0xfffe, 100.0),
    ] {
        let mut bench = Bench::new(&part);
        bench.word(0x0f, remaining);
        bench.run_for(SECOND);
        let state = bench.state(Pack::Second);
        let percent_of_state = state.readings.remaining_pct.expect("it has a gauge");
        assert!(
            (percent_of_state - percent).abs() < 0.01,
            "{remaining}: {percent_of_state}"
        );
        assert_eq!(
            state.consumed_mah(),
            Some((5200.0 - remaining as f32).max(0.0)),
            "{remaining}"
        );
    }
}

#[test]
// Requirement: S-3
fn peaks_above_the_range_of_a_part_are_cut_off_before_it_averages_and_show_no_end() {
    /// Kind, shunt, mean current, and what of it is shown.
    type Pulses = (&'static str, u8, fn() -> Box<dyn Emulated>, f32, f32, f32, f32);
    fn pulsed<D: I2cDevice + 'static>(mut device: D, set: fn(&mut D)) -> Box<dyn Emulated> {
        set(&mut device);
        idle(device)
    }
    let table: [Pulses; 6] = [
        // 81.92 mV over 0.1 Ohm: 0.82 of 4 A.
        (
            "INA226",
            0x40,
            || {
                pulsed(Ina226::new(0.1), |device| {
                    device.set(VOLTS, 4.0);
                    device.set_pulses(0.25);
                })
            },
            21.0,
            0.1,
            1.0,
            0.2048,
        ),
        // 163.84 mV.
        (
            "INA228",
            0x40,
            || {
                pulsed(Ina228::new(0.1), |device| {
                    device.set(VOLTS, 4.0, 25.0);
                    device.set_pulses(0.25);
                })
            },
            21.0,
            0.1,
            1.0,
            0.4096,
        ),
        (
            "INA238",
            0x40,
            || {
                pulsed(Ina228::ina238(0.1), |device| {
                    device.set(VOLTS, 4.0, 25.0);
                    device.set_pulses(0.25);
                })
            },
            21.0,
            0.1,
            1.0,
            0.4096,
        ),
        (
            "INA3221",
            0x40,
            || {
                pulsed(Ina3221::new(0.1), |device| {
                    device.set(1, VOLTS, 4.0);
                    device.set_pulses(1, 0.25);
                })
            },
            30.0,
            0.1,
            1.0,
            0.4096,
        ),
        // 102.4 mV.
        (
            "LTC2946",
            0x6f,
            || {
                pulsed(Ltc2946::new(0.1), |device| {
                    device.set(VOLTS, 4.0);
                    device.set_pulses(0.25);
                })
            },
            22.0,
            0.1,
            1.0,
            0.256,
        ),
        // 200 mV over its own 1 mOhm.
        (
            "BQ76952",
            0x08,
            || {
                pulsed(Bq76952::new(), |device| {
                    device.set(&[4000; 3], 400.0, 25.0);
                    device.set_pulses(0.1);
                })
            },
            32.0,
            0.0005,
            40.0,
            20.0,
        ),
    ];
    for (name, address, make, kind, shunt_ohm, mean_a, shown_a) in table {
        let settings = [("BATT2_MONITOR", kind), ("BATT2_SHUNT", shunt_ohm)];
        let part = row(name, address, make, settings.to_vec().leak());
        let mut bench = Bench::new(&part);
        bench.run_for(SECOND);
        let reading = bench.latest[&2].expect("it answers");
        let current_a = reading.current_a.expect("it is measured");
        assert!(
            (current_a - shown_a).abs() < 0.01 * shown_a,
            "{name}: {current_a}"
        );
        assert!(current_a < 0.6 * mean_a, "{name}");
        assert_eq!(reading.current_range, CurrentRange::Within, "{name}");
    }
}
