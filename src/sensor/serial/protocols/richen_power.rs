//! RichenPower's hybrid generators, which report once a second (by ArduPilot's `AP_Generator_RichenPower`; the maker publishes no
//! description).
//!
//! | byte | content, big-endian |
//! |---|---|
//! | 0, 1 | 0xAA, 0x55 |
//! | 2 to 11 | version, running time, seconds until maintenance |
//! | 12, 13 | errors, a bit each |
//! | 14 to 19 | speed, throttle |
//! | 20, 21 | voltage, in 10 mV |
//! | 22, 23 | current, in 10 mA |
//! | 66, 67 | sum of the five words from byte 2: voltage and current are not protected |
//! | 68, 69 | 0x55, 0xAA |

use super::super::conditions::{RichenPowerErrors, SerialNotice};
use super::super::protocol::{Baud, Gaps, Line, Protocol, SerialReading, Window, Wires, centivolts};
use super::is_output;
use crate::announce::LastAnnounced;
use crate::battery::{CurrentRange, Measurement, ReadError};
use crate::parameter::MonitorKind;
use crate::time::Instant;

const FRAME_BYTES: usize = 70;
const HEADER: [u8; 2] = [0xaa, 0x55];
const FOOTER: [u8; 2] = [0x55, 0xaa];

/// Offsets of words.
const SUMMED: core::ops::Range<usize> = 2..12;
const ERRORS: usize = 12;
const VOLTAGE: usize = 20;
const CURRENT: usize = 22;
const SUM: usize = 66;

/// Idle time that ends a frame, in microseconds; a frame takes 73 ms.
const MAX_GAP_US: u64 = 200_000;

/// Frame decoder of RichenPower's telemetry.
#[derive(Clone, Copy, Debug)]
pub(in crate::sensor::serial) struct RichenPower {
    window: Window<FRAME_BYTES>,
    gaps: Gaps<MAX_GAP_US>,
    errors: LastAnnounced<RichenPowerErrors>,
}

impl Protocol for RichenPower {
    type Model = ();
    const LINE: Line = Line {
        baud: Baud::Set,
        wires: Wires::ReceiveOnly,
    };
    const KINDS: &'static [MonitorKind] = &[MonitorKind::GeneratorElectrical];
    const TIMEOUT_US: u64 = 2_000_000;

    fn new((): &()) -> Self {
        Self {
            window: Window::new(),
            gaps: Gaps::new(),
            errors: LastAnnounced::new(RichenPowerErrors(0)),
        }
    }

    fn begin(&mut self, now: Instant) {
        if self.gaps.precede(now) {
            self.window.clear();
        }
    }

    fn push(&mut self, byte: u8, _: Instant, deliver: &mut impl FnMut(SerialReading)) {
        let Some((errors, measured)) = self.window.push(byte, decode) else {
            return;
        };
        let measurement = match measured {
            Ok(measurement) => measurement,
            // The errors are not protected either.
            Err(error) => return deliver(SerialReading::Refused(MonitorKind::GeneratorElectrical, error)),
        };
        if self.errors.has_changed(errors) {
            deliver(SerialReading::Notice(SerialNotice::RichenPower(errors)));
        }
        deliver(SerialReading::GeneratorElectrical(measurement));
    }
}

fn decode(bytes: &[u8; FRAME_BYTES]) -> Option<(RichenPowerErrors, Result<Measurement, ReadError>)> {
    let word = |at: usize| Some(u16::from_be_bytes(*bytes.get(at..)?.first_chunk()?));
    let summed = bytes.get(SUMMED)?.as_chunks().0;
    let sum = summed
        .iter()
        .fold(0u16, |sum, pair| sum.wrapping_add(u16::from_be_bytes(*pair)));
    let is_frame = bytes.starts_with(&HEADER) && bytes.ends_with(&FOOTER) && word(SUM)? == sum;
    if !is_frame {
        return None;
    }
    let measured = measured(word(VOLTAGE)?, word(CURRENT)?);
    Some((RichenPowerErrors(word(ERRORS)?), measured))
}

