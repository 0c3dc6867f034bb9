//! MAVLink by UDP and TCP, and addresses by DHCP, to phones that have a network stack of their own. Frames of Ethernet go
//! between them one by one, in stepped time.

mod air;
mod browsers;
mod dhcp;
mod kept_address;
mod phone;
mod ping;
mod room;
mod tcp;
mod udp;
