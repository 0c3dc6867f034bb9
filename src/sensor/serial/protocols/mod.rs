//! The protocols, a file each.

pub(super) mod intelligent_energy;
mod kiss;
mod mega_squirt;
mod richen_power;
mod torqeedo;

pub(super) use intelligent_energy::IntelligentEnergy;
pub(super) use kiss::Kiss;
pub(super) use mega_squirt::MegaSquirt;
pub(super) use richen_power::RichenPower;
pub(super) use torqeedo::{Torqeedo, TorqeedoRole};

/// Limits of a generator's output, in volts and amperes: the supported ones charge twelve cells (50.4 V) with a few kilowatts.
const HIGHEST_OUTPUT_V: f32 = 100.0;
const HIGHEST_OUTPUT_A: f32 = 200.0;

/// Whether a generator can give this.
fn is_output(voltage_v: f32, current_a: f32) -> bool {
    (0.0..=HIGHEST_OUTPUT_V).contains(&voltage_v) && current_a.abs() <= HIGHEST_OUTPUT_A
}
