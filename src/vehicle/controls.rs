//! The driver's sticks.

use super::ArmState;
use super::timed_input::TimedInput;
use crate::parameter::StickChannel;
use crate::time::Instant;

/// What a control message says about a stick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum StickInput {
    /// Its position, from −1000 (back, left) to 1000 (ahead, right), clamped.
    Position(i16),
    /// The override is released.
    Released,
    /// The message is about other channels.
    Unchanged,
}

impl StickInput {
    /// What the pulses of all channels, in microseconds, say about the stick of one.
    pub fn of_channel(channel: &StickChannel, pulses_us: &[u16]) -> Self {
        const RELEASED_US: u16 = 0;
        const UNCHANGED_US: u16 = u16::MAX;
        match channel.pulse_of(pulses_us) {
            None | Some(UNCHANGED_US) => Self::Unchanged,
            Some(RELEASED_US) => Self::Released,
            Some(pulse_us) => Self::Position(channel.position(pulse_us)),
        }
    }
}

/// One of the driver's sticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Stick {
    /// Ahead and back.
    Throttle,
    /// Left and right.
    Steering,
}

impl Stick {
    /// ArduPilot's name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Throttle => "Throttle",
            Self::Steering => "Steering",
        }
    }
}

const FULL_DEFLECTION: i16 = 1000;

/// Deadband of the neutral position: a worn gamepad rests a few percent off centre.
const DEADBAND: f32 = 0.05;

/// Whether a stick at this position is off neutral.
pub(super) fn is_deflected(position: i16) -> bool {
    share(position).abs() > DEADBAND
}

/// From −1 to 1.
fn share(position: i16) -> f32 {
    let position = position.clamp(-FULL_DEFLECTION, FULL_DEFLECTION);
    f32::from(position) / f32::from(FULL_DEFLECTION)
}

/// The driver's sticks. Each times out separately: a message about one does not refresh the other.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Controls {
    throttle: StickState,
    steering: StickState,
}

impl Controls {
    /// Processes a control message. Returns whether it was about a stick at all.
    pub fn receive(&mut self, received_at: Instant, throttle: StickInput, steering: StickInput) -> bool {
        self.throttle.receive(received_at, throttle);
        self.steering.receive(received_at, steering);
        (throttle, steering) != (StickInput::Unchanged, StickInput::Unchanged)
    }

    /// From −1 (full reverse) to 1 (full ahead).
    pub fn throttle(&self) -> f32 {
        self.throttle.position()
    }

    /// From −1 (left) to 1 (right).
    pub fn steering(&self) -> f32 {
        self.steering.position()
    }

    /// A stick that is deflected, which prevents arming.
    pub fn deflected(&self) -> Option<Stick> {
        if self.throttle.is_deflected() {
            Some(Stick::Throttle)
        } else if self.steering.is_deflected() {
            Some(Stick::Steering)
        } else {
            None
        }
    }

    /// On arming: positions from before do not drive.
    pub fn arm(&mut self) {
        self.throttle.arm();
        self.steering.arm();
    }

    /// Requires each stick to be neutral before it drives, and those that are in use before arming.
    pub fn require_neutral(&mut self) {
        self.throttle.gate = Gate::AwaitsNeutral;
        self.steering.gate = Gate::AwaitsNeutral;
    }

    /// On disarming: time-outs are cleared.
    pub fn disarm(&mut self) {
        self.throttle.input.clear_time_out();
        self.steering.input.clear_time_out();
    }

    /// Centres sticks without a message for `timeout_us`. Returns whether that is a failure.
    pub fn times_out(&mut self, now: Instant, timeout_us: u64, arm_state: ArmState) -> bool {
        let throttle = self.throttle.input.times_out(now, timeout_us, arm_state);
        let steering = self.steering.input.times_out(now, timeout_us, arm_state);
        throttle || steering
    }

    /// Whether a stick timed out while armed, without a message about it since.
    pub fn have_timed_out(&self) -> bool {
        self.throttle.input.has_timed_out() || self.steering.input.has_timed_out()
    }
}

/// Interlock that keeps a stick from driving after arming.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Gate {
    /// It drives.
    #[default]
    Open,
    /// Opened by the next message: the latest one is from before arming.
    AwaitsMessage,
    /// Opened by the neutral position: it was deflected on arming, or its channel has changed.
    AwaitsNeutral,
}

/// The state of a stick.
#[derive(Clone, Copy, Debug, Default)]
struct StickState {
    /// From −1 to 1.
    input: TimedInput<f32>,
    gate: Gate,
}

impl StickState {
    fn receive(&mut self, received_at: Instant, input: StickInput) {
        match input {
            StickInput::Position(position) => {
                let position = share(position);
                self.input.receive(received_at, position);
                if self.gate == Gate::AwaitsMessage || position.abs() <= DEADBAND {
                    self.gate = Gate::Open;
                }
            }
            // A deliberate release is not a failure.
            StickInput::Released => *self = Self::default(),
            StickInput::Unchanged => {}
        }
    }

