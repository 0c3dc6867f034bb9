//! Frames and findings between what serves the controller, perhaps in an interrupt, and the task that uses the bus.

use core::cell::Cell;

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_sync::channel::Channel;
use embassy_sync::signal::Signal;

use crate::sensor::{Acceptance, CanBus, CanFrame, CanInterrupt, CanStatus};

/// Frames at full load of 1 Mbit/s take 130 µs each, so that these bridge 16 ms: what the start does between two turns of the task,
/// and the sampling of packs, 4 ms.
const RECEIVED: usize = 128;

/// Frames that may wait to be sent; a task with more waits itself.
const TO_SEND: usize = 4;

/// Frames that were received and that are to be sent, and what is known of the controller.
pub struct CanExchange<M: RawMutex> {
    received: Channel<M, CanFrame, RECEIVED>,
    to_send: Channel<M, CanFrame, TO_SEND>,
    acceptance: Signal<M, Acceptance>,
    status: Mutex<M, Cell<CanStatus>>,
}

impl<M: RawMutex> CanExchange<M> {
    /// Nothing yet.
    #[allow(clippy::new_without_default, reason = "it is for statics")]
    pub const fn new() -> Self {
        Self {
            received: Channel::new(),
            to_send: Channel::new(),
            acceptance: Signal::new(),
            status: Mutex::new(Cell::new(CanStatus::STARTING)),
        }
    }

    pub(super) fn update(&self, change: impl FnOnce(&mut CanStatus)) {
        self.status.lock(|cell| {
            let mut status = cell.get();
            change(&mut status);
            cell.set(status);
        });
    }

    /// Whether the controller interrupts.
    pub(super) fn interrupt(&self) -> CanInterrupt {
        self.status.lock(Cell::get).interrupt
    }

    /// A frame was discarded unsent.
    pub(super) fn count_unsent(&self) {
        self.update(|status| status.unsent_frames = status.unsent_frames.wrapping_add(1));
    }

    /// Hands over a received frame; without room it is lost, and counted.
    pub(super) fn received(&self, frame: CanFrame) {
        if self.received.try_send(frame).is_err() {
            self.update(|status| status.lost_frames = status.lost_frames.wrapping_add(1));
        }
    }

    /// The next frame to be sent.
    pub(super) async fn next_to_send(&self) -> CanFrame {
        self.to_send.receive().await
    }

    /// The frames to let through, when that changes.
    pub(super) async fn new_acceptance(&self) -> Acceptance {
        self.acceptance.wait().await
    }
}

impl<M: RawMutex> CanBus for &CanExchange<M> {
    async fn receive(&self) -> CanFrame {
        self.received.receive().await
    }

    fn try_receive(&self) -> Option<CanFrame> {
        self.received.try_receive().ok()
    }

    async fn send(&self, frame: CanFrame) {
        self.to_send.send(frame).await;
    }

    fn accept(&self, accepted: Acceptance) {
        self.acceptance.signal(accepted);
    }

    fn status(&self) -> CanStatus {
        self.status.lock(Cell::get)
    }
}
