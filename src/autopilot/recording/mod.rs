//! The log: what is recorded, into which file, and what of it goes to flash next.

mod date;
mod share;
mod step;
mod stream;

use core::mem;

use heapless::Vec;

use date::Date;
pub use share::Detail;
use share::Share;
pub use step::LogStep;
pub use stream::Subject;
use stream::{Stream, parameter_record};

use crate::announce::{LastAnnounced, RateLimit};
use crate::battery::{BatteryState, Extremes, FailsafeLevel, FailsafeTimers};
use crate::log::{info, warn};
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{ParameterId, ParameterTrouble, Parameters, VehicleParameter};
use crate::recorder::dataflash::{CommandRecord, MESSAGE_BYTES, Record};
use crate::recorder::{LogFile, Piece, Ring};
use crate::system::{LogHealth, LogReaders};
use crate::time::{Instant, Utc};
use crate::vehicle::{ArmState, Vehicle};

/// Recording time after disarming, as ArduPilot's: the pack recovers meanwhile.
const AFTER_DISARMING_US: u64 = 15_000_000;

/// Delay after a failure before another file is begun.
const RETRY_INTERVAL_US: u64 = 10_000_000;

/// Shortest time between the reports of a pack, in microseconds.
const REPORT_INTERVAL_US: u64 = 10_000_000;

/// `LOG_BITMASK`: the health of the board, once a second.
const HEALTH_RECORDED: i32 = 1 << 3;

/// `LOG_BITMASK`: the packs.
const PACKS_RECORDED: i32 = 1 << 9;

/// Begins every file. Log viewers find ArduPilot's names of modes by the word "Rover".
const GREETING: &str = concat!(
    "rover-battmon ",
    env!("CARGO_PKG_VERSION"),
    " (modes of ArduPilot Rover)"
);

/// Page size of the flash.
const PAGE_BYTES: usize = 256;

/// Bytes on their way to flash.
type Chunk = Vec<u8, PAGE_BYTES>;

/// Erases that fail in a row until the flash counts as worn out.
const MOST_FAILED_ERASES: u8 = 8;

/// Why there is no log although there should be one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum LogFailure {
    /// All erased space is used up, and flash is erased while disarmed only.
    Full,
    /// The flash can't be written.
    NotWritten,
}

/// Commands that are recorded at once, and the time after which one more is: five a second at most.
const COMMANDS_AT_ONCE: u8 = 5;
const COMMAND_INTERVAL_US: u64 = 1_000_000;

/// Announced once the log is full, and its last record.
pub const LOG_FULL: &str = "Log full until disarmed";

/// Records on their way to flash.
#[derive(Debug)]
pub struct Recording {
    /// The files in flash; `None` until they were looked for.
    ring: Option<Ring>,
    pub(super) readers: LogReaders,
    state: State,
    stream: Stream,
    /// Taken out of the stream and not in flash yet.
    chunk: Chunk,
    share: Share,
    now: Instant,
    /// When the rover was armed last.
    armed_at: Option<Instant>,
    flushed_at: Instant,
    failed_erases: u8,
    /// No log is wanted.
    is_off: bool,
    failure: Option<LogFailure>,
    announced: LastAnnounced<Option<LogFailure>>,
    retry_at: Instant,
    /// Whether the crash before this start has to get into flash.
    crash_is_due: bool,
    /// Waiting records have to be in flash at once.
    is_urgent: bool,
    command_rate: RateLimit<COMMAND_INTERVAL_US>,
    date: Date,
    /// The timers of each pack's failsafe as the file has them.
    timers: [FailsafeTimers; MAX_PACKS],
    /// The timers as they are, and when those of low and critical changed last.
    latest_timers: [(FailsafeTimers, [Instant; 2]); MAX_PACKS],
    /// When the latest report of each pack in this file was recorded.
    reports_at: [Option<Instant>; MAX_PACKS],
    /// Extremes of each pack since its latest BATX in this file.
    extremes: [Extremes; MAX_PACKS],
}

/// Whether records are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    /// No file is open.
    #[default]
    Idle,
    /// Into the open file.
    Recording,
    /// Not now; the open file goes on at the next arming.
    Paused,
    /// Not any more; the open file ends when all is written.
    Closing,
}

/// The wanted state of the log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Wish {
    /// To record, in another file if none is open.
    Record,
    /// To go on for a while after disarming, if a file is open.
    GoOn,
    /// To wait for the next arming.
    Pause,
    /// To end the open file.
    End,
}