    fn arm(&mut self) {
        self.gate = if self.is_deflected() || self.gate == Gate::AwaitsNeutral {
            Gate::AwaitsNeutral
        } else {
            Gate::AwaitsMessage
        };
    }

    /// From −1 to 1; 0 without input.
    fn position(&self) -> f32 {
        let position = self.input.value().filter(|_| self.gate == Gate::Open);
        position.unwrap_or(0.0)
    }

    /// Whether it is in use and not known to be neutral.
    fn is_deflected(&self) -> bool {
        let is_deflected = |position: f32| position.abs() > DEADBAND || self.gate == Gate::AwaitsNeutral;
        self.input.value().is_some_and(is_deflected)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    const TIMEOUT_US: u64 = 1_500_000;

    fn positions(controls: &Controls) -> (f32, f32) {
        (controls.throttle(), controls.steering())
    }

    #[test]
    fn stick_keeps_its_position_until_the_next_message() {
        let mut controls = Controls::default();
        assert_eq!(positions(&controls), (0.0, 0.0));
        controls.receive(
            Instant::EPOCH,
            StickInput::Position(500),
            StickInput::Position(i16::MIN),
        );
        assert_eq!(positions(&controls), (0.5, -1.0));
        controls.receive(Instant::EPOCH, StickInput::Unchanged, StickInput::Released);
        assert_eq!(positions(&controls), (0.5, 0.0));
        controls.receive(Instant::EPOCH, StickInput::Released, StickInput::Unchanged);
        assert_eq!(positions(&controls), (0.0, 0.0));
        assert!(!controls.times_out(Instant::MAX, TIMEOUT_US, ArmState::Armed));
    }

    #[test]
    fn sticks_time_out_separately_and_stay_neutral() {
        for arm_state in [ArmState::Disarmed, ArmState::Armed] {
            let mut controls = Controls::default();
            controls.receive(
                Instant::EPOCH,
                StickInput::Position(1000),
                StickInput::Position(1000),
            );
            controls.receive(at_us(1_000_000), StickInput::Unchanged, StickInput::Position(500));
            let is_failure = controls.times_out(at_us(1_500_001), TIMEOUT_US, arm_state);
            assert_eq!(is_failure, arm_state == ArmState::Armed);
            assert_eq!(positions(&controls), (0.0, 0.5));
            controls.receive(at_us(1_600_000), StickInput::Unchanged, StickInput::Position(250));
            assert_eq!(positions(&controls), (0.0, 0.25));
            assert_eq!(controls.have_timed_out(), is_failure, "no throttle message since");
            controls.receive(at_us(1_700_000), StickInput::Released, StickInput::Unchanged);
            assert!(!controls.have_timed_out());
        }
    }

    #[test]
    fn message_about_other_channels_refreshes_nothing() {
        let mut controls = Controls::default();
        assert!(controls.receive(
            Instant::EPOCH,
            StickInput::Position(1000),
            StickInput::Position(1000)
        ));
        assert!(!controls.receive(at_us(2_000_000), StickInput::Unchanged, StickInput::Unchanged));
        assert!(controls.times_out(at_us(2_000_000), TIMEOUT_US, ArmState::Armed));
        assert_eq!(positions(&controls), (0.0, 0.0));
    }

    #[test]
    fn position_from_before_arming_does_not_drive() {
        let mut controls = Controls::default();
        controls.receive(
            Instant::EPOCH,
            StickInput::Position(50),
            StickInput::Position(-50),
        );
        assert_eq!(controls.deflected(), None);
        controls.arm();
        assert_eq!(positions(&controls), (0.0, 0.0));
        controls.receive(Instant::EPOCH, StickInput::Position(800), StickInput::Unchanged);
        assert_eq!(positions(&controls), (0.8, 0.0));
    }

    #[test]
    fn stick_deflected_on_arming_must_be_neutral_first() {
        let mut controls = Controls::default();
        controls.receive(
            Instant::EPOCH,
            StickInput::Position(-1000),
            StickInput::Position(60),
        );
        assert_eq!(controls.deflected(), Some(Stick::Throttle));
        controls.arm();
        controls.receive(
            Instant::EPOCH,
            StickInput::Position(-1000),
            StickInput::Position(0),
        );
        assert_eq!(positions(&controls), (0.0, 0.0));
        // Also after rearming and after a time-out.
        controls.disarm();
        controls.times_out(at_us(2_000_000), TIMEOUT_US, ArmState::Disarmed);
        controls.arm();
        controls.receive(
            at_us(2_000_000),
            StickInput::Position(-1000),
            StickInput::Position(60),
        );
        assert_eq!(positions(&controls), (0.0, 0.06));
        controls.receive(at_us(2_000_000), StickInput::Position(0), StickInput::Unchanged);
        controls.receive(
            at_us(2_000_000),
            StickInput::Position(-1000),
            StickInput::Unchanged,
        );
        assert_eq!(positions(&controls), (-1.0, 0.06));
    }
}
