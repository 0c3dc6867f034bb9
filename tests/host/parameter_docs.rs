//! What is generated from the table of parameters is up to date, and the ready parameter files fit it.

use std::fs;
use std::io;
use std::path::PathBuf;

use flate2::read::GzDecoder;
use lzma_rust2::XzReader;
use rover_battmon::battery::{Amount, BatteryState, PackStatus, Thresholds, arming_failures};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{ParameterId, Parameters, documentation};
use support::repository;

fn docs() -> PathBuf {
    repository().join("docs")
}

fn assert_fresh(file: &str, expected: &str) {
    let written = fs::read_to_string(docs().join(file)).unwrap_or_default();
    assert!(
        written == expected,
        "docs/{file} is stale: run `cargo run --example parameter_docs`"
    );
}

#[test]
fn the_page_and_the_descriptions_that_are_served_are_fresh() {
    assert_fresh("parameters.md", &documentation::markdown());
    let expected = documentation::parameters_json();
    let read = |file: &str| fs::read(docs().join(file)).expect("it can be read");
    let (xz, gz) = (read("parameters.json.xz"), read("parameters.json.gz"));
    assert_fresh("general.json", &documentation::general_json(&xz));
    let unpacked = [
        io::read_to_string(XzReader::new(&xz[..], false)),
        io::read_to_string(GzDecoder::new(&gz[..])),
    ];
    for (json, ending) in unpacked.into_iter().zip(["xz", "gz"]) {
        assert!(
            json.is_ok_and(|json| json == expected),
            "docs/parameters.json.{ending} is stale: run `cargo run --example parameter_docs`"
        );
    }
}

/// The ready files, by name.
fn ready_files() -> Vec<(String, String)> {
    let folder = fs::read_dir(docs().join("params")).expect("the folder exists");
    let files = folder.map(|entry| {
        let path = entry.expect("it can be listed").path();
        let name = path.file_name().expect("a name").to_string_lossy().into_owned();
        (name, fs::read_to_string(path).expect("it can be read"))
    });
    files.collect()
}

/// What a rover has that started with the defaults and was given this file.
fn after(file: &str, content: &str) -> Parameters {
    let mut parameters = Parameters::defaults();
    let settings = content
        .lines()
        .filter(|line| !line.starts_with('#') && !line.trim().is_empty());
    for line in settings {
        let (name, value) = line.split_once(',').expect("NAME,VALUE");
        let id = ParameterId::from_name(name.as_bytes()).unwrap_or_else(|| panic!("{file}: no {name}"));
        let value = value.parse().expect("a number");
        assert_eq!(parameters.set(id, value), Ok(()), "{file}: {line}");
    }
    parameters
}

#[test]
fn every_ready_parameter_file_sets_existing_parameters_to_allowed_values() {
    let files = ready_files();
    assert!(files.len() >= 2);
    for (file, content) in files {
        let parameters = after(&file, &content);
        assert!(parameters.next_unsaved().is_some(), "{file} changes nothing");
    }
}

#[test]
fn every_ready_parameter_file_has_a_failsafe_that_can_trip() {
    // An addition to the file of a pack leaves its thresholds.
    let of_packs = ready_files()
        .into_iter()
        .filter(|(_, content)| content.contains("_MONITOR,"));
    for (file, content) in of_packs {
        let parameters = after(&file, &content);
        let settings = Pack::ALL
            .into_iter()
            .filter(|pack| parameters.is_monitored(*pack))
            .map(|pack| parameters.pack(pack).settings());
        let armed: Vec<_> = settings
            .filter(|settings| !settings.failsafe.is_disabled(&BatteryState::UNKNOWN))
            .collect();
        assert!(!armed.is_empty(), "{file}: nothing ever counts as low");
        // What fails of a pack of which nothing is known but that it is well are thresholds in the wrong order.
        for settings in armed {
            let well = BatteryState {
                status: PackStatus::Healthy,
                capacity: settings.capacity_mah.map(Amount::Mah),
                ..BatteryState::default()
            };
            let failures: Vec<_> = arming_failures(&well, &settings, &Thresholds::default(), None).collect();
            assert!(failures.is_empty(), "{file}: {failures:?}");
        }
    }
}

#[test]
fn every_ready_parameter_file_is_in_the_guide() {
    let guide = fs::read_to_string(docs().join("packs.md")).expect("the guide exists");
    for (file, _) in ready_files() {
        assert!(guide.contains(&format!("](params/{file})")), "{file}");
    }
}
