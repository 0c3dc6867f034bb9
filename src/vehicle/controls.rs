//! The driver's levers.

use super::timed_input::TimedInput;
use crate::battery::ArmState;

/// What a control message says of a lever.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Lever {
    /// Its position, from −1000 (back, left) to 1000 (ahead, right); what lies beyond counts as the end.
    At(i16),
    /// The driver lets go of it.
    Released,
    /// The message is about other levers.
    Unchanged,
}

/// One of the driver's levers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum LeverName {
    /// Ahead and back.
    Throttle,
    /// Left and right.
    Steering,
}

const FULL_DEFLECTION: i16 = 1000;

/// A lever that is deflected by no more than this counts as neutral: a worn gamepad rests some percent off its middle.
const NEUTRAL: f32 = 0.05;

/// The driver's levers. Each has an age of its own: a message about one says nothing about the other.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Controls {
    throttle: LeverInput,
    steering: LeverInput,
}

impl Controls {
    /// Takes a control message. Returns whether it was about a lever at all.
    pub fn take(&mut self, received_us: u64, throttle: Lever, steering: Lever) -> bool {
        self.throttle.take(received_us, throttle);
        self.steering.take(received_us, steering);
        (throttle, steering) != (Lever::Unchanged, Lever::Unchanged)
    }

    /// From −1 (full speed back) to 1 (full speed ahead).
    pub fn throttle(&self) -> f32 {
        self.throttle.position()
    }

    /// From −1 (left) to 1 (right).
    pub fn steering(&self) -> f32 {
        self.steering.position()
    }

    /// The lever that is deflected now, so that the rover must not be armed.
    pub fn deflected(&self) -> Option<LeverName> {
        if self.throttle.is_deflected() {
            Some(LeverName::Throttle)
        } else if self.steering.is_deflected() {
            Some(LeverName::Steering)
        } else {
            None
        }
    }

    /// The rover is armed from now on. No position from before drives it.
    pub fn arm(&mut self) {
        self.throttle.arm();
        self.steering.arm();
    }

    /// The rover is disarmed from now on.
    pub fn disarm(&mut self) {
        self.throttle.input.clear_time_out();
        self.steering.input.clear_time_out();
    }

    /// Lets levers that were not heard of for `timeout_us` go neutral. Returns whether that is a failure.
    pub fn times_out(&mut self, now_us: u64, timeout_us: u64, arm_state: ArmState) -> bool {
        let throttle = self.throttle.input.times_out(now_us, timeout_us, arm_state);
        let steering = self.steering.input.times_out(now_us, timeout_us, arm_state);
        throttle || steering
    }

    /// Whether a lever timed out while the rover was armed, and was neither moved nor released since.
    pub fn have_timed_out(&self) -> bool {
        self.throttle.input.has_timed_out() || self.steering.input.has_timed_out()
    }
}

/// What a lever has to do before it drives.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Gate {
    /// Nothing: it drives.
    #[default]
    Open,
    /// A message has to come: the latest one is from before arming.
    Message,
    /// It has to be neutral once: it was deflected when the rover was armed.
    Neutral,
}

/// A lever: where it is, and whether that counts.
#[derive(Clone, Copy, Debug, Default)]
struct LeverInput {
    /// From −1 to 1.
    input: TimedInput<f32>,
    gate: Gate,
}

impl LeverInput {
    fn take(&mut self, received_us: u64, lever: Lever) {
        match lever {
            Lever::At(position) => {
                let position = position.clamp(-FULL_DEFLECTION, FULL_DEFLECTION);
                let position = f32::from(position) / f32::from(FULL_DEFLECTION);
                self.input.receive(received_us, position);
                if self.gate == Gate::Message || !self.is_deflected() {
                    self.gate = Gate::Open;
                }
            }
            // The driver lets go on purpose: that is no failure.
            Lever::Released => *self = Self::default(),
            Lever::Unchanged => {}
        }
    }

    fn arm(&mut self) {
        self.gate = if self.is_deflected() || self.gate == Gate::Neutral {
            Gate::Neutral
        } else {
            Gate::Message
        };
    }

