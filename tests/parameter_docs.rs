//! What is generated from the table of parameters is up to date, and the ready parameter files fit it.

use std::fs;
use std::path::{Path, PathBuf};

use rover_battmon::parameter::{ParameterId, Parameters, documentation};

fn docs() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("docs")
}

fn assert_fresh(file: &str, expected: &str) {
    let written = fs::read_to_string(docs().join(file)).unwrap_or_default();
    assert!(
        written == expected,
        "docs/{file} is stale: run `cargo run --example parameter_docs`"
    );
}

#[test]
fn the_docs_page_is_fresh() {
    assert_fresh("parameters.md", &documentation::markdown());
}

#[test]
fn the_metadata_file_is_fresh() {
    assert_fresh("apm.pdef.xml", &documentation::apm_pdef_xml());
}

#[test]
fn every_ready_parameter_file_sets_existing_parameters_to_allowed_values() {
    for file in ["2s-18650.param", "3s-lipo.param"] {
        let content = fs::read_to_string(docs().join("params").join(file)).expect("the file exists");
        let mut parameters = Parameters::defaults();
        let settings: Vec<_> = content
            .lines()
            .filter(|line| !line.starts_with('#') && !line.trim().is_empty())
            .collect();
        assert!(!settings.is_empty());
        for line in settings {
            let (name, value) = line.split_once(',').expect("NAME,VALUE");
            let id = ParameterId::from_name(name.as_bytes()).unwrap_or_else(|| panic!("{file}: no {name}"));
            let value = value.parse().expect("a number");
            assert_eq!(parameters.set(id, value), Ok(()), "{file}: {line}");
        }
    }
}
