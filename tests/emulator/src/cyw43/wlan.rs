//! What the program of the WLAN core does once it runs: packets from and to the driver, after the time that it takes.

use std::collections::VecDeque;

use super::super::clock::{Cycle, NEVER, cycles};
use super::air::Air;
use super::control::{Context, Control};
use super::events::Event;
use super::radio::Radio;
use super::sdpcm::{Channel, Packet, Received, Sdpcm};

/// Until a control message is answered.
const ANSWER_AFTER: Cycle = cycles(200);
/// Until a frame from the air has been received.
const FRAME_AFTER: Cycle = cycles(300);
/// Frames that wait for the driver.
const FRAMES: usize = 16;

#[derive(Clone)]
pub struct Wlan {
    address: [u8; 6],
    sdpcm: Sdpcm,
    control: Control,
    pub radio: Radio,
    to_come: VecDeque<(Cycle, Packet)>,
    waiting: VecDeque<Packet>,
}

impl Wlan {
    pub fn new(address: [u8; 6]) -> Self {
        Self {
            address,
            sdpcm: Sdpcm::new(),
            control: Control::default(),
            radio: Radio::default(),
            to_come: VecDeque::new(),
            waiting: VecDeque::new(),
        }
    }

    /// The length of the packet that waits for the driver.
    pub fn waiting_bytes(&self) -> Option<usize> {
        self.waiting.front().map(Packet::bytes)
    }

    /// The next packet for the driver.
    pub fn take_waiting(&mut self) -> Option<Vec<u8>> {
        let packet = self.waiting.pop_front()?;
        Some(self.sdpcm.framed(&packet))
    }

    /// A packet from the driver.
    pub fn receive(&mut self, bytes: &[u8], air: &mut Air, now: Cycle) {
        match self.sdpcm.received(bytes) {
            Some(Received::Control(message)) => self.receive_control(&message, now),
            Some(Received::Frame(frame)) if self.radio.has_network() => air.sent.push(frame),
            Some(Received::Frame(_)) | None => {}
        }
        if self.sdpcm.has_few_credits() && self.waiting.is_empty() && self.to_come.is_empty() {
            self.queue(Packet::control(Vec::new()), now + ANSWER_AFTER);
        }
    }

    fn receive_control(&mut self, message: &[u8], now: Cycle) {
        let mut context = Context {
            radio: &mut self.radio,
            address: self.address,
            now,
        };
        if let Some(answer) = self.control.answer(message, &mut context) {
            self.queue(Packet::control(answer), now + ANSWER_AFTER);
        }
        self.queue_events(now);
    }

    /// A frame from the air; false when there is no place for it, or no network.
    pub fn receive_frame(&mut self, frame: &[u8], now: Cycle) -> bool {
        let queued = self.to_come.iter().map(|(_, packet)| packet).chain(&self.waiting);
        let frames = queued.filter(|packet| packet.channel == Channel::Data).count();
        let is_taken = frames < FRAMES && self.radio.has_network();
        if is_taken {
            self.queue(Packet::frame(frame), now + FRAME_AFTER);
        }
        is_taken
    }

    /// Something has come from the air that the driver may want to hear of.
    pub fn emit(&mut self, event: Event, now: Cycle) {
        self.radio.push(event);
        self.queue_events(now);
    }

    /// A network is no longer in range.
    pub fn lose(&mut self, ssid: &str, now: Cycle) {
        self.radio.lose(ssid);
        self.queue_events(now);
    }

    /// The network excludes the station.
    pub fn deauthenticated(&mut self, now: Cycle) {
        self.radio.deauthenticated();
        self.queue_events(now);
    }

    fn queue_events(&mut self, now: Cycle) {
        for event in self.radio.take_events() {
            if self.control.mask.wants(event.kind) {
                let packet = Packet::event(&event.frame(self.address));
                self.queue(packet, now + ANSWER_AFTER);
            }
        }
    }

    /// In the order in which they were queued.
    fn queue(&mut self, packet: Packet, due: Cycle) {
        let earliest = self.to_come.back().map_or(0, |&(due, _)| due);
        self.to_come.push_back((due.max(earliest), packet));
    }

    pub fn next_event(&self) -> Cycle {
        let packet = self.to_come.front().map(|&(due, _)| due);
        packet
            .unwrap_or(NEVER)
            .min(self.radio.next_event().unwrap_or(NEVER))
    }

    pub fn advance(&mut self, air: &Air, now: Cycle) {
        self.radio.advance(air, now);
        self.queue_events(now);
        while let Some((_, packet)) = self.to_come.pop_front_if(|(due, _)| *due <= now) {
            self.waiting.push_back(packet);
        }
    }
}
