//! What is linked into the release firmware, read from its ELF file: panic sites, sizes, no allocator.

#[path = "../support/elf.rs"]
mod elf;

mod calls;
mod lines;
mod panics;
mod program;
mod sizes;
