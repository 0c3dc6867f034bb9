//! A network device that leaves the other tasks their turn.

use core::task::Context;

use embassy_net::driver::{Capabilities, Driver, HardwareAddress, LinkState};

/// A device that gives one received frame, and takes one to send, each time the network is polled. Without that all frames that
/// wait would be handled in one go, and the sampling of the packs would wait meanwhile.
pub(super) struct Paced<D> {
    device: D,
    received: FrameSlot,
    sent: FrameSlot,
}

/// Whether this turn's frame has passed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum FrameSlot {
    Open,
    Used,
}

impl FrameSlot {
    /// Whether a frame may pass. After one that did the next may not, and is let through in the next turn, to which the task is
    /// woken.
    fn take(&mut self, context: &mut Context<'_>) -> bool {
        let is_open = *self == Self::Open;
        *self = Self::Open;
        if !is_open {
            context.waker().wake_by_ref();
        }
        is_open
    }
}

impl<D> Paced<D> {
    pub fn new(device: D) -> Self {
        Self {
            device,
            received: FrameSlot::Open,
            sent: FrameSlot::Open,
        }
    }
}

impl<D: Driver> Driver for Paced<D> {
    type RxToken<'a>
        = D::RxToken<'a>
    where
        Self: 'a;
    type TxToken<'a>
        = D::TxToken<'a>
    where
        Self: 'a;

    fn receive(&mut self, context: &mut Context<'_>) -> Option<(Self::RxToken<'_>, Self::TxToken<'_>)> {
        if !self.received.take(context) {
            return None;
        }
        let frame = self.device.receive(context);
        if frame.is_some() {
            self.received = FrameSlot::Used;
        }
        frame
    }

    fn transmit(&mut self, context: &mut Context<'_>) -> Option<Self::TxToken<'_>> {
        if !self.sent.take(context) {
            return None;
        }
        let place = self.device.transmit(context);
        if place.is_some() {
            self.sent = FrameSlot::Used;
        }
        place
    }

    fn link_state(&mut self, context: &mut Context<'_>) -> LinkState {
        self.device.link_state(context)
    }

    fn capabilities(&self) -> Capabilities {
        self.device.capabilities()
    }

    fn hardware_address(&self) -> HardwareAddress {
        self.device.hardware_address()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use embassy_net::driver::{RxToken, TxToken};
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::task::{Wake, Waker};

    /// It always has a frame, and always takes one.
    struct Endless;

    struct Token;

    impl RxToken for Token {
        fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, use_frame: F) -> R {
            use_frame(&mut [])
        }
    }

    impl TxToken for Token {
        fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, _: usize, write: F) -> R {
            write(&mut [])
        }
    }

    impl Driver for Endless {
        type RxToken<'a> = Token;
        type TxToken<'a> = Token;

        fn receive(&mut self, _: &mut Context<'_>) -> Option<(Token, Token)> {
            Some((Token, Token))
        }

        fn transmit(&mut self, _: &mut Context<'_>) -> Option<Token> {
            Some(Token)
        }

        fn link_state(&mut self, _: &mut Context<'_>) -> LinkState {
            LinkState::Down
        }

        fn capabilities(&self) -> Capabilities {
            Capabilities::default()
        }

        fn hardware_address(&self) -> HardwareAddress {
            HardwareAddress::Ip
        }
    }

    #[derive(Default)]
    struct Wakes(AtomicU32);

    impl Wake for Wakes {
        fn wake(self: Arc<Self>) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    #[test]
    fn one_frame_passes_each_way_and_the_task_is_woken_for_the_next() {
        let wakes = Arc::new(Wakes::default());
        let waker = Waker::from(wakes.clone());
        let mut context = Context::from_waker(&waker);
        let mut device = Paced::new(Endless);
        for turn in 0..3 {
            assert!(device.receive(&mut context).is_some());
            assert!(device.receive(&mut context).is_none());
            assert!(device.transmit(&mut context).is_some());
            assert!(device.transmit(&mut context).is_none());
            assert_eq!(wakes.0.load(Ordering::Relaxed), 2 * (turn + 1));
        }
    }
}
