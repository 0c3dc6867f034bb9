//! The registers of an I2C block (datasheet 4.3.17).

use super::super::clock::Cycle;
use super::super::peripheral::Peripheral;
use super::super::register::{RegisterWrite, bit, field};
use super::I2c;
use super::master::{
    ACTIVITY, Command, FIFO_DEPTH, Master, RX_OVER, RX_UNDER, START_DET, STOP_DET, TX_ABRT, TX_OVER,
};
use super::speed::Speed;

pub const IC_CON: u32 = 0x00;
pub const IC_TAR: u32 = 0x04;
pub const IC_SAR: u32 = 0x08;
pub const IC_DATA_CMD: u32 = 0x10;
pub const IC_SS_SCL_HCNT: u32 = 0x14;
pub const IC_SS_SCL_LCNT: u32 = 0x18;
pub const IC_FS_SCL_HCNT: u32 = 0x1c;
pub const IC_FS_SCL_LCNT: u32 = 0x20;
pub const IC_INTR_STAT: u32 = 0x2c;
pub const IC_INTR_MASK: u32 = 0x30;
pub const IC_RAW_INTR_STAT: u32 = 0x34;
pub const IC_RX_TL: u32 = 0x38;
pub const IC_TX_TL: u32 = 0x3c;
pub const IC_CLR_INTR: u32 = 0x40;
pub const IC_CLR_RX_UNDER: u32 = 0x44;
pub const IC_CLR_RX_OVER: u32 = 0x48;
pub const IC_CLR_TX_OVER: u32 = 0x4c;
pub const IC_CLR_TX_ABRT: u32 = 0x54;
pub const IC_CLR_ACTIVITY: u32 = 0x5c;
pub const IC_CLR_STOP_DET: u32 = 0x60;
pub const IC_CLR_START_DET: u32 = 0x64;
pub const IC_ENABLE: u32 = 0x6c;
pub const IC_STATUS: u32 = 0x70;
pub const IC_TXFLR: u32 = 0x74;
pub const IC_RXFLR: u32 = 0x78;
pub const IC_SDA_HOLD: u32 = 0x7c;
pub const IC_TX_ABRT_SOURCE: u32 = 0x80;
pub const IC_DMA_CR: u32 = 0x88;
pub const IC_DMA_TDLR: u32 = 0x8c;
pub const IC_DMA_RDLR: u32 = 0x90;
pub const IC_SDA_SETUP: u32 = 0x94;
pub const IC_ACK_GENERAL_CALL: u32 = 0x98;
pub const IC_ENABLE_STATUS: u32 = 0x9c;
pub const IC_FS_SPKLEN: u32 = 0xa0;
pub const IC_COMP_VERSION: u32 = 0xf8;
pub const IC_COMP_TYPE: u32 = 0xfc;

pub const RX_FULL: u32 = 1 << 2;
pub const TX_EMPTY: u32 = 1 << 4;

const CON_MASK: u32 = 0x3ff;
const CON_MASTER_MODE: u32 = 0;
const CON_10BITADDR_MASTER: u32 = 4;
const CON_RESTART_EN: u32 = 5;
const CON_SLAVE_DISABLE: u32 = 6;
const CON_TX_EMPTY_CTRL: u32 = 8;
const SPEED_STANDARD: u32 = 1;
const TAR_SPECIAL: u32 = 11;
const ENABLE: u32 = 0;
const ENABLE_ABORT: u32 = 1;
const ENABLE_TX_CMD_BLOCK: u32 = 2;
const DMA_RX: u32 = 0;
const DMA_TX: u32 = 1;

/// What the firmware writes and reads back.
#[derive(Clone)]
pub struct Settings {
    con: u32,
    tar: u32,
    sar: u32,
    ss_hcnt: u32,
    ss_lcnt: u32,
    fs_hcnt: u32,
    fs_lcnt: u32,
    spike_length: u32,
    intr_mask: u32,
    rx_tl: u32,
    tx_tl: u32,
    enable: u32,
    sda_hold: u32,
    sda_setup: u32,
    ack_general_call: u32,
    dma_cr: u32,
    dma_tdlr: u32,
    dma_rdlr: u32,
}

impl Default for Settings {
    fn default() -> Self {
        Self {
            con: 0x65,
            tar: 0x55,
            sar: 0x55,
            ss_hcnt: 0x28,
            ss_lcnt: 0x2f,
            fs_hcnt: 0x06,
            fs_lcnt: 0x0d,
            spike_length: 0x07,
            intr_mask: 0x8ff,
            rx_tl: 0,
            tx_tl: 0,
            enable: 0,
            sda_hold: 1,
            sda_setup: 0x64,
            ack_general_call: 1,
            dma_cr: 0,
            dma_tdlr: 0,
            dma_rdlr: 0,
        }
    }
}