impl Recording {
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new(has_crashed: bool) -> Self {
        Self {
            ring: None,
            readers: LogReaders::NONE,
            state: State::Idle,
            stream: Stream::default(),
            chunk: Chunk::default(),
            share: Share::default(),
            now: Instant::EPOCH,
            armed_at: None,
            flushed_at: Instant::EPOCH,
            failed_erases: 0,
            is_off: false,
            failure: None,
            announced: LastAnnounced::default(),
            retry_at: Instant::EPOCH,
            crash_is_due: has_crashed,
            is_urgent: false,
            command_rate: RateLimit::default(),
            date: Date::default(),
            timers: [FailsafeTimers::STOPPED; MAX_PACKS],
            latest_timers: [(FailsafeTimers::STOPPED, [Instant::EPOCH; 2]); MAX_PACKS],
            reports_at: [None; MAX_PACKS],
            extremes: [Extremes::default(); MAX_PACKS],
        }
    }

    /// The files, oldest first.
    pub fn files(&self) -> &[LogFile] {
        self.ring.as_ref().map_or(&[], Ring::files)
    }

    /// Place of a file's bytes.
    pub fn locate(&self, number: u16, offset: u32) -> Option<Piece> {
        self.ring.as_ref()?.locate(number, offset)
    }

    /// Whether the flash can be written and erased.
    pub fn health(&self) -> LogHealth {
        let is_worn_out = self.failed_erases >= MOST_FAILED_ERASES;
        if self.is_off {
            LogHealth::Off
        } else if is_worn_out || self.failure == Some(LogFailure::NotWritten) {
            LogHealth::Failed
        } else {
            LogHealth::Works
        }
    }

    /// A failure that was not announced yet.
    pub fn take_report(&mut self) -> Option<LogFailure> {
        self.announced
            .has_changed(self.failure)
            .then_some(self.failure)
            .flatten()
    }

    /// It is this time in UTC at `now`. Counts for the open file, unless it has its date, and for all that follow, until there
    /// is a later word.
    pub fn set_time(&mut self, utc: Utc, now: Instant) {
        self.date.set_time(utc, now);
    }

    /// Takes over what was found in flash.
    // Not inlined: a ring is large.
    #[inline(never)]
    pub fn found(&mut self, ring: Ring) {
        info!("log: {} files", ring.files().len());
        self.ring = Some(ring);
    }

    /// Begins, pauses or ends the log as it is wanted at `now`, and returns the number of a file that begins.
    pub fn follow(&mut self, now: Instant, parameters: &Parameters, vehicle: &Vehicle) -> Option<u16> {
        self.now = self.now.max(now);
        let arm_state = vehicle.arm_state();
        match arm_state {
            ArmState::Armed => {
                self.armed_at = Some(self.now);
                self.readers = LogReaders::NONE;
            }
            ArmState::Disarmed if self.is_full() => self.failure = None,
            ArmState::Disarmed => {}
        }
        self.is_off = !is_on(parameters);
        if self.is_off {
            // Of no concern.
            self.failed_erases = 0;
        }
        if matches!(self.state, State::Recording | State::Paused) {
            self.date.record(&mut self.stream, self.now);
        }
        match (self.state, self.wish(parameters, vehicle)) {
            (State::Idle, Wish::Record) => return self.begin(arm_state),
            // A failure of a log that is not wanted any more is over once it was announced.
            (State::Idle, Wish::Pause | Wish::End) if self.announced.is(&self.failure) => self.failure = None,
            (State::Recording, Wish::Record) => self.limit_length(arm_state),
            (State::Recording, Wish::Pause) => self.state = State::Paused,
            (State::Paused, Wish::Record) => self.state = State::Recording,
            (State::Paused, Wish::Pause) => self.close_if_long(),
            (State::Recording | State::Paused, Wish::End) => self.state = State::Closing,
            (State::Idle, Wish::Pause | Wish::End)
            | (State::Idle | State::Recording | State::Paused, Wish::GoOn)
            | (State::Closing, _) => {}
        }
        None
    }

    /// The state that parameters and vehicle call for.
    fn wish(&self, parameters: &Parameters, vehicle: &Vehicle) -> Wish {
        let is_set = |parameter| parameters.get_whole(parameter) != 0;
        let is_kept_on = |armed_at| self.now.us_since(armed_at) < AFTER_DISARMING_US;
        if vehicle.pending_restart().is_some() || !is_on(parameters) {
            Wish::End
        } else if is_set(VehicleParameter::LogDisarmed)
            || vehicle.arm_state() == ArmState::Armed
            || self.has_crash_to_record(parameters)
        {
            Wish::Record
        } else if self.armed_at.is_some_and(is_kept_on) {
            Wish::GoOn
        } else if is_set(VehicleParameter::LogFileDsrmrot) {
            Wish::End
        } else {
            Wish::Pause
        }
    }

