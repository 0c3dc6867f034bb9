//! Instructions to the controller.
//!
//! Figures: Microchip MCP2515 data sheet DS20001801.

use embedded_hal::spi::SpiDevice;
use mcp25xx::embedded_can::{ExtendedId, Frame, Id};
use mcp25xx::registers::{CANCTRL, CANINTF, EFLG, Modify, RXB0CTRL, ReadStatusResponse, Register};
use mcp25xx::{Instruction, MCP25xx, RxBuffer, TxBuffer};

use super::filters::Filters;
use crate::sensor::{BitTiming, CanFrame};

/// Transmit buffer 0 (register 3-1), the only one that is used: from several, frames would not leave in their order.
const TXB0CTRL: u8 = 0x30;
const TXREQ: u8 = 1 << 3;

/// Filters, masks and behind these CNF3 to CNF1 and CANINTE, each four registers (table 11-1).
const FROM_RXF0: u8 = 0x00;
const FROM_RXF3: u8 = 0x10;
const FROM_RXM0: u8 = 0x20;

/// CNF3 and the seven registers behind it, one of each kind that has to be looked at (table 11-1).
const FROM_CNF3: u8 = 0x28;

/// Interrupts: both receive buffers, transmit buffer 0, errors (register 7-1).
const INTERRUPTS: u8 = RX0IF | RX1IF | TX0IF | ERRIF;
const RX0IF: u8 = 1 << 0;
const RX1IF: u8 = 1 << 1;
const TX0IF: u8 = 1 << 2;
const ERRIF: u8 = 1 << 5;

/// Overflow of each receive buffer; they stay until they are cleared (register 6-3).
const RX0OVR: u8 = 1 << 6;
const RX1OVR: u8 = 1 << 7;
const BUS_OFF: u8 = 1 << 5;
const PASSIVE: u8 = 1 << 3 | 1 << 4;

/// CANSTAT, the bits with the mode; 0 is the normal mode, 4 configuration (register 10-2).
const MODE: u8 = 0xe0;
const CONFIGURATION: u8 = 0x80;

/// CANCTRL in operation: normal mode, no clock output (register 10-1). After a reset it is 0x87.
const NORMAL: u8 = 0;

/// The controller does not answer, or does not keep what is written to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NoAnswer;

/// The controller behind an SPI device of its own.
pub(super) struct Chip<S: SpiDevice> {
    instructions: MCP25xx<S>,
    cnf: [u8; 3],
}

/// What is read of the controller at a look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Registers {
    cnf: [u8; 3],
    interrupts: u8,
    flags: u8,
    errors: u8,
    status: u8,
    control: u8,
}

/// A frame that the controller has received.
pub(super) enum Received {
    /// A data frame with an extended identifier.
    Frame(CanFrame),
    /// One of another kind, which DroneCAN does not use.
    Other,
}

impl<S: SpiDevice> Chip<S> {
    pub fn new(spi: S, timing: BitTiming) -> Self {
        Self {
            instructions: MCP25xx { spi },
            cnf: cnf(timing),
        }
    }

    /// After it the controller is in its configuration mode, as soon as its oscillator runs: 128 periods (8.1).
    pub fn reset(&mut self) -> Result<(), NoAnswer> {
        self.instructions.reset().map_err(no_answer)
    }

    /// Sets it up after a reset.
    pub fn set_up(&mut self, filters: &Filters) -> Result<(), NoAnswer> {
        if self.look()?.status & MODE != CONFIGURATION {
            return Err(NoAnswer);
        }
        self.write_all(filters).map_err(no_answer)?;
        if self.look()?.is_set_up(&self.cnf) {
            Ok(())
        } else {
            Err(NoAnswer)
        }
    }

