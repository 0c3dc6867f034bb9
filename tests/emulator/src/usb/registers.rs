//! Registers of USBCTRL (datasheet 4.1.4) and their bits, as far as device mode uses them.

pub const ADDR_ENDP: u32 = 0x00;
pub const MAIN_CTRL: u32 = 0x40;
pub const SOF_RD: u32 = 0x48;
pub const SIE_CTRL: u32 = 0x4c;
pub const SIE_STATUS: u32 = 0x50;
pub const BUFF_STATUS: u32 = 0x58;
pub const EP_ABORT: u32 = 0x60;
pub const EP_ABORT_DONE: u32 = 0x64;
pub const EP_STALL_ARM: u32 = 0x68;
pub const USB_MUXING: u32 = 0x74;
pub const USB_PWR: u32 = 0x78;
pub const INTR: u32 = 0x8c;
pub const INTE: u32 = 0x90;
pub const INTF: u32 = 0x94;
pub const INTS: u32 = 0x98;
/// One word each, up to INTS.
pub const REGISTERS: usize = 0x9c / 4;

pub const MAIN_CTRL_CONTROLLER_EN: u32 = 1 << 0;
pub const MAIN_CTRL_HOST: u32 = 1 << 1;
pub const MUXING_TO_PHY: u32 = 1 << 0;
pub const PWR_VBUS_DETECT: u32 = 1 << 2;
pub const PWR_VBUS_DETECT_OVERRIDE: u32 = 1 << 3;

pub const SIE_CTRL_PULLUP: u32 = 1 << 16;
pub const SIE_CTRL_EP0_INT_1BUF: u32 = 1 << 29;
/// Double buffering and interrupts of NAK and STALL on EP0, and the remote wakeup.
pub const SIE_CTRL_NOT_MODELLED: u32 = 1 << 12 | 1 << 27 | 1 << 28 | 1 << 30 | 1 << 31;

pub const STATUS_SUSPENDED: u32 = 1 << 4;
pub const STATUS_RESUME: u32 = 1 << 11;
pub const STATUS_CONNECTED: u32 = 1 << 16;
pub const STATUS_SETUP_REC: u32 = 1 << 17;
pub const STATUS_TRANS_COMPLETE: u32 = 1 << 18;
pub const STATUS_BUS_RESET: u32 = 1 << 19;
pub const STATUS_CRC_ERROR: u32 = 1 << 24;
pub const STATUS_RX_TIMEOUT: u32 = 1 << 27;
pub const STATUS_ACK_REC: u32 = 1 << 30;
pub const STATUS_DATA_SEQ_ERROR: u32 = 1 << 31;
/// What a one written to it clears.
pub const STATUS_CLEARABLE: u32 = 0xff0e_0810;

/// INTR's bits and the bits of SIE_STATUS that they repeat.
pub const STATUS_INTERRUPTS: [(u32, u32); 8] = [
    (1 << 3, STATUS_TRANS_COMPLETE),
    (1 << 5, STATUS_DATA_SEQ_ERROR),
    (1 << 6, STATUS_RX_TIMEOUT),
    (1 << 9, STATUS_CRC_ERROR),
    (1 << 12, STATUS_BUS_RESET),
    (1 << 14, STATUS_SUSPENDED),
    (1 << 15, STATUS_RESUME),
    (1 << 16, STATUS_SETUP_REC),
];
pub const INT_BUFF_STATUS: u32 = 1 << 4;
pub const INT_DEV_SOF: u32 = 1 << 17;
pub const INT_ABORT_DONE: u32 = 1 << 18;

/// Endpoint control, in the DPRAM (4.1.2.5.3).
pub const EP_ENABLE: u32 = 1 << 31;
pub const EP_DOUBLE_BUFFERED: u32 = 1 << 30;
pub const EP_INT_1BUF: u32 = 1 << 29;

/// Buffer control, in the DPRAM (4.1.2.5.4): the half for buffer 0.
pub const BUFFER_FULL: u32 = 1 << 15;
pub const BUFFER_LAST: u32 = 1 << 14;
pub const BUFFER_DATA1: u32 = 1 << 13;
pub const BUFFER_STALL: u32 = 1 << 11;
pub const BUFFER_AVAILABLE: u32 = 1 << 10;
pub const BUFFER_LENGTH: u32 = 0x3ff;
