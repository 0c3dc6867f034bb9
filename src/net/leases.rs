//! Addresses that are given to others.

use core::net::Ipv4Addr;

use heapless::Vec;
use leasehund::{AdmissionEvent, DhcpConfig, DhcpServer, Outcome, Reply, TransactionEvent};

use super::address::ACCESS_POINT;
use crate::log::info;

/// The most addresses that are given to others.
pub(super) const MAX_CLIENTS: usize = 8;

const FIRST: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 2);
const LAST: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1 + MAX_CLIENTS as u8);

const NETMASK: Ipv4Addr = Ipv4Addr::new(255, 255, 255, 0);

/// A phone that has left keeps its address for so long.
const LEASE_S: u32 = 600;

/// Type of the message of a client that does not want the address it was given (RFC 2132).
const DECLINE: u8 = 4;

/// The addresses of the access point's network, and who has them.
///
/// No gateway and no name server is given: phones go on using their mobile network for all else.
pub(super) struct Leases(DhcpServer<MAX_CLIENTS, 0, 0, 0>);

impl Leases {
    /// All addresses are free.
    pub fn new() -> Self {
        Self(DhcpServer::with_config(DhcpConfig {
            server_ip: ACCESS_POINT,
            subnet_mask: NETMASK,
            router: None,
            dns_servers: Vec::new(),
            ip_pool_start: FIRST,
            ip_pool_end: LAST,
            lease_time: LEASE_S,
            domain_name: None,
        }))
    }

    /// Answers what came to the server's port at `now_ms`, milliseconds since boot. Anything may have come.
    pub fn answer(&mut self, request: &[u8], now_ms: u64) -> Option<Reply> {
        if let Some(client) = declining_client(request) {
            self.decline(client);
            return None;
        }
        let mut is_new_client = false;
        let mut outcome = self.0.handle_packet(request, now_ms, |_, event| {
            is_new_client = event == AdmissionEvent::Discover;
            true
        });
        // Those who only ask for addresses must not keep them from the others.
        if outcome.reply.is_none() && is_new_client && self.withdraw_oldest_offer() {
            outcome = self.0.handle_packet(request, now_ms, |_, _| true);
        }
        log(&outcome);
        outcome.reply
    }

    /// Frees the address of a client that does not want it. The server would withhold the declined address from all for ten minutes,
    /// and one client could decline them all.
    fn decline(&mut self, client: [u8; 6]) {
        if let Some(address) = self.0.revoke(client) {
            info!("DHCP: {:?} has declined {:?}", client, address.octets());
        }
    }

    /// Forgets the oldest offer that was not accepted yet. Whether there was one.
    fn withdraw_oldest_offer(&mut self) -> bool {
        let offers = self.0.leases().filter(|lease| !lease.bound);
        match offers
            .min_by_key(|offer| offer.expires_at_ms)
            .map(|offer| offer.mac)
        {
            Some(mac) => self.0.revoke(mac).is_some(),
            None => false,
        }
    }

    /// The addresses that are in use at `now_ms`, as far as is known.
    pub fn clients(&self, now_ms: u64) -> Vec<Ipv4Addr, MAX_CLIENTS> {
        let mut clients = Vec::new();
        for lease in self.0.leases() {
            if lease.bound && lease.expires_at_ms > now_ms {
                // There is room for all of them.
                let _ = clients.push(lease.ip);
            }
        }
        clients
    }
    /// Whether this client has this address from us.
    pub fn has(&self, mac: [u8; 6], address: Ipv4Addr) -> bool {
        let mut leases = self.0.leases();
        leases.any(|lease| lease.bound && lease.mac == mac && lease.ip == address)
    }

    /// Gives a client the first address.
    #[cfg(test)]
    pub fn lease_first_to(&mut self, mac: [u8; 6]) {
        self.answer(&tests::message_of(1, mac, None), 0);
        self.answer(&tests::message_of(3, mac, Some(FIRST)), 0);
    }
}

/// The hardware address of the client that sends a DHCPDECLINE; `None` for any other message.
fn declining_client(message: &[u8]) -> Option<[u8; 6]> {
    const CLIENT_MAC: usize = 28;
    const OPTIONS: usize = 240;
    let client = message.get(CLIENT_MAC..)?.first_chunk()?;
    (message_type(message.get(OPTIONS..)?) == Some(DECLINE)).then_some(*client)
}

/// The DHCP message type (option 53) among a message's options (RFC 2132).
fn message_type(mut options: &[u8]) -> Option<u8> {
    const PAD: u8 = 0;
    const MESSAGE_TYPE: u8 = 53;
    const END: u8 = 255;
    loop {
        options = match options {
            [PAD, rest @ ..] => rest,
            [MESSAGE_TYPE, 1, kind, ..] => return Some(*kind),
            [] | [END, ..] => return None,
            [_, length, rest @ ..] => rest.get(usize::from(*length)..)?,
            [_] => return None,
        };
    }
}

