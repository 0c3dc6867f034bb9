//! The telemetry port, and the second serial port.
#![expect(
    unsafe_code,
    reason = "the halves of a port are driven differently, and a pin has two"
)]

use core::convert::Infallible;
use core::pin::pin;
use core::sync::atomic::AtomicU8;

use embassy_rp::Peri;
use embassy_rp::gpio::{Input, Level, Output, Pull};
use embassy_rp::pac;
use embassy_rp::pac::dma::vals::TreqSel;
use embassy_rp::pac::uart::Uart;
use embassy_rp::pac::uart::regs::Uarticr;
use embassy_rp::peripherals::{
    DMA_CH0, DMA_CH8, DMA_CH9, DMA_CH10, DMA_CH11, PIN_0, PIN_1, PIN_4, PIN_5, PIN_22, UART0, UART1,
};
use embassy_rp::uart::{Async, Config, Instance, RxPin, UartRx, UartTx};
use embassy_time::{Duration, Instant, Timer, with_timeout};
use embedded_io_async::{ErrorType, Write};

use super::Irqs;
use super::dma_ring::ReceiveRing;
use crate::sensor::{REQUEST_BYTES, SerialSetup, Wires};
use crate::tasks::{ByteSource, ReceiveError, SerialLine};

/// No interrupt reports that the ring has got a byte.
const LOOK_INTERVAL: Duration = Duration::from_millis(1);

/// Fruitless looks after which the next start bit is waited for. Bytes of a frame follow each other faster.
const LOOKS_IN_SILENCE: u8 = 2;

/// A byte takes 1.04 ms at 9600 baud, the lowest rate there is.
const LONGEST_BYTE: Duration = Duration::from_millis(2);

/// As much as comes in 45 ms, the typical erase of a sector, at 921,600 baud.
const TELEMETRY_RING_BYTES: usize = 4096;

/// As much as comes in 89 ms at 115,200 baud.
const SERIAL_RING_BYTES: usize = 1024;

/// A ring of the DMA begins at a multiple of its length.
#[repr(C, align(4096))]
struct TelemetryRing([AtomicU8; TELEMETRY_RING_BYTES]);
const _: () = assert!(align_of::<TelemetryRing>() == TELEMETRY_RING_BYTES);

#[repr(C, align(1024))]
struct SerialRing([AtomicU8; SERIAL_RING_BYTES]);
const _: () = assert!(align_of::<SerialRing>() == SERIAL_RING_BYTES);

/// Peripherals of the telemetry port: UART0 on GP0 (out) and GP1 (in).
pub struct TelemetryUart {
    /// The port.
    pub uart: Peri<'static, UART0>,
    /// Its output.
    pub tx_pin: Peri<'static, PIN_0>,
    /// Its input.
    pub rx_pin: Peri<'static, PIN_1>,
    /// Sends.
    pub tx_dma: Peri<'static, DMA_CH0>,
    /// Receives, and starts that again.
    pub rx_dma: (Peri<'static, DMA_CH8>, Peri<'static, DMA_CH9>),
}

