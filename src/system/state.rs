//! Everything telemetry reports, at one moment.

use crate::battery::{BatteryState, ChargeSource, PackStatus, Visibility};
use crate::memory::identity::Identity;
use crate::pack::{Pack, PackSet};
use crate::parameter::MonitorKind;
use crate::recorder::LogFile;
use crate::time::Instant;
use crate::vehicle::ArmState;
use crate::vehicle::VehicleStatus;

/// Everything the telemetry of one link reports.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SystemState<'a> {
    /// The packs by their instance; the first one is the primary pack.
    pub batteries: &'a [BatteryState],
    /// The packs that are monitored, and their kinds, since boot.
    pub kinds: &'a [(Pack, MonitorKind)],
    /// Addresses of the packs' parts on the I2C bus, by their instance, where they are known.
    pub part_addresses: &'a [Option<u8>],
    /// The rover's mode, and whether it is armed.
    pub vehicle: VehicleStatus,
    /// Whether the vehicle would be armed on request.
    pub readiness: ArmingReadiness,
    /// Busy share of the processor over the last second, in tenths of a percent (0 to 1000).
    pub load_permille: u16,
    /// Counters of the link this state is sent over.
    pub link: LinkStatistics,
    /// The present moment; its epoch is the start.
    pub now: Instant,
    /// Which board and program it is.
    pub identity: Identity,
    /// The log files, oldest first.
    pub logs: &'a [LogFile],
    /// Whether the log can be written.
    pub log: LogHealth,
    /// Readers of log files.
    pub log_readers: &'a LogReaders,
    /// Number of armings. It wraps.
    pub armings: u8,
}

impl SystemState<'_> {
    /// The kind of a pack's monitor since boot; `None` if it is not monitored.
    pub fn kind(&self, pack: Pack) -> Option<MonitorKind> {
        let own = self.kinds.iter().find(|(monitored, _)| *monitored == pack);
        own.map(|(_, kind)| *kind)
    }

    /// The state of `pack`; of one that does not exist nothing is known.
    pub fn battery(&self, pack: Pack) -> &BatteryState {
        self.batteries
            .get(pack as usize)
            .unwrap_or(&BatteryState::UNKNOWN)
    }

    /// Whether the rover is armed.
    pub fn is_armed(&self) -> bool {
        self.vehicle.arm_state == ArmState::Armed
    }

    /// The packs that are monitored.
    pub fn monitored(&self) -> impl Iterator<Item = &BatteryState> {
        self.batteries
            .iter()
            .filter(|battery| battery.status != PackStatus::Disabled)
    }

    /// The packs that are monitored.
    pub fn monitored_packs(&self) -> PackSet {
        self.packs_that(|battery| battery.status != PackStatus::Disabled)
    }

    /// The packs whose charge can't be set: it is known from a gauge of their own or reported by another component, or their
    /// cells are unclear.
    pub fn gauged_packs(&self) -> PackSet {
        self.packs_that(|battery| {
            battery.charge_source != ChargeSource::Estimated || battery.has_unclear_cells()
        })
    }

    /// These packs and the monitored ones that they are the sum of.
    pub fn with_members(&self, mut packs: PackSet) -> PackSet {
        let monitored = self.monitored_packs();
        // A sum may be of sums, each of which adds a pack at least.
        for _ in self.batteries {
            for pack in packs.iter() {
                let members = PackSet::from_bits(self.battery(pack).members);
                packs = packs | members & monitored;
            }
        }
        packs
    }

    /// Whether `pack` is a tank whose capacity is known.
    pub fn is_tank(&self, pack: Pack) -> bool {
        self.battery(pack).capacity_ml().is_some()
    }

    fn packs_that(&self, is_meant: impl Fn(&BatteryState) -> bool) -> PackSet {
        let packs = Pack::ALL.into_iter().zip(self.batteries);
        let meant = packs.filter(|(_, battery)| is_meant(battery));
        meant.map(|(pack, _)| pack).collect()
    }

    /// The packs that have a BATTERY_STATUS of their own: those monitored and not kept on board.
    pub fn reported(&self) -> impl Iterator<Item = Pack> {
        Pack::ALL.into_iter().filter(|pack| self.is_reported(*pack))
    }

    /// Packs that report what they are: smart batteries.
    pub fn described(&self) -> impl Iterator<Item = Pack> {
        self.reported()
            .filter(|pack| !self.battery(*pack).details.is_empty())
    }

    /// Whether `pack` is one of those that are reported.
    pub fn is_reported(&self, pack: Pack) -> bool {
        let battery = self.batteries.get(pack as usize);
        battery.is_some_and(|battery| {
            battery.status != PackStatus::Disabled && battery.visibility == Visibility::Reported
        })
    }
}

/// Whether the log can be written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum LogHealth {
    /// As far as is known.
    #[default]
    Works,
    /// The flash can't be written or erased.
    Failed,
    /// None is wanted (`LOG_BITMASK` 0).
    Off,
}

/// The protocol by which a link reads log files.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum LogProtocol {
    /// LOG_REQUEST_DATA.
    LogData,
    /// MAVLink FTP.
    FileTransfer,
}

/// A reader of log files: of one at a time.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LogReader {
    /// The link of this number.
    Link(u16, LogProtocol),
    /// The browser whose transfer has this slot.
    Browser(u8),
}

/// The latest read of a reader: of the file with this number, at this moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct LatestRead {
    reader: LogReader,
    file: u16,
    at: Instant,
}

impl LatestRead {
    fn is_active(&self, now: Instant) -> bool {
        now.us_since(self.at) < LOG_READER_SILENCE_US
    }
}

