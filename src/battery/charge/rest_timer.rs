//! When a rest is evaluated.

/// A shorter rest teaches nothing, in seconds.
const FIRST_S: f32 = 30.0;

/// Measures a rest. It is evaluated after half a minute, and again whenever it has lasted twice as long.
#[derive(Clone, Copy, Debug)]
pub(super) struct RestTimer {
    rested_s: f32,
    due_s: f32,
}

impl RestTimer {
    pub const fn new() -> Self {
        Self {
            rested_s: 0.0,
            due_s: FIRST_S,
        }
    }

    /// The pack rested for another `dt_s` seconds. Returns whether an evaluation is due.
    pub fn rest(&mut self, dt_s: f32) -> bool {
        self.rested_s += dt_s;
        let is_due = self.rested_s >= self.due_s;
        if is_due {
            self.due_s = 2.0 * self.rested_s;
        }
        is_due
    }
}