/// The two halves of the telemetry port, 8N1 at `baud`.
pub fn telemetry_uart(parts: TelemetryUart, baud: u32) -> (UartTransmitter, UartReceiver) {
    static RING: TelemetryRing = TelemetryRing([const { AtomicU8::new(0) }; TELEMETRY_RING_BYTES]);
    let mut config = Config::default();
    config.baudrate = baud;
    // SAFETY: the two halves use different registers of the port, but for those of its set-up, which is done here, and for its
    // DMA control, in which the receiving half sets its bit here and the sending one has a bit of its own.
    let other_half = unsafe { parts.uart.clone_unchecked() };
    let transmitter = UartTx::new(parts.uart, parts.tx_pin, parts.tx_dma, Irqs, config);
    let line = receiving_pin(other_half, parts.rx_pin, config);
    let ring = ReceiveRing::start(parts.rx_dma, pac::UART0, TreqSel::UART0_RX, &RING.0);
    let receiver = UartReceiver::new(pac::UART0, line, ring);
    (UartTransmitter(transmitter), receiver)
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

    /// Returns at once: what was written is in the FIFO, and leaves it by itself.
    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

/// Peripherals of the second serial port: UART1 on GP4 (out) and GP5 (in).
pub struct SerialUart {
    /// The port.
    pub uart: Peri<'static, UART1>,
    /// Its output.
    pub tx_pin: Peri<'static, PIN_4>,
    /// Its input.
    pub rx_pin: Peri<'static, PIN_5>,
    /// Receives, and starts that again.
    pub rx_dma: (Peri<'static, DMA_CH10>, Peri<'static, DMA_CH11>),
    /// High while the port sends, if a transceiver has to be switched.
    pub driver_enable: Option<Peri<'static, PIN_22>>,
}

/// The second serial port, 8N1. Its output's pin stays untouched if nothing is sent.
pub fn serial_uart(parts: SerialUart, setup: SerialSetup) -> SerialPort {
    static RING: SerialRing = SerialRing([const { AtomicU8::new(0) }; SERIAL_RING_BYTES]);
    let mut config = Config::default();
    config.baudrate = setup.baud;
    let driver_enable = parts.driver_enable.map(|pin| Output::new(pin, Level::Low));
    // SAFETY: the two halves use different registers of the port, but for those of its set-up, which is done here.
    let other_half = unsafe { parts.uart.clone_unchecked() };
    match setup.wires {
        Wires::ReceiveOnly => {}
        Wires::BothWays | Wires::OneWire => {
            UartTx::new_blocking(other_half, parts.tx_pin, config);
        }
    }
    let line = receiving_pin(parts.uart, parts.rx_pin, config);
    let ring = ReceiveRing::start(parts.rx_dma, pac::UART1, TreqSel::UART1_RX, &RING.0);
    SerialPort {
        receiver: UartReceiver::new(pac::UART1, line, ring),
        registers: pac::UART1,
        driver_enable,
        baud: setup.baud,
    }
}

/// Bits of a byte on the line: a start bit and a stop bit around it.
const BYTE_BITS: u64 = 10;

/// The FIFO takes a request as a whole.
const FIFO_BYTES: usize = 32;
const _: () = assert!(REQUEST_BYTES <= FIFO_BYTES);

/// The second serial port.
pub struct SerialPort {
    receiver: UartReceiver,
    registers: Uart,
    driver_enable: Option<Output<'static>>,
    baud: u32,
}

impl SerialPort {
    /// Waits until the last stop bit has left. A request is sent without a pause, so its end is known; only the start of its
    /// first bit is not, by up to a bit.
    async fn all_sent(&self, bytes: usize) {
        let bits = BYTE_BITS * bytes as u64;
        let duration = Duration::from_micros(bits * 1_000_000 / u64::from(self.baud.max(1)));
        Timer::after(duration).await;
        let latest = Instant::now() + LONGEST_BYTE;
        while self.registers.uartfr().read().busy() && Instant::now() < latest {}
    }
}

impl ByteSource for SerialPort {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        self.receiver.receive(buffer).await
    }
}

impl SerialLine for SerialPort {
    async fn send(&mut self, bytes: &[u8]) {
        if let Some(pin) = &mut self.driver_enable {
            pin.set_high();
        }
        // Everything sent before has left: the FIFO is empty.
        for byte in bytes.iter().take(FIFO_BYTES) {
            self.registers.uartdr().write(|data| data.set_data(*byte));
        }
        self.all_sent(bytes.len()).await;
        if let Some(pin) = &mut self.driver_enable {
            pin.set_low();
        }
    }
}

