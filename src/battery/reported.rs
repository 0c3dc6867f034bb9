//! What a pack reports of itself.

use super::{ChargeState, Faults};

/// What a pack, or another component that measures it, reports of its condition. It is shown, and its faults are
/// announced; none of them changes what is found here, and only [`Faults::BAD_BATTERY`] keeps a rover from being armed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Reported {
    /// Faults.
    pub faults: Faults,
    /// Charge state.
    pub charge_state: Option<ChargeState>,
}

impl Reported {
    /// Nothing.
    pub const NONE: Self = Self {
        faults: Faults::empty(),
        charge_state: None,
    };
}
