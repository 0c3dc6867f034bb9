//! Addresses that are given to others.

use core::net::Ipv4Addr;

use heapless::Vec;
use leasehund::{AdmissionEvent, DhcpConfig, DhcpServer, Lease, Outcome, Reply, TransactionEvent};

use super::address::{ACCESS_POINT, MAX_CLIENTS};
use super::retained_leases::{Holders, RetainedLeases};
use crate::log::info;

const FIRST: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 2);
const LAST: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1 + MAX_CLIENTS as u8);

const NETMASK: Ipv4Addr = Ipv4Addr::new(255, 255, 255, 0);

/// Time for which a phone that has left keeps its address.
const LEASE_S: u32 = 600;

/// Since boot: a lease from before it has expired by then.
const OLD_LEASES_END_MS: u64 = LEASE_S as u64 * 1_000;

/// Types of messages (RFC 2132).
const REQUEST: u8 = 3;
/// Of a client that does not want the address it was given.
const DECLINE: u8 = 4;

// Options (RFC 2132).
const PAD: u8 = 0;
const REQUESTED_ADDRESS: u8 = 50;
const MESSAGE_TYPE: u8 = 53;
const END: u8 = 255;

// Their offsets in a message (RFC 2131).
const CLIENT_MAC: usize = 28;
const MAGIC_COOKIE: usize = 236;
const OPTIONS: usize = 240;

/// A message with no more than its type and an address.
const SHORT_MESSAGE_BYTES: usize = OPTIONS + 10;

/// The addresses of the access point's network, and the clients that have them.
///
/// A phone that keeps its address while the board restarts need not ask for it again. After a reset it has it still. After power-up,
/// an address that is free is lent to the first that uses it: one to each computer, for as long as a lease from before can last. A loan
/// is withdrawn when another computer asks for an address and there is none left.
///
/// No gateway and no name server is given: phones go on using their mobile network for all else.
pub(super) struct Leases {
    server: DhcpServer<MAX_CLIENTS, 0, 0, 0>,
    /// Bit n: the lease of the n-th address is a loan.
    loans: u8,
    retained: &'static RetainedLeases,
}

impl Leases {
    /// The leases from before the last reset. All other addresses are free.
    pub fn new(retained: &'static RetainedLeases) -> Self {
        let mut leases = Self {
            server: DhcpServer::with_config(DhcpConfig {
                server_ip: ACCESS_POINT,
                subnet_mask: NETMASK,
                router: None,
                dns_servers: Vec::new(),
                ip_pool_start: FIRST,
                ip_pool_end: LAST,
                lease_time: LEASE_S,
                domain_name: None,
            }),
            loans: 0,
            retained,
        };
        for (address, holder) in (FIRST.to_bits()..).zip(retained.recall()) {
            let address = Ipv4Addr::from_bits(address);
            if holder != [0; 6] && leases.give(holder, address) {
                info!("DHCP: {:?} has kept {:?}", holder, address.octets());
            }
        }
        leases
    }

    /// Answers what came to the server's port at `now_ms`, milliseconds since boot. Anything may have come.
    pub fn answer(&mut self, request: &[u8], now_ms: u64) -> Option<Reply> {
        let reply = match declining_client(request) {
            Some(client) => {
                self.decline(client);
                None
            }
            None => self.serve(request, now_ms),
        };
        self.retained.retain(&self.holders());
        reply
    }

    fn serve(&mut self, request: &[u8], now_ms: u64) -> Option<Reply> {
        let (mut outcome, kind) = self.handle(request, now_ms);
        // A client that did not ask, or only asked, must not keep addresses from the others.
        if outcome.reply.is_none() && kind == Some(AdmissionEvent::Discover) && self.withdraw() {
            (outcome, _) = self.handle(request, now_ms);
        }
        if let Some((TransactionEvent::Leased(address, _), _)) = outcome.event {
            self.loans &= !bit(address);
        }
        log(&outcome);
        outcome.reply
    }

