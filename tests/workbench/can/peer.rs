//! A node that sends transfers, and keeps what it hears.

use std::cell::RefCell;
use std::collections::BTreeMap;
use std::rc::Rc;

use super::Transfer;
use emulator::can::{CanFrame, CanId, Station};

/// Of the tail byte: the transfer id, and the start of a transfer (DroneCAN specification, 4.1.4.1).
const TRANSFER_ID: u8 = 0x1f;
const CYCLES_PER_US: u64 = 125;

pub struct Peer {
    pub station: Rc<RefCell<Station>>,
    /// How many transfers of each identifier were sent: that is the next transfer id.
    sent: BTreeMap<u32, u8>,
}

impl Peer {
    pub fn new(station: Rc<RefCell<Station>>) -> Self {
        Self {
            station,
            sent: BTreeMap::new(),
        }
    }

    /// Sends a transfer from `at_us` on, with the transfer id that follows that of the one before.
    pub fn send(&mut self, at_us: u64, transfer: Transfer) {
        let number = self.sent.entry(transfer.0[0].0).or_default();
        let transfer_id = *number & TRANSFER_ID;
        *number = number.wrapping_add(1);
        for (id, data) in transfer.0 {
            self.send_frame(at_us, *id, &with_transfer_id(data, transfer_id));
        }
    }

    /// Sends a frame as it is.
    pub fn send_frame(&mut self, at_us: u64, id: u32, data: &[u8]) {
        let frame = CanFrame::extended(id, data);
        self.station.borrow_mut().send(at_us * CYCLES_PER_US, frame);
    }

    /// The frames with extended identifiers that it has heard since this was asked last: time in us, identifier, data.
    pub fn take_received(&mut self) -> Vec<(u64, u32, Vec<u8>)> {
        let received = self.station.borrow_mut().take_received();
        let extended = |(at, frame): (u64, CanFrame)| match frame.id {
            CanId::Extended(id) => Some((at / CYCLES_PER_US, id, frame.data)),
            CanId::Standard(_) => None,
        };
        received.into_iter().filter_map(extended).collect()
    }
}

fn with_transfer_id(data: &[u8], transfer_id: u8) -> Vec<u8> {
    let mut data = data.to_vec();
    if let Some(tail) = data.last_mut() {
        *tail = *tail & !TRANSFER_ID | transfer_id;
    }
    data
}
