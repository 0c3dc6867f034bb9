//! The core, shared between tasks.

use core::cell::{RefCell, RefMut};

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_sync::watch::{Receiver, Watch};

use super::now;
use crate::announce::Announce;
use crate::autopilot::{Autopilot, Start, Work};
use crate::mavlink::MAX_LINKS;
use crate::memory::in_place::in_place;
use crate::memory::storage::Erase;

/// Wakes up a link when something was announced.
pub type AnnouncementReceiver<'a> = Receiver<'a, NoopRawMutex, (), MAX_LINKS>;

/// The core, and wake-ups for the tasks that have to act on what other tasks made of it.
///
/// All tasks run on one executor and none is interrupted by another, so a plain cell guards the core.
pub struct Shared {
    autopilot: RefCell<Autopilot>,
    announced: Watch<NoopRawMutex, (), MAX_LINKS>,
    pub(super) to_drive: Signal<NoopRawMutex, ()>,
    pub(super) to_save: Signal<NoopRawMutex, ()>,
    pub(super) to_reboot: Signal<NoopRawMutex, ()>,
    /// The radio's set-up may have changed.
    pub(crate) to_set_up_wifi: Signal<NoopRawMutex, ()>,
    pub(super) to_write_log: Signal<NoopRawMutex, ()>,
    pub(super) to_feed_watchdog: Signal<NoopRawMutex, ()>,
}

impl Shared {
    /// The core at boot.
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new(start: &Start) -> Self {
        Self {
            autopilot: in_place(|| RefCell::new(Autopilot::new(start))),
            announced: Watch::new(),
            to_drive: Signal::new(),
            to_save: Signal::new(),
            to_reboot: Signal::new(),
            to_set_up_wifi: Signal::new(),
            to_write_log: Signal::new(),
            to_feed_watchdog: Signal::new(),
        }
    }

    /// Uses the core, and wakes up the tasks that have to act on the result. It must not wait in there.
    pub fn with<R>(&self, use_it: impl FnOnce(&mut Autopilot) -> R) -> R {
        let mut autopilot = self.borrow();
        let result = use_it(&mut autopilot);
        self.release(autopilot);
        result
    }

    // Not inlined, like `release`: the core is used in a hundred places.
    #[inline(never)]
    fn borrow(&self) -> RefMut<'_, Autopilot> {
        self.autopilot.borrow_mut()
    }

    #[inline(never)]
    fn release(&self, mut autopilot: RefMut<'_, Autopilot>) {
        let work = autopilot.take_work();
        drop(autopilot);
        let signals = [
            (Work::DRIVE, &self.to_drive),
            (Work::SAVE, &self.to_save),
            (Work::RESTART, &self.to_reboot),
            (Work::WIFI, &self.to_set_up_wifi),
            (Work::LOG, &self.to_write_log),
            (Work::WATCHDOG, &self.to_feed_watchdog),
        ];
        for (kind, signal) in signals {
            if work.contains(kind) {
                signal.signal(());
            }
        }
        if work.contains(Work::ANNOUNCED) {
            self.announced.sender().send(());
        }
    }

    /// Whether flash may be erased now, for [`Storage`](crate::memory::storage::Storage).
    pub(super) fn may_erase(&self) -> Erase {
        self.with(|autopilot| autopilot.may_erase())
    }

    /// Whether flash has to be left alone until the watchdog has its longer time-out.
    pub(super) fn waits_for_watchdog(&self) -> bool {
        self.with(|autopilot| autopilot.waits_for_watchdog())
    }

    /// Announces something to all connected ground stations, once.
    pub fn announce(&self, event: &dyn Announce) {
        self.with(|autopilot| autopilot.announce(event, now()));
    }

    /// Wakes up a link when something is announced; `None` for too many links.
    pub(super) fn announcements(&self) -> Option<AnnouncementReceiver<'_>> {
        self.announced.receiver()
    }
}