    /// The server's outcome, and the request.
    // Generic over its closure, the server would be in flash for each caller.
    fn handle(&mut self, request: &[u8], now_ms: u64) -> (Outcome, Option<AdmissionEvent>) {
        let mut kind = None;
        let outcome = self.server.handle_packet(request, now_ms, |_, event| {
            kind = Some(event);
            true
        });
        (outcome, kind)
    }

    /// Frees the address of a client that does not want it. The server would withhold the declined address from all for ten minutes,
    /// and one client could decline them all.
    fn decline(&mut self, client: [u8; 6]) {
        if let Some(address) = self.server.revoke(client) {
            info!("DHCP: {:?} has declined {:?}", client, address.octets());
        }
    }

    /// Withdraws a loan, or else the oldest offer that was not accepted yet. Whether there was one.
    fn withdraw(&mut self) -> bool {
        // The server gives the lowest addresses: the others may be invented.
        let loans = self.server.leases().filter(|lease| self.is_loan(lease));
        let loan = loans.max_by_key(|loan| loan.ip);
        let offers = self.server.leases().filter(|lease| !lease.bound);
        let withdrawn = loan.or_else(|| offers.min_by_key(|offer| offer.expires_at_ms));
        withdrawn.is_some_and(|lease| self.server.revoke(lease.mac).is_some())
    }

    fn is_loan(&self, lease: &Lease) -> bool {
        lease.bound && self.loans & bit(lease.ip) != 0
    }

    /// The addresses that are in use at `now_ms`, as far as is known.
    pub fn clients(&self, now_ms: u64) -> Vec<Ipv4Addr, MAX_CLIENTS> {
        let mut clients = Vec::new();
        for lease in self.server.leases() {
            if is_valid(&lease, now_ms) {
                // There is room for all of them.
                let _ = clients.push(lease.ip);
            }
        }
        clients
    }

    /// Whether this client may use this address at `now_ms`: it has it from us, or the address is free and is lent to it.
    pub fn accepts(&mut self, client: [u8; 6], address: Ipv4Addr, now_ms: u64) -> bool {
        self.has(client, address, now_ms) || self.lend(client, address, now_ms)
    }

    fn has(&self, client: [u8; 6], address: Ipv4Addr, now_ms: u64) -> bool {
        let mut leases = self.server.leases();
        leases.any(|lease| lease.mac == client && lease.ip == address && is_valid(&lease, now_ms))
    }

    /// Lends an address to a client that uses it. Whether it could be.
    fn lend(&mut self, client: [u8; 6], address: Ipv4Addr, now_ms: u64) -> bool {
        if now_ms >= OLD_LEASES_END_MS || bit(address) == 0 {
            return false;
        }
        self.server.purge_expired_leases_at(now_ms);
        let mut leases = self.server.leases();
        if leases.any(|lease| lease.mac == client || lease.ip == address) {
            return false;
        }
        drop(leases);
        let is_lent = self.give(client, address);
        if is_lent {
            self.loans |= bit(address);
            info!("DHCP: {:?} is lent {:?}", client, address.octets());
        }
        is_lent
    }

    /// Gives a client the address it had before the board's start, by the request that it need not send. Whether it could be.
    fn give(&mut self, client: [u8; 6], address: Ipv4Addr) -> bool {
        let (outcome, _) = self.handle(&request(client, address), 0);
        outcome.event.is_some()
    }

    /// All addresses are free.
    #[cfg(test)]
    pub fn without_retained() -> Self {
        Self::new(std::boxed::Box::leak(std::boxed::Box::default()))
    }

    /// Gives a client the first address.
    #[cfg(test)]
    pub fn lease_first_to(&mut self, mac: [u8; 6]) {
        self.answer(&tests::message_of(1, mac, None), 0);
        self.answer(&tests::message_of(3, mac, Some(FIRST)), 0);
    }

    /// The clients that have asked for their address.
    fn holders(&self) -> Holders {
        let mut holders = Holders::default();
        for lease in self.server.leases() {
            let holder = index_of(lease.ip).and_then(|index| holders.get_mut(index));
            if let Some(holder) = holder.filter(|_| lease.bound && !self.is_loan(&lease)) {
                *holder = lease.mac;
            }
        }
        holders
    }
}

