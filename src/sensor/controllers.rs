//! Motor controllers: several may measure a pack together.

use crate::battery::{Consumed, Counted, CurrentRange, Measurement, Thermometer};
use crate::numbers::mean;
use crate::parameter::{BatteryParameter, MAX_CONTROLLERS, PackParameters};
use crate::time::Instant;

/// A controller that has been silent for this long has dropped out, in microseconds: as long as a pack without a reading
/// stays healthy. ArduPilot waits for 5 s, and counts on with the current of the others.
const LOST_AFTER_US: u64 = 500_000;

/// A motor controller's reading. `None` is not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControllerReading {
    /// Voltage at its supply, in volts.
    pub voltage_v: Option<f32>,
    /// Current drawn from the pack, in amperes.
    pub current_a: Option<f32>,
    /// Whether the current is within its sensor's range, whatever the controller counts.
    pub current_range: CurrentRange,
    /// Temperature, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Charge drawn since its previous reading, in milliampere-hours, by a counter of its own.
    pub drawn_mah: Option<f32>,
}

impl ControllerReading {
    /// Charge and energy drawn since its previous reading.
    fn drawn(&self) -> Option<Consumed> {
        let charge_mah = self.drawn_mah?;
        Some(Consumed {
            charge_mah,
            energy_wh: charge_mah * 1e-3 * self.voltage_v.unwrap_or_default(),
        })
    }
}

/// The motor controllers that supply a pack's measurement (`BATT_ESC_MASK`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Members {
    /// All that were heard since the start.
    All,
    /// These, one bit each from bit 0.
    Mask(u16),
}

impl Members {
    /// From the live parameters of a pack.
    pub fn from_parameters(pack: PackParameters<'_>) -> Self {
        match pack.get_whole(BatteryParameter::EscMask) as u16 {
            0 => Self::All,
            mask => Self::Mask(mask),
        }
    }

    fn contains(self, index: usize) -> bool {
        match self {
            Self::All => true,
            Self::Mask(mask) => mask >> index & 1 != 0,
        }
    }
}

/// The latest reading of each motor controller, by its index.
#[derive(Clone, Copy, Debug, Default)]
pub struct ControllerBank {
    latest: [Option<Latest>; MAX_CONTROLLERS],
}

#[derive(Clone, Copy, Debug)]
struct Latest {
    reading: ControllerReading,
    received: Instant,
}

impl Latest {
    /// Whether this controller counts charge; one that never reported is not known to.
    fn has_counter(latest: Option<&Self>) -> bool {
        latest.is_some_and(|latest| latest.reading.drawn_mah.is_some())
    }

    fn is_lost(&self, now: Instant) -> bool {
        now.us_since(self.received) >= LOST_AFTER_US
    }
}

impl ControllerBank {
    /// Takes a controller's reading. One beyond the last index belongs to no pack.
    pub fn add(&mut self, index: u8, reading: ControllerReading, now: Instant) {
        if let Some(latest) = self.latest.get_mut(usize::from(index)) {
            let received = now;
            *latest = Some(Latest { reading, received });
        }
    }

    /// Measurement of all members when the controller `reporting` has just reported: mean voltage, sum of the
    /// currents with the worst of their ranges, mean temperature, and what that controller has drawn. `None` if it is not one of them.
    ///
    /// The current is unknown while a member is lost. The charge is counted only if every member has a counter, whose
    /// difference includes a time in which it was lost; else the current has to be integrated.
    pub fn measure(&self, members: Members, reporting: u8, now: Instant) -> Option<Measurement> {
        let reporting = usize::from(reporting);
        let reported = self.latest.get(reporting)?.as_ref()?;
        if !members.contains(reporting) {
            return None;
        }
        let present = || {
            self.members(members)
                .flatten()
                .filter(|latest| !latest.is_lost(now))
        };
        let readings = || present().map(|latest| &latest.reading);
        // One that does not measure its supply may report 0 V.
        let voltages = || readings().filter_map(|reading| reading.voltage_v);
        let all_count = self.members(members).all(Latest::has_counter);
        let ranges = readings().map(|reading| reading.current_range);
        let worst = ranges.max().unwrap_or_default();
        Some(Measurement {
            voltage_v: mean(voltages().filter(|voltage_v| *voltage_v > 0.0)).or(voltages().next()),
            current_a: self.current_a(members, now),
            current_range: if all_count { worst.counted() } else { worst },
            counted: reported
                .reading
                .drawn()
                .filter(|_| all_count)
                .map(Counted::Increment),
            temperature_c: mean(
                readings().filter_map(|reading| Thermometer::Device.possible_c(reading.temperature_c)),
            ),
            thermometer: Thermometer::Device,
            ..Measurement::default()
        })
    }

    /// The controllers that are expected to report: of a mask all, else those that were heard.
    fn members(&self, members: Members) -> impl Iterator<Item = Option<&Latest>> {
        let indexed = self.latest.iter().enumerate();
        let chosen = indexed.filter(move |(index, latest)| match members {
            Members::All => latest.is_some(),
            Members::Mask(_) => members.contains(*index),
        });
        chosen.map(|(_, latest)| latest.as_ref())
    }

