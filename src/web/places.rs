//! Places of connections that are served at a time.

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

/// A place that was not used for this long, in µs, is given to one of our pages that asks. After one of ours found none free,
/// foreign pages get none for as long.
const PATIENCE_US: u64 = 3_000_000;

/// Interval and number of looks for a place that was given up.
const LOOK_INTERVAL: Duration = Duration::from_millis(10);
const LOOKS: u32 = 100;

/// The places of a server.
pub struct Places {
    web_sockets: [PlaceState; WEB_SOCKETS],
    files: [PlaceState; FILES],
    /// Until then free places are reserved for our pages.
    reserved_until: Cell<Instant>,
}

/// Purpose of a place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    WebSocket,
    /// A page or a file.
    File,
}

struct PlaceState {
    /// From then on it gives way to one of our pages. `None`: it is free.
    gives_way_at: Cell<Option<Instant>>,
    give_up: Signal<NoopRawMutex, ()>,
}

impl PlaceState {
    const fn free() -> Self {
        Self {
            gives_way_at: Cell::new(None),
            give_up: Signal::new(),
        }
    }
}

impl Places {
    /// All are free.
    pub const fn new() -> Self {
        Self {
            web_sockets: [const { PlaceState::free() }; WEB_SOCKETS],
            files: [const { PlaceState::free() }; FILES],
            reserved_until: Cell::new(Instant::EPOCH),
        }
    }

    /// Takes a place. If none is free, one of our pages gets that of a foreign page, or else the one that was not used for longest.
    pub(super) async fn take(&self, purpose: Purpose, sender: Sender) -> Option<Place<'_>> {
        let places: &[_] = match purpose {
            Purpose::WebSocket => &self.web_sockets,
            Purpose::File => &self.files,
        };
        for _ in 0..LOOKS {
            let now = now();
            if sender == Sender::Foreign && now < self.reserved_until.get() {
                return None;
            }
            // A free one comes first, then those of foreign pages.
            let states = places.iter().enumerate();
            let (index, state) = states.min_by_key(|(_, state)| state.gives_way_at.get())?;
            match state.gives_way_at.get() {
                None => return Some(Place::take(index, sender, state)),
                Some(_) if sender == Sender::Foreign => return None,
                gives_way_at => {
                    self.reserved_until.set(now.after_us(PATIENCE_US));
                    if gives_way_at > Some(now) {
                        return None;
                    }
                }
            }
            state.give_up.signal(());
            Timer::after(LOOK_INTERVAL).await;
        }
        None
    }

    /// Ends transfers of files that were stalled for too long: all connections are in use.
    pub(super) fn end_stalled_files(&self) {
        let now = now();
        let is_stalled = |state: &&PlaceState| state.gives_way_at.get().is_some_and(|at| at <= now);
        let stalled = self.files.iter().filter(is_stalled);
        stalled.for_each(|state| state.give_up.signal(()));
    }
}

impl Default for Places {
    fn default() -> Self {
        Self::new()
    }
}

/// A place that is taken until this is dropped.
pub struct Place<'a> {
    /// Which one it is, of those with the same purpose.
    pub index: usize,
    /// Origin of the page that has it.
    pub sender: Sender,
    state: &'a PlaceState,
}

impl<'a> Place<'a> {
    fn take(index: usize, sender: Sender, state: &'a PlaceState) -> Self {
        state.gives_way_at.set(Some(Instant::EPOCH));
        state.give_up.reset();
        let place = Self { index, sender, state };
        place.note_use();
        place
    }

    /// Notes that it was used just now. That of a foreign page gives way all the same.
    pub fn note_use(&self) {
        if self.sender != Sender::Foreign {
            self.state.gives_way_at.set(Some(now().after_us(PATIENCE_US)));
        }
    }

    /// Waits until it is to be given up.
    pub async fn is_wanted(&self) {
        self.state.give_up.wait().await;
    }
}

impl Drop for Place<'_> {
    fn drop(&mut self) {
        self.state.gives_way_at.set(None);
    }
}