    /// From −1 to 1; 0 without a driver.
    fn position(&self) -> f32 {
        let position = self.input.value().filter(|_| self.gate == Gate::Open);
        position.unwrap_or(0.0)
    }

    fn is_deflected(&self) -> bool {
        self.input
            .value()
            .is_some_and(|position| position.abs() > NEUTRAL)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TIMEOUT_US: u64 = 1_500_000;

    fn positions(controls: &Controls) -> (f32, f32) {
        (controls.throttle(), controls.steering())
    }

    #[test]
    fn a_lever_stays_until_it_is_moved_or_released() {
        let mut controls = Controls::default();
        assert_eq!(positions(&controls), (0.0, 0.0));
        controls.take(0, Lever::At(500), Lever::At(i16::MIN));
        assert_eq!(positions(&controls), (0.5, -1.0));
        controls.take(0, Lever::Unchanged, Lever::Released);
        assert_eq!(positions(&controls), (0.5, 0.0));
        controls.take(0, Lever::Released, Lever::Unchanged);
        assert_eq!(positions(&controls), (0.0, 0.0));
        assert!(!controls.times_out(u64::MAX, TIMEOUT_US, ArmState::Armed));
    }

    #[test]
    fn each_lever_times_out_by_itself_and_stays_neutral() {
        for arm_state in [ArmState::Disarmed, ArmState::Armed] {
            let mut controls = Controls::default();
            controls.take(0, Lever::At(1000), Lever::At(1000));
            controls.take(1_000_000, Lever::Unchanged, Lever::At(500));
            let is_failure = controls.times_out(1_500_001, TIMEOUT_US, arm_state);
            assert_eq!(is_failure, arm_state == ArmState::Armed);
            assert_eq!(positions(&controls), (0.0, 0.5));
            controls.take(1_600_000, Lever::Unchanged, Lever::At(250));
            assert_eq!(positions(&controls), (0.0, 0.25));
            assert_eq!(
                controls.have_timed_out(),
                is_failure,
                "the throttle did not come back"
            );
            controls.take(1_700_000, Lever::Released, Lever::Unchanged);
            assert!(!controls.have_timed_out());
        }
    }

    #[test]
    fn a_message_about_other_levers_refreshes_nothing() {
        let mut controls = Controls::default();
        assert!(controls.take(0, Lever::At(1000), Lever::At(1000)));
        assert!(!controls.take(2_000_000, Lever::Unchanged, Lever::Unchanged));
        assert!(controls.times_out(2_000_000, TIMEOUT_US, ArmState::Armed));
        assert_eq!(positions(&controls), (0.0, 0.0));
    }

    #[test]
    fn no_position_from_before_arming_drives() {
        let mut controls = Controls::default();
        controls.take(0, Lever::At(50), Lever::At(-50));
        assert_eq!(controls.deflected(), None);
        controls.arm();
        assert_eq!(positions(&controls), (0.0, 0.0));
        controls.take(0, Lever::At(800), Lever::Unchanged);
        assert_eq!(positions(&controls), (0.8, 0.0));
    }

    #[test]
    fn a_lever_that_was_deflected_when_armed_drives_after_it_was_neutral() {
        let mut controls = Controls::default();
        controls.take(0, Lever::At(-1000), Lever::At(60));
        assert_eq!(controls.deflected(), Some(LeverName::Throttle));
        controls.arm();
        controls.take(0, Lever::At(-1000), Lever::At(0));
        assert_eq!(positions(&controls), (0.0, 0.0));
        // Armed again meanwhile, and after a silence, too.
        controls.disarm();
        controls.times_out(2_000_000, TIMEOUT_US, ArmState::Disarmed);
        controls.arm();
        controls.take(2_000_000, Lever::At(-1000), Lever::At(60));
        assert_eq!(positions(&controls), (0.0, 0.06));
        controls.take(2_000_000, Lever::At(0), Lever::Unchanged);
        controls.take(2_000_000, Lever::At(-1000), Lever::Unchanged);
        assert_eq!(positions(&controls), (-1.0, 0.06));
    }
}
