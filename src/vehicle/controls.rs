//! The driver's sticks.

use super::ArmState;
use super::timed_input::TimedInput;
use crate::parameter::StickChannel;
use crate::time::Instant;

/// Content of a control message about a stick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum StickInput {
    /// Its position, from −1000 (back, left) to 1000 (ahead, right).
    Position(i16),
    /// The override is released.
    Released,
    /// The message is about other channels, or has a value that no stick has.
    Unchanged,
}

impl StickInput {
    /// Whether it is a position off neutral.
    pub fn is_deflected(self) -> bool {
        matches!(self, Self::Position(position) if !is_neutral(position))
    }

    /// Whether it is a position, and neutral.
    pub fn is_neutral(self) -> bool {
        matches!(self, Self::Position(position) if is_neutral(position))
    }

    /// Reads the stick of one channel from the pulses of all, in microseconds.
    pub fn of_channel(channel: &StickChannel, pulses_us: &[u16]) -> Self {
        const RELEASED_US: u16 = 0;
        match channel.pulse_of(pulses_us) {
            Some(RELEASED_US) => Self::Released,
            pulse_us => {
                let position = pulse_us.and_then(|pulse_us| channel.position(pulse_us));
                position.map_or(Self::Unchanged, Self::Position)
            }
        }
    }

