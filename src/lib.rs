//! Battery monitor firmware for a rover autopilot on the Raspberry Pi RP2040.
//!
//! A measurement travels one way through this crate:
//!
//! ```text
//! converter, I2C, pulses                                                ground station
//!   │ counts, registers                                                       ▲
//!   ▼                                                                         ▼
//! sensor ──Measurement──▶ battery ──BatteryState──▶ mavlink ◀──frames──▶ UART, USB, TCP
//!                            │                         │
//!                            └──failsafe──▶ vehicle ◀──┘ commands
//!                                              │
//!                                              └──▶ motors, lamps, buzzer
//! ```
//!
//! Pins, dividers, cells and thresholds come from [`parameter`]; a ground station sets them over the same wire.
//!
//! # From a conversion to a frame
//! The tasks do this for each pack ten times a second, in one go. Nothing here waits, owns a peripheral or reads a clock:
//!
//! ```
//! use rover_battmon::battery::{BatteryMonitor, BatteryState, ChargeState, Measurement, PackSettings, PackStatus, Tick};
//! use rover_battmon::mavlink::{Framer, Stream};
//! use rover_battmon::pack::Pack;
//! use rover_battmon::sensor::{AdcCount, VoltageDivider};
//! use rover_battmon::system::SystemState;
//! use rover_battmon::time::Instant;
//!
//! // 3600 of 4095, behind the board's divider.
//! let count = AdcCount(3600.0);
//! let divider = VoltageDivider { multiplier: 3.95, offset_v: 0.0 };
//! let reading = Measurement {
//!     voltage_v: Some(divider.pack_voltage_v(count.pin_voltage_v())),
//!     // Nothing else is measured, and what is unknown stays `None`.
//!     ..Measurement::default()
//! };
//!
//! // A 3S pack. `Err(ReadError::...)` would be a reading that failed.
//! let settings = PackSettings { cell_count: Some(3), ..PackSettings::default() };
//! let mut monitor = BatteryMonitor::new();
//! let mut battery = BatteryState::default();
//! let tick = Tick { now: Instant::from_micros(100_000), ..Tick::default() };
//! let _ = monitor.update(&mut battery, tick, Ok(reading), &settings);
//! assert_eq!(battery.status, PackStatus::Healthy);
//! assert_eq!(battery.charge_state, ChargeState::Ok);
//!
//! // A message is built when the wire takes it, numbered, and framed.
//! let batteries = [battery];
//! let state = SystemState { batteries: &batteries, ..SystemState::default() };
//! let message = Stream::BatteryStatus(Pack::First).build(&state);
//! let frame = Framer::new().frame(&message, 1).to_vec();
//! // MAVLink 2, and BATTERY_STATUS.
//! assert_eq!((frame[0], frame[7]), (0xfd, 147));
//! // The voltage of the whole pack stands in the first cell's place, in millivolts: 11.459 V.
//! assert_eq!(u16::from_le_bytes([frame[20], frame[21]]), 11_459);
//! ```
//!
//! # Modules
//! | module | what it knows |
//! |---|---|
//! | [`sensor`] | turning conversions of a part into a [`battery::Measurement`] |
//! | [`battery`] | turning measurements into a [`battery::BatteryState`] |
//! | [`parameter`] | the table of parameters and their live values |
//! | [`announce`] | severities and limits of texts for ground stations |
//! | [`pack`] | which packs there are |
//! | [`time`] | moments, regular due times |
//! | [`mavlink`] | message builders, the stream scheduler, the outbox of a link |
//! | [`memory`] | what lies where in flash; values under keys in flash, whole after a power cut at any moment; what survives a reset |
//! | [`recorder`] | a ring of log files in flash; `dataflash`: their records, in ArduPilot's format |
//! | [`wifi`] | names and passwords of Wi-Fi networks, what the radio is to do, what it reports |
//! | [`vehicle`] | the rover: arming, modes, outputs to the motors |
//! | [`system`] | packs and vehicle as a whole, at one moment, and whether the vehicle can be armed |
//! | [`crash`] | what is known of a crash after the restart |
//! | [`autopilot`] | the core object: owns parameters, packs, vehicle and signing, and decides between them |
//! | [`drivers`] | the CAN controller, how far a DMA ring is read, whether a USB device is stuck |
//! | [`tasks`] | thin `async` loops that wait, call the core and publish |
//! | `web` | a page for browsers, and MAVLink over a WebSocket, over any stream of bytes (with one of the features `board` and `web`) |
//! | `net` | MAVLink by UDP and TCP, and addresses for others (with the feature `board`) |
//! | `board` | the pins and peripherals of the Freenove RP2040 board (target only, with the feature `board`) |
//!
//! Everything but `tasks`, `drivers`, `net`, `web` and `board` does no I/O and reads no clock: time, counts and parameters come
//! in as arguments, states and messages come out. That is what makes the behaviour testable on a desk.
//!
//! # Where to go next
//! - One pack and its life: [`BatteryMonitor`](battery::BatteryMonitor), [`BatteryState`](battery::BatteryState),
//!   [`PackSettings`](battery::PackSettings).
//! - A sensor of your own: fill a [`Measurement`](battery::Measurement). Into this firmware: `docs/extending.md`.
//! - Everything at once, without hardware, links and clock: [`Autopilot`](autopilot::Autopilot).
//! - A link without its wire, bytes in and frames out: [`Endpoint`](mavlink::Endpoint).
//! - Firmware of your own, without the feature `board`: `docs/extending.md`.
//! - Another board: the traits that `board` and the simulator implement, as [`AnalogIn`](sensor::AnalogIn),
//!   [`I2cBus`](sensor::I2cBus), [`Motors`](vehicle::Motors), [`Indicators`](vehicle::Indicators) and those of [`tasks`]; and
//!   `docs/extending.md`.
//! - Whole programs: the firmware `src/bin/firmware/main.rs`, and one idea each in `examples/`; in the repository the simulator,
//!   `tools/src/bin/sitl.rs`.
//! - What a version of it promises: `CHANGELOG.md`.
//! - How it all fits together and why: `docs/architecture.md` and `docs/decisions.md`.
#![cfg_attr(target_os = "none", no_std)]

mod numbers;

pub mod announce;
pub mod autopilot;
pub mod battery;
pub mod crash;
pub mod drivers;
#[doc(hidden)]
pub mod log;
pub mod mavlink;
pub mod memory;
#[cfg(feature = "board")]
pub mod net;
pub mod pack;
pub mod parameter;
pub mod recorder;
pub mod sensor;
pub mod system;
pub mod tasks;
pub mod time;
pub mod vehicle;
#[cfg(feature = "web")]
pub mod web;
pub mod wifi;

#[cfg(all(target_os = "none", feature = "board"))]
pub mod board;
