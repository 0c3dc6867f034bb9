//! The air around a board with Wi-Fi: computers with a network stack of their own, a router, and hostile traffic. They live
//! in emulated time.

pub mod bridge;
pub mod computer;
pub mod dhcp_server;
#[cfg(test)]
mod echo;
mod frames;
pub mod hostile;
pub mod laptop;
pub mod radio;
pub mod router;
pub mod space;
