//! The files that are part of the program.

use core::fmt;

use crate::memory::flash_map::constant_file;

/// A file that is part of the program, compressed.
#[derive(Clone, Copy, Debug)]
pub struct File {
    pub content: &'static [u8],
    pub kind: &'static str,
    pub tag: FileTag,
}

/// Version of a file: the CRC-32 of its content.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileTag(u32);

impl fmt::Display for FileTag {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "\"{:08x}\"", self.0)
    }
}

const fn file(content: &'static [u8], kind: &'static str) -> File {
    File {
        content,
        kind,
        tag: FileTag(gzip_checksum(content)),
    }
}

/// The checksum that a gzip file ends with, of what is compressed, and before it the length.
const fn gzip_checksum(content: &[u8]) -> u32 {
    match content.last_chunk::<8>() {
        Some([a, b, c, d, ..]) => u32::from_le_bytes([*a, *b, *c, *d]),
        None => 0,
    }
}

/// The page.
pub const PAGE: File = file(&PAGE_CONTENT, "text/html; charset=utf-8");

/// The descriptions of the parameters.
pub const PARAMETERS: File = file(&PARAMETERS_CONTENT, "application/json");

constant_file!(PAGE_CONTENT, "../../web/page.html.gz");
constant_file!(PARAMETERS_CONTENT, "../../docs/parameters.json.gz");
