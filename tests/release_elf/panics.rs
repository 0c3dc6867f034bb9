//! Every place from which the release firmware can reach a panic, held against a list of known ones.

use std::collections::{BTreeMap, BTreeSet};

use crate::calls::{Call, TRAP, calls};
use crate::lines::{Frame, Lines};
use workbench::program::{Program, Symbol, release_firmware};

/// `what | where | why it stays`, see the top of the file.
const KNOWN: &str = include_str!("panic_sites.txt");

/// Crates whose frames say how a panic is raised, not where from.
const MACHINERY: [&str; 4] = ["core/", "alloc/", "defmt/", "compiler_builtins/"];

/// A call that ends in a panic.
#[derive(Debug)]
struct Site {
    /// Which function of the panic machinery is called.
    what: String,
    /// The function the call was written in.
    place: String,
    line: String,
    /// The line of this package it was inlined into, if it was.
    own_line: Option<String>,
}

/// A line of the list.
struct Entry<'list> {
    what: &'list str,
    place: &'list str,
    reason: &'list str,
}

impl Entry<'_> {
    fn covers(&self, site: &Site) -> bool {
        (self.what == "*" || site.what.contains(self.what))
            && (self.place == "*" || site.place.starts_with(self.place))
    }
}

fn entries(list: &str) -> Vec<Entry<'_>> {
    let lines = list.lines().map(str::trim);
    let written = lines.filter(|line| !line.is_empty() && !line.starts_with('#'));
    written
        .map(|line| {
            let fields: Vec<_> = line.splitn(3, '|').map(str::trim).collect();
            let [what, place, reason] = fields[..] else {
                panic!("not three fields: {line}");
            };
            assert!(!reason.is_empty(), "no reason: {line}");
            Entry { what, place, reason }
        })
        .collect()
}

/// What a panic is raised with: the handler, what of the machinery leads to it, and undefined instructions.
fn panic_functions(program: &Program, calls: &[Call]) -> BTreeMap<u32, String> {
    let mut found = BTreeMap::from([(TRAP, "udf".to_owned())]);
    let functions = program.symbols.iter().filter(|symbol| symbol.is_function);
    for symbol in functions.filter(|symbol| raises_panics(&symbol.name)) {
        // The linker gives the default handler a second name.
        let name = symbol.name.replace("_defmt_panic", "__defmt_default_panic");
        found.insert(symbol.address, name);
    }
    assert!(
        found.values().any(|name| name.ends_with("rust_begin_unwind")),
        "no panic handler: {found:?}"
    );
    // A function of core that can panic is not a site of its own: its caller is.
    loop {
        let callers = calls.iter().filter(|call| found.contains_key(&call.to));
        let new: Vec<&Symbol> = callers
            .filter_map(|call| program.function_at(call.from))
            .filter(|function| is_of_core(&function.name) && !found.contains_key(&function.address))
            .collect();
        if new.is_empty() {
            return found;
        }
        found.extend(
            new.iter()
                .map(|function| (function.address, function.name.clone())),
        );
    }
}

/// Not so what core makes of other crates' types.
fn is_of_core(name: &str) -> bool {
    name.starts_with("core::") && !name.starts_with("core::ptr::drop_in_place")
}

fn raises_panics(name: &str) -> bool {
    name.ends_with("rust_begin_unwind")
        || name.starts_with("core::panicking::")
        || name.contains("defmt_panic")
        || name == "__defmt_default_panic"
}

/// Every call of a panic function from outside of them.
fn panic_sites(program: &Program) -> Vec<Site> {
    let calls = calls(program);
    let panics = panic_functions(program, &calls);
    let lines = Lines::of(program);
    let is_panic = |address| {
        program
            .function_at(address)
            .is_some_and(|function| panics.contains_key(&function.address))
    };
    let sites: BTreeSet<_> = calls
        .iter()
        .filter(|call| panics.contains_key(&call.to) && !is_panic(call.from))
        .collect();
    sites
        .into_iter()
        .map(|call| site(program, &panics[&call.to], call.from, &lines))
        .collect()
}

fn site(program: &Program, what: &str, address: u32, lines: &Lines) -> Site {
    let frames = lines.frames(address);
    let is_machinery = |frame: &&Frame| MACHINERY.iter().any(|part| frame.file.starts_with(part));
    let written_in = frames.iter().find(|frame| !is_machinery(frame)).or(frames.last());
    let symbol = || {
        program
            .function_at(address)
            .map_or("?", |function| &*function.name)
    };
    let function = written_in.map_or_else(symbol, |frame| &*frame.function);
    let own = frames.iter().find(|frame| frame.file.starts_with("src/"));
    Site {
        what: what.to_owned(),
        // `<Type as Trait>::method` begins as the type does.
        place: function.trim_start_matches('<').to_owned(),
        line: written_in.map_or_else(String::new, line_of),
        own_line: own.map(line_of),
    }
}

fn line_of(frame: &Frame) -> String {
    format!("{}:{}", frame.file, frame.line)
}

fn described(site: &Site) -> String {
    let own = site.own_line.as_ref().filter(|own| **own != site.line);
    let own = own.map_or_else(String::new, |own| format!(", inlined at {own}"));
    format!("{} | {} ({}{own})", site.what, site.place, site.line)
}

#[test]
fn every_panic_site_is_known_and_has_a_reason() {
    let sites = panic_sites(release_firmware());
    let entries = entries(KNOWN);
    let covering = |site: &Site| entries.iter().position(|entry| entry.covers(site));
    let unknown: Vec<_> = sites
        .iter()
        .filter(|site| covering(site).is_none())
        .map(described)
        .collect();
    println!("{} panic sites:", sites.len());
    for (index, entry) in entries.iter().enumerate() {
        let count = sites.iter().filter(|site| covering(site) == Some(index)).count();
        println!("{count:5}  {} | {}: {}", entry.what, entry.place, entry.reason);
    }
    assert!(
        unknown.is_empty(),
        "not in tests/release_elf/panic_sites.txt:\n{}",
        unknown.join("\n")
    );
    let idle: Vec<_> = entries
        .iter()
        .filter(|entry| !sites.iter().any(|site| entry.covers(site)))
        .map(|entry| format!("{} | {}", entry.what, entry.place))
        .collect();
    assert!(
        idle.is_empty(),
        "in the list, and in the firmware no longer:\n{}",
        idle.join("\n")
    );
}
