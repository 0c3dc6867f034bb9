//! Programs for a host, beside the firmware: a simulator, a replay of recorded drives, a check of boards over MAVLink.
//!
//! Here is what the programs share with each other and with the tests; built for the board, this crate is empty.
#![cfg_attr(target_os = "none", no_std)]
#![cfg(not(target_os = "none"))]

pub mod board_check;
pub mod frames;
pub mod page_messages;
pub mod recordings;
pub mod sim;
