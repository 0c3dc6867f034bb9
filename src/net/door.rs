//! Ingress filter: whose frames are let in.

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

/// Limit of the lines about strangers of one kind.
pub(super) type RefusalLog = Cell<RateLimit<LOG_INTERVAL_US>>;

/// Whether a line is written now; then it counts.
pub(super) fn may_log(limit: &RefusalLog) -> bool {
    let mut rate = limit.get();
    let is_allowed = rate.take(now());
    limit.set(rate);
    is_allowed
}

/// Lets frames in that mean something to the board.
///
/// At its own access point the board knows which address it has given to which computer. Frames with another sender are refused there: those
/// who invent addresses would push the others out of the list of neighbours, and occupy the places for connections. A DHCP message on behalf of
/// another computer is refused, too: it could release that one's address. So is ARP on behalf of another: it could be lent every free address.
pub(super) struct Door<'a> {
    /// Of the access point; `None` in another's network.
    leases: Option<&'a RefCell<Leases>>,
    refused: Cell<u32>,
    log: RefusalLog,
}

impl<'a> Door<'a> {
    pub fn new(leases: Option<&'a RefCell<Leases>>) -> Self {
        Self {
            leases,
            refused: Cell::new(0),
            log: Cell::default(),
        }
    }

    /// Whether a frame comes in.
    pub fn admits(&self, frame: &[u8]) -> bool {
        let is_admitted = match part(frame, ETHERTYPE) {
            Some(ETHERTYPE_ARP) => {
                let sender = part(frame, SOURCE_MAC);
                part(frame, ARP_SENDER) == sender && self.is_known(sender, part(frame, ARP_SENDER_IP))
            }
            Some(ETHERTYPE_IPV4) => match to_dhcp_server(frame) {
                Some(message) => self.leases.is_none() || speaks_for_itself(frame, message),
                None => self.is_known(part(frame, SOURCE_MAC), part(frame, IP_SOURCE)),
            },
            _ => return false,
        };
        if !is_admitted {
            self.count();
        }
        is_admitted
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
                .is_ok_and(|mut leases| leases.admits(mac, Ipv4Addr::from(address), now_ms())),
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

/// The UDP datagram of a message to the DHCP server, which also hears who has no address yet.
fn to_dhcp_server(frame: &[u8]) -> Option<&[u8]> {
    let header_bytes = usize::from(frame.get(IP_HEADER)? & 0x0f) * 4;
    let datagram = frame.get(IP_HEADER + header_bytes..)?;
    let is_to_server =
        frame.get(IP_PROTOCOL) == Some(&PROTOCOL_UDP) && part(datagram, 2) == Some(DHCP_SERVER_PORT);
    is_to_server.then_some(datagram)
}

/// Whether a DHCP message is about the computer that sends it.
fn speaks_for_itself(frame: &[u8], datagram: &[u8]) -> bool {
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
    const STRANGER: [u8; 6] = [2, 0, 0, 0, 0, 2];
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

    fn admits(leases: Option<&RefCell<Leases>>, frame: &[u8]) -> bool {
        Door::new(leases).admits(frame)
    }

    #[test]
    fn at_the_access_point_only_those_come_in_who_have_their_address_from_it() {
        let leases = leased();
        for make in [arp, |mac, address| datagram(mac, address, 14550)] {
            assert!(admits(Some(&leases), &make(PHONE, ADDRESS)));
            assert!(!admits(Some(&leases), &make(PHONE, OTHER)));
            assert!(!admits(Some(&leases), &make(STRANGER, ADDRESS)));
            assert!(!admits(Some(&leases), &make(STRANGER, OTHER)));
            assert!(admits(None, &make(STRANGER, OTHER)), "in another's network");
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
    fn a_dhcp_message_comes_in_if_it_is_about_its_sender() {
        let leases = leased();
        let at_access_point = |frame: &[u8]| admits(Some(&leases), frame);
        assert!(
            at_access_point(&dhcp(STRANGER, [0; 4], STRANGER)),
            "it asks for an address"
        );
        assert!(
            at_access_point(&dhcp(PHONE, ADDRESS, PHONE)),
            "it renews its lease"
        );
        for address in [[0; 4], ADDRESS, OTHER] {
            assert!(!at_access_point(&dhcp(STRANGER, address, PHONE)));
            assert!(!at_access_point(&dhcp(PHONE, address, STRANGER)));
        }
        assert!(!at_access_point(&dhcp(PHONE, ADDRESS, PHONE)[..75]), "cut short");
        assert!(
            admits(None, &dhcp(STRANGER, OTHER, PHONE)),
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
    fn arp_on_behalf_of_another_stays_outside() {
        let leases = leased();
        // The other address would be lent to the stranger.
        for address in [ADDRESS, [192, 168, 4, 3]] {
            let mut frame = arp(PHONE, address);
            frame[SOURCE_MAC..12].copy_from_slice(&STRANGER);
            assert!(!admits(Some(&leases), &frame), "{address:?}");
        }
    }

    #[test]
    fn what_is_neither_arp_nor_ipv4_stays_outside() {
        let mut frame = datagram(PHONE, ADDRESS, 14550);
        frame[ETHERTYPE..14].copy_from_slice(&[0x86, 0xdd]);
        assert!(!admits(None, &frame));
    }

    proptest! {
        #[test]
        fn nothing_that_comes_breaks_it(frame in prop::collection::vec(any::<u8>(), 0..80), kind in 0..3) {
            let mut frame = frame;
            let kinds = [ETHERTYPE_ARP, ETHERTYPE_IPV4, [0, 0]];
            if frame.len() >= 14 {
                frame[ETHERTYPE..14].copy_from_slice(&kinds[kind as usize]);
            }
            admits(Some(&leased()), &frame);
        }
    }
}
