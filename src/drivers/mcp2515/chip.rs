//! Instructions to the controller.
//!
//! Figures: Microchip MCP2515 data sheet DS20001801. The crate `mcp25xx` 0.4 reads receive buffer 1 from the address of buffer 0's
//! data (its instruction is 0x92, table 12-1 has 0x94), which leaves buffer 1 full for ever.

use embedded_hal::spi::{Operation, SpiDevice};

use crate::sensor::{Acceptance, BitTiming, CanFrame, FRAME_BYTES};

/// Instructions (table 12-1).
const RESET: u8 = 0xc0;
const READ: u8 = 0x03;
const WRITE: u8 = 0x02;
const BIT_MODIFY: u8 = 0x05;
const READ_STATUS: u8 = 0xa0;
const LOAD_TXB0: u8 = 0x40;
const SEND_TXB0: u8 = 0x81;
const READ_RXB0: u8 = 0x90;
const READ_RXB1: u8 = 0x94;

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
const CANINTF: u8 = 0x2c;
const EFLG: u8 = 0x2d;
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

/// Receive buffer 0: a frame goes to buffer 1 while it is full (register 4-1).
const RXB0CTRL: u8 = 0x60;
const ROLLOVER: u8 = 1 << 2;

/// CANCTRL in operation: normal mode, no clock output (register 10-1). After a reset it is 0x87.
const CANCTRL: u8 = 0x0f;
const NORMAL: u8 = 0;

/// Registers of a frame: four of its identifier, one of its length, its data (registers 3-3 to 3-8, 4-3 to 4-9).
const FRAME_REGISTERS: usize = 5 + FRAME_BYTES;

/// In the second register of an identifier: that it is an extended one.
const EXTENDED: u8 = 1 << 3;

/// In the register of the length: that it is not a data frame; and the bits of the length, of which 9 to 15 mean 8.
const REMOTE: u8 = 1 << 6;
const LENGTH: u8 = 0xf;

/// The controller does not answer, or does not keep what is written to it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct NoAnswer;

/// The controller behind an SPI device of its own.
pub(super) struct Chip<S: SpiDevice> {
    spi: S,
    cnf: [u8; 3],
}

/// Registers that are read at a look.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Registers {
    cnf: [u8; 3],
    interrupts: u8,
    flags: u8,
    errors: u8,
    status: u8,
    control: u8,
}

/// A receive buffer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ReceiveBuffer {
    First,
    Second,
}

/// Answer to READ STATUS (figure 12-8).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Buffers(u8);

impl Buffers {
    pub fn is_full(self, buffer: ReceiveBuffer) -> bool {
        let bit = match buffer {
            ReceiveBuffer::First => 0,
            ReceiveBuffer::Second => 1,
        };
        self.0 >> bit & 1 == 1
    }

    /// Whether the transmit buffer waits to be sent.
    pub fn is_sending(self) -> bool {
        self.0 >> 2 & 1 == 1
    }

