//! A computer: one network interface, a network stack, and what programs do with it.

use std::net::{Ipv4Addr, SocketAddrV4};

use smoltcp::iface::{Config, Interface, SocketHandle, SocketSet};
use smoltcp::socket::{tcp, udp};
use smoltcp::time::Instant;
use smoltcp::wire::{EthernetAddress, IpAddress, IpCidr, IpEndpoint, Ipv4Cidr};

use super::frames::FrameQueues;
use super::radio::MacAddress;

/// What programs do not read at once, of each socket.
const BUFFER_BYTES: usize = 65_535;
const BUFFER_DATAGRAMS: usize = 256;

/// The first port that no service claims (RFC 6335).
const FIRST_EPHEMERAL_PORT: u16 = 49_152;

/// A bound UDP port of a computer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UdpPort(SocketHandle);

/// A TCP connection of a computer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Connection(SocketHandle);

/// What has come to a UDP port.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Datagram {
    pub from: SocketAddrV4,
    pub bytes: Vec<u8>,
}

pub struct Computer {
    mac: MacAddress,
    pub(super) interface: Interface,
    queues: FrameQueues,
    pub(super) sockets: SocketSet<'static>,
    next_port: u16,
}

impl Computer {
    /// Without an address.
    pub fn new(mac: MacAddress) -> Self {
        let mut config = Config::new(EthernetAddress(mac).into());
        // Of sequence numbers and transaction numbers: each computer has its own.
        config.random_seed = mac.iter().fold(0, |seed, byte| seed << 8 | u64::from(*byte));
        let mut queues = FrameQueues::default();
        Self {
            mac,
            interface: Interface::new(config, &mut queues, Instant::ZERO),
            queues,
            sockets: SocketSet::new(Vec::new()),
            next_port: FIRST_EPHEMERAL_PORT,
        }
    }

    pub fn mac(&self) -> MacAddress {
        self.mac
    }

    pub fn address(&self) -> Option<Ipv4Addr> {
        self.interface.ipv4_addr()
    }

    /// Sets the address and the length of the network's prefix, or takes it away.
    pub fn set_address(&mut self, address: Option<Ipv4Cidr>) {
        self.interface.update_ip_addrs(|addresses| {
            addresses.clear();
            // An interface has room for one at least.
            addresses.extend(address.map(IpCidr::Ipv4));
        });
    }

    /// An Ethernet frame arrives; `poll` has the stack see it.
    pub fn receive(&mut self, frame: &[u8]) {
        self.queues.received.push_back(frame.to_vec());
    }

    /// Lets the stack do what is due at this time. Returns the frames that it sends.
    pub fn poll(&mut self, now_us: u64) -> Vec<Vec<u8>> {
        let now = Instant::from_micros(now_us as i64);
        self.interface.poll(now, &mut self.queues, &mut self.sockets);
        std::mem::take(&mut self.queues.sent)
    }

    /// Opens a UDP port. Panics if it is 0.
    pub fn bind_udp(&mut self, port: u16) -> UdpPort {
        let buffer = || {
            udp::PacketBuffer::new(
                vec![udp::PacketMetadata::EMPTY; BUFFER_DATAGRAMS],
                vec![0; BUFFER_BYTES],
            )
        };
        let mut socket = udp::Socket::new(buffer(), buffer());
        socket.bind(port).expect("a port that is not 0");
        UdpPort(self.sockets.add(socket))
    }

    /// Sends a datagram. Returns whether there was room for it.
    pub fn send_to(&mut self, port: UdpPort, bytes: &[u8], to: SocketAddrV4) -> bool {
        let socket = self.sockets.get_mut::<udp::Socket>(port.0);
        socket.send_slice(bytes, endpoint(to)).is_ok()
    }

    /// What has come to the port since the last call.
    pub fn take_datagrams(&mut self, port: UdpPort) -> Vec<Datagram> {
        let socket = self.sockets.get_mut::<udp::Socket>(port.0);
        let mut datagrams = Vec::new();
        while let Ok((bytes, meta)) = socket.recv() {
            let IpAddress::Ipv4(address) = meta.endpoint.addr;
            datagrams.push(Datagram {
                from: SocketAddrV4::new(address, meta.endpoint.port),
                bytes: bytes.to_vec(),
            });
        }
        datagrams
    }

