//! What a CAN controller does for a node.

use super::{Acceptance, CanFrame, CanStatus};

/// A CAN bus, behind a controller that something else serves.
pub trait CanBus {
    /// The next frame that was received, as soon as there is one.
    // The futures stay on one executor, so `Send` need not be promised.
    #[allow(async_fn_in_trait)]
    async fn receive(&self) -> CanFrame;

    /// The next frame that was received, if there is one already.
    fn try_receive(&self) -> Option<CanFrame>;

    /// Has a frame sent, as soon as there is room. If the future is dropped before, it is not.
    #[allow(async_fn_in_trait)]
    async fn send(&self, frame: CanFrame);

    /// Lets nothing else through, as far as the controller can; nothing works before.
    fn accept(&self, accepted: Acceptance);

    /// What is known of the controller.
    fn status(&self) -> CanStatus;
}