/// Measurement of words for voltage and current.
fn measured(voltage: u16, current: u16) -> Result<Measurement, ReadError> {
    let (voltage_v, current_a) = (centivolts(voltage)?, f32::from(current) * 0.01);
    let current_range = CurrentRange::of_unsigned_word(current);
    if current_range == CurrentRange::Within && !is_output(voltage_v, current_a) {
        return Err(ReadError::Implausible);
    }
    Ok(Measurement {
        voltage_v: Some(voltage_v),
        current_a: Some(current_a),
        current_range,
        ..Measurement::default()
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::announce::{Announce, Severity};
    /// A frame of an H2's controller: 43.81 V, 0 A, low battery voltage (ArduPilot/ardupilot, a comment in
    /// libraries/AP_Generator/AP_Generator_RichenPower.cpp).
    const RECORDED: [u8; FRAME_BYTES] = {
        let mut frame = [0; FRAME_BYTES];
        let start = [
            0xaa, 0x55, 0x00, 0x0a, 0x00, 0x00, 0x00, 0x00, 0x00, 0x04, 0x1e, 0xb0, 0x00, 0x10, 0x00, 0x00,
            0x23, 0x7a, 0x23, 0x7a, 0x11, 0x1d, 0x00, 0x00, 0x00, 0x00, 0x01,
        ];
        let mut place = 0;
        while place < start.len() {
            frame[place] = start[place];
            place += 1;
        }
        [frame[66], frame[67], frame[68], frame[69]] = [0x1e, 0xbe, 0x55, 0xaa];
        frame
    };

    fn frame(errors: u16, centivolts: u16, centiamperes: u16) -> [u8; FRAME_BYTES] {
        let mut frame = RECORDED;
        frame[12..14].copy_from_slice(&errors.to_be_bytes());
        frame[20..22].copy_from_slice(&centivolts.to_be_bytes());
        frame[22..24].copy_from_slice(&centiamperes.to_be_bytes());
        frame
    }

    fn read(protocol: &mut RichenPower, bytes: &[u8]) -> Vec<SerialReading> {
        let mut readings = Vec::new();
        for byte in bytes {
            protocol.push(*byte, Instant::EPOCH, &mut |reading| readings.push(reading));
        }
        readings
    }

    fn output(voltage_v: f32, current_a: f32) -> SerialReading {
        SerialReading::GeneratorElectrical(Measurement {
            voltage_v: Some(voltage_v),
            current_a: Some(current_a),
            ..Measurement::default()
        })
    }

    fn texts(readings: &[SerialReading]) -> Vec<String> {
        let text = |reading: &SerialReading| match reading {
            SerialReading::Notice(notice) => Some(notice.to_string()),
            _ => None,
        };
        readings.iter().filter_map(text).collect()
    }

    #[test]
    fn recorded_frame_has_voltage_current_and_an_error() {
        let readings = read(&mut RichenPower::new(&()), &RECORDED);
        assert_eq!(texts(&readings), ["Generator: low battery voltage"]);
        assert_eq!(readings[1..], [output(4381.0 * 0.01, 0.0)]);
        let readings = read(&mut RichenPower::new(&()), &frame(0, 4995, 1234));
        assert_eq!(readings, [output(4995.0 * 0.01, 1234.0 * 0.01)]);
    }

    #[test]
    fn errors_are_reported_when_they_change() {
        let mut protocol = RichenPower::new(&());
        for (errors, expected) in [
            (0, None),
            (0b1, Some(("Generator: maintenance required", Severity::Info))),
            (0b1, None),
            (
                0b1101,
                Some((
                    "Generator: maintenance required, overload, low output voltage",
                    Severity::Warning,
                )),
            ),
            (0x8000, Some(("Generator: error 15", Severity::Warning))),
            (0, Some(("Generator: no error any more", Severity::Info))),
            (0, None),
        ] {
            let readings = read(&mut protocol, &frame(errors, 5000, 0));
            let notice = match readings[0] {
                SerialReading::Notice(notice) => Some((notice.to_string(), notice.severity())),
                _ => None,
            };
            let expected = expected.map(|(text, severity)| (text.to_string(), severity));
            assert_eq!(notice, expected, "{errors:#x}");
        }
    }
}
