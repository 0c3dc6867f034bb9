//! What a log says as a whole: parameters, which rover and which packs, and when.

use std::io::{self, Read};

use rover_battmon::battery::{LEARNT_WORDS, LearntPack};
use rover_battmon::pack::{MAX_PACKS, Pack};
use rover_battmon::parameter::{ParameterId, Parameters};

use crate::binlog::{Record, Records};
use crate::trace::Inputs;

/// Parameters with the system id: that of ArduPilot up to 4.6, and the later one.
const SYSTEM_ID: [&str; 2] = ["SYSID_THISMAV", "MAV_SYSID"];

/// GPS time began with 1980-01-06, in seconds since 1970; since 2017 it is 18 leap seconds ahead of UTC.
const GPS_EPOCH_S: f64 = 315_964_800.0 - 18.0;

const WEEK_S: f64 = 7.0 * 86_400.0;

/// Words of what was learnt that PCKO has; PACK has those before.
const OFFSET_WORDS: usize = 5;

/// What a log says as a whole. `None` is what it does not say.
#[derive(Debug, Default)]
pub struct Survey {
    /// The last value of each parameter, defaults beside.
    pub parameters: Option<Parameters>,
    /// MAVLink's id of the rover.
    pub system_id: Option<i32>,
    /// The board's serial number.
    pub board_id: Option<String>,
    /// When the recorder started, in seconds since 1970 (UTC).
    pub started_utc_s: Option<f64>,
    /// What is measured of each pack that has a reading.
    packs: [Option<Inputs>; MAX_PACKS],
    learnt: [Option<[u32; LEARNT_WORDS]>; MAX_PACKS],
    /// All bytes.
    pub read_bytes: u64,
    /// Those of them that belong to no record.
    pub skipped_bytes: u64,
    has_formats: bool,
}

impl Survey {
    /// Reads a log to its end.
    pub fn of(source: impl Read) -> io::Result<Self> {
        let mut survey = Self::default();
        let mut records = Records::of(source);
        for record in records.by_ref() {
            survey.take(&record?);
        }
        survey.read_bytes = records.read_bytes();
        survey.skipped_bytes = records.skipped_bytes();
        survey.has_formats = records.has_formats();
        Ok(survey)
    }

    /// Why there is nothing to replay; `None` if there is.
    pub fn obstacle(&self) -> Option<&'static str> {
        match self {
            Self { read_bytes: 0, .. } => Some("empty"),
            Self {
                has_formats: false, ..
            } => Some("no log in ArduPilot's format (.BIN)"),
            _ if self.packs.iter().all(Option::is_none) => Some("no reading of a pack (BAT)"),
            _ => None,
        }
    }

    /// What is measured of a pack; `None` without a reading.
    pub fn measured(&self, pack: Pack) -> Option<Inputs> {
        self.packs[usize::from(pack.instance())]
    }

    /// What was known of a pack at the beginning of the file.
    pub fn known(&self, pack: Pack) -> Option<LearntPack> {
        LearntPack::from_words(self.learnt[usize::from(pack.instance())].as_ref()?)
    }

    fn take(&mut self, record: &Record) {
        match record.name() {
            "PARM" => self.parameter(record),
            "BRD" => {
                self.board_id = record
                    .text("Id")
                    .filter(|id| !id.is_empty())
                    .or(self.board_id.take())
            }
            "BAT" => self.reading(record),
            "GPS" => self.started_utc_s = self.started_utc_s.or(started_utc_s(record)),
            "PACK" => self.learnt(record),
            "PCKO" => self.offsets(record),
            _ => {}
        }
    }

    /// What another version has set does not matter here: a parameter that is not known, or a value out of range.
    fn parameter(&mut self, record: &Record) {
        let Some((name, value)) = record.text("Name").zip(record.number("Value")) else {
            return;
        };
        if SYSTEM_ID.contains(&name.as_str()) {
            self.system_id = Some(value as i32);
        }
        if let Some(id) = ParameterId::from_name(name.as_bytes()) {
            let parameters = self.parameters.get_or_insert_with(Parameters::defaults);
            let _ = parameters.set(id, value as f32);
        }
    }

    fn reading(&mut self, record: &Record) {
        let Some(pack) = pack_of(record) else {
            return;
        };
        let has_current = record.number("Curr").is_some();
        let measured = &mut self.packs[usize::from(pack.instance())];
        let had_current = measured.is_some_and(|measured| measured.current);
        *measured = Some(Inputs {
            voltage: true,
            current: had_current || has_current,
        });
    }

    /// The first record of a pack is what was known at the beginning.
    fn learnt(&mut self, record: &Record) {
        let Some(pack) = pack_of(record) else {
            return;
        };
        self.learnt[usize::from(pack.instance())].get_or_insert_with(|| learnt_words(record));
    }

    fn offsets(&mut self, record: &Record) {
        let Some(learnt) =
            pack_of(record).and_then(|pack| self.learnt[usize::from(pack.instance())].as_mut())
        else {
            return;
        };
        for (word, place) in learnt[LEARNT_WORDS - OFFSET_WORDS..].iter_mut().zip(1..) {
            let half = |name: &str| {
                let number = record.number(&format!("{name}{place}")).unwrap_or(0.0);
                u32::from(number as i16 as u16)
            };
            *word = half("O") | half("D") << 16;
        }
    }
}

/// What a PACK record has of it, as flash holds it; NaN is what is not learnt.
fn learnt_words(record: &Record) -> [u32; LEARNT_WORDS] {
    let whole = |name| record.number(name).unwrap_or(0.0);
    let bits = |name| {
        record
            .number(name)
            .map_or(f32::NAN, |number| number as f32)
            .to_bits()
    };
    let [drives_low, drives_high] = (whole("Drv") as u16).to_le_bytes();
    let mut words = [0; LEARNT_WORDS];
    words[0] = u32::from_le_bytes([whole("Chem") as u8, whole("Cells") as u8, drives_low, drives_high]);
    words[1] = serial_number(record).unwrap_or(-1) as u32;
    let names = ["Cap", "CapD", "Res", "Res1", "SoC", "SoCD", "RstV"];
    for (word, name) in words[2..].iter_mut().zip(names) {
        *word = bits(name);
    }
    words
}

/// Of a PACK record; negative is unknown.
pub fn serial_number(record: &Record) -> Option<i32> {
    Some(record.number("SN")? as i32).filter(|number| *number >= 0)
}

/// The pack that a record is of.
pub fn pack_of(record: &Record) -> Option<Pack> {
    let instance = record.number("Inst").or(record.number("Instance"))?;
    Pack::ALL
        .into_iter()
        .find(|pack| f64::from(pack.instance()) == instance)
}

/// When the recorder started, by a GPS record. Week 0 is unknown.
fn started_utc_s(record: &Record) -> Option<f64> {
    let weeks = record.number("GWk").filter(|weeks| *weeks > 0.0)?;
    let of_week_s = record.number("GMS")? / 1e3;
    Some(GPS_EPOCH_S + weeks * WEEK_S + of_week_s - record.number("TimeUS")? / 1e6)
}
