//! What runs on a host only (feature `host`): the simulator, and the check of a board.

pub mod board_check;
pub mod frames;
pub mod page_messages;
pub mod sim;
