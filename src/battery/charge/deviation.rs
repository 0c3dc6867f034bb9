//! Standard deviations.

/// Standard deviation of the sum of two that are independent.
pub(super) fn root_of_squares(a: f32, b: f32) -> f32 {
    libm::sqrtf(a * a + b * b)
}
