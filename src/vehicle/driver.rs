//! The driver: the sticks of one station at a time drive.

use super::controls::Controls;
use super::{ArmState, StickInput};
use crate::announce::RateLimit;
use crate::time::Instant;

/// A driver that has been neutral or silent for this long gives way, in µs.
const FREE_AFTER_US: u64 = 1_000_000;

/// Minimum time between two texts to a station about its sticks, in µs.
const TEXT_INTERVAL_US: u64 = 5_000_000;

/// Other drivers whose sticks are watched at a time.
const OTHERS: usize = 4;

/// A station on a link that moves sticks, by one kind of message: one that sends both drives with the first.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriverId {
    /// The number of the link: each one that is opened has another.
    pub link: u16,
    /// The station's system id.
    pub system_id: u8,
    /// Its component id.
    pub component_id: u8,
    /// The message that has its sticks.
    pub message: ControlMessage,
}

/// Message with the positions of sticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ControlMessage {
    /// MANUAL_CONTROL.
    #[default]
    ManualControl,
    /// RC_CHANNELS_OVERRIDE.
    ChannelOverride,
}

/// Presence of a ground station by a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Presence {
    /// One has sent it, in time as far as is known.
    GroundStation,
    /// Nothing: it came long after it was sent, or from another component of this vehicle.
    Unknown,
}

/// Sticks are ignored: another driver has the seat.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct AnotherDrives {
    /// The one that drives, if it has to be reported now.
    pub report: Option<DriverId>,
}

impl AnotherDrives {
    const UNREPORTED: Self = Self { report: None };
}

/// Content of a control message about both sticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Sticks {
    Deflected,
    Neutral,
    /// The driver lets go of them.
    Released,
}

impl Sticks {
    /// `None` of a message about neither.
    fn of(throttle: StickInput, steering: StickInput) -> Option<Self> {
        match (throttle, steering) {
            _ if throttle.is_deflected() || steering.is_deflected() => Some(Self::Deflected),
            (StickInput::Position(_), _) | (_, StickInput::Position(_)) => Some(Self::Neutral),
            (StickInput::Released, _) | (_, StickInput::Released) => Some(Self::Released),
            (StickInput::Unchanged, StickInput::Unchanged) => None,
        }
    }
}

/// The station that drives, or the last one that did.
#[derive(Clone, Copy, Debug)]
struct Driver {
    id: DriverId,
    heard_at: Instant,
    /// Released if it has left the seat.
    sticks: Sticks,
    /// Since then no stick is known to be deflected.
    free_since: Instant,
    texts: RateLimit<TEXT_INTERVAL_US>,
}

/// A station that would drive.
#[derive(Clone, Copy, Debug, Default)]
struct Other {
    id: Option<DriverId>,
    heard_at: Instant,
    /// Positions that had no effect.
    sticks: Controls,
    texts: RateLimit<TEXT_INTERVAL_US>,
}

/// The driver. Another station takes over once the driver has been neutral or silent for a second, with sticks that were neutral
/// since: those of one that is held deflected would make the rover jump.
#[derive(Clone, Debug, Default)]
pub struct DriverSeat {
    driver: Option<Driver>,
    others: [Other; OTHERS],
}

/// A message of the driver.
#[derive(Clone, Copy, Debug)]
pub enum Admitted {
    /// It drives on.
    Driver,
    /// It has taken over; these are its sticks as they were heard before.
    NewDriver(Controls),
}

impl DriverSeat {
    /// Whether there is a driver, who has not left the seat.
    pub fn is_taken(&self) -> bool {
        self.driver.as_ref().is_some_and(Driver::is_seated)
    }

    /// After a message of the driver a stick is deflected, which the message need not have repeated.
    pub fn note_deflected(&mut self, at: Instant) {
        if let Some(driver) = &mut self.driver {
            driver.hear(at, Sticks::Deflected);
        }
    }

    /// The driver leaves the seat.
    pub fn vacate(&mut self) {
        if let Some(driver) = &mut self.driver {
            driver.sticks = Sticks::Released;
        }
    }

    /// The stations of a link are gone. Returns whether the driver was one of them.
    pub fn close_link(&mut self, link: u16) -> bool {
        for other in &mut self.others {
            other.id.take_if(|id| id.link == link);
        }
        self.driver.take_if(|driver| driver.id.link == link).is_some()
    }

    /// Admits the message of a station at this time if its sticks drive.
    ///
    /// # Errors
    /// Another one drives.
    pub fn admit(
        &mut self,
        from: DriverId,
        at: Instant,
        throttle: StickInput,
        steering: StickInput,
    ) -> Result<Admitted, AnotherDrives> {
        let Some(sticks) = Sticks::of(throttle, steering) else {
            return Ok(Admitted::Driver);
        };
        if let Some(driver) = self.driver.as_mut().filter(|driver| driver.id == from) {
            driver.hear(at, sticks);
            return Ok(Admitted::Driver);
        }
        let driver = self.driver.filter(Driver::is_seated);
        let Some(other) = self.other(from) else {
            // There is always one.
            return Err(AnotherDrives::UNREPORTED);
        };
        other.heard_at = at;
        let takes_over = match driver {
            Some(driver) => other.takes_over(at, sticks, &driver),
            // Only the driver can let go.
            None if sticks == Sticks::Released => Err(AnotherDrives::UNREPORTED),
            None => Ok(()),
        };
        if let Err(ignored) = takes_over {
            other.sticks.receive(at, throttle, steering);
            return Err(ignored);
        }
        other.id = None;
        let heard = other.sticks;
        self.driver = Some(Driver::new(from, at, sticks));
        Ok(Admitted::NewDriver(heard))
    }

