//! An emulated RP2040 board on which a release ELF runs, byte for byte as it is flashed.
//!
//! ```ignore
//! let firmware = Firmware::load("target/thumbv6m-none-eabi/release/rover-battmon");
//! let mut board = Board::power_up(&firmware, 1);
//! board.adc_input(0, AdcInput::Volts(2.0));
//! board.run_for(1_000_000);
//! board.uart_send(0, 1_200_000, b"hello");
//! board.run_for(1_000_000);
//! let sent: Vec<u8> = board.uart(0).take_sent().iter().map(|sent| sent.byte).collect();
//! assert!(!sent.is_empty());
//! assert!(board.resets().is_empty() && board.bus_errors().is_empty());
//! ```
//!
//! # What is modelled
//!
//! The emulator knows nothing of the firmware's source: it sees pins, registers, wires, and the
//! symbols of the ELF. Processor core, NVIC, clocks, RESETS, IO_BANK0 and PADS_BANK0
//! come from the crate `rp2040-emu`; SIO, PLLs, memory, bus, boot ROM and the way into its USB boot loader, flash, TIMER, WATCHDOG, PSM, VREG and
//! CHIP_RESET, both UARTs, both I2C blocks and SPI1 as masters, GPIO inputs and their interrupts, the
//! ADC, the PWM, the PIO, the DMA, the USB device controller with a host at its cable, and everything about time and sleep are in this folder, one file each, with
//! tests against the figures of the RP2040 datasheet. Section numbers are those of its builds in which
//! the watchdog is 4.7 and the ADC 4.9.
//!
//! The flash chip is a W25Q16JV, erased and programmed through the boot ROM functions with the time
//! that takes ([`FlashTiming`]), during which the processor waits and everything else goes on. Its
//! contents outlast resets and power cycles. The second stage is executed as it is, at each start and by a driver that calls
//! a copy in RAM, against the registers of XIP_SSI: chips of other makes ([`FlashMake`]) leave the factory without quad
//! reads, and are given them by different commands or by none. The power can be cut at any operation
//! ([`Board::cut_power_at_flash_operation`], [`FlashCut`]), sectors can be worn out, contents be
//! changed from outside. Misuse that would damage data or stop a real chip is a panic that says what
//! it is: arguments that are not aligned or not in flash, a ROM function without `flash_exit_xip`,
//! and flash read by processor or DMA while it is busy, not set up for reads that the chip knows, or not flushed from
//! the cache.
//!
//! The ROM's routines for singles that firmware calls give what the ROM gives, bit for bit, after the
//! cycles that it takes on average, which count as instructions. The cache in front of the flash holds
//! what one of its size would: for what it misses the processor waits as long as the line's bits take, at the divider that
//! is set, on one wire (03h) or on four (continuous EBh).
//!
//! The ADC converts in round robin and at its exact pace, and its results reach RAM by chained DMA channels. Tests can lose
//! conversions, hold the DMA, or halt a channel. [`Board::attach_circuit`] connects a pack with a resistance, H-bridges at pins
//! and their motors ([`circuit`]): each conversion sees the voltage and the current of its own instant, and monitors at the I2C
//! bus give the means of their conversions.
//!
//! [`Board::attach_wifi`] makes the board a Pico W: a CYW43439 at the pins of PIO0, on which the driver loads its program and
//! brings up an access point or joins a network ([`cyw43`] says what of it is modelled). Frames from and to the air are the test's,
//! or those of the computers in [`air`].
//!
//! A board can be cloned at any moment, while a test has attached no devices to it: the copy goes on as the board does, to the
//! byte and the cycle, and may go to another thread.
//!
//! # What is not, and may not be claimed
//!
//! * Exact cycles: which line a miss of the flash cache replaces is assumed; what is fetched ahead of a branch, bus
//!   contention and the wait states of the APB are left out, taken branches and SIO loads differ from silicon by a
//!   cycle. Milliseconds and instruction counts are sound, cycle figures are not.
//! * `clk_sys` is 125 MHz from the first instruction, `clk_peri` the same, `clk_adc` 48 MHz.
//! * Core 1, the interpolators, SPI0, RTC and SysTick: their registers read back what was
//!   written or zero, and every access is recorded in [`Board::unmodelled`].
//! * The NMI never comes. A pin's function, the direction of SIO and the pad's output disable decide
//!   what drives it; the overrides of IO_BANK0 do nothing. UART, SPI, PWM and PIO do not reach the inputs
//!   of SIO and the GPIO interrupts. A forced PIO instruction that stalls is tried again in cycles of the divided clock.
//! * PWM: interrupts, the DMA request, input modes, phase steps, phase-correct counting and inverted outputs; using them is a panic.
//! * Results of the converter in RAM, as long as they raise no interrupt: a processor that reads them without having read a
//!   register of ADC or DMA first may see RAM as it was 100 µs before. Registers and DMA are exact.
//! * The circuit has no capacitors, its motors no commutation, and nothing follows for the board from the voltage of its pack.
//!   Motors differ: their figures are typical, those of an owner's own are not known.
//! * Forced interrupts of TIMER, IO_BANK0, PIO and DMA, the DMA's second interrupt and byte swap, TIMER written or paused by
//!   its registers, the boot ROM's functions for bits and for filling memory: a panic, too.
//! * Flash: the time of the bytes on its serial wires (some 20 µs a page, and some µs of a second stage), cells that read
//!   differently from one time to the next after a torn operation, cells that hold their charge for
//!   a short time only, wear by itself, commands sent through XIP_SSI other than those of a second
//!   stage, streaming through XIP_CTRL (asynchronous reads). IO_QSPI and PADS_QSPI only store what
//!   is written.
//! * The brown-out before a power cut: power is there or it is not.
//! * A load that ends in a bus error writes zero to its register before the HardFault.
//!
//! # How it works
//!
//! [`board`] owns [`cpu`] and [`bus`]; [`run`] alternates between executing instructions and
//! letting the peripherals of [`soc`] catch up. A peripheral says when its next event is due, so a
//! sleeping firmware costs nothing but its events. Conversions are made in bulk when they are looked at ([`stream`]):
//! 16,360 a second take a millisecond of the host's time, three while four motors are driven.

