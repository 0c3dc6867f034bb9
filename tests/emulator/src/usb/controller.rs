//! The device controller: registers, DPRAM, and what it answers on the bus (datasheet 4.1.2).

use super::super::clock::{CLK_SYS_HZ, Cycle, NEVER, cycles};
use super::super::register::RegisterWrite;
use super::bus::{Delivery, Endpoint, Handshake, Sent, Toggle};
use super::registers::*;

/// "4kB of DPSRAM" (4.1.2.5).
pub const DPRAM_BYTES: usize = 4096;
/// Buffer control of IN 0, OUT 0, IN 1… (4.1.2.5.1).
const BUFFER_CONTROLS: u32 = 0x80;
const BUFFER_CONTROLS_END: u32 = 0x100;
/// EP0's one buffer for both directions.
const EP0_BUFFER: usize = 0x100;
/// "Bits 0-5 are ignored" in a buffer's address.
const BUFFER_ADDRESS: u32 = 0xffc0;

/// A bus that is idle for 3 ms is suspended (USB 2.0, 7.1.7.6).
const IDLE_TO_SUSPEND: Cycle = cycles(3_000);

/// The controller reads a buffer control by its own clock of 48 MHz, so AVAILABLE has to follow the other bits by a
/// cycle of that at least, which is three of `clk_sys` at most (4.1.2.5.1).
const SETTLE: Cycle = CLK_SYS_HZ.div_ceil(48_000_000);

#[derive(Clone)]
pub struct Controller {
    registers: [u32; REGISTERS],
    dpram: Vec<u8>,
    /// The latched bits of SIE_STATUS.
    status: u32,
    buff_status: u32,
    abort_done: u32,
    frame: u32,
    has_seen_frame: bool,
    /// Since when nothing was on the bus; `None` while it is not idle, and once that has led to a suspend.
    idle_since: Option<Cycle>,
    /// When each buffer control got its present bits, AVAILABLE left aside.
    settled_from: [Cycle; 32],
    /// RP2040-E15 has struck.
    hangs: bool,
}

impl Controller {
    pub fn new() -> Self {
        Self {
            registers: [0; REGISTERS],
            dpram: vec![0; DPRAM_BYTES],
            status: 0,
            buff_status: 0,
            abort_done: 0,
            frame: 0,
            has_seen_frame: false,
            idle_since: None,
            settled_from: [0; 32],
            hangs: false,
        }
    }

    /// RESETS clears the registers, and the DPRAM keeps what it holds.
    pub fn reset(&mut self) {
        let dpram = std::mem::take(&mut self.dpram);
        *self = Self { dpram, ..Self::new() };
    }

    // ----- The processor's side -----------------------------------------------------------------------

    pub fn read(&mut self, offset: u32) -> u32 {
        match offset {
            SIE_STATUS => self.status | u32::from(self.has_vbus()),
            SOF_RD => {
                self.has_seen_frame = false;
                self.frame
            }
            BUFF_STATUS => self.buff_status,
            EP_ABORT_DONE => self.abort_done,
            INTR => self.raw_interrupts(),
            INTS => self.interrupts(),
            _ => self.register(offset),
        }
    }

    pub fn write(&mut self, offset: u32, write: RegisterWrite, now: Cycle) {
        match offset {
            SIE_STATUS => self.status &= !(write.value & STATUS_CLEARABLE),
            BUFF_STATUS => self.buff_status &= !write.value,
            EP_ABORT_DONE => self.abort_done &= !write.value,
            SOF_RD | INTR | INTS => {}
            _ => self.write_register(offset, write, now),
        }
    }

    fn write_register(&mut self, offset: u32, write: RegisterWrite, now: Cycle) {
        let was_attached = self.is_attached();
        let Some(register) = self.registers.get_mut(offset as usize / 4) else {
            return;
        };
        *register = write.applied_to(*register);
        assert!(
            self.register(MAIN_CTRL) & MAIN_CTRL_HOST == 0,
            "USB host mode is not modelled"
        );
        let unknown = self.register(SIE_CTRL) & SIE_CTRL_NOT_MODELLED;
        assert!(unknown == 0, "SIE_CTRL bits {unknown:#x} are not modelled");
        self.abort_done |= self.register(EP_ABORT);
        if self.is_attached() && !was_attached {
            self.idle_since = Some(now);
        }
    }

    /// The word at an offset in the DPRAM.
    pub fn dpram_word(&self, offset: u32) -> u32 {
        let offset = offset as usize & !3;
        let bytes = self.dpram.get(offset..offset + 4);
        let bytes = bytes.unwrap_or_else(|| panic!("the USB DPRAM ends before {offset:#x}"));
        bytes
            .iter()
            .rev()
            .fold(0, |word, byte| word << 8 | u32::from(*byte))
    }

