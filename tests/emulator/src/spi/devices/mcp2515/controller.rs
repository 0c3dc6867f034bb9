//! The registers, and the node at the bus that they stand for.

use super::super::super::super::can::{CanFrame, CanId, CanNode, Confinement, ErrorState};
use super::super::super::super::clock::{CLK_SYS_HZ, Cycle};
use super::super::super::super::random::Random;
use super::acceptance::{Destination, destination};
use super::registers::*;
use super::timing::Timing;

/// 8.1: the oscillator start-up timer, in cycles of the crystal.
const START_UP: u64 = 128;
/// 7.6.2 and 7.6.3.
const WARNING: u16 = 96;
const PASSIVE: u16 = 128;

pub struct Controller {
    crystal_hz: u64,
    registers: [u8; 128],
    mode: Mode,
    confinement: Confinement,
    is_powered: bool,
    now: Cycle,
    /// When the oscillator runs.
    starts_at: Cycle,
    /// The buffer that is being sent.
    sending: Option<usize>,
    pub lost: u64,
    pub ignored_writes: u64,
}

impl Controller {
    pub fn new(crystal_hz: u64) -> Self {
        let mut controller = Self {
            crystal_hz,
            registers: [0; 128],
            mode: Mode::Configuration,
            confinement: Confinement::default(),
            is_powered: true,
            now: 0,
            starts_at: 0,
            sending: None,
            lost: 0,
            ignored_writes: 0,
        };
        controller.reset();
        controller
    }

    pub fn reset(&mut self) {
        Random::new(self.now ^ 0x2515).fill(&mut self.registers);
        for address in [BFPCTRL, TXRTSCTRL]
            .into_iter()
            .chain(CNF3..=EFLG)
            .chain(TXB_CTRL)
            .chain(RXB_CTRL)
        {
            self.set(address, 0);
        }
        self.set(CANCTRL, CANCTRL_AFTER_RESET);
        self.mode = Mode::Configuration;
        self.confinement = Confinement::default();
        self.sending = None;
        self.starts_at = self.now + START_UP * CLK_SYS_HZ / self.crystal_hz;
    }

    pub fn power(&mut self, is_powered: bool) {
        self.is_powered = is_powered;
        self.reset();
    }

    pub fn pass_time(&mut self, now: Cycle) {
        self.now = self.now.max(now);
    }

    pub fn is_starting(&self) -> bool {
        self.now < self.starts_at
    }

    pub fn timing(&self) -> Timing {
        Timing::of(&self.registers, self.crystal_hz)
    }

    fn at(&self, address: u8) -> u8 {
        self.registers[usize::from(address)]
    }

    fn set(&mut self, address: u8, value: u8) {
        self.registers[usize::from(address)] = value;
    }

    fn flag(&mut self, flags: u8) {
        self.set(CANINTF, self.at(CANINTF) | flags);
    }

    /// Whether INT is low.
    pub fn interrupts(&self) -> bool {
        self.is_powered && self.at(CANINTF) & self.at(CANINTE) != 0
    }

    // ----- Instructions -------------------------------------------------------------------------

    pub fn read(&self, address: u8) -> u8 {
        match address {
            _ if address & 0xf == CANSTAT => self.opmod() | self.interrupt_code() << 1,
            _ if address & 0xf == CANCTRL => self.at(CANCTRL),
            TEC => self.confinement.transmit_errors().min(255) as u8,
            REC => self.confinement.receive_errors().min(255) as u8,
            EFLG => self.at(EFLG) | self.error_flags(),
            // Masks and filters read zero in other modes (4.5).
            _ if is_filter_or_mask(address) && self.mode != Mode::Configuration => 0,
            _ if address == RXB_CTRL[0] => self.at(address) | (self.at(address) & BUKT) >> 1,
            _ => self.at(address),
        }
    }

    pub fn write(&mut self, address: u8, value: u8) {
        self.modify_bits(address, 0xff, value);
    }

    pub fn modify(&mut self, address: u8, mask: u8, value: u8) {
        let mask = if is_bit_modifiable(address) { mask } else { 0xff };
        self.modify_bits(address, mask, value);
    }

    fn modify_bits(&mut self, address: u8, mask: u8, value: u8) {
        let is_closed = is_configuration(address) && self.mode != Mode::Configuration;
        let is_being_sent = |buffer: usize| self.at(TXB_CTRL[buffer]) & TXREQ != 0;
        if is_closed || transmit_buffer(address).is_some_and(is_being_sent) {
            self.ignored_writes += 1;
            return;
        }
        let address = if address & 0xf == CANCTRL {
            CANCTRL
        } else {
            address
        };
        let mask = mask & writable(address);
        let before = self.at(address);
        let after = before & !mask | value & mask;
        match TXB_CTRL.iter().position(|control| *control == address) {
            Some(buffer) => self.control_transmission(buffer, before, after),
            None => self.set(address, after),
        }
        self.obey_control();
    }

