//! A board with a radio, and ground stations in its network.

use std::net::{Ipv4Addr, SocketAddrV4};

use emulator::air::computer::{Connection, UdpPort};
use emulator::air::laptop::Laptop;
use emulator::air::radio::Credentials;
use emulator::air::space::Air;
use support::frames::{BATTERY_STATUS, Frame, HEARTBEAT, SYS_STATUS, frames};
use support::requests::{GCS, heartbeat};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND};
use workbench::starts::Start;

pub const BOARD: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1);
pub const UDP_PORT: u16 = 14550;
pub const TCP_PORT: u16 = 5760;
pub const WEB_PORT: u16 = 80;

/// From power-up until the network is there, at most.
const UP_WITHIN_US: u64 = 2 * SECOND;

/// A laptop gets its address within this time.
const ADDRESS_WITHIN_US: u64 = 5 * SECOND;

const ANSWER_TIME_US: u64 = 200 * MILLISECOND;

/// A board with everything around it.
pub struct Ground {
    pub bench: Bench,
    pub air: Air,
}

/// How a station talks to the board.
#[derive(Clone, Copy)]
enum Socket {
    Udp(UdpPort),
    Tcp(Connection),
    /// By TCP, the bytes in frames of a WebSocket.
    Web(Connection),
}

/// A ground station on a laptop.
pub struct Station {
    pub laptop: usize,
    socket: Socket,
    /// By UDP: where the board was heard.
    board: Option<SocketAddrV4>,
    received: Vec<(u64, u8)>,
    /// By WebSocket: what has come of a frame that is not whole.
    begun: Vec<u8>,
}

impl Station {
    fn new(laptop: usize, socket: Socket) -> Self {
        Self {
            laptop,
            socket,
            board: None,
            received: Vec::new(),
            begun: Vec::new(),
        }
    }
}

/// What opens a WebSocket.
pub const UPGRADE: &[u8] =
    b"GET / HTTP/1.1\r\nHost: 192.168.4.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
    Sec-WebSocket-Version: 13\r\nSec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n\r\n";

impl Ground {
    /// A Pico W whose network is up.
    pub fn up() -> Self {
        let start = Start::AccessPoint(DIVIDER_CODE);
        let bench = start.shared(|| Self::of(Bench::power_up(DIVIDER_CODE)).bench);
        Self::around(bench)
    }

    /// A ground around this bench, which has not run yet.
    pub fn of(mut bench: Bench) -> Self {
        bench.attach_wifi();
        let mut ground = Self::around(bench);
        ground.wait_for_network(UP_WITHIN_US);
        ground
    }

    /// What is around a board with a radio.
    pub fn around(bench: Bench) -> Self {
        let air = Air::new(1);
        Self { bench, air }
    }

    pub fn wait_for_network(&mut self, within_us: u64) {
        let is_up = self.air.run_until(&mut self.bench, within_us, |_, board| {
            board.wifi().access_point().is_some()
        });
        assert!(is_up, "{:?}", self.bench.log_lines());
    }

    pub fn run_for(&mut self, duration_us: u64) {
        self.air.run_for(&mut self.bench, duration_us);
    }

    /// What the owner types into a laptop.
    pub fn credentials(&mut self) -> Credentials {
        let network = self.bench.wifi().access_point().expect("it is up");
        Credentials {
            ssid: network.ssid.clone(),
            passphrase: network.passphrase.clone(),
        }
    }

    /// A laptop that has joined the board's network, and has an address in it.
    pub fn laptop(&mut self) -> usize {
        let credentials = self.credentials();
        self.laptop_with(credentials)
    }

    pub fn laptop_with(&mut self, credentials: Credentials) -> usize {
        let number = self.air.laptops().count() as u8;
        let laptop = Laptop::new([2, 0, 0, 0, 0, number], Some(credentials));
        let number = self.air.add(laptop);
        let has_address = self.air.run_until(&mut self.bench, ADDRESS_WITHIN_US, |air, _| {
            air.laptop(number).address().is_some()
        });
        assert!(has_address, "{:?}", self.bench.log_lines());
        number
    }

    /// A ground station that listens on UDP port 14550 of a laptop.
    pub fn listen(&mut self, laptop: usize) -> Station {
        let port = self.air.laptop(laptop).bind_udp(UDP_PORT);
        Station::new(laptop, Socket::Udp(port))
    }

