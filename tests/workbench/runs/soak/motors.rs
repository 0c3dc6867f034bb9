//! What the motors do, from every change at their pins, held against what the driver has ordered.

use std::collections::VecDeque;

use crate::bench::{Bench, CYCLES_PER_US, MILLISECOND};
use emulator::PwmOutput;
use support::motor_poles::motors;

/// What the start of a frame among garbage has swallowed is found 293 bytes later, and a driver sends 400 a second.
const SWALLOWED_MS: u64 = 730;

/// FS_TIMEOUT, and on top of it: how long garbage may delay stick input; an erase of the flash; a tick of the drive task.
const STICK_US: u64 = (1_500 + SWALLOWED_MS + 45 + 20) * MILLISECOND;

/// A HEARTBEAT that was built before the order to arm was found may still say "disarmed".
const ORDER_US: u64 = (SWALLOWED_MS + 50) * MILLISECOND;

/// A share of the power is rounded to steps of the PWM.
const ROUNDING: f64 = 0.01;

#[derive(Clone, Copy, Debug, PartialEq)]
enum Motion {
    Coast,
    Brake,
    /// With this share of the power, ahead if positive.
    Turn(f64),
}

impl Motion {
    /// What a motor does that has these duties at its poles.
    fn of(positive: f64, negative: f64) -> Self {
        match (positive, negative) {
            (0.0, 0.0) => Self::Coast,
            (1.0, 1.0) => Self::Brake,
            (power, 0.0) => Self::Turn(power),
            (0.0, power) => Self::Turn(-power),
            both => panic!("pulses at both poles of a motor: {both:?}"),
        }
    }
}

/// What the driver has ordered.
#[derive(Default)]
pub struct Orders {
    /// When the order to arm was sent first and last, as it is repeated until the rover is seen to be armed; `None` while the
    /// rover has to be disarmed.
    armed: Option<(u64, u64)>,
    /// Shares of the power for the left and the right side, latest last.
    sticks: VecDeque<(u64, [f64; 2])>,
}

impl Orders {
    /// The order to arm is sent.
    pub fn arm(&mut self, at_us: u64) {
        let first_us = self.armed.map_or(at_us, |(first_us, _)| first_us);
        self.armed = Some((first_us, at_us));
    }

    /// A reset: nothing that was ordered before counts.
    pub fn forget(&mut self) {
        *self = Self::default();
    }

    /// A control message is sent.
    pub fn stick(&mut self, at_us: u64, powers: [f64; 2]) {
        let is_old = |(sent_us, _): &(u64, _)| sent_us + STICK_US < at_us;
        while self.sticks.front().is_some_and(is_old) {
            self.sticks.pop_front();
        }
        self.sticks.push_back((at_us, powers));
    }

    /// A HEARTBEAT that says whether the rover is armed. Panics if it must not be.
    pub fn reported(&mut self, says: Says, at_us: u64) {
        match says {
            Says::Armed => assert!(self.armed.is_some(), "armed without an order"),
            Says::Disarmed if self.armed.is_some_and(|(_, last_us)| last_us + ORDER_US < at_us) => {
                self.armed = None;
            }
            Says::Disarmed => {}
        }
    }

    /// The age of the stick input that permits this motion of a side.
    fn permit(&self, side: usize, motion: Motion, at_us: u64) -> Option<u64> {
        let power = match motion {
            Motion::Coast => return Some(0),
            Motion::Brake => return self.armed.map(|_| 0),
            Motion::Turn(power) => power,
        };
        let (first_us, _) = self.armed?;
        let fits = |ordered: f64| power * ordered > 0.0 && power.abs() <= ordered.abs() + ROUNDING;
        // No position from before arming drives.
        let counts = |sent_us: u64, powers: &[f64; 2]| sent_us >= first_us && fits(powers[side]);
        let mut latest_first = self.sticks.iter().rev();
        let stick = latest_first.find(|(sent_us, powers)| counts(*sent_us, powers));
        let age_us = stick.map(|(sent_us, _)| at_us.saturating_sub(*sent_us));
        age_us.filter(|age_us| *age_us <= STICK_US)
    }
}

/// What a HEARTBEAT says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Says {
    Armed,
    Disarmed,
}

/// A change at a pin.
pub struct Change {
    pub at_us: u64,
    motor: usize,
    pole: usize,
    duty: f64,
}

/// The motors, and what was seen of them.
#[derive(Default)]
pub struct Motors {
    /// The duties at the positive and the negative pole of each motor, those on the left first.
    duties: [[f64; 2]; 4],
    /// Changes that were looked at.
    pub changes: u64,
    /// The age of the oldest stick input that turned a motor.
    pub oldest_stick_us: u64,
    /// When one was seen to turn last.
    pub turned_us: Option<u64>,
}

fn pins() -> impl Iterator<Item = (usize, usize, usize)> {
    motors()
        .enumerate()
        .flat_map(|(number, motor)| [(number, 0, motor.positive), (number, 1, motor.negative)])
}

impl Motors {
    pub fn record(bench: &mut Bench) {
        pins().for_each(|(_, _, pin)| bench.record_pin(pin));
    }

    /// Whether one turns or brakes, as those of an armed rover only do.
    pub fn are_on(bench: &Bench) -> bool {
        pins().any(|(_, _, pin)| bench.pwm_output(pin).is_some_and(|output| output.duty > 0.0))
    }

    /// Checks changes. Panics if a motor does what was not ordered.
    pub fn check(&mut self, changes: &[Change], orders: &Orders) {
        for (place, change) in changes.iter().enumerate() {
            self.duties[change.motor][change.pole] = change.duty;
            let is_whole = changes
                .get(place + 1)
                .is_none_or(|next| next.at_us > change.at_us);
            if is_whole {
                self.assert_ordered(orders, change.at_us);
            }
        }
        self.changes += changes.len() as u64;
    }

    /// Panics if a motor does now what was not ordered. Returns the age of the oldest stick input that turns one.
    pub fn assert_ordered(&mut self, orders: &Orders, at_us: u64) -> u64 {
        let mut oldest_us = 0;
        for (motor, [positive, negative]) in self.duties.into_iter().enumerate() {
            let motion = Motion::of(positive, negative);
            let age_us = orders.permit(motor / 2, motion, at_us);
            let age_us =
                age_us.unwrap_or_else(|| panic!("motor {motor} at {at_us} us: {motion:?}, not ordered"));
            oldest_us = oldest_us.max(age_us);
            if let Motion::Turn(_) = motion {
                self.turned_us = Some(at_us);
            }
        }
        self.oldest_stick_us = self.oldest_stick_us.max(oldest_us);
        oldest_us
    }

    /// All changes since the last time, in their order.
    pub fn take_changes(bench: &mut Bench) -> Vec<Change> {
        let mut changes = Vec::new();
        for (motor, pole, pin) in pins() {
            let edges = bench.take_edges(pin);
            assert!(
                edges.iter().all(|(_, level)| !level),
                "GP{pin} is high, and not by the PWM"
            );
            let change = |(at, output): (u64, Option<PwmOutput>)| Change {
                at_us: at / CYCLES_PER_US,
                motor,
                pole,
                duty: output.map_or(0.0, |output| output.duty),
            };
            changes.extend(bench.take_pwm_changes(pin).into_iter().map(change));
        }
        changes.sort_by_key(|change| change.at_us);
        changes
    }
}
