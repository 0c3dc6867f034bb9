//! Events: frames of an Ethernet type of their own from the WLAN core's program to the driver.

/// Numbers of events (Broadcom's `bcmevent.h`).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    SetSsid = 0,
    Join = 1,
    Auth = 3,
    AuthInd = 4,
    DeauthInd = 6,
    Assoc = 7,
    AssocInd = 8,
    Disassoc = 11,
    DisassocInd = 12,
    Link = 16,
    PskSup = 46,
}

/// Its result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    Success = 0,
    NoNetworks = 3,
    Abort = 4,
    /// Of [`Kind::PskSup`]: the keys are there.
    Keyed = 6,
    /// Of [`Kind::PskSup`]: no message of the key exchange came.
    Partial = 8,
}

/// Loss of the beacons of a network.
pub const REASON_BEACONS_LOST: u32 = 1;
/// The driver has asked for it.
pub const REASON_DISASSOCIATED: u32 = 2;
/// The four-way handshake took too long, as it does with the wrong passphrase.
pub const REASON_KEY_TIME_OUT: u32 = 15;
/// IEEE 802.11 reason 6: a frame of a station that is not authenticated.
pub const REASON_NOT_AUTHENTICATED: u32 = 6;
/// IEEE 802.11 reason 8: the station is leaving.
pub const REASON_STATION_LEAVES: u32 = 8;

/// Of [`Kind::Link`]: it is up.
pub const FLAG_LINK_UP: u16 = 1;

const ETHER_TYPE: u16 = 0x886c;
const SUBTYPE: u16 = 0x8001;
const OUI: [u8; 3] = [0x00, 0x10, 0x18];
const USER_SUBTYPE: u16 = 1;
const VERSION: u16 = 2;
const MESSAGE_BYTES: u16 = 48;
const LOCALLY_ADMINISTERED: u8 = 0x02;

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Event {
    pub kind: Kind,
    pub status: Status,
    pub flags: u16,
    pub reason: u32,
    /// The other station, if there is one.
    pub address: [u8; 6],
}

impl Event {
    pub fn new(kind: Kind, status: Status) -> Self {
        Self {
            kind,
            status,
            flags: 0,
            reason: 0,
            address: [0; 6],
        }
    }

    pub fn with_flags(self, flags: u16) -> Self {
        Self { flags, ..self }
    }

    pub fn because(self, reason: u32) -> Self {
        Self { reason, ..self }
    }

    pub fn of(self, address: [u8; 6]) -> Self {
        Self { address, ..self }
    }

    /// As it is sent to the driver of the station with this address. Its numbers have the network's order.
    pub fn frame(&self, own: [u8; 6]) -> Vec<u8> {
        let mut source = own;
        source[0] |= LOCALLY_ADMINISTERED;
        let mut frame = [own, source].concat();
        frame.extend(ETHER_TYPE.to_be_bytes());
        frame.extend(SUBTYPE.to_be_bytes());
        frame.extend(MESSAGE_BYTES.to_be_bytes());
        frame.push(0);
        frame.extend(OUI);
        frame.extend(USER_SUBTYPE.to_be_bytes());
        frame.extend(VERSION.to_be_bytes());
        frame.extend(self.flags.to_be_bytes());
        // No authentication type, and no data behind the event.
        for number in [self.kind as u32, self.status as u32, self.reason, 0, 0] {
            frame.extend(number.to_be_bytes());
        }
        frame.extend(self.address);
        frame.extend(*b"wl0\0\0\0\0\0\0\0\0\0\0\0\0\0");
        frame.extend([0, 0]);
        frame
    }
}

/// Which events the driver wants: a bit each.
#[derive(Clone, Debug, Default)]
pub struct Mask {
    bits: Vec<u8>,
}

impl Mask {
    pub fn of(bits: &[u8]) -> Self {
        Self { bits: bits.to_vec() }
    }

    pub fn wants(&self, kind: Kind) -> bool {
        let number = kind as usize;
        let byte = self.bits.get(number / 8).copied().unwrap_or(0);
        byte >> (number % 8) & 1 != 0
    }
}
