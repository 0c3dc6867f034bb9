//! Battery monitor firmware for a rover autopilot on the Raspberry Pi RP2040.
//!
//! A measurement travels one way through this crate:
//!
//! ```text
//! sensor  --Measurement-->  battery  --BatteryState-->  mavlink  --frames-->  UART, TCP
//! ```
//!
//! | room | what it knows |
//! |---|---|
//! | [`sensor`] | turning conversions of a part into a [`battery::Measurement`] |
//! | [`battery`] | turning measurements into a [`battery::BatteryState`] |
//! | [`parameter`] | the table of parameters and their live values |
//! | [`mavlink`] | message builders, the stream scheduler, the outbox of a link |
//! | [`storage`] | values under keys in flash, whole after a power cut at any moment |
//! | [`vehicle`] | the rover: arming, modes, what the motors are told |
//! | [`crash`] | what is known of a crash after the restart |
//! | [`tasks`] | thin `async` loops that wait, call the rooms above and publish |
//! | `board` | the pins and peripherals of the Freenove RP2040 board (target only) |
//! | `sim` | a simulated pack, clock and wire (host only) |
//!
//! Everything but `tasks`, `board` and `sim` does no I/O and reads no clock: time, counts and parameters come in as
//! arguments, states and messages come out. That is what makes the behaviour testable on a desk.
#![cfg_attr(target_os = "none", no_std)]

mod crc32;
mod log;
mod rounding;
mod sealed;

pub mod battery;
pub mod cadence;
pub mod crash;
pub mod liveness;
pub mod mavlink;
pub mod parameter;
pub mod sensor;
pub mod storage;
pub mod tasks;
pub mod vehicle;

#[cfg(target_os = "none")]
pub mod board;

#[cfg(not(target_os = "none"))]
pub mod sim;
