//! Ingress filter: which received frames are processed.

use core::cell::{Cell, RefCell};
use core::net::Ipv4Addr;

use super::dhcp::now_ms;
use super::leases::Leases;
use crate::announce::RateLimit;
use crate::log::info;
use crate::tasks::now;

const ETHERTYPE_IPV4: [u8; 2] = [0x08, 0x00];
const ETHERTYPE_ARP: [u8; 2] = [0x08, 0x06];
const PROTOCOL_UDP: u8 = 17;
const DHCP_SERVER_PORT: [u8; 2] = [0, 67];

// Offsets into an Ethernet frame.
const SOURCE_MAC: usize = 6;
const ETHERTYPE: usize = 12;
const ARP_SENDER: usize = 22;
const ARP_SENDER_IP: usize = 28;
const IP_HEADER: usize = 14;
const IP_PROTOCOL: usize = 23;
const IP_SOURCE: usize = 26;

/// Offset of the client's hardware address (`chaddr`) into a UDP datagram that carries a DHCP message.
const DHCP_CLIENT_MAC: usize = 8 + 28;

/// Minimum interval between log lines about refused frames or stations.
const LOG_INTERVAL_US: u64 = 10_000_000;

/// Rate limit of the log lines about refused frames, or about refused stations.
pub(super) type RefusalLog = Cell<RateLimit<LOG_INTERVAL_US>>;

/// Whether a line is written now; then it counts.
pub(super) fn may_log(limit: &RefusalLog) -> bool {
    let mut rate = limit.get();
    let is_allowed = rate.take(now());
    limit.set(rate);
    is_allowed
}

/// Accepts IPv4 and ARP, and at the board's own access point only from senders that use the address they have been given.
///
/// At its own access point the board knows which address it has given to which computer. Frames with another sender are refused there:
/// spoofed addresses would push the others out of the ARP cache, and occupy the sockets. A DHCP message on behalf of another computer is
/// refused, too: it could release that one's address. ARP on behalf of another could be lent every free address.
pub(super) struct IngressFilter<'a> {
    /// Leases of the access point; `None` in another's network.
    leases: Option<&'a RefCell<Leases>>,
    refused: Cell<u32>,
    log: RefusalLog,
}

impl<'a> IngressFilter<'a> {
    pub fn new(leases: Option<&'a RefCell<Leases>>) -> Self {
        Self {
            leases,
            refused: Cell::new(0),
            log: Cell::default(),
        }
    }

    /// Whether a frame is to be processed. Counts one that is refused.
    pub fn accepts(&self, frame: &[u8]) -> bool {
        let is_accepted = match part(frame, ETHERTYPE) {
            Some(ETHERTYPE_ARP) => {
                let sender = part(frame, SOURCE_MAC);
                part(frame, ARP_SENDER) == sender && self.is_known(sender, part(frame, ARP_SENDER_IP))
            }
            Some(ETHERTYPE_IPV4) => match to_dhcp_server(frame) {
                Some(message) => self.leases.is_none() || is_about_sender(frame, message),
                None => self.is_known(part(frame, SOURCE_MAC), part(frame, IP_SOURCE)),
            },
            _ => return false,
        };
        if !is_accepted {
            self.count();
        }
        is_accepted
    }

    /// Whether the sender has the address from us.
    fn is_known(&self, mac: Option<[u8; 6]>, address: Option<[u8; 4]>) -> bool {
        let (Some(mac), Some(address)) = (mac, address) else {
            return false;
        };
        match self.leases {
            None => true,
            Some(leases) => leases
                .try_borrow_mut()
                .is_ok_and(|mut leases| leases.accepts(mac, Ipv4Addr::from(address), now_ms())),
        }
    }

    fn count(&self) {
        let refused = self.refused.get().saturating_add(1);
        self.refused.set(refused);
        if may_log(&self.log) {
            info!("Wi-Fi: {} frames of unknown senders refused", refused);
        }
    }
}

/// The UDP datagram of a message to the DHCP server, which also serves clients without an address.
fn to_dhcp_server(frame: &[u8]) -> Option<&[u8]> {
    let header_bytes = usize::from(frame.get(IP_HEADER)? & 0x0f) * 4;
    let datagram = frame.get(IP_HEADER + header_bytes..)?;
    let is_to_server =
        frame.get(IP_PROTOCOL) == Some(&PROTOCOL_UDP) && part(datagram, 2) == Some(DHCP_SERVER_PORT);
    is_to_server.then_some(datagram)
}

/// Whether the client of a DHCP message is the computer that sends it.
fn is_about_sender(frame: &[u8], datagram: &[u8]) -> bool {
    part::<6>(datagram, DHCP_CLIENT_MAC).is_some_and(|client| part(frame, SOURCE_MAC) == Some(client))
}

