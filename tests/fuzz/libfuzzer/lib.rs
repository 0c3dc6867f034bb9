//! What all fuzz targets share: the functions that `tests/host/fuzz.rs` runs, too.

#![allow(dead_code, reason = "some of the support is for other tests")]

#[path = "../../support/desk.rs"]
mod desk;
#[path = "../../support/signer.rs"]
mod signer;
#[path = "../../support/mod.rs"]
mod support;
#[path = "../targets/mod.rs"]
pub mod targets;
