//! What answers a ground station on one link.

use super::dialect::{MavResult, MavSeverity};
use super::messages::chunks_of;
use super::outbox::Outbox;
use super::{CommandAck, Message, Peer, status_texts};

/// Posts answers and texts, and counts those for which there is no room.
pub(super) struct Replies<'a> {
    pub outbox: &'a mut Outbox,
    pub dropped: &'a mut u32,
    /// Long texts so far, of which each has a number.
    pub texts: &'a mut u16,
}

impl Replies<'_> {
    pub fn answer(&mut self, message: Message) {
        if self.outbox.reply(message).is_err() {
            *self.dropped = self.dropped.wrapping_add(1);
        }
    }

    pub fn answer_any(&mut self, message: Option<Message>) {
        if let Some(message) = message {
            self.answer(message);
        }
    }

    /// Acknowledges a command to its sender.
    pub fn acknowledge(&mut self, command: u16, result: MavResult, to: Peer) {
        self.answer(Message::CommandAck(CommandAck {
            command,
            result,
            target_system: to.system_id,
            target_component: to.component_id,
        }));
    }

    /// Says a text, in as many messages as it needs.
    pub fn say(&mut self, severity: MavSeverity, text: &str) {
        let id = self.next_text_id();
        for message in status_texts(severity, text, id) {
            self.answer(Message::StatusText(message));
        }
    }

    /// The number of the next text, never 0.
    pub fn next_text_id(&mut self) -> u16 {
        *self.texts = self.texts.wrapping_add(1).max(1);
        *self.texts
    }

    /// Says why before the acknowledgement follows, for which there has to be room left.
    pub fn explain(&mut self, severity: MavSeverity, text: &str) {
        if self.outbox.room_for_replies() > chunks_of(text.len()) {
            self.say(severity, text);
        } else {
            *self.dropped = self.dropped.wrapping_add(1);
        }
    }
}
