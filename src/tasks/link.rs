//! A link to ground stations, shared by the tasks that schedule, write and read it.

use core::cell::RefCell;

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;

use super::{Shared, now};
use crate::autopilot::{Autopilot, Channel};
use crate::mavlink::{LinkKind, LinkStatistics};

/// A link: our end of it, and wake-ups for its tasks.
///
/// All tasks run on one executor and none is interrupted by another, so a plain cell guards our end.
pub struct Link {
    channel: RefCell<Channel>,
    /// There may be something to write.
    pub(super) to_write: Signal<NoopRawMutex, ()>,
    /// The schedule may have changed.
    pub(super) to_schedule: Signal<NoopRawMutex, ()>,
}

impl Link {
    /// A link of this kind called `name` in the log, that carries `bytes_per_second`.
    pub fn new(name: &'static str, kind: LinkKind, bytes_per_second: u32) -> Self {
        Self {
            channel: RefCell::new(Channel::new(name, kind, bytes_per_second, now())),
            to_write: Signal::new(),
            to_schedule: Signal::new(),
        }
    }

    /// The link's name in the log.
    pub fn name(&self) -> &'static str {
        self.channel.borrow().name()
    }

    /// The link's counters.
    pub fn statistics(&self) -> LinkStatistics {
        self.channel.borrow().statistics()
    }

    /// Whether all answers have been taken by the wire.
    pub fn is_idle(&self) -> bool {
        self.channel.borrow().is_idle()
    }

    /// Uses our end of the link. It must not wait in there.
    pub(super) fn with<R>(&self, use_channel: impl FnOnce(&mut Channel) -> R) -> R {
        use_channel(&mut self.channel.borrow_mut())
    }

    /// Uses our end of the link together with the core. It must not wait in there.
    pub(super) fn serve<R>(
        &self,
        shared: &Shared,
        serve: impl FnOnce(&mut Autopilot, &mut Channel) -> R,
    ) -> R {
        shared.with(|autopilot| self.with(|channel| serve(autopilot, channel)))
    }
}
