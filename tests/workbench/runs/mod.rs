//! Runs of a board, as long as is asked for: `tests/firmware` asks for a few emulated minutes, `tests/endurance` for hours.

pub mod budget;
pub mod exact_rates;
pub mod flash_cuts;
pub mod line_noise;
pub mod log_cuts;
pub mod logged_drive;
pub mod mixed_packs;
pub mod power_cuts;
mod progress;
pub mod radio_restarts;
pub mod rates_asked_for;
pub mod signing_time;
pub mod soak;
pub mod time_wrap;