    /// A ground station that was found by the board, and has answered.
    pub fn found_station(&mut self) -> Station {
        let laptop = self.laptop();
        let mut station = self.listen(laptop);
        self.wait_to_be_found(&mut station);
        station
    }

    fn wait_to_be_found(&mut self, station: &mut Station) {
        let heard = self.hear_until(station, 3 * SECOND, |bytes| !bytes.is_empty());
        assert!(heard, "no heartbeat: {:?}", self.bench.log_lines());
        self.send(station, &heartbeat(GCS));
        self.run_for(ANSWER_TIME_US);
    }

    /// A ground station that connects by TCP.
    pub fn connected_station(&mut self) -> Station {
        let laptop = self.laptop();
        self.connect(laptop)
    }

    pub fn connect(&mut self, laptop: usize) -> Station {
        let connection = self.connect_to(TCP_PORT, laptop);
        self.run_for(ANSWER_TIME_US);
        Station::new(laptop, Socket::Tcp(connection))
    }

    /// Begins a connection to a port of the board.
    pub fn connect_to(&mut self, port: u16, laptop: usize) -> Connection {
        let board = SocketAddrV4::new(BOARD, port);
        self.air.laptop(laptop).connect(board)
    }

    /// A browser that has a WebSocket.
    pub fn web_station(&mut self) -> Station {
        let laptop = self.laptop();
        self.open_web_socket(laptop)
    }

    pub fn open_web_socket(&mut self, laptop: usize) -> Station {
        let connection = self.open(laptop);
        assert_eq!(self.air.laptop(laptop).send(connection, UPGRADE), UPGRADE.len());
        let mut answer = Vec::new();
        let opened = self.air.run_until(&mut self.bench, SECOND, |air, _| {
            answer.extend(air.laptop(laptop).take_received(connection));
            end_of_head(&answer).is_some()
        });
        assert!(opened && answer.starts_with(b"HTTP/1.1 101 "), "{answer:?}");
        let begun = answer.split_off(end_of_head(&answer).expect("it has one"));
        Station {
            begun,
            ..Station::new(laptop, Socket::Web(connection))
        }
    }

    /// A connection to the port for browsers.
    pub fn open(&mut self, laptop: usize) -> Connection {
        let connection = self.connect_to(WEB_PORT, laptop);
        self.air.run_until(&mut self.bench, ANSWER_TIME_US, |air, _| {
            air.laptop(laptop).is_established(connection)
        });
        connection
    }

    /// What a request is answered, until the board closes the connection, and how long that took.
    pub fn fetch(&mut self, laptop: usize, request: &[u8], within_us: u64) -> (Vec<u8>, u64) {
        let began_us = self.bench.time_us();
        let connection = self.open(laptop);
        let sent = self.air.laptop(laptop).send(connection, request);
        assert_eq!(sent, request.len());
        let mut answer = Vec::new();
        self.air.run_until(&mut self.bench, within_us, |air, _| {
            let laptop = air.laptop(laptop);
            answer.extend(laptop.take_received(connection));
            !laptop.is_established(connection)
        });
        let took_us = self.bench.time_us() - began_us;
        self.air.laptop(laptop).close(connection);
        self.run_for(ANSWER_TIME_US);
        self.air.laptop(laptop).forget(connection);
        (answer, took_us)
    }

    pub fn is_connected(&mut self, station: &Station) -> bool {
        match station.socket {
            Socket::Tcp(connection) | Socket::Web(connection) => {
                self.air.laptop(station.laptop).is_established(connection)
            }
            Socket::Udp(_) => station.board.is_some(),
        }
    }

    pub fn send(&mut self, station: &mut Station, bytes: &[u8]) {
        self.receive(station);
        let laptop = self.air.laptop(station.laptop);
        match (station.socket, station.board) {
            (Socket::Udp(port), Some(board)) => assert!(laptop.send_to(port, bytes, board)),
            (Socket::Udp(_), None) => panic!("the board was not heard yet"),
            (Socket::Tcp(connection), _) => assert_eq!(laptop.send(connection, bytes), bytes.len()),
            (Socket::Web(connection), _) => {
                let frame = web_socket_frame(bytes);
                assert_eq!(laptop.send(connection, &frame), frame.len());
            }
        }
    }