    fn write_all(&mut self, filters: &Filters) -> Result<(), S::Error> {
        let [filter0, filter1] = filters.first;
        let [filter2, filter3, filter4, filter5] = filters.second;
        let [mask0, mask1] = filters.masks;
        let [cnf3, cnf2, cnf1] = self.cnf;
        let instructions = &mut self.instructions;
        for (address, registers) in [
            (FROM_RXF0, [filter0, filter1, filter2].map(id_registers)),
            (FROM_RXF3, [filter3, filter4, filter5].map(id_registers)),
            (
                FROM_RXM0,
                [
                    id_registers(mask0),
                    id_registers(mask1),
                    [cnf3, cnf2, cnf1, INTERRUPTS],
                ],
            ),
        ] {
            instructions.write_registers(address, registers.as_flattened())?;
        }
        // A frame for a full buffer 0 goes to buffer 1.
        instructions.write_register(RXB0CTRL::new().with_bukt(true))?;
        instructions.write_register(CANCTRL::from(NORMAL))
    }

    /// Which buffers have something to be done.
    pub fn status(&mut self) -> Result<ReadStatusResponse, NoAnswer> {
        self.instructions.read_status().map_err(no_answer)
    }

    /// Reads a full receive buffer, which frees it.
    pub fn receive(&mut self, buffer: RxBuffer) -> Result<Received, NoAnswer> {
        let frame = self.instructions.read_rx_buffer(buffer).map_err(no_answer)?;
        let Id::Extended(id) = frame.id() else {
            return Ok(Received::Other);
        };
        if frame.is_remote_frame() {
            return Ok(Received::Other);
        }
        let received = CanFrame::new(id.as_raw(), frame.data());
        Ok(received.map_or(Received::Other, Received::Frame))
    }

    /// Has the transmit buffer, which is empty, sent.
    pub fn send(&mut self, frame: &CanFrame) -> Result<(), NoAnswer> {
        let Some(frame) = mcp25xx::CanFrame::new(extended(frame.id()), frame.data()) else {
            return Ok(());
        };
        let instructions = &mut self.instructions;
        instructions
            .load_tx_buffer(TxBuffer::TXB0, &frame)
            .and_then(|()| instructions.request_to_send(TxBuffer::TXB0))
            .map_err(no_answer)
    }

    /// The transmit buffer is no longer to be sent.
    pub fn give_up_sending(&mut self) -> Result<(), NoAnswer> {
        // Bit modify has no type of this register that can be written in part.
        let modify = [Instruction::BitModify as u8, TXB0CTRL, TXREQ, 0];
        self.instructions.spi.write(&modify).map_err(no_answer)
    }

    /// The interrupt of the transmit buffer is served.
    pub fn clear_sent(&mut self) -> Result<(), NoAnswer> {
        self.clear::<CANINTF>(TX0IF)
    }

    /// The interrupt of errors, and overflows among them, are served.
    pub fn clear_errors(&mut self) -> Result<(), NoAnswer> {
        self.clear::<EFLG>(RX0OVR | RX1OVR)?;
        self.clear::<CANINTF>(ERRIF)
    }

    fn clear<R: Register + Modify + Into<u8>>(&mut self, bits: u8) -> Result<(), NoAnswer> {
        let cleared = self.instructions.modify_register(R::from(0), bits);
        cleared.map_err(no_answer)
    }

    /// Everything that shows how the controller is.
    pub fn look(&mut self) -> Result<Registers, NoAnswer> {
        let mut read = [0; 8];
        let looked = self.instructions.read_registers(FROM_CNF3, &mut read);
        looked.map_err(no_answer)?;
        let [cnf3, cnf2, cnf1, interrupts, flags, errors, status, control] = read;
        Ok(Registers {
            cnf: [cnf3, cnf2, cnf1],
            interrupts,
            flags,
            errors,
            status,
            control,
        })
    }

    /// Whether it still is as it was set up.
    pub fn is_set_up(&self, registers: &Registers) -> bool {
        registers.is_set_up(&self.cnf)
    }
}

impl Registers {
    fn is_set_up(&self, cnf: &[u8; 3]) -> bool {
        self.cnf == *cnf && self.interrupts == INTERRUPTS && self.control == NORMAL
    }

    /// Whether it takes no part in the bus. It leaves the configuration mode when it has seen the bus idle (10.1).
    pub fn is_bus_off(&self) -> bool {
        self.errors & BUS_OFF != 0 || self.status & MODE != NORMAL
    }

