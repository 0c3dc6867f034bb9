//! The telemetry port, and the one of a motor controller.

use embassy_rp::Peri;
use embassy_rp::peripherals::{PIN_0, PIN_1, PIN_5, UART0, UART1};
use embassy_rp::uart::{BufferedUart, BufferedUartRx, BufferedUartTx, Config};
use embedded_io_async::Read;
use static_cell::ConstStaticCell;

use super::Irqs;
use crate::tasks::{ByteSource, ReceiveError};

/// About 11 ms of line at 115200 baud: enough to keep it busy, little enough that what leaves is fresh.
const TRANSMIT_BUFFER_BYTES: usize = 128;

/// What arrives while another task has its turn.
const RECEIVE_BUFFER_BYTES: usize = 512;

/// UART0 on GP0 (out) and GP1 (in), 8N1, interrupt driven.
///
/// # Panics
/// When called twice: the buffers exist once.
pub fn telemetry_uart(
    uart: Peri<'static, UART0>,
    tx_pin: Peri<'static, PIN_0>,
    rx_pin: Peri<'static, PIN_1>,
    baud: u32,
) -> (BufferedUartTx, UartReceiver) {
    static TRANSMIT_BUFFER: ConstStaticCell<[u8; TRANSMIT_BUFFER_BYTES]> =
        ConstStaticCell::new([0; TRANSMIT_BUFFER_BYTES]);
    static RECEIVE_BUFFER: ConstStaticCell<[u8; RECEIVE_BUFFER_BYTES]> =
        ConstStaticCell::new([0; RECEIVE_BUFFER_BYTES]);
    let mut config = Config::default();
    config.baudrate = baud;
    let (transmitter, receiver) = BufferedUart::new(
        uart,
        tx_pin,
        rx_pin,
        Irqs,
        TRANSMIT_BUFFER.take(),
        RECEIVE_BUFFER.take(),
        config,
    )
    .split();
    (transmitter, UartReceiver(receiver))
}

/// KISS and BLHeli_32 controllers send at this rate.
const ESC_BAUD: u32 = 115_200;

/// Some twelve frames.
const ESC_BUFFER_BYTES: usize = 128;

/// UART1 on GP5, which only listens to a motor controller's telemetry; 8N1, interrupt driven.
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