    /// Whether the crash before this start has to be recorded.
    pub fn crash_is_due(&self) -> bool {
        self.crash_is_due
    }

    /// Whether a file is begun for the crash before this start. Not after quick crashes: the owner's `LOG_BITMASK` is unknown, and
    /// a loop would take the place of drives.
    fn has_crash_to_record(&self, parameters: &Parameters) -> bool {
        self.crash_is_due && parameters.trouble() != Some(ParameterTrouble::NotRead)
    }

    /// Whether the log ends until the rover is disarmed.
    fn is_full(&self) -> bool {
        self.failure == Some(LogFailure::Full)
    }

    /// Ends a file that must not be longer.
    fn limit_length(&mut self, arm_state: ArmState) {
        match arm_state {
            // Its announcement is the last record.
            ArmState::Armed if self.is_full() => self.state = State::Closing,
            ArmState::Armed if self.ring.as_ref().is_some_and(share::is_full) => self.fail(LogFailure::Full),
            ArmState::Armed => {}
            ArmState::Disarmed => self.close_if_long(),
        }
    }

    /// Ends a file if the next drive has more room in a new one.
    fn close_if_long(&mut self) {
        if self.ring.as_ref().is_some_and(share::is_long) {
            self.state = State::Closing;
        }
    }

    /// Begins a file, unless the log is full or has failed a moment ago.
    fn begin(&mut self, arm_state: ArmState) -> Option<u16> {
        if self.now < self.retry_at || self.is_full() {
            return None;
        }
        let ring = self.ring.as_mut()?;
        let Ok(number) = ring.open() else {
            // While disarmed, space is about to be erased.
            if arm_state == ArmState::Armed {
                self.fail(LogFailure::Full);
            }
            return None;
        };
        info!("log: file {}", number);
        self.state = State::Recording;
        self.chunk.clear();
        self.stream.begin(self.now);
        self.date.file_began_utc_s = None;
        self.timers = [FailsafeTimers::STOPPED; MAX_PACKS];
        self.reports_at = [None; MAX_PACKS];
        self.extremes = [Extremes::default(); MAX_PACKS];
        self.flushed_at = self.now;
        self.add(&Record::Message(GREETING));
        Some(number)
    }

    fn fail(&mut self, failure: LogFailure) {
        if failure == LogFailure::NotWritten {
            // Once at once, in another sector: the begun file shows the next start that this one does not end the drive.
            let pause_us = match self.failure {
                Some(LogFailure::NotWritten) => RETRY_INTERVAL_US,
                _ => 0,
            };
            self.retry_at = self.now.after_us(pause_us);
        }
        if self.failure != Some(failure) {
            warn!("log: {:?}", failure);
        }
        self.failure = Some(failure);
    }

    /// Takes a record, if records are taken now, and returns its length. After a BATX the pack's extremes begin again.
    pub fn add(&mut self, record: &Record<'_>) -> usize {
        self.add_at(record, self.now)
    }

    /// Takes a record of something that was at `at`, and returns its length: readings are of their sampling tick.
    pub fn add_at(&mut self, record: &Record<'_>, at: Instant) -> usize {
        if self.state != State::Recording {
            return 0;
        }
        // The next start sees by it whether the power has ended a drive.
        self.is_urgent |= matches!(record, Record::Arm { .. });
        let bytes = record.encode(at.as_micros());
        let has_room = self.stream.add(&bytes);
        if let Record::Estimate(pack, ..) = record
            && has_room
        {
            self.extremes[*pack as usize] = Extremes::default();
        }
        bytes.len()
    }

    /// Takes a text, in as many records as it needs. One that fills its record has another behind it, which may be empty: so they can be
    /// joined.
    pub fn add_text(&mut self, text: &str) {
        let mut rest = text;
        loop {
            let (part, further) = rest
                .split_at_checked(rest.floor_char_boundary(MESSAGE_BYTES))
                .unwrap_or((rest, ""));
            self.add(&Record::Message(part));
            if part.len() < MESSAGE_BYTES && further.is_empty() {
                return;
            }
            rest = further;
        }
    }

    /// Whether records are taken now.
    pub fn takes_records(&self) -> bool {
        self.state == State::Recording
    }

