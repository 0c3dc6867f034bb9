//! What a scenario consists of.

use std::fmt;

use crate::host::sim::{PackModel, SimulatedPack};
use crate::parameter::{ParameterId, Parameters};
use crate::vehicle::ArmState;
use crate::vehicle::Mode;

/// A story.
#[derive(Debug)]
pub struct Scenario {
    /// What it is called on the command line.
    pub name: &'static str,
    /// What will happen, in a sentence.
    pub summary: &'static str,
    /// How many times as fast as the wall clock it takes about a minute.
    pub speedup: f64,
    /// The pack at the start.
    pub pack: Plugged,
    /// Parameters with which the vehicle starts, as if they were in its flash. They are not written there.
    pub parameters: &'static [(&'static str, f32)],
    /// What happens, in the order of time.
    pub steps: &'static [Step],
    /// When it ends, in seconds of simulated time since the start.
    pub end_s: u32,
    /// What is looked for in what the vehicle announces, for the closing sentence.
    pub sights: &'static [Sight],
}

/// A pack that is plugged in.
#[derive(Clone, Copy, Debug)]
pub struct Plugged {
    /// What kind of pack it is.
    pub model: PackModel,
    /// Its state of charge, 0 to 1.
    pub charge: f32,
}

impl Plugged {
    /// The rested pack.
    pub fn pack(self) -> SimulatedPack {
        SimulatedPack::charged(self.model, self.charge)
    }
}

/// Something that happens.
#[derive(Debug)]
pub struct Step {
    /// When, in seconds of simulated time since the start.
    pub at_s: u32,
    /// What it is, as it is printed.
    pub what: &'static str,
    /// What is done.
    pub actions: &'static [Action],
}

/// What is done in a step.
#[derive(Clone, Copy, Debug)]
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
    PlugIn(Plugged),
}

/// Something that is looked for.
#[derive(Debug)]
pub struct Sight {
    /// What the closing sentence calls it.
    pub name: &'static str,
    /// How announcements of it begin, or the mode.
    pub texts: &'static [&'static str],
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