#![cfg_attr(target_os = "none", no_std)]
#![cfg(not(target_os = "none"))]

mod access_log;
mod adc;
pub mod air;
mod attached;
#[cfg(test)]
mod bench;
mod blocks;
mod board;
mod boot_loader;
#[cfg(test)]
mod boot_loader_tests;
mod boot_rom;
#[cfg(test)]
mod boot_rom_tests;
mod bus;
pub mod can;
mod chip;
mod chip_reset;
pub mod circuit;
mod clock;
#[cfg(test)]
mod clone_tests;
mod core_bus;
mod cpu;
#[cfg(test)]
mod cpu_tests;
mod cyw43;
mod dma;
mod fast_core;
mod faults;
#[cfg(test)]
mod faults_tests;
mod firmware;
mod flash;
mod floating;
mod gpio;
pub mod host_stream;
mod i2c;
mod interrupts;
mod log;
mod memory;
mod memory_map;
mod mpu;
mod peripheral;
mod pin_record;
mod pins;
#[cfg(test)]
mod pins_tests;
mod pio;
mod power_state;
mod pwm;
mod random;
mod register;
mod reset;
#[cfg(test)]
mod reset_tests;
mod rom_floats;
mod rtt;
mod run;
#[cfg(test)]
mod run_tests;
mod sio;
mod soc;
mod spi;
mod ssi;
mod stream;
#[cfg(test)]
mod stream_tests;
mod system_control;
#[cfg(test)]
mod thumb;
mod timer;
mod uart;
mod usb;
mod watchdog;
mod xip_cache;
mod xip_control;

pub use access_log::{BusErrorRecord, Direction, UnmodelledAccess};
pub use adc::{AdcCurve, AdcFault, AdcInput, Conversion, code_of_volts};
pub use board::Board;
pub use boot_loader::BootLoader;
pub use boot_rom::{BRANCH_TO_SELF, UNDEFINED_INSTRUCTION};
pub use circuit::{CurrentSensor, SensorRange};
pub use cpu::CpuState;
pub use cyw43::{AccessPoint, ChipPart, Cyw43, Network, RadioFault};
pub use firmware::Firmware;
pub use flash::{
    FlashCut, FlashMake, FlashOperation, FlashOperationKind, FlashTiming, Status2Write, StatusWrite,
};
pub use gpio::PinWire;
pub use i2c::{Ack, I2c, I2cDevice, I2cDirection, I2cTransaction, devices as i2c_devices};
pub use log::{LogLevel, LogLine};
pub use pin_record::{Edge, PwmChange};
pub use pins::{I2cPins, SpiPins, UartPins};
pub use pwm::PwmOutput;
pub use random::Random;
pub use reset::{ResetCause, ResetRecord};
pub use spi::{Spi, SpiClock, SpiDevice, SpiMode, SpiTransaction, devices as spi_devices};
pub use uart::SentByte;
pub use usb::{AbortPoint, ControlRequest, Failure, HostEvent, Reading, UsbDescription, UsbHost};
