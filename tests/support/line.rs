//! A serial line in stepped time, and what was sent on it.

use std::cell::RefCell;
use std::convert::Infallible;

use embassy_time::{Instant, Timer};
use embedded_io_async::{ErrorType, Write};

/// What was sent, each byte with the time in µs at which the write it was part of had ended.
pub type Sent = RefCell<Vec<(u64, u8)>>;

/// What a byte takes at 115200 baud.
pub const BYTE_US: u64 = 87;

/// A serial line that takes `byte_us` for each byte.
pub struct Line<'a> {
    pub byte_us: u64,
    pub sent: &'a Sent,
}

impl ErrorType for Line<'_> {
    type Error = Infallible;
}

impl Write for Line<'_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        Timer::after_micros(self.byte_us * bytes.len() as u64).await;
        let at_us = Instant::now().as_micros();
        self.sent
            .borrow_mut()
            .extend(bytes.iter().map(|byte| (at_us, *byte)));
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}
