//! What is linked into the release firmware, read from its ELF file: panic sites, sizes, no allocator, where in flash it is.

mod calls;
mod flash_regions;
mod lines;
mod panics;
mod sizes;
