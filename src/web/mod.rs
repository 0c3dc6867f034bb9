//! A page for browsers, and what it talks to: HTTP, and MAVLink over a WebSocket, over any stream of bytes.
//!
//! A connection has one request. It is answered and closed, or becomes a link like any other: the binary messages of a
//! WebSocket are pieces of MAVLink's stream of bytes. Who may ask for what: `docs/decisions.md#browsers`.

mod answer;
mod byte_range;
mod content;
mod decoder;
mod files;
mod head;
mod request;
mod serve;
mod slots;
mod web_socket;

pub use request::Sender;
pub use serve::{BUFFER_BYTES, Site, refuse, serve_request};
pub use slots::{Slot, Slots, WEB_SOCKETS};
pub use web_socket::serve_web_socket;
