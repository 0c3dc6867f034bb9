//! The host's side of a serial port (CDC ACM): its pipes, and the program that has it open.

use std::collections::VecDeque;

use super::super::clock::Cycle;
use super::super::uart::SentByte;
use super::bus::{Delivery, Endpoint, Handshake, Sent, Toggle, transaction_time};
use super::control::TRIES;
use super::controller::Controller;

const PACKET_BYTES: usize = 64;

/// A pipe of bulk packets.
#[derive(Clone, Default)]
struct Pipe {
    number: u8,
    toggle: Toggle,
    /// Transactions in a row without an answer. After [`TRIES`] the host uses the pipe no more.
    silent: u32,
    /// The device was not ready in this frame.
    waits: bool,
}

impl Pipe {
    fn of(number: u8) -> Self {
        Self {
            number,
            ..Self::default()
        }
    }

    fn is_ready(&self) -> bool {
        !self.waits && self.silent < TRIES
    }

    fn not_answered(&mut self) {
        self.silent += 1;
    }

    fn moved(&mut self) {
        self.silent = 0;
        self.toggle = self.toggle.flipped();
    }
}

/// What a program does with the port that it has open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reading {
    #[default]
    Reads,
    Stalls,
}

#[derive(Clone, Default)]
pub struct SerialPort {
    input: Pipe,
    output: Pipe,
    pub is_open: bool,
    pub reading: Reading,
    to_send: VecDeque<Vec<u8>>,
    received: Vec<SentByte>,
}

impl SerialPort {
    /// The device was configured: its pipes begin with DATA0.
    pub fn configure(&mut self, input: u8, output: u8) {
        self.input = Pipe::of(input);
        self.output = Pipe::of(output);
    }

    /// The device is gone, and with it what was not sent.
    pub fn detach(&mut self) {
        self.is_open = false;
        self.to_send.clear();
    }

    pub fn send(&mut self, bytes: &[u8]) {
        self.to_send
            .extend(bytes.chunks(PACKET_BYTES).map(<[u8]>::to_vec));
    }

    pub fn take_received(&mut self) -> Vec<SentByte> {
        std::mem::take(&mut self.received)
    }

    /// Packets the device has not taken yet.
    pub fn unsent(&self) -> usize {
        self.to_send.len()
    }

    pub fn begin_frame(&mut self) {
        self.input.waits = false;
        self.output.waits = false;
    }

    /// One transaction, if there is one to be done. Returns how many bytes of data it took.
    pub fn transact(
        &mut self,
        address: u8,
        delivery: Delivery,
        controller: &mut Controller,
        now: Cycle,
    ) -> Option<usize> {
        if !self.is_open {
            return None;
        }
        if self.output.is_ready()
            && let Some(packet) = self.to_send.front()
        {
            let length = packet.len();
            self.send_packet(address, controller);
            return Some(length);
        }
        if self.input.is_ready() && self.reading == Reading::Reads {
            return Some(self.receive_packet(address, delivery, controller, now));
        }
        None
    }

    fn send_packet(&mut self, address: u8, controller: &mut Controller) {
        let Some(packet) = self.to_send.front() else {
            return;
        };
        let number = self.output.number;
        match controller.output(Endpoint { address, number }, self.output.toggle, packet) {
            Some(Handshake::Ack) => {
                self.to_send.pop_front();
                self.output.moved();
            }
            Some(_) => self.output.waits = true,
            None => self.output.not_answered(),
        }
    }

    fn receive_packet(
        &mut self,
        address: u8,
        delivery: Delivery,
        controller: &mut Controller,
        now: Cycle,
    ) -> usize {
        let number = self.input.number;
        match controller.input(Endpoint { address, number }, delivery) {
            Some(Sent::Data(toggle, bytes)) => {
                if toggle == self.input.toggle {
                    self.input.moved();
                    self.take(&bytes, now);
                }
                bytes.len()
            }
            Some(_) => {
                self.input.waits = true;
                0
            }
            None => {
                self.input.not_answered();
                0
            }
        }
    }

    fn take(&mut self, bytes: &[u8], start: Cycle) {
        let end = start + transaction_time(bytes.len());
        let received = bytes.iter().map(|&byte| SentByte { byte, start, end });
        self.received.extend(received);
    }
}
