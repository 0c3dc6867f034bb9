//! The talk with the board: keeps in touch, listens, asks, and keeps a record of everything.

use std::sync::mpsc::TryRecvError;

use rover_battmon::mavlink::dialect::{
    HEARTBEAT_DATA, MavAutopilot, MavCmd, MavMessage, MavModeFlag, MavResult, MavState, MavType,
    TIMESYNC_DATA,
};
use rover_battmon::time::Instant;

use super::evidence::{BoardStart, Gap, Interruption, Received, Recording, Restarted, RoundTrip};
use super::port::{Owner, Port};
use crate::frames::{self, AUTOPILOT, Frame, FrameReader, frame};

const HEARTBEAT_INTERVAL_US: u64 = 1_000_000;

/// Between two requests for the board's time, which measure round trips and reveal restarts.
const TIMESYNC_INTERVAL_US: u64 = 500_000;

/// Between two looks at whether the owner has stopped the check or answered.
const LOOK_INTERVAL_US: u64 = 100_000;

/// A command is answered within this; at 9600 baud a list may be ahead of the answer.
const ACK_TIMEOUT_US: u64 = 2_000_000;

/// Until what was set is saved (3.3 s), the board has started and its port is there again.
const RESTART_TIMEOUT_US: u64 = 12_000_000;

/// A restart shows by the board's time: before, it has to run for longer than until its first answer afterwards.
const LEAST_UPTIME_US: u64 = 2_000_000;

const MAVLINK_VERSION: u8 = 3;

/// The talk with the board.
pub struct Session<'a> {
    port: &'a mut dyn Port,
    owner: &'a mut dyn Owner,
    reader: FrameReader,
    sequence: u8,
    board: Option<(u8, u8)>,
    next_heartbeat: Instant,
    next_timesync: Instant,
    /// When the board was asked for its time, while the answer is awaited.
    time_asked_at: Option<Instant>,
    uptime_ns: Option<i64>,
    /// It was asked to restart.
    is_restarting: bool,
    last_sequence: Option<u8>,
    is_damaged: bool,
    record: Recording,
}

impl<'a> Session<'a> {
    /// A talk that begins now.
    pub fn new(port: &'a mut dyn Port, owner: &'a mut dyn Owner) -> Self {
        let now = port.now();
        Self {
            port,
            owner,
            reader: FrameReader::default(),
            sequence: 0,
            board: None,
            next_heartbeat: now,
            next_timesync: now,
            time_asked_at: None,
            uptime_ns: None,
            is_restarting: false,
            last_sequence: None,
            is_damaged: false,
            record: Recording::default(),
        }
    }

    /// Messages so far.
    pub fn record(&self) -> &Recording {
        &self.record
    }

    /// Ends the talk.
    pub fn into_record(self) -> Recording {
        self.record
    }

    /// The board's system and component id; `None` while it was not heard.
    pub fn board(&self) -> Option<(u8, u8)> {
        self.board
    }

    /// The system that requests are for.
    pub(super) fn system_id(&self) -> u8 {
        self.board.map_or(0, |(system_id, _)| system_id)
    }

    /// The time.
    pub fn now(&mut self) -> Instant {
        self.port.now()
    }

    /// Shows the owner a line.
    pub fn show(&mut self, line: &str) {
        self.owner.show(line);
    }

    /// Sends a message. A line that is gone is noticed where answers are waited for.
    pub fn send(&mut self, message: &MavMessage) {
        let bytes = frame(self.sequence, message);
        self.sequence = self.sequence.wrapping_add(1);
        // That line is gone for `receive`, too, which reports it.
        let _ = self.port.send(&bytes);
    }

    /// Listens until `deadline`.
    ///
    /// # Errors
    /// The check has to end.
    pub fn listen_until(&mut self, deadline: Instant) -> Result<(), Interruption> {
        while self.port.now() < deadline {
            self.listen_once(deadline)?;
        }
        Ok(())
    }

    /// Listens for this many µs.
    ///
    /// # Errors
    /// The check has to end.
    pub fn listen_for(&mut self, us: u64) -> Result<(), Interruption> {
        let deadline = self.port.now().after_us(us);
        self.listen_until(deadline)
    }

    /// Waits for a message from now on in which `find` finds something, for this many µs.
    ///
    /// # Errors
    /// The check has to end.
    pub fn wait_for<T>(
        &mut self,
        timeout_us: u64,
        mut find: impl FnMut(&MavMessage) -> Option<T>,
    ) -> Result<Option<T>, Interruption> {
        let deadline = self.port.now().after_us(timeout_us);
        let mut seen = self.record.received.len();
        loop {
            let new = self.record.received.get(seen..).unwrap_or_default();
            if let Some(found) = new.iter().find_map(|received| find(&received.message)) {
                return Ok(Some(found));
            }
            seen = self.record.received.len();
            if self.port.now() >= deadline {
                return Ok(None);
            }
            self.listen_once(deadline)?;
        }
    }

