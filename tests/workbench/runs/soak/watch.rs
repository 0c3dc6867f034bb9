//! What has to hold whatever happens.

use rover_battmon::memory::flash_map;

use super::motors::{Change, Motors, Says};
use super::rig::{PROBE, Radio, Rig};
use super::station::Driver;
use crate::bench::{CYCLES_PER_US, MILLISECOND, PARAMETER_OFFSET, SECOND, SIGNING_OFFSET, is_learnt};
use crate::i2c_bus::BUS;
use emulator::{FlashOperationKind, ResetCause};
use support::frames::{ARMED, BATTERY_STATUS, Frame, HEARTBEAT, Heartbeat, PARAM_VALUE, PING, ParamValue};

/// HEARTBEAT comes once a second. What else may lie between two of them, or between a start and the first one: a slice of
/// the list of parameters, an erase of the flash, a step of this.
const SILENCE_US: u64 = 1_300 * MILLISECOND;

/// Without a fault: a step of this in which the station has just stopped sending stick input, and one until the rover acts on it.
const PROMPT_US: u64 = 250 * MILLISECOND;

/// Flash is written only this long after a parameter was set, or after a start.
const WRITING_US: u64 = 2 * SECOND;

/// In the log of a board that hung in the radio's task before.
const OFF_AFTER_CRASH: &str = "Wi-Fi: OffAfterCrash";

impl Rig {
    /// Looks at everything that has happened since the last look, and panics if it must not.
    pub fn look(&mut self) {
        let resets = self.bench.resets();
        assert_eq!(resets.len(), self.resets, "{:?}", resets.last());
        let changes = Motors::take_changes(&mut self.bench);
        let frames = self.receive(None);
        self.take_all(&changes, &frames);
        self.look_at_flash();
        let log = self.bench.take_log();
        if log.iter().any(|line| line.text == OFF_AFTER_CRASH) {
            self.radio = Radio::Unused;
        }
        // They are not used elsewhere, and grow.
        self.bench.i2c(BUS).take_transactions();
        let silence_us = self.now_us() - self.alive_us;
        assert!(silence_us <= SILENCE_US, "no HEARTBEAT for {silence_us} us");
        self.look_at_drive();
    }

    /// Looks at the board after a reset that was caused.
    pub fn look_at_reset(&mut self, causes: &[ResetCause]) {
        let reset = self.bench.resets()[self.resets];
        assert!(causes.contains(&reset.cause), "{reset:?}");
        self.resets += 1;
        self.radio = match self.converter_works {
            true => Radio::Used,
            false => Radio::Unused,
        };
        let reset_us = reset.time_us;
        let changes = Motors::take_changes(&mut self.bench);
        let frames = self.receive(Some(reset_us));
        let change = changes.partition_point(|change| change.at_us < reset_us);
        let frame = frames.partition_point(|frame| frame.at_us <= reset_us);
        self.take_all(&changes[..change], &frames[..frame]);
        self.orders.forget();
        self.ledger.restart(reset_us);
        self.alive_us = reset_us;
        self.take_all(&changes[change..], &frames[frame..]);
        self.motors.assert_ordered(&self.orders, self.now_us());
        self.look_at_flash();
    }

    fn receive(&mut self, reset_us: Option<u64>) -> Vec<Frame> {
        let sent = self.bench.uart(0).take_sent();
        let bytes = sent.iter().map(|sent| (sent.end / CYCLES_PER_US, sent.byte));
        let frames = self.receiver.receive(bytes, reset_us);
        if let Some(owner) = &mut self.owner {
            owner.hear(&frames);
        }
        frames
    }

    fn take_all(&mut self, changes: &[Change], frames: &[Frame]) {
        self.motors.check(changes, &self.orders);
        for frame in frames {
            self.take(frame);
        }
    }

    fn take(&mut self, frame: &Frame) {
        match frame.message_id {
            HEARTBEAT => self.take_heartbeat(frame),
            BATTERY_STATUS => self.packs.take(frame),
            PING if frame.u32(8) == PROBE => {
                self.answered_us.get_or_insert(frame.at_us);
            }
            PARAM_VALUE => {
                let reported = ParamValue(frame);
                self.ledger
                    .reported(&reported.name(), reported.value(), frame.at_us);
                self.reported.insert(reported.name(), reported.value());
            }
            _ => {}
        }
    }

    fn take_heartbeat(&mut self, frame: &Frame) {
        self.tally.heartbeat(frame.at_us - self.alive_us);
        self.alive_us = frame.at_us;
        self.heard_us.get_or_insert(frame.at_us);
        let says = match Heartbeat(frame).base_mode() & ARMED {
            0 => Says::Disarmed,
            _ => Says::Armed,
        };
        self.orders.reported(says, frame.at_us);
        self.station.see(says, frame.at_us);
    }

    /// What is written was set, or is made good after a start.
    fn look_at_flash(&mut self) {
        let since_us = self.ledger.sent_us.max(self.ledger.started_us);
        for operation in self.bench.take_flash_operations() {
            let is_signing = (SIGNING_OFFSET..PARAMETER_OFFSET).contains(&operation.offset);
            if is_learnt(&operation) {
                self.tally.learnt += 1;
            } else if flash_map::LOG.contains(&operation.offset) {
                self.tally.logged += 1;
            } else if self.owner.is_some() && is_signing {
                self.tally.marks += 1;
            } else {
                let is_set = operation.time_us <= since_us + WRITING_US;
                assert!(is_set, "no parameter was set: {operation:?}");
                match operation.kind {
                    FlashOperationKind::PageProgram => self.tally.programs += 1,
                    _ => self.tally.erases += 1,
                }
            }
        }
    }

    /// No motor turns now that must not. Without a fault they follow the stick input at once, and have turned by the end of a drive.
    fn look_at_drive(&mut self) {
        let stick_us = self.motors.assert_ordered(&self.orders, self.now_us());
        assert!(
            self.calm_since_us.is_none() || stick_us <= PROMPT_US,
            "by stick input {stick_us} us old"
        );
        let Some(drive) = self.station.take_finished_drive() else {
            return;
        };
        self.tally.drives += 1;
        let began_us = drive.began_us;
        if self.calm_since_us.is_some_and(|calm_us| calm_us <= began_us) {
            self.tally.calm_drives += 1;
            let turned = self.motors.turned_us > Some(began_us);
            assert_eq!(turned, drive.driver == Driver::Careful, "{drive:?}");
        }
    }
}
