//! Needs of every link of the network.

use embedded_io_async::Write;

use crate::mavlink::{Access, LinkId};
use crate::recorder::LogSource;
use crate::tasks::{ByteSource, CheckIn, Link, Shared, serve_link};

/// The core and the logs, to serve links with.
#[derive(Clone, Copy)]
pub struct Service<'a> {
    /// The core.
    pub shared: &'a Shared,
    /// The recorded files.
    pub logs: &'a dyn LogSource,
    /// Takes the service's signs of life.
    pub check_in: &'a CheckIn,
}

impl<'a> Service<'a> {
    /// A new link to someone with this access, whose first frame has this sequence number.
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub(super) fn open(&self, id: LinkId, first_sequence: u8, access: Access) -> Link<'a> {
        Link::of_board(id, self.shared)
            .with_logs(self.logs)
            .with_access(access)
            .with_first_sequence(first_sequence)
    }

    /// Serves a link until its wire is closed.
    pub(super) async fn serve(&self, transmitter: impl Write, receiver: impl ByteSource, link: &Link<'_>) {
        serve_link(transmitter, receiver, self.shared, link, self.check_in).await;
    }
}
