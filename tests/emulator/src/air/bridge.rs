//! From a laptop's ports to programs on the host: a ground station there takes itself for one on the laptop.

use std::io;
use std::net::{Ipv4Addr, Ipv6Addr, SocketAddr, SocketAddrV4, TcpListener, UdpSocket};

use super::computer::{Connection, UdpPort};
use super::laptop::Laptop;
use crate::host_stream::HostStream;

/// Longer than any datagram on Ethernet that is not fragmented.
const LONGEST_DATAGRAM_BYTES: usize = 1500;

/// This many datagrams of a ground station are taken over at once.
const DATAGRAMS_AT_ONCE: usize = 64;

/// A program that does not read is sent nothing more beyond this; the board then waits.
const UNREAD_BYTES: usize = 65_536;

/// A ground station that waits for datagrams at a port of the host, as if it ran on the laptop.
pub struct UdpBridge {
    /// The ground station receives from this socket, and answers to it.
    socket: UdpSocket,
    station: SocketAddr,
    port: UdpPort,
    /// Who has sent last to the laptop.
    board: Option<SocketAddrV4>,
}

impl UdpBridge {
    /// Between a program's port on the host and a port of the laptop.
    pub fn new(station: SocketAddr, laptop: &mut Laptop, port: u16) -> io::Result<Self> {
        let any = match station {
            SocketAddr::V4(_) => SocketAddr::from((Ipv4Addr::UNSPECIFIED, 0)),
            SocketAddr::V6(_) => SocketAddr::from((Ipv6Addr::UNSPECIFIED, 0)),
        };
        let socket = UdpSocket::bind(any)?;
        socket.set_nonblocking(true)?;
        let port = laptop.bind_udp(port);
        Ok(Self {
            socket,
            station,
            port,
            board: None,
        })
    }

    /// Takes over what has come to both ends.
    pub fn exchange(&mut self, laptop: &mut Laptop) {
        for datagram in laptop.take_datagrams(self.port) {
            self.board = Some(datagram.from);
            // A station that is not there yet hears the next one.
            let _ = self.socket.send_to(&datagram.bytes, self.station);
        }
        for _ in 0..DATAGRAMS_AT_ONCE {
            let Some(bytes) = self.receive() else {
                break;
            };
            if let Some(board) = self.board {
                laptop.send_to(self.port, &bytes, board);
            }
        }
    }

    /// The next datagram; of others than the station it is empty.
    fn receive(&self) -> Option<Vec<u8>> {
        let mut bytes = vec![0; LONGEST_DATAGRAM_BYTES];
        let (length, from) = self.socket.recv_from(&mut bytes).ok()?;
        bytes.truncate(if from == self.station { length } else { 0 });
        Some(bytes)
    }
}

/// A TCP port of the host that leads to one of the board: each connection to it becomes one of the laptop.
pub struct TcpBridge {
    listener: TcpListener,
    board: SocketAddrV4,
    pairs: Vec<Pair>,
}

/// Two connections that are one.
struct Pair {
    /// `None` once it is closed.
    station: Option<HostStream>,
    connection: Connection,
}

impl TcpBridge {
    /// Between a port of the host and one of the board.
    pub fn listen(address: SocketAddr, board: SocketAddrV4) -> io::Result<Self> {
        let listener = TcpListener::bind(address)?;
        listener.set_nonblocking(true)?;
        Ok(Self {
            listener,
            board,
            pairs: Vec::new(),
        })
    }

    /// Takes over what has come to both ends. Without an address the laptop has no connections, and new ones wait.
    pub fn exchange(&mut self, laptop: &mut Laptop) {
        if laptop.address().is_none() {
            for pair in self.pairs.drain(..) {
                laptop.forget(pair.connection);
            }
            return;
        }
        while let Ok(station) = self.listener.accept().and_then(HostStream::new) {
            self.pairs.push(Pair {
                station: Some(station),
                connection: laptop.connect(self.board),
            });
        }
        for pair in &mut self.pairs {
            pair.exchange(laptop);
        }
        self.pairs.retain(|pair| !pair.is_over(laptop));
    }
}

