//! Packs that another component of the vehicle measures, such as a companion computer.

use crate::battery::{CellVoltages, Consumed, Counted, CurrentRange, Measurement, PackDetails, Reported};
use crate::pack::Pack;
use crate::parameter::MonitorKind;
use crate::time::Instant;

/// Longest time without a reading by another component of the vehicle, in microseconds.
const EXTERNAL_TIMEOUT_US: u64 = MonitorKind::External.timeout_us();

/// A reading of a pack by another component. `None` is not reported; without a voltage there is no reading.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExternalReading {
    /// The pack.
    pub pack: Pack,
    /// Voltage between the pack's terminals, in volts.
    pub voltage_v: f32,
    /// Voltage of each cell.
    pub cells: CellVoltages,
    /// Current drawn from the pack, in amperes; negative while charging.
    pub current_a: Option<f32>,
    /// Whether the current is within the range of its field, whatever the component counts.
    pub current_range: CurrentRange,
    /// Charge drawn, as the component counts it, in milliampere-hours.
    pub consumed_mah: Option<f32>,
    /// Energy drawn, as the component counts it, in watt-hours.
    pub consumed_wh: Option<f32>,
    /// State of charge, 0 to 1.
    pub state_of_charge: Option<f32>,
    /// Temperature of the pack, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// The pack's condition, as the component reports it.
    pub reported: Reported,
    /// Time until the pack is empty, in seconds.
    pub time_remaining_s: Option<f32>,
}

/// Facts of a pack that seldom change, by the component that measures it (BATTERY_INFO). `None` is not reported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ExternalHealth {
    /// Charge cycles.
    pub cycle_count: Option<u16>,
    /// State of health, in percent.
    pub state_of_health_pct: Option<u8>,
}

/// Report of another component about a pack.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ExternalReport {
    /// A reading.
    Reading(ExternalReading),
    /// A reading without cells and time left, which a component may send beside the other one (BATTERY_STATUS_V2).
    ReadingV2(ExternalReading),
    /// The health of this pack.
    Health(Pack, ExternalHealth),
}

impl ExternalReport {
    /// The pack.
    pub fn pack(&self) -> Pack {
        match self {
            Self::Reading(reading) | Self::ReadingV2(reading) => reading.pack,
            Self::Health(pack, _) => *pack,
        }
    }
}

impl ExternalReading {
    fn counted(&self) -> Option<Counted> {
        let charge_mah = self.consumed_mah?;
        Some(match self.consumed_wh {
            Some(energy_wh) => Counted::Total(Consumed {
                charge_mah,
                energy_wh,
            }),
            None => Counted::TotalCharge(charge_mah),
        })
    }
}

impl From<&ExternalReading> for Measurement {
    fn from(reading: &ExternalReading) -> Self {
        Self {
            voltage_v: Some(reading.voltage_v),
            current_a: reading.current_a,
            current_range: match reading.consumed_mah {
                Some(_) => reading.current_range.counted(),
                None => reading.current_range,
            },
            counted: reading.counted(),
            state_of_charge: reading.state_of_charge,
            temperature_c: reading.temperature_c,
            cells: reading.cells,
            reported: reading.reported,
            time_remaining_s: reading.time_remaining_s,
            ..Self::default()
        }
    }
}

#[cfg(target_os = "none")]
impl defmt::Format for ExternalReport {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{}", self.pack());
    }
}

/// The component that measures a pack: the first that reports it, until it is lost.
#[derive(Clone, Copy, Debug, Default)]
pub struct ExternalSource {
    /// Its component id, and the readings that are taken of it.
    source: Option<(u8, Readings)>,
    /// When its latest reading was received, or the board's start.
    heard: Instant,
    health: ExternalHealth,
}

/// The readings that are taken of a component: each, or those alone that have all it reports.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Readings {
    V2,
    Complete,
}

/// Whether a component's reading counts.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Admission {
    /// The component measures the pack.
    Known,
    /// The component measures the pack from now on, as the first.
    New,
    /// The component measures the pack from now on, in place of another.
    Successor,
    /// Another component measures the pack.
    OtherSource,
    /// The component reports the pack more completely, too.
    LessComplete,
    /// The reading may have waited for too long on its way.
    TooLate,
}

impl ExternalSource {
    /// Judges a report that can't have been received before `received_at`, which is a reading.
    pub fn admit(
        &mut self,
        component_id: u8,
        report: &ExternalReport,
        received_at: Instant,
        now: Instant,
    ) -> Admission {
        if now.us_since(received_at) >= EXTERNAL_TIMEOUT_US {
            return Admission::TooLate;
        }
        let readings = match report {
            ExternalReport::ReadingV2(_) => Readings::V2,
            ExternalReport::Reading(_) | ExternalReport::Health(..) => Readings::Complete,
        };
        let admission = match self.source {
            Some((known, Readings::Complete))
                if known == component_id && readings == Readings::V2 && !self.is_lost(now) =>
            {
                return Admission::LessComplete;
            }
            Some((known, _)) if known == component_id => Admission::Known,
            Some(_) if !self.is_lost(now) => return Admission::OtherSource,
            other => {
                self.health = ExternalHealth::default();
                other.map_or(Admission::New, |_| Admission::Successor)
            }
        };
        self.source = Some((component_id, readings));
        self.heard = self.heard.max(received_at);
        admission
    }

    /// Takes what the component reports of the pack's health, if it measures the pack.
    pub fn set_health(&mut self, component_id: u8, health: ExternalHealth) {
        if self.source.is_some_and(|(known, _)| known == component_id) {
            self.health = health;
        }
    }

