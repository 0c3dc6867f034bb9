//! A phone: a network stack, and a ground station's sockets.

use std::net::{Ipv4Addr, SocketAddrV4};

use smoltcp::iface::{Config, Interface, SocketHandle, SocketSet, SocketStorage};
use smoltcp::phy::{Device, DeviceCapabilities, Medium, RxToken, TxToken};
use smoltcp::socket::{dhcpv4, tcp, udp};
use smoltcp::time::Instant;
use smoltcp::wire::{EthernetAddress, IpAddress, IpCidr, IpEndpoint, Ipv4Cidr};

use super::air::{MTU, SharedAir};
use support::frames::{Frame, frames};

pub const BOARD: SocketAddrV4 = SocketAddrV4::new(Ipv4Addr::new(192, 168, 4, 1), 14550);

pub struct Phone {
    pub mac: [u8; 6],
    interface: Interface,
    pub sockets: SocketSet<'static>,
    device: Antenna,
}

/// A datagram that was received.
#[derive(Clone, Debug, PartialEq)]
pub struct Datagram {
    pub from: SocketAddrV4,
    pub at_us: u64,
    pub bytes: Vec<u8>,
}

impl Datagram {
    pub fn frames(&self) -> Vec<Frame> {
        let bytes = self.bytes.iter().map(|byte| (self.at_us, *byte));
        frames(&bytes.collect::<Vec<_>>())
    }
}

impl Phone {
    /// A phone in reach, with the address 192.168.4.`number`, which the board has not given to it.
    pub fn new(air: &SharedAir, number: u8) -> Self {
        let mut phone = Self::without_address(air, number);
        phone.set_address(Ipv4Cidr::new(Ipv4Addr::new(192, 168, 4, number), 24));
        phone
    }

    pub fn without_address(air: &SharedAir, number: u8) -> Self {
        let mac = [2, 0, 0, 0, 1, number];
        air.borrow_mut().join(mac);
        let mut device = Antenna {
            air: air.clone(),
            mac,
        };
        let config = Config::new(EthernetAddress(mac).into());
        let storage: [SocketStorage<'static>; 4] = std::array::from_fn(|_| SocketStorage::EMPTY);
        Self {
            mac,
            interface: Interface::new(config, &mut device, now()),
            sockets: SocketSet::new(&mut Box::leak(Box::new(storage))[..]),
            device,
        }
    }

    pub fn set_address(&mut self, address: Ipv4Cidr) {
        self.interface.update_ip_addrs(|addresses| {
            addresses.clear();
            addresses
                .push(IpCidr::Ipv4(address))
                .expect("there is room for one");
        });
    }

    pub fn address(&self) -> Option<Ipv4Addr> {
        self.interface.ipv4_addr()
    }

    /// A ground station listens on this port, of a phone that takes no broadcasts.
    pub fn listen_to_own_address(&mut self, port: u16) -> SocketHandle {
        let address = self.address().expect("it has one");
        let handle = self.listen(port);
        let socket = self.sockets.get_mut::<udp::Socket>(handle);
        socket.close();
        socket.bind((address, port)).expect("the port is free");
        handle
    }

    /// Sends and receives what waits.
    pub fn poll(&mut self) {
        self.interface.poll(now(), &mut self.device, &mut self.sockets);
    }

    /// A ground station listens on this port.
    pub fn listen(&mut self, port: u16) -> SocketHandle {
        let buffer = || {
            let packets: &'static mut [udp::PacketMetadata] =
                Box::leak(vec![udp::PacketMetadata::EMPTY; 4096].into());
            udp::PacketBuffer::new(packets, leak(64 * 1024))
        };
        let mut socket = udp::Socket::new(buffer(), buffer());
        socket.bind(port).expect("the port is free");
        self.sockets.add(socket)
    }

    pub fn send(&mut self, socket: SocketHandle, bytes: &[u8]) {
        let to = IpEndpoint::new(IpAddress::Ipv4(*BOARD.ip()), BOARD.port());
        self.sockets
            .get_mut::<udp::Socket>(socket)
            .send_slice(bytes, to)
            .expect("there is room for it");
    }

    /// All datagrams that have come.
    pub fn received(&mut self, socket: SocketHandle) -> Vec<Datagram> {
        let socket = self.sockets.get_mut::<udp::Socket>(socket);
        let at_us = embassy_time::Instant::now().as_micros();
        std::iter::from_fn(|| {
            let (bytes, metadata) = socket.recv().ok()?;
            let IpAddress::Ipv4(address) = metadata.endpoint.addr;
            Some(Datagram {
                from: SocketAddrV4::new(address, metadata.endpoint.port),
                at_us,
                bytes: bytes.into(),
            })
        })
        .collect()
    }

    /// Connects to the board's port of MAVLink by TCP, from this port.
    pub fn connect(&mut self, port: u16) -> SocketHandle {
        self.connect_to(5760, port)
    }

    /// Connects to this port of the board by TCP.
    pub fn connect_to(&mut self, board_port: u16, port: u16) -> SocketHandle {
        let buffer = || tcp::SocketBuffer::new(leak(2048));
        let mut socket = tcp::Socket::new(buffer(), buffer());
        let board = (IpAddress::Ipv4(*BOARD.ip()), board_port);
        let connected = socket.connect(self.interface.context(), board, port);
        connected.expect("the socket is new");
        self.sockets.add(socket)
    }

    pub fn tcp(&mut self, socket: SocketHandle) -> &mut tcp::Socket<'static> {
        self.sockets.get_mut(socket)
    }

