//! What several test programs share.

pub mod frames;
pub mod requests;
