//! The network device: it leaves the other tasks their turn, and filters received frames.

use core::mem;
use core::task::Context;

use embassy_net::driver::{Capabilities, Driver, HardwareAddress, LinkState, RxToken};

use super::ingress_filter::IngressFilter;

/// A device that gives one received frame, and takes one to send, each time the network is polled. Without that all frames that
/// wait would be handled in one go, and the sampling of the packs would wait meanwhile.
///
/// A frame stays with the device when the token for it is dropped.
pub(super) struct Paced<'a, D> {
    device: D,
    filter: IngressFilter<'a>,
    /// This turn's frame has been received: the next one is refused once, and passes in the next turn.
    has_received: bool,
    /// This turn's frame has been sent, likewise.
    has_sent: bool,
}

impl<'a, D> Paced<'a, D> {
    pub fn new(device: D, filter: IngressFilter<'a>) -> Self {
        Self {
            device,
            filter,
            has_received: false,
            has_sent: false,
        }
    }
}

/// A received frame that passes the filter before it is processed.
pub(super) struct FilteredToken<'a, T> {
    token: T,
    filter: &'a IngressFilter<'a>,
}

impl<T: RxToken> RxToken for FilteredToken<'_, T> {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, take: F) -> R {
        self.token.consume(|frame| match self.filter.accepts(frame) {
            true => take(frame),
            // An empty frame is ignored.
            false => take(&mut []),
        })
    }
}

impl<D: Driver> Driver for Paced<'_, D> {
    type RxToken<'a>
        = FilteredToken<'a, D::RxToken<'a>>
    where
        Self: 'a;
    type TxToken<'a>
        = D::TxToken<'a>
    where
        Self: 'a;

    fn receive(&mut self, context: &mut Context<'_>) -> Option<(Self::RxToken<'_>, Self::TxToken<'_>)> {
        let frame = self.device.receive(context);
        if mem::take(&mut self.has_received) {
            // Another one waits. Otherwise the device wakes the task when one comes.
            if frame.is_some() {
                context.waker().wake_by_ref();
            }
            return None;
        }
        let (token, answer) = frame?;
        self.has_received = true;
        let filter = &self.filter;
        Some((FilteredToken { token, filter }, answer))
    }

    fn transmit(&mut self, context: &mut Context<'_>) -> Option<Self::TxToken<'_>> {
        if mem::take(&mut self.has_sent) {
            // There is another one to send.
            context.waker().wake_by_ref();
            return None;
        }
        let token = self.device.transmit(context);
        self.has_sent = token.is_some();
        token
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
    use embassy_net::driver::TxToken;
    use std::sync::Arc;
    use std::sync::atomic::{AtomicU32, Ordering};
    use std::task::{Wake, Waker};

    /// It has this many frames, and takes any number.
    struct Waiting(u32);

    struct Received<'a>(&'a mut u32);

    struct Sent;

    impl RxToken for Received<'_> {
        fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, use_frame: F) -> R {
            *self.0 -= 1;
            use_frame(&mut [])
        }
    }

    impl TxToken for Sent {
        fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, _: usize, write: F) -> R {
            write(&mut [])
        }
    }

    impl Driver for Waiting {
        type RxToken<'a> = Received<'a>;
        type TxToken<'a> = Sent;

        fn receive(&mut self, _: &mut Context<'_>) -> Option<(Received<'_>, Sent)> {
            (self.0 > 0).then_some((Received(&mut self.0), Sent))
        }

        fn transmit(&mut self, _: &mut Context<'_>) -> Option<Sent> {
            Some(Sent)
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
    fn one_frame_is_received_a_turn_and_the_task_is_woken_only_while_another_one_waits() {
        let wakes = Arc::new(Wakes::default());
        let waker = Waker::from(wakes.clone());
        let mut context = Context::from_waker(&waker);
        let mut device = Paced::new(Waiting(3), IngressFilter::new(None));
        for expected_wakes in [1, 2, 2, 2] {
            if let Some((frame, _)) = device.receive(&mut context) {
                frame.consume(|_| ());
                assert!(device.receive(&mut context).is_none());
            }
            assert_eq!(wakes.0.load(Ordering::Relaxed), expected_wakes);
        }
        assert_eq!(device.device.0, 0);
    }

    #[test]
    fn one_frame_is_sent_a_turn_and_the_task_is_woken_for_the_next() {
        let wakes = Arc::new(Wakes::default());
        let waker = Waker::from(wakes.clone());
        let mut context = Context::from_waker(&waker);
        let mut device = Paced::new(Waiting(0), IngressFilter::new(None));
        for turn in 1..4 {
            assert!(device.transmit(&mut context).is_some());
            assert!(device.transmit(&mut context).is_none());
            assert_eq!(wakes.0.load(Ordering::Relaxed), turn);
        }
    }
}