fn log(outcome: &Outcome) {
    match outcome.event {
        Some((TransactionEvent::Leased(address, mac), _)) => {
            info!("DHCP: {:?} has {:?}", mac, address.octets());
        }
        Some((TransactionEvent::Released(address, mac), _)) => {
            info!("DHCP: {:?} has released {:?}", mac, address.octets());
        }
        None => {}
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const DISCOVER: u8 = 1;
    const OFFER: u8 = 2;
    const REQUEST: u8 = 3;
    const ACK: u8 = 5;
    const NAK: u8 = 6;

    fn mac(number: u16) -> [u8; 6] {
        let [high, low] = number.to_be_bytes();
        [2, 0, 0, 0, high, low]
    }

    fn message(kind: u8, client: u16, wanted: Option<Ipv4Addr>) -> std::vec::Vec<u8> {
        message_of(kind, mac(client), wanted)
    }

    /// A client's message, which wants this address if any.
    pub fn message_of(kind: u8, client: [u8; 6], wanted: Option<Ipv4Addr>) -> std::vec::Vec<u8> {
        let mut message = vec![0; 240];
        message[..4].copy_from_slice(&[1, 1, 6, 0]);
        message[28..34].copy_from_slice(&client);
        message[236..].copy_from_slice(&[0x63, 0x82, 0x53, 0x63]);
        message.extend([53, 1, kind]);
        if let Some(wanted) = wanted {
            message.extend([50, 4]);
            message.extend(wanted.octets());
        }
        message.push(255);
        message
    }

    /// The kind of an answer, and the address it gives.
    fn answer(leases: &mut Leases, message: &[u8], now_ms: u64) -> Option<(u8, Ipv4Addr)> {
        let reply = leases.answer(message, now_ms)?;
        let bytes = reply.bytes();
        let address = [bytes[16], bytes[17], bytes[18], bytes[19]];
        Some((bytes[242], address.into()))
    }

    /// A client asks for an address and takes it.
    fn join(leases: &mut Leases, client: u16, now_ms: u64) -> Option<Ipv4Addr> {
        let (kind, offered) = answer(leases, &message(DISCOVER, client, None), now_ms)?;
        assert_eq!(kind, OFFER);
        let taken = answer(leases, &message(REQUEST, client, Some(offered)), now_ms)?;
        assert_eq!(taken, (ACK, offered));
        Some(offered)
    }

    #[test]
    fn eight_clients_have_an_address_each_until_they_are_silent_for_the_time_of_a_lease() {
        let mut leases = Leases::new();
        for client in 0..8 {
            assert_eq!(
                join(&mut leases, client, 0),
                Some([192, 168, 4, 2 + client as u8].into())
            );
        }
        assert_eq!(leases.clients(1).len(), MAX_CLIENTS);
        assert_eq!(join(&mut leases, 8, 1_000), None);
        // One of them renews its lease.
        let renewed = answer(
            &mut leases,
            &message(REQUEST, 3, Some([192, 168, 4, 5].into())),
            300_000,
        );
        assert_eq!(renewed, Some((ACK, [192, 168, 4, 5].into())));
        assert_eq!(leases.clients(600_000).len(), 1);
        assert_eq!(join(&mut leases, 8, 600_000), Some(FIRST));
        assert_eq!(leases.clients(600_001).len(), 2);
    }

    #[test]
    fn who_declines_frees_its_own_address_and_withholds_none() {
        let mut leases = Leases::new();
        let [driver, guest] = [1, 2].map(|client| join(&mut leases, client, 0).unwrap());
        for last in 2..10 {
            let declined = message(DECLINE, 2, Some([192, 168, 4, last].into()));
            assert_eq!(answer(&mut leases, &declined, 1), None);
        }
        assert!(leases.has(mac(1), driver));
        assert!(!leases.has(mac(2), guest));
        for client in 3..10 {
            assert!(join(&mut leases, client, 2).is_some(), "client {client}");
        }
    }

    #[test]
    fn a_message_type_is_found_among_options_of_any_length() {
        let typed = [0, 0, 50, 4, 192, 168, 4, 2, 61, 0, 53, 1, 4, 255];
        assert_eq!(message_type(&typed), Some(4));
        for length in 0..13 {
            assert_eq!(message_type(&typed[..length]), None, "{length}");
        }
        assert_eq!(message_type(&[255, 53, 1, 4]), None);
        assert_eq!(message_type(&[53, 2, 4, 4, 53, 1, 4]), Some(4));
    }

    #[test]
    fn a_thousand_that_only_ask_do_not_keep_a_phone_from_its_address() {
        let mut leases = Leases::new();
        assert_eq!(join(&mut leases, 5_000, 0), Some(FIRST));
        for client in 0..1_000 {
            let offer = answer(&mut leases, &message(DISCOVER, client, None), u64::from(client));
            assert!(matches!(offer, Some((OFFER, address)) if address != FIRST));
        }
        assert_eq!(leases.clients(1_000).as_slice(), [FIRST]);
        assert!(join(&mut leases, 6_000, 1_001).is_some());
        // Whose offer was withdrawn begins again.
        let late = answer(&mut leases, &message(REQUEST, 0, Some(FIRST)), 1_002);
        assert_eq!(late.map(|(kind, _)| kind), Some(NAK));
    }

    proptest! {
        #[test]
        fn nothing_that_comes_breaks_it(
            mut packets in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..600), 1..40),
            cut in 0_usize..250,
        ) {
            let mut leases = Leases::new();
            for (number, packet) in packets.iter_mut().enumerate() {
                // Half of them begin as a message does.
                if number % 2 == 0 {
                    let mut start = message(DISCOVER, number as u16, None);
                    start.truncate(cut);
                    packet.splice(..0, start);
                }
                if let Some(reply) = leases.answer(packet, number as u64) {
                    prop_assert!(reply.bytes().len() <= 320);
                }
                prop_assert!(leases.clients(0).len() <= MAX_CLIENTS);
            }
            prop_assert!(join(&mut leases, 9_999, 10_000_000).is_some());
        }
    }
}
