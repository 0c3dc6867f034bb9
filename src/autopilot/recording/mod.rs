//! The log: what is recorded, and what of it goes to flash next.

mod queue;
mod share;
mod step;
mod stream;

use heapless::Vec;

use crate::battery::ArmState;
use crate::crash::CrashRecord;
use crate::dataflash::Record;
use crate::log::{info, warn};
use crate::mavlink::LogHealth;
use crate::parameter::{ParameterId, Parameters, VehicleParameter};
use crate::recorder::{LogFile, Piece, Ring};
use crate::time::Instant;
use crate::vehicle::Vehicle;
use share::Share;
use stream::{Stream, parameter_record};

pub(super) use share::Detail;
pub use step::LogStep;

/// The log goes on for so long after disarming, as ArduPilot's does: the pack recovers meanwhile.
const AFTER_DISARMING_US: u64 = 15_000_000;

/// With the interval at which the flash is looked after, at most a second is lost when the power goes.
const FLUSH_INTERVAL_US: u64 = 700_000;

/// After a failure, another file is begun so much later.
const RETRY_INTERVAL_US: u64 = 10_000_000;

/// Erases that fail in a row until the flash counts as worn out.
const MOST_FAILED_ERASES: u8 = 8;

/// What the flash programs at once.
const PAGE_BYTES: usize = 256;

/// Bytes on their way to flash.
type Chunk = Vec<u8, PAGE_BYTES>;

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

/// Why there is no log although there should be one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum LogFailure {
    /// All erased space is used up, and flash is erased while disarmed only.
    Full,
    /// The flash can't be written.
    NotWritten,
}

/// What is recorded, until it is in flash.
#[derive(Debug)]
pub(super) struct Recording {
    /// The files in flash; `None` until they were looked for.
    ring: Option<Ring>,
    state: State,
    stream: Stream,
    /// What is taken out of the stream and not in flash yet.
    chunk: Chunk,
    share: Share,
    now: Instant,
    disarmed_at: Option<Instant>,
    flushed_at: Instant,
    failed_erases: u8,
    failure: Option<LogFailure>,
    announced: Option<LogFailure>,
    retry_at: Instant,
    /// The crash before this start, until a file has it.
    crash: Option<CrashRecord>,
}

/// Whether records are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
enum State {
    /// No file is open.
    #[default]
    Idle,
    /// Into the open file.
    Recording,
    /// Not now; the open file goes on later.
    Paused,
    /// Not any more; the open file ends when all is written.
    Closing,
}

impl Recording {
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new(crash: Option<CrashRecord>) -> Self {
        Self {
            ring: None,
            state: State::Idle,
            stream: Stream::default(),
            chunk: Chunk::default(),
            share: Share::default(),
            now: Instant::EPOCH,
            disarmed_at: None,
            flushed_at: Instant::EPOCH,
            failed_erases: 0,
            failure: None,
            announced: None,
            retry_at: Instant::EPOCH,
            crash,
        }
    }

    /// The files, oldest first.
    pub fn files(&self) -> &[LogFile] {
        self.ring.as_ref().map_or(&[], Ring::files)
    }

    /// Where the bytes of a file are.
    pub fn locate(&self, number: u16, offset: u32) -> Option<Piece> {
        self.ring.as_ref()?.locate(number, offset)
    }

    /// Whether the flash can be written.
    pub fn health(&self) -> LogHealth {
        match self.failure {
            Some(LogFailure::NotWritten) => LogHealth::Failed,
            Some(LogFailure::Full) | None => LogHealth::Works,
        }
    }

    /// A failure that was not announced yet.
    pub fn take_report(&mut self) -> Option<LogFailure> {
        if self.announced == self.failure {
            return None;
        }
        self.announced = self.failure;
        self.failure
    }

    /// Takes over what was found in flash.
    // Not inlined: a ring is large.
    #[inline(never)]
    pub fn found(&mut self, ring: Ring) {
        info!("log: {} files", ring.files().len());
        self.ring = Some(ring);
    }