impl Settings {
    pub fn is_enabled(&self) -> bool {
        bit(self.enable, ENABLE)
    }

    pub fn may_transmit(&self) -> bool {
        self.is_enabled() && !bit(self.enable, ENABLE_TX_CMD_BLOCK)
    }

    /// The address of the device, checked to be one this model can reach.
    pub fn target(&self) -> u8 {
        let is_master = bit(self.con, CON_MASTER_MODE) && bit(self.con, CON_SLAVE_DISABLE);
        assert!(is_master, "I2C: slave mode is not modelled");
        assert!(
            !bit(self.con, CON_10BITADDR_MASTER) && !bit(self.tar, TAR_SPECIAL),
            "I2C: 10-bit addresses, general call and START byte are not modelled"
        );
        assert!(
            bit(self.con, CON_RESTART_EN),
            "I2C: RESTART disabled is not modelled"
        );
        self.tar as u8 & 0x7f
    }

    pub fn speed(&self) -> Speed {
        match field(self.con, 1, 2) {
            SPEED_STANDARD => Speed::of_counts(self.ss_hcnt, self.ss_lcnt, self.spike_length),
            _ => Speed::of_counts(self.fs_hcnt, self.fs_lcnt, self.spike_length),
        }
    }

    fn read(&self, offset: u32) -> u32 {
        match offset {
            IC_CON => self.con,
            IC_TAR => self.tar,
            IC_SAR => self.sar,
            IC_SS_SCL_HCNT => self.ss_hcnt,
            IC_SS_SCL_LCNT => self.ss_lcnt,
            IC_FS_SCL_HCNT => self.fs_hcnt,
            IC_FS_SCL_LCNT => self.fs_lcnt,
            IC_FS_SPKLEN => self.spike_length,
            IC_INTR_MASK => self.intr_mask,
            IC_RX_TL => self.rx_tl,
            IC_TX_TL => self.tx_tl,
            IC_ENABLE => self.enable,
            IC_SDA_HOLD => self.sda_hold,
            IC_SDA_SETUP => self.sda_setup,
            IC_ACK_GENERAL_CALL => self.ack_general_call,
            IC_DMA_CR => self.dma_cr,
            IC_DMA_TDLR => self.dma_tdlr,
            IC_DMA_RDLR => self.dma_rdlr,
            IC_COMP_VERSION => 0x3230_312a,
            IC_COMP_TYPE => 0x4457_0140,
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite) {
        match offset {
            IC_INTR_MASK => write.update(&mut self.intr_mask, 0x1fff),
            IC_RX_TL => write.update(&mut self.rx_tl, 0xff),
            IC_TX_TL => write.update(&mut self.tx_tl, 0xff),
            IC_ACK_GENERAL_CALL => write.update(&mut self.ack_general_call, 1),
            IC_DMA_CR => write.update(&mut self.dma_cr, 0b11),
            IC_DMA_TDLR => write.update(&mut self.dma_tdlr, 0xf),
            IC_DMA_RDLR => write.update(&mut self.dma_rdlr, 0xf),
            _ if !self.is_enabled() => self.write_while_disabled(offset, write),
            _ => {}
        }
    }

    /// Registers that "can be written only when the DW_apb_i2c is disabled". Low counts are at least
    /// 8, high counts at least 6: "hardware prevents values less than this being written".
    fn write_while_disabled(&mut self, offset: u32, write: RegisterWrite) {
        let at_least = |register: &mut u32, least: u32| {
            write.update(register, 0xffff);
            *register = least.max(*register);
        };
        match offset {
            IC_CON => write.update(&mut self.con, CON_MASK),
            IC_TAR => write.update(&mut self.tar, 0xfff),
            IC_SAR => write.update(&mut self.sar, 0x3ff),
            IC_SS_SCL_HCNT => at_least(&mut self.ss_hcnt, 6),
            IC_SS_SCL_LCNT => at_least(&mut self.ss_lcnt, 8),
            IC_FS_SCL_HCNT => at_least(&mut self.fs_hcnt, 6),
            IC_FS_SCL_LCNT => at_least(&mut self.fs_lcnt, 8),
            IC_FS_SPKLEN => {
                write.update(&mut self.spike_length, 0xff);
                self.spike_length = self.spike_length.max(1);
            }
            IC_SDA_HOLD => write.update(&mut self.sda_hold, 0xff_ffff),
            IC_SDA_SETUP => write.update(&mut self.sda_setup, 0xff),
            _ => {}
        }
    }
}

impl I2c {
    fn raw_interrupts(&self) -> u32 {
        let mut raw = self.master.latched;
        if self.receive_is_full() {
            raw |= RX_FULL;
        }
        if self.transmit_is_empty() {
            raw |= TX_EMPTY;
        }
        raw
    }

