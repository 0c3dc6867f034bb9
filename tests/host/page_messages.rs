//! What the page in the browser knows of messages is up to date.

use std::fs;

use rover_battmon_tools::page_messages::messages_js;
use support::repository;

#[test]
fn the_table_of_messages_is_fresh() {
    let written = fs::read_to_string(repository().join("web/messages.js")).expect("it can be read");
    assert!(
        written == messages_js(),
        "web/messages.js is stale: run `cargo run --example page_messages`, then web/build.py"
    );
}
