//! A router with a Wi-Fi network of its own, for a board that joins one.

use std::net::{Ipv4Addr, SocketAddrV4};
use std::ops::{Deref, DerefMut};

use smoltcp::wire::{DHCP_CLIENT_PORT, EthernetAddress, Ipv4Cidr};

use super::computer::{Computer, UdpPort};
use super::dhcp_server::{DhcpAnswers, DhcpServer};
use super::radio::{Credentials, MacAddress};

use crate::Network;

const MAC: MacAddress = [2, 0, 0, 0, 0xff, 1];

/// As most routers have it.
const ADDRESS: Ipv4Cidr = Ipv4Cidr::new(Ipv4Addr::new(192, 168, 1, 1), 24);

/// A computer that also leases addresses. It routes nothing anywhere: there is one network.
pub struct Router {
    computer: Computer,
    credentials: Credentials,
    server: DhcpServer,
    server_port: UdpPort,
}

impl Router {
    pub fn new(credentials: Credentials) -> Self {
        let mut computer = Computer::new(MAC);
        computer.set_address(Some(ADDRESS));
        let server_port = computer.bind_udp(DhcpServer::PORT);
        Self {
            computer,
            credentials,
            server: DhcpServer::new(ADDRESS),
            server_port,
        }
    }

    /// Of its network.
    pub fn credentials(&self) -> &Credentials {
        &self.credentials
    }

    /// Its network as the board's chip finds it, to be added there.
    pub fn network(&self) -> Network {
        Network {
            ssid: self.credentials.ssid.clone(),
            passphrase: self.credentials.passphrase.clone(),
        }
    }

    /// Has the server treat its clients like this from now on.
    pub fn answer_dhcp_by(&mut self, answers: DhcpAnswers) {
        self.server.answers = answers;
    }

    /// The address of a client that has asked for one.
    pub fn leased_to(&self, mac: MacAddress) -> Option<Ipv4Addr> {
        self.server.leased_to(EthernetAddress(mac))
    }

    /// Lets the stack and the server do what is due at this time. Returns the frames that are sent.
    pub fn poll(&mut self, now_us: u64) -> Vec<Vec<u8>> {
        let mut frames = self.computer.poll(now_us);
        for request in self.computer.take_datagrams(self.server_port) {
            if let Some(answer) = self.server.answer(&request.bytes) {
                let everyone = SocketAddrV4::new(Ipv4Addr::BROADCAST, DHCP_CLIENT_PORT);
                self.computer.send_to(self.server_port, &answer, everyone);
            }
        }
        frames.extend(self.computer.poll(now_us));
        frames
    }
}

impl Deref for Router {
    type Target = Computer;

    fn deref(&self) -> &Computer {
        &self.computer
    }
}

impl DerefMut for Router {
    fn deref_mut(&mut self) -> &mut Computer {
        &mut self.computer
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::air::laptop::Laptop;

    const LAPTOP: MacAddress = [2, 0, 0, 0, 0, 1];

    /// A laptop with DHCP and a router on one wire, after ten seconds.
    fn connected(answers: DhcpAnswers) -> (Laptop, Router) {
        let mut laptop = Laptop::new(LAPTOP, None);
        let mut router = Router::new(Credentials::new("Home", "12345678"));
        router.answer_dhcp_by(answers);
        run(&mut laptop, &mut router, 0);
        (laptop, router)
    }

    fn run(laptop: &mut Laptop, router: &mut Router, from_s: u64) {
        for now_ms in from_s * 1000..(from_s + 20) * 1000 {
            for frame in laptop.poll(now_ms * 1000) {
                router.receive(&frame);
            }
            for frame in router.poll(now_ms * 1000) {
                laptop.receive(&frame);
            }
        }
    }

    #[test]
    fn a_client_gets_the_same_address_each_time() {
        let (mut laptop, mut router) = connected(DhcpAnswers::Leases);
        let leased = Some(Ipv4Addr::new(192, 168, 1, 100));
        assert_eq!((laptop.address(), router.leased_to(LAPTOP)), (leased, leased));
        laptop.joined();
        assert_eq!(laptop.address(), None);
        run(&mut laptop, &mut router, 20);
        assert_eq!(laptop.address(), leased);
    }

    #[test]
    fn two_clients_get_two_addresses_and_reach_each_other_by_them() {
        let (laptop, mut router) = connected(DhcpAnswers::Leases);
        let mut other = Laptop::new([2, 0, 0, 0, 0, 2], None);
        run(&mut other, &mut router, 20);
        assert_eq!(other.address(), Some(Ipv4Addr::new(192, 168, 1, 101)));
        assert_ne!(other.address(), laptop.address());
    }

    #[test]
    fn a_server_that_refuses_or_is_silent_gives_no_address() {
        for answers in [DhcpAnswers::Refusals, DhcpAnswers::Silence] {
            let (mut laptop, mut router) = connected(answers);
            assert_eq!(laptop.address(), None, "{answers:?}");
            router.answer_dhcp_by(DhcpAnswers::Leases);
            run(&mut laptop, &mut router, 20);
            assert!(laptop.address().is_some(), "{answers:?}");
        }
    }

    #[test]
    fn noise_at_the_servers_port_is_not_answered() {
        let mut server = DhcpServer::new(ADDRESS);
        for length in [0, 1, 239, 240, 300] {
            assert_eq!(server.answer(&vec![0x55; length]), None);
        }
    }
}