fn is_valid(lease: &Lease, now_ms: u64) -> bool {
    lease.bound && lease.expires_at_ms > now_ms
}

/// Index of an address among those that are given to others.
fn index_of(address: Ipv4Addr) -> Option<usize> {
    let index = address.to_bits().checked_sub(FIRST.to_bits())? as usize;
    (index < MAX_CLIENTS).then_some(index)
}

/// The bit of an address; 0 if it is not given to others.
fn bit(address: Ipv4Addr) -> u8 {
    index_of(address).map_or(0, |index| 1 << index)
}

/// A DHCPREQUEST for an address that the client has had before.
fn request(client: [u8; 6], address: Ipv4Addr) -> [u8; SHORT_MESSAGE_BYTES] {
    const START: [u8; 4] = [1, 1, 6, 0];
    const COOKIE: [u8; 4] = [0x63, 0x82, 0x53, 0x63];
    let [a, b, c, d] = address.octets();
    let mut message = [0; SHORT_MESSAGE_BYTES];
    let mut put = |at: usize, bytes: &[u8]| {
        if let Some(field) = message.get_mut(at..at + bytes.len()) {
            field.copy_from_slice(bytes);
        }
    };
    put(0, &START);
    put(CLIENT_MAC, &client);
    put(MAGIC_COOKIE, &COOKIE);
    put(
        OPTIONS,
        &[MESSAGE_TYPE, 1, REQUEST, REQUESTED_ADDRESS, 4, a, b, c, d, END],
    );
    message
}

/// The hardware address of the client that sends a DHCPDECLINE; `None` for any other message.
fn declining_client(message: &[u8]) -> Option<[u8; 6]> {
    let client = message.get(CLIENT_MAC..)?.first_chunk()?;
    (message_type(message.get(OPTIONS..)?) == Some(DECLINE)).then_some(*client)
}

