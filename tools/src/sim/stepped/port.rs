//! A serial port in stepped time, with whoever holds its other end.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::convert::Infallible;

use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Instant, Timer};
use embedded_io_async::{ErrorType, Write};
use rover_battmon::tasks::{ByteSource, ReceiveError, SerialLine};

/// Duration of a byte at 115200 baud, in µs.
pub const BYTE_US: u64 = 87;

/// A port with a wire. A reference to it is both ends.
pub struct Port {
    byte_us: u64,
    received: RefCell<VecDeque<u8>>,
    arrived: Signal<NoopRawMutex, ()>,
    sent: RefCell<Vec<(u64, u8)>>,
    /// Time at the start of the present clock, in µs.
    epoch_us: Cell<u64>,
}

impl Port {
    /// A port at which a byte takes `byte_us`.
    pub fn new(byte_us: u64) -> Self {
        Self {
            byte_us,
            received: RefCell::default(),
            arrived: Signal::new(),
            sent: RefCell::default(),
            epoch_us: Cell::new(0),
        }
    }

    /// Sends bytes to the vehicle.
    pub fn send(&self, bytes: &[u8]) {
        self.received.borrow_mut().extend(bytes);
        self.arrived.signal(());
    }

    /// Everything that the vehicle has sent, each byte with the end of its frame in µs.
    pub fn sent(&self) -> Vec<(u64, u8)> {
        self.sent.borrow().clone()
    }

    /// The power was off: bytes on their way are lost, and a new clock begins at this time.
    pub(super) fn restart(&self, epoch_us: u64) {
        self.received.borrow_mut().clear();
        self.epoch_us.set(epoch_us);
    }
}

impl ErrorType for &Port {
    type Error = Infallible;
}

impl Write for &Port {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        Timer::after_micros(self.byte_us * bytes.len() as u64).await;
        let at_us = self.epoch_us.get() + Instant::now().as_micros();
        self.sent
            .borrow_mut()
            .extend(bytes.iter().map(|byte| (at_us, *byte)));
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl ByteSource for &Port {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        while self.received.borrow().is_empty() {
            self.arrived.wait().await;
        }
        let count = self.received.borrow().len().min(buffer.len());
        Timer::after_micros(self.byte_us * count as u64).await;
        let mut received = self.received.borrow_mut();
        for (to, from) in buffer.iter_mut().zip(received.drain(..count)) {
            *to = from;
        }
        Ok(count)
    }
}

impl SerialLine for &Port {
    async fn send(&mut self, bytes: &[u8]) {
        let Ok(_) = Write::write(self, bytes).await;
    }
}
