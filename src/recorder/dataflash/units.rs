//! Units and multipliers that the formats use, by ArduPilot's characters.

/// A unit and its name.
pub(super) const UNITS: [(u8, &str); 11] = [
    (b'-', ""),
    (b'#', "instance"),
    (b's', "s"),
    (b'v', "V"),
    (b'A', "A"),
    (b'a', "Ah"),
    (b'X', "W.h"),
    (b'O', "degC"),
    (b'w', "Ohm"),
    (b'%', "%"),
    (b'b', "B"),
];

/// A multiplier and its value. `-` is for what is not a number; `?` is ArduPilot's for hundredths of a degree, which the type
/// of the field divides already.
pub(super) const MULTIPLIERS: [(u8, f64); 6] = [
    (b'-', 0.0),
    (b'?', 1.0),
    (b'0', 1.0),
    (b'A', 1e-1),
    (b'C', 1e-3),
    (b'F', 1e-6),
];
