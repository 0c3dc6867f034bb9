//! Permission to erase a sector.

/// Whether a sector may be erased now. An erase stops the processor for 45 ms, typically, and for 400 ms at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Erase {
    /// There is no real-time deadline.
    Allowed,
    /// The vehicle may be moving.
    Forbidden,
}

/// Asked immediately before each erase: the vehicle may have been armed since the operation was begun.
pub type MayErase<'a> = &'a dyn Fn() -> Erase;

impl Erase {
    /// The answer before the vehicle can be armed, and on a host.
    pub fn always() -> Self {
        Self::Allowed
    }
}
