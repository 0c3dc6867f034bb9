//! Whose sticks drive: those of one station at a time.

use heapless::Vec;

use super::StickInput;
use super::controls::is_deflected;
use crate::time::Instant;

/// A driver that has been neutral or silent for this long gives way, in µs.
const FREE_AFTER_US: u64 = 1_000_000;

/// Minimum time between two texts to a station whose sticks are ignored, in µs.
const TEXT_INTERVAL_US: u64 = 5_000_000;

/// Other stations whose sticks are watched at a time.
const OTHERS: usize = 4;

/// A station on a link that moves sticks.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DriverId {
    /// The number of the link: each one that is opened has another.
    pub link: u16,
    /// The station's system id.
    pub system_id: u8,
    /// Its component id.
    pub component_id: u8,
}

/// Sticks are ignored: another station drives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AnotherDrives {
    /// Its driver should know now.
    IsNews,
    /// There is nothing to say, or it was said a moment ago.
    IsKnown,
}

/// What a control message says of both sticks.
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
        let inputs = [throttle, steering];
        let deflects =
            |input: &StickInput| matches!(input, StickInput::Position(position) if is_deflected(*position));
        let positions = inputs
            .iter()
            .filter(|input| matches!(input, StickInput::Position(_)));
        match (
            inputs.iter().any(deflects),
            positions.count(),
            inputs.contains(&StickInput::Released),
        ) {
            (true, ..) => Some(Self::Deflected),
            (false, 0, false) => None,
            (false, 0, true) => Some(Self::Released),
            (false, _, _) => Some(Self::Neutral),
        }
    }
}

/// The station that drives.
#[derive(Clone, Copy, Debug)]
struct Driver {
    id: DriverId,
    heard_at: Instant,
    sticks: Sticks,
    /// Since then no stick is known to be deflected.
    free_since: Instant,
}

/// A station that would drive.
#[derive(Clone, Copy, Debug)]
struct Other {
    id: DriverId,
    heard_at: Instant,
    /// When its sticks were neutral last, if they are.
    neutral_at: Option<Instant>,
    said_at: Option<Instant>,
}

/// Who drives. Another station takes over once the driver has been neutral or silent for a second, with sticks that were neutral
/// since: those of one that is held deflected would make the rover jump.
#[derive(Clone, Debug, Default)]
pub(super) struct DriverSeat {
    driver: Option<Driver>,
    others: Vec<Other, OTHERS>,
}

impl DriverSeat {
    /// There is no driver any more.
    pub fn vacate(&mut self) {
        self.driver = None;
    }

    /// Whether a station's message at this time moves the sticks.
    ///
    /// # Errors
    /// Another one drives.
    pub fn admit(
        &mut self,
        from: DriverId,
        at: Instant,
        throttle: StickInput,
        steering: StickInput,
    ) -> Result<(), AnotherDrives> {
        let Some(sticks) = Sticks::of(throttle, steering) else {
            return Ok(());
        };
        match &mut self.driver {
            Some(driver) if driver.id == from => driver.hear(at, sticks),
            Some(driver) => {
                let driver = *driver;
                self.hear_other(from, at, sticks, &driver)?;
                self.driver = Some(Driver::new(from, at, sticks));
            }
            None => self.driver = Some(Driver::new(from, at, sticks)),
        }
        if sticks == Sticks::Released {
            self.vacate();
        }
        Ok(())
    }

    /// Whether another station takes over with this message.
    fn hear_other(
        &mut self,
        from: DriverId,
        at: Instant,
        sticks: Sticks,
        driver: &Driver,
    ) -> Result<(), AnotherDrives> {
        // There is always one.
        let other = self.other(from, at).ok_or(AnotherDrives::IsKnown)?;
        other.heard_at = at;
        match sticks {
            Sticks::Neutral if driver.is_silent(at) => Ok(()),
            Sticks::Neutral => {
                other.neutral_at = Some(at);
                Err(AnotherDrives::IsKnown)
            }
            Sticks::Deflected => {
                let was_neutral = other
                    .neutral_at
                    .take()
                    .is_some_and(|neutral_at| neutral_at >= driver.free_since);
                if was_neutral && driver.is_free(at) {
                    return Ok(());
                }
                Err(other.say_once_in_a_while(at))
            }
            Sticks::Released => Err(AnotherDrives::IsKnown),
        }
    }

    /// What is known of this station. The one that was heard longest ago gives way to a new one.
    fn other(&mut self, id: DriverId, at: Instant) -> Option<&mut Other> {
        let mut place = self.others.iter().position(|other| other.id == id);
        if place.is_none() {
            let new = Other {
                id,
                heard_at: at,
                neutral_at: None,
                said_at: None,
            };
            if self.others.is_full() {
                let oldest = self.others.iter_mut().min_by_key(|other| other.heard_at)?;
                *oldest = new;
            } else {
                // There is room.
                let _ = self.others.push(new);
            }
            place = self.others.iter().position(|other| other.id == id);
        }
        self.others.get_mut(place?)
    }
}

