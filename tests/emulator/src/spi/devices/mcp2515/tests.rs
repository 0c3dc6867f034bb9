//! Tests against the figures of DS20001801J.

use std::cell::RefCell;
use std::rc::Rc;

use super::super::super::super::can::{CanBus, CanFrame, CanWires, ErrorState, Station, bit_time};
use super::super::super::super::clock::{Cycle, cycles};
use super::*;

const CRYSTAL_HZ: u64 = 16_000_000;
const CLOCK: SpiClock = SpiClock {
    mode: SpiMode::Mode0,
    hz: 1_000_000,
};
/// 500 kbit/s: 16 quanta of 125 ns, sampled behind the tenth.
const CNF: [u8; 3] = [0x05, 0xb1, 0x00];
const BIT: Cycle = bit_time(500_000);
/// 11 recessive bits, and some.
const JOINED: Cycle = cycles(30);

/// A controller whose SPI a test uses, and another node at its bus.
struct Rig {
    chip: Mcp2515,
    bus: SharedCanBus,
    peer: Rc<RefCell<Station>>,
    now: Cycle,
}

impl Rig {
    /// In configuration mode, with its oscillator running.
    fn new() -> Self {
        let bus = CanBus::new(1);
        let peer = Rc::new(RefCell::new(Station::new(BIT)));
        bus.borrow_mut().attach(peer.clone());
        let mut rig = Self {
            chip: Mcp2515::new(CRYSTAL_HZ, bus.clone()),
            bus,
            peer,
            now: 0,
        };
        rig.pass(cycles(1000));
        rig
    }

    /// In normal mode, at 500 kbit/s, receiving everything.
    fn at_bus() -> Self {
        let mut rig = Self::new();
        rig.frame(&[&[WRITE, CNF3], &CNF[..]].concat());
        for control in RXB_CTRL {
            rig.frame(&[WRITE, control, RXM]);
        }
        rig.frame(&[WRITE, CANINTE, 0xff]);
        rig.request(Mode::Normal);
        rig.pass(JOINED);
        assert_eq!(rig.read(CANSTAT) >> 5, 0);
        rig
    }

    fn request(&mut self, mode: Mode) {
        self.frame(&[BIT_MODIFY, CANCTRL, 0xe0, mode.opmod()]);
    }

    fn pass(&mut self, length: Cycle) {
        self.now += length;
        self.chip.advance(self.now);
    }

    fn frame_at(&mut self, bytes: &[u8], clock: SpiClock) -> Vec<Option<u8>> {
        self.chip.select();
        let answer = bytes
            .iter()
            .map(|&byte| self.chip.exchange(byte, clock))
            .collect();
        self.chip.deselect();
        self.pass(cycles(8 * bytes.len() as u64));
        answer
    }

    /// What it drives, and zeros.
    fn frame(&mut self, bytes: &[u8]) -> Vec<u8> {
        let answer = self.frame_at(bytes, CLOCK);
        answer.into_iter().map(Option::unwrap_or_default).collect()
    }

    fn read(&mut self, address: u8) -> u8 {
        self.frame(&[READ, address, 0])[2]
    }

    fn load(&mut self, buffer: u8, id: u32, data: &[u8]) {
        let header = [LOAD_TX_BUFFER | buffer << 1];
        self.frame(&[&header[..], &pattern(id), &[data.len() as u8], data].concat());
    }

    fn send(&mut self, buffer: u8, id: u32, data: &[u8]) {
        self.load(buffer, id, data);
        self.frame(&[REQUEST_TO_SEND | 1 << buffer]);
    }

    /// The peer sends a frame, which is through.
    fn hear(&mut self, frame: CanFrame) {
        self.peer.borrow_mut().send(self.now, frame);
        self.pass(cycles(500));
    }

    fn filters(&mut self, address: u8, patterns: &[[u8; 4]]) {
        for (number, pattern) in patterns.iter().enumerate() {
            self.frame(&[&[WRITE, address + 4 * number as u8], &pattern[..]].concat());
        }
    }
}

/// The four registers of an extended identifier.
fn pattern(id: u32) -> [u8; 4] {
    [
        (id >> 21) as u8,
        (id >> 13) as u8 & 0xe0 | EXIDE | (id >> 16) as u8 & 3,
        (id >> 8) as u8,
        id as u8,
    ]
}