    pub fn is_passive(&self) -> bool {
        self.errors & PASSIVE != 0
    }

    /// Whether errors are to be cleared.
    pub fn has_error_interrupt(&self) -> bool {
        self.flags & ERRIF != 0 || self.overflows() != 0
    }

    /// Buffers that have lost a frame at least.
    pub fn overflows(&self) -> u32 {
        (self.errors & (RX0OVR | RX1OVR)).count_ones()
    }

    /// Whether the interrupt line has to be low.
    pub fn is_interrupting(&self) -> bool {
        self.flags & self.interrupts != 0
    }
}

/// CNF3, CNF2 and CNF1 (registers 5-1 to 5-3). Of the quanta, the first synchronises, the last two are phase segment 2, and the
/// sample point is between phase segments 1 and 2. The others are shared by phase segment 1, at most 8, and the propagation
/// segment. The bit is shortened or lengthened by one quantum, less than phase segment 2 (5.3).
fn cnf(timing: BitTiming) -> [u8; 3] {
    const SYNC: u8 = 1;
    const PHASE_2: u8 = 2;
    const LENGTH_OF_PHASE_2_IS_SET: u8 = 1 << 7;
    let before_sample = timing.quanta().saturating_sub(SYNC + PHASE_2);
    let phase_1 = before_sample.div_ceil(2);
    let propagation = before_sample.saturating_sub(phase_1);
    [
        PHASE_2 - 1,
        LENGTH_OF_PHASE_2_IS_SET | phase_1.saturating_sub(1) << 3 | propagation.saturating_sub(1),
        timing.prescaler().saturating_sub(1),
    ]
}

fn extended(id: u32) -> ExtendedId {
    ExtendedId::new(id & ExtendedId::MAX.as_raw()).unwrap_or(ExtendedId::ZERO)
}

/// The registers of a filter or a mask (registers 4-10 to 4-17): bits 28 to 18, that it is of extended identifiers, which a
/// mask ignores, and bits 17 to 0.
fn id_registers(id: u32) -> [u8; 4] {
    const EXTENDED: u32 = 1 << 3;
    let [_, _, eid8, eid0] = id.to_be_bytes();
    let sidh = id >> 21;
    let sidl = id >> 13 & 0xe0 | EXTENDED | id >> 16 & 3;
    [sidh as u8, sidl as u8, eid8, eid0]
}

fn no_answer<E>(_: E) -> NoAnswer {
    NoAnswer
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Quanta before the sample point and of the bit, periods of the crystal in a quantum: what the data sheet makes of the
    /// registers (DS20001801, 5.1, registers 5-1 to 5-3).
    fn meaning([cnf3, cnf2, cnf1]: [u8; 3]) -> (u8, u8, u8) {
        assert_eq!(cnf2 & 0xc0, 0x80, "PS2 by CNF3, sampled once");
        assert_eq!(cnf1 >> 6, 0, "a jump of one quantum");
        let (propagation, phase_1, phase_2) = ((cnf2 & 7) + 1, (cnf2 >> 3 & 7) + 1, (cnf3 & 7) + 1);
        assert!(propagation + phase_1 >= phase_2 && phase_2 >= 2);
        let before_sample = 1 + propagation + phase_1;
        (before_sample, before_sample + phase_2, 2 * ((cnf1 & 0x3f) + 1))
    }

    #[test]
    fn bits_are_sampled_near_87_percent() {
        for (crystal_mhz, bit_rate, expected) in [
            (16, 1_000_000, (6, 8, 2)),
            (16, 500_000, (14, 16, 2)),
            (16, 250_000, (14, 16, 4)),
            (16, 125_000, (14, 16, 8)),
            (8, 500_000, (6, 8, 2)),
            (8, 250_000, (14, 16, 2)),
            (8, 125_000, (14, 16, 4)),
        ] {
            let timing = BitTiming::new(crystal_mhz, bit_rate).unwrap();
            assert_eq!(
                meaning(cnf(timing)),
                expected,
                "{crystal_mhz} MHz, {bit_rate} bit/s"
            );
        }
    }
}
