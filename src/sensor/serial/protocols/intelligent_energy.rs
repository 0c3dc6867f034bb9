//! Intelligent Energy's fuel cells (by ArduPilot's `AP_Generator_IE_650_800` and `AP_Generator_IE_2400`), which send sentences of
//! terms with commas between.
//!
//! | sentence | terms |
//! |---|---|
//! | `<...>` of 650 W and 800 W | tank in %, battery in %, state, error flags in hexadecimal |
//! | `<...>` of 2.4 kW | tank in bar, battery in V, output in W, stack in W, power into the battery in W, state, error |
//! | the same, protocol 4 | tank in %, inlet in bar, battery in V, output in W, stack in W, unit at fault, power into the battery in W, state, error, its detail, a text, checksum |
//! | `[...]` of the latter | part number, version, protocol, serial number, checksum |
//!
//! The checksum is the inverted sum of all bytes before it, in decimal.

use heapless::Vec;

use super::super::conditions::{FuelCellError, FuelCellState, SerialNotice};
use super::super::protocol::{Baud, Gaps, Line, Protocol, SerialReading, Wires};
use super::is_output;
use crate::announce::LastAnnounced;
use crate::battery::{Contents, Measurement, ReadError};
use crate::parameter::MonitorKind;
use crate::time::Instant;

/// The longest sentence of protocol 4 has some 110.
const SENTENCE_BYTES: usize = 128;

/// As many terms as the longest sentence has.
const TERMS: usize = 12;

/// Idle time that ends a sentence, in microseconds: a sentence takes 133 ms at most.
const MAX_GAP_US: u64 = 200_000;

/// An empty and a full tank, in bar.
const EMPTY_BAR: f32 = 5.0;
const FULL_BAR: f32 = 300.0;

/// The highest share of a tank or battery without a checksum: a full one may exceed its nominal content.
const HIGHEST_SHARE: f32 = 1.1;

/// Which fuel cell it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::sensor::serial) enum FuelCell {
    /// 650 W or 800 W.
    Watts650,
    /// 2.4 kW.
    Kilowatts2,
}

/// Decoder of Intelligent Energy's sentences.
#[derive(Clone, Debug)]
pub(in crate::sensor::serial) struct IntelligentEnergy {
    fuel_cell: FuelCell,
    /// From its first byte on; empty between sentences.
    sentence: Vec<u8, SENTENCE_BYTES>,
    gaps: Gaps<MAX_GAP_US>,
    state: LastAnnounced<Option<FuelCellState>>,
    error: LastAnnounced<FuelCellError>,
}

impl Protocol for IntelligentEnergy {
    type Model = FuelCell;
    const LINE: Line = Line {
        baud: Baud::Set,
        wires: Wires::ReceiveOnly,
    };
    const KINDS: &'static [MonitorKind] = &[MonitorKind::GeneratorElectrical, MonitorKind::GeneratorFuel];
    const TIMEOUT_US: u64 = 5_000_000;

    fn new(fuel_cell: &FuelCell) -> Self {
        Self {
            fuel_cell: *fuel_cell,
            sentence: Vec::new(),
            gaps: Gaps::new(),
            state: LastAnnounced::default(),
            error: LastAnnounced::new(FuelCellError::NONE),
        }
    }

    fn begin(&mut self, now: Instant) {
        if self.gaps.precede(now) {
            self.sentence.clear();
        }
    }

    fn push(&mut self, byte: u8, _: Instant, deliver: &mut impl FnMut(SerialReading)) {
        match byte {
            b'<' | b'[' => self.sentence.clear(),
            b'>' => {
                match self.decode() {
                    Some(report) if report.is_possible() => self.deliver(&report, deliver),
                    Some(_) => {
                        for kind in Self::KINDS {
                            deliver(SerialReading::Refused(*kind, ReadError::Implausible));
                        }
                    }
                    None => {}
                }
                return self.sentence.clear();
            }
            _ if self.sentence.is_empty() => return,
            _ => {}
        }
        if self.sentence.push(byte).is_err() {
            self.sentence.clear();
        }
    }
}

/// Content of a sentence.
struct Report {
    state: Option<FuelCellState>,
    error: FuelCellError,
    /// A charge may be above 1.
    electrical: Measurement,
    /// From 0; 1 is full.
    tank: f32,
    /// The highest share that is possible.
    highest_share: f32,
}