    /// Adds the extremes of a reading to those that the pack's next BATX has.
    pub fn add_extremes(&mut self, pack: Pack, extremes: Extremes) {
        if self.state == State::Recording {
            self.extremes[pack as usize].include(extremes);
        }
    }

    /// Extremes of a pack since its latest BATX.
    pub fn extremes(&self, pack: Pack) -> Extremes {
        self.extremes[pack as usize]
    }

    /// Records the timers of a pack's failsafe that are not as the file has them, at the tick `now`, each with the time of its
    /// change; before them the reading, by which a replay has the same voltage cross its threshold in the same tick. They are part
    /// of the share, since a voltage may cross its threshold with every tick; the latest follows when there is room.
    pub fn add_timers(&mut self, pack: Pack, state: &BatteryState, now: Instant) {
        let timers = state.failsafe_timers;
        let (latest, changed_at) = &mut self.latest_timers[pack as usize];
        let place = |level| usize::from(level == FailsafeLevel::Critical);
        for (level, _) in timers.changes(mem::replace(latest, timers)) {
            changed_at[place(level)] = now;
        }
        let changed_at = *changed_at;
        let before = self.timers[pack as usize];
        if before == timers || self.state != State::Recording || self.share.is_overdrawn() {
            return;
        }
        self.timers[pack as usize] = timers;
        let mut bytes = self.add_at(&Record::Battery(pack, state), now);
        for (level, timer) in timers.changes(before) {
            bytes += self.add_at(
                &Record::FailsafeTimer(pack, level, timer),
                changed_at[place(level)],
            );
        }
        self.spend(bytes);
    }

    /// Records a command, whatever is left of the packs' share, unless there were five in the last seconds.
    pub fn add_command(&mut self, command: &CommandRecord, now: Instant) {
        if self.state == State::Recording && self.command_rate.take_of(COMMANDS_AT_ONCE, now) {
            let bytes = self.add(&Record::Command(command));
            self.spend(bytes);
            self.is_urgent = true;
        }
    }

    /// Records the value of a parameter.
    pub fn add_parameter(&mut self, id: ParameterId, parameters: &Parameters) {
        // A file that goes on later has the values of then.
        if matches!(self.state, State::Recording | State::Paused) {
            self.stream.add(&parameter_record(id, parameters, self.now));
        }
    }

    /// Records once more which pack it is, and what is learnt of it.
    pub fn describe(&mut self, pack: Pack) {
        // A file that goes on later has the pack of then.
        if matches!(self.state, State::Recording | State::Paused) {
            self.stream.describe(pack);
        }
    }

    /// Records all parameters once more.
    pub fn add_all_parameters(&mut self) {
        self.stream.repeat_parameters();
    }

    /// Whether the health of the board is recorded.
    pub fn records_health(&self, parameters: &Parameters) -> bool {
        parameters.get_whole(VehicleParameter::LogBitmask) & HEALTH_RECORDED != 0
    }

    /// Whether everything that was recorded is in flash, or lost.
    pub fn is_written(&self) -> bool {
        self.state == State::Idle || (self.chunk.is_empty() && !self.stream.has(1))
    }

    /// Records that could not be taken so far.
    pub fn dropped(&self) -> u32 {
        self.stream.dropped()
    }

    /// A sampling tick has passed.
    pub fn tick(&mut self) {
        self.share.tick();
    }

    /// The next pack to record, by its position among `packs`.
    pub fn next_pack(&mut self, packs: usize, parameters: &Parameters) -> Option<(usize, Detail)> {
        if self.state != State::Recording
            || parameters.get_whole(VehicleParameter::LogBitmask) & PACKS_RECORDED == 0
        {
            return None;
        }
        let rate_hz = parameters.get(VehicleParameter::LogBlkRatemax);
        let round_us = if rate_hz > 0.0 { (1e6 / rate_hz) as u64 } else { 0 };
        self.share.next(packs, round_us, self.now)
    }

    /// Whether what a pack reports is recorded in this turn of it.
    pub fn takes_report(&mut self, pack: Pack) -> bool {
        let recorded_at = &mut self.reports_at[pack as usize];
        let is_due = recorded_at.is_none_or(|at| self.now.us_since(at) >= REPORT_INTERVAL_US);
        if is_due {
            *recorded_at = Some(self.now);
        }
        is_due
    }

    /// This many bytes of the share were used.
    pub fn spend(&mut self, bytes: usize) {
        self.share.spend(bytes);
    }
}

/// Whether anything is recorded at all.
pub fn is_on(parameters: &Parameters) -> bool {
    parameters.get_whole(VehicleParameter::LogBitmask) != 0
}

#[cfg(test)]
mod tests;
