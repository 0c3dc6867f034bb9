//! Writes what is generated from the table of parameters: the docs page and the metadata for ground stations.

use std::fs;
use std::path::Path;

use rover_battmon::parameter::documentation;

fn main() -> std::io::Result<()> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    fs::write(docs.join("parameters.md"), documentation::markdown())?;
    fs::write(docs.join("apm.pdef.xml"), documentation::apm_pdef_xml())
}
