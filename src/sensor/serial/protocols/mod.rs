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