    fn receive_is_full(&self) -> bool {
        self.settings.is_enabled() && self.master.receive_level() > self.settings.rx_tl as usize
    }

    /// Disabled, the FIFO is empty "provided there is activity"; with TX_EMPTY_CTRL the byte taken
    /// last has to have left, too (IC_RAW_INTR_STAT.TX_EMPTY).
    fn transmit_is_empty(&self) -> bool {
        if !self.settings.is_enabled() {
            return self.master.is_active();
        }
        let waits_for_byte = bit(self.settings.con, CON_TX_EMPTY_CTRL) && self.master.is_shifting();
        self.master.transmit_level() <= self.settings.tx_tl as usize && !waits_for_byte
    }

    fn status(&self) -> u32 {
        let (transmit, receive) = (self.master.transmit_level(), self.master.receive_level());
        let active = u32::from(self.master.is_active());
        active
            | u32::from(transmit < FIFO_DEPTH) << 1
            | u32::from(transmit == 0) << 2
            | u32::from(receive > 0) << 3
            | u32::from(receive == FIFO_DEPTH) << 4
            | active << 5
    }

    fn read_clears(&mut self, interrupts: u32) -> u32 {
        let was_set = self.master.latched & interrupts != 0;
        self.master.clear(interrupts);
        u32::from(was_set)
    }

    fn write_enable(&mut self, write: RegisterWrite) {
        let was_enabled = self.settings.is_enabled();
        write.update(&mut self.settings.enable, 0b111);
        assert!(
            !bit(self.settings.enable, ENABLE_ABORT),
            "I2C: IC_ENABLE.ABORT is not modelled"
        );
        if was_enabled && !self.settings.is_enabled() {
            self.master.disable();
        }
    }
}

impl Peripheral for I2c {
    fn read(&mut self, offset: u32, _now: Cycle) -> u32 {
        match offset {
            IC_DATA_CMD => self.master.pop(),
            IC_INTR_STAT => self.raw_interrupts() & self.settings.intr_mask,
            IC_RAW_INTR_STAT => self.raw_interrupts(),
            IC_CLR_INTR => self.read_clears(u32::MAX),
            IC_CLR_RX_UNDER => self.read_clears(RX_UNDER),
            IC_CLR_RX_OVER => self.read_clears(RX_OVER),
            IC_CLR_TX_OVER => self.read_clears(TX_OVER),
            IC_CLR_TX_ABRT => self.read_clears(TX_ABRT),
            IC_CLR_ACTIVITY => self.read_clears(ACTIVITY),
            IC_CLR_STOP_DET => self.read_clears(STOP_DET),
            IC_CLR_START_DET => self.read_clears(START_DET),
            IC_STATUS => self.status(),
            IC_TXFLR => self.master.transmit_level() as u32,
            IC_RXFLR => self.master.receive_level() as u32,
            IC_TX_ABRT_SOURCE => self.master.abort_source,
            IC_ENABLE_STATUS => u32::from(self.settings.is_enabled() || self.master.is_active()),
            _ => self.settings.read(offset),
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, _now: Cycle) {
        match offset {
            IC_DATA_CMD if self.settings.is_enabled() => self.master.push(Command(write.value)),
            IC_ENABLE => self.write_enable(write),
            _ => self.settings.write(offset, write),
        }
    }

    /// The bus is outside the chip. A transaction that is cut off leaves no STOP on it.
    fn reset(&mut self, now: Cycle) {
        self.now = now;
        self.master = Master::default();
        self.settings = Settings::default();
    }

    fn advance(&mut self, now: Cycle) {
        self.advance_to(now);
    }

    fn next_event(&self) -> Cycle {
        if self.connected {
            self.master.next_event()
        } else {
            super::NEVER
        }
    }

    fn interrupt_lines(&self) -> u32 {
        let asked_for = self.raw_interrupts() & self.settings.intr_mask != 0;
        u32::from(asked_for) << self.place.interrupt_line
    }

    fn dma_requests(&self) -> u64 {
        let level = |enabled, reached: bool| {
            u64::from(self.settings.is_enabled() && bit(self.settings.dma_cr, enabled) && reached)
        };
        let has_room = self.master.transmit_level() <= self.settings.dma_tdlr as usize;
        let has_bytes = self.master.receive_level() > self.settings.dma_rdlr as usize;
        level(DMA_TX, has_room) << self.place.dma_request_tx
            | level(DMA_RX, has_bytes) << self.place.dma_request_rx
    }
}
