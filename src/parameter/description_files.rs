//! Descriptions of the parameters for ground stations, by MAVLink's component metadata: files that are part of the firmware.
//! `parameters_json` of the documentation is what they are made of.

use crate::memory::flash_map::constant_file;

constant_file!(GENERAL, "../../docs/general.json");
constant_file!(PARAMETERS, "../../docs/parameters.json.xz");

/// A file that ground stations read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DescriptionFile {
    /// Which files there are, with their checksums: what a ground station reads first.
    General,
    /// The descriptions. Compressed by the one method that all versions of QGroundControl decompress.
    Parameters,
}

impl DescriptionFile {
    /// All of them.
    pub const ALL: [Self; 2] = [Self::General, Self::Parameters];

    /// Its name, in the root of MAVLink FTP.
    pub const fn name(self) -> &'static str {
        match self {
            Self::General => "general.json",
            Self::Parameters => "parameters.json.xz",
        }
    }

    /// Its bytes.
    pub const fn content(self) -> &'static [u8] {
        match self {
            Self::General => &GENERAL,
            Self::Parameters => &PARAMETERS,
        }
    }
}
