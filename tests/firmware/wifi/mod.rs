//! The radio of a Pico W, and ground stations in its network.

mod browsers;
mod crash;
mod credentials;
mod driving;
mod faults;
mod ground;
mod kept_address;
mod links;
mod load;
mod start;
mod station;