    /// Whether the driver may be sent a text about its sticks, which counts as sent.
    pub fn may_report(&mut self, at: Instant) -> bool {
        self.driver.as_mut().is_some_and(|driver| driver.texts.take(at))
    }

    /// Drops positions of other stations that have expired.
    pub fn expire(&mut self, now: Instant, timeout_us: u64) {
        for other in &mut self.others {
            other.sticks.times_out(now, timeout_us, ArmState::Disarmed);
        }
    }

    /// The record of this station. A new one takes a free place, or that of the one that was heard longest ago.
    fn other(&mut self, id: DriverId) -> Option<&mut Other> {
        let age = |other: &&mut Other| match other.id {
            Some(known) if known == id => None,
            _ => Some(other.id.map(|_| other.heard_at)),
        };
        let other = self.others.iter_mut().min_by_key(age)?;
        if other.id != Some(id) {
            *other = Other {
                id: Some(id),
                ..Other::default()
            };
        }
        Some(other)
    }
}

impl Driver {
    fn new(id: DriverId, at: Instant, sticks: Sticks) -> Self {
        Self {
            id,
            heard_at: at,
            sticks,
            free_since: at,
            texts: RateLimit::default(),
        }
    }

    fn hear(&mut self, at: Instant, sticks: Sticks) {
        if sticks == Sticks::Deflected || self.sticks == Sticks::Deflected {
            self.free_since = at;
        }
        self.heard_at = at;
        self.sticks = sticks;
    }

    fn is_seated(&self) -> bool {
        self.sticks != Sticks::Released
    }

    fn is_silent(&self, at: Instant) -> bool {
        at.us_since(self.heard_at) >= FREE_AFTER_US
    }

    fn is_free(&self, at: Instant) -> bool {
        at.us_since(self.free_since) >= FREE_AFTER_US
    }
}

