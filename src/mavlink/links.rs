//! The links of the board: the one table of their names, kinds and capacities.

use super::signing::LinkKind;

/// Links of the simulator: eight clients by TCP, one ground station by UDP, and two browsers.
pub const SIMULATED_LINKS: usize = 11;

/// The board's links, or on a host the simulator's, which are more.
pub const MAX_LINKS: usize = if cfg!(target_os = "none") {
    LinkId::ALL.len()
} else {
    SIMULATED_LINKS
};

/// A byte on a serial line has ten bits.
const BITS_PER_BYTE: u32 = 10;

/// Assumed capacity of the USB link: a packet of 64 bytes each millisecond, which any host polls for.
const USB_BYTES_PER_SECOND: u32 = 64_000;

/// Assumed capacity of each Wi-Fi link: more than all streams at their highest rates, and less than the radio's bus.
const WIFI_BYTES_PER_SECOND: u32 = 100_000;

/// A link of the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LinkId {
    /// The telemetry port.
    Uart0,
    /// The serial port on USB.
    Usb,
    /// The first ground station by UDP.
    Udp1,
    /// The second one.
    Udp2,
    /// The first client by TCP.
    Tcp1,
    /// The second one.
    Tcp2,
    /// The first browser.
    Web1,
    /// The second one.
    Web2,
}

impl LinkId {
    /// All links, in the order of the table.
    pub const ALL: [Self; 8] = [
        Self::Uart0,
        Self::Usb,
        Self::Udp1,
        Self::Udp2,
        Self::Tcp1,
        Self::Tcp2,
        Self::Web1,
        Self::Web2,
    ];

    /// The name in the log and in announcements.
    pub fn name(self) -> &'static str {
        match self {
            Self::Uart0 => "UART0",
            Self::Usb => "USB",
            Self::Udp1 => "UDP 1",
            Self::Udp2 => "UDP 2",
            Self::Tcp1 => "TCP 1",
            Self::Tcp2 => "TCP 2",
            Self::Web1 => "WEB 1",
            Self::Web2 => "WEB 2",
        }
    }

    /// The kind of link.
    pub fn kind(self) -> LinkKind {
        match self {
            Self::Uart0 => LinkKind::Radio,
            Self::Usb => LinkKind::Direct,
            Self::Udp1 | Self::Udp2 | Self::Tcp1 | Self::Tcp2 | Self::Web1 | Self::Web2 => LinkKind::Wifi,
        }
    }

    /// Its capacity, in bytes per second, if the telemetry port has this baud rate.
    pub fn bytes_per_second(self, telemetry_baud: u32) -> u32 {
        match self {
            Self::Uart0 => telemetry_baud / BITS_PER_BYTE,
            Self::Usb => USB_BYTES_PER_SECOND,
            Self::Udp1 | Self::Udp2 | Self::Tcp1 | Self::Tcp2 | Self::Web1 | Self::Web2 => {
                WIFI_BYTES_PER_SECOND
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_link_has_a_name_of_its_own() {
        for (index, link) in LinkId::ALL.into_iter().enumerate() {
            assert_eq!(link as usize, index);
            let same = LinkId::ALL
                .into_iter()
                .filter(|other| other.name() == link.name());
            assert_eq!(same.count(), 1, "{link:?}");
        }
    }

    #[test]
    fn the_cable_alone_is_direct_and_the_telemetry_port_alone_a_radio() {
        let of_kind = |kind| LinkId::ALL.into_iter().filter(move |link| link.kind() == kind);
        assert!(of_kind(LinkKind::Direct).eq([LinkId::Usb]));
        assert!(of_kind(LinkKind::Radio).eq([LinkId::Uart0]));
        assert_eq!(of_kind(LinkKind::Wifi).count(), 6);
    }

    #[test]
    fn only_the_telemetry_port_depends_on_the_baud_rate() {
        let at = |baud| LinkId::ALL.map(|link| link.bytes_per_second(baud));
        assert_eq!(
            at(115_200),
            [
                11_520, 64_000, 100_000, 100_000, 100_000, 100_000, 100_000, 100_000
            ]
        );
        assert_eq!(at(9_600)[0], 960);
        assert_eq!(at(9_600)[1..], at(115_200)[1..]);
    }
}
