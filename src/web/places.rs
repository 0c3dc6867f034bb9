//! Who is served at a time.

use core::cell::Cell;

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer};

use super::request::Sender;

/// WebSockets at a time.
pub const WEB_SOCKETS: usize = 2;

/// Connections at a time that get a page or a file.
const FILES: u8 = 2;

/// So often it is looked whether a place was given up, this many times.
const LOOK_INTERVAL: Duration = Duration::from_millis(10);
const LOOKS: u32 = 100;

/// The places of a server.
pub struct Places {
    web_sockets: [PlaceState; WEB_SOCKETS],
    files: Cell<u8>,
}

/// A place for a WebSocket.
struct PlaceState {
    taken_by: Cell<Option<Sender>>,
    give_up: Signal<NoopRawMutex, ()>,
}

impl PlaceState {
    const fn free() -> Self {
        Self {
            taken_by: Cell::new(None),
            give_up: Signal::new(),
        }
    }
}

impl Places {
    /// All are free.
    pub const fn new() -> Self {
        Self {
            web_sockets: [const { PlaceState::free() }; WEB_SOCKETS],
            files: Cell::new(0),
        }
    }

    /// A place for a WebSocket. That of a foreign page is given to one of ours.
    pub(super) async fn take_web_socket(&self, sender: Sender) -> Option<WebSocketPlace<'_>> {
        for _ in 0..LOOKS {
            if let Some(place) = self.free_web_socket(sender) {
                return Some(place);
            }
            let mut places = self.web_sockets.iter();
            let foreign = places.find(|place| place.taken_by.get() == Some(Sender::Foreign));
            match (foreign, sender) {
                (Some(place), Sender::Own) => place.give_up.signal(()),
                _ => return None,
            }
            Timer::after(LOOK_INTERVAL).await;
        }
        None
    }

    fn free_web_socket(&self, sender: Sender) -> Option<WebSocketPlace<'_>> {
        let index = self
            .web_sockets
            .iter()
            .position(|place| place.taken_by.get().is_none())?;
        let state = self.web_sockets.get(index)?;
        state.taken_by.set(Some(sender));
        state.give_up.reset();
        Some(WebSocketPlace { index, sender, state })
    }

    /// A place for a page or a file.
    pub(super) fn take_file(&self) -> Option<FilePlace<'_>> {
        let taken = self.files.get();
        (taken < FILES).then(|| {
            self.files.set(taken + 1);
            FilePlace(&self.files)
        })
    }
}

impl Default for Places {
    fn default() -> Self {
        Self::new()
    }
}

/// A place for a WebSocket that is taken until this is dropped.
pub struct WebSocketPlace<'a> {
    /// Which of [`WEB_SOCKETS`] it is.
    pub index: usize,
    /// Whose page has it.
    pub sender: Sender,
    state: &'a PlaceState,
}

impl WebSocketPlace<'_> {
    /// Waits until it is to be given up.
    pub async fn is_wanted(&self) {
        self.state.give_up.wait().await;
    }
}

impl Drop for WebSocketPlace<'_> {
    fn drop(&mut self) {
        self.state.taken_by.set(None);
    }
}

/// A place for a page or a file that is taken until this is dropped.
pub(super) struct FilePlace<'a>(&'a Cell<u8>);

impl Drop for FilePlace<'_> {
    fn drop(&mut self) {
        self.0.set(self.0.get().saturating_sub(1));
    }
}
