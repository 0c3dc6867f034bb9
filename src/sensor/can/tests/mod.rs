//! The node as a bus sees it.

mod bench;
mod chargers;
mod golden;
mod ids;
mod packs;
mod status;
mod transfers;