    fn receive(&mut self, station: &mut Station) {
        let laptop = self.air.laptop(station.laptop);
        let bytes: Vec<u8> = match station.socket {
            Socket::Udp(port) => {
                let datagrams = laptop.take_datagrams(port).into_iter();
                let bytes = datagrams.flat_map(|datagram| {
                    station.board = Some(datagram.from);
                    datagram.bytes
                });
                bytes.collect()
            }
            Socket::Tcp(connection) => laptop.take_received(connection),
            Socket::Web(connection) => {
                station.begun.extend(laptop.take_received(connection));
                take_payloads(&mut station.begun)
            }
        };
        let now_us = self.bench.time_us();
        station
            .received
            .extend(bytes.into_iter().map(|byte| (now_us, byte)));
    }

    /// Lets time pass, and notes when what came.
    pub fn hear_for(&mut self, station: &mut Station, duration_us: u64) -> Vec<Frame> {
        self.receive(station);
        let from_us = self.bench.time_us();
        self.hear_until(station, duration_us, |_| false);
        frames_after(&station.received, from_us)
    }

    /// What has come since then.
    pub fn heard_since(&mut self, station: &mut Station, from_us: u64) -> Vec<Frame> {
        self.receive(station);
        frames_after(&station.received, from_us)
    }

    /// Sends to all in the network, by UDP.
    pub fn broadcast(&mut self, station: &Station, bytes: &[u8]) {
        let Socket::Udp(port) = station.socket else {
            panic!("TCP has no broadcasts");
        };
        let everyone = SocketAddrV4::new(Ipv4Addr::BROADCAST, UDP_PORT);
        assert!(self.air.laptop(station.laptop).send_to(port, bytes, everyone));
    }

    fn hear_until(
        &mut self,
        station: &mut Station,
        limit_us: u64,
        condition: impl Fn(&[(u64, u8)]) -> bool,
    ) -> bool {
        let end_us = self.bench.time_us() + limit_us;
        while self.bench.time_us() < end_us {
            self.run_for(MILLISECOND);
            self.receive(station);
            if condition(&station.received) {
                return true;
            }
        }
        false
    }

    /// Sends a request, and returns what is answered in the next 200 ms, but for telemetry.
    pub fn ask(&mut self, station: &mut Station, request: &[u8]) -> Vec<Frame> {
        self.send(station, request);
        let telemetry = [HEARTBEAT, SYS_STATUS, BATTERY_STATUS];
        let mut answers = self.hear_for(station, ANSWER_TIME_US);
        answers.retain(|frame| !telemetry.contains(&frame.message_id));
        answers
    }

    /// Panics if the board has restarted.
    pub fn assert_not_reset(&self) {
        assert!(self.bench.resets().is_empty(), "{:?}", self.bench.resets());
    }
}

/// A binary message of a browser, which masks what it sends.
pub fn web_socket_frame(payload: &[u8]) -> Vec<u8> {
    const MASK: [u8; 4] = [0x5a, 0xa5, 0x0f, 0xf0];
    let mut frame = vec![0x82, 0x80 | 126];
    frame.extend((payload.len() as u16).to_be_bytes());
    frame.extend(MASK);
    let masks = MASK.iter().cycle();
    frame.extend(payload.iter().zip(masks).map(|(byte, mask)| byte ^ mask));
    frame
}

/// The place at which the content of an answer begins, once its head is whole.
pub fn end_of_head(answer: &[u8]) -> Option<usize> {
    const EMPTY_LINE: &[u8] = b"\r\n\r\n";
    let place = answer
        .windows(EMPTY_LINE.len())
        .position(|bytes| bytes == EMPTY_LINE)?;
    Some(place + EMPTY_LINE.len())
}

/// Takes the payloads of all whole frames, which are binary.
fn take_payloads(bytes: &mut Vec<u8>) -> Vec<u8> {
    let mut payloads = Vec::new();
    loop {
        let (start, length) = match bytes[..] {
            [0x82, 126, high, low, ..] => (4, usize::from(u16::from_be_bytes([high, low]))),
            [0x82, 126, ..] | [_] | [] => return payloads,
            [0x82, short, ..] => (2, usize::from(short)),
            [..] => panic!("no binary message: {bytes:x?}"),
        };
        if bytes.len() < start + length {
            return payloads;
        }
        payloads.extend(bytes.drain(..start + length).skip(start));
    }
}

/// All bytes of a datagram come at one time.
fn frames_after(received: &[(u64, u8)], from_us: u64) -> Vec<Frame> {
    let later = received.partition_point(|(at_us, _)| *at_us <= from_us);
    frames(&received[later..])
}
