//! One link to ground stations, between the task that schedules its telemetry and the one that writes its frames.

use core::cell::{Cell, RefCell};

use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Instant};

use crate::log::warn;
use crate::mavlink::{LinkStatistics, Message, Outbox, Posted, Stream};

/// Room for every stream there is: HEARTBEAT, SYS_STATUS and BATTERY_STATUS.
const OUTBOX_CAPACITY: usize = 3;

/// A link that is far too slow drops many messages a second; the log is told of it this often.
const DROP_REPORT_INTERVAL: Duration = Duration::from_secs(1);

/// A link: its outbox and its counters.
pub struct Link {
    name: &'static str,
    outbox: Mutex<CriticalSectionRawMutex, RefCell<Outbox<OUTBOX_CAPACITY>>>,
    posted: Signal<CriticalSectionRawMutex, ()>,
    statistics: Mutex<CriticalSectionRawMutex, Cell<LinkStatistics>>,
    drop_reported: Mutex<CriticalSectionRawMutex, Cell<Option<Instant>>>,
}

impl Link {
    /// A link called `name` in the log.
    pub const fn new(name: &'static str) -> Self {
        Self {
            name,
            outbox: Mutex::new(RefCell::new(Outbox::new())),
            posted: Signal::new(),
            statistics: Mutex::new(Cell::new(LinkStatistics { sent: 0, dropped: 0 })),
            drop_reported: Mutex::new(Cell::new(None)),
        }
    }

    /// The link's name in the log.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// The link's counters.
    pub fn statistics(&self) -> LinkStatistics {
        self.statistics.lock(Cell::get)
    }

    /// Posts a message. What is dropped for it is counted, and logged once a second at most.
    pub(super) fn post(&self, message: Message) {
        match self.outbox.lock(|outbox| outbox.borrow_mut().post(message)) {
            Posted::Queued => {}
            Posted::Replaced(stream) | Posted::Refused(stream) => self.drop_one(stream),
        }
        self.posted.signal(());
    }

    fn drop_one(&self, stream: Stream) {
        let dropped = self.count(|statistics| {
            statistics.dropped = statistics.dropped.wrapping_add(1);
            statistics.dropped
        });
        let now = Instant::now();
        let report = self.drop_reported.lock(|reported| {
            let due = reported
                .get()
                .is_none_or(|last| now - last >= DROP_REPORT_INTERVAL);
            if due {
                reported.set(Some(now));
            }
            due
        });
        if report {
            warn!(
                "{}: link too slow, dropped {:?}, {} messages so far",
                self.name, stream, dropped
            );
        }
    }

    /// Waits for the next message and takes it out.
    pub(super) async fn next_message(&self) -> Message {
        loop {
            if let Some(message) = self.outbox.lock(|outbox| outbox.borrow_mut().take()) {
                return message;
            }
            self.posted.wait().await;
        }
    }

    /// A frame was handed to the wire.
    pub(super) fn count_sent(&self) {
        self.count(|statistics| statistics.sent = statistics.sent.wrapping_add(1));
    }

    fn count<R>(&self, change: impl FnOnce(&mut LinkStatistics) -> R) -> R {
        self.statistics.lock(|cell| {
            let mut statistics = cell.get();
            let result = change(&mut statistics);
            cell.set(statistics);
            result
        })
    }
}