fn part<const BYTES: usize>(frame: &[u8], at: usize) -> Option<[u8; BYTES]> {
    frame.get(at..)?.first_chunk().copied()
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const PHONE: [u8; 6] = [2, 0, 0, 0, 0, 1];
    const UNKNOWN: [u8; 6] = [2, 0, 0, 0, 0, 2];
    const ADDRESS: [u8; 4] = [192, 168, 4, 2];
    const OTHER: [u8; 4] = [192, 168, 4, 200];

    fn arp(mac: [u8; 6], address: [u8; 4]) -> Vec<u8> {
        let mut frame = vec![0; 42];
        frame[SOURCE_MAC..12].copy_from_slice(&mac);
        frame[ETHERTYPE..14].copy_from_slice(&ETHERTYPE_ARP);
        frame[ARP_SENDER..28].copy_from_slice(&mac);
        frame[ARP_SENDER_IP..32].copy_from_slice(&address);
        frame
    }

    fn datagram(mac: [u8; 6], address: [u8; 4], port: u16) -> Vec<u8> {
        let mut frame = vec![0; 60];
        frame[SOURCE_MAC..12].copy_from_slice(&mac);
        frame[ETHERTYPE..14].copy_from_slice(&ETHERTYPE_IPV4);
        frame[IP_HEADER] = 0x45;
        frame[IP_PROTOCOL] = PROTOCOL_UDP;
        frame[IP_SOURCE..30].copy_from_slice(&address);
        frame[36..38].copy_from_slice(&port.to_be_bytes());
        frame
    }

    fn leased() -> RefCell<Leases> {
        let mut leases = Leases::without_retained();
        leases.lease_first_to(PHONE);
        RefCell::new(leases)
    }

    fn accepts(leases: Option<&RefCell<Leases>>, frame: &[u8]) -> bool {
        IngressFilter::new(leases).accepts(frame)
    }

    #[test]
    fn at_the_access_point_only_senders_with_an_address_from_it_are_accepted() {
        let leases = leased();
        for make in [arp, |mac, address| datagram(mac, address, 14550)] {
            assert!(accepts(Some(&leases), &make(PHONE, ADDRESS)));
            assert!(!accepts(Some(&leases), &make(PHONE, OTHER)));
            assert!(!accepts(Some(&leases), &make(UNKNOWN, ADDRESS)));
            assert!(!accepts(Some(&leases), &make(UNKNOWN, OTHER)));
            assert!(accepts(None, &make(UNKNOWN, OTHER)), "in another's network");
        }
    }

    /// A DHCP message about a client.
    fn dhcp(mac: [u8; 6], address: [u8; 4], client: [u8; 6]) -> Vec<u8> {
        let mut frame = datagram(mac, address, 67);
        frame.resize(300, 0);
        frame[70..76].copy_from_slice(&client);
        frame
    }

    #[test]
    fn a_dhcp_message_is_accepted_if_it_is_about_its_sender() {
        let leases = leased();
        let at_access_point = |frame: &[u8]| accepts(Some(&leases), frame);
        assert!(
            at_access_point(&dhcp(UNKNOWN, [0; 4], UNKNOWN)),
            "it asks for an address"
        );
        assert!(
            at_access_point(&dhcp(PHONE, ADDRESS, PHONE)),
            "it renews its lease"
        );
        for address in [[0; 4], ADDRESS, OTHER] {
            assert!(!at_access_point(&dhcp(UNKNOWN, address, PHONE)));
            assert!(!at_access_point(&dhcp(PHONE, address, UNKNOWN)));
        }
        assert!(!at_access_point(&dhcp(PHONE, ADDRESS, PHONE)[..75]), "cut short");
        assert!(
            accepts(None, &dhcp(UNKNOWN, OTHER, PHONE)),
            "in another's network"
        );
        let mut with_options = dhcp(PHONE, ADDRESS, PHONE);
        with_options[IP_HEADER] = 0x46;
        with_options.splice(34..34, [1; 4]);
        assert!(at_access_point(&with_options));
        with_options[75] ^= 1;
        assert!(!at_access_point(&with_options));
    }

    #[test]
    fn arp_on_behalf_of_another_is_refused() {
        let leases = leased();
        // The other address would be lent to the unknown sender.
        for address in [ADDRESS, [192, 168, 4, 3]] {
            let mut frame = arp(PHONE, address);
            frame[SOURCE_MAC..12].copy_from_slice(&UNKNOWN);
            assert!(!accepts(Some(&leases), &frame), "{address:?}");
        }
    }

    #[test]
    fn other_protocols_than_arp_and_ipv4_are_refused() {
        let mut frame = datagram(PHONE, ADDRESS, 14550);
        frame[ETHERTYPE..14].copy_from_slice(&[0x86, 0xdd]);
        assert!(!accepts(None, &frame));
    }

    proptest! {
        #[test]
        fn no_frame_makes_it_panic(frame in prop::collection::vec(any::<u8>(), 0..80), kind in 0..3) {
            let mut frame = frame;
            let kinds = [ETHERTYPE_ARP, ETHERTYPE_IPV4, [0, 0]];
            if frame.len() >= 14 {
                frame[ETHERTYPE..14].copy_from_slice(&kinds[kind as usize]);
            }
            accepts(Some(&leased()), &frame);
        }
    }
}
