//! Parameters of the driver's sticks: which channels of RC_CHANNELS_OVERRIDE they are, and what their pulses mean.

#[cfg(not(target_os = "none"))]
use super::Documentation;
use super::{Kind, Parameter, Range, means};

/// Channels that an axis can have: those of RC_CHANNELS_OVERRIDE in MAVLink 1.
const CHANNELS: Range = Range::Between(1.0, 8.0);

/// Lengths of pulses, in microseconds. What does not fit the other two of a channel is in
/// [`Parameters::stick_misfits`](crate::parameter::Parameters::stick_misfits).
pub(in crate::parameter) const SHORTEST_US: f32 = 800.0;
pub(in crate::parameter) const LONGEST_US: f32 = 2200.0;
pub(in crate::parameter) const LEAST_TRAVEL_US: f32 = 100.0;

/// The rows of the axes, and those of the channels, of which four are like each other.
macro_rules! sticks {
    (
        axes: [$($axis:ident $name:literal $axis_key:literal $channel:literal $label:literal $about:literal;)*]
        channels: [$($number:literal $key:literal $min:ident $max:ident $trim:ident $reversed:ident;)*]
    ) => {
        parameters! {
            /// A parameter of the driver's sticks.
            StickParameter

            $($axis {
                key: $axis_key,
                name: concat!("RCMAP_", $name),
                kind: Kind::Int8,
                default: $channel,
                range: CHANNELS,
            } Documentation {
                label: $label,
                description: concat!($about, " Arming is refused while the throttle or the steering shares its channel. A change takes effect when the rover is disarmed."),
            })*
            $($min {
                key: $key,
                name: concat!("RC", $number, "_MIN"),
                kind: Kind::Int16,
                default: 1000.0,
                range: Range::Between(SHORTEST_US, LONGEST_US - 2.0 * LEAST_TRAVEL_US),
            } Documentation {
                label: concat!("Channel ", $number, ": shortest pulse"),
                description: concat!(
                    "Pulse in RC_CHANNELS_OVERRIDE that is a stick's full deflection back or left, at least 100 µs shorter \
                     than RC", $number, "_TRIM. A change takes effect when the rover is disarmed; a stick has to be neutral \
                     once then."
                ),
                unit: "µs",
            }
            $max {
                key: $key + 1,
                name: concat!("RC", $number, "_MAX"),
                kind: Kind::Int16,
                default: 2000.0,
                range: Range::Between(SHORTEST_US + 2.0 * LEAST_TRAVEL_US, LONGEST_US),
            } Documentation {
                label: concat!("Channel ", $number, ": longest pulse"),
                description: concat!(
                    "Pulse of a stick's full deflection ahead or right, at least 100 µs longer than RC", $number, "_TRIM. A \
                     change takes effect when the rover is disarmed."
                ),
                unit: "µs",
            }
            $trim {
                key: $key + 2,
                name: concat!("RC", $number, "_TRIM"),
                kind: Kind::Int16,
                default: 1500.0,
                range: Range::Between(SHORTEST_US + LEAST_TRAVEL_US, LONGEST_US - LEAST_TRAVEL_US),
            } Documentation {
                label: concat!("Channel ", $number, ": neutral pulse"),
                description: "Pulse of a stick that is neutral. A change takes effect when the rover is disarmed.",
                unit: "µs",
            }
            $reversed {
                key: $key + 3,
                name: concat!("RC", $number, "_REVERSED"),
                kind: Kind::Int8,
                default: 0.0,
                range: Range::OneOf(&[(0, means("Normal")), (1, means("Reversed"))]),
            } Documentation {
                label: concat!("Channel ", $number, ": direction"),
                description: "Whether longer pulses are back or left. A change takes effect when the rover is disarmed.",
            })*
        }
    };
}

sticks! {
    axes: [
        RcmapRoll "ROLL" 32 1.0 "Channel of the steering" "Channel of RC_CHANNELS_OVERRIDE that steers.";
        RcmapPitch "PITCH" 33 2.0 "Channel without function" "For ground stations: a rover has no pitch.";
        RcmapThrottle "THROTTLE" 34 3.0 "Channel of the throttle" "Channel of RC_CHANNELS_OVERRIDE that is the throttle.";
        RcmapYaw "YAW" 35 4.0 "Channel without function" "For ground stations: a rover steers by RCMAP_ROLL.";
    ]
    channels: [
        1 36 Rc1Min Rc1Max Rc1Trim Rc1Reversed;
        2 40 Rc2Min Rc2Max Rc2Trim Rc2Reversed;
        3 44 Rc3Min Rc3Max Rc3Trim Rc3Reversed;
        4 48 Rc4Min Rc4Max Rc4Trim Rc4Reversed;
    ]
}
