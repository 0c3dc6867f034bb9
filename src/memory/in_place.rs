//! Large values that are built where they stay.

/// Builds a value where it stays. Inlined, it would be built on the stack and copied.
#[inline(never)]
pub(crate) fn in_place<T>(build: impl FnOnce() -> T) -> T {
    build()
}