impl Report {
    /// Whether the fuel cell can have these values.
    fn is_possible(&self) -> bool {
        let is_share = |share: f32| (0.0..=self.highest_share).contains(&share);
        let Measurement {
            voltage_v,
            current_a,
            state_of_charge,
            ..
        } = self.electrical;
        is_share(self.tank)
            && state_of_charge.is_none_or(is_share)
            && is_output(voltage_v.unwrap_or(0.0), current_a.unwrap_or(0.0))
    }
}

impl IntelligentEnergy {
    fn decode(&self) -> Option<Report> {
        let body = self.sentence.strip_prefix(b"<")?;
        let mut terms: Vec<&[u8], TERMS> = Vec::new();
        for term in body.split(|byte| *byte == b',') {
            terms.push(term).ok()?;
        }
        match (self.fuel_cell, terms.as_slice()) {
            (FuelCell::Watts650, [tank, battery, state, flags]) => small(tank, battery, state, flags),
            (FuelCell::Kilowatts2, [tank, voltage, output, stack, power, state, error]) => {
                // All of them are numbers, although not all are used: there is no checksum.
                decimal(output)?;
                decimal(stack)?;
                Some(Report {
                    state: FuelCellState::of_code(whole(state)?),
                    error: FuelCellError::Code(whole(error)?, 0),
                    electrical: of_battery(decimal(voltage)?, decimal(power)?),
                    tank: share_of_pressure(decimal(tank)?),
                    highest_share: HIGHEST_SHARE,
                })
            }
            (
                FuelCell::Kilowatts2,
                [
                    tank,
                    _,
                    voltage,
                    _,
                    _,
                    _,
                    power,
                    state,
                    error,
                    detail,
                    _,
                    checksum,
                ],
            ) => {
                let summed = self.sentence.len() - checksum.len();
                let sum = self.sentence.get(..summed)?.iter().copied();
                if whole(checksum)? != u32::from(!sum.fold(0, u8::wrapping_add)) {
                    return None;
                }
                Some(Report {
                    state: FuelCellState::of_code_of_protocol_4(whole(state)?),
                    error: FuelCellError::Code(whole(error)?, whole(detail)?),
                    electrical: of_battery(decimal(voltage)?, decimal(power)?),
                    tank: decimal(tank)? * 0.01,
                    highest_share: f32::INFINITY,
                })
            }
            _ => None,
        }
    }

    fn deliver(&mut self, report: &Report, deliver: &mut impl FnMut(SerialReading)) {
        if let Some(state) = report.state
            && self.state.has_changed(Some(state))
        {
            deliver(SerialReading::Notice(SerialNotice::FuelCellState(state)));
        }
        if self.error.has_changed(report.error) {
            deliver(SerialReading::Notice(SerialNotice::FuelCellError(report.error)));
        }
        deliver(SerialReading::GeneratorElectrical(Measurement {
            state_of_charge: report.electrical.state_of_charge.map(|share| share.min(1.0)),
            ..report.electrical
        }));
        deliver(SerialReading::GeneratorFuel(Measurement {
            contents: Contents::Fuel,
            state_of_charge: Some(report.tank.min(1.0)),
            ..Measurement::default()
        }));
    }
}

/// The sentence of 650 W and 800 W, which have neither voltage nor current.
fn small(tank: &[u8], battery: &[u8], state: &[u8], flags: &[u8]) -> Option<Report> {
    Some(Report {
        state: FuelCellState::of_code(whole(state)?),
        error: FuelCellError::of_flags(hexadecimal(flags)?),
        electrical: Measurement {
            state_of_charge: Some(decimal(battery)? * 0.01),
            ..Measurement::default()
        },
        tank: decimal(tank)? * 0.01,
        highest_share: HIGHEST_SHARE,
    })
}

/// Share of a full tank at this pressure, in bar: negative if there is no such pressure.
fn share_of_pressure(bar: f32) -> f32 {
    if bar < 0.0 {
        return bar;
    }
    ((bar - EMPTY_BAR) / (FULL_BAR - EMPTY_BAR)).max(0.0)
}

