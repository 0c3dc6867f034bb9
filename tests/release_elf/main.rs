//! What is linked into the release firmware, read from its ELF file: its panic sites.

#[path = "../support/elf.rs"]
mod elf;

mod calls;
mod lines;
mod panics;
mod program;
