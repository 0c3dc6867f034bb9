//! Detection of rest, no load and a stable voltage, and of the number of cells by the voltage at rest.

use crate::chemistry::Chemistry;
use crate::event::PackEvent;
use crate::low_pass::LowPass;

/// Minimum duration of a stable voltage, in seconds.
const MIN_REST_S: f32 = 2.0;

/// Maximum change of a resting voltage, in volts: the noise after filtering.
const REST_BAND_V: f32 = 0.02;

const TIME_CONSTANT_S: f32 = 0.3;

/// Maximum current at rest, in amperes: the offset of an analog sensor and the board's own consumption.
pub const RESTING_CURRENT_A: f32 = 0.5;

/// Detects rest by the duration of a stable voltage.
#[derive(Clone, Copy, Debug)]
pub struct Rest {
    voltage: LowPass,
    reference_v: f32,
    duration_s: f32,
}

impl Rest {
    pub const fn new() -> Self {
        Self {
            voltage: LowPass::new(TIME_CONSTANT_S),
            reference_v: 0.0,
            duration_s: 0.0,
        }
    }

    /// Starts over with the next reading.
    pub fn reset(&mut self) {
        self.voltage.reset();
        self.duration_s = 0.0;
    }

    /// Processes a reading, and returns the voltage if the pack is at rest. A gap of [`MIN_REST_S`] between readings
    /// restarts the detection.
    pub fn update(&mut self, dt_s: f32, voltage_v: f32, current_a: Option<f32>) -> Option<f32> {
        let is_first = self.voltage.value().is_none();
        let filtered_v = self.voltage.update(dt_s, voltage_v);
        let is_loaded = current_a.is_some_and(|current_a| current_a.abs() > RESTING_CURRENT_A);
        if is_first || is_loaded || dt_s >= MIN_REST_S || (filtered_v - self.reference_v).abs() > REST_BAND_V
        {
            self.reference_v = filtered_v;
            self.duration_s = 0.0;
        } else {
            self.duration_s += dt_s;
        }
        self.voltage_v()
    }

    /// The voltage, if the pack is at rest.
    pub fn voltage_v(&self) -> Option<f32> {
        self.voltage.value().filter(|_| self.duration_s >= MIN_REST_S)
    }
}

/// Unambiguous resting voltages of lithium packs: cells, lowest, highest, in volts. From 8.7 to 9.0 V a pack may have
/// two full or three nearly empty cells, and from four cells on the ranges overlap.
const DETECTABLE: [(u8, f32, f32); 3] = [(1, 2.5, 4.35), (2, 5.0, 8.7), (3, 9.0, 13.05)];

/// Detects the number of cells once, from the voltage at rest. While it is unclear, each later rest may show it.
#[derive(Clone, Copy, Debug)]
pub struct CellCount {
    detected: Detected,
    /// The pack has rested above fewer full cells.
    least: u8,
    /// The voltage at the latest rest until they were detected, in volts.
    voltage_v: f32,
    rest: Rest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Detected {
    Pending,
    Ambiguous,
    Cells(u8),
    /// They may be more that are deeply discharged: as many as the pack had before.
    Doubtful(u8),
}

impl CellCount {
    pub const fn new() -> Self {
        Self {
            detected: Detected::Pending,
            least: 0,
            voltage_v: 0.0,
            rest: Rest::new(),
        }
    }

    /// The number of cells, once detected and not in doubt.
    pub fn cells(&self) -> Option<u8> {
        match self.detected {
            Detected::Cells(count) => Some(count),
            Detected::Pending | Detected::Ambiguous | Detected::Doubtful(_) => None,
        }
    }

    /// Whether the detected cells may be fewer than there are.
    pub fn is_doubtful(&self) -> bool {
        matches!(self.detected, Detected::Doubtful(_))
    }

    /// The fewest cells that the pack may have by its voltages at rest.
    pub fn least(&self) -> u8 {
        self.least
    }

    /// Takes over the number detected before a restart of the firmware, if it was, and the least one.
    pub fn restore(&mut self, count: Option<u8>, least: u8) {
        self.detected = count.map_or(Detected::Pending, Detected::Cells);
        self.least = least;
    }