    /// Stores `length` bytes: the DPRAM is memory and takes narrow stores as they are.
    pub fn store_dpram(&mut self, offset: u32, value: u32, length: usize, now: Cycle) {
        let old = self.dpram_word(offset);
        let start = offset as usize;
        self.dpram[start..start + length].copy_from_slice(&value.to_le_bytes()[..length]);
        if (BUFFER_CONTROLS..BUFFER_CONTROLS_END).contains(&offset) {
            self.check_buffer_control(offset, old, now);
        }
    }

    fn check_buffer_control(&mut self, offset: u32, old: u32, now: Cycle) {
        let new = self.dpram_word(offset);
        let number = ((offset - BUFFER_CONTROLS) / 4) as usize;
        if (old ^ new) & !BUFFER_AVAILABLE != 0 {
            self.settled_from[number] = now;
        }
        let settled = now >= self.settled_from[number] + SETTLE;
        assert!(
            new & BUFFER_AVAILABLE == 0 || settled,
            "AVAILABLE of buffer control {number} was set too early after its other bits"
        );
    }

    pub fn interrupts(&self) -> u32 {
        self.raw_interrupts() & self.register(INTE) | self.register(INTF)
    }

    fn raw_interrupts(&self) -> u32 {
        let latched = STATUS_INTERRUPTS
            .iter()
            .filter(|(_, status)| self.status & status != 0);
        let latched = latched.fold(0, |raised, (interrupt, _)| raised | interrupt);
        let raised = |condition: bool, interrupt| if condition { interrupt } else { 0 };
        latched
            | raised(self.buff_status != 0, INT_BUFF_STATUS)
            | raised(self.has_seen_frame, INT_DEV_SOF)
            | raised(self.abort_done != 0, INT_ABORT_DONE)
    }

    fn register(&self, offset: u32) -> u32 {
        self.registers.get(offset as usize / 4).copied().unwrap_or(0)
    }

    // ----- The bus's side -----------------------------------------------------------------------------

    /// Whether D+ is pulled up, which is what a host sees of a device.
    pub fn is_attached(&self) -> bool {
        self.register(MAIN_CTRL) & MAIN_CTRL_CONTROLLER_EN != 0
            && self.register(USB_MUXING) & MUXING_TO_PHY != 0
            && self.register(SIE_CTRL) & SIE_CTRL_PULLUP != 0
            && self.has_vbus()
    }

    /// VBUS is not on a pin of the controller: the firmware has to override its detection.
    fn has_vbus(&self) -> bool {
        let overridden = PWR_VBUS_DETECT | PWR_VBUS_DETECT_OVERRIDE;
        self.register(USB_PWR) & overridden == overridden
    }

    /// Whether RP2040-E15 has not struck.
    pub fn is_working(&self) -> bool {
        !self.hangs
    }

    /// When [`Self::advance`] has something to do.
    pub fn next_event(&self) -> Cycle {
        match self.idle_since {
            Some(since) if self.is_working() && self.is_attached() => since + IDLE_TO_SUSPEND,
            _ => NEVER,
        }
    }

    pub fn advance(&mut self, now: Cycle) {
        if self.next_event() <= now {
            self.status |= STATUS_SUSPENDED;
            self.idle_since = None;
        }
    }

    /// The host drives a reset, which is not an idle bus.
    pub fn bus_reset(&mut self) {
        if !self.hangs {
            self.idle_since = None;
            self.status |= STATUS_BUS_RESET | STATUS_CONNECTED;
        }
    }

    /// The host ends a suspend.
    pub fn resume(&mut self, now: Cycle) {
        if !self.hangs {
            self.idle_since = Some(now);
            self.status |= STATUS_RESUME;
        }
    }

    /// A frame begins.
    pub fn start_of_frame(&mut self, number: u32, now: Cycle) {
        if !self.hangs {
            self.idle_since = Some(now);
            self.frame = number & 0x7ff;
            self.has_seen_frame = true;
        }
    }

    /// A SETUP packet is always accepted. It clears EP_STALL_ARM, and leaves the buffer controls as they are.
    pub fn setup(&mut self, address: u8, packet: [u8; 8]) -> Option<Handshake> {
        self.is_addressed(address).then(|| {
            self.dpram[..8].copy_from_slice(&packet);
            self.registers[EP_STALL_ARM as usize / 4] = 0;
            self.status |= STATUS_SETUP_REC;
            Handshake::Ack
        })
    }

