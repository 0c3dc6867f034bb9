//! Writes what is generated from the table of parameters: the docs page, and the descriptions that the rover serves.
//!
//! Given a folder, it writes `apm.pdef.xml` there instead: the metadata that a release has for ground stations.

use std::env;
use std::fs;
use std::io::{self, Write};
use std::path::Path;

use lzma_rust2::{CheckType, XzOptions, XzWriter};
use rover_battmon::parameter::documentation;
use zopfli::{Format, Options};

/// How well it is compressed, from 0 to 9.
const PRESET: u32 = 9;

/// More than the file has, which is all that who decompresses it needs to remember.
const DICTIONARY_BYTES: u32 = 1 << 18;

fn main() -> io::Result<()> {
    match env::args_os().nth(1) {
        Some(folder) => fs::write(
            Path::new(&folder).join("apm.pdef.xml"),
            documentation::apm_pdef_xml(),
        ),
        None => write_docs(&Path::new(env!("CARGO_MANIFEST_DIR")).join("docs")),
    }
}

fn write_docs(docs: &Path) -> io::Result<()> {
    fs::write(docs.join("parameters.md"), documentation::markdown())?;
    let descriptions = documentation::parameters_json();
    let compressed = compressed(descriptions.as_bytes())?;
    fs::write(
        docs.join("parameters.json.gz"),
        compressed_for_browsers(descriptions.as_bytes())?,
    )?;
    fs::write(
        docs.join("general.json"),
        documentation::general_json(&compressed),
    )?;
    fs::write(docs.join("parameters.json.xz"), compressed)
}

/// By the one method that all browsers decompress.
fn compressed_for_browsers(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut compressed = Vec::new();
    zopfli::compress(Options::default(), Format::Gzip, bytes, &mut compressed)?;
    Ok(compressed)
}

/// With the check that every decompressor knows.
fn compressed(bytes: &[u8]) -> io::Result<Vec<u8>> {
    let mut options = XzOptions::with_preset(PRESET);
    options.lzma_options.dict_size = DICTIONARY_BYTES;
    // Characters of a text have no place within a word.
    options.lzma_options.pb = 0;
    options.set_check_sum_type(CheckType::Crc32);
    let mut writer = XzWriter::new(Vec::new(), options)?;
    writer.write_all(bytes)?;
    writer.finish()
}