#[test]
fn after_reset_it_is_in_configuration_mode() {
    let mut rig = Rig::at_bus();
    rig.chip.select();
    rig.chip.exchange(RESET, CLOCK);
    rig.chip.deselect();
    assert_eq!(
        rig.frame_at(&[READ, CANSTAT, 0], CLOCK),
        [None; 3],
        "its oscillator starts"
    );
    assert_eq!(
        rig.frame(&[READ, CANSTAT, 0, 0])[2..],
        [0x80, 0x87],
        "CANSTAT, CANCTRL"
    );
    assert_eq!(rig.read(0x3f), 0x87, "CANCTRL is at all XFh");
    assert_eq!(rig.frame(&[READ, CNF3, 0, 0, 0, 0, 0, 0])[2..], [0; 6]);
}

#[test]
fn reading_and_writing_go_on_at_the_next_address() {
    let mut rig = Rig::new();
    rig.frame(&[WRITE, CNF3, 1, 2, 3]);
    assert_eq!(rig.frame(&[READ, CNF3, 0, 0, 0]), [0, 0, 1, 2, 3]);
}

#[test]
fn bit_modify_changes_the_bits_of_its_mask_where_it_may() {
    let mut rig = Rig::new();
    rig.frame(&[WRITE, CANINTE, 0b1010_0000]);
    // Figure 12-1: mask 00110101, data XX10X0X1.
    rig.frame(&[BIT_MODIFY, CANINTE, 0b0011_0101, 0b0010_0001]);
    assert_eq!(rig.read(CANINTE), 0b1010_0001);
    rig.frame(&[WRITE, 0x36, 0xf0]);
    rig.frame(&[BIT_MODIFY, 0x36, 0x0f, 0x55]);
    assert_eq!(rig.read(0x36), 0x55, "TXB0D0 is not one of them");
}

#[test]
fn configuration_registers_are_closed_in_other_modes() {
    let mut rig = Rig::new();
    rig.filters(MASKS[0], &[[0x12, 0xe3, 0x34, 0x56]]);
    assert_eq!(rig.read(MASKS[0]), 0x12);
    let mut rig = Rig::at_bus();
    rig.frame(&[WRITE, CNF3, 0]);
    assert_eq!(rig.read(CNF3), CNF[0]);
    assert_eq!(rig.chip.ignored_writes(), 1);
    assert_eq!(rig.read(MASKS[0]), 0, "reads zero");
    rig.request(Mode::Configuration);
    assert_eq!(rig.read(CANSTAT) >> 5, 4);
}

#[test]
fn it_joins_the_bus_after_eleven_recessive_bits() {
    let mut rig = Rig::new();
    rig.frame(&[&[WRITE, CNF3], &CNF[..]].concat());
    assert_eq!(rig.chip.bits_per_second(), Some(500_000));
    rig.chip.controller_mut().modify(CANCTRL, 0xe0, 0);
    rig.pass(10 * BIT);
    assert_eq!(rig.chip.register(CANSTAT) >> 5, 4);
    rig.pass(BIT);
    assert_eq!(rig.chip.register(CANSTAT) >> 5, 0);
}

#[test]
fn a_loaded_buffer_is_sent_on_request_and_flagged() {
    let mut rig = Rig::at_bus();
    rig.load(1, 0x1234_5678, &[1, 2, 3, 4, 5]);
    rig.pass(cycles(1000));
    assert!(rig.peer.borrow_mut().take_received().is_empty());
    rig.frame(&[REQUEST_TO_SEND | 0b010]);
    assert_eq!(rig.frame(&[READ_STATUS, 0])[1], 1 << 4, "TXB1 TXREQ");
    assert_eq!(rig.chip.interrupt_level(), Some(true));
    rig.pass(cycles(500));
    let received = rig.peer.borrow_mut().take_received();
    assert_eq!(received[0].1, CanFrame::extended(0x1234_5678, &[1, 2, 3, 4, 5]));
    assert_eq!(rig.frame(&[READ_STATUS, 0])[1], 1 << 5, "TX1IF");
    assert_eq!(rig.chip.interrupt_level(), Some(false));
    assert_eq!(rig.read(CANSTAT) & 0xe, 0b100 << 1, "ICOD: TXB1");
    rig.frame(&[BIT_MODIFY, CANINTF, TXIF[1], 0]);
    assert_eq!(rig.chip.interrupt_level(), Some(true));
}

#[test]
fn the_higher_priority_is_sent_first_then_the_higher_number() {
    let mut rig = Rig::at_bus();
    for buffer in 0..3 {
        rig.load(buffer, 10 + u32::from(buffer), &[]);
    }
    rig.frame(&[BIT_MODIFY, TXB_CTRL[1], TXP, 0b01]);
    rig.frame(&[REQUEST_TO_SEND | 0b111]);
    rig.pass(cycles(2000));
    let sent = rig.peer.borrow_mut().take_received();
    let ids: Vec<_> = sent.into_iter().map(|(_, frame)| frame).collect();
    assert_eq!(ids, [11, 12, 10].map(|id| CanFrame::extended(id, &[])));
}