    /// Takes a reading, with the number of cells that the pack had before, if that is known. Returns an event when
    /// detection ends, and when a doubt begins or ends.
    pub fn update(
        &mut self,
        dt_s: f32,
        voltage_v: f32,
        current_a: Option<f32>,
        chemistry: Chemistry,
        known: Option<u8>,
    ) -> Option<PackEvent> {
        let (before, cells_before) = (self.detected, self.cells());
        if !matches!(before, Detected::Cells(_))
            && let Some(resting_v) = self.rest.update(dt_s, voltage_v, current_a)
        {
            self.rest_at(resting_v, chemistry);
        }
        if let Detected::Cells(count) | Detected::Doubtful(count) = self.detected {
            let least_v = |known: u8| f32::from(known) * chemistry.cell().min_v;
            let is_doubtful = known.is_some_and(|known| known > count && self.voltage_v >= least_v(known));
            self.detected = if is_doubtful {
                Detected::Doubtful(count)
            } else if before == Detected::Doubtful(count) && least_cells(voltage_v) > count {
                // Charged since then: the next rest shows it.
                Detected::Pending
            } else {
                Detected::Cells(count)
            };
        }
        let has_ended = before == Detected::Pending && self.detected != before;
        if !has_ended && self.cells() == cells_before {
            return None;
        }
        Some(match self.cells() {
            Some(count) => PackEvent::CellsDetected { count },
            None => PackEvent::CellsAmbiguous {
                voltage_v: self.voltage_v,
            },
        })
    }

    fn rest_at(&mut self, resting_v: f32, chemistry: Chemistry) {
        self.voltage_v = resting_v;
        self.least = self.least.max(least_cells(resting_v));
        let fitting = cells_at_rest(resting_v, chemistry).filter(|count| *count >= self.least);
        self.detected = match (fitting, self.detected) {
            (Some(count), _) => Detected::Cells(count),
            (None, Detected::Doubtful(count)) => Detected::Doubtful(count),
            (None, _) => Detected::Ambiguous,
        };
    }
}

/// The fewest cells with this voltage: it is above that of fewer full ones.
fn least_cells(voltage_v: f32) -> u8 {
    let exceeded = DETECTABLE.into_iter().filter(|(.., to_v)| voltage_v > *to_v);
    1 + exceeded.count() as u8
}

fn cells_at_rest(resting_v: f32, chemistry: Chemistry) -> Option<u8> {
    match chemistry {
        Chemistry::LiPo | Chemistry::LiIon => DETECTABLE
            .into_iter()
            .find(|(_, from_v, to_v)| (*from_v..=*to_v).contains(&resting_v))
            .map(|(count, ..)| count),
        Chemistry::LiFe | Chemistry::NiMh => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gap_before_the_first_reading_is_not_rest() {
        let mut rest = Rest::new();
        rest.update(0.0, 11.5, None);
        rest.reset();
        // The previous reading was 1.5 s ago, at the same voltage.
        assert_eq!(rest.update(1.5, 11.5, None), None);
        assert_eq!(rest.update(1.0, 11.5, None), None);
        assert_eq!(rest.update(1.0, 11.5, None), Some(11.5));
    }

    /// The events in 5 s at 10 Hz of this voltage and current.
    fn events(chemistry: Chemistry, current_a: Option<f32>, at: impl Fn(f32) -> f32) -> Vec<PackEvent> {
        let mut cells = CellCount::new();
        (0..50)
            .filter_map(|sample| cells.update(0.1, at(sample as f32 / 10.0), current_a, chemistry, None))
            .collect()
    }

    #[test]
    fn one_to_three_cells_are_detected_at_rest_unless_their_voltage_is_ambiguous() {
        use Chemistry::{LiFe, LiIon, LiPo, NiMh};
        for (chemistry, voltage_v, count) in [
            (LiPo, 3.7, Some(1)),
            (LiPo, 4.2, Some(1)),
            (LiIon, 4.7, None),
            (LiPo, 6.4, Some(2)),
            (LiPo, 8.7, Some(2)),
            (LiIon, 8.85, None),
            (LiPo, 9.0, Some(3)),
            (LiPo, 12.6, Some(3)),
            (LiIon, 14.8, None),
            (LiIon, 25.2, None),
            // Flat curves.
            (LiFe, 9.9, None),
            (NiMh, 9.9, None),
        ] {
            let expected = match count {
                Some(count) => PackEvent::CellsDetected { count },
                None => PackEvent::CellsAmbiguous { voltage_v },
            };
            assert_eq!(
                events(chemistry, None, |_| voltage_v),
                [expected],
                "{chemistry:?}"
            );
        }
    }

    #[test]
    fn no_detection_under_load_or_at_a_changing_voltage() {
        assert_eq!(events(Chemistry::LiPo, Some(3.0), |_| 11.1), []);
        assert_eq!(events(Chemistry::LiPo, None, |t_s| 12.6 - 0.2 * t_s), []);
    }
}
