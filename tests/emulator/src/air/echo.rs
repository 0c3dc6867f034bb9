//! A computer that sends everything back, for the tests of the others.

use smoltcp::wire::Ipv4Cidr;

use super::computer::{Computer, Connection, UdpPort};
use super::radio::MacAddress;

/// The port of the echo service (RFC 862), by UDP and by TCP.
pub const ECHO_PORT: u16 = 7;

const MAC: MacAddress = [2, 0, 0, 0, 0, 0xec];

/// Serves this many connections at once.
const CONNECTIONS: usize = 2;

pub struct Echo {
    pub computer: Computer,
    udp: UdpPort,
    tcp: [Connection; CONNECTIONS],
    /// Received, and without room to be sent.
    unsent: [Vec<u8>; CONNECTIONS],
}

impl Echo {
    pub fn new(address: Ipv4Cidr) -> Self {
        let mut computer = Computer::new(MAC);
        computer.set_address(Some(address));
        let udp = computer.bind_udp(ECHO_PORT);
        let tcp = [(); CONNECTIONS].map(|()| computer.listen(ECHO_PORT));
        Self {
            computer,
            udp,
            tcp,
            unsent: Default::default(),
        }
    }

    /// Answers what has come, and returns the frames that are sent.
    pub fn poll(&mut self, now_us: u64) -> Vec<Vec<u8>> {
        let mut frames = self.computer.poll(now_us);
        for datagram in self.computer.take_datagrams(self.udp) {
            self.computer.send_to(self.udp, &datagram.bytes, datagram.from);
        }
        for index in 0..CONNECTIONS {
            self.answer(index);
        }
        frames.extend(self.computer.poll(now_us));
        frames
    }

    fn answer(&mut self, index: usize) {
        let connection = self.tcp[index];
        if !self.computer.is_open(connection) {
            self.computer.close(connection);
        }
        if self.computer.is_over(connection) {
            self.computer.forget(connection);
            self.tcp[index] = self.computer.listen(ECHO_PORT);
            self.unsent[index].clear();
            return;
        }
        let unsent = &mut self.unsent[index];
        unsent.extend(self.computer.take_received(connection));
        let sent = self.computer.send(connection, unsent);
        unsent.drain(..sent);
    }

    /// How many stations are connected.
    pub fn connections(&mut self) -> usize {
        let connections = self.tcp;
        connections
            .into_iter()
            .filter(|connection| self.computer.is_established(*connection))
            .count()
    }

    /// Closes all connections.
    pub fn close(&mut self) {
        for connection in self.tcp {
            self.computer.close(connection);
        }
    }
}