    /// Bytes that have come by TCP.
    pub fn tcp_bytes(&mut self, socket: SocketHandle) -> Vec<u8> {
        let mut bytes = Vec::new();
        let socket = self.tcp(socket);
        while socket.can_recv() {
            socket
                .recv(|part| {
                    bytes.extend_from_slice(part);
                    (part.len(), ())
                })
                .expect("it can receive");
        }
        bytes
    }

    /// The frames that have come by TCP. One that is cut off at the end is lost.
    pub fn tcp_frames(&mut self, socket: SocketHandle) -> Vec<Frame> {
        let bytes = self.tcp_bytes(socket);
        let at_us = embassy_time::Instant::now().as_micros();
        frames(&bytes.into_iter().map(|byte| (at_us, byte)).collect::<Vec<_>>())
    }

    /// Begins to ask for an address.
    pub fn ask_for_address(&mut self) -> SocketHandle {
        self.sockets.add(dhcpv4::Socket::new())
    }

    /// Takes the address that was given, if one was. It leads nowhere else.
    pub fn take_address(&mut self, socket: SocketHandle) -> bool {
        let event = self.sockets.get_mut::<dhcpv4::Socket>(socket).poll();
        let Some(dhcpv4::Event::Configured(config)) = event else {
            return false;
        };
        let address = config.address;
        assert_eq!((address.prefix_len(), config.router), (24, None));
        self.set_address(address);
        true
    }

    /// The frames of all datagrams that have come.
    pub fn received_frames(&mut self, socket: SocketHandle) -> Vec<Frame> {
        let datagrams = self.received(socket);
        datagrams.iter().flat_map(Datagram::frames).collect()
    }
}

fn leak(bytes: usize) -> &'static mut [u8] {
    Box::leak(vec![0; bytes].into())
}

fn now() -> Instant {
    Instant::from_micros(embassy_time::Instant::now().as_micros() as i64)
}

struct Antenna {
    air: SharedAir,
    mac: [u8; 6],
}

pub struct Received(Vec<u8>);

pub struct Place(SharedAir);

impl RxToken for Received {
    fn consume<R, F: FnOnce(&[u8]) -> R>(self, use_frame: F) -> R {
        use_frame(&self.0)
    }
}

impl TxToken for Place {
    fn consume<R, F: FnOnce(&mut [u8]) -> R>(self, length: usize, write: F) -> R {
        let mut frame = vec![0; length];
        let result = write(&mut frame);
        self.0.borrow_mut().send_to_board(frame);
        result
    }
}

impl Device for Antenna {
    type RxToken<'a> = Received;
    type TxToken<'a> = Place;

    fn receive(&mut self, _: Instant) -> Option<(Received, Place)> {
        let frame = self.air.borrow_mut().next_for(self.mac)?;
        Some((Received(frame), Place(self.air.clone())))
    }

    fn transmit(&mut self, _: Instant) -> Option<Place> {
        Some(Place(self.air.clone()))
    }

    fn capabilities(&self) -> DeviceCapabilities {
        let mut capabilities = DeviceCapabilities::default();
        capabilities.medium = Medium::Ethernet;
        capabilities.max_transmission_unit = MTU;
        capabilities
    }
}
