//! A link to ground stations, shared by the tasks that schedule, write and read it.

use core::cell::{RefCell, RefMut};

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;

use super::{Shared, now};
use crate::autopilot::Autopilot;
use crate::mavlink::{Access, Endpoint, LinkId, LinkKind};
use crate::parameter::{VehicleParameter, serial_baud};
use crate::recorder::LogSource;
use crate::system::{LinkStatistics, LogReader};

/// A link: our end of it, and wake-ups for its tasks.
///
/// All tasks run on one executor and none is interrupted by another, so a plain cell guards our end.
pub struct Link<'a> {
    endpoint: RefCell<Endpoint>,
    /// The source of logs for downloads on this link.
    log: Option<&'a dyn LogSource>,
    /// The sequence number of the first frame.
    pub(super) first_sequence: u8,
    /// There may be something to write.
    pub(super) to_write: Signal<NoopRawMutex, ()>,
    /// The schedule may have changed.
    pub(super) to_schedule: Signal<NoopRawMutex, ()>,
}

impl<'a> Link<'a> {
    /// A link of this kind called `name` in the log, that carries `bytes_per_second`.
    pub fn new(name: &'static str, kind: LinkKind, bytes_per_second: u32) -> Self {
        Self {
            endpoint: RefCell::new(Endpoint::new(name, kind, bytes_per_second, now())),
            log: None,
            first_sequence: 0,
            to_write: Signal::new(),
            to_schedule: Signal::new(),
        }
    }

    /// A link of the board, with what the parameters say of it now.
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn of_board(id: LinkId, shared: &Shared) -> Self {
        let baud = shared
            .with(|autopilot| serial_baud(autopilot.parameters().get_whole(VehicleParameter::Serial0Baud)));
        Self::new(id.name(), id.kind(), id.bytes_per_second(baud))
    }

    /// This link, which offers downloads of logs read from `source`.
    pub fn with_logs(mut self, source: &'a dyn LogSource) -> Self {
        self.log = Some(source);
        self
    }

    /// This link, whose first frame has this sequence number: it goes on from what the ground station has heard before.
    pub fn with_first_sequence(mut self, first_sequence: u8) -> Self {
        self.first_sequence = first_sequence;
        self
    }

    /// This link, at whose other end someone with this access is.
    pub fn with_access(mut self, access: Access) -> Self {
        self.endpoint.get_mut().set_access(access);
        self
    }

    /// There is something to write that is no message, or has to follow the messages that were taken.
    pub fn wake_writer(&self) {
        self.to_write.signal(());
    }

    /// This many frames were lost on their way to the wire.
    pub fn count_lost(&self, frames: u32) {
        self.with(|endpoint| endpoint.outbox.count_dropped(frames));
    }

    /// The link's name in the log.
    pub fn name(&self) -> &'static str {
        self.endpoint.borrow().name()
    }

    /// The link's counters.
    pub fn statistics(&self) -> LinkStatistics {
        self.endpoint.borrow().statistics()
    }

    /// Whether all answers have been taken by the wire.
    pub fn is_idle(&self) -> bool {
        self.endpoint.borrow().is_idle()
    }

    /// Uses our end of the link. It must not wait in there.
    pub(super) fn with<R>(&self, use_endpoint: impl FnOnce(&mut Endpoint) -> R) -> R {
        use_endpoint(&mut self.borrow())
    }

    // Not inlined: each kind of wire has tasks of its own.
    #[inline(never)]
    fn borrow(&self) -> RefMut<'_, Endpoint> {
        self.endpoint.borrow_mut()
    }

    /// Uses our end of the link together with the core. It must not wait in there.
    pub(super) fn serve<R>(
        &self,
        shared: &Shared,
        serve: impl FnOnce(&mut Autopilot, &mut Endpoint) -> R,
    ) -> R {
        shared.with(|autopilot| self.with(|endpoint| serve(autopilot, endpoint)))
    }

    /// Reads what the next message of a download needs, and returns whether it needs anything: there may be another piece then.
    pub(super) fn read_log(&self, shared: &Shared) -> bool {
        let next = self.serve(shared, |autopilot, endpoint| autopilot.next_read(endpoint, now()));
        let Some(read) = next else {
            return false;
        };
        let mut bytes = [0; u8::MAX as usize];
        let wanted = bytes.get_mut(..read.bytes.into()).unwrap_or_default();
        let filled = match self.log {
            Some(source) => {
                let reader = LogReader::Link(self.with(|endpoint| endpoint.number()), read.protocol);
                read_file(read.number, read.offset, wanted, reader, source, shared)
            }
            None => 0,
        };
        let bytes = bytes.get(..filled).unwrap_or_default();
        self.with(|endpoint| endpoint.supply(read, bytes));
        true
    }
}

/// Fills `wanted` with what the log file `number` has from `offset` on, as far as it goes and can be read, and returns how far
/// that is.
pub fn read_file(
    number: u16,
    offset: u32,
    wanted: &mut [u8],
    reader: LogReader,
    source: &dyn LogSource,
    shared: &Shared,
) -> usize {
    let mut filled = 0;
    while let Some(rest) = wanted.get_mut(filled..).filter(|rest| !rest.is_empty()) {
        let offset = offset.saturating_add(filled as u32);
        let Some(piece) = shared.with(|autopilot| autopilot.locate_log(number, offset, reader, now())) else {
            break;
        };
        let bytes = rest.len().min(piece.bytes as usize);
        let read = rest
            .get_mut(..bytes)
            .map(|part| source.read_log(piece.address, part));
        if !matches!(read, Some(Ok(()))) {
            break;
        }
        filled += bytes;
    }
    filled
}
