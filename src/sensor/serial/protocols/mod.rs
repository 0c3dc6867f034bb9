//! The protocols, a file each.

mod kiss;
mod mega_squirt;
mod torqeedo;

pub(super) use kiss::Kiss;
pub(super) use mega_squirt::MegaSquirt;
pub use torqeedo::TorqeedoCondition;
pub(super) use torqeedo::{Place, Torqeedo};