    /// Begins, pauses or ends the log as it is wanted at `now`.
    pub fn follow(&mut self, now: Instant, parameters: &Parameters, vehicle: &Vehicle) {
        self.now = self.now.max(now);
        let arm_state = vehicle.arm_state();
        let is_restarting = vehicle.pending_restart().is_some();
        if arm_state == ArmState::Armed {
            self.disarmed_at = Some(self.now);
        }
        let is_wanted = !is_restarting && self.is_wanted(parameters);
        match self.state {
            State::Idle if is_wanted && self.now >= self.retry_at => self.begin(arm_state),
            State::Paused | State::Closing if is_wanted => self.state = State::Recording,
            State::Recording if !is_wanted => {
                let rotates = parameters.get_whole(VehicleParameter::LogFileDsrmrot) != 0;
                self.state = if rotates || !is_on(parameters) || is_restarting {
                    State::Closing
                } else {
                    State::Paused
                };
            }
            _ => {}
        }
        self.forget_failure(is_wanted, parameters, arm_state);
    }

    /// A failure that is over, or of no concern: a flash that could not be erased stays so.
    fn forget_failure(&mut self, is_wanted: bool, parameters: &Parameters, arm_state: ArmState) {
        if !is_on(parameters) {
            self.failed_erases = 0;
        }
        let is_over = match self.failure {
            Some(LogFailure::Full) => arm_state == ArmState::Disarmed,
            Some(LogFailure::NotWritten) => !is_wanted && self.failed_erases < MOST_FAILED_ERASES,
            None => false,
        };
        if is_over {
            self.failure = None;
        }
    }

    /// Whether records should be taken now.
    fn is_wanted(&self, parameters: &Parameters) -> bool {
        let is_kept_on = |disarmed_at| self.now.us_since(disarmed_at) < AFTER_DISARMING_US;
        is_on(parameters)
            && (parameters.get_whole(VehicleParameter::LogDisarmed) != 0
                || self.disarmed_at.is_some_and(is_kept_on))
    }

    fn begin(&mut self, arm_state: ArmState) {
        let Some(ring) = &mut self.ring else { return };
        match ring.open() {
            Ok(number) => {
                info!("log: file {}", number);
                self.state = State::Recording;
                self.failure = None;
                self.chunk.clear();
                self.stream.begin();
                self.flushed_at = self.now;
                self.add(&Record::Message(GREETING));
                if let Some(crash) = self.crash.take() {
                    self.add(&Record::Crash(&crash));
                }
            }
            // While disarmed, space is about to be erased.
            Err(_) if arm_state == ArmState::Armed => self.fail(LogFailure::Full),
            Err(_) => {}
        }
    }

    fn fail(&mut self, failure: LogFailure) {
        self.retry_at = self.now.after_us(RETRY_INTERVAL_US);
        if self.failure != Some(failure) {
            warn!("log: {:?}", failure);
        }
        self.failure = Some(failure);
    }

    /// Takes a record, if records are taken now, and returns its length.
    pub fn add(&mut self, record: &Record<'_>) -> usize {
        if self.state != State::Recording {
            return 0;
        }
        let bytes = record.encode(self.now.as_micros());
        self.stream.add(&bytes);
        bytes.len()
    }

    /// Records the value of a parameter.
    pub fn add_parameter(&mut self, id: ParameterId, parameters: &Parameters) {
        if self.state == State::Recording {
            self.stream.add(&parameter_record(id, parameters, self.now));
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

    /// So many bytes of the share were used.
    pub fn spend(&mut self, bytes: usize) {
        self.share.spend(bytes);
    }
}

/// Whether anything is recorded at all.
fn is_on(parameters: &Parameters) -> bool {
    parameters.get_whole(VehicleParameter::LogBitmask) != 0
}

#[cfg(test)]
mod tests;
