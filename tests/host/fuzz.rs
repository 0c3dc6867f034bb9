//! A bounded run of what is fuzzed: the corpus, changes to it, and any bytes.
//!
//! `libfuzzer/` runs the same functions without a time limit, as its README describes.

use std::fs;

use proptest::prelude::*;
use proptest::sample::Index;
use support::{fuzz, repository};

fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder = repository().join("tests/fuzz/corpus").join(target);
    let entries = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{}: {error}", folder.display()));
    let mut paths: Vec<_> = entries
        .map(|entry| entry.expect("it can be listed").path())
        .collect();
    paths.sort();
    assert!(!paths.is_empty(), "no corpus in {}", folder.display());
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

/// Runs `target` on its corpus, on changes to it and on any bytes.
fn run(name: &str, target: fn(&[u8])) {
    let corpus = corpus(name);
    corpus.iter().for_each(|bytes| target(bytes));
    let inputs = prop_oneof![changed(corpus), prop::collection::vec(any::<u8>(), 0..600)];
    proptest!(ProptestConfig::with_cases(2000), |(bytes in inputs)| target(&bytes));
}

#[test]
// Requirement: OWN-5
fn parser() {
    run("parser", fuzz::parser::run);
}

#[test]
// Requirement: OWN-5
fn dispatcher() {
    run("dispatcher", fuzz::dispatcher::run);
}

#[test]
// Requirement: OWN-5
fn storage() {
    run("storage", fuzz::storage::run);
}

#[test]
// Requirement: OWN-5
fn signing() {
    run("signing", fuzz::signing::run);
}
