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
use super::super::frame::Gaps;
use super::super::protocol::{Baud, Line, Protocol, SerialReading, Wires};
use crate::battery::{Contents, Measurement};
use crate::sensor::MonitorKind;
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
    /// What was reported last.
    state: Option<FuelCellState>,
    error: FuelCellError,
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
            state: None,
            error: FuelCellError::NONE,
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
                if let Some(report) = self.decode() {
                    self.deliver(&report, deliver);
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

/// What a sentence says.
struct Report {
    state: Option<FuelCellState>,
    error: FuelCellError,
    electrical: Measurement,
    /// 0 to 1.
    tank: f32,
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
                    tank: (decimal(tank)? - EMPTY_BAR) / (FULL_BAR - EMPTY_BAR),
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
                })
            }
            _ => None,
        }
    }

    fn deliver(&mut self, report: &Report, deliver: &mut impl FnMut(SerialReading)) {
        if let Some(state) = report.state
            && self.state != Some(state)
        {
            self.state = Some(state);
            deliver(SerialReading::Notice(SerialNotice::FuelCellState(state)));
        }
        if self.error != report.error {
            self.error = report.error;
            deliver(SerialReading::Notice(SerialNotice::FuelCellError(report.error)));
        }
        deliver(SerialReading::GeneratorElectrical(report.electrical));
        deliver(SerialReading::GeneratorFuel(Measurement {
            contents: Contents::Fuel,
            state_of_charge: Some(report.tank.clamp(0.0, 1.0)),
            ..Measurement::default()
        }));
    }
}

/// The sentence of 650 W and 800 W, which have neither voltage nor current.
fn small(tank: &[u8], battery: &[u8], state: &[u8], flags: &[u8]) -> Option<Report> {
    let share = |term: &[u8]| decimal(term).filter(|percent| (0.0..=100.0).contains(percent));
    Some(Report {
        state: FuelCellState::of_code(whole(state)?),
        error: FuelCellError::of_flags(hexadecimal(flags)?),
        electrical: Measurement {
            state_of_charge: Some(share(battery)? * 0.01),
            ..Measurement::default()
        },
        tank: share(tank)? * 0.01,
    })
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
mod tests;