/// The DHCP message type (option 53) among a message's options (RFC 2132).
fn message_type(mut options: &[u8]) -> Option<u8> {
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
    use std::boxed::Box;

    use super::super::dhcp::DHCP_REPLY_BYTES;
    use super::*;
    use proptest::prelude::*;

    const DISCOVER: u8 = 1;
    const OFFER: u8 = 2;
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

    fn fresh() -> Leases {
        Leases::without_retained()
    }

    fn address(last: u8) -> Ipv4Addr {
        Ipv4Addr::new(192, 168, 4, last)
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
    // Requirement: L-19
    fn eight_clients_have_an_address_each_until_they_are_silent_for_the_time_of_a_lease() {
        let mut leases = fresh();
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
        let mut leases = fresh();
        let [driver, passenger] = [1, 2].map(|client| join(&mut leases, client, 0).unwrap());
        for last in 2..10 {
            let declined = message(DECLINE, 2, Some([192, 168, 4, last].into()));
            assert_eq!(answer(&mut leases, &declined, 1), None);
        }
        assert!(leases.has(mac(1), driver, 1));
        assert!(!leases.has(mac(2), passenger, 1));
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
    // Requirement: L-19
    fn a_thousand_that_only_ask_do_not_keep_a_phone_from_its_address() {
        let mut leases = fresh();
        assert_eq!(join(&mut leases, 5_000, 0), Some(FIRST));
        for client in 0..1_000 {
            let offer = answer(&mut leases, &message(DISCOVER, client, None), u64::from(client));
            assert!(matches!(offer, Some((OFFER, address)) if address != FIRST));
        }
        assert_eq!(leases.clients(1_000).as_slice(), [FIRST]);
        assert!(join(&mut leases, 6_000, 1_001).is_some());
        // A client whose offer was withdrawn begins again.
        let late = answer(&mut leases, &message(REQUEST, 0, Some(FIRST)), 1_002);
        assert_eq!(late.map(|(kind, _)| kind), Some(NAK));
    }

    #[test]
    fn our_longest_answer_has_the_length_that_is_reserved_for_it() {
        let mut leases = fresh();
        let offer = leases.answer(&message(DISCOVER, 1, None), 0).unwrap();
        assert_eq!(offer.bytes().len(), DHCP_REPLY_BYTES);
    }

    #[test]
    fn who_keeps_its_address_over_a_reset_has_it() {
        let retained = Box::leak(Box::<RetainedLeases>::default());
        let mut leases = Leases::new(retained);
        let [one, two] = [1, 2].map(|client| join(&mut leases, client, 5_000).unwrap());
        leases.answer(&message(DISCOVER, 3, None), 5_000);
        leases.answer(&message(DECLINE, 2, Some(two)), 6_000);

        let mut leases = Leases::new(retained);
        assert!(!leases.accepts(mac(9), one, 0), "another client");
        assert!(leases.accepts(mac(1), one, 0));
        assert_eq!(leases.clients(0).as_slice(), [one]);
        for client in 10..17 {
            assert!(join(&mut leases, client, 1).is_some());
        }
        assert_eq!(join(&mut leases, 17, 1), None, "it is not a loan");
        assert!(leases.accepts(mac(1), one, 599_999));
        assert!(!leases.accepts(mac(1), one, 600_000));
    }

    #[test]
    fn one_address_is_lent_to_each_computer_and_each_to_one() {
        let mut leases = fresh();
        for last in (0..=255).filter(|last| !(2..=9).contains(last)) {
            assert!(!leases.accepts(mac(1), address(last), 1), "{last}");
        }
        assert!(!leases.accepts(mac(1), Ipv4Addr::new(192, 168, 5, 2), 1));
        for last in 2..=9 {
            assert_eq!(leases.accepts(mac(1), address(last), 1), last == 2);
            assert_eq!(leases.accepts(mac(2), address(last), 1), last == 3);
        }
        assert_eq!(leases.clients(1).len(), 2);
    }

    #[test]
    fn an_address_that_is_offered_or_leased_is_not_lent() {
        let mut leases = fresh();
        let leased = join(&mut leases, 1, 0).unwrap();
        let (_, offered) = answer(&mut leases, &message(DISCOVER, 2, None), 0).unwrap();
        assert!(!leases.accepts(mac(3), leased, 1));
        assert!(!leases.accepts(mac(3), offered, 1));
        assert!(!leases.accepts(mac(1), address(4), 1), "it has one");
        assert!(leases.accepts(mac(3), offered, 60_000), "not taken in time");
    }

    #[test]
    fn a_loan_ends_ten_minutes_after_the_start_whatever_comes() {
        let mut leases = fresh();
        for second in 0..600 {
            assert!(leases.accepts(mac(1), FIRST, second * 1_000), "{second}");
        }
        assert!(leases.accepts(mac(2), LAST, 599_999));
        assert!(!leases.accepts(mac(1), FIRST, 600_000));
        assert!(!leases.accepts(mac(2), LAST, 600_000));
        assert!(!leases.accepts(mac(3), FIRST, 1_000_000));
        assert_eq!(join(&mut leases, 4, 600_001), Some(FIRST));
    }

    #[test]
    fn a_loan_becomes_a_lease_when_it_is_asked_for() {
        let mut leases = fresh();
        assert!(leases.accepts(mac(1), FIRST, 1));
        let renewed = answer(&mut leases, &message(REQUEST, 1, Some(FIRST)), 300_000);
        assert_eq!(renewed, Some((ACK, FIRST)));
        for client in 2..9 {
            assert!(join(&mut leases, client, 300_000).is_some());
        }
        assert_eq!(join(&mut leases, 9, 300_000), None);
        assert!(leases.accepts(mac(1), FIRST, 899_999));
    }

    #[test]
    fn loans_are_withdrawn_before_offers_and_leases_never() {
        let mut leases = fresh();
        let leased = join(&mut leases, 1, 0).unwrap();
        for last in 3..=9 {
            assert!(leases.accepts(mac(last.into()), address(last), 1));
        }
        for client in 100..107 {
            let (kind, _) = answer(&mut leases, &message(DISCOVER, client, None), 1).unwrap();
            assert_eq!(kind, OFFER);
        }
        for last in 3..=9 {
            assert!(!leases.accepts(mac(last.into()), address(last), 1));
        }
        for client in 100..107 {
            let offered = answer(&mut leases, &message(DISCOVER, client, None), 2);
            let (_, offered) = offered.expect("no offer was withdrawn");
            let taken = answer(&mut leases, &message(REQUEST, client, Some(offered)), 2);
            assert_eq!(taken, Some((ACK, offered)));
        }
        assert_eq!(join(&mut leases, 8, 2), None);
        assert!(leases.accepts(mac(1), leased, 2));
    }

    #[test]
    fn a_loan_is_not_retained() {
        let retained = Box::leak(Box::<RetainedLeases>::default());
        let mut leases = Leases::new(retained);
        assert!(leases.accepts(mac(1), FIRST, 1));
        let leased = join(&mut leases, 2, 1).unwrap();
        let leases = Leases::new(retained);
        assert_eq!(leases.clients(0).as_slice(), [leased]);
    }

    /// Action of a computer.
    #[derive(Clone, Copy, Debug)]
    enum Act {
        Use(u16, u8),
        Message(u8, u16, Option<u8>),
    }

    fn act() -> impl Strategy<Value = Act> {
        prop_oneof![
            (0..12_u16, 0..12_u8).prop_map(|(client, last)| Act::Use(client, last)),
            (1..9_u8, 0..12_u16, prop::option::of(0..12_u8))
                .prop_map(|(kind, client, wanted)| Act::Message(kind, client, wanted)),
        ]
    }

    proptest! {
        #[test]
        fn nothing_that_comes_breaks_it(
            mut packets in prop::collection::vec(prop::collection::vec(any::<u8>(), 0..600), 1..40),
            cut in 0_usize..250,
        ) {
            let mut leases = fresh();
            for (number, packet) in packets.iter_mut().enumerate() {
                // Half of them begin as a message does.
                if number % 2 == 0 {
                    let mut start = message(DISCOVER, number as u16, None);
                    start.truncate(cut);
                    packet.splice(..0, start);
                }
                if let Some(reply) = leases.answer(packet, number as u64) {
                    prop_assert!(reply.bytes().len() <= DHCP_REPLY_BYTES);
                }
                prop_assert!(leases.clients(0).len() <= MAX_CLIENTS);
            }
            prop_assert!(join(&mut leases, 9_999, 10_000_000).is_some());
        }

        #[test]
        fn each_has_one_address_and_who_has_a_lease_keeps_it(acts in prop::collection::vec((act(), 0..9_000_u64), 1..200)) {
            let retained = Box::leak(Box::<RetainedLeases>::default());
            let mut leases = Leases::new(retained);
            let driver = address(9);
            prop_assert_eq!(answer(&mut leases, &message(REQUEST, 100, Some(driver)), 0), Some((ACK, driver)));
            let mut now_ms = 0;
            for (act, pause_ms) in acts {
                now_ms = (now_ms + pause_ms).min(599_999);
                match act {
                    Act::Use(client, last) => { leases.accepts(mac(client), address(last), now_ms); }
                    Act::Message(kind, client, wanted) => {
                        leases.answer(&message(kind, client, wanted.map(address)), now_ms);
                    }
                }
                let table: Vec<Lease, MAX_CLIENTS> = leases.server.leases().collect();
                for (at, lease) in table.iter().enumerate() {
                    prop_assert!(index_of(lease.ip).is_some());
                    prop_assert!(table[..at].iter().all(|other| other.ip != lease.ip && other.mac != lease.mac));
                }
                prop_assert!(leases.has(mac(100), driver, now_ms));
                prop_assert_eq!(retained.recall(), leases.holders());
            }
        }
    }
}