/// Sets a UART up to receive at `pin`, and returns the pin as one whose start bits can be waited for.
///
/// An open line would be noise: the pin is pulled up, to the level of a silent line, and has the hysteresis of its Schmitt
/// trigger. The UART's own set-up turns both off.
fn receiving_pin<T: Instance>(
    uart: Peri<'static, T>,
    pin: Peri<'static, impl RxPin<T>>,
    config: Config,
) -> Input<'static> {
    // SAFETY: the UART's driver sets the pin up and does nothing with it later. What is waited for is the pin's interrupt,
    // which no other driver uses.
    let uart_pin = unsafe { pin.clone_unchecked() };
    let number = usize::from(pin.pin());
    // Before the UART, as it makes the pin one of the processor.
    let line = Input::new(pin, Pull::Up);
    UartRx::new_blocking(uart, uart_pin, config);
    pac::PADS_BANK0.gpio(number).modify(|pad| {
        pad.set_pue(true);
        pad.set_schmitt(true);
    });
    line
}

/// The receiving half of a port: DMA brings every byte into a ring, which is looked at every millisecond while bytes come.
/// While none come, the next start bit is waited for.
pub struct UartReceiver {
    registers: Uart,
    line: Input<'static>,
    ring: ReceiveRing,
    /// When the ring was found empty. Looked for sooner than a [`LOOK_INTERVAL`] later, bytes would be handled one by one.
    emptied_at: Instant,
    looks_in_vain: u8,
    /// When noise was reported.
    noisy_at: Instant,
}

impl UartReceiver {
    fn new(registers: Uart, line: Input<'static>, ring: ReceiveRing) -> Self {
        Self {
            registers,
            line,
            ring,
            emptied_at: Instant::MIN,
            looks_in_vain: 0,
            noisy_at: Instant::MIN,
        }
    }

    /// Takes the bytes that have come since the last look.
    fn look(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        self.check_line()?;
        let read = self.ring.read(buffer);
        read.map_err(|overtaken| ReceiveError::BytesLost(overtaken.bytes_lost))
    }

    /// Waits for the line to fall, or until a byte is there that was under way before: it need not have another edge.
    async fn start_bit(&mut self) {
        let mut edge = pin!(self.line.wait_for_falling_edge());
        let waited = with_timeout(LONGEST_BYTE, edge.as_mut()).await;
        if waited.is_err() && self.ring.is_empty() {
            edge.await;
        }
        self.looks_in_vain = 0;
        self.emptied_at = Instant::now();
    }

    /// Whether the port saw noise, or its FIFO overran. Its raw interrupts stay until they are cleared.
    ///
    /// At most once per [`LOOK_INTERVAL`]: on a line that is nothing but noise there would be an error at every look, and
    /// no look at what was received.
    fn check_line(&mut self) -> Result<(), ReceiveError> {
        let now = Instant::now();
        if now.saturating_duration_since(self.noisy_at) < LOOK_INTERVAL {
            return Ok(());
        }
        let raw = self.registers.uartris().read();
        if !(raw.oeris() || raw.beris() || raw.peris() || raw.feris()) {
            return Ok(());
        }
        let mut seen = Uarticr(0);
        seen.set_oeic(raw.oeris());
        seen.set_beic(raw.beris());
        seen.set_peic(raw.peris());
        seen.set_feic(raw.feris());
        self.registers.uarticr().write_value(seen);
        self.noisy_at = now;
        Err(ReceiveError::LineError)
    }
}

impl ByteSource for UartReceiver {
    /// # Errors
    /// The line was noisy, or unread bytes were overwritten. It goes on with the next byte.
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        loop {
            // Later than that, it is not a wait: bytes may have been there for long.
            let since_empty = Instant::now().saturating_duration_since(self.emptied_at);
            if since_empty < LOOK_INTERVAL {
                Timer::after(LOOK_INTERVAL).await;
            }
            let received = self.look(buffer)?;
            if received < buffer.len() {
                self.emptied_at = Instant::now();
            }
            if received > 0 {
                self.looks_in_vain = 0;
                return Ok(received);
            }
            self.looks_in_vain = self.looks_in_vain.saturating_add(1);
            if self.looks_in_vain >= LOOKS_IN_SILENCE {
                self.start_bit().await;
            }
        }
    }
}
