//! What is announced of the CAN bus's controller.

use crate::sensor::{CanInterrupt, CanReport, CanState, CanStatus};
use crate::time::Instant;

/// A bus that works and fails in turns is announced no more often.
const ANNOUNCEMENT_INTERVAL_US: u64 = 10_000_000;

/// What was announced of the controller.
#[derive(Debug)]
pub(super) struct CanWatch {
    announced: CanStatus,
    /// When the state was announced last.
    announced_at: Option<Instant>,
}

impl CanWatch {
    pub fn new() -> Self {
        Self {
            announced: CanStatus::STARTING,
            announced_at: None,
        }
    }

    /// What is news of `status`, if it may be announced yet.
    pub fn news(&mut self, status: &CanStatus, now: Instant) -> Option<CanReport> {
        let is_too_soon = |at| now.us_since(at) < ANNOUNCEMENT_INTERVAL_US;
        if self.announced_at.is_some_and(is_too_soon) {
            return None;
        }
        let report = self.difference(status)?;
        // The first time that everything works is expected.
        let is_start = self.announced.state == CanState::Starting && report == CanReport::Working;
        self.note(report, status);
        if is_start {
            return None;
        }
        self.announced_at = Some(now);
        Some(report)
    }

    /// The most important of what has changed since it was announced.
    fn difference(&self, status: &CanStatus) -> Option<CanReport> {
        let before = &self.announced;
        if status.bus_offs != before.bus_offs {
            return Some(CanReport::BusOff(status.bus_offs));
        }
        if status.lost_setups != before.lost_setups {
            return Some(CanReport::SetUpAnew);
        }
        if status.state != before.state {
            return match status.state {
                CanState::NoAnswer => Some(CanReport::NoAnswer),
                CanState::Passive => Some(CanReport::Passive),
                CanState::Active => Some(CanReport::Working),
                CanState::Starting | CanState::BusOff => None,
            };
        }
        if status.interrupt != before.interrupt && status.interrupt == CanInterrupt::Dead {
            return Some(CanReport::NoInterrupt);
        }
        (status.lost_frames != before.lost_frames).then_some(CanReport::FramesLost(status.lost_frames))
    }

    /// Remembers what was announced; the rest stays news.
    fn note(&mut self, report: CanReport, status: &CanStatus) {
        let announced = &mut self.announced;
        match report {
            CanReport::BusOff(bus_offs) => {
                announced.bus_offs = bus_offs;
                announced.state = CanState::BusOff;
            }
            CanReport::SetUpAnew => announced.lost_setups = status.lost_setups,
            CanReport::FramesLost(frames) => announced.lost_frames = frames,
            CanReport::NoInterrupt => announced.interrupt = status.interrupt,
            CanReport::NoAnswer | CanReport::Passive | CanReport::Working => announced.state = status.state,
            CanReport::ImpossibleBitRate => {}
        }
    }

    /// What a ground station that connects has to know.
    pub fn trouble(&self) -> Option<CanReport> {
        match self.announced.state {
            CanState::NoAnswer => Some(CanReport::NoAnswer),
            CanState::Passive => Some(CanReport::Passive),
            CanState::BusOff => Some(CanReport::BusOff(self.announced.bus_offs)),
            CanState::Starting | CanState::Active => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    const ACTIVE: CanStatus = CanStatus {
        state: CanState::Active,
        ..CanStatus::STARTING
    };

    /// What is announced of statuses that come every 100 ms.
    fn announced(statuses: impl IntoIterator<Item = CanStatus>) -> Vec<(u64, CanReport)> {
        let mut watch = CanWatch::new();
        let statuses = (0..).map(|tick| tick * 100).zip(statuses);
        statuses
            .filter_map(|(ms, status)| Some((ms, watch.news(&status, at_us(ms * 1000))?)))
            .collect()
    }

    #[test]
    fn a_bus_that_works_is_no_news() {
        assert_eq!(announced([CanStatus::STARTING, ACTIVE, ACTIVE]), []);
    }

    #[test]
    fn each_change_is_announced_once() {
        for (state, report) in [
            (CanState::NoAnswer, CanReport::NoAnswer),
            (CanState::Passive, CanReport::Passive),
        ] {
            let failed = CanStatus { state, ..ACTIVE };
            let statuses = [ACTIVE; 10].into_iter().chain([failed; 200]).chain([ACTIVE; 10]);
            let expected = [(1_000, report), (21_000, CanReport::Working)];
            assert_eq!(announced(statuses), expected);
        }
    }

    #[test]
    fn a_bus_off_between_two_looks_is_noticed_and_repeated_every_ten_seconds() {
        let statuses = (0..250).map(|tick| CanStatus {
            bus_offs: tick,
            ..ACTIVE
        });
        let expected = [
            (100, CanReport::BusOff(1)),
            (10_100, CanReport::BusOff(101)),
            (20_100, CanReport::BusOff(201)),
        ];
        assert_eq!(announced(statuses), expected);
    }

    #[test]
    fn what_waits_is_announced_later() {
        let statuses = (0..400).map(|tick| CanStatus {
            lost_setups: u32::from(tick >= 10),
            lost_frames: tick.min(20),
            interrupt: if tick < 15 {
                CanInterrupt::Working
            } else {
                CanInterrupt::Dead
            },
            ..ACTIVE
        });
        let expected = [
            (100, CanReport::FramesLost(1)),
            (10_100, CanReport::SetUpAnew),
            (20_100, CanReport::NoInterrupt),
            (30_100, CanReport::FramesLost(20)),
        ];
        assert_eq!(announced(statuses), expected);
    }
}