#[test]
fn a_buffer_that_waits_can_not_be_changed_but_given_up() {
    let mut rig = Rig::at_bus();
    rig.peer.borrow_mut().set_bit(None);
    rig.send(0, 7, &[1]);
    rig.frame(&[WRITE, 0x36, 9]);
    assert_eq!((rig.read(0x36), rig.chip.ignored_writes()), (1, 1));
    rig.send(1, 8, &[1]);
    for control in &TXB_CTRL[..2] {
        rig.frame(&[BIT_MODIFY, *control, TXREQ, 0]);
    }
    rig.pass(cycles(1000));
    for control in &TXB_CTRL[..2] {
        assert_eq!(rig.read(*control) & (TXREQ | ABTF), ABTF);
    }
}

#[test]
fn what_is_received_is_read_and_released_by_one_instruction() {
    let mut rig = Rig::at_bus();
    rig.hear(CanFrame::extended(0x1234_5678, &[9, 8, 7]));
    assert_eq!(rig.chip.interrupt_level(), Some(false));
    assert_eq!(rig.frame(&[READ_STATUS, 0])[1], 1);
    let read = rig.frame(&[READ_RX_BUFFER, 0, 0, 0, 0, 0, 0, 0, 0]);
    assert_eq!(read[1..], [&pattern(0x1234_5678)[..], &[3, 9, 8, 7]].concat());
    assert_eq!(rig.frame(&[READ_STATUS, 0])[1], 0);
    assert_eq!(rig.chip.interrupt_level(), Some(true));
    rig.hear(CanFrame::standard(0x123, &[5]));
    assert_eq!(rig.read(RXB_CTRL[0] + 2) & EXIDE, 0, "standard");
    assert_eq!(rig.frame(&[READ_RX_BUFFER | 1 << 1, 0])[1], 5, "from the data on");
}

#[test]
fn a_second_frame_rolls_over_and_a_third_is_lost() {
    let mut rig = Rig::at_bus();
    rig.frame(&[WRITE, RXB_CTRL[0], RXM | BUKT]);
    assert_eq!(rig.read(RXB_CTRL[0]) & 0b110, 0b110, "BUKT1 shows BUKT");
    (1..=3).for_each(|id| rig.hear(CanFrame::extended(id, &[])));
    assert_eq!(rig.read(CANINTF) & 0b11, 0b11);
    assert_eq!((rig.read(EFLG), rig.chip.lost_frames()), (RXOVR[1], 1));
    assert_ne!(rig.read(CANINTF) & ERRIF, 0);
    rig.frame(&[BIT_MODIFY, EFLG, 0xff, 0]);
    assert_eq!(rig.read(EFLG), 0);
    rig.frame(&[READ_RX_BUFFER, 0]);
    assert_eq!(rig.read(CANINTF) & 0b11, 0b10);
    assert_eq!(rig.read(RXB_CTRL[1]) & 0b111, 0, "RXF0, rolled over");
}

#[test]
fn without_rollover_a_full_first_buffer_loses_frames() {
    let mut rig = Rig::at_bus();
    (1..=2).for_each(|id| rig.hear(CanFrame::extended(id, &[])));
    assert_eq!((rig.read(EFLG), rig.read(CANINTF) & 0b11), (RXOVR[0], 0b01));
}

#[test]
fn masks_and_filters_decide_which_buffer_a_frame_reaches() {
    let mut rig = Rig::new();
    rig.frame(&[&[WRITE, CNF3], &CNF[..]].concat());
    rig.filters(MASKS[0], &[pattern(0x00ff_ff00), pattern(0x1fff_ffff)]);
    rig.filters(
        FILTERS[0],
        &[pattern(0x0001_2300), pattern(0x0004_5600), pattern(1)],
    );
    rig.filters(FILTERS[3], &[pattern(2), pattern(3), [0, 0, 0, 0]]);
    rig.request(Mode::Normal);
    rig.pass(JOINED);
    for (frame, buffer, filter) in [
        (CanFrame::extended(0x1901_23ff, &[]), RXIF[0], 0),
        (CanFrame::extended(0x0004_5601, &[]), RXIF[0], 1),
        (CanFrame::extended(0x0004_5701, &[]), 0, 0),
        (CanFrame::extended(3, &[]), RXIF[1], 4),
        (CanFrame::extended(4, &[]), 0, 0),
        // The last filter is of standard identifiers.
        (CanFrame::standard(0, &[]), RXIF[1], 5),
        (CanFrame::standard(1, &[]), 0, 0),
    ] {
        rig.hear(frame.clone());
        let flags = rig.read(CANINTF) & 0b11;
        let hit = match flags {
            0b01 => rig.read(RXB_CTRL[0]) & 1,
            0b10 => rig.read(RXB_CTRL[1]) & 0b111,
            _ => 0,
        };
        assert_eq!((flags, hit), (buffer, filter), "{frame:?}");
        rig.frame(&[BIT_MODIFY, CANINTF, 0b11, 0]);
    }
}

