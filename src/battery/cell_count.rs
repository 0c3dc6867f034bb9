//! How many cells a pack has in series.

use super::chemistry::Chemistry;
use super::event::PackEvent;
use super::rest::Rest;

/// Resting voltages of packs of lithium cells that can be told apart: cells, from, to, in volts. Two cells that are full
/// and three that are nearly empty are not told apart between 8.7 and 9.0 V, and from four cells on the ranges overlap.
const DETECTABLE: [(u8, f32, f32); 3] = [(1, 2.5, 4.35), (2, 5.0, 8.7), (3, 9.0, 13.05)];

/// Finds the number of cells once, from the voltage at rest.
#[derive(Clone, Copy, Debug)]
pub(super) struct CellCount {
    detected: Detected,
    rest: Rest,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Detected {
    NotYet,
    Unclear,
    Found(u8),
}

impl CellCount {
    pub const fn new() -> Self {
        Self {
            detected: Detected::NotYet,
            rest: Rest::new(),
        }
    }

    /// What was found.
    pub fn found(&self) -> Option<u8> {
        match self.detected {
            Detected::Found(count) => Some(count),
            Detected::NotYet | Detected::Unclear => None,
        }
    }

    /// What was found before a restart of the firmware.
    pub fn restore(&mut self, count: u8) {
        self.detected = Detected::Found(count);
    }

    /// Takes a reading, and tells when it settles the question.
    pub fn update(
        &mut self,
        dt_s: f32,
        voltage_v: f32,
        current_a: Option<f32>,
        chemistry: Chemistry,
    ) -> Option<PackEvent> {
        if self.detected != Detected::NotYet {
            return None;
        }
        let resting_v = self.rest.update(dt_s, voltage_v, current_a)?;
        match cells_at(resting_v, chemistry) {
            Some(count) => {
                self.detected = Detected::Found(count);
                Some(PackEvent::CellsDetected { count })
            }
            None => {
                self.detected = Detected::Unclear;
                Some(PackEvent::CellsUnclear { voltage_v: resting_v })
            }
        }
    }
}

fn cells_at(resting_v: f32, chemistry: Chemistry) -> Option<u8> {
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

    /// What is found in 5 s at 10 Hz of this voltage and current.
    fn found(chemistry: Chemistry, current_a: Option<f32>, at: impl Fn(f32) -> f32) -> Vec<PackEvent> {
        let mut cells = CellCount::new();
        (0..50)
            .filter_map(|sample| cells.update(0.1, at(sample as f32 / 10.0), current_a, chemistry))
            .collect()
    }

    #[test]
    fn packs_of_up_to_three_cells_are_told_apart_at_rest() {
        for (voltage_v, count) in [
            (3.7, 1),
            (4.2, 1),
            (6.4, 2),
            (8.4, 2),
            (8.7, 2),
            (9.0, 3),
            (11.1, 3),
            (12.6, 3),
        ] {
            let events = found(Chemistry::LiPo, None, |_| voltage_v);
            assert_eq!(events, [PackEvent::CellsDetected { count }], "{voltage_v} V");
        }
    }

    #[test]
    fn between_them_and_above_it_is_said_to_be_unclear() {
        for voltage_v in [4.7, 8.85, 14.8, 25.2] {
            let events = found(Chemistry::LiIon, None, |_| voltage_v);
            assert!(
                matches!(events[..], [PackEvent::CellsUnclear { .. }]),
                "{voltage_v} V"
            );
        }
    }

    #[test]
    fn nothing_is_found_under_load_or_while_the_voltage_moves() {
        assert_eq!(found(Chemistry::LiPo, Some(3.0), |_| 11.1), []);
        assert_eq!(found(Chemistry::LiPo, None, |t_s| 12.6 - 0.2 * t_s), []);
    }

    #[test]
    fn flat_curves_do_not_tell() {
        for chemistry in [Chemistry::LiFe, Chemistry::NiMh] {
            let events = found(chemistry, None, |_| 9.9);
            assert!(matches!(events[..], [PackEvent::CellsUnclear { .. }]));
        }
    }
}
