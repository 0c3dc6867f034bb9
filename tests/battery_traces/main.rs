//! The battery monitor over whole drives: how far its estimates are off, and when its failsafes trip.
//!
//! The traces are synthetic and deterministic; `tests/data/traces/README.md` tells how they were made. Each test prints its
//! figure (`cargo test --test battery_traces -- --nocapture`); `docs/battery-model.md` lists them.

mod charge;
mod failsafe;
mod pack;
mod replay;
mod resistance;
mod sample_rate;
