//! The telemetry port, and the one of a motor controller.
#![expect(unsafe_code, reason = "the telemetry port's halves are driven differently")]

use core::convert::Infallible;

use embassy_rp::Peri;
use embassy_rp::peripherals::{DMA_CH0, PIN_0, PIN_1, PIN_5, UART0, UART1};
use embassy_rp::uart::{Async, BufferedUartRx, Config, UartTx};
use embassy_time::{Duration, Timer};
use embedded_io_async::{ErrorType, Read, Write};
use static_cell::ConstStaticCell;

use super::Irqs;
use crate::tasks::{ByteSource, ReceiveError};

/// No interrupt reports that the FIFO has run empty.
const LOOK_INTERVAL: Duration = Duration::from_millis(1);

/// What arrives while another task has its turn.
const RECEIVE_BUFFER_BYTES: usize = 512;

/// UART0 on GP0 (out) and GP1 (in), 8N1. What is sent goes out by DMA channel 0, what is received comes in by interrupts.
///
/// # Panics
/// When called twice: the buffer exists once.
pub fn telemetry_uart(
    uart: Peri<'static, UART0>,
    tx_pin: Peri<'static, PIN_0>,
    rx_pin: Peri<'static, PIN_1>,
    dma: Peri<'static, DMA_CH0>,
    baud: u32,
) -> (UartTransmitter, UartReceiver) {
    static RECEIVE_BUFFER: ConstStaticCell<[u8; RECEIVE_BUFFER_BYTES]> =
        ConstStaticCell::new([0; RECEIVE_BUFFER_BYTES]);
    let mut config = Config::default();
    config.baudrate = baud;
    // SAFETY: the two halves use different registers of the port, but for those of its set-up, which both write alike, here.
    let other_half = unsafe { uart.clone_unchecked() };
    let transmitter = UartTx::new(uart, tx_pin, dma, Irqs, config);
    let receiver = BufferedUartRx::new(other_half, Irqs, rx_pin, RECEIVE_BUFFER.take(), config);
    (UartTransmitter(transmitter), UartReceiver(receiver))
}

/// The sending half of the telemetry port. A frame costs one interrupt, however long it is; bytes by interrupts would take
/// most of what a busy line costs. The port's FIFO bridges the time from one frame to the next.
pub struct UartTransmitter(UartTx<'static, Async>);

impl ErrorType for UartTransmitter {
    type Error = Infallible;
}

impl Write for UartTransmitter {
    /// Returns when the last of `bytes` is in the FIFO.
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        // Writing by DMA has no error to report: embassy-rp's type is shared with reading.
        let _ = self.0.write(bytes).await;
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        while self.0.busy() {
            Timer::after(LOOK_INTERVAL).await;
        }
        Ok(())
    }
}

/// KISS and BLHeli_32 controllers send at this rate.
const ESC_BAUD: u32 = 115_200;

/// Some twelve frames.
const ESC_BUFFER_BYTES: usize = 128;

/// UART1 on GP5, which only listens to a motor controller's telemetry; 8N1, by interrupts.
///
/// # Panics
/// When called twice: the buffer exists once.
pub fn esc_uart(uart: Peri<'static, UART1>, rx_pin: Peri<'static, PIN_5>) -> UartReceiver {
    static BUFFER: ConstStaticCell<[u8; ESC_BUFFER_BYTES]> = ConstStaticCell::new([0; ESC_BUFFER_BYTES]);
    let mut config = Config::default();
    config.baudrate = ESC_BAUD;
    UartReceiver(BufferedUartRx::new(uart, Irqs, rx_pin, BUFFER.take(), config))
}

/// The receiving half of a port.
pub struct UartReceiver(BufferedUartRx);

impl ByteSource for UartReceiver {
    /// # Errors
    /// The receiver overran, or the line was noisy. It goes on with the next byte.
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        self.0.read(buffer).await.map_err(|_| ReceiveError::BytesLost)
    }
}
