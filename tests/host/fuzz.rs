//! A bounded run of what is fuzzed: the corpus, changes to it, and any bytes.
//!
//! `libfuzzer/` runs the same functions without a time limit, as its README describes.

#[path = "../fuzz/targets/mod.rs"]
mod targets;

use std::fs;
use std::path::PathBuf;

use proptest::prelude::*;
use proptest::sample::Index;

fn corpus(target: &str) -> Vec<Vec<u8>> {
    let folder: PathBuf = [env!("CARGO_MANIFEST_DIR"), "tests/fuzz/corpus", target]
        .iter()
        .collect();
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
fn fuzz(name: &str, target: fn(&[u8])) {
    let corpus = corpus(name);
    corpus.iter().for_each(|bytes| target(bytes));
    let inputs = prop_oneof![changed(corpus), prop::collection::vec(any::<u8>(), 0..600)];
    proptest!(ProptestConfig::with_cases(2000), |(bytes in inputs)| target(&bytes));
}

#[test]
fn parser() {
    fuzz("parser", targets::parser::run);
}

#[test]
fn dispatcher() {
    fuzz("dispatcher", targets::dispatcher::run);
}

#[test]
fn storage() {
    fuzz("storage", targets::storage::run);
}

#[test]
fn signing() {
    fuzz("signing", targets::signing::run);
}
