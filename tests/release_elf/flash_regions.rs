//! Where in flash the firmware is: between its two regions is what an update keeps.

use std::fs;
use std::ops::Range;

use rover_battmon::memory::flash_map;
use support::repository;
use workbench::program::release_firmware;

/// Where flash is in the processor's addresses.
const FLASH_BASE: u32 = 0x1000_0000;

/// The files that are served by FTP and to browsers.
const SERVED: [&str; 4] = [
    "web/page.html.gz",
    "docs/parameters.json.gz",
    "docs/parameters.json.xz",
    "docs/general.json",
];

/// A region of `memory.x`, by the symbols at its ends.
fn region(name: &str) -> Range<u32> {
    let end = |end: &str| {
        let name = format!("_{name}_{end}");
        let symbols = &release_firmware().symbols;
        let symbol = symbols.iter().find(|symbol| symbol.name == name);
        symbol.expect("memory.x defines it").address - FLASH_BASE
    };
    end("start")..end("end")
}

#[test]
fn the_linker_has_the_regions_of_the_flash_map() {
    assert_eq!(region("program"), flash_map::PROGRAM);
    assert_eq!(region("constants"), flash_map::CONSTANTS);
}

#[test]
fn the_files_that_are_served_are_behind_what_is_kept_and_nothing_else_is() {
    let constants = FLASH_BASE + flash_map::CONSTANTS.start..FLASH_BASE + flash_map::CONSTANTS.end;
    let sections = &release_firmware().sections;
    let found: Vec<_> = sections
        .iter()
        .filter(|section| constants.contains(&section.address))
        .collect();
    let [section] = found[..] else {
        panic!("{} sections", found.len());
    };
    let mut bytes = 0;
    for name in SERVED {
        let content = fs::read(repository().join(name)).expect("it is committed");
        let is_there = section.bytes.windows(content.len()).any(|part| part == content);
        assert!(is_there, "{name}");
        bytes += content.len();
    }
    assert_eq!(section.bytes.len(), bytes.next_multiple_of(4));
}