#[test]
fn alone_at_the_bus_it_warns_and_becomes_passive() {
    let mut rig = Rig::at_bus();
    rig.peer.borrow_mut().set_bit(None);
    rig.send(0, 5, &[]);
    rig.pass(cycles(100_000));
    assert_eq!((rig.read(TEC), rig.read(REC)), (128, 0));
    assert_eq!(rig.read(EFLG), EWARN | TXWAR | TXEP);
    assert_eq!(rig.read(CANINTF), ERRIF | MERRF);
    assert_eq!(rig.read(TXB_CTRL[0]), TXREQ | TXERR);
    rig.request(Mode::Configuration);
    assert_eq!(rig.read(CANSTAT) >> 5, 0, "a frame is pending");
    rig.frame(&[BIT_MODIFY, TXB_CTRL[0], TXREQ, 0]);
    rig.pass(cycles(1000));
    assert_eq!((rig.read(CANSTAT) >> 5, rig.read(TEC), rig.read(EFLG)), (4, 0, 0));
}

#[test]
fn shorted_wires_switch_it_off_and_it_comes_back() {
    let mut rig = Rig::at_bus();
    rig.bus.borrow_mut().set_wires(CanWires::Shorted);
    rig.send(0, 5, &[]);
    rig.pass(cycles(2000));
    assert_eq!(rig.chip.error_state(), ErrorState::BusOff);
    assert_ne!(rig.read(EFLG) & TXBO, 0);
    rig.bus.borrow_mut().set_wires(CanWires::Sound);
    rig.pass(128 * 11 * BIT);
    assert_eq!((rig.chip.error_state(), rig.read(EFLG)), (ErrorState::Active, 0));
    rig.pass(cycles(500));
    assert_eq!(
        rig.peer.borrow_mut().take_received().len(),
        1,
        "it is sent after all"
    );
}

#[test]
fn lost_arbitration_is_noted_and_the_frame_follows() {
    let mut rig = Rig::at_bus();
    rig.load(0, 500, &[]);
    rig.frame(&[WRITE, TXB_CTRL[0], 0]);
    let at = rig.now + cycles(300);
    rig.peer
        .borrow_mut()
        .send(at - cycles(100), CanFrame::extended(3, &[0; 8]));
    rig.peer.borrow_mut().send(at, CanFrame::extended(4, &[0; 8]));
    rig.pass(cycles(250));
    rig.frame(&[REQUEST_TO_SEND | 1]);
    rig.pass(cycles(300));
    assert_eq!(rig.read(TXB_CTRL[0]), TXREQ | MLOA);
    rig.pass(cycles(500));
    assert_eq!(rig.read(TXB_CTRL[0]), 0);
}

#[test]
#[should_panic(expected = "mode 2 of the MCP2515 is not modelled")]
fn loopback_is_refused() {
    Rig::at_bus().frame(&[BIT_MODIFY, CANCTRL, 0xe0, 2 << 5]);
}

#[test]
fn it_understands_modes_0_and_3_up_to_10_mhz() {
    for (mode, hz, answer) in [
        (SpiMode::Mode0, 10_000_000, Some(0x80)),
        (SpiMode::Mode3, 10_000_000, Some(0x80)),
        (SpiMode::Mode0, 10_000_001, None),
        (SpiMode::Mode1, 1_000_000, None),
        (SpiMode::Mode2, 1_000_000, None),
    ] {
        let mut rig = Rig::new();
        let read = rig.frame_at(&[READ, CANSTAT, 0], SpiClock { mode, hz });
        assert_eq!(read[2], answer, "{mode:?} {hz}");
    }
}

#[test]
fn without_supply_it_drives_nothing_and_is_off_the_bus() {
    let mut rig = Rig::at_bus();
    rig.chip.set_powered(false);
    assert_eq!(rig.frame_at(&[READ, CANSTAT, 0], CLOCK), [None; 3]);
    assert_eq!(rig.chip.interrupt_level(), None);
    rig.hear(CanFrame::extended(1, &[]));
    assert_eq!(rig.peer.borrow().waiting(), 1);
    rig.chip.set_powered(true);
    rig.pass(cycles(20));
    assert_eq!(rig.read(CANSTAT), 0x80, "configuration mode");
}
