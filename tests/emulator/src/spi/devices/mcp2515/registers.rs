//! Addresses and bits (tables 11-1 and 11-2).

pub const BFPCTRL: u8 = 0x0c;
pub const TXRTSCTRL: u8 = 0x0d;
/// At every address that ends with this.
pub const CANSTAT: u8 = 0x0e;
/// At every address that ends with this.
pub const CANCTRL: u8 = 0x0f;
pub const TEC: u8 = 0x1c;
pub const REC: u8 = 0x1d;
pub const CNF3: u8 = 0x28;
pub const CNF2: u8 = 0x29;
pub const CNF1: u8 = 0x2a;
pub const CANINTE: u8 = 0x2b;
pub const CANINTF: u8 = 0x2c;
pub const EFLG: u8 = 0x2d;
pub const TXB_CTRL: [u8; 3] = [0x30, 0x40, 0x50];
pub const RXB_CTRL: [u8; 2] = [0x60, 0x70];
/// The first of four registers of each filter.
pub const FILTERS: [u8; 6] = [0x00, 0x04, 0x08, 0x10, 0x14, 0x18];
/// The first of four registers of each mask.
pub const MASKS: [u8; 2] = [0x20, 0x24];

/// TXBnCTRL (register 3-1).
pub const ABTF: u8 = 1 << 6;
pub const MLOA: u8 = 1 << 5;
pub const TXERR: u8 = 1 << 4;
pub const TXREQ: u8 = 1 << 3;
pub const TXP: u8 = 0b11;

/// RXBnCTRL (registers 4-1 and 4-2).
pub const RXM: u8 = 0b11 << 5;
pub const BUKT: u8 = 1 << 2;

/// SIDL of buffers, filters and masks.
pub const EXIDE: u8 = 1 << 3;

/// CANINTF and CANINTE (registers 7-1 and 7-2).
pub const RXIF: [u8; 2] = [1 << 0, 1 << 1];
pub const TXIF: [u8; 3] = [1 << 2, 1 << 3, 1 << 4];
pub const ERRIF: u8 = 1 << 5;
pub const WAKIF: u8 = 1 << 6;
pub const MERRF: u8 = 1 << 7;

/// EFLG (register 6-3).
pub const EWARN: u8 = 1 << 0;
pub const RXWAR: u8 = 1 << 1;
pub const TXWAR: u8 = 1 << 2;
pub const RXEP: u8 = 1 << 3;
pub const TXEP: u8 = 1 << 4;
pub const TXBO: u8 = 1 << 5;
pub const RXOVR: [u8; 2] = [1 << 6, 1 << 7];

/// CANCTRL (register 10-1): ABAT and OSM.
pub const NOT_MODELLED: u8 = 0b11 << 3;
/// Configuration mode, CLKOUT with an eighth of the clock.
pub const CANCTRL_AFTER_RESET: u8 = 0x87;

/// Of REQOP and OPMOD.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mode {
    Normal = 0,
    Configuration = 4,
}

impl Mode {
    /// REQOP (register 10-1).
    pub fn requested(canctrl: u8) -> Self {
        match canctrl >> 5 {
            0 => Self::Normal,
            4 => Self::Configuration,
            mode => panic!("mode {mode} of the MCP2515 is not modelled"),
        }
    }

    /// OPMOD.
    pub fn opmod(self) -> u8 {
        (self as u8) << 5
    }
}

/// What can be changed in configuration mode only (10.1): CNF1 to 3, TXRTSCTRL, filters, masks.
pub fn is_configuration(address: u8) -> bool {
    is_filter_or_mask(address) || matches!(address, CNF3..=CNF1 | TXRTSCTRL)
}

pub fn is_filter_or_mask(address: u8) -> bool {
    let starts = FILTERS.iter().chain(&MASKS);
    starts
        .into_iter()
        .any(|start| (*start..start + 4).contains(&address))
}

/// The transmit buffer that has a register of a message at the address.
pub fn transmit_buffer(address: u8) -> Option<usize> {
    TXB_CTRL
        .iter()
        .position(|control| (control + 1..control + 14).contains(&address))
}

/// The shaded ones of table 11-1: BIT MODIFY works with them, with others it writes the whole byte.
pub fn is_bit_modifiable(address: u8) -> bool {
    matches!(address, BFPCTRL | TXRTSCTRL | CNF3..=EFLG)
        || address & 0xf == CANCTRL
        || TXB_CTRL.contains(&address)
        || RXB_CTRL.contains(&address)
}

/// The bits that a write changes.
pub fn writable(address: u8) -> u8 {
    match address {
        _ if address & 0xf == CANCTRL => 0xff,
        _ if address & 0xf == CANSTAT => 0,
        BFPCTRL => 0x3f,
        TXRTSCTRL => 0x07,
        TEC | REC => 0,
        CNF3 => 0xc7,
        EFLG => RXOVR[0] | RXOVR[1],
        _ if TXB_CTRL.contains(&address) => TXREQ | TXP,
        _ if address == RXB_CTRL[0] => RXM | BUKT,
        _ if address == RXB_CTRL[1] => RXM,
        // What was received.
        0x61..=0x6d | 0x71..=0x7d => 0,
        _ => 0xff,
    }
}
