//! The driver's levers.

use super::watch::Watch;

/// What a control message says of a lever.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum Lever {
    /// It stands there, from −1000 (back, left) to 1000 (ahead, right); what lies beyond counts as the end.
    At(i16),
    /// It is let go.
    Released,
    /// It stays where it was.
    Unchanged,
}

const FULL_DEFLECTION: i16 = 1000;

impl Lever {
    /// Where a lever that was at `before` is now, from −1 to 1; `None` has nobody at it.
    fn after(self, before: Option<f32>) -> Option<f32> {
        match self {
            Self::At(position) => {
                let position = position.clamp(-FULL_DEFLECTION, FULL_DEFLECTION);
                Some(f32::from(position) / f32::from(FULL_DEFLECTION))
            }
            Self::Released => None,
            Self::Unchanged => before,
        }
    }
}

/// The levers, and whether somebody is at them.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Controls {
    throttle: Option<f32>,
    steering: Option<f32>,
    pub watch: Watch,
}

impl Controls {
    /// Takes a control message.
    pub fn take(&mut self, now_us: u64, throttle: Lever, steering: Lever) {
        if (throttle, steering) == (Lever::Unchanged, Lever::Unchanged) {
            return;
        }
        self.throttle = throttle.after(self.throttle);
        self.steering = steering.after(self.steering);
        if self.throttle.is_some() || self.steering.is_some() {
            self.watch.seen(now_us);
        } else {
            // The driver has let go on purpose: that is no failure.
            self.watch = Watch::default();
        }
    }

    /// From −1 (full speed back) to 1 (full speed ahead); 0 with nobody there.
    pub fn throttle(&self) -> f32 {
        self.if_alive(self.throttle)
    }

    /// From −1 (left) to 1 (right); 0 with nobody there.
    pub fn steering(&self) -> f32 {
        self.if_alive(self.steering)
    }

    fn if_alive(&self, lever: Option<f32>) -> f32 {
        lever.filter(|_| self.watch.is_alive()).unwrap_or(0.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::ArmState;

    #[test]
    fn levers_stay_until_they_are_moved_or_let_go() {
        let mut controls = Controls::default();
        assert_eq!((controls.throttle(), controls.steering()), (0.0, 0.0));
        controls.take(0, Lever::At(500), Lever::At(i16::MIN));
        assert_eq!((controls.throttle(), controls.steering()), (0.5, -1.0));
        controls.take(0, Lever::Unchanged, Lever::Released);
        assert_eq!((controls.throttle(), controls.steering()), (0.5, 0.0));
        assert!(controls.watch.is_alive());
        controls.take(0, Lever::Released, Lever::Unchanged);
        assert_eq!(controls.throttle(), 0.0);
        assert!(!controls.watch.is_alive());
    }

    #[test]
    fn a_message_for_other_levers_does_not_keep_the_controls_alive() {
        let mut controls = Controls::default();
        controls.take(0, Lever::At(1000), Lever::At(1000));
        controls.take(2_000_000, Lever::Unchanged, Lever::Unchanged);
        assert!(controls.watch.fails(2_000_000, 1_500_000, ArmState::Armed));
        assert_eq!((controls.throttle(), controls.steering()), (0.0, 0.0));
    }
}
