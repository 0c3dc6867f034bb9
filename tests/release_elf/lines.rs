//! From an address to the line of source it comes from, through everything that was inlined there.

use std::path::Path;

use addr2line::Context;
use addr2line::gimli::{Dwarf, EndianSlice, LittleEndian};
use object::read::elf::ElfFile32;
use object::{Object, ObjectSection};
use support::repository;
use workbench::program::{Program, demangled};

type Bytes<'data> = EndianSlice<'data, LittleEndian>;

/// One function's part in an address.
#[derive(Clone, Debug)]
pub struct Frame {
    /// `src/...` of this package, or the name of a crate and its file: `embassy-usb/src/lib.rs`.
    pub file: String,
    /// 0 when instructions of several lines were merged.
    pub line: u32,
    pub function: String,
}

/// The debug information of a program.
pub struct Lines<'data>(Context<Bytes<'data>>);

impl<'data> Lines<'data> {
    pub fn of(program: &'data Program) -> Self {
        let elf = ElfFile32::<object::LittleEndian>::parse(&*program.file).expect("it was read before");
        let section = |name: &str| elf.section_by_name(name).and_then(|section| section.data().ok());
        let dwarf = Dwarf::load(|id| -> Result<_, addr2line::gimli::Error> {
            Ok(Bytes::new(section(id.name()).unwrap_or_default(), LittleEndian))
        });
        let dwarf = dwarf.expect("the release profile keeps debug information");
        Self(Context::from_dwarf(dwarf).expect("rustc writes valid debug information"))
    }

    /// The functions at an address, the innermost first.
    pub fn frames(&self, address: u32) -> Vec<Frame> {
        let found = self.0.find_frames(u64::from(address)).skip_all_loads();
        let mut frames = found.expect("rustc writes valid debug information");
        let mut list = Vec::new();
        while let Ok(Some(frame)) = frames.next() {
            let name = frame
                .function
                .as_ref()
                .and_then(|function| function.raw_name().ok());
            let location = frame.location.as_ref();
            list.push(Frame {
                file: short_path(location.and_then(|location| location.file).unwrap_or("?")),
                line: location.and_then(|location| location.line).unwrap_or(0),
                function: name.map_or_else(String::new, |name| demangled(&name)),
            });
        }
        list
    }
}

/// Without what differs from machine to machine, and without a crate's version.
fn short_path(path: &str) -> String {
    let path = path.replace("/./", "/");
    if let Ok(own) = Path::new(&path).strip_prefix(repository()) {
        return own.display().to_string();
    }
    if let Some((_, in_library)) = path.split_once("/library/") {
        return in_library.to_owned();
    }
    match path
        .split_once("/registry/src/")
        .and_then(|(_, rest)| rest.split_once('/'))
    {
        Some((_, in_crate)) => without_version(in_crate),
        None => path,
    }
}

/// `embassy-rp-0.10.0/src/usb.rs` without the `-0.10.0`.
fn without_version(path: &str) -> String {
    let Some((folder, rest)) = path.split_once('/') else {
        return path.to_owned();
    };
    let version = folder
        .match_indices('-')
        .find(|(at, _)| folder[at + 1..].starts_with(|character: char| character.is_ascii_digit()));
    let name = version.map_or(folder, |(at, _)| &folder[..at]);
    format!("{name}/{rest}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_the_same_on_every_machine() {
        let own = repository()
            .join("src/bin/firmware/main.rs")
            .display()
            .to_string();
        for (path, short) in [
            (own.as_str(), "src/bin/firmware/main.rs"),
            (
                "/home/a/.cargo/registry/src/index.crates.io-1949/rp-pac-7.0.0/src/./rp2040/io.rs",
                "rp-pac/src/rp2040/io.rs",
            ),
            (
                "/rustc/59807616e/library/core/src/option.rs",
                "core/src/option.rs",
            ),
        ] {
            assert_eq!(short_path(path), short);
        }
    }
}
