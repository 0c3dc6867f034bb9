//! Writes what is generated from the table of parameters: the docs page and the descriptions for ground stations.

use std::fs;
use std::io::Write;
use std::path::Path;

use lzma_rust2::{CheckType, XzOptions, XzWriter};
use rover_battmon::parameter::documentation;
use zopfli::{Format, Options};

/// How well it is compressed, from 0 to 9.
const PRESET: u32 = 9;

/// More than the file has, which is all that who decompresses it needs to remember.
const DICTIONARY_BYTES: u32 = 1 << 18;

fn main() -> std::io::Result<()> {
    let docs = Path::new(env!("CARGO_MANIFEST_DIR")).join("docs");
    fs::write(docs.join("parameters.md"), documentation::markdown())?;
    fs::write(docs.join("apm.pdef.xml"), documentation::apm_pdef_xml())?;
    let descriptions = documentation::parameters_json();
    let compressed = compressed(descriptions.as_bytes())?;
    fs::write(
        docs.join("parameters.json.gz"),
        compressed_for_browsers(descriptions.as_bytes())?,
    )?;
    fs::write(docs.join("parameters.json"), descriptions)?;
    fs::write(
        docs.join("general.json"),
        documentation::general_json(&compressed),
    )?;
    fs::write(docs.join("parameters.json.xz"), compressed)
}

/// By the one method that all browsers decompress.
fn compressed_for_browsers(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut compressed = Vec::new();
    zopfli::compress(Options::default(), Format::Gzip, bytes, &mut compressed)?;
    Ok(compressed)
}

/// With the check that every decompressor knows.
fn compressed(bytes: &[u8]) -> std::io::Result<Vec<u8>> {
    let mut options = XzOptions::with_preset(PRESET);
    options.lzma_options.dict_size = DICTIONARY_BYTES;
    // Characters of a text have no place within a word.
    options.lzma_options.pb = 0;
    options.set_check_sum_type(CheckType::Crc32);
    let mut writer = XzWriter::new(Vec::new(), options)?;
    writer.write_all(bytes)?;
    writer.finish()
}
