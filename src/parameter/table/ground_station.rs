//! Parameters that ground stations ask for before they call a rover set up, but which set nothing here: each is a constant.

#[cfg(not(target_os = "none"))]
use super::Documentation;
use super::{Access, Kind, Meaning, Parameter, Range, means};

const HOLD: f32 = 4.0;

const MODE_SWITCH: Meaning =
    means("For ground stations: modes are set by commands only, never by a channel.");
const AUX_SWITCH: Meaning =
    means("For ground stations: channels besides those of the sticks have no function.");
const COMPASS: Meaning = means("For ground stations: there is no compass.");
const ACCELEROMETER: Meaning = means(
    "For ground stations: there is no accelerometer. One that is not 0 counts as calibrated in QGroundControl.",
);

/// The table.
static ROWS: [Parameter; 49] = [
    row(
        "FS_GCS_ENABLE",
        Kind::Int8,
        1.0,
        means("For ground stations: FS_GCS_TIMEOUT is always observed."),
    ),
    row(
        "FS_THR_ENABLE",
        Kind::Int8,
        1.0,
        means("For ground stations: FS_TIMEOUT is always observed."),
    ),
    row(
        "FS_ACTION",
        Kind::Int8,
        2.0,
        means("For ground stations: either time-out leads to Hold."),
    ),
    row(
        "FS_THR_VALUE",
        Kind::Int16,
        0.0,
        means("For ground stations: no length of a pulse counts as a lost driver."),
    ),
    row(
        "FS_CRASH_CHECK",
        Kind::Int8,
        0.0,
        means("For ground stations: a collision is not detected."),
    ),
    row("MODE_CH", Kind::Int8, 0.0, MODE_SWITCH),
    row("MODE1", Kind::Int8, HOLD, MODE_SWITCH),
    row("MODE2", Kind::Int8, HOLD, MODE_SWITCH),
    row("MODE3", Kind::Int8, HOLD, MODE_SWITCH),
    row("MODE4", Kind::Int8, HOLD, MODE_SWITCH),
    row("MODE5", Kind::Int8, HOLD, MODE_SWITCH),
    row("MODE6", Kind::Int8, HOLD, MODE_SWITCH),
    row("FLTMODE1", Kind::Int8, HOLD, MODE_SWITCH),
    row("FLTMODE2", Kind::Int8, HOLD, MODE_SWITCH),
    row("FLTMODE3", Kind::Int8, HOLD, MODE_SWITCH),
    row("FLTMODE4", Kind::Int8, HOLD, MODE_SWITCH),
    row("FLTMODE5", Kind::Int8, HOLD, MODE_SWITCH),
    row("FLTMODE6", Kind::Int8, HOLD, MODE_SWITCH),
    row("RC6_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("RC7_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("RC8_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("RC9_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("RC10_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("RC11_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("RC12_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("RC13_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("RC14_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("RC15_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("RC16_OPTION", Kind::Int16, 0.0, AUX_SWITCH),
    row("COMPASS_DEV_ID", Kind::Int32, 0.0, COMPASS),
    row("COMPASS_DEV_ID2", Kind::Int32, 0.0, COMPASS),
    row("COMPASS_DEV_ID3", Kind::Int32, 0.0, COMPASS),
    row("COMPASS_USE", Kind::Int8, 0.0, COMPASS),
    row("COMPASS_USE2", Kind::Int8, 0.0, COMPASS),
    row("COMPASS_USE3", Kind::Int8, 0.0, COMPASS),
    row("COMPASS_OFS_X", Kind::Real32, 0.0, COMPASS),
    row("COMPASS_OFS_Y", Kind::Real32, 0.0, COMPASS),
    row("COMPASS_OFS_Z", Kind::Real32, 0.0, COMPASS),
    row("COMPASS_OFS2_X", Kind::Real32, 0.0, COMPASS),
    row("COMPASS_OFS2_Y", Kind::Real32, 0.0, COMPASS),
    row("COMPASS_OFS2_Z", Kind::Real32, 0.0, COMPASS),
    row("COMPASS_OFS3_X", Kind::Real32, 0.0, COMPASS),
    row("COMPASS_OFS3_Y", Kind::Real32, 0.0, COMPASS),
    row("COMPASS_OFS3_Z", Kind::Real32, 0.0, COMPASS),
    row("COMPASS_DEC", Kind::Real32, 0.0, COMPASS),
    row("INS_ACCOFFS_X", Kind::Real32, 0.01, ACCELEROMETER),
    row("INS_ACCOFFS_Y", Kind::Real32, 0.01, ACCELEROMETER),
    row("INS_ACCOFFS_Z", Kind::Real32, 0.01, ACCELEROMETER),
    row(
        "AHRS_ORIENTATION",
        Kind::Int8,
        0.0,
        means("For ground stations: there is no inertial sensor to be turned."),
    ),
];

/// A constant for ground stations.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub struct GroundStationParameter(u8);

impl GroundStationParameter {
    /// Number of parameters in the table.
    pub const COUNT: usize = ROWS.len();

    /// The first parameter.
    pub const FIRST: Self = Self(0);

    /// The next parameter in the table.
    pub(in crate::parameter) fn next(self) -> Option<Self> {
        let next = Self(self.0 + 1);
        (next.number() < Self::COUNT).then_some(next)
    }

    /// Position in the table.
    pub(in crate::parameter) fn number(self) -> usize {
        self.0.into()
    }

    /// The parameter with this name, case-insensitive.
    pub(in crate::parameter) fn from_name(name: &[u8]) -> Option<Self> {
        let is_meant = |row: &Parameter| row.name.as_bytes().eq_ignore_ascii_case(name);
        ROWS.iter().position(is_meant).map(|number| Self(number as u8))
    }

    /// Row in the table.
    pub fn row(self) -> &'static Parameter {
        // In bounds for every parameter, but an index would leave a panicking path.
        ROWS.get(self.number()).unwrap_or(&ROWS[0])
    }
}

/// The row of a constant. It has no key in flash: it is never saved.
const fn row(
    name: &'static str,
    kind: Kind,
    value: f32,
    #[cfg_attr(target_os = "none", expect(unused))] about: Meaning,
) -> Parameter {
    Parameter {
        key: 0,
        name,
        kind,
        default: value,
        range: Range::Between(value, value),
        access: Access::Constant,
        #[cfg(not(target_os = "none"))]
        documentation: Documentation {
            label: "For ground stations",
            description: about.text(),
            ..Documentation::DEFAULT
        },
        ..Parameter::DEFAULT
    }
}