/// The battery at this voltage, and with this power into it, in watts.
fn of_battery(voltage_v: f32, power_w: f32) -> Measurement {
    Measurement {
        voltage_v: Some(voltage_v),
        current_a: (voltage_v > 0.0).then(|| -power_w / voltage_v),
        ..Measurement::default()
    }
}

/// A number with an optional sign and decimal point, of nine digits at most.
fn decimal(term: &[u8]) -> Option<f32> {
    let (sign, digits) = match term.strip_prefix(b"-") {
        Some(digits) => (-1.0, digits),
        None => (1.0, term),
    };
    let mut parts = digits.splitn(2, |byte| *byte == b'.');
    let before = whole(parts.next()?)? as f32;
    let after = match parts.next() {
        Some(digits) => whole(digits)? as f32 * fraction(digits.len())?,
        None => 0.0,
    };
    Some(sign * (before + after))
}

/// A unit of the last of this many decimals.
fn fraction(decimals: usize) -> Option<f32> {
    [1.0, 0.1, 0.01, 0.001, 0.0001].get(decimals).copied()
}

/// An unsigned number.
fn whole(term: &[u8]) -> Option<u32> {
    number(term, 10)
}

/// An unsigned number, with or without `0x`.
fn hexadecimal(term: &[u8]) -> Option<u32> {
    number(term.strip_prefix(b"0x").unwrap_or(term), 16)
}

fn number(digits: &[u8], radix: u32) -> Option<u32> {
    let mut number: u32 = 0;
    for digit in digits {
        let digit = char::from(*digit).to_digit(radix)?;
        number = number.checked_mul(radix)?.checked_add(digit)?;
    }
    (!digits.is_empty()).then_some(number)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::announce::{Announce, Severity};

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

    fn notices(readings: &[SerialReading]) -> std::vec::Vec<(String, Severity)> {
        let notice = |reading: &SerialReading| match reading {
            SerialReading::Notice(notice) => Some((notice.to_string(), notice.severity())),
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
        let full = values(&read(&mut protocol, b"<101,110,2,0>"));
        assert_eq!(full, (None, None, Some(1.0), Some(1.0)));
        for impossible in ["<111,50,2,0>", "<50,110.1,2,0>", "<-1,50,3,0x20000>"] {
            let refused = IntelligentEnergy::KINDS
                .iter()
                .map(|kind| SerialReading::Refused(*kind, ReadError::Implausible));
            let found = read(&mut protocol, impossible.as_bytes());
            assert!(found.into_iter().eq(refused), "{impossible}");
        }
        for wrong in [
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
        let notice = |text: &str, severity| (text.to_string(), severity);
        let running = [notice("Fuel cell running", Severity::Info)];
        assert_eq!(after(b"<50,50,2,0>"), running);
        assert_eq!(after(b"<50,50,2,0>"), []);
        assert_eq!(
            after(b"<50,50,3,0x20000>"),
            [
                notice("Fuel cell has failed", Severity::Warning),
                notice("Fuel cell error 0x20000", Severity::Warning),
            ]
        );
        let critical = [notice("Fuel cell error 0x80020000", Severity::Critical)];
        assert_eq!(after(b"<50,50,3,0x80020000>"), critical);
        // A flag without a meaning.
        let gone = [notice("Fuel cell: no error any more", Severity::Info)];
        assert_eq!(after(b"<50,50,3,0x1>"), gone);

        let mut protocol = fuel_cell(&FuelCell::Kilowatts2);
        let mut after = |sentence: &[u8]| notices(&read(&mut protocol, sentence));
        after(LEGACY);
        for (error, severity) in [
            (1, Severity::Info),
            (20, Severity::Warning),
            (21, Severity::Critical),
        ] {
            let sentence = format!("<300,48.7,1600,1700,100,2,{error}>");
            let expected = notice(&format!("Fuel cell error {error}"), severity);
            assert_eq!(after(sentence.as_bytes()), [expected]);
        }
        let sentence = of_protocol_4("48,6.1,49.9,1200,1300,0,-499,3,33,7,LOW PRESSURE");
        assert_eq!(
            after(&sentence),
            [
                notice("Fuel cell stopping", Severity::Info),
                notice("Fuel cell error 33.7", Severity::Critical),
            ]
        );
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
}
