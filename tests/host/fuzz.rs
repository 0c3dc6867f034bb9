//! A bounded run of what is fuzzed: the corpus, changes to it, and any bytes.
//!
//! `libfuzzer/` runs the same functions without a time limit, as its README describes.

use std::fs;
use std::path::{Path, PathBuf};

use proptest::prelude::*;
use proptest::sample::Index;
use support::{fuzz, repository};

/// Longer logs are left out, as most of the time would be theirs.
const MOST_LOG_BYTES: usize = 20_000;

/// As Mission Planner writes it.
const TEXT_LOG: &str = "FMT, 128, 89, FMT, BBnNZ, Type,Length,Name,Format,Columns\n\
                        FMT, 2, 31, BAT, Qfh, TimeUS,Volt,Curr\n\
                        FMT, 3, 75, MSG, QZ, TimeUS,Message\n\
                        BAT, 1000000, 11.5, -3\n\
                        MSG, 1300000, low, and critical\n\
                        BAT, 2000000, 11.4, 250\n";

fn files(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<_> = entries
        .map(|entry| entry.expect("it can be listed").path())
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "nothing in {}", folder.display());
    paths
}

fn corpus(target: &str) -> Vec<Vec<u8>> {
    let paths = files(&repository().join("tests/fuzz/corpus").join(target));
    paths
        .into_iter()
        .map(|path| fs::read(path).expect("it can be read"))
        .collect()
}

/// A part of the corpus with a few bytes changed, and another part behind it.
fn changed(corpus: Vec<Vec<u8>>) -> impl Strategy<Value = Vec<u8>> {
    let part = prop::sample::select(corpus);
    let changes = prop::collection::vec((any::<Index>(), any::<u8>()), 0..8);
    (part.clone(), part, any::<Index>(), changes).prop_map(|(first, second, cut, changes)| {
        let mut bytes = first[..cut.index(first.len() + 1)].to_vec();
        bytes.extend(second);
        for (at, byte) in changes {
            if !bytes.is_empty() {
                let at = at.index(bytes.len());
                bytes[at] = byte;
            }
        }
        bytes
    })
}

/// The small logs, each behind the byte that chooses its reader, and one as text.
fn logs() -> Vec<Vec<u8>> {
    let reader = |ending: &str| fuzz::logs::READERS.iter().position(|reader| *reader == ending);
    let files = files(&repository().join("tests/data/logs"))
        .into_iter()
        .filter_map(|path| {
            let reader = reader(path.extension()?.to_str()?)?;
            let log = fs::read(&path).expect("it can be read");
            (log.len() < MOST_LOG_BYTES).then(|| [&[reader as u8], log.as_slice()].concat())
        });
    let mut logs: Vec<Vec<u8>> = files.collect();
    let text = reader("log").expect("there is one") as u8;
    logs.push([&[text], TEXT_LOG.as_bytes()].concat());
    logs
}

/// Runs `target` on its corpus, on changes to it and on any bytes.
fn run(corpus: Vec<Vec<u8>>, target: fn(&[u8])) {
    corpus.iter().for_each(|bytes| target(bytes));
    let inputs = prop_oneof![changed(corpus), prop::collection::vec(any::<u8>(), 0..600)];
    proptest!(ProptestConfig::with_cases(2000), |(bytes in inputs)| target(&bytes));
}

#[test]
// Requirement: OWN-5
fn parser() {
    run(corpus("parser"), fuzz::parser::run);
}

#[test]
// Requirement: OWN-5
fn dispatcher() {
    run(corpus("dispatcher"), fuzz::dispatcher::run);
}

#[test]
// Requirement: OWN-5
fn storage() {
    run(corpus("storage"), fuzz::storage::run);
}

#[test]
// Requirement: OWN-5
fn signing() {
    run(corpus("signing"), fuzz::signing::run);
}

#[test]
fn readers_of_logs() {
    run(logs(), fuzz::logs::run);
}