impl Driver {
    fn new(id: DriverId, at: Instant, sticks: Sticks) -> Self {
        Self {
            id,
            heard_at: at,
            sticks,
            free_since: at,
        }
    }

    fn hear(&mut self, at: Instant, sticks: Sticks) {
        if sticks == Sticks::Deflected || self.sticks == Sticks::Deflected {
            self.free_since = at;
        }
        self.heard_at = at;
        self.sticks = sticks;
    }

    fn is_silent(&self, at: Instant) -> bool {
        at.us_since(self.heard_at) >= FREE_AFTER_US
    }

    fn is_free(&self, at: Instant) -> bool {
        at.us_since(self.free_since) >= FREE_AFTER_US
    }
}

impl Other {
    fn say_once_in_a_while(&mut self, at: Instant) -> AnotherDrives {
        let is_known = |said_at| at.us_since(said_at) < TEXT_INTERVAL_US;
        if self.said_at.is_some_and(is_known) {
            return AnotherDrives::IsKnown;
        }
        self.said_at = Some(at);
        AnotherDrives::IsNews
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
        }
    }

    /// A message of a station with this throttle.
    fn send(seat: &mut DriverSeat, from: DriverId, at_ms: u64, throttle: i16) -> Result<(), AnotherDrives> {
        let at = at_us(at_ms * 1_000);
        seat.admit(from, at, StickInput::Position(throttle), StickInput::Position(0))
    }

    const IGNORED: Result<(), AnotherDrives> = Err(AnotherDrives::IsKnown);
    const SAID: Result<(), AnotherDrives> = Err(AnotherDrives::IsNews);

    #[test]
    fn sticks_of_a_second_driver_are_ignored_while_the_first_one_drives() {
        let mut seat = DriverSeat::default();
        for ms in (0..10_000).step_by(50) {
            assert_eq!(send(&mut seat, ONE, ms, 400), Ok(()));
            assert_eq!(send(&mut seat, TWO, ms + 10, 0), IGNORED);
            let said = if ms % 5_000 == 0 { SAID } else { IGNORED };
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
        assert_eq!(send(&mut seat, TWO, 1_060, 500), SAID);
        assert_eq!(send(&mut seat, TWO, 1_070, 0), IGNORED, "the driver is there");
        assert_eq!(send(&mut seat, ONE, 1_080, 0), Ok(()));
        assert_eq!(send(&mut seat, TWO, 1_090, 500), Ok(()));
        assert_eq!(send(&mut seat, ONE, 1_100, 400), SAID, "it is no driver any more");
    }

    #[test]
    fn sticks_that_were_deflected_too_early_have_to_be_neutral_again() {
        let mut seat = DriverSeat::default();
        assert_eq!(send(&mut seat, ONE, 0, 0), Ok(()));
        assert_eq!(send(&mut seat, TWO, 500, 0), IGNORED);
        assert_eq!(send(&mut seat, TWO, 600, 500), SAID);
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
        assert_eq!(send(&mut seat, TWO, 5_000, 500), SAID);
        assert_eq!(send(&mut seat, TWO, 5_050, 0), Ok(()));
        assert_eq!(send(&mut seat, TWO, 5_100, 500), Ok(()));
    }

    #[test]
    fn a_driver_that_lets_go_leaves_the_seat_and_others_can_not_make_it() {
        let mut seat = DriverSeat::default();
        let release = |seat: &mut DriverSeat, from| {
            seat.admit(from, at_us(100), StickInput::Released, StickInput::Released)
        };
        assert_eq!(send(&mut seat, ONE, 0, 1000), Ok(()));
        assert_eq!(release(&mut seat, TWO), IGNORED);
        assert_eq!(send(&mut seat, TWO, 1, 500), SAID);
        assert_eq!(release(&mut seat, ONE), Ok(()));
        assert_eq!(send(&mut seat, TWO, 2, 500), Ok(()));
    }

    #[test]
    fn who_moves_no_stick_takes_no_seat() {
        let mut seat = DriverSeat::default();
        let nothing = StickInput::Unchanged;
        assert_eq!(seat.admit(ONE, Instant::EPOCH, nothing, nothing), Ok(()));
        assert_eq!(send(&mut seat, TWO, 1, 500), Ok(()));
        assert_eq!(seat.admit(ONE, Instant::EPOCH, nothing, nothing), Ok(()));
        assert_eq!(send(&mut seat, TWO, 2, 500), Ok(()));
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