    /// Sends a command and waits for its result; `None` without an answer.
    ///
    /// # Errors
    /// The check has to end.
    pub fn command(
        &mut self,
        command: MavCmd,
        parameters: [f32; 4],
    ) -> Result<Option<MavResult>, Interruption> {
        self.post_command(command, parameters);
        self.wait_for(ACK_TIMEOUT_US, |message| match message {
            MavMessage::COMMAND_ACK(ack) if ack.command == command => Some(ack.result),
            _ => None,
        })
    }

    /// Sends a command without waiting.
    pub fn post_command(&mut self, command: MavCmd, parameters: [f32; 4]) {
        self.send(&frames::command(self.system_id(), command, parameters));
    }

    /// Has the board restart, by MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN with these parameters, and waits until it runs again.
    ///
    /// # Errors
    /// The check has to end.
    pub fn restart(&mut self, parameters: [f32; 4]) -> Result<Restarted, Interruption> {
        self.let_run()?;
        let asked_at = self.port.now();
        let before = self.record.starts.len();
        self.is_restarting = true;
        let answer = self.command(MavCmd::MAV_CMD_PREFLIGHT_REBOOT_SHUTDOWN, parameters)?;
        let restarted = match answer {
            Some(MavResult::MAV_RESULT_ACCEPTED) => self.await_start(before, asked_at)?,
            Some(result) => Restarted::Refused(result),
            None => Restarted::Unanswered,
        };
        self.is_restarting = false;
        Ok(restarted)
    }

    /// Waits while the board has started a moment ago.
    fn let_run(&mut self) -> Result<(), Interruption> {
        let deadline = self.port.now().after_us(LEAST_UPTIME_US);
        let has_just_started = |uptime_ns| uptime_ns < LEAST_UPTIME_US as i64 * 1000;
        while self.uptime_ns.is_some_and(has_just_started) && self.port.now() < deadline {
            self.listen_once(deadline)?;
        }
        Ok(())
    }

    fn await_start(&mut self, before: usize, asked_at: Instant) -> Result<Restarted, Interruption> {
        let deadline = asked_at.after_us(RESTART_TIMEOUT_US);
        while self.record.starts.len() == before {
            if self.port.now() >= deadline {
                return Ok(Restarted::NotSeen);
            }
            self.listen_once(deadline)?;
        }
        // A line that was opened again carries something only once the board's program serves it.
        let left_us = deadline.us_since(self.port.now());
        self.wait_for(left_us, |_| Some(()))?;
        Ok(Restarted::After(self.port.now().us_since(asked_at)))
    }

    /// Asks the owner, and listens to the board meanwhile; `None` if there is no one to ask.
    ///
    /// # Errors
    /// The check has to end.
    pub fn ask(&mut self, question: &str) -> Result<Option<String>, Interruption> {
        self.owner.ask(question);
        loop {
            match self.owner.answer() {
                Ok(line) => return Ok(Some(line)),
                Err(TryRecvError::Disconnected) => return Ok(None),
                Err(TryRecvError::Empty) => {
                    let look = self.port.now().after_us(LOOK_INTERVAL_US);
                    self.listen_until(look)?;
                }
            }
        }
    }

    /// Waits for bytes once, for [`LOOK_INTERVAL_US`] at most.
    fn listen_once(&mut self, deadline: Instant) -> Result<(), Interruption> {
        if self.owner.has_stopped() {
            return Err(Interruption::Stopped);
        }
        let now = self.port.now();
        self.keep_in_touch(now);
        let look = now.after_us(LOOK_INTERVAL_US);
        let wake = [deadline, self.next_heartbeat, self.next_timesync]
            .into_iter()
            .fold(look, Ord::min);
        let mut bytes = Vec::new();
        match self.port.receive(wake, &mut bytes) {
            Ok(()) => self.take(&bytes),
            Err(_) => self.reopen()?,
        }
        Ok(())
    }

    fn keep_in_touch(&mut self, now: Instant) {
        if now >= self.next_heartbeat {
            self.next_heartbeat = now.after_us(HEARTBEAT_INTERVAL_US);
            self.send(&MavMessage::HEARTBEAT(heartbeat()));
        }
        if now >= self.next_timesync {
            self.next_timesync = now.after_us(TIMESYNC_INTERVAL_US);
            self.ask_time(now);
        }
    }