    /// The mode that is requested.
    fn obey_control(&mut self) {
        assert!(
            self.at(CANCTRL) & NOT_MODELLED == 0,
            "ABAT and OSM of the MCP2515 are not modelled"
        );
        let requested = Mode::requested(self.at(CANCTRL));
        // "The mode will not actually change until all pending message transmissions are complete" (10).
        if requested != self.mode && !self.is_sending_or_pending() {
            self.mode = requested;
            // Configuration clears the error counters (10.1).
            self.confinement = Confinement::default();
        }
    }

    fn is_sending_or_pending(&self) -> bool {
        TXB_CTRL.iter().any(|control| self.at(*control) & TXREQ != 0) || self.sending.is_some()
    }

    fn opmod(&self) -> u8 {
        let has_joined = self.confinement.state() != ErrorState::Joining;
        match self.mode {
            Mode::Normal if !has_joined => Mode::Configuration.opmod(),
            mode => mode.opmod(),
        }
    }

    /// ICOD: the first of these that is flagged and enabled (7.1, table 7-1).
    fn interrupt_code(&self) -> u8 {
        let pending = self.at(CANINTF) & self.at(CANINTE);
        let order = [ERRIF, WAKIF, TXIF[0], TXIF[1], TXIF[2], RXIF[0], RXIF[1]];
        let first = order.iter().position(|flag| pending & flag != 0);
        first.map_or(0, |first| first as u8 + 1)
    }

    /// Figure 12-8.
    pub fn read_status(&self) -> u8 {
        let flags = self.at(CANINTF);
        let transmit = |buffer: usize| {
            let requested = u8::from(self.at(TXB_CTRL[buffer]) & TXREQ != 0);
            let sent = u8::from(flags & TXIF[buffer] != 0);
            (requested | sent << 1) << (2 + 2 * buffer)
        };
        flags & 0b11 | transmit(0) | transmit(1) | transmit(2)
    }

    /// The end of READ RX BUFFER.
    pub fn release(&mut self, buffer: usize) {
        self.set(CANINTF, self.at(CANINTF) & !RXIF[buffer]);
    }

    // ----- Transmission -------------------------------------------------------------------------

    pub fn request_to_send(&mut self, buffers: u8) {
        for (buffer, control) in TXB_CTRL.into_iter().enumerate() {
            if buffers >> buffer & 1 != 0 {
                let before = self.at(control);
                self.control_transmission(buffer, before, before | TXREQ);
            }
        }
    }

    fn control_transmission(&mut self, buffer: usize, before: u8, after: u8) {
        let (was, is) = (before & TXREQ != 0, after & TXREQ != 0);
        // A new request clears what became of the one before (3.3).
        let after = if is && !was {
            after & !(ABTF | MLOA | TXERR)
        } else {
            after
        };
        self.set(TXB_CTRL[buffer], after);
        if was && !is {
            self.set(TXB_CTRL[buffer], after | TXREQ);
            self.abort(buffer);
        }
    }

    /// What is being sent is finished (3.6).
    fn abort(&mut self, buffer: usize) {
        let control = self.at(TXB_CTRL[buffer]);
        if self.sending == Some(buffer) {
            self.set(TXB_CTRL[buffer], control & !TXREQ);
        } else if control & TXREQ != 0 {
            self.set(TXB_CTRL[buffer], control & !TXREQ | ABTF);
        }
    }

    /// The highest TXP, of equal ones the highest number (3.2).
    fn next_buffer(&self) -> Option<usize> {
        let waiting = (0..TXB_CTRL.len()).filter(|buffer| self.at(TXB_CTRL[*buffer]) & TXREQ != 0);
        waiting.max_by_key(|buffer| (self.at(TXB_CTRL[*buffer]) & TXP, *buffer))
    }

    fn frame_of(&self, buffer: usize) -> CanFrame {
        let at = |offset: u8| self.at(TXB_CTRL[buffer] + offset);
        let standard = u16::from(at(1)) << 3 | u16::from(at(2)) >> 5;
        let extension = u32::from(at(2) & 0b11) << 16 | u32::from(at(3)) << 8 | u32::from(at(4));
        let length = (at(5) & 0xf).min(8);
        CanFrame {
            id: match at(2) & EXIDE != 0 {
                true => CanId::Extended(u32::from(standard) << 18 | extension),
                false => CanId::Standard(standard),
            },
            data: (0..length).map(|byte| at(6 + byte)).collect(),
        }
    }

