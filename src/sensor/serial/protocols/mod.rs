//! The protocols, a file each.

mod kiss;

pub(super) use kiss::Kiss;
