//! A link of a program that has one loop and no tasks.

use embedded_io_async::Write;

use crate::announce::Announce;
use crate::battery::{PackEvent, PackNotice};
use crate::mavlink::{Endpoint, Framer, LinkKind};
use crate::pack::Pack;
use crate::parameter::Parameters;
use crate::system::SystemState;
use crate::time::Instant;

/// Our end of a link together with its wire, for a program of one loop. Nothing is signed.
pub struct WiredEndpoint<W> {
    /// Our end of the link.
    pub endpoint: Endpoint,
    framer: Framer,
    wire: W,
}

impl<W: Write> WiredEndpoint<W> {
    /// A link of this kind over `wire`, which carries `bytes_per_second`. Its first HEARTBEAT is due at `now`.
    pub fn new(kind: LinkKind, bytes_per_second: u32, wire: W, now: Instant) -> Self {
        Self {
            endpoint: Endpoint::new("link", kind, bytes_per_second, now),
            framer: Framer::new(),
            wire,
        }
    }

    /// Posts a STATUSTEXT for each event of a pack.
    pub fn announce(&mut self, pack: Pack, events: &[PackEvent]) {
        for event in events {
            let announcement = PackNotice(pack, event);
            self.endpoint.say(announcement.severity(), &announcement.text());
        }
    }

    /// Builds what is due at `now` and what was posted, frames it and writes it.
    ///
    /// # Errors
    /// The wire failed.
    pub async fn send_due(
        &mut self,
        now: Instant,
        state: &SystemState<'_>,
        parameters: &Parameters,
    ) -> Result<(), W::Error> {
        self.endpoint.post_due(now, state, parameters);
        let system_id = parameters.system_id();
        while let Some(message) = self.endpoint.next_message(state, parameters) {
            self.wire
                .write_all(self.framer.frame(&message, system_id))
                .await?;
        }
        Ok(())
    }
}
