#![no_main]
#![allow(dead_code, reason = "each target uses its own part")]

#[path = "../../../support/desk.rs"]
mod desk;
#[path = "../../../support/signer.rs"]
mod signer;
#[path = "../../../support/mod.rs"]
mod support;
#[path = "../../targets/mod.rs"]
mod targets;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| targets::storage::run(bytes));
