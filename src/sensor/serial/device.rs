//! The device on the serial line: its protocol, and its silence.

use super::SerialProtocol;
use super::protocol::{Request, SerialReading};
use super::registry::AnyProtocol;
use crate::parameter::Parameters;
use crate::sensor::MonitorKind;
use crate::time::Instant;

/// A silence that is too long is reported at this interval, in microseconds: once in each sampling tick.
const REPORT_INTERVAL_US: u64 = 100_000;

/// What comes from the serial line.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum SerialEvent {
    /// A reading.
    Reading(SerialReading),
    /// There was none for too long, for packs of these kinds.
    Silence(&'static [MonitorKind]),
}

/// The device on the serial line.
#[derive(Debug)]
pub struct SerialDevice {
    kinds: &'static [MonitorKind],
    lost_after_us: u64,
    protocol: AnyProtocol,
    /// When there is a silence to report, unless there is a reading before.
    silence_due: Instant,
}

impl SerialDevice {
    /// The device that is set at `now`, at boot; `None` if no pack is measured by one.
    pub fn from_parameters(parameters: &Parameters, now: Instant) -> Option<Self> {
        let protocol = SerialProtocol::in_use(parameters)?;
        Some(Self {
            kinds: protocol.kinds(),
            lost_after_us: protocol.lost_after_us(),
            protocol: protocol.start(),
            silence_due: now.after_us(protocol.lost_after_us()),
        })
    }

    /// Processes bytes that were received by `now`.
    pub fn receive(&mut self, bytes: &[u8], now: Instant, mut deliver: impl FnMut(SerialEvent)) {
        let lost_at = now.after_us(self.lost_after_us);
        let silence_due = &mut self.silence_due;
        let mut deliver_reading = |reading| {
            if !matches!(reading, SerialReading::Notice(_)) {
                *silence_due = lost_at;
            }
            deliver(SerialEvent::Reading(reading));
        };
        self.protocol.begin(now);
        for byte in bytes {
            self.protocol.push(*byte, now, &mut deliver_reading);
        }
    }

    /// Reports a silence that is too long at `now`, again and again.
    pub fn poll(&mut self, now: Instant, deliver: impl FnOnce(SerialEvent)) {
        if now >= self.silence_due {
            self.silence_due = now.after_us(REPORT_INTERVAL_US);
            deliver(SerialEvent::Silence(self.kinds));
        }
    }

    /// What has to be sent at `now`, if anything.
    pub fn next_request(&mut self, now: Instant) -> Option<Request> {
        self.protocol.next_request(now)
    }

    /// When [`Self::poll`] and [`Self::next_request`] have to be called again at the latest.
    pub fn next_due(&self) -> Instant {
        let request_due = self.protocol.next_due();
        request_due.map_or(self.silence_due, |due| due.min(self.silence_due))
    }
}
