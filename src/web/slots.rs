//! Limits how many browsers are served at a time: each WebSocket and each transfer of a file needs a slot.

use core::cell::Cell;

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer};

use super::request::Sender;
use crate::tasks::now;
use crate::time::Instant;

/// WebSockets at a time.
pub const WEB_SOCKETS: usize = 2;

/// Connections at a time that get a page or a file.
const FILES: usize = 2;

/// Idle time-out, in µs: a slot that was not used for this long can be taken over by one of our pages. After one of ours found
/// none free, foreign pages get none for as long.
const IDLE_TIMEOUT_US: u64 = 3_000_000;

/// Interval and number of checks whether a holder that was asked to release its slot has done so.
const RELEASE_INTERVAL: Duration = Duration::from_millis(10);
const RELEASE_CHECKS: u32 = 100;

/// The slots of a server.
pub struct Slots {
    web_sockets: [SlotState; WEB_SOCKETS],
    files: [SlotState; FILES],
    /// Until then free slots are reserved for our pages.
    reserved_until: Cell<Instant>,
}

/// Purpose of a slot.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    WebSocket,
    /// A page or a file.
    File,
}

struct SlotState {
    /// From then on one of our pages can take it over. `None`: it is free.
    idle_from: Cell<Option<Instant>>,
    /// Asks the holder to release it.
    release: Signal<NoopRawMutex, ()>,
}

impl SlotState {
    const fn free() -> Self {
        Self {
            idle_from: Cell::new(None),
            release: Signal::new(),
        }
    }
}

impl Slots {
    /// All are free.
    pub const fn new() -> Self {
        Self {
            web_sockets: [const { SlotState::free() }; WEB_SOCKETS],
            files: [const { SlotState::free() }; FILES],
            reserved_until: Cell::new(Instant::EPOCH),
        }
    }

    /// Takes a slot. If none is free, one of our pages takes over that of a foreign page, or else the one that has been idle for
    /// longest, and waits until its holder has released it. `None`: no slot can be had at present.
    pub(super) async fn take(&self, purpose: Purpose, sender: Sender) -> Option<Slot<'_>> {
        let slots: &[_] = match purpose {
            Purpose::WebSocket => &self.web_sockets,
            Purpose::File => &self.files,
        };
        for _ in 0..RELEASE_CHECKS {
            let now = now();
            if sender == Sender::Foreign && now < self.reserved_until.get() {
                return None;
            }
            // A free one comes first, then those of foreign pages.
            let states = slots.iter().enumerate();
            let (index, state) = states.min_by_key(|(_, state)| state.idle_from.get())?;
            match state.idle_from.get() {
                None => return Some(Slot::take(index, sender, state)),
                Some(_) if sender == Sender::Foreign => return None,
                idle_from => {
                    self.reserved_until.set(now.after_us(IDLE_TIMEOUT_US));
                    if idle_from > Some(now) {
                        return None;
                    }
                }
            }
            state.release.signal(());
            Timer::after(RELEASE_INTERVAL).await;
        }
        None
    }

    /// Ends transfers of files that have been idle for too long, because all connections are in use.
    pub(super) fn end_stalled_files(&self) {
        let now = now();
        for state in &self.files {
            if state.idle_from.get().is_some_and(|from| from <= now) {
                state.release.signal(());
            }
        }
    }
}

impl Default for Slots {
    fn default() -> Self {
        Self::new()
    }
}

/// A slot that is taken until this is dropped.
pub struct Slot<'a> {
    /// Index among those with the same purpose.
    pub index: usize,
    /// Origin of the page that has it.
    pub sender: Sender,
    state: &'a SlotState,
}

impl<'a> Slot<'a> {
    fn take(index: usize, sender: Sender, state: &'a SlotState) -> Self {
        state.idle_from.set(Some(Instant::EPOCH));
        state.release.reset();
        let slot = Self { index, sender, state };
        slot.note_use();
        slot
    }

    /// Notes that it was used just now. That of a foreign page can be taken over all the same.
    pub fn note_use(&self) {
        if self.sender != Sender::Foreign {
            self.state.idle_from.set(Some(now().after_us(IDLE_TIMEOUT_US)));
        }
    }

    /// Waits until another connection needs it: then it has to be dropped.
    pub async fn release_requested(&self) {
        self.state.release.wait().await;
    }
}

impl Drop for Slot<'_> {
    fn drop(&mut self) {
        self.state.idle_from.set(None);
    }
}
