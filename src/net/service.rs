//! What every link of the network needs.

use embedded_io_async::Write;

use crate::liveness::CheckIn;
use crate::mavlink::LinkId;
use crate::recorder::LogSource;
use crate::tasks::{ByteSource, Link, Shared, serve_link};

/// The core and the logs, to serve links with.
pub(super) struct Service<'a> {
    pub shared: &'a Shared,
    pub logs: &'a dyn LogSource,
    pub check_in: &'a CheckIn,
}

impl<'a> Service<'a> {
    /// A new link, whose first frame has this sequence number.
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn open(&self, id: LinkId, first_sequence: u8) -> Link<'a> {
        Link::of_board(id, self.shared)
            .with_logs(self.logs)
            .with_first_sequence(first_sequence)
    }

    /// Serves a link until its wire is closed.
    pub async fn serve(&self, transmitter: impl Write, receiver: impl ByteSource, link: &Link<'_>) {
        serve_link(transmitter, receiver, self.shared, link, self.check_in).await;
    }
}
