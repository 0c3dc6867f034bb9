//! The Freenove RP2040 board: which pin is what, and the peripherals behind it.

mod adc;
mod alarm_watch;
mod can;
mod dma_ring;
mod fault;
mod flash;
mod flash_chip;
mod floats;
mod i2c;
mod idle;
mod indicators;
mod lamps;
mod last_run;
mod memory_map;
mod motors;
mod pre_init;
mod pulses;
mod reset;
mod retained;
mod running;
mod spi;
mod stack_guard;
mod uart;
mod usb;
mod watchdog;
mod wifi;

pub use adc::{AnalogInputs, AnalogPeripherals};
pub use can::{BoardCan, CanController, CanPins, can_exchange, interrupt_spawner};
use embassy_rp::peripherals::{DMA_CH0, DMA_CH1, I2C1, PIO0, PIO1, USB};
use embassy_rp::{bind_interrupts, dma, i2c as rp_i2c, pio, usb as rp_usb};
pub use flash::{BoardFlash, FlashDriver, flash_driver};
pub use flash_chip::FlashChip;
pub use floats::use_rom_floats;
pub use i2c::SensorI2c;
pub use idle::idle_us;
pub use indicators::{BoardIndicators, Buzzer, indicators};
pub use last_run::LastRun;
pub use memory_map::{program, program_code};
pub use motors::{BoardMotors, MotorPeripherals, MotorPins};
pub use pulses::{PULSES_SEEN, PulseInput, pulse_input};
pub use reset::{ResetReason, restart};
pub use retained::{RETAINED_LEASES, retained_memory};
pub use running::{name_task, name_this_task, note_firmware};
pub use spi::{SensorSpi, SharedSpi, SpiPeripherals};
pub use stack_guard::guard_stack;
pub use uart::{
    SerialPort, SerialUart, TelemetryUart, UartReceiver, UartTransmitter, serial_uart, telemetry_uart,
};
pub use usb::{UsbPort, UsbReceiver, UsbTransmitter};
pub use watchdog::BoardWatchdog;
pub use wifi::{BoardKind, Wifi, WifiPeripherals, entropy, find_board};

bind_interrupts!(struct Irqs {
    DMA_IRQ_0 => dma::InterruptHandler<DMA_CH0>, dma::InterruptHandler<DMA_CH1>;
    I2C1_IRQ => rp_i2c::InterruptHandler<I2C1>;
    PIO0_IRQ_0 => pio::InterruptHandler<PIO0>;
    PIO1_IRQ_0 => pio::InterruptHandler<PIO1>;
    USBCTRL_IRQ => rp_usb::InterruptHandler<USB>;
});
