//! Writes what the page in the browser knows of MAVLink's messages: `web/messages.js`.

use std::fs;
use std::path::Path;

use rover_battmon_tools::page_messages::messages_js;

fn main() -> std::io::Result<()> {
    let page = Path::new(env!("CARGO_MANIFEST_DIR")).join("../web");
    fs::write(page.join("messages.js"), messages_js())
}
