//! What several test programs share.

pub mod frames;
pub mod pack_report;
pub mod requests;