    /// Whether the transmit buffer has been sent.
    pub fn has_sent(self) -> bool {
        self.0 >> 3 & 1 == 1
    }
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
            spi,
            cnf: cnf(timing),
        }
    }

    /// After it the controller is in its configuration mode, as soon as its oscillator runs: 128 periods (8.1).
    pub fn reset(&mut self) -> Result<(), NoAnswer> {
        self.write(&[RESET])
    }

    /// Sets it up after a reset.
    pub fn set_up(&mut self, accepted: &Acceptance) -> Result<(), NoAnswer> {
        if self.look()?.status & MODE != CONFIGURATION {
            return Err(NoAnswer);
        }
        self.write_all(accepted)?;
        if self.look()?.is_set_up(&self.cnf) {
            Ok(())
        } else {
            Err(NoAnswer)
        }
    }

    fn write_all(&mut self, accepted: &Acceptance) -> Result<(), NoAnswer> {
        let [filter0, filter1] = accepted.first.ids;
        let [filter2, filter3, filter4, filter5] = accepted.second.ids;
        let [cnf3, cnf2, cnf1] = self.cnf;
        for (address, registers) in [
            (FROM_RXF0, [filter0, filter1, filter2].map(id_registers)),
            (FROM_RXF3, [filter3, filter4, filter5].map(id_registers)),
            (
                FROM_RXM0,
                [
                    id_registers(accepted.first.mask),
                    id_registers(accepted.second.mask),
                    [cnf3, cnf2, cnf1, INTERRUPTS],
                ],
            ),
        ] {
            let mut write = [
                Operation::Write(&[WRITE, address]),
                Operation::Write(registers.as_flattened()),
            ];
            self.transfer(&mut write)?;
        }
        self.write(&[WRITE, RXB0CTRL, ROLLOVER])?;
        self.write(&[WRITE, CANCTRL, NORMAL])
    }

    /// Which buffers have something to be done.
    pub fn status(&mut self) -> Result<Buffers, NoAnswer> {
        let mut status = [0];
        self.transfer(&mut [Operation::Write(&[READ_STATUS]), Operation::Read(&mut status)])?;
        let [bits] = status;
        Ok(Buffers(bits))
    }

    /// Reads a full receive buffer, which frees it.
    pub fn receive(&mut self, buffer: ReceiveBuffer) -> Result<Received, NoAnswer> {
        let instruction = match buffer {
            ReceiveBuffer::First => READ_RXB0,
            ReceiveBuffer::Second => READ_RXB1,
        };
        let mut registers = [0; FRAME_REGISTERS];
        self.transfer(&mut [Operation::Write(&[instruction]), Operation::Read(&mut registers)])?;
        Ok(frame_of(&registers).map_or(Received::Other, Received::Frame))
    }

    /// Has the transmit buffer, which is empty, sent.
    pub fn send(&mut self, frame: &CanFrame) -> Result<(), NoAnswer> {
        let data = frame.data();
        let id = id_registers(frame.id());
        self.transfer(&mut [
            Operation::Write(&[LOAD_TXB0]),
            Operation::Write(&id),
            Operation::Write(&[data.len() as u8]),
            Operation::Write(data),
        ])?;
        self.write(&[SEND_TXB0])
    }

    /// The transmit buffer is no longer to be sent.
    pub fn give_up_sending(&mut self) -> Result<(), NoAnswer> {
        self.clear(TXB0CTRL, TXREQ)
    }

    /// The interrupt of the transmit buffer is served.
    pub fn clear_sent(&mut self) -> Result<(), NoAnswer> {
        self.clear(CANINTF, TX0IF)
    }

    /// The interrupt of errors, and overflows among them, are served.
    pub fn clear_errors(&mut self) -> Result<(), NoAnswer> {
        self.clear(EFLG, RX0OVR | RX1OVR)?;
        self.clear(CANINTF, ERRIF)
    }

    fn clear(&mut self, register: u8, bits: u8) -> Result<(), NoAnswer> {
        self.write(&[BIT_MODIFY, register, bits, 0])
    }

    fn write(&mut self, instruction: &[u8]) -> Result<(), NoAnswer> {
        self.transfer(&mut [Operation::Write(instruction)])
    }

    fn transfer(&mut self, operations: &mut [Operation<'_, u8>]) -> Result<(), NoAnswer> {
        self.spi.transaction(operations).map_err(|_| NoAnswer)
    }

    /// Everything that shows how the controller is.
    pub fn look(&mut self) -> Result<Registers, NoAnswer> {
        let mut read = [0; 8];
        self.transfer(&mut [Operation::Write(&[READ, FROM_CNF3]), Operation::Read(&mut read)])?;
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

    /// Whether too many errors have switched it off the bus (6.5).
    pub fn is_bus_off(&self) -> bool {
        self.errors & BUS_OFF != 0
    }

    /// Whether it waits to take part in the bus: it is in its normal mode once it has seen the bus idle (10.1).
    pub fn is_joining(&self) -> bool {
        self.status & MODE != NORMAL
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

/// The registers of an extended identifier, a filter or a mask, which ignores the bit of extended identifiers (registers 3-3 to
/// 3-6, 4-10 to 4-17): bits 28 to 21, 20 to 18 and 17 to 16, 15 to 8, 7 to 0.
fn id_registers(id: u32) -> [u8; 4] {
    let [_, _, eid8, eid0] = id.to_be_bytes();
    let sidl = (id >> 13) as u8 & 0xe0 | EXTENDED | (id >> 16) as u8 & 3;
    [(id >> 21) as u8, sidl, eid8, eid0]
}

/// The data frame with an extended identifier that a receive buffer holds.
fn frame_of(registers: &[u8; FRAME_REGISTERS]) -> Option<CanFrame> {
    let [sidh, sidl, eid8, eid0, length, data @ ..] = *registers;
    if sidl & EXTENDED == 0 || length & REMOTE != 0 {
        return None;
    }
    let low = u32::from_be_bytes([0, 0, eid8, eid0]);
    let id = u32::from(sidh) << 21 | u32::from(sidl & 0xe0) << 13 | u32::from(sidl & 3) << 16 | low;
    let length = usize::from(length & LENGTH);
    CanFrame::new(id, data.get(..length).unwrap_or(&data))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

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

    proptest! {
        /// A frame loaded for sending is what a receive buffer holds at the other end (registers 3-3 to 3-8, 4-3 to 4-9).
        #[test]
        fn frames_are_held_as_they_are_sent(id in 0..1u32 << 29, data in prop::collection::vec(any::<u8>(), 0..=8)) {
            let frame = CanFrame::new(id, &data).unwrap();
            let mut registers = [0xff; FRAME_REGISTERS];
            registers[..4].copy_from_slice(&id_registers(id));
            registers[4] = data.len() as u8;
            registers[5..5 + data.len()].copy_from_slice(&data);
            prop_assert_eq!(frame_of(&registers), Some(frame));
        }

        #[test]
        fn whatever_a_buffer_holds_is_a_frame_of_eight_bytes_at_most_or_none(registers: [u8; FRAME_REGISTERS]) {
            let is_data = registers[1] & EXTENDED != 0 && registers[4] & REMOTE == 0;
            let length = frame_of(&registers).map(|frame| frame.data().len());
            prop_assert_eq!(length, is_data.then(|| usize::from(registers[4] & LENGTH).min(8)));
        }
    }

    #[test]
    fn an_identifier_has_its_place_in_the_registers() {
        // The bits of 0x1804_4408, in the order of registers 3-3 to 3-6.
        assert_eq!(id_registers(0x1804_4408), [0xc0, 0x28, 0x44, 0x08]);
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
