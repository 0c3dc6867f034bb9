//! What several test programs share.

pub mod frames;
pub mod learnt_record;
pub mod pack_report;
pub mod requests;
