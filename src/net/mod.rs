//! MAVLink by UDP and TCP, and a page for browsers, over a network device; addresses for others on the network.
//!
//! All of it runs in one task ([`serve`]): in each turn the network stack, then everything that waits for it (`until` in `socket.rs`).

mod address;
mod browsers;
mod datagram;
mod dhcp;
mod discovery;
mod ingress_filter;
mod leases;
mod memory;
mod paced;
mod retained_leases;
mod sender;
mod serve;
mod service;
mod socket;
mod stations;
mod tcp;
mod udp;

pub use address::{NetReport, Role};
pub use memory::NetMemory;
pub use retained_leases::RetainedLeases;
pub use serve::serve;
pub use service::Service;