    /// Begins to connect; what is sent meanwhile waits. Panics without an address.
    pub fn connect(&mut self, to: SocketAddrV4) -> Connection {
        let mut socket = tcp_socket();
        let port = self.ephemeral_port();
        socket
            .connect(self.interface.context(), endpoint(to), port)
            .expect("an address");
        Connection(self.sockets.add(socket))
    }

    /// Waits for one connection to a port.
    pub fn listen(&mut self, port: u16) -> Connection {
        let mut socket = tcp_socket();
        socket.listen(port).expect("a port that is not 0");
        Connection(self.sockets.add(socket))
    }

    fn ephemeral_port(&mut self) -> u16 {
        let port = self.next_port;
        self.next_port = port.checked_add(1).unwrap_or(FIRST_EPHEMERAL_PORT);
        port
    }

    /// This many bytes can be sent at once.
    pub fn room(&mut self, connection: Connection) -> usize {
        let socket = self.tcp(connection);
        match socket.may_send() {
            true => socket.send_capacity() - socket.send_queue(),
            false => 0,
        }
    }

    /// Sends what there is room for. Returns how many bytes.
    pub fn send(&mut self, connection: Connection, bytes: &[u8]) -> usize {
        self.tcp(connection).send_slice(bytes).unwrap_or(0)
    }

    /// What has been received since the last call.
    pub fn take_received(&mut self, connection: Connection) -> Vec<u8> {
        let socket = self.tcp(connection);
        let mut bytes = vec![0; socket.recv_queue()];
        let length = socket.recv_slice(&mut bytes).unwrap_or(0);
        bytes.truncate(length);
        bytes
    }

    /// Whether the other side can still send, or something that it has sent was not taken yet. A connection that is being
    /// opened is open.
    pub fn is_open(&mut self, connection: Connection) -> bool {
        let socket = self.tcp(connection);
        let is_opening = matches!(
            socket.state(),
            tcp::State::Listen | tcp::State::SynSent | tcp::State::SynReceived
        );
        is_opening || socket.may_recv() || socket.can_recv()
    }

    /// Whether both sides have connected.
    pub fn is_established(&mut self, connection: Connection) -> bool {
        self.tcp(connection).state() == tcp::State::Established
    }

    /// Closes this side once everything is sent.
    pub fn close(&mut self, connection: Connection) {
        self.tcp(connection).close();
    }

    /// Whether nothing is left of the connection for this side to do.
    pub fn is_over(&mut self, connection: Connection) -> bool {
        matches!(
            self.tcp(connection).state(),
            tcp::State::Closed | tcp::State::TimeWait
        )
    }

    /// Frees what a connection took. One that is not over is never answered again.
    pub fn forget(&mut self, connection: Connection) {
        self.sockets.remove(connection.0);
    }

    fn tcp(&mut self, connection: Connection) -> &mut tcp::Socket<'static> {
        self.sockets.get_mut(connection.0)
    }
}

fn tcp_socket() -> tcp::Socket<'static> {
    let buffer = || tcp::SocketBuffer::new(vec![0; BUFFER_BYTES]);
    let mut socket = tcp::Socket::new(buffer(), buffer());
    // As ground stations do: a command is not to wait for the next one.
    socket.set_nagle_enabled(false);
    socket
}

