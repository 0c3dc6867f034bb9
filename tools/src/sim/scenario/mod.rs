//! Stories that the simulator plays without a ground station: what happens to the rover and its pack, and when.
//!
//! What a scenario's driver does goes to the vehicle as MAVLink messages; only what hands do to a pack is done to the
//! simulated pack itself.

mod play;
mod table;

use std::fmt;

use rover_battmon::parameter::{ParameterId, Parameters};
use rover_battmon::vehicle::ArmState;
use rover_battmon::vehicle::Mode;

use super::SimulatedPack;

pub(super) use play::Player;

/// A story.
#[derive(Debug)]
pub struct Scenario {
    /// Its name on the command line.
    pub name: &'static str,
    /// Description in a sentence.
    pub summary: &'static str,
    /// How many times as fast as the wall clock it takes about a minute.
    pub speedup: f64,
    /// The pack at the start.
    pub pack: SimulatedPack,
    /// Whether it can be played with another one: its own is in no step, and does not have what the story is about.
    pub takes_any_pack: bool,
    /// Parameters with which the vehicle starts, as if they were in its flash. They are not written there.
    pub parameters: &'static [(&'static str, f32)],
    /// Steps in the order of time.
    pub steps: &'static [Step],
    /// When it ends, in seconds of simulated time since the start.
    pub end_s: u32,
    /// What is looked for in what the vehicle announces: what the closing sentence calls it, and how announcements of it
    /// begin, or the mode.
    pub sights: &'static [(&'static str, &'static [&'static str])],
}

/// Something that happens: when, in seconds of simulated time since the start; what it is, as it is printed; and what is
/// done.
pub type Step = (u32, &'static str, &'static [Action]);

/// Action of a step.
#[derive(Clone, Debug)]
pub enum Action {
    /// A parameter is set, for a fault that begins or ends.
    Set(&'static str, f32),
    /// The mode is changed.
    Mode(Mode),
    /// The rover is armed or disarmed.
    Arm(ArmState),
    /// The throttle is moved, from −1000 (back) to 1000 (ahead), and stays there.
    Throttle(i16),
    /// The pack is unplugged.
    Unplug,
    /// A pack is plugged in.
    PlugIn(SimulatedPack),
}

impl Scenario {
    /// Sets its parameters.
    pub fn set_up(&self, parameters: &mut Parameters) {
        for (name, value) in self.parameters {
            let id = ParameterId::from_name(name.as_bytes());
            let set = id.map(|id| parameters.restore(id.key(), *value));
            debug_assert_eq!(set, Some(Ok(())), "{name}");
        }
    }
}

impl fmt::Display for Scenario {
    /// The name and what will happen.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {}", self.name, self.summary)
    }
}
