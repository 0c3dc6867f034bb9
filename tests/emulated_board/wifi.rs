//! From the board's Wi-Fi to programs on the host: for each port there is a laptop that has joined the board's network.

use std::net::{Ipv4Addr, SocketAddr, SocketAddrV4};

use emulator::Board;
use emulator::air::bridge::{TcpBridge, UdpBridge};
use emulator::air::laptop::Laptop;
use emulator::air::radio::Radio;
use emulator::air::space::Air;

/// The board in its own network.
const BOARD: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1);

/// Where the board serves MAVLink by TCP.
pub const MAVLINK_PORT: u16 = 5760;

/// Where the board serves browsers.
pub const HTTP_PORT: u16 = 80;

/// Where ground stations wait for MAVLink by UDP.
const STATIONS_UDP_PORT: u16 = 14550;

/// Nothing is lost in this air.
const SEED: u64 = 1;

/// The air around the board, and laptops in it, each with one port of the host.
pub struct WifiAir {
    air: Air,
    udp: Vec<(usize, UdpBridge)>,
    tcp: Vec<(usize, TcpBridge)>,
}

impl WifiAir {
    pub fn new() -> Self {
        Self {
            air: Air::new(SEED),
            udp: Vec::new(),
            tcp: Vec::new(),
        }
    }

    /// A laptop with a ground station that waits for datagrams at `station`.
    pub fn add_udp(&mut self, station: SocketAddr) -> Result<(), String> {
        let number = self.add_laptop();
        let bridge = UdpBridge::new(station, self.air.laptop(number), STATIONS_UDP_PORT)
            .map_err(|error| format!("Can't send from this machine to {station}: {error}"))?;
        self.udp.push((number, bridge));
        Ok(())
    }

    /// A laptop from which every program that connects to `address` reaches this port of the board.
    pub fn add_tcp(&mut self, address: SocketAddr, port: u16) -> Result<(), String> {
        let bridge = TcpBridge::listen(address, SocketAddrV4::new(BOARD, port))
            .map_err(|error| format!("Can't listen on {address}: {error}"))?;
        let number = self.add_laptop();
        self.tcp.push((number, bridge));
        Ok(())
    }

    fn add_laptop(&mut self) -> usize {
        let number = (self.udp.len() + self.tcp.len()) as u8;
        self.air.add(Laptop::new([2, 0, 0, 0, 0, number], None))
    }

    /// Takes over what was sent, at both ends.
    pub fn exchange(&mut self, board: &mut Board) {
        self.type_in_credentials(board);
        for (number, bridge) in &mut self.udp {
            bridge.exchange(self.air.laptop(*number));
        }
        for (number, bridge) in &mut self.tcp {
            bridge.exchange(self.air.laptop(*number));
        }
        self.air.exchange_with(board);
    }

    /// The owner of the laptops knows the board's passphrase.
    fn type_in_credentials(&mut self, board: &mut Board) {
        let credentials = Radio::access_point(board.wifi());
        for laptop in self.air.laptops() {
            laptop.credentials.clone_from(&credentials);
        }
    }
}
