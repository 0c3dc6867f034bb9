//! The Freenove RP2040 board: which pin is what, and the peripherals behind it.

mod adc;
mod idle;
mod reset;
mod watchdog;

use embassy_rp::gpio::Pull;
use embassy_rp::peripherals::{ADC, PIN_0, PIN_1, PIN_26, UART0};
use embassy_rp::uart::{BufferedInterruptHandler, BufferedUart, BufferedUartRx, BufferedUartTx};
use embassy_rp::{Peri, adc as rp_adc, bind_interrupts, uart};
use static_cell::ConstStaticCell;

pub use adc::PackVoltageInput;
pub use idle::ExecutorIdleTime;
pub use reset::{ResetReason, reset_reason};
pub use watchdog::BoardWatchdog;

bind_interrupts!(struct Irqs {
    ADC_IRQ_FIFO => rp_adc::InterruptHandler;
    UART0_IRQ => BufferedInterruptHandler<UART0>;
});

/// ArduPilot's default for the first telemetry port, 8N1.
const TELEMETRY_BAUD: u32 = 115_200;

/// About 11 ms of line at 115200 baud: enough to keep it busy, little enough that what leaves is fresh.
const TRANSMIT_BUFFER_BYTES: usize = 128;

const RECEIVE_BUFFER_BYTES: usize = 256;

/// The pack's voltage divider on GP26 (ADC0).
pub fn pack_voltage_input(adc: Peri<'static, ADC>, pin: Peri<'static, PIN_26>) -> PackVoltageInput {
    PackVoltageInput::new(
        rp_adc::Adc::new(adc, Irqs, rp_adc::Config::default()),
        // The divider drives the pin; a pull would bend its ratio.
        rp_adc::Channel::new_pin(pin, Pull::None),
    )
}

/// The telemetry port: UART0 on GP0 (out) and GP1 (in), interrupt driven.
///
/// # Panics
/// When called twice: the buffers exist once.
pub fn telemetry_uart(
    uart: Peri<'static, UART0>,
    tx_pin: Peri<'static, PIN_0>,
    rx_pin: Peri<'static, PIN_1>,
) -> (BufferedUartTx, BufferedUartRx) {
    static TRANSMIT_BUFFER: ConstStaticCell<[u8; TRANSMIT_BUFFER_BYTES]> =
        ConstStaticCell::new([0; TRANSMIT_BUFFER_BYTES]);
    static RECEIVE_BUFFER: ConstStaticCell<[u8; RECEIVE_BUFFER_BYTES]> =
        ConstStaticCell::new([0; RECEIVE_BUFFER_BYTES]);
    let mut config = uart::Config::default();
    config.baudrate = TELEMETRY_BAUD;
    BufferedUart::new(
        uart,
        tx_pin,
        rx_pin,
        Irqs,
        TRANSMIT_BUFFER.take(),
        RECEIVE_BUFFER.take(),
        config,
    )
    .split()
}
