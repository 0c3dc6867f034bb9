//! An H-bridge with the motor at its outputs.

use super::signal::PinSignal;

/// A brushed motor: a winding, and a shaft that turns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    pub resistance_ohm: f64,
    pub inductance_h: f64,
    pub shaft: Shaft,
}

/// The motor's speed, as the voltage that it induces.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shaft {
    /// Held at a speed, or at a standstill (0 V). Positive is the direction of IN1.
    Held { back_emf_v: f64 },
    /// It turns as the current drives it.
    Turning {
        /// The time in which speed follows voltage, inertia × resistance / constant².
        time_constant_s: f64,
        /// The current that friction takes, at any speed.
        friction_a: f64,
    },
}

impl Motor {
    /// A TT gear motor: stalled it takes 1.5 A at 6 V, idling 0.15 A (Adafruit 3777). Its inductance and the rover's inertia are
    /// assumed.
    pub const TT: Self = Self {
        resistance_ohm: 4.0,
        inductance_h: 1.5e-3,
        shaft: Shaft::Turning {
            time_constant_s: 0.15,
            friction_a: 0.15,
        },
    };

    /// This motor, blocked.
    pub const fn stalled(self) -> Self {
        Self {
            shaft: Shaft::Held { back_emf_v: 0.0 },
            ..self
        }
    }
}

/// The switches of a bridge.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Switches {
    /// Of both that conduct together.
    pub resistance_ohm: f64,
    /// Forward voltage of the diode in parallel to each.
    pub diode_v: f64,
}

impl Switches {
    /// The DRV8837: 280 mΩ (SLVSBA4, page 1). The diode's voltage is assumed.
    pub const DRV8837: Self = Self {
        resistance_ohm: 0.28,
        diode_v: 0.8,
    };
}

/// A bridge's inputs, and what it leads to.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bridge {
    /// The GPIO numbers of IN1 and IN2.
    pub pins: [usize; 2],
    pub switches: Switches,
    /// `None`: unplugged.
    pub motor: Option<Motor>,
}

/// "Table 1. DRV8837 Device Logic" (SLVSBA4).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Coast,
    Forward,
    Reverse,
    /// Both ends of the winding are at ground.
    Brake,
}

impl Mode {
    fn of([in1, in2]: [bool; 2]) -> Self {
        match (in1, in2) {
            (false, false) => Self::Coast,
            (true, false) => Self::Forward,
            (false, true) => Self::Reverse,
            (true, true) => Self::Brake,
        }
    }
}

/// A bridge at work.
#[derive(Clone, Debug)]
pub struct Drive {
    pub bridge: Bridge,
    signals: [PinSignal; 2],
    pub mode: Mode,
    /// Through the winding, positive from OUT1 to OUT2.
    pub amperes: f64,
    pub back_emf_v: f64,
}

/// A winding as a circuit between the pack's terminals: `inductance · di/dt = share · pack volts + volts - resistance · i`, and
/// the pack gives `share · i`.
#[derive(Clone, Copy, Debug, Default)]
pub struct Branch {
    pub share: f64,
    pub volts: f64,
    pub resistance_ohm: f64,
    pub inductance_h: f64,
    /// It conducts by its diodes, which end at a current of 0.
    pub ends_at_zero: bool,
}

impl Drive {
    pub fn new(bridge: Bridge) -> Self {
        Self {
            bridge,
            signals: [PinSignal::Level(false); 2],
            mode: Mode::Coast,
            amperes: 0.0,
            back_emf_v: match bridge.motor.map(|motor| motor.shaft) {
                Some(Shaft::Held { back_emf_v }) => back_emf_v,
                Some(Shaft::Turning { .. }) | None => 0.0,
            },
        }
    }

    pub fn set_signals(&mut self, signals: [PinSignal; 2]) {
        self.signals = signals;
    }

    /// Follows the inputs. Returns when they may change again.
    pub fn follow_inputs(&mut self, now: u64) -> u64 {
        self.mode = Mode::of(self.signals.each_mut().map(|signal| signal.level(now)));
        let [in1, in2] = self.signals.each_ref().map(PinSignal::next_change);
        in1.min(in2)
    }

    /// Plugs in another motor, which does not turn yet, or none.
    pub fn plug_in(&mut self, motor: Option<Motor>) {
        let bridge = Bridge { motor, ..self.bridge };
        *self = Self {
            signals: self.signals,
            mode: self.mode,
            ..Self::new(bridge)
        };
    }

    /// `None` if no current flows, and none will as the inputs are.
    pub fn branch(&self) -> Option<Branch> {
        let Bridge { motor, switches, .. } = self.bridge;
        let motor = motor?;
        let (share, diodes_v) = match self.mode {
            Mode::Forward => (1.0, 0.0),
            Mode::Reverse => (-1.0, 0.0),
            Mode::Brake => (0.0, 0.0),
            Mode::Coast if self.amperes == 0.0 => return None,
            // Against the pack and two diodes.
            Mode::Coast => (
                -self.amperes.signum(),
                -2.0 * switches.diode_v * self.amperes.signum(),
            ),
        };
        let ends_at_zero = self.mode == Mode::Coast;
        Some(Branch {
            share,
            volts: diodes_v - self.back_emf_v,
            resistance_ohm: motor.resistance_ohm
                + if ends_at_zero {
                    0.0
                } else {
                    switches.resistance_ohm
                },
            inductance_h: motor.inductance_h,
            ends_at_zero,
        })
    }

    /// The shaft after a time in which so much charge has flowed through the winding.
    pub fn turn(&mut self, coulombs: f64, seconds: f64) {
        let Some(Motor {
            resistance_ohm,
            shaft,
            ..
        }) = self.bridge.motor
        else {
            return;
        };
        let Shaft::Turning {
            time_constant_s,
            friction_a,
        } = shaft
        else {
            return;
        };
        let per_coulomb = resistance_ohm / time_constant_s;
        let driven = self.back_emf_v + per_coulomb * coulombs;
        // Friction stops it, and does not turn it round.
        let friction = per_coulomb * friction_a * seconds;
        self.back_emf_v = driven.signum() * (driven.abs() - friction).max(0.0);
    }
}
