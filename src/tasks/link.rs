//! One link to ground stations, shared by the tasks that schedule, write and read it.

use core::cell::{Cell, RefCell};

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant};

use super::Shared;
use crate::log::warn;
use crate::mavlink::{Endpoint, LinkKind, LinkStatistics, Message, Stream};

/// Minimum interval between log lines about something that can happen many times a second.
const REPORT_INTERVAL: Duration = Duration::from_secs(1);

/// A link: our end of it, and who has to wake up when something happens at it.
///
/// All tasks run on one executor and none is interrupted by another, so a plain cell guards the end.
pub struct Link {
    name: &'static str,
    endpoint: RefCell<Endpoint>,
    /// There may be something to write.
    pub(super) to_write: Signal<NoopRawMutex, ()>,
    /// The schedule may have changed.
    pub(super) to_schedule: Signal<NoopRawMutex, ()>,
    drops: ReportLimit,
    /// Requests that were refused.
    pub(super) refusals: ReportLimit,
}

/// Lets one report through in each [`REPORT_INTERVAL`].
#[derive(Default)]
pub(super) struct ReportLimit(Cell<Option<Instant>>);

impl ReportLimit {
    /// Whether it is time for another report; then it counts as made.
    pub fn allows(&self) -> bool {
        let now = Instant::now();
        let due = self.0.get().is_none_or(|last| now - last >= REPORT_INTERVAL);
        if due {
            self.0.set(Some(now));
        }
        due
    }
}

impl Link {
    /// A link of this kind called `name` in the log, that carries `bytes_per_second`.
    pub fn new(name: &'static str, kind: LinkKind, bytes_per_second: u32) -> Self {
        let now_us = Instant::now().as_micros();
        Self {
            name,
            endpoint: RefCell::new(Endpoint::new(kind, bytes_per_second, now_us)),
            to_write: Signal::new(),
            to_schedule: Signal::new(),
            drops: ReportLimit::default(),
            refusals: ReportLimit::default(),
        }
    }

    /// The link's name in the log.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// What kind of link it is.
    pub(super) fn kind(&self) -> LinkKind {
        self.endpoint.borrow().kind()
    }

    /// The link's counters.
    pub fn statistics(&self) -> LinkStatistics {
        self.endpoint.borrow().statistics()
    }

    /// Whether everything that was asked for has been taken by the wire.
    pub fn is_idle(&self) -> bool {
        self.endpoint.borrow().is_idle()
    }

    /// Uses our end of the link. It must not wait in there.
    pub(super) fn with<R>(&self, use_endpoint: impl FnOnce(&mut Endpoint) -> R) -> R {
        use_endpoint(&mut self.endpoint.borrow_mut())
    }

    /// Takes out the message that leaves next.
    pub(super) fn take(&self, shared: &Shared) -> Option<Message> {
        shared.with_system_state(|state| {
            shared.with_parameters(|parameters| self.with(|endpoint| endpoint.take(state, parameters)))
        })
    }

    /// Says what a ground station that connects has to know.
    // In line it would be there twice.
    #[inline(never)]
    pub(super) fn say_notices(&self, shared: &Shared) {
        for (severity, text) in shared.notices() {
            self.with(|endpoint| endpoint.say(severity, text));
        }
    }

    /// Logs that a message of `stream` was dropped, once a second at most.
    pub(super) fn report_drop(&self, stream: Stream) {
        if self.drops.allows() {
            let dropped = self.statistics().dropped;
            warn!(
                "{}: link too slow, dropped {:?}, {} messages so far",
                self.name, stream, dropped
            );
        }
    }
}
