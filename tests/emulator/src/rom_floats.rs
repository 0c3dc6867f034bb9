//! The boot ROM's routines for singles (datasheet 2.8.3.2), as far as firmware calls them: the result by the host's own
//! arithmetic, for the time that the ROM takes.
//!
//! They round to nearest, ties to even, as IEEE 754 requires. They have neither subnormals nor NaN: subnormal operands and
//! results are zeros of the same sign, NaN is taken for infinity of the same sign, and what has no result gives infinity
//! (the ROM's published source, `mufplib.S`).

/// A routine of the ROM's table of singles.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FloatRoutine {
    Add,
    Subtract,
    Multiply,
    Divide,
}

const EXPONENT: u32 = 0x7f80_0000;
const SIGN: u32 = 0x8000_0000;

impl FloatRoutine {
    /// In the order of the table, which begins with them.
    pub const ALL: [Self; 4] = [Self::Add, Self::Subtract, Self::Multiply, Self::Divide];

    /// What it takes on average.
    pub fn cycles(self) -> u64 {
        match self {
            Self::Add | Self::Divide => 71,
            Self::Subtract => 74,
            Self::Multiply => 69,
        }
    }

    /// What it leaves in R0 of what is in R0 and R1.
    pub fn result(self, a: u32, b: u32) -> u32 {
        match self {
            Self::Add => sum(a, b),
            Self::Subtract => sum(a, b ^ SIGN),
            Self::Multiply => product(a, b),
            Self::Divide => quotient(a, b),
        }
    }
}

fn sum(a: u32, b: u32) -> u32 {
    match (is_infinite(a), is_infinite(b)) {
        // Of opposite infinities the positive one remains.
        (true, true) => infinity(a & b),
        (true, false) => infinity(a),
        (false, true) => infinity(b),
        (false, false) => without_subnormals(single(a) + single(b)),
    }
}

fn product(a: u32, b: u32) -> u32 {
    if is_infinite(a) || is_infinite(b) {
        return infinity(a ^ b);
    }
    without_subnormals(single(a) * single(b))
}

fn quotient(a: u32, b: u32) -> u32 {
    let sign = (a ^ b) & SIGN;
    match (is_infinite(a), is_infinite(b)) {
        (_, false) if single(b) == 0.0 => infinity(sign),
        (true, _) => infinity(sign),
        (false, true) => sign,
        (false, false) => without_subnormals(single(a) / single(b)),
    }
}

fn is_infinite(bits: u32) -> bool {
    bits & EXPONENT == EXPONENT
}

fn infinity(sign: u32) -> u32 {
    EXPONENT | sign & SIGN
}

/// An operand as the ROM takes it.
fn single(bits: u32) -> f32 {
    f32::from_bits(if bits & EXPONENT == 0 { bits & SIGN } else { bits })
}

fn without_subnormals(result: f32) -> u32 {
    single(result.to_bits()).to_bits()
}

#[cfg(test)]
mod tests {
    use super::FloatRoutine::{Add, Divide, Multiply, Subtract};

    const INFINITY: f32 = f32::INFINITY;
    /// The largest subnormal number.
    const SUBNORMAL: f32 = f32::from_bits(0x007f_ffff);

    #[test]
    fn results_are_rounded_and_without_subnormals_and_nan() {
        for (routine, a, b, expected) in [
            // Rounded to the nearest, ties to even.
            (Add, 1.5, 2.25, 3.75),
            (Add, 16_777_216.0, 1.0, 16_777_216.0),
            (Add, 16_777_218.0, 1.0, 16_777_220.0),
            (Subtract, 1.0, 1.0, 0.0),
            (Subtract, -1.0, 2.5, -3.5),
            (Multiply, 0.1, 0.1, 0.010_000_001),
            (Multiply, -3.0, 0.0, -0.0),
            (Divide, 1.0, 3.0, 0.333_333_34),
            (Divide, 0.0, -3.0, -0.0),
            // Too large is infinite, too small is zero.
            (Add, f32::MAX, f32::MAX, INFINITY),
            (Add, SUBNORMAL, SUBNORMAL, 0.0),
            (Subtract, 1.5 * f32::MIN_POSITIVE, f32::MIN_POSITIVE, 0.0),
            (Multiply, 1e30, -1e30, -INFINITY),
            (Multiply, -1e-30, 1e-30, -0.0),
            (Multiply, SUBNORMAL, 1e30, 0.0),
            (Divide, 1e30, 1e-30, INFINITY),
            (Divide, f32::MIN_POSITIVE, -2.0, -0.0),
            // Without a result it is infinite.
            (Add, INFINITY, -INFINITY, INFINITY),
            (Add, f32::NAN, 1.0, INFINITY),
            (Multiply, 0.0, -INFINITY, -INFINITY),
            (Divide, 0.0, 0.0, INFINITY),
            (Divide, 0.0, SUBNORMAL, INFINITY),
            (Divide, 1.0, INFINITY, 0.0),
        ] {
            let result = routine.result(f32::to_bits(a), f32::to_bits(b));
            assert_eq!(
                result,
                f32::to_bits(expected),
                "{routine:?} {a} {b} is {expected}"
            );
        }
    }
}
