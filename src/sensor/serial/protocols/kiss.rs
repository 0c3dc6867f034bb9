//! Telemetry of a motor controller in the format of KISS and BLHeli_32, which it sends by itself.
//!
//! | byte | content, big-endian |
//! |---|---|
//! | 0 | temperature, in °C; from 216 on as −40 |
//! | 1, 2 | voltage, in 10 mV |
//! | 3, 4 | current, in 10 mA |
//! | 5, 6 | charge drawn, in mAh |
//! | 7, 8 | electrical speed, in 100 rpm |
//! | 9 | CRC-8 of the others, polynomial 0x07, as SMBus |

use super::super::protocol::{Baud, Gaps, Line, Protocol, SerialReading, Window, Wires, centivolts};
use crate::battery::CurrentRange;
use crate::parameter::MonitorKind;
use crate::sensor::ControllerReading;
use crate::time::Instant;

const FRAME_BYTES: usize = 10;

/// Idle time that ends a frame, in microseconds; a frame takes 0.9 ms.
const MAX_GAP_US: u64 = 5_000;

/// Maximum plausible increment between two frames; a larger one is a restarted counter.
const MAX_STEP_MAH: u16 = 5_000;

/// From here on a temperature is below zero: the lowest possible one is −40 °C.
const BELOW_ZERO: u8 = 216;

/// Frame decoder of a controller's telemetry.
#[derive(Clone, Copy, Debug)]
pub(in crate::sensor::serial) struct Kiss {
    window: Window<FRAME_BYTES>,
    gaps: Gaps<MAX_GAP_US>,
    /// Charge counter of the previous frame.
    counted_mah: Option<u16>,
}

impl Protocol for Kiss {
    type Model = ();
    const LINE: Line = Line {
        baud: Baud::Fixed(115_200),
        wires: Wires::ReceiveOnly,
    };
    const KINDS: &'static [MonitorKind] = &[MonitorKind::Esc];

    fn new((): &()) -> Self {
        Self {
            window: Window::new(),
            gaps: Gaps::new(),
            counted_mah: None,
        }
    }

    fn begin(&mut self, now: Instant) {
        if self.gaps.precede(now) {
            self.window.clear();
        }
    }

    fn push(&mut self, byte: u8, _: Instant, deliver: &mut impl FnMut(SerialReading)) {
        if let Some(reading) = self.take(byte) {
            deliver(SerialReading::Controller(reading));
        }
    }
}

impl Kiss {
    /// Takes a byte, and returns the reading if it completes a frame.
    fn take(&mut self, byte: u8) -> Option<ControllerReading> {
        let [temperature_c, v1, v0, c1, c0, q1, q0, ..] = self.window.push(byte, valid)?;
        let current = u16::from_be_bytes([c1, c0]);
        Some(ControllerReading {
            voltage_v: centivolts(u16::from_be_bytes([v1, v0])).ok(),
            current_a: Some(f32::from(current) * 0.01),
            current_range: CurrentRange::of_unsigned_word(current),
            temperature_c: Some(celsius(temperature_c)),
            drawn_mah: self.drawn_mah(u16::from_be_bytes([q1, q0])),
        })
    }

    /// Increment of the controller's charge counter since the previous frame, which includes missed ones. `None` at 0: the
    /// controller may not have a counter.
    fn drawn_mah(&mut self, counted_mah: u16) -> Option<f32> {
        let before_mah = self.counted_mah.replace(counted_mah).unwrap_or(counted_mah);
        let step_mah = counted_mah.wrapping_sub(before_mah);
        let drawn_mah = if step_mah <= MAX_STEP_MAH { step_mah } else { 0 };
        (counted_mah > 0).then(|| f32::from(drawn_mah))
    }
}

/// Temperature, in degrees Celsius: below zero as a byte with a sign.
fn celsius(byte: u8) -> f32 {
    match byte {
        ..BELOW_ZERO => byte.into(),
        BELOW_ZERO.. => byte.cast_signed().into(),
    }
}

/// The frame, if it is valid. All zeros, a line held low, have a valid CRC, but a voltage of zero is impossible.
fn valid(frame: &[u8; FRAME_BYTES]) -> Option<[u8; FRAME_BYTES]> {
    let (crc, checked) = frame.split_last()?;
    let [_, v1, v0, ..] = *frame;
    (smbus_pec::pec(checked) == *crc && [v1, v0] != [0, 0]).then_some(*frame)
}

#[cfg(test)]
mod tests {
    use super::*;
    fn sealed(body: [u8; FRAME_BYTES - 1]) -> [u8; FRAME_BYTES] {
        let mut frame = [0; FRAME_BYTES];
        frame[..FRAME_BYTES - 1].copy_from_slice(&body);
        frame[FRAME_BYTES - 1] = smbus_pec::pec(&body);
        frame
    }

    /// 38 °C, 15.76 V, 12.34 A, 1000 rpm.
    fn frame(counted_mah: u16) -> [u8; FRAME_BYTES] {
        let [q1, q0] = counted_mah.to_be_bytes();
        sealed([38, 0x06, 0x28, 0x04, 0xd2, q1, q0, 0, 10])
    }

    fn read(telemetry: &mut Kiss, bytes: &[u8]) -> Vec<ControllerReading> {
        bytes.iter().filter_map(|byte| telemetry.take(*byte)).collect()
    }

    #[test]
    fn frame_has_temperature_voltage_current_and_charge() {
        let mut telemetry = Kiss::new(&());
        // 25 °C, 16.80 V, 12.34 A, 300 mAh; CRC computed by hand from the polynomial.
        let before = [0x19, 0x06, 0x90, 0x04, 0xd2, 0x01, 0x2c, 0x00, 0x64, 0x97];
        assert_eq!(read(&mut telemetry, &before)[0].drawn_mah, Some(0.0));
        let [reading] = read(&mut telemetry, &frame(303))[..] else {
            panic!("one frame");
        };
        assert_eq!(reading.temperature_c, Some(38.0));
        assert!((reading.voltage_v.unwrap() - 15.76).abs() < 1e-4);
        assert!((reading.current_a.unwrap() - 12.34).abs() < 1e-4);
        assert_eq!(reading.drawn_mah, Some(3.0));
    }

    #[test]
    fn counter_may_wrap_and_a_restart_counts_nothing() {
        let mut telemetry = Kiss::new(&());
        for (counted_mah, drawn_mah) in [
            (65_530, Some(0.0)),
            (4, Some(10.0)),
            (1500, Some(1496.0)),
            (2, Some(0.0)),
            (3, Some(1.0)),
            (50_000, Some(0.0)),
            (50_001, Some(1.0)),
            (0, None),
        ] {
            let readings = read(&mut telemetry, &frame(counted_mah));
            assert_eq!(readings[0].drawn_mah, drawn_mah, "{counted_mah}");
        }
    }
}