fn endpoint(address: SocketAddrV4) -> IpEndpoint {
    IpEndpoint::new(IpAddress::Ipv4(*address.ip()), address.port())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::air::echo::{ECHO_PORT, Echo};

    const MAC: MacAddress = [2, 0, 0, 0, 0, 1];
    const ADDRESS: Ipv4Addr = Ipv4Addr::new(10, 0, 0, 2);

    /// A computer and an echo on one wire.
    struct Wired {
        computer: Computer,
        echo: Echo,
        now_us: u64,
    }

    impl Wired {
        fn new() -> Self {
            let mut computer = Computer::new(MAC);
            computer.set_address(Some(Ipv4Cidr::new(ADDRESS, 24)));
            Self {
                computer,
                echo: Echo::new(Ipv4Cidr::new(Ipv4Addr::new(10, 0, 0, 1), 24)),
                now_us: 0,
            }
        }

        fn run(&mut self, milliseconds: u64) {
            for _ in 0..milliseconds {
                self.now_us += 1000;
                for frame in self.computer.poll(self.now_us) {
                    self.echo.computer.receive(&frame);
                }
                for frame in self.echo.poll(self.now_us) {
                    self.computer.receive(&frame);
                }
            }
        }

        fn to(port: u16) -> SocketAddrV4 {
            SocketAddrV4::new(Ipv4Addr::new(10, 0, 0, 1), port)
        }
    }

    #[test]
    fn datagrams_come_back_with_their_sender() {
        let mut wired = Wired::new();
        let port = wired.computer.bind_udp(14550);
        for length in [0, 1, 280, 1472] {
            let bytes: Vec<u8> = (0..length).map(|position| position as u8).collect();
            assert!(wired.computer.send_to(port, &bytes, Wired::to(ECHO_PORT)));
            wired.run(5);
            let from = Wired::to(ECHO_PORT);
            assert_eq!(wired.computer.take_datagrams(port), [Datagram { from, bytes }]);
        }
        assert_eq!(wired.computer.take_datagrams(port), []);
    }

    #[test]
    fn a_broadcast_arrives_at_the_port_that_is_open_for_it() {
        let mut wired = Wired::new();
        let [port, other] = [14550, 14551].map(|port| wired.computer.bind_udp(port));
        let from = wired.echo.computer.bind_udp(14550);
        for to in [Ipv4Addr::new(10, 0, 0, 255), Ipv4Addr::BROADCAST] {
            wired
                .echo
                .computer
                .send_to(from, b"heartbeat", SocketAddrV4::new(to, 14550));
            wired.run(5);
            let datagrams = wired.computer.take_datagrams(port);
            assert_eq!(datagrams.len(), 1, "{to}");
            assert_eq!(
                (datagrams[0].from, &*datagrams[0].bytes),
                (Wired::to(14550), &b"heartbeat"[..])
            );
        }
        assert_eq!(wired.computer.take_datagrams(other), []);
    }

    #[test]
    fn a_connection_carries_every_byte_and_is_closed_on_both_sides() {
        let mut wired = Wired::new();
        let connection = wired.computer.connect(Wired::to(ECHO_PORT));
        assert!(wired.computer.is_open(connection) && !wired.computer.is_established(connection));
        wired.run(5);
        assert!(wired.computer.is_established(connection));
        let bytes: Vec<u8> = (0..200_000_u32)
            .map(|position| (position.wrapping_mul(position) >> 7) as u8)
            .collect();
        let (mut sent, mut received) = (0, Vec::new());
        for _ in 0..2000 {
            sent += wired.computer.send(connection, &bytes[sent..]);
            wired.run(1);
            received.extend(wired.computer.take_received(connection));
        }
        assert!(received == bytes, "{} of {} bytes", received.len(), bytes.len());
        assert_eq!(wired.computer.room(connection), BUFFER_BYTES);

        wired.computer.close(connection);
        wired.run(5);
        assert!(!wired.computer.is_open(connection) && wired.computer.is_over(connection));
        assert_eq!(
            (wired.computer.room(connection), wired.echo.connections()),
            (0, 0)
        );
        wired.computer.forget(connection);
    }

    #[test]
    fn what_was_received_before_the_other_side_closed_is_not_lost() {
        let mut wired = Wired::new();
        let connection = wired.computer.connect(Wired::to(ECHO_PORT));
        wired.run(5);
        wired.computer.send(connection, b"last words");
        wired.run(5);
        wired.echo.close();
        wired.run(5);
        assert!(wired.computer.is_open(connection));
        assert_eq!(wired.computer.take_received(connection), b"last words");
        assert!(!wired.computer.is_open(connection) && !wired.computer.is_over(connection));
    }

    #[test]
    fn a_closed_port_refuses_a_connection() {
        let mut wired = Wired::new();
        let connection = wired.computer.connect(Wired::to(ECHO_PORT + 1));
        wired.run(5);
        assert!(!wired.computer.is_open(connection) && wired.computer.is_over(connection));
        assert_eq!(wired.computer.send(connection, b"x"), 0);
    }
}
