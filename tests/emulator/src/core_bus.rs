//! The processor's side of the bus: the trait through which the crate's core executes.

use rp2040_emu::bus::ppb::Ppb;
use rp2040_emu::core::{CoreBus, Nvic};

use super::access_log::Direction;
use super::bus::{BusError, SystemBus, Width};

/// What the crate's core announces as its program counter while it stacks or unstacks the
/// registers of an exception.
const STACKING: u32 = 0xffff_fffe;
const UNSTACKING: u32 = 0xffff_fffd;

/// The IOPORT segment, which only the processor can reach (datasheet 2.3.1).
const IOPORT: u32 = 0xd;
/// "Mapped to word-aligned addresses in the range 0xd0000000...0xd000017c" (2.3.1).
const SIO_END: u32 = 0xd000_0180;
const SYSTEM_CONTROL: u32 = 0xe;
/// The levels of all pins (2.3.1.7).
const SIO_GPIO_IN: u32 = 0xd000_0004;
/// The levels that are put out, at which pins, and the aliases of both.
const SIO_GPIO_OUT: u32 = 0xd000_0010;
const SIO_GPIO_OE_XOR: u32 = 0xd000_002c;
/// Writing the inter-core FIFO means starting core 1.
const SIO_FIFO_WR: u32 = 0xd000_0054;
const SIO_INTERPOLATORS: u32 = 0xd000_0080;
const SIO_SPINLOCK0: u32 = 0xd000_0100;

/// The first interrupt line that only software can raise.
const FIRST_SOFTWARE_LINE: u8 = 26;

impl SystemBus {
    #[inline]
    fn core_load(&mut self, address: u32, width: Width) -> u32 {
        let loaded = match address >> 28 {
            IOPORT if address < SIO_END => Ok(self.load_sio(address, width)),
            SYSTEM_CONTROL => Ok(self.load_system_control(address, width)),
            _ if !self.mpu_permits(address, Direction::Read) => Err(BusError),
            _ => self.load(address, width),
        };
        loaded.unwrap_or_else(|BusError| {
            self.fail(address, Direction::Read);
            0
        })
    }

    #[inline]
    fn core_store(&mut self, address: u32, value: u32, width: Width) {
        let stored = match address >> 28 {
            IOPORT if address < SIO_END => {
                self.store_sio(address, value, width);
                Ok(())
            }
            SYSTEM_CONTROL => {
                self.store_system_control(address, value);
                Ok(())
            }
            _ if !self.mpu_permits(address, Direction::Write) => Err(BusError),
            _ => self.store(address, value, width),
        };
        if stored.is_err() {
            self.fail(address, Direction::Write);
        }
    }

    #[inline]
    fn mpu_permits(&self, address: u32, direction: Direction) -> bool {
        let control = &self.system_control;
        control.mpu.permits(address, direction, control.active_exception)
    }

    #[cold]
    fn fail(&mut self, address: u32, direction: Direction) {
        self.note_bus_error(address, direction);
        self.fault = Some(address);
    }

    fn load_sio(&mut self, address: u32, width: Width) -> u32 {
        if address & !3 == SIO_GPIO_IN {
            self.sample_inputs();
        }
        self.note_unmodelled_sio(address, Direction::Read);
        let word = self.chip.sio.read(address & 0xffc);
        super::bus::lane(word, address, width)
    }

    fn store_sio(&mut self, address: u32, value: u32, width: Width) {
        self.note_unmodelled_sio(address, Direction::Write);
        let value = super::bus::replicated(value, width);
        self.chip.sio.write(address & 0xffc, value);
        if (SIO_GPIO_OUT..=SIO_GPIO_OE_XOR).contains(&(address & !3)) {
            self.observe_circuit();
        }
        self.observe_pins();
    }

    fn note_unmodelled_sio(&mut self, address: u32, direction: Direction) {
        match address & !3 {
            SIO_FIFO_WR => self.note_unmodelled("SIO_FIFO", address, direction),
            SIO_INTERPOLATORS..SIO_SPINLOCK0 => self.note_unmodelled("SIO_INTERP", address, direction),
            _ => {}
        }
    }

    /// Exception entry and return set the event register (ARMv6-M B1.5.18), and change which
    /// interrupt lines may become pending.
    fn exception_boundary(&mut self) {
        self.chip.event_flag = true;
        self.attention = true;
    }
}

impl CoreBus for SystemBus {
    fn read8(&mut self, address: u32) -> u8 {
        self.core_load(address, Width::Byte) as u8
    }

    fn read16(&mut self, address: u32) -> u16 {
        self.core_load(address, Width::Half) as u16
    }

    fn read32(&mut self, address: u32) -> u32 {
        self.core_load(address, Width::Word)
    }

    fn write8(&mut self, address: u32, value: u8) {
        self.core_store(address, u32::from(value), Width::Byte);
    }

    fn write16(&mut self, address: u32, value: u16) {
        self.core_store(address, u32::from(value), Width::Half);
    }

    fn write32(&mut self, address: u32, value: u32) {
        self.core_store(address, value, Width::Word);
    }

    /// Called at every instruction, and with a marker at every exception entry and return.
    fn set_active_pc(&mut self, pc: u32) {
        if pc == STACKING || pc == UNSTACKING {
            self.exception_boundary();
            return;
        }
        self.pc = pc;
        self.instructions += 1;
        self.note_fetched(pc);
    }

    fn bus_fault(&self) -> bool {
        self.fault.is_some()
    }

    fn bus_fault_addr(&self) -> u32 {
        self.fault.unwrap_or(0)
    }

    fn clear_bus_fault(&mut self) {
        self.fault = None;
    }

    fn ppb(&self, _core: usize) -> &Ppb {
        &self.chip.ppb
    }

    fn ppb_mut(&mut self, _core: usize) -> &mut Ppb {
        &mut self.chip.ppb
    }

    fn nvic(&self, _core: usize) -> &Nvic {
        &self.chip.nvic
    }

    /// The core asks for this only to clear the pending bit of the interrupt it is about to enter,
    /// which is the pending one of highest priority. The crate's `clear_pending` leaves lines 26
    /// to 31 alone, so that is done here.
    fn nvic_mut(&mut self, _core: usize) -> &mut Nvic {
        let nvic = &mut self.chip.nvic;
        if let Some((line, _)) = nvic.highest_priority_pending()
            && line >= FIRST_SOFTWARE_LINE
        {
            nvic.pending &= !(1 << line);
        }
        nvic
    }

    fn active_core(&self) -> usize {
        0
    }

    fn event_flag(&self, _core: usize) -> bool {
        self.chip.event_flag
    }

    fn consume_event_flag(&mut self, _core: usize) -> bool {
        std::mem::take(&mut self.chip.event_flag)
    }

    fn set_wfe_waiting(&mut self, _core: usize, waiting: bool) {
        self.chip.wfe_waiting = waiting;
    }

    fn signal_sev(&mut self) {
        self.chip.event_flag = true;
    }
}
