//! What is linked into the release firmware, read from its ELF file: panic sites, sizes, no allocator.

mod calls;
mod lines;
mod panics;
mod sizes;
