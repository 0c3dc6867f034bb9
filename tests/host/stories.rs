//! Stories in stepped time.

use support::scenarios;
use support::story::{Story, play};
use support::vehicle::OnHost;

#[test]
// Requirement: AP-18
fn every_story_has_its_expected_outcomes() {
    for story in Story::all() {
        play::<OnHost>(&story);
    }
}

#[test]
fn parameters_are_kept() {
    scenarios::parameters_are_kept::<OnHost>();
}
