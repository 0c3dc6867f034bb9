//! Which vehicle and which firmware recorded a log.

use std::fmt;

use rover_battmon_tools::recordings::entry::Content;
use rover_battmon_tools::recordings::px4;

/// The beginning of the text by which this board names itself.
const BOARD: &str = "rover-battmon ";
const THIS_FIRMWARE: &str = "rover-battmon";

/// Beginnings of the text by which ArduPilot names its vehicle, in the order of versions.
const ARDUPILOT: [&str; 2] = ["Ardu", "APM:"];

/// Beginnings of versions of ArduPilot whose failsafes have other texts.
const OLDER: [char; 4] = ['0', '1', '2', '3'];

/// A vehicle and its firmware. `None` is unknown.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Vehicle {
    /// Its kind: rover, copter, plane and so on.
    pub kind: Option<String>,
    /// The name of its firmware.
    pub firmware: Option<String>,
    /// Its version, as the firmware has it.
    pub version: Option<String>,
}

impl Vehicle {
    /// Takes what an entry says of it.
    pub fn take(&mut self, content: &Content) {
        match content {
            Content::Text(text) => self.text(text),
            Content::Vehicle(kind) => {
                self.kind.get_or_insert_with(|| kind_name(*kind));
            }
            Content::Autopilot(autopilot) => {
                self.firmware = self.firmware.take().or(firmware_name(*autopilot).map(Into::into));
            }
            Content::Version(version) => {
                self.version.get_or_insert(version.clone());
            }
            _ => {}
        }
    }

    /// Whether it ran this firmware.
    pub fn is_of_this_firmware(&self) -> bool {
        self.firmware.as_deref() == Some(THIS_FIRMWARE)
    }

    /// Whether its texts name the pack and the level of a failsafe: PX4 and ArduPilot before 4.0 have others.
    pub fn announces_failsafes(&self) -> bool {
        let version = self.version.as_deref().unwrap_or_default();
        match self.firmware.as_deref() {
            Some("PX4") => false,
            Some("ArduPilot") => !version.starts_with(OLDER),
            _ => true,
        }
    }

    /// As in `ArduRover V4.2.3 (abcdef12)` and `APM:Copter V3.5.5`.
    fn text(&mut self, text: &str) {
        if let Some(version) = text.strip_prefix(BOARD) {
            return self.name(THIS_FIRMWARE, "rover", version);
        }
        let rest = ARDUPILOT
            .iter()
            .find_map(|beginning| text.strip_prefix(beginning));
        let Some((kind, version)) = rest.and_then(|rest| rest.split_once([' '])) else {
            return;
        };
        if let Some(version) = version.strip_prefix(['V', 'v']) {
            self.name("ArduPilot", &kind.to_lowercase(), version);
        }
    }

    /// The text is more exact than numbers; the first one counts.
    fn name(&mut self, firmware: &str, kind: &str, version: &str) {
        let version = version.split_whitespace().next().unwrap_or_default();
        if !version.starts_with(|character: char| character.is_ascii_digit()) {
            return;
        }
        self.firmware = Some(firmware.into());
        self.kind.get_or_insert(kind.into());
        self.version = Some(version.into());
    }
}

impl fmt::Display for Vehicle {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let firmware = self.firmware.as_deref().unwrap_or("an unknown firmware");
        write!(f, "{firmware}")?;
        if let Some(version) = &self.version {
            write!(f, " {version}")?;
        }
        match &self.kind {
            Some(kind) => write!(f, ", {kind}"),
            None => Ok(()),
        }
    }
}

/// By `MAV_AUTOPILOT`.
fn firmware_name(autopilot: u8) -> Option<&'static str> {
    match autopilot {
        3 => Some("ArduPilot"),
        px4::AUTOPILOT => Some("PX4"),
        _ => None,
    }
}

/// By `MAV_TYPE`.
fn kind_name(kind: u8) -> String {
    let name = match kind {
        1 => "plane",
        2 | 3 | 13 | 14 | 15 | 29 | 35 => "copter",
        4 => "helicopter",
        5 => "antenna tracker",
        7 => "airship",
        10 => "rover",
        11 => "boat",
        12 => "submarine",
        19..=25 => "VTOL",
        other => return format!("MAV_TYPE {other}"),
    };
    name.into()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn firmware_is_known_by_its_text_or_its_numbers() {
        let named = |contents: &[Content]| {
            let mut vehicle = Vehicle::default();
            contents.iter().for_each(|content| vehicle.take(content));
            vehicle.to_string()
        };
        let text = |text: &str| Content::Text(text.into());
        for (contents, expected) in [
            (
                vec![text("ArduRover V4.2.3 (3ab0b4b1)")],
                "ArduPilot 4.2.3, rover",
            ),
            (
                vec![text("APM:Copter V3.5.5 (27229c83)")],
                "ArduPilot 3.5.5, copter",
            ),
            (
                vec![text("APM:Rover v2.50"), text("ArduCopter V9")],
                "ArduPilot 9, rover",
            ),
            (
                vec![text("rover-battmon 0.1.0 (modes of ArduPilot Rover)")],
                "rover-battmon 0.1.0, rover",
            ),
            (
                vec![Content::Vehicle(11), text("ArduRover V4.5.7")],
                "ArduPilot 4.5.7, boat",
            ),
            (
                vec![
                    Content::Autopilot(12),
                    Content::Vehicle(2),
                    Content::Version("1.14.0".into()),
                ],
                "PX4 1.14.0, copter",
            ),
            (
                vec![text("Ardu"), text("Arduous Work"), text("EKF3 active")],
                "an unknown firmware",
            ),
        ] {
            assert_eq!(named(&contents), expected);
        }
    }

    #[test]
    fn older_firmware_announces_failsafes_by_other_texts() {
        for (text, expected) in [
            ("ArduRover V4.2.3", true),
            ("rover-battmon 0.1.0", true),
            ("EKF3 active", true),
            ("APM:Copter V3.5.5", false),
        ] {
            let mut vehicle = Vehicle::default();
            vehicle.take(&Content::Text(text.into()));
            assert_eq!(vehicle.announces_failsafes(), expected, "{text}");
        }
        let mut vehicle = Vehicle::default();
        vehicle.take(&Content::Autopilot(12));
        assert!(!vehicle.announces_failsafes());
    }
}