    /// Reads the stick of an axis, from −1000 to 1000.
    // Inlined, it would be repeated for each axis.
    #[inline(never)]
    pub fn of_axis(position: i16) -> Self {
        /// An axis that the sender does not have.
        const NO_AXIS: i16 = i16::MAX;
        match position {
            NO_AXIS => Self::Released,
            _ if (-FULL_DEFLECTION..=FULL_DEFLECTION).contains(&position) => Self::Position(position),
            _ => Self::Unchanged,
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
const DEADBAND: i16 = 50;

/// Whether a position is within the deadband.
fn is_neutral(position: i16) -> bool {
    (-DEADBAND..=DEADBAND).contains(&position)
}

/// The driver's sticks. Each times out separately: a message about one does not refresh the other. From rest neither drives
/// before all that are in use were neutral at the same time: a finger held ahead is a few percent off the centre of the steering.
#[derive(Clone, Copy, Debug, Default)]
pub struct Controls {
    throttle: StickState,
    steering: StickState,
}

impl Controls {
    /// Processes a control message. Returns whether it was about a stick at all.
    pub fn receive(&mut self, received_at: Instant, throttle: StickInput, steering: StickInput) -> bool {
        let rests = ![&self.throttle, &self.steering]
            .into_iter()
            .any(StickState::is_driving);
        self.throttle.receive(received_at, throttle);
        self.steering.receive(received_at, steering);
        if rests && self.waiting().is_some() {
            self.require_neutral();
        }
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

    /// Closes both gates: if no latest position is deflected, a stick that was neutral drives with the next message. Any other has
    /// to be centred first.
    pub fn close(&mut self) {
        if self.deflected().is_some() {
            self.require_neutral();
        }
        self.throttle.close();
        self.steering.close();
    }

    /// Requires both sticks to be centred before they drive, whatever their latest positions are.
    pub fn require_neutral(&mut self) {
        self.throttle.gate = Gate::AwaitsNeutral;
        self.steering.gate = Gate::AwaitsNeutral;
    }

    /// Centres both sticks for a driver who has left. They go on ageing, and so time out.
    pub fn centre(&mut self) {
        self.throttle.centre();
        self.steering.centre();
    }

    /// Hands the sticks over to another driver, of whose sticks this was heard before.
    pub fn hand_over(&mut self, mut heard: Self) {
        heard.close();
        self.centre();
        self.throttle.gate = heard.throttle.gate;
        self.steering.gate = heard.steering.gate;
    }

    /// Whether the latest positions are neutral, and not from before `since`.
    pub fn are_neutral_since(&self, since: Instant) -> bool {
        let received_at = self
            .throttle
            .input
            .received_at()
            .max(self.steering.input.received_at());
        self.deflected().is_none() && received_at >= Some(since)
    }

    /// A deflected stick that has to be centred before it drives.
    pub fn waiting(&self) -> Option<Stick> {
        if self.throttle.is_waiting() {
            Some(Stick::Throttle)
        } else if self.steering.is_waiting() {
            Some(Stick::Steering)
        } else {
            None
        }
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

/// Interlock that keeps a stick from driving before its driver has centred it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum Gate {
    /// The stick drives.
    Open,
    /// Opened by the next message: the latest position, from before the gate was closed, is neutral.
    AwaitsMessage,
    /// Opened by a neutral position.
    #[default]
    AwaitsNeutral,
}

/// The state of a stick.
#[derive(Clone, Copy, Debug, Default)]
struct StickState {
    /// From −1000 to 1000.
    input: TimedInput<i16>,
    gate: Gate,
}

impl StickState {
    fn receive(&mut self, received_at: Instant, input: StickInput) {
        match input {
            StickInput::Position(position) => {
                self.input.receive(received_at, position);
                if self.gate == Gate::AwaitsMessage || is_neutral(position) {
                    self.gate = Gate::Open;
                }
            }
            // A deliberate release is not a failure.
            StickInput::Released => *self = Self::default(),
            StickInput::Unchanged => {}
        }
    }

    fn close(&mut self) {
        let was_neutral = self.gate != Gate::AwaitsNeutral && self.input.value().is_some_and(is_neutral);
        self.gate = if was_neutral {
            Gate::AwaitsMessage
        } else {
            Gate::AwaitsNeutral
        };
    }

    fn centre(&mut self) {
        self.input.replace(0);
        self.gate = Gate::AwaitsNeutral;
    }

    /// From −1 to 1; 0 without input.
    fn position(&self) -> f32 {
        let position = self.input.value().filter(|_| self.gate == Gate::Open);
        f32::from(position.unwrap_or(0)) / f32::from(FULL_DEFLECTION)
    }

    // Inlined, it would be repeated for each stick in each use.
    #[inline(never)]
    fn is_deflected(&self) -> bool {
        self.input.value().is_some_and(|position| !is_neutral(position))
    }

    fn is_driving(&self) -> bool {
        self.gate == Gate::Open && self.is_deflected()
    }

    fn is_waiting(&self) -> bool {
        self.gate == Gate::AwaitsNeutral && self.is_deflected()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;
    use StickInput::{Position, Released, Unchanged};

    const TIMEOUT_US: u64 = 1_500_000;

    fn positions(controls: &Controls) -> (f32, f32) {
        (controls.throttle(), controls.steering())
    }

    const NEUTRAL: StickInput = Position(0);

    /// Sticks that were neutral at the start.
    fn centred() -> Controls {
        let mut controls = Controls::default();
        controls.receive(Instant::EPOCH, NEUTRAL, NEUTRAL);
        controls
    }

    #[test]
    fn stick_keeps_its_position_until_the_next_message() {
        let mut controls = centred();
        assert_eq!(positions(&controls), (0.0, 0.0));
        controls.receive(Instant::EPOCH, Position(500), Position(-1000));
        assert_eq!(positions(&controls), (0.5, -1.0));
        controls.receive(Instant::EPOCH, Unchanged, Released);
        assert_eq!(positions(&controls), (0.5, 0.0));
        controls.receive(Instant::EPOCH, Released, Unchanged);
        assert_eq!(positions(&controls), (0.0, 0.0));
        assert!(!controls.times_out(Instant::MAX, TIMEOUT_US, ArmState::Armed));
    }

    #[test]
    fn sticks_time_out_separately_and_stay_neutral() {
        for arm_state in [ArmState::Disarmed, ArmState::Armed] {
            let mut controls = centred();
            controls.receive(Instant::EPOCH, Position(1000), Position(1000));
            controls.receive(at_us(1_000_000), Unchanged, Position(500));
            let is_failure = controls.times_out(at_us(1_500_001), TIMEOUT_US, arm_state);
            assert_eq!(is_failure, arm_state == ArmState::Armed);
            assert_eq!(positions(&controls), (0.0, 0.5));
            controls.receive(at_us(1_600_000), Unchanged, Position(250));
            assert_eq!(positions(&controls), (0.0, 0.25));
            assert_eq!(controls.have_timed_out(), is_failure, "no throttle message since");
            controls.receive(at_us(1_700_000), Released, Unchanged);
            assert!(!controls.have_timed_out());
        }
    }

    #[test]
    fn a_closed_gate_opens_by_the_next_message_only_if_all_positions_were_neutral() {
        for (position, expected) in [(50, (0.0, 0.9)), (51, (0.0, 0.0))] {
            let mut controls = centred();
            controls.receive(Instant::EPOCH, Position(position), NEUTRAL);
            controls.close();
            controls.receive(Instant::EPOCH, NEUTRAL, Position(900));
            assert_eq!(positions(&controls), expected, "{position}");
        }
    }

    #[test]
    fn values_that_no_stick_has_leave_it_unchanged() {
        for (position, input) in [
            (i16::MIN, Unchanged),
            (-1001, Unchanged),
            (-1000, Position(-1000)),
            (1000, Position(1000)),
            (1001, Unchanged),
            (i16::MAX - 1, Unchanged),
            (i16::MAX, Released),
        ] {
            assert_eq!(StickInput::of_axis(position), input, "{position}");
        }
        for (pulse_us, input) in [
            (0, Released),
            (1, Unchanged),
            (799, Unchanged),
            (800, Position(-1000)),
            (2200, Position(1000)),
            (2201, Unchanged),
            (u16::MAX - 1, Unchanged),
            (u16::MAX, Unchanged),
        ] {
            let read = StickInput::of_channel(&StickChannel::STEERING, &[pulse_us]);
            assert_eq!(read, input, "{pulse_us}");
        }
        assert_eq!(
            StickInput::of_channel(&StickChannel::THROTTLE, &[1500]),
            Unchanged
        );
    }

    #[test]
    fn a_neutral_stick_drives_with_the_next_message_after_the_gate_was_closed() {
        let mut controls = Controls::default();
        controls.receive(Instant::EPOCH, Position(50), Position(-50));
        controls.close();
        controls.close();
        assert_eq!(positions(&controls), (0.0, 0.0));
        controls.receive(Instant::EPOCH, Position(800), Unchanged);
        assert_eq!(positions(&controls), (0.8, 0.0));
    }

    #[test]
    fn a_stick_that_was_deflected_or_silent_when_the_gate_was_closed_has_to_be_centred() {
        let deflected = Position(-1000);
        let mut controls = centred();
        controls.receive(Instant::EPOCH, deflected, Position(50));
        assert_eq!(controls.deflected(), Some(Stick::Throttle));
        controls.close();
        controls.receive(Instant::EPOCH, deflected, Position(60));
        assert_eq!(positions(&controls), (0.0, 0.0));
        // Closed again, after a time-out.
        controls.disarm();
        controls.times_out(at_us(2_000_000), TIMEOUT_US, ArmState::Disarmed);
        controls.close();
        controls.receive(at_us(2_000_000), deflected, Position(60));
        assert_eq!(positions(&controls), (0.0, 0.0));
        controls.receive(at_us(2_000_000), NEUTRAL, NEUTRAL);
        controls.receive(at_us(2_000_000), deflected, Unchanged);
        assert_eq!(positions(&controls), (-1.0, 0.0));
    }

    #[test]
    fn another_driver_brings_what_was_heard_of_its_own_sticks() {
        let mut heard = Controls::default();
        heard.receive(Instant::EPOCH, NEUTRAL, Unchanged);
        let mut controls = centred();
        controls.receive(Instant::EPOCH, Position(700), Position(700));
        controls.hand_over(heard);
        assert_eq!((positions(&controls), controls.deflected()), ((0.0, 0.0), None));
        controls.receive(Instant::EPOCH, Position(800), Unchanged);
        assert_eq!(positions(&controls), (0.8, 0.0));
        // Its first positions were not neutral before.
        controls.hand_over(heard);
        controls.receive(Instant::EPOCH, Position(800), Position(800));
        assert_eq!(positions(&controls), (0.0, 0.0));
        // The sticks of its predecessor time out.
        let mut controls = centred();
        controls.hand_over(heard);
        assert!(controls.times_out(at_us(1_500_001), TIMEOUT_US, ArmState::Armed));
    }
}