    /// The sum of the currents; unknown unless that of every member is.
    fn current_a(&self, members: Members, now: Instant) -> Option<f32> {
        let current_a = |latest: Option<&Latest>| {
            let present = latest.filter(|latest| !latest.is_lost(now))?;
            present.reading.current_a
        };
        self.members(members).map(current_a).sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;
    use proptest::prelude::*;

    const FIRST_TWO: Members = Members::Mask(0b11);

    fn reading(voltage_v: f32, current_a: f32, drawn_mah: Option<f32>) -> ControllerReading {
        ControllerReading {
            voltage_v: Some(voltage_v),
            current_a: Some(current_a),
            current_range: CurrentRange::Within,
            temperature_c: Some(voltage_v * 2.0),
            drawn_mah,
        }
    }

    fn drawn(charge_mah: f32, energy_wh: f32) -> Option<Counted> {
        Some(Counted::Increment(Consumed {
            charge_mah,
            energy_wh,
        }))
    }

    /// Controllers 0 and 1 reported now.
    fn two() -> ControllerBank {
        let mut bank = ControllerBank::default();
        bank.add(0, reading(12.0, 3.0, Some(4000.0)), Instant::EPOCH);
        bank.add(1, reading(11.0, 2.0, Some(1000.0)), Instant::EPOCH);
        bank
    }

    #[test]
    // Requirement: AP-10
    fn voltages_and_temperatures_are_averaged_and_currents_added_up() {
        for members in [Members::All, FIRST_TWO] {
            let measurement = two().measure(members, 1, Instant::EPOCH).unwrap();
            assert_eq!(measurement.voltage_v, Some(11.5));
            assert_eq!(measurement.current_a, Some(5.0));
            assert_eq!(measurement.temperature_c, Some(23.0));
            assert_eq!(
                measurement.counted,
                drawn(1000.0, 11.0),
                "only of the one that reports"
            );
        }
    }

    #[test]
    fn no_voltage_of_a_controller_counts_only_if_no_other_has_one() {
        for (voltages_v, expected) in [
            ([Some(0.0), Some(12.0)], Some(12.0)),
            ([Some(12.0), Some(0.0)], Some(12.0)),
            ([None, Some(12.0)], Some(12.0)),
            ([Some(0.0), Some(0.0)], Some(0.0)),
            ([Some(0.0), None], Some(0.0)),
            ([None, None], None),
        ] {
            let mut bank = ControllerBank::default();
            for (index, voltage_v) in (0..).zip(voltages_v) {
                let reading = ControllerReading {
                    voltage_v,
                    ..reading(12.0, 3.0, None)
                };
                bank.add(index, reading, Instant::EPOCH);
            }
            let measure = |reporting| bank.measure(Members::All, reporting, Instant::EPOCH).unwrap();
            for reporting in [0, 1] {
                assert_eq!(measure(reporting).voltage_v, expected, "{voltages_v:?}");
                assert_eq!(measure(reporting).current_a, Some(6.0));
            }
        }
        // The other one is lost.
        let mut bank = two();
        bank.add(0, reading(0.0, 3.0, None), at_us(LOST_AFTER_US));
        let alone = bank.measure(Members::All, 0, at_us(LOST_AFTER_US)).unwrap();
        assert_eq!(alone.voltage_v, Some(0.0));
    }

    #[test]
    fn current_is_unknown_while_that_of_a_member_is_and_the_voltage_stays() {
        let mut bank = two();
        let mut after_0_reports = |current_a| {
            let reading = ControllerReading {
                current_a,
                ..reading(12.0, 0.0, None)
            };
            bank.add(0, reading, Instant::EPOCH);
            let measured = bank.measure(Members::All, 0, Instant::EPOCH).unwrap();
            (measured.voltage_v, measured.current_a)
        };
        assert_eq!(after_0_reports(Some(3.0)), (Some(11.5), Some(5.0)));
        assert_eq!(after_0_reports(None), (Some(11.5), None));
        assert_eq!(after_0_reports(Some(4.0)), (Some(11.5), Some(6.0)));
    }

    #[test]
    // Requirement: S-3
    fn a_sum_with_a_current_over_range_is_over_range_unless_all_are_counted() {
        use CurrentRange::{Over, OverAndCounted, Within};
        for (first, second, drawn_mah, expected) in [
            (Within, Within, None, Within),
            (Over, Within, None, Over),
            (Within, Over, None, Over),
            (Within, Over, Some(1.0), OverAndCounted),
        ] {
            let mut bank = ControllerBank::default();
            for (index, current_range, drawn_mah) in [(0, first, Some(1.0)), (1, second, drawn_mah)] {
                let reading = ControllerReading {
                    current_range,
                    ..reading(12.0, 3.0, drawn_mah)
                };
                bank.add(index, reading, Instant::EPOCH);
            }
            for reporting in [0, 1] {
                let sum = bank.measure(Members::All, reporting, Instant::EPOCH).unwrap();
                assert_eq!(
                    sum.current_range, expected,
                    "{first:?}, {second:?}, {drawn_mah:?}"
                );
            }
            let first_alone = bank.measure(Members::Mask(1), 0, Instant::EPOCH).unwrap();
            assert_eq!(
                first_alone.current_range,
                first.counted(),
                "the other is no member"
            );
        }
    }

    #[test]
    fn a_broken_thermometer_has_no_part_in_the_mean() {
        for broken_c in [-41.0, 201.0, 1e6, f32::NAN] {
            let mut bank = two();
            let broken = ControllerReading {
                temperature_c: Some(broken_c),
                ..reading(11.0, 2.0, None)
            };
            bank.add(1, broken, Instant::EPOCH);
            let measurement = bank.measure(Members::All, 0, Instant::EPOCH).unwrap();
            assert_eq!(measurement.temperature_c, Some(24.0), "{broken_c}");
        }
    }

    #[test]
    fn mask_selects_controllers() {
        let bank = two();
        let second = bank.measure(Members::Mask(0b10), 1, Instant::EPOCH).unwrap();
        assert_eq!((second.voltage_v, second.current_a), (Some(11.0), Some(2.0)));
        assert_eq!(bank.measure(Members::Mask(0b10), 0, Instant::EPOCH), None);
        assert_eq!(
            bank.measure(Members::All, 2, Instant::EPOCH),
            None,
            "it never reported"
        );
    }

    #[test]
    fn current_is_unknown_while_a_member_is_lost() {
        let mut bank = two();
        let mut after = |us| {
            bank.add(0, reading(12.0, 3.0, Some(4000.0)), at_us(us));
            bank.measure(Members::All, 0, at_us(us)).unwrap()
        };
        assert_eq!(after(LOST_AFTER_US - 1).current_a, Some(5.0));
        let lost = after(LOST_AFTER_US);
        assert_eq!((lost.voltage_v, lost.current_a), (Some(12.0), None));
        assert_eq!(lost.counted, drawn(4000.0, 48.0), "its own counter goes on");
        bank.add(1, reading(11.0, 2.0, None), at_us(2 * LOST_AFTER_US));
        bank.add(0, reading(12.0, 3.0, Some(1000.0)), at_us(2 * LOST_AFTER_US));
        let back = bank.measure(Members::All, 0, at_us(2 * LOST_AFTER_US)).unwrap();
        assert_eq!(back.current_a, Some(5.0));
    }

    #[test]
    fn only_a_mask_expects_a_controller_that_never_reported() {
        let mut bank = ControllerBank::default();
        bank.add(0, reading(12.0, 3.0, None), Instant::EPOCH);
        let measure = |members| bank.measure(members, 0, Instant::EPOCH).unwrap().current_a;
        assert_eq!(measure(Members::All), Some(3.0));
        assert_eq!(measure(Members::Mask(0b01)), Some(3.0));
        assert_eq!(measure(FIRST_TWO), None);
    }

    #[test]
    fn charge_is_counted_only_if_every_member_counts_it() {
        let mut bank = two();
        bank.add(1, reading(11.0, 2.0, None), Instant::EPOCH);
        for now in [Instant::EPOCH, at_us(LOST_AFTER_US)] {
            bank.add(0, reading(12.0, 3.0, Some(2000.0)), now);
            let counted = |members| bank.measure(members, 0, now).unwrap().counted;
            assert_eq!(
                counted(FIRST_TWO),
                None,
                "the current is integrated once it is known"
            );
            assert_eq!(counted(Members::Mask(0b1)), drawn(2000.0, 24.0));
            assert_eq!(counted(Members::Mask(0b101)), None, "the third never reported");
        }
    }

    proptest! {
        /// Whatever comes, a known current is the sum of the latest currents of all that reported.
        #[test]
        fn known_current_is_that_of_all(
            reports in prop::collection::vec((0..16u8, 0..100u8, 0..300_000u64), 1..60),
        ) {
            let mut bank = ControllerBank::default();
            let mut latest = std::collections::BTreeMap::new();
            let mut now = Instant::EPOCH;
            for (index, current_a, after_us) in reports {
                now = now.after_us(after_us);
                let current_a = f32::from(current_a);
                bank.add(index, reading(12.0, current_a, None), now);
                let measured = bank.measure(Members::All, index, now);
                if usize::from(index) >= MAX_CONTROLLERS {
                    prop_assert_eq!(measured, None);
                    continue;
                }
                latest.insert(index, (current_a, now));
                let is_complete = latest.values().all(|(_, at)| now.us_since(*at) < LOST_AFTER_US);
                let sum_a: f32 = latest.values().map(|(current_a, _)| current_a).sum();
                prop_assert_eq!(measured.unwrap().current_a, is_complete.then_some(sum_a));
            }
        }
    }
}
