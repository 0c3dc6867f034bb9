//! The radio of a Pico W, a CYW43439.

mod bus;
mod entropy;
mod module;
mod program;
mod radio;

pub use entropy::entropy;
pub use module::Module;
pub use radio::{Wifi, WifiPeripherals};