impl Pair {
    fn exchange(&mut self, laptop: &mut Laptop) {
        let connection = self.connection;
        let is_served = self.station.as_mut().is_some_and(|station| {
            let carried = carry(station, laptop, connection);
            let ended = !laptop.is_open(connection) && station.unwritten() == 0;
            carried.is_ok() && !ended
        });
        if !is_served {
            self.station = None;
            laptop.close(connection);
            // What is not read any more must not keep the board from closing.
            laptop.take_received(connection);
        }
    }

    /// Whether nothing is left of it.
    fn is_over(&self, laptop: &mut Laptop) -> bool {
        let is_over = self.station.is_none() && laptop.is_over(self.connection);
        if is_over {
            laptop.forget(self.connection);
        }
        is_over
    }
}

/// Both ways. An error: the station has closed its connection.
fn carry(station: &mut HostStream, laptop: &mut Laptop, connection: Connection) -> io::Result<()> {
    let room = laptop.room(connection);
    if room > 0 {
        let bytes = station.read(room)?;
        laptop.send(connection, &bytes);
    }
    let received = match station.unwritten() < UNREAD_BYTES {
        true => laptop.take_received(connection),
        false => Vec::new(),
    };
    station.write(&received)
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpStream;

    use smoltcp::wire::Ipv4Cidr;

    use super::*;
    use crate::air::echo::{ECHO_PORT, Echo};

    const BOARD: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1);

    /// What is sent to a port of this host is there at the next look or a little later.
    const LOOKS: usize = 100_000;

    fn any_port() -> SocketAddr {
        SocketAddr::from((Ipv4Addr::LOCALHOST, 0))
    }

    struct Wired {
        laptop: Laptop,
        echo: Echo,
        now_us: u64,
    }

    impl Wired {
        fn new() -> Self {
            let address = Ipv4Cidr::new(Ipv4Addr::new(192, 168, 4, 2), 24);
            let mut laptop = Laptop::new([2, 0, 0, 0, 0, 1], None);
            laptop.keep_address();
            laptop.set_address(Some(address));
            Self {
                laptop,
                echo: Echo::new(Ipv4Cidr::new(BOARD, 24)),
                now_us: 0,
            }
        }

        fn step(&mut self) {
            self.now_us += 1000;
            for frame in self.laptop.poll(self.now_us) {
                self.echo.computer.receive(&frame);
            }
            for frame in self.echo.poll(self.now_us) {
                self.laptop.receive(&frame);
            }
        }

        fn run(&mut self, bridge: &mut TcpBridge, milliseconds: u64) {
            let end_us = self.now_us + milliseconds * 1000;
            self.until(bridge, |wired| wired.now_us >= end_us);
        }

        /// Has the bridge work until the condition holds.
        fn until(&mut self, bridge: &mut TcpBridge, mut condition: impl FnMut(&mut Self) -> bool) {
            for _ in 0..LOOKS {
                bridge.exchange(&mut self.laptop);
                self.step();
                if condition(self) {
                    return;
                }
            }
            panic!("it never came");
        }
    }

    #[test]
    fn a_station_hears_the_board_first_and_is_heard_by_it() {
        let mut wired = Wired::new();
        let [station, stranger] = [(); 2].map(|()| UdpSocket::bind(any_port()).unwrap());
        station.set_nonblocking(true).unwrap();
        let mut bridge = UdpBridge::new(station.local_addr().unwrap(), &mut wired.laptop, 14550).unwrap();
        let board = wired.echo.computer.bind_udp(14550);
        let everyone = SocketAddrV4::new(Ipv4Addr::new(192, 168, 4, 255), 14550);
        wired.echo.computer.send_to(board, b"heartbeat", everyone);
        let mut bytes = [0; 100];
        let (length, from) = (0..LOOKS)
            .find_map(|_| {
                wired.step();
                bridge.exchange(&mut wired.laptop);
                station.recv_from(&mut bytes).ok()
            })
            .expect("a heartbeat");
        assert_eq!(&bytes[..length], b"heartbeat");

        let bridged = SocketAddr::from((Ipv4Addr::LOCALHOST, from.port()));
        stranger.send_to(b"not for you", bridged).unwrap();
        station.send_to(b"request", bridged).unwrap();
        let request = (0..LOOKS)
            .find_map(|_| {
                bridge.exchange(&mut wired.laptop);
                wired.step();
                let datagrams = wired.echo.computer.take_datagrams(board);
                datagrams.into_iter().find(|datagram| !datagram.bytes.is_empty())
            })
            .expect("a request");
        assert_eq!(request.bytes, b"request");
        assert_eq!(
            request.from,
            SocketAddrV4::new(Ipv4Addr::new(192, 168, 4, 2), 14550)
        );
    }

    fn connected() -> (Wired, TcpBridge, TcpStream) {
        let mut wired = Wired::new();
        let mut bridge = TcpBridge::listen(any_port(), SocketAddrV4::new(BOARD, ECHO_PORT)).unwrap();
        let station = TcpStream::connect(bridge.listener.local_addr().unwrap()).unwrap();
        station.set_nonblocking(true).unwrap();
        wired.until(&mut bridge, |wired| wired.echo.connections() == 1);
        (wired, bridge, station)
    }

    #[test]
    fn a_connection_carries_every_byte() {
        let (mut wired, mut bridge, mut station) = connected();
        let bytes: Vec<u8> = (0..300_000_u32)
            .map(|position| (position.wrapping_mul(position) >> 7) as u8)
            .collect();
        let (mut sent, mut received) = (0, Vec::<u8>::new());
        let mut chunk = vec![0; 65_536];
        wired.until(&mut bridge, |_| {
            sent += station.write(&bytes[sent..]).unwrap_or(0);
            let length = station.read(&mut chunk).unwrap_or(0);
            received.extend(&chunk[..length]);
            received.len() >= bytes.len()
        });
        assert!(received == bytes);
    }

    #[test]
    fn a_station_that_closes_closes_the_boards_connection() {
        let (mut wired, mut bridge, station) = connected();
        drop(station);
        wired.until(&mut bridge, |wired| wired.echo.connections() == 0);
        wired.run(&mut bridge, 100);
        assert!(bridge.pairs.is_empty());
    }

    #[test]
    fn a_board_that_closes_closes_the_stations_connection_once_all_is_read() {
        let (mut wired, mut bridge, mut station) = connected();
        station.write_all(b"last words").unwrap();
        wired.run(&mut bridge, 100);
        wired.echo.close();
        let (mut received, mut bytes) = (Vec::<u8>::new(), [0; 100]);
        wired.until(&mut bridge, |_| {
            let length = station.read(&mut bytes);
            received.extend(&bytes[..*length.as_ref().unwrap_or(&0)]);
            matches!(length, Ok(0))
        });
        assert_eq!(received, b"last words");
        wired.run(&mut bridge, 100);
        assert!(bridge.pairs.is_empty());
    }

    #[test]
    fn a_refused_connection_is_closed_and_a_laptop_without_an_address_has_none() {
        let mut wired = Wired::new();
        let mut bridge = TcpBridge::listen(any_port(), SocketAddrV4::new(BOARD, ECHO_PORT + 1)).unwrap();
        let mut station = TcpStream::connect(bridge.listener.local_addr().unwrap()).unwrap();
        station.set_nonblocking(true).unwrap();
        wired.until(&mut bridge, |_| matches!(station.read(&mut [0]), Ok(0)));

        let (mut wired, mut bridge, mut station) = connected();
        wired.laptop.set_address(None);
        bridge.exchange(&mut wired.laptop);
        assert!(bridge.pairs.is_empty());
        wired.until(&mut bridge, |_| matches!(station.read(&mut [0]), Ok(0)));
    }
}
