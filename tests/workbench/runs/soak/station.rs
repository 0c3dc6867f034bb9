//! A ground station with a driver: what they send of their own accord.

use super::ledger::Ledger;
use super::motors::{Orders, Says};
use crate::bench::{MILLISECOND, SECOND};
use emulator::Random;
use support::commands::REQUEST_MESSAGE;
use support::requests::{
    GCS, VEHICLE, VEHICLE_ID, arm, arm_by_force, command_long, disarm, heartbeat, manual_control,
    manual_mode, param_read_by_name, param_request_list, param_set, ping, timesync,
};

const AUTOPILOT_VERSION: f32 = 148.0;

/// Orders are sent again until they are seen to be obeyed.
const REPEAT_US: u64 = 500 * MILLISECOND;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Doing {
    WaitingUntil(u64),
    DrivingUntil(u64),
    Stopping,
}

/// How a driver arms.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Driver {
    /// Leaves the sticks neutral until the rover is seen to be armed.
    Careful,
    /// Deflects a stick from the start and arms by force: it must not drive, since it is never neutral.
    Hasty,
}

/// A drive that has ended.
#[derive(Clone, Copy, Debug)]
pub struct FinishedDrive {
    pub began_us: u64,
    pub driver: Driver,
}

pub struct Station {
    random: Random,
    doing: Doing,
    driver: Driver,
    sees_armed: bool,
    heartbeat_due_us: u64,
    repeat_due_us: u64,
    /// The stick positions, in thousandths.
    steering: i16,
    throttle: i16,
    /// No value is set twice.
    next_value: f32,
    began_us: u64,
    finished_drive: Option<FinishedDrive>,
    pub settings: u64,
}

impl Station {
    pub fn new(random: Random, now_us: u64) -> Self {
        Self {
            random,
            doing: Doing::WaitingUntil(now_us),
            driver: Driver::Careful,
            sees_armed: false,
            heartbeat_due_us: now_us,
            repeat_due_us: now_us,
            steering: 0,
            throttle: 0,
            next_value: 1.0,
            began_us: now_us,
            finished_drive: None,
            settings: 0,
        }
    }

    /// What it sends now; it is asked ten times a second.
    pub fn messages(&mut self, now_us: u64, orders: &mut Orders, ledger: &mut Ledger) -> Vec<Vec<u8>> {
        let mut messages = Vec::new();
        if self.heartbeat_due_us <= now_us {
            self.heartbeat_due_us += SECOND;
            messages.push(heartbeat(GCS));
        }
        match self.doing {
            Doing::WaitingUntil(until_us) if now_us < until_us => {}
            Doing::WaitingUntil(_) => messages.extend(self.begin_something(now_us, ledger)),
            Doing::DrivingUntil(until_us) if now_us < until_us => self.drive(now_us, orders, &mut messages),
            Doing::DrivingUntil(_) => {
                self.doing = Doing::Stopping;
                self.finished_drive = Some(FinishedDrive {
                    began_us: self.began_us,
                    driver: self.driver,
                });
            }
            Doing::Stopping => {
                messages.push(manual_control(VEHICLE_ID, 0, 0));
                if self.is_time_to_repeat(now_us) {
                    messages.push(disarm());
                }
            }
        }
        messages
    }

    /// A HEARTBEAT says whether the rover is armed.
    pub fn see(&mut self, says: Says, now_us: u64) {
        self.sees_armed = says == Says::Armed;
        if says == Says::Disarmed && self.doing == Doing::Stopping {
            self.wait(now_us);
        }
    }

    /// The drive that has ended since this was asked last.
    pub fn take_finished_drive(&mut self) -> Option<FinishedDrive> {
        self.finished_drive.take()
    }

    fn wait(&mut self, now_us: u64) {
        let pause_us = 200 * MILLISECOND + self.random.below(2_000_000) as u64;
        self.doing = Doing::WaitingUntil(now_us + pause_us);
    }

    fn is_time_to_repeat(&mut self, now_us: u64) -> bool {
        let is_due = self.repeat_due_us <= now_us;
        if is_due {
            self.repeat_due_us = now_us + REPEAT_US;
        }
        is_due
    }

    fn begin_something(&mut self, now_us: u64, ledger: &mut Ledger) -> Option<Vec<u8>> {
        self.wait(now_us);
        match self.random.below(40) {
            0 => Some(param_request_list(VEHICLE)),
            1..4 => Some(command_long(REQUEST_MESSAGE, AUTOPILOT_VERSION)),
            4..7 => Some(ping(now_us, 1)),
            7..10 => Some(timesync(1)),
            10..15 => Some(param_read_by_name(&self.any_name(ledger))),
            15..33 => Some(self.set_something(now_us, ledger)),
            _ => {
                let length_us = 2 * SECOND + self.random.below(5_000_000) as u64;
                self.doing = Doing::DrivingUntil(now_us + length_us);
                self.began_us = now_us;
                self.repeat_due_us = now_us;
                self.sees_armed = false;
                self.driver = match self.random.below(5) {
                    0 => Driver::Hasty,
                    _ => Driver::Careful,
                };
                self.move_stick();
                None
            }
        }
    }

    fn any_name(&mut self, ledger: &Ledger) -> String {
        let names: Vec<_> = ledger.names().collect();
        names[self.random.below(names.len())].clone()
    }

    /// Sets one of the parameters to a value that it has not had.
    pub fn set_something(&mut self, now_us: u64, ledger: &mut Ledger) -> Vec<u8> {
        let name = self.any_name(ledger);
        self.next_value += 1.0;
        self.settings += 1;
        ledger.sent(&name, self.next_value, now_us);
        param_set(&name, self.next_value)
    }

    fn move_stick(&mut self) {
        let power = self.random.below(801) as i16 + 200;
        (self.steering, self.throttle) = match self.random.below(4) {
            0 => (power, 0),
            1 => (-power, 0),
            2 => (0, -power),
            _ => (0, power),
        };
    }

    fn drive(&mut self, now_us: u64, orders: &mut Orders, messages: &mut Vec<Vec<u8>>) {
        let is_pushing = self.driver == Driver::Hasty || self.sees_armed;
        if self.driver == Driver::Hasty {
            messages.push(manual_control(VEHICLE_ID, self.steering, self.throttle));
        }
        if self.is_time_to_repeat(now_us) {
            orders.arm(now_us);
            // A failsafe that is still latched refuses: by force from the second time on, or a short drive ends before it begins.
            let is_first = now_us < self.began_us + REPEAT_US;
            messages.push(match (self.driver, self.random.below(2)) {
                (Driver::Careful, 0) if is_first => arm(),
                _ => arm_by_force(),
            });
            messages.push(manual_mode());
            if self.driver == Driver::Careful && self.random.below(2) == 0 {
                self.move_stick();
            }
        }
        let (steering, throttle) = match is_pushing {
            true => (self.steering, self.throttle),
            false => (0, 0),
        };
        let [forward, right] = [throttle, steering].map(|axis| f64::from(axis) / 1000.0);
        orders.stick(now_us, [forward + right, forward - right]);
        messages.push(manual_control(VEHICLE_ID, steering, throttle));
    }
}