    fn ask_time(&mut self, now: Instant) {
        let unanswered = self.time_asked_at.take();
        if self.board.is_none() {
            return;
        }
        if let Some(asked_at) = unanswered {
            self.note_round_trip(asked_at, None);
        }
        self.time_asked_at = Some(now);
        self.send(&MavMessage::TIMESYNC(TIMESYNC_DATA {
            tc1: 0,
            ts1: stamp_ns(now),
            target_system: self.system_id(),
            target_component: AUTOPILOT,
        }));
    }

    /// Notes a round trip, unless the board is restarting.
    fn note_round_trip(&mut self, asked_at: Instant, took_us: Option<u64>) {
        if !self.is_restarting {
            self.record.round_trips.push(RoundTrip { asked_at, took_us });
        }
    }

    fn reopen(&mut self) -> Result<(), Interruption> {
        let at = self.port.now();
        let deadline = at.after_us(RESTART_TIMEOUT_US);
        self.forget_what_came_before();
        self.port.reopen(deadline).map_err(|_| Interruption::Lost)?;
        if self.is_restarting {
            // The line went with the program, so this is the restart. Whether its time started over no longer matters.
            let at = self.port.now();
            self.note_start(at);
            self.uptime_ns = None;
        } else {
            self.record.port_losses.push(at);
        }
        Ok(())
    }

    /// What comes next is not a continuation of what came before.
    fn forget_what_came_before(&mut self) {
        self.reader = FrameReader::default();
        self.last_sequence = None;
        self.is_damaged = false;
        self.time_asked_at = None;
    }

    fn take(&mut self, bytes: &[u8]) {
        let at = self.port.now();
        for frame in self.reader.take(bytes) {
            self.is_damaged |= frame.is_after_damage;
            self.take_frame(frame, at);
        }
    }

    fn take_frame(&mut self, frame: Frame, at: Instant) {
        let sender = (frame.system_id, frame.component_id);
        if is_autopilot(frame.message.as_ref()) {
            match self.board {
                None => self.board = Some(sender),
                Some(board) if board != sender => {
                    self.record.others.insert(sender);
                }
                Some(_) => {}
            }
        }
        if self.board != Some(sender) {
            return;
        }
        self.note_gap(frame.sequence, at);
        if let Some(message) = frame.message {
            if let MavMessage::TIMESYNC(timesync) = &message {
                self.take_time(timesync, at);
            }
            self.record.received.push(Received { at, message });
        }
    }

    /// Compares a frame's number with the one before. Damage in front of the very first frame is the end of another one.
    fn note_gap(&mut self, sequence: u8, at: Instant) {
        let is_damage = std::mem::take(&mut self.is_damaged);
        let Some(last) = self.last_sequence.replace(sequence) else {
            return;
        };
        let missing = sequence.wrapping_sub(last).wrapping_sub(1);
        if !self.is_restarting && (missing > 0 || is_damage) {
            self.record.gaps.push(Gap {
                at,
                missing,
                is_damage,
            });
        }
    }

    /// An answer to the latest request for the time.
    fn take_time(&mut self, answer: &TIMESYNC_DATA, at: Instant) {
        let is_answered = |asked_at: &mut Instant| answer.tc1 != 0 && answer.ts1 == stamp_ns(*asked_at);
        let Some(asked_at) = self.time_asked_at.take_if(is_answered) else {
            return;
        };
        self.note_round_trip(asked_at, Some(at.us_since(asked_at)));
        let before_ns = self.uptime_ns.replace(answer.tc1);
        if before_ns.is_some_and(|before_ns| answer.tc1 < before_ns) {
            self.note_start(at);
        }
    }

    fn note_start(&mut self, at: Instant) {
        self.record.starts.push(BoardStart {
            at,
            is_requested: self.is_restarting,
        });
    }
}

/// Identifies a request for the time: nanoseconds, and never 0.
fn stamp_ns(asked_at: Instant) -> i64 {
    (asked_at.as_micros() as i64)
        .saturating_mul(1000)
        .saturating_add(1)
}

fn heartbeat() -> HEARTBEAT_DATA {
    HEARTBEAT_DATA {
        custom_mode: 0,
        mavtype: MavType::MAV_TYPE_GCS,
        autopilot: MavAutopilot::MAV_AUTOPILOT_INVALID,
        base_mode: MavModeFlag::empty(),
        system_status: MavState::MAV_STATE_ACTIVE,
        mavlink_version: MAVLINK_VERSION,
    }
}

/// Whether a message is the heartbeat of an autopilot: other components and ground stations name none.
fn is_autopilot(message: Option<&MavMessage>) -> bool {
    matches!(message, Some(MavMessage::HEARTBEAT(heartbeat)) if heartbeat.autopilot != MavAutopilot::MAV_AUTOPILOT_INVALID)
}
