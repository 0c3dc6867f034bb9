//! The protocols, a file each.

mod kiss;
mod mega_squirt;

pub(super) use kiss::Kiss;
pub(super) use mega_squirt::MegaSquirt;
