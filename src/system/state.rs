//! Everything telemetry reports, at one moment.

use crate::battery::{BatteryState, ChargeSource, PackStatus, Visibility};
use crate::memory::identity::Identity;
use crate::pack::Pack;
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
    /// The packs that another component measures, a bit each, bit 0 for the first.
    pub external_packs: u16,
    /// The packs on the CAN bus, a bit each, bit 0 for the first.
    pub can_packs: u16,
    /// The packs whose voltage is read at an analog pin, a bit each, bit 0 for the first.
    pub pin_packs: u16,
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
    pub log_readers: LogReaders,
}

impl SystemState<'_> {
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

    /// The packs that are monitored, a bit each, bit 0 for the first.
    pub fn monitored_mask(&self) -> u16 {
        self.mask_of(|battery| battery.status != PackStatus::Disabled)
    }

    /// The packs whose charge can't be set, a bit each, bit 0 for the first: it is known from a gauge of their own or reported by
    /// another component, or their cells are unclear.
    pub fn gauged_mask(&self) -> u16 {
        self.mask_of(|battery| {
            battery.charge_source != ChargeSource::Estimated || battery.has_unclear_cells()
        })
    }

    /// The packs in `mask` and the monitored ones that they are the sum of, a bit each, bit 0 for the first.
    pub fn with_members(&self, mask: u16) -> u16 {
        let members = |mask: u16| {
            let packs = Pack::ALL.iter().zip(self.batteries);
            let named = packs.filter(move |(pack, _)| mask & pack.bit() != 0);
            named.fold(mask, |mask, (_, battery)| {
                mask | battery.members & self.monitored_mask()
            })
        };
        // A sum may be of sums, each of which adds a pack at least.
        self.batteries.iter().fold(mask, |mask, _| members(mask))
    }

    /// Whether `pack` is a tank whose capacity is known.
    pub fn is_tank(&self, pack: Pack) -> bool {
        self.battery(pack).capacity_ml().is_some()
    }

    fn mask_of(&self, is_meant: impl Fn(&BatteryState) -> bool) -> u16 {
        let packs = Pack::ALL.iter().zip(self.batteries);
        packs
            .filter(|(_, battery)| is_meant(battery))
            .fold(0, |mask, (pack, _)| mask | pack.bit())
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

/// The latest readers of log files: a download must not lose its file to another station's LOG_ERASE.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LogReaders {
    latest: Option<LogReader>,
    /// The latest one by another link than that of `latest`.
    other: Option<LogReader>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct LogReader {
    /// The number of the link; `None` for a browser's download, which has none.
    link: Option<u16>,
    at: Instant,
}

impl LogReaders {
    /// A piece of a log file is read for this link at `now`.
    pub fn note(&mut self, link: Option<u16>, now: Instant) {
        if self.latest.is_some_and(|latest| latest.link != link) {
            self.other = self.latest;
        }
        self.latest = Some(LogReader { link, at: now });
    }

    /// A browser has its file.
    pub fn browser_ended(&mut self) {
        for reader in [&mut self.latest, &mut self.other] {
            reader.take_if(|reader| reader.link.is_none());
        }
    }

    /// When a log file was last read for another link than this one.
    pub fn read_for_another_at(&self, link: u16) -> Option<Instant> {
        let readers = [self.latest, self.other].into_iter().flatten();
        let mut others = readers.filter(|reader| reader.link != Some(link));
        others.next().map(|reader| reader.at)
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

    #[test]
    fn a_station_that_reads_logs_is_not_hidden_by_the_one_that_asks() {
        let mut readers = LogReaders::default();
        assert_eq!(readers.read_for_another_at(1), None);
        for (link, at) in [(Some(1), 1), (None, 2), (Some(1), 3), (Some(1), 4)] {
            readers.note(link, at_us(at));
        }
        let of_others = |readers: &LogReaders| [1, 2].map(|link| readers.read_for_another_at(link));
        assert_eq!(of_others(&readers), [Some(at_us(2)), Some(at_us(4))]);
        readers.browser_ended();
        assert_eq!(of_others(&readers), [None, Some(at_us(4))]);
    }
}
