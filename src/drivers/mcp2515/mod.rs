//! The MCP2515, a CAN controller behind an SPI bus.
//!
//! [`serve`] waits for its interrupt, reads its two receive buffers, sends, and looks after it; [`CanExchange`] is what a task
//! has of it. Both may run at different priorities: at 1 Mbit/s two frames fill the buffers in 260 µs, less than other tasks
//! take.

mod chip;
mod exchange;
mod serve;

pub use exchange::CanExchange;
pub use serve::serve;