impl Other {
    /// Whether it takes over from the driver with this message.
    fn takes_over(&mut self, at: Instant, sticks: Sticks, driver: &Driver) -> Result<(), AnotherDrives> {
        let takes_over = match sticks {
            Sticks::Neutral => driver.is_silent(at),
            Sticks::Deflected => driver.is_free(at) && self.sticks.are_neutral_since(driver.free_since),
            Sticks::Released => false,
        };
        if takes_over {
            return Ok(());
        }
        let reports = sticks == Sticks::Deflected && self.texts.take(at);
        Err(AnotherDrives {
            report: reports.then_some(driver.id),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    const ONE: DriverId = station(1);
    const TWO: DriverId = station(2);

    const fn station(system_id: u8) -> DriverId {
        DriverId {
            link: 0,
            system_id,
            component_id: 190,
            message: ControlMessage::ManualControl,
        }
    }

    fn admit(
        seat: &mut DriverSeat,
        from: DriverId,
        at_ms: u64,
        throttle: StickInput,
        steering: StickInput,
    ) -> Result<(), AnotherDrives> {
        seat.admit(from, at_us(at_ms * 1_000), throttle, steering)
            .map(|_| ())
    }

    /// A message of a station with this throttle.
    fn send(seat: &mut DriverSeat, from: DriverId, at_ms: u64, throttle: i16) -> Result<(), AnotherDrives> {
        let throttle = StickInput::Position(throttle);
        admit(seat, from, at_ms, throttle, StickInput::Position(0))
    }

    const IGNORED: Result<(), AnotherDrives> = Err(AnotherDrives::UNREPORTED);

    /// Ignored, with a report of the driver.
    const fn reported(driver: DriverId) -> Result<(), AnotherDrives> {
        Err(AnotherDrives { report: Some(driver) })
    }

    #[test]
    fn sticks_of_a_second_driver_are_ignored_while_the_first_one_drives() {
        let mut seat = DriverSeat::default();
        for ms in (0..10_000).step_by(50) {
            assert_eq!(send(&mut seat, ONE, ms, 400), Ok(()));
            assert_eq!(send(&mut seat, TWO, ms + 10, 0), IGNORED);
            let said = if ms % 5_000 == 0 { reported(ONE) } else { IGNORED };
            assert_eq!(send(&mut seat, TWO, ms + 20, -900), said, "{ms}");
        }
    }

    #[test]
    fn a_driver_that_is_neutral_for_a_second_gives_way_to_sticks_that_were_neutral_since() {
        let mut seat = DriverSeat::default();
        assert_eq!(send(&mut seat, ONE, 0, 400), Ok(()));
        assert_eq!(send(&mut seat, TWO, 40, 0), IGNORED);
        assert_eq!(send(&mut seat, ONE, 50, 0), Ok(()));
        assert_eq!(send(&mut seat, ONE, 900, 0), Ok(()));
        // Neutral before the driver was.
        assert_eq!(send(&mut seat, TWO, 1_060, 500), reported(ONE));
        assert_eq!(send(&mut seat, TWO, 1_070, 0), IGNORED, "the driver is there");
        assert_eq!(send(&mut seat, ONE, 1_080, 0), Ok(()));
        let [throttle, steering] = [500, 0].map(StickInput::Position);
        let admitted = seat.admit(TWO, at_us(1_090_000), throttle, steering);
        let Ok(Admitted::NewDriver(heard)) = admitted else {
            panic!("{admitted:?}");
        };
        let mut controls = Controls::default();
        controls.hand_over(heard);
        controls.receive(at_us(1_090_000), throttle, steering);
        assert_eq!(controls.throttle(), 0.5, "with this very message");
        assert_eq!(
            send(&mut seat, ONE, 1_100, 400),
            reported(TWO),
            "it is no driver any more"
        );
    }

    #[test]
    fn sticks_that_were_deflected_too_early_have_to_be_neutral_again() {
        let mut seat = DriverSeat::default();
        assert_eq!(send(&mut seat, ONE, 0, 0), Ok(()));
        assert_eq!(send(&mut seat, TWO, 500, 0), IGNORED);
        assert_eq!(send(&mut seat, TWO, 600, 500), reported(ONE));
        for ms in (700..3_000).step_by(100) {
            assert_eq!(send(&mut seat, ONE, ms, 0), Ok(()));
            assert_eq!(send(&mut seat, TWO, ms + 1, 500), IGNORED, "{ms}");
        }
        assert_eq!(send(&mut seat, TWO, 3_000, 0), IGNORED);
        assert_eq!(send(&mut seat, TWO, 3_050, 500), Ok(()));
    }

    #[test]
    fn a_driver_that_is_silent_for_a_second_gives_way_to_neutral_sticks_alone() {
        let mut seat = DriverSeat::default();
        assert_eq!(send(&mut seat, ONE, 0, 1000), Ok(()));
        assert_eq!(send(&mut seat, TWO, 999, 0), IGNORED);
        assert_eq!(send(&mut seat, TWO, 5_000, 500), Ok(()), "it was neutral since");
        let mut seat = DriverSeat::default();
        assert_eq!(send(&mut seat, ONE, 0, 1000), Ok(()));
        assert_eq!(send(&mut seat, TWO, 5_000, 500), reported(ONE));
        assert_eq!(send(&mut seat, TWO, 5_050, 0), Ok(()));
        assert_eq!(send(&mut seat, TWO, 5_100, 500), Ok(()));
    }

    #[test]
    fn who_moves_no_stick_takes_no_seat() {
        let mut seat = DriverSeat::default();
        let nothing = StickInput::Unchanged;
        assert_eq!(admit(&mut seat, ONE, 0, nothing, nothing), Ok(()));
        assert_eq!(send(&mut seat, TWO, 1, 500), Ok(()));
        assert_eq!(admit(&mut seat, ONE, 0, nothing, nothing), Ok(()));
        assert_eq!(send(&mut seat, TWO, 2, 500), Ok(()));
    }

    #[test]
    fn a_station_drives_by_the_message_it_began_with() {
        let by_channels = DriverId {
            message: ControlMessage::ChannelOverride,
            ..ONE
        };
        let mut seat = DriverSeat::default();
        assert_eq!(send(&mut seat, ONE, 0, 0), Ok(()));
        for ms in (50..3_000).step_by(50) {
            assert_eq!(send(&mut seat, by_channels, ms, 0), IGNORED, "{ms}");
            assert_eq!(send(&mut seat, ONE, ms, 300), Ok(()), "{ms}");
        }
        assert_eq!(send(&mut seat, by_channels, 3_000, 300), reported(ONE));
    }

    #[test]
    fn only_the_driver_releases_the_sticks() {
        let released = StickInput::Released;
        let mut seat = DriverSeat::default();
        assert_eq!(admit(&mut seat, ONE, 0, released, released), IGNORED);
        assert_eq!(send(&mut seat, ONE, 100, 0), Ok(()));
        seat.vacate();
        assert_eq!(admit(&mut seat, TWO, 200, released, released), IGNORED);
        assert_eq!(admit(&mut seat, ONE, 300, released, released), Ok(()));
    }

    #[test]
    fn a_crowd_of_others_takes_nothing_over() {
        let mut seat = DriverSeat::default();
        for round in 0..100 {
            assert_eq!(send(&mut seat, station(0), round * 100, 300), Ok(()));
            for number in 1..=9 {
                let _ = send(&mut seat, station(number), round * 100 + 1, 0);
                assert!(send(&mut seat, station(number), round * 100 + 2, 900).is_err());
            }
        }
    }
}
