//! A minimal DHCP server (RFC 2131): an address for each client, never taken back.

use std::net::Ipv4Addr;

use smoltcp::wire::{DHCP_SERVER_PORT, DhcpMessageType, DhcpPacket, DhcpRepr, EthernetAddress, Ipv4Cidr};

/// The last byte of the first address that is leased.
const FIRST_LEASED: u8 = 100;

const LEASE_S: u32 = 3600;

/// How the server treats its clients.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DhcpAnswers {
    Leases,
    /// Offers an address, and refuses it to those that request it.
    Refusals,
    /// As if there were no server.
    Silence,
}

pub struct DhcpServer {
    /// The server's own address.
    address: Ipv4Cidr,
    pub answers: DhcpAnswers,
    /// The first has the first address, and so on.
    clients: Vec<EthernetAddress>,
}

impl DhcpServer {
    pub const PORT: u16 = DHCP_SERVER_PORT;

    pub fn new(address: Ipv4Cidr) -> Self {
        Self {
            address,
            answers: DhcpAnswers::Leases,
            clients: Vec::new(),
        }
    }

    /// The answer to a datagram, which is to be broadcast: its client has no address yet.
    pub fn answer(&mut self, datagram: &[u8]) -> Option<Vec<u8>> {
        let packet = DhcpPacket::new_checked(datagram).ok()?;
        let request = DhcpRepr::parse(&packet).ok()?;
        let message_type = self.type_of_answer(request.message_type)?;
        let answer = self.reply(&request, message_type);
        let mut bytes = vec![0; answer.buffer_len()];
        answer.emit(&mut DhcpPacket::new_unchecked(&mut bytes)).ok()?;
        Some(bytes)
    }

    fn type_of_answer(&self, request: DhcpMessageType) -> Option<DhcpMessageType> {
        match (request, self.answers) {
            (_, DhcpAnswers::Silence) => None,
            (DhcpMessageType::Discover, _) => Some(DhcpMessageType::Offer),
            (DhcpMessageType::Request, DhcpAnswers::Leases) => Some(DhcpMessageType::Ack),
            (DhcpMessageType::Request, DhcpAnswers::Refusals) => Some(DhcpMessageType::Nak),
            _ => None,
        }
    }

    fn reply(&mut self, request: &DhcpRepr, message_type: DhcpMessageType) -> DhcpRepr<'static> {
        let (server, unspecified) = (self.address.address(), Ipv4Addr::UNSPECIFIED);
        // A refusal names no address (RFC 2131, table 3).
        let your_ip = match message_type {
            DhcpMessageType::Nak => unspecified,
            _ => self.lease(request.client_hardware_address),
        };
        DhcpRepr {
            message_type,
            transaction_id: request.transaction_id,
            secs: 0,
            client_hardware_address: request.client_hardware_address,
            client_ip: unspecified,
            your_ip,
            server_ip: unspecified,
            router: Some(server),
            subnet_mask: Some(self.address.netmask()),
            relay_agent_ip: unspecified,
            broadcast: request.broadcast,
            requested_ip: None,
            client_identifier: None,
            server_identifier: Some(server),
            parameter_request_list: None,
            dns_servers: None,
            max_size: None,
            lease_duration: Some(LEASE_S),
            renew_duration: None,
            rebind_duration: None,
            additional_options: &[],
        }
    }

    fn lease(&mut self, client: EthernetAddress) -> Ipv4Addr {
        if !self.clients.contains(&client) {
            self.clients.push(client);
        }
        self.leased_to(client).expect("a client")
    }

    /// The address of a client that has asked for one.
    pub fn leased_to(&self, client: EthernetAddress) -> Option<Ipv4Addr> {
        let index = self.clients.iter().position(|known| *known == client)?;
        let [a, b, c, _] = self.address.address().octets();
        Some(Ipv4Addr::new(a, b, c, FIRST_LEASED + index as u8))
    }
}
