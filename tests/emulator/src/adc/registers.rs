//! The registers of the ADC (datasheet 4.9.6).

use super::super::clock::{Cycle, NEVER, from_adc_clock};
use super::super::peripheral::Peripheral;
use super::super::register::{RegisterWrite, bit};
use super::fifo::SampleFifo;
use super::pace::AdcTime;
use super::{
    Adc, CS_EN, CS_ERR, CS_ERR_STICKY, CS_READY, CS_START_MANY, CS_START_ONCE, DMA_REQUEST, INTERRUPT_LINE,
    POWER_UP_ADC_CYCLES,
};

pub const CS: u32 = 0x00;
pub const RESULT: u32 = 0x04;
pub const FCS: u32 = 0x08;
pub const FIFO: u32 = 0x0c;
pub const DIV: u32 = 0x10;
pub const INTR: u32 = 0x14;
pub const INTE: u32 = 0x18;
pub const INTF: u32 = 0x1c;
pub const INTS: u32 = 0x20;

const CS_MASK: u32 = 0x001f_700b;
const DIV_MASK: u32 = 0x00ff_ffff;

impl Adc {
    fn write_control(&mut self, write: RegisterWrite, now: Cycle) {
        let was = self.cs;
        let cs = write.applied_to(was);
        self.error_sticky &= !bit(write.value, CS_ERR_STICKY);
        self.cs = cs & CS_MASK;
        if !bit(was, CS_EN) && bit(cs, CS_EN) {
            self.powered_up_at = now + from_adc_clock(POWER_UP_ADC_CYCLES);
        }
        if !bit(cs, CS_EN) {
            self.running = None;
        }
        if bit(cs, CS_START_MANY) && bit(cs, CS_EN) {
            let first = now.max(self.powered_up_at);
            self.next_start = self.next_start.or(Some(AdcTime::of(first)));
        } else {
            self.next_start = None;
            if bit(cs, CS_START_ONCE) {
                self.start_conversion(AdcTime::of(now));
            }
        }
    }

    fn control(&self, now: Cycle) -> u32 {
        self.cs
            | u32::from(self.is_ready(now)) << CS_READY
            | u32::from(self.error) << CS_ERR
            | u32::from(self.error_sticky) << CS_ERR_STICKY
    }
}

impl Peripheral for Adc {
    fn read(&mut self, offset: u32, now: Cycle) -> u32 {
        match offset {
            CS => self.control(now),
            RESULT => u32::from(self.result),
            FCS => self.fifo.status(),
            FIFO => self.pop(),
            DIV => self.div,
            INTR => u32::from(self.fifo.reached_threshold()),
            INTE => self.inte,
            INTF => self.intf,
            INTS => self.interrupt_status(),
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, now: Cycle) {
        match offset {
            CS => self.write_control(write, now),
            FCS => self.fifo.write_control(write),
            DIV => write.update(&mut self.div, DIV_MASK),
            INTE => write.update(&mut self.inte, 1),
            INTF => write.update(&mut self.intf, 1),
            _ => {}
        }
    }

    fn reset(&mut self, _now: Cycle) {
        self.cs = 0;
        self.div = 0;
        self.inte = 0;
        self.intf = 0;
        self.result = 0;
        self.error = false;
        self.error_sticky = false;
        self.fifo = SampleFifo::default();
        self.running = None;
        self.next_start = None;
    }

    fn advance(&mut self, now: Cycle) {
        let now = AdcTime::of(now);
        loop {
            match (self.conversion_end(), self.free_running_start()) {
                (Some(end), _) if end <= now => self.finish_conversion(end),
                (None, Some(trigger)) if trigger <= now => self.start_at_trigger(trigger),
                _ => return,
            }
        }
    }

    fn next_event(&self) -> Cycle {
        let event = self.conversion_end().or(self.free_running_start());
        event.map_or(NEVER, AdcTime::cycle)
    }

    fn interrupt_lines(&self) -> u32 {
        self.interrupt_status() << INTERRUPT_LINE
    }

    fn dma_requests(&self) -> u64 {
        u64::from(self.fifo.requests_dma()) << DMA_REQUEST
    }
}
