//! Numbers in texts, without float formatting.

use core::fmt;

/// A number with two decimals. Float formatting would take some 20 KB of flash.
pub struct Hundredths(pub f32);

impl fmt::Display for Hundredths {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let hundredths = whole(self.0 * 100.0);
        let sign = if hundredths < 0 { "-" } else { "" };
        let magnitude = hundredths.unsigned_abs();
        write!(f, "{sign}{}.{:02}", magnitude / 100, magnitude % 100)
    }
}

/// Rounds half away from zero, saturating.
pub fn whole(value: f32) -> i32 {
    (value + if value < 0.0 { -0.5 } else { 0.5 }) as i32
}
