//! From the board's CAN bus to a program on the host: an adapter that speaks slcan, as Lawicel's CANUSB does, over TCP.

use std::cell::RefCell;
use std::rc::Rc;

use crate::port::Port;
use emulator::Board;
use emulator::can::{CanFrame, CanId, CanNode, CanWires, Station, Traffic, bit_time};
use workbench::can::CanRig;

/// Crystal of the controller: `CAN_P1_CRYSTAL` by default.
const CRYSTAL_HZ: u64 = 16_000_000;

/// Bit rates of the commands S0 to S8.
const RATES: [u64; 9] = [
    10_000, 20_000, 50_000, 100_000, 125_000, 250_000, 500_000, 800_000, 1_000_000,
];

const CHUNK_BYTES: usize = 4096;
const DONE: &[u8] = b"\r";
const REFUSED: &[u8] = b"\x07";
/// A frame is accepted.
const QUEUED: &[u8] = b"Z\r";

/// Wins against everything else: esc.RawCommand (1030) of node 1, of highest priority.
const TRAFFIC_ID: u32 = 0x0004_0601;

/// The bus, and the adapter at it.
pub struct CanAdapter {
    rig: CanRig,
    port: Port,
    station: Rc<RefCell<Station>>,
    traffic: Option<Rc<RefCell<Traffic>>>,
    bits_per_second: u64,
    /// Of a command that is not complete.
    line: Vec<u8>,
}

impl CanAdapter {
    /// Solders a controller to the board, with an adapter at its bus that waits for a program.
    pub fn solder(board: &mut Board, port: Port, bits_per_second: u64) -> Self {
        let rig = CanRig::new(board, CRYSTAL_HZ, bits_per_second);
        let station = rig.peer().station;
        station.borrow_mut().set_bit(None);
        Self {
            rig,
            port,
            station,
            traffic: None,
            bits_per_second,
            line: Vec::new(),
        }
    }

    /// Takes over what was sent, at both ends.
    pub fn exchange(&mut self, board: &mut Board) {
        if self.port.accept() {
            self.close();
        }
        for byte in self.port.read(CHUNK_BYTES) {
            match byte {
                b'\r' => self.obey(board),
                byte => self.line.push(byte),
            }
        }
        if !self.port.is_connected() {
            self.close();
        }
        let received = self.station.borrow_mut().take_received();
        for (_, frame) in received.iter().filter(|(_, frame)| !is_traffic(frame)) {
            self.port.write(&line_of(frame));
        }
        self.rig.bus.borrow_mut().take_records();
    }

    fn close(&mut self) {
        if self.station.borrow().attachment().is_some() {
            self.station.borrow_mut().set_bit(None);
        }
    }

    fn obey(&mut self, board: &mut Board) {
        let line = std::mem::take(&mut self.line);
        let answer = self.answer(board, &String::from_utf8_lossy(&line));
        self.port.write(answer);
    }

    fn answer(&mut self, board: &mut Board, line: &str) -> &'static [u8] {
        match line.split_at_checked(1) {
            None => DONE,
            Some(("C", _)) => {
                self.close();
                DONE
            }
            Some(("S", number)) => match number.parse().ok().and_then(|number: usize| RATES.get(number)) {
                Some(rate) => {
                    self.bits_per_second = *rate;
                    DONE
                }
                None => REFUSED,
            },
            Some(("O", _)) => {
                let bit = bit_time(self.bits_per_second);
                self.station.borrow_mut().set_bit(Some(bit));
                DONE
            }
            // No error flags.
            Some(("F", _)) => b"F00\r",
            Some(("T", rest)) => match frame_of(rest) {
                Some(frame) => {
                    self.station.borrow_mut().send(board.time_cycles(), frame);
                    QUEUED
                }
                None => REFUSED,
            },
            Some(_) => REFUSED,
        }
    }

    /// Makes trouble: `load 0.9`, `noise 0.1`, `wires shorted`.
    pub fn trouble(&mut self, board: &mut Board, words: &[&str]) {
        match words {
            ["load", share] => self.load(board, share.parse().unwrap_or(0.0)),
            ["noise", share] => self.rig.bus(board).set_noise(share.parse().unwrap_or(0.0)),
            ["wires", wires] => self.rig.set_wires(board, wires_of(wires)),
            _ => {}
        }
    }

    fn load(&mut self, board: &Board, share: f64) {
        let rig = &self.rig;
        let traffic = self
            .traffic
            .get_or_insert_with(|| rig.traffic(board, TRAFFIC_ID, share));
        traffic.borrow_mut().set_share(share);
    }
}

/// It is of no use to a program, which could not keep up with it.
fn is_traffic(frame: &CanFrame) -> bool {
    frame.id == CanId::Extended(TRAFFIC_ID)
}

fn wires_of(name: &str) -> CanWires {
    match name {
        "open" => CanWires::Open,
        "shorted" => CanWires::Shorted,
        "stuck" => CanWires::StuckDominant,
        _ => CanWires::Sound,
    }
}

/// `T`, identifier, number of bytes, bytes, all hexadecimal.
fn line_of(frame: &CanFrame) -> Vec<u8> {
    let mut line = match frame.id {
        CanId::Extended(id) => format!("T{id:08X}"),
        CanId::Standard(id) => format!("t{id:03X}"),
    };
    line.push_str(&frame.data.len().to_string());
    for byte in &frame.data {
        line.push_str(&format!("{byte:02X}"));
    }
    line.push('\r');
    line.into_bytes()
}

/// The frame of a line without its first letter.
fn frame_of(text: &str) -> Option<CanFrame> {
    let (id, rest) = text.split_at_checked(8)?;
    let id = u32::from_str_radix(id, 16).ok().filter(|id| *id < 1 << 29)?;
    let (length, rest) = rest.split_at_checked(1)?;
    let length: usize = length.parse().ok().filter(|length| *length <= 8)?;
    let byte = |number: usize| u8::from_str_radix(rest.get(2 * number..2 * number + 2)?, 16).ok();
    let data: Option<Vec<u8>> = (0..length).map(byte).collect();
    Some(CanFrame::extended(id, &data?))
}
