//! The air, which carries Ethernet frames between the board and the phones.

use std::cell::RefCell;
use std::collections::VecDeque;
use std::rc::Rc;
use std::task::{Context, Waker};

use embassy_net::driver::{Capabilities, Driver, HardwareAddress, LinkState, RxToken, TxToken};

pub const BOARD_MAC: [u8; 6] = [2, 0, 0, 0, 0, 1];

/// As many as the radio's driver has.
const BUFFERS: usize = 4;

pub const MTU: usize = 1514;

#[derive(Default)]
pub struct Air {
    to_board: VecDeque<Vec<u8>>,
    board: Option<Waker>,
    phones: Vec<([u8; 6], VecDeque<Vec<u8>>)>,
    is_up: bool,
}

pub type SharedAir = Rc<RefCell<Air>>;

impl Air {
    /// As an access point, the radio's driver never reports that its link is up.
    pub fn new(is_up: bool) -> SharedAir {
        Rc::new(RefCell::new(Self {
            is_up,
            ..Self::default()
        }))
    }

    pub fn join(&mut self, mac: [u8; 6]) {
        self.phones.push((mac, VecDeque::new()));
    }

    /// It is out of reach from now on.
    pub fn leave(&mut self, mac: [u8; 6]) {
        self.phones.retain(|(other, _)| *other != mac);
    }

    pub fn send_to_board(&mut self, frame: Vec<u8>) {
        // A frame that comes while all of the board's buffers are in use is lost.
        if self.to_board.len() < BUFFERS {
            self.to_board.push_back(frame);
        }
        if let Some(board) = self.board.take() {
            board.wake();
        }
    }

    pub fn next_for(&mut self, mac: [u8; 6]) -> Option<Vec<u8>> {
        let phone = self.phones.iter_mut().find(|(other, _)| *other == mac)?;
        phone.1.pop_front()
    }

    fn deliver(&mut self, frame: &[u8]) {
        for (mac, frames) in &mut self.phones {
            if frame[0] & 1 != 0 || frame[..6] == *mac {
                frames.push_back(frame.into());
            }
        }
    }
}

/// The board's radio.
pub struct BoardDevice(pub SharedAir);

/// The frame that came first; it stays with the radio until it is used.
pub struct Received(SharedAir);

pub struct Place(SharedAir);

impl RxToken for Received {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, use_frame: F) -> R {
        let frame = self.0.borrow_mut().to_board.pop_front();
        use_frame(&mut frame.expect("one waits"))
    }
}

impl TxToken for Place {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, write: F) -> R {
        let mut frame = vec![0; length];
        let result = write(&mut frame);
        self.0.borrow_mut().deliver(&frame);
        result
    }
}

impl Driver for BoardDevice {
    type RxToken<'a> = Received;
    type TxToken<'a> = Place;

    fn receive(&mut self, context: &mut Context<'_>) -> Option<(Received, Place)> {
        let mut air = self.0.borrow_mut();
        air.board = Some(context.waker().clone());
        (!air.to_board.is_empty()).then(|| (Received(self.0.clone()), Place(self.0.clone())))
    }

    fn transmit(&mut self, _: &mut Context<'_>) -> Option<Place> {
        Some(Place(self.0.clone()))
    }

    fn link_state(&mut self, _: &mut Context<'_>) -> LinkState {
        if self.0.borrow().is_up {
            LinkState::Up
        } else {
            LinkState::Down
        }
    }

    fn capabilities(&self) -> Capabilities {
        let mut capabilities = Capabilities::default();
        capabilities.max_transmission_unit = MTU;
        capabilities
    }

    fn hardware_address(&self) -> HardwareAddress {
        HardwareAddress::Ethernet(BOARD_MAC)
    }
}
