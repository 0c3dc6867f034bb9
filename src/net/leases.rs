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
