//! What happens while ground stations are connected, said once to each of them.

use core::future::pending;

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::pubsub::{PubSubChannel, Subscriber, WaitResult};
use heapless::String;

use crate::battery::MAX_PACKS;
use crate::log::warn;
use crate::mavlink::dialect::MavSeverity;

/// The longest announcement, in bytes: two STATUSTEXT.
pub const ANNOUNCEMENT_BYTES: usize = 96;

/// One of each pack in the same sampling tick, and a few more, wait for a link that is busy.
const KEPT: usize = MAX_PACKS + 3;

/// Links that can listen. The simulator has the most: eight by TCP and one by UDP.
const MAX_LINKS: usize = 9;

/// Publishing never waits, so no publisher is registered.
const PUBLISHERS: usize = 0;

type Channel = PubSubChannel<NoopRawMutex, Announcement, KEPT, MAX_LINKS, PUBLISHERS>;

/// Something that is said to every ground station that is connected.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Announcement {
    pub severity: MavSeverity,
    pub text: String<ANNOUNCEMENT_BYTES>,
}

/// The latest announcements, for links that have not said them yet.
pub(super) struct Announcements(Channel);

impl Announcements {
    // Inlined, it would be built on the stack and copied.
    #[inline(never)]
    pub fn new() -> Self {
        Self(Channel::new())
    }

    /// Says `text` to everyone who listens, as much of it as fits. A listener that is too far behind loses its oldest.
    pub fn publish(&self, severity: MavSeverity, text: &str) {
        let fitting = text
            .get(..text.floor_char_boundary(ANNOUNCEMENT_BYTES))
            .unwrap_or_default();
        let publisher = self.0.immediate_publisher();
        publisher.publish_immediate(Announcement {
            severity,
            // It fits.
            text: String::try_from(fitting).unwrap_or_default(),
        });
    }

    /// Listens to what is announced from now on.
    pub fn listen(&self) -> Listener<'_> {
        let subscriber = self.0.subscriber();
        if subscriber.is_err() {
            warn!("too many links: one gets no announcements");
        }
        Listener(subscriber.ok())
    }
}

/// Hears each announcement once.
pub(super) struct Listener<'a>(
    Option<Subscriber<'a, NoopRawMutex, Announcement, KEPT, MAX_LINKS, PUBLISHERS>>,
);

impl Listener<'_> {
    /// Waits for the next announcement, or learns how many were lost before it.
    pub async fn next(&mut self) -> WaitResult<Announcement> {
        match &mut self.0 {
            Some(subscriber) => subscriber.next_message().await,
            None => pending().await,
        }
    }
}
