//! Data in flash, and in RAM that survives a reset, each behind a checksum.

pub(crate) mod checksum;
pub mod flash_chip;
pub mod flash_map;
pub mod identity;
pub(crate) mod in_place;
pub mod retained;
pub mod save_state;
pub mod storage;