    fn finish_sending(&mut self, buffer: usize) {
        let control = self.at(TXB_CTRL[buffer]) & !(TXREQ | ABTF | MLOA | TXERR);
        self.set(TXB_CTRL[buffer], control);
        self.flag(TXIF[buffer]);
        self.sending = None;
        self.obey_control();
    }

    /// It is tried again, unless that was aborted meanwhile.
    fn stop_sending(&mut self, reason: u8) {
        let Some(buffer) = self.sending.take() else {
            return;
        };
        let mut control = self.at(TXB_CTRL[buffer]) | reason;
        if control & TXREQ == 0 {
            control |= ABTF;
        }
        self.set(TXB_CTRL[buffer], control);
        self.obey_control();
    }

    // ----- Reception ----------------------------------------------------------------------------

    fn take(&mut self, frame: &CanFrame) {
        match destination(&self.registers, frame) {
            Destination::Nowhere => {}
            Destination::Buffer(buffer, filter) => self.store(buffer, filter as u8, frame),
            Destination::Overflow(buffer) => {
                self.lost += 1;
                self.set(EFLG, self.at(EFLG) | RXOVR[buffer]);
                self.flag(ERRIF);
            }
        }
    }

    fn store(&mut self, buffer: usize, filter: u8, frame: &CanFrame) {
        let control = RXB_CTRL[buffer];
        let hit = if buffer == 0 { 1 } else { 0b111 };
        self.set(control, self.at(control) & !hit | filter & hit);
        let identifier = match frame.id {
            CanId::Standard(id) => [(id >> 3) as u8, (id as u8 & 0b111) << 5, 0, 0],
            CanId::Extended(id) => [
                (id >> 21) as u8,
                (id >> 13) as u8 & 0xe0 | EXIDE | (id >> 16) as u8 & 0b11,
                (id >> 8) as u8,
                id as u8,
            ],
        };
        let content = identifier.into_iter().chain([frame.data.len() as u8]);
        for (offset, byte) in (1..).zip(content.chain(frame.data.iter().copied())) {
            self.set(control + offset, byte);
        }
        self.flag(RXIF[buffer]);
    }

    // ----- Errors -------------------------------------------------------------------------------

    fn error_flags(&self) -> u8 {
        let (tec, rec) = (
            self.confinement.transmit_errors(),
            self.confinement.receive_errors(),
        );
        let flag = |is_set, bit| if is_set { bit } else { 0 };
        flag(tec >= WARNING || rec >= WARNING, EWARN)
            | flag(rec >= WARNING, RXWAR)
            | flag(tec >= WARNING, TXWAR)
            | flag(rec >= PASSIVE, RXEP)
            | flag(tec >= PASSIVE, TXEP)
            | flag(self.confinement.state() == ErrorState::BusOff, TXBO)
    }

    /// ERRIF comes with each condition that is new (7.6).
    fn note_errors(&mut self) {
        let conditions = self.error_flags();
        let known = self.at(EFLG) & 0x3f;
        if conditions & !known != 0 {
            self.flag(ERRIF);
        }
        self.set(EFLG, self.at(EFLG) & !0x3f | conditions);
    }
}

impl CanNode for Controller {
    fn attachment(&self) -> Option<Cycle> {
        let is_at_bus = self.is_powered && self.mode == Mode::Normal;
        is_at_bus.then(|| self.timing().bit())
    }

    fn confinement(&self) -> &Confinement {
        &self.confinement
    }

    fn confinement_mut(&mut self) -> &mut Confinement {
        &mut self.confinement
    }

    fn ready_from(&self) -> Option<Cycle> {
        self.next_buffer().map(|_| 0)
    }

    fn begin(&mut self, _now: Cycle) -> Option<CanFrame> {
        self.sending = self.next_buffer();
        self.sending.map(|buffer| self.frame_of(buffer))
    }

    fn sent(&mut self, _now: Cycle) {
        if let Some(buffer) = self.sending {
            self.finish_sending(buffer);
        }
        self.note_errors();
    }

    fn lost_arbitration(&mut self, _now: Cycle) {
        self.stop_sending(MLOA);
    }

    fn failed(&mut self, _now: Cycle) {
        self.stop_sending(TXERR);
        self.flag(MERRF);
        self.note_errors();
    }

    fn received(&mut self, frame: &CanFrame, _now: Cycle) {
        self.take(frame);
        self.note_errors();
    }

    fn disturbed(&mut self, _now: Cycle) {
        self.flag(MERRF);
        self.note_errors();
    }

    fn state_changed(&mut self, _now: Cycle) {
        self.note_errors();
    }
}
