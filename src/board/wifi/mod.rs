//! The radio of a Pico W, a CYW43439.

mod bus;
mod entropy;
mod find;
mod gspi;
mod radio;

pub use entropy::entropy;
pub use find::{BoardKind, find_board};
pub use radio::{Wifi, WifiPeripherals};
