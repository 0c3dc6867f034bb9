//! The device on the serial line.

use super::SerialProtocol;
use super::protocol::{Request, SerialReading};
use super::registry::AnyProtocol;
use crate::parameter::Parameters;
use crate::time::Instant;

/// The device on the serial line.
#[derive(Debug)]
pub struct SerialDevice(AnyProtocol);

impl SerialDevice {
    /// The device that is set, at boot; `None` if no pack is measured by one.
    pub fn from_parameters(parameters: &Parameters) -> Option<Self> {
        let protocol = SerialProtocol::in_use(parameters)?;
        Some(Self(protocol.start()))
    }

    /// Processes bytes that were received by `now`.
    pub fn receive(&mut self, bytes: &[u8], now: Instant, mut deliver: impl FnMut(SerialReading)) {
        self.0.begin(now);
        for byte in bytes {
            self.0.push(*byte, now, &mut deliver);
        }
    }

    /// What has to be sent at `now`, if anything.
    pub fn next_request(&mut self, now: Instant) -> Option<Request> {
        self.0.next_request(now)
    }

    /// When [`Self::next_request`] has to be called again; `None` if not before something was received.
    pub fn next_due(&self) -> Option<Instant> {
        self.0.next_due()
    }
}
