//! Announcements of the CAN bus's controller.

use super::start::{ParameterLoad, Start};
use crate::sensor::{BitTiming, CanInterrupt, CanReport, CanState, CanStatus};
use crate::time::Instant;

/// At the start no node may acknowledge yet; errors that go on for longer are announced.
const PASSIVE_US: u64 = 2_000_000;

/// With shorted wires it is active for moments, between one bus-off and the next.
const WORKING_US: u64 = 2_000_000;

/// Announced state of the controller.
#[derive(Debug)]
pub struct CanWatch {
    /// Why the bus is not in use.
    pub impossible: Option<CanReport>,
    announced: CanStatus,
    /// Since when there are too many errors.
    passive_since: Option<Instant>,
    /// Since when it has been active, with that number of times of bus-off.
    active_since: Option<(u32, Instant)>,
}

impl CanWatch {
    pub fn new(start: &Start) -> Self {
        let impossible = match start.parameter_load {
            ParameterLoad::Loaded => BitTiming::from_parameters(&start.parameters).err(),
            _ => None,
        };
        Self {
            impossible,
            announced: CanStatus::STARTING,
            passive_since: None,
            active_since: None,
        }
    }

    /// The most important news of `status` that may be announced yet, which `is_due` says. A bus may work and fail
    /// in turns; what has to wait stays news.
    pub fn news(
        &mut self,
        status: &CanStatus,
        now: Instant,
        is_due: impl Fn(CanReport) -> bool,
    ) -> Option<CanReport> {
        self.passive_since = match status.state {
            CanState::Passive => self.passive_since.or(Some(now)),
            _ => None,
        };
        self.active_since = match status.state {
            CanState::Active => self
                .active_since
                .filter(|(bus_offs, _)| *bus_offs == status.bus_offs)
                .or(Some((status.bus_offs, now))),
            _ => None,
        };
        if self.announced.state == CanState::Starting && status.state == CanState::Active {
            self.announced.state = CanState::Active;
        }
        let mut changes = self.changes(status, now).into_iter().flatten();
        let report = changes.find(|report| is_due(*report))?;
        self.note(report, status);
        Some(report)
    }

    /// The change since the last announcement, the most important first.
    fn changes(&self, status: &CanStatus, now: Instant) -> [Option<CanReport>; 5] {
        let before = &self.announced;
        let is_dead = status.interrupt != before.interrupt && status.interrupt == CanInterrupt::Dead;
        [
            (status.bus_offs != before.bus_offs).then_some(CanReport::BusOff(status.bus_offs)),
            (status.lost_setups != before.lost_setups).then_some(CanReport::Reconfigured),
            self.change_of_state(status.state, now),
            is_dead.then_some(CanReport::NoInterrupt),
            (status.lost_frames != before.lost_frames).then_some(CanReport::FramesLost(status.lost_frames)),
        ]
    }

    fn change_of_state(&self, state: CanState, now: Instant) -> Option<CanReport> {
        if state == self.announced.state {
            return None;
        }
        match state {
            CanState::NoAnswer => Some(CanReport::NoAnswer),
            CanState::Passive => {
                let since = self.passive_since?;
                (now.us_since(since) >= PASSIVE_US).then_some(CanReport::Passive)
            }
            CanState::Active => {
                let (_, since) = self.active_since?;
                (now.us_since(since) >= WORKING_US).then_some(CanReport::Working)
            }
            CanState::Starting | CanState::BusOff => None,
        }
    }

    /// Remembers what was announced; the rest stays news.
    fn note(&mut self, report: CanReport, status: &CanStatus) {
        let announced = &mut self.announced;
        match report {
            CanReport::BusOff(bus_offs) => {
                announced.bus_offs = bus_offs;
                announced.state = CanState::BusOff;
            }
            CanReport::Reconfigured => announced.lost_setups = status.lost_setups,
            CanReport::FramesLost(frames) => announced.lost_frames = frames,
            CanReport::NoInterrupt => announced.interrupt = status.interrupt,
            CanReport::NoAnswer | CanReport::Passive | CanReport::Working => announced.state = status.state,
            CanReport::ImpossibleBitRate => {}
        }
    }

    /// Trouble for a ground station that connects.
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
    use crate::announce::Announce;
    use crate::autopilot::announcement_limit::AnnouncementLimit;
    use crate::time::at_us;

    const ACTIVE: CanStatus = CanStatus {
        state: CanState::Active,
        ..CanStatus::STARTING
    };

    /// Announcements of statuses that come every 100 ms.
    fn announced(statuses: impl IntoIterator<Item = CanStatus>) -> std::vec::Vec<(u64, CanReport)> {
        let (mut watch, mut limit) = (CanWatch::new(&Start::default()), AnnouncementLimit::default());
        let mut announced = std::vec::Vec::new();
        for (tick, status) in (0..).zip(statuses) {
            let now = at_us(tick * 100_000);
            let news = watch.news(&status, now, |report| limit.allows_one(report.limit(), now));
            if let Some(report) = news {
                assert!(limit.count(report.limit(), now).is_ok());
                announced.push((tick * 100, report));
            }
        }
        announced
    }

    #[test]
    fn a_bus_that_works_is_no_news() {
        assert_eq!(announced([CanStatus::STARTING, ACTIVE, ACTIVE]), []);
    }

    #[test]
    fn each_change_is_announced_once_and_errors_when_they_last() {
        for (state, report, announced_ms) in [
            (CanState::NoAnswer, CanReport::NoAnswer, 1_000),
            (CanState::Passive, CanReport::Passive, 3_000),
        ] {
            let failed = CanStatus { state, ..ACTIVE };
            let statuses = [ACTIVE; 10].into_iter().chain([failed; 200]).chain([ACTIVE; 30]);
            let expected = [(announced_ms, report), (23_000, CanReport::Working)];
            assert_eq!(announced(statuses), expected);
        }
        let short = CanStatus {
            state: CanState::Passive,
            ..ACTIVE
        };
        assert_eq!(announced([[short; 20], [ACTIVE; 20]].concat()), []);
    }

    #[test]
    fn a_bus_off_between_two_looks_is_noticed_and_repeated_every_ten_seconds_until_there_is_none() {
        let statuses = (0..250).map(|tick| CanStatus {
            bus_offs: tick.min(205),
            ..ACTIVE
        });
        let expected = [
            (100, CanReport::BusOff(1)),
            (10_100, CanReport::BusOff(101)),
            (20_100, CanReport::BusOff(201)),
            (22_500, CanReport::Working),
        ];
        assert_eq!(announced(statuses), expected);
    }

    #[test]
    // Requirement: L-10
    fn kinds_do_not_wait_for_each_other() {
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
            (1_000, CanReport::Reconfigured),
            (1_500, CanReport::NoInterrupt),
            (10_100, CanReport::FramesLost(20)),
        ];
        assert_eq!(announced(statuses), expected);
    }
}
