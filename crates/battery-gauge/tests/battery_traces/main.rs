//! The battery monitor over whole drives: errors of its estimates, and times of its failsafes.
//!
//! The traces are synthetic and deterministic; `tests/data/traces/README.md` describes them. Each test prints its
//! figure (`cargo test -p battery-gauge --test battery_traces -- --nocapture`); `docs/battery-model.md` lists them.

mod charge;
mod failsafe;
mod pack;
mod percentages;
mod replay;
mod resistance;
mod sample;
mod sample_rate;
mod start;