    /// Details of the pack as the component has reported them.
    pub fn details(&self) -> PackDetails {
        PackDetails {
            cycle_count: self.health.cycle_count,
            state_of_health_pct: self.health.state_of_health_pct,
            ..PackDetails::NONE
        }
    }

    /// Whether another component may take its place.
    fn is_lost(&self, now: Instant) -> bool {
        now.us_since(self.heard) >= EXTERNAL_TIMEOUT_US
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;
    use proptest::prelude::*;

    const FIRST: u8 = 191;
    const SECOND: u8 = 192;
    const LAST_IN_TIME_US: u64 = EXTERNAL_TIMEOUT_US - 1;

    fn reading() -> ExternalReading {
        ExternalReading {
            pack: Pack::First,
            voltage_v: 12.0,
            cells: CellVoltages::NONE,
            current_a: None,
            current_range: CurrentRange::Within,
            consumed_mah: None,
            consumed_wh: None,
            state_of_charge: None,
            temperature_c: None,
            reported: Reported::NONE,
            time_remaining_s: None,
        }
    }

    fn report() -> ExternalReport {
        ExternalReport::Reading(reading())
    }

    #[test]
    fn the_second_version_counts_unless_its_component_sends_the_first_too() {
        let mut source = ExternalSource::default();
        let mut at = |component_id, report, us| source.admit(component_id, &report, at_us(us), at_us(us));
        let (v1, v2) = (report, || ExternalReport::ReadingV2(reading()));
        assert_eq!(at(FIRST, v2(), 0), Admission::New);
        assert_eq!(at(FIRST, v2(), 1_000_000), Admission::Known);
        assert_eq!(at(FIRST, v1(), 1_500_000), Admission::Known);
        assert_eq!(at(FIRST, v2(), 1_600_000), Admission::LessComplete);
        assert_eq!(at(SECOND, v2(), 1_600_000), Admission::OtherSource);
        // It sends the second version alone from now on.
        let silent_at_us = 1_500_000 + EXTERNAL_TIMEOUT_US;
        assert_eq!(at(FIRST, v2(), silent_at_us - 1), Admission::LessComplete);
        assert_eq!(at(FIRST, v2(), silent_at_us), Admission::Known);
        assert_eq!(at(FIRST, v2(), silent_at_us + 1), Admission::Known);
    }

    #[test]
    fn first_component_is_kept_until_it_is_lost() {
        let mut source = ExternalSource::default();
        let mut at = |component_id, us| source.admit(component_id, &report(), at_us(us), at_us(us));
        assert_eq!(at(FIRST, 0), Admission::New);
        assert_eq!(at(SECOND, 0), Admission::OtherSource);
        assert_eq!(at(FIRST, LAST_IN_TIME_US), Admission::Known);
        assert_eq!(at(SECOND, EXTERNAL_TIMEOUT_US), Admission::OtherSource);
        let lost_at_us = LAST_IN_TIME_US + EXTERNAL_TIMEOUT_US;
        assert_eq!(at(SECOND, lost_at_us), Admission::Successor);
        assert_eq!(at(FIRST, lost_at_us), Admission::OtherSource);
    }

    #[test]
    fn reading_counts_from_when_it_may_have_been_received() {
        let mut source = ExternalSource::default();
        let now = at_us(10 * EXTERNAL_TIMEOUT_US);
        let late = now.before_us(EXTERNAL_TIMEOUT_US);
        assert_eq!(source.admit(FIRST, &report(), late, now), Admission::TooLate);
        assert!(source.is_lost(now));
        let in_time = now.before_us(LAST_IN_TIME_US);
        assert_eq!(source.admit(FIRST, &report(), in_time, now), Admission::New);
        assert!(!source.is_lost(now) && source.is_lost(now.after_us(1)));
        // That component by a faster link, then again by the slow one.
        assert_eq!(source.admit(FIRST, &report(), now, now), Admission::Known);
        assert_eq!(source.admit(FIRST, &report(), in_time, now), Admission::Known);
        assert!(!source.is_lost(now.after_us(LAST_IN_TIME_US)));
    }

    proptest! {
        /// However components take turns, one measures the pack at any time, and it changes only after a silence.
        #[test]
        fn source_changes_only_after_a_silence(
            steps in prop::collection::vec((1..4u8, 0..3 * EXTERNAL_TIMEOUT_US), 1..100)
        ) {
            let mut source = ExternalSource::default();
            let mut now = Instant::EPOCH;
            let mut last: Option<(u8, Instant)> = None;
            for (component_id, after_us) in steps {
                now = now.after_us(after_us);
                match source.admit(component_id, &report(), now, now) {
                    Admission::Known => prop_assert_eq!(last.map(|(known, _)| known), Some(component_id)),
                    Admission::New => prop_assert_eq!(last, None),
                    Admission::Successor => {
                        let (known, heard) = last.expect("one was heard");
                        prop_assert!(known != component_id && now.us_since(heard) >= EXTERNAL_TIMEOUT_US);
                    }
                    Admission::OtherSource => {
                        let (known, heard) = last.expect("one was heard");
                        prop_assert!(known != component_id && now.us_since(heard) < EXTERNAL_TIMEOUT_US);
                        continue;
                    }
                    Admission::TooLate | Admission::LessComplete => unreachable!("received now, complete"),
                }
                last = Some((component_id, now));
            }
        }
    }
}
