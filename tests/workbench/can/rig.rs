//! An MCP2515 at SPI1, and its bus.

use std::cell::{RefCell, RefMut};
use std::rc::Rc;

use super::{Peer, Transfer};
use emulator::Board;
use emulator::can::{CanBus, CanNode, CanWires, SharedCanBus, Station, Traffic, bit_time};
use emulator::spi_devices::Mcp2515;

/// Chip select of the controller, and where its interrupt output leads.
pub const SELECT: usize = 13;
const INTERRUPT: usize = 17;

/// Decides which frames noise corrupts.
const SEED: u64 = 1;

/// What a test keeps of the controller and of the bus.
pub struct CanRig {
    pub bus: SharedCanBus,
    pub chip: Rc<RefCell<Mcp2515>>,
    bits_per_second: u64,
}

impl CanRig {
    /// Solders a controller with this crystal to the board, at a bus for nodes of this bit rate.
    pub fn new(board: &mut Board, crystal_hz: u64, bits_per_second: u64) -> Self {
        let bus = CanBus::new(SEED);
        let chip = Rc::new(RefCell::new(Mcp2515::new(crystal_hz, bus.clone())));
        let rig = Self {
            bus,
            chip,
            bits_per_second,
        };
        rig.plug(board);
        rig
    }

    /// Puts the controller onto the board's SPI bus, again.
    pub fn plug(&self, board: &mut Board) {
        board
            .spi1()
            .attach_with_interrupt(SELECT, INTERRUPT, Box::new(self.chip.clone()));
    }

    /// Takes it off the SPI bus; it stays at the CAN bus.
    pub fn unplug(&self, board: &mut Board) {
        board.spi1().detach(SELECT);
    }

    fn attach<N: CanNode + 'static>(&self, node: N) -> Rc<RefCell<N>> {
        let node = Rc::new(RefCell::new(node));
        self.bus.borrow_mut().attach(node.clone());
        node
    }

    /// Another node, at the rate of the bus.
    pub fn peer(&self) -> Peer {
        Peer::new(self.attach(Station::new(bit_time(self.bits_per_second))))
    }

    /// Other traffic that takes a share of the bus, from now on.
    pub fn traffic(&self, board: &Board, id: u32, share: f64) -> Rc<RefCell<Traffic>> {
        let bit = bit_time(self.bits_per_second);
        self.attach(Traffic::new(bit, id, share, board.time_cycles()))
    }

    /// The bus, as it is at the board's time.
    pub fn bus(&self, board: &mut Board) -> RefMut<'_, CanBus> {
        board.spi1();
        self.bus.borrow_mut()
    }

    /// Changes what the wires do, from now on.
    pub fn set_wires(&self, board: &mut Board, wires: CanWires) {
        self.bus(board).set_wires(wires);
    }

    /// Sends a transfer every `interval_us` until `until_us`, the first now, and lets the board run.
    pub fn run_with(
        &self,
        board: &mut Board,
        duration_us: u64,
        interval_us: u64,
        sent: &mut [(&mut Peer, &[Transfer])],
    ) {
        let end_us = board.time_us() + duration_us;
        while board.time_us() < end_us {
            let now_us = board.time_us();
            for (peer, transfers) in sent.iter_mut() {
                transfers.iter().for_each(|transfer| peer.send(now_us, *transfer));
            }
            board.run_until_time(end_us.min(now_us + interval_us));
        }
    }
}