/// A reader that has taken nothing for this long does not keep its file from being erased, in µs.
pub const LOG_READER_SILENCE_US: u64 = 10_000_000;

/// Readers at a time.
const LOG_READERS: usize = 8;

/// The latest readers of log files, which keep theirs from being erased.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogReaders([Option<LatestRead>; LOG_READERS]);

impl LogReaders {
    /// Nothing is being read.
    pub const NONE: Self = Self([None; LOG_READERS]);

    /// A piece of a file is read at `now`. Returns whether there is room for its reader: without it the file would not be kept.
    pub fn note(&mut self, reader: LogReader, file: u16, now: Instant) -> bool {
        let rank = |latest: &Option<LatestRead>| match latest {
            Some(read) if read.reader == reader => 0,
            Some(read) if read.is_active(now) => 2,
            Some(_) | None => 1,
        };
        let place = self.0.iter_mut().min_by_key(|latest| rank(latest));
        let Some(place) = place.filter(|latest| rank(latest) < 2) else {
            return false;
        };
        *place = Some(LatestRead {
            reader,
            file,
            at: now,
        });
        true
    }

    /// A reader has its file.
    pub fn end(&mut self, reader: LogReader) {
        for latest in &mut self.0 {
            latest.take_if(|read| read.reader == reader);
        }
    }

    /// Whether the file of this number is being read.
    pub fn is_read(&self, file: u16, now: Instant) -> bool {
        self.active(now).any(|read| read.file == file)
    }

    /// Whether anything is being read, but on this link.
    pub fn is_read_for_another(&self, link: u16, now: Instant) -> bool {
        let is_of_link = |reader| matches!(reader, LogReader::Link(number, _) if number == link);
        self.active(now).any(|read| !is_of_link(read.reader))
    }

    fn active(&self, now: Instant) -> impl Iterator<Item = &LatestRead> {
        let latest = self.0.iter().flatten();
        latest.filter(move |read| read.is_active(now))
    }
}

impl Default for &LogReaders {
    fn default() -> Self {
        &LogReaders::NONE
    }
}

/// Whether the vehicle would be armed on request (SYS_STATUS, PREARM_CHECK).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ArmingReadiness {
    /// A check fails, or the checks have not run yet.
    #[default]
    NotReady,
    /// All checks pass, or it is armed.
    Ready,
}

/// Counters of one link since boot. They wrap at 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LinkStatistics {
    /// Messages handed to the wire.
    pub sent: u32,
    /// Their bytes.
    pub sent_bytes: u32,
    /// Messages dropped because the link had no room for them.
    pub dropped: u32,
    /// Received messages that were ignored because they were not signed as they would have to be.
    pub unauthorized: u32,
    /// Received frames and bytes.
    pub received: ReceiveStatistics,
}

/// Counters of reception on a link since boot. They wrap at 2^32.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReceiveStatistics {
    /// Frames with a right checksum.
    pub frames: u32,
    /// Frames, or what looked like the start of one, whose checksum was wrong.
    pub bad_checksums: u32,
    /// Frames of a message this dialect does not know; their checksum can't be judged.
    pub unknown_messages: u32,
    /// Times bytes were lost before they could be read.
    pub overruns: u32,
}

impl ReceiveStatistics {
    /// Everything that was lost.
    pub fn errors(&self) -> u32 {
        self.bad_checksums
            .wrapping_add(self.unknown_messages)
            .wrapping_add(self.overruns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::time::at_us;

    const BROWSER: LogReader = LogReader::Browser(0);

    fn by_ftp(link: u16) -> LogReader {
        LogReader::Link(link, LogProtocol::FileTransfer)
    }

    #[test]
    fn each_reader_keeps_its_file_for_ten_seconds() {
        let mut readers = LogReaders::NONE;
        let by_log_data = LogReader::Link(1, LogProtocol::LogData);
        for (number, reader) in (1..).zip([by_log_data, by_ftp(1), by_ftp(2), BROWSER]) {
            assert!(readers.note(reader, number, at_us(u64::from(number))));
        }
        for number in 1..5 {
            let last_us = LOG_READER_SILENCE_US + u64::from(number);
            assert!(readers.is_read(number, at_us(last_us - 1)));
            assert!(!readers.is_read(number, at_us(last_us)), "{number}");
        }
        assert!(!readers.is_read(5, at_us(4)));
        readers.end(BROWSER);
        assert!(!readers.is_read(4, at_us(4)));
    }

    #[test]
    fn the_readers_of_a_link_are_no_others_for_it() {
        let mut readers = LogReaders::NONE;
        readers.note(by_ftp(1), 1, at_us(0));
        assert_eq!(
            [1, 2].map(|link| readers.is_read_for_another(link, at_us(1))),
            [false, true]
        );
        readers.note(BROWSER, 1, at_us(0));
        assert!(readers.is_read_for_another(1, at_us(1)));
        assert!(!readers.is_read_for_another(1, at_us(LOG_READER_SILENCE_US)));
    }

    #[test]
    fn one_reader_too_many_waits_for_the_place_of_a_silent_one() {
        let mut readers = LogReaders::NONE;
        for link in 0..LOG_READERS as u16 {
            assert!(readers.note(by_ftp(link), 1, at_us(u64::from(link))));
        }
        assert!(!readers.note(BROWSER, 1, at_us(LOG_READER_SILENCE_US - 1)));
        assert!(readers.note(by_ftp(3), 2, at_us(LOG_READER_SILENCE_US - 1)));
        assert!(readers.note(BROWSER, 1, at_us(LOG_READER_SILENCE_US)));
    }
}