    /// An IN transaction. `None`: no answer at all.
    pub fn input(&mut self, from: Endpoint, delivery: Delivery) -> Option<Sent> {
        let buffer = self.buffer(from, Way::In)?;
        let control = self.dpram_word(buffer.control);
        if self.is_stalled(from, Way::In, control) {
            return Some(Sent::Stall);
        }
        if control & BUFFER_AVAILABLE == 0 || self.is_aborted(&buffer) {
            return Some(Sent::Nak);
        }
        if delivery == Delivery::BusError {
            self.hangs = true;
            return None;
        }
        let length = (control & BUFFER_LENGTH) as usize;
        let bytes = self.dpram[buffer.data..buffer.data + length].to_vec();
        self.status |= STATUS_ACK_REC;
        self.complete(&buffer, control & !(BUFFER_AVAILABLE | BUFFER_FULL), control);
        Some(Sent::Data(Toggle::of(control & BUFFER_DATA1 != 0), bytes))
    }

    /// An OUT transaction. A packet with the wrong toggle has been received before: it is acknowledged and dropped.
    pub fn output(&mut self, to: Endpoint, toggle: Toggle, bytes: &[u8]) -> Option<Handshake> {
        let buffer = self.buffer(to, Way::Out)?;
        let control = self.dpram_word(buffer.control);
        if self.is_stalled(to, Way::Out, control) {
            return Some(Handshake::Stall);
        }
        if control & BUFFER_AVAILABLE == 0 || self.is_aborted(&buffer) {
            return Some(Handshake::Nak);
        }
        if toggle != Toggle::of(control & BUFFER_DATA1 != 0) {
            self.status |= STATUS_DATA_SEQ_ERROR;
            return Some(Handshake::Ack);
        }
        self.dpram[buffer.data..buffer.data + bytes.len()].copy_from_slice(bytes);
        let received = control & !(BUFFER_AVAILABLE | BUFFER_LENGTH) | BUFFER_FULL | bytes.len() as u32;
        self.complete(&buffer, received, control);
        Some(Handshake::Ack)
    }

    fn is_addressed(&self, address: u8) -> bool {
        !self.hangs && self.register(ADDR_ENDP) & 0x7f == u32::from(address)
    }

    /// An endpoint that is not enabled does not answer.
    fn buffer(&self, endpoint: Endpoint, way: Way) -> Option<Buffer> {
        if !self.is_addressed(endpoint.address) {
            return None;
        }
        let number = u32::from(endpoint.number);
        let place = 2 * number + way as u32;
        let control = BUFFER_CONTROLS + 4 * place;
        if number == 0 {
            let signals = self.register(SIE_CTRL) & SIE_CTRL_EP0_INT_1BUF != 0;
            return Some(Buffer {
                place,
                control,
                data: EP0_BUFFER,
                signals,
            });
        }
        let settings = self.dpram_word(4 * place);
        assert!(
            settings & EP_DOUBLE_BUFFERED == 0,
            "double buffering of USB endpoint {number} is not modelled"
        );
        (settings & EP_ENABLE != 0).then_some(Buffer {
            place,
            control,
            data: (settings & BUFFER_ADDRESS) as usize,
            signals: settings & EP_INT_1BUF != 0,
        })
    }

    /// "This bit must be set in conjunction with the STALL bit in the buffer control register to send a STALL on EP0"
    /// (EP_STALL_ARM).
    fn is_stalled(&self, endpoint: Endpoint, way: Way, control: u32) -> bool {
        let armed = self.register(EP_STALL_ARM) >> (way as u32) & 1 != 0;
        control & BUFFER_STALL != 0 && (endpoint.number != 0 || armed)
    }

    fn is_aborted(&self, buffer: &Buffer) -> bool {
        self.register(EP_ABORT) >> buffer.place & 1 != 0
    }

    fn complete(&mut self, buffer: &Buffer, written_back: u32, before: u32) {
        let at = buffer.control as usize;
        self.dpram[at..at + 4].copy_from_slice(&written_back.to_le_bytes());
        if before & BUFFER_LAST != 0 {
            self.status |= STATUS_TRANS_COMPLETE;
        }
        if buffer.signals {
            self.buff_status |= 1 << buffer.place;
        }
    }
}

/// Which way a buffer's data goes, in the order of the buffer controls.
#[derive(Clone, Copy)]
enum Way {
    In = 0,
    Out = 1,
}

struct Buffer {
    /// Its bit in BUFF_STATUS and EP_ABORT.
    place: u32,
    control: u32,
    data: usize,
    signals: bool,
}
