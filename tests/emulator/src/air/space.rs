//! What carries frames between the board's radio and the computers in reach.

use super::hostile::Hostile;
use super::laptop::Laptop;
use super::radio::{Credentials, Radio, is_for};
use super::router::Router;
use crate::{Board, Random};

const SECOND_US: u64 = 1_000_000;

/// So much emulated time passes between two exchanges with a board.
const SLICE_US: u64 = 1_000;

/// A computer that was refused tries again after this time.
const RETRY_US: u64 = SECOND_US;

/// The networks that there can be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Network {
    AccessPoint,
    Router,
}

/// A laptop, and where it is.
struct Member {
    laptop: Laptop,
    joined: Option<Network>,
    refused: usize,
    /// When it tries next to join.
    next_attempt_us: u64,
}

/// Traffic of strangers.
struct Flood {
    hostile: Hostile,
    frames_per_second: u64,
    began_us: u64,
    sent: u64,
}

/// The air: computers in reach of the board. Nothing takes time in it, and everything arrives unless frames are lost on purpose.
pub struct Air {
    members: Vec<Member>,
    router: Option<Router>,
    flood: Option<Flood>,
    random: Random,
    lost_share: f64,
    overrun: usize,
}

impl Air {
    /// Without any computer. The seed decides which frames are lost.
    pub fn new(seed: u64) -> Self {
        Self {
            members: Vec::new(),
            router: None,
            flood: None,
            random: Random::new(seed),
            lost_share: 0.0,
            overrun: 0,
        }
    }

    /// A laptop comes into reach. Returns its number.
    pub fn add(&mut self, laptop: Laptop) -> usize {
        self.members.push(Member {
            laptop,
            joined: None,
            refused: 0,
            next_attempt_us: 0,
        });
        self.members.len() - 1
    }

    /// Panics if there is no such laptop.
    pub fn laptop(&mut self, number: usize) -> &mut Laptop {
        &mut self.members[number].laptop
    }

    /// All of them.
    pub fn laptops(&mut self) -> impl Iterator<Item = &mut Laptop> {
        self.members.iter_mut().map(|member| &mut member.laptop)
    }

    /// Whether a laptop has joined a network.
    pub fn is_joined(&self, number: usize) -> bool {
        self.members[number].joined.is_some()
    }

    /// How often a laptop was refused for its passphrase.
    pub fn refused(&self, number: usize) -> usize {
        self.members[number].refused
    }

    /// A router is switched on, or off.
    pub fn set_router(&mut self, router: Option<Router>) {
        self.router = router;
    }

    pub fn router(&mut self) -> Option<&mut Router> {
        self.router.as_mut()
    }

    /// Loses this share of all frames from now on, 0 to 1.
    pub fn lose(&mut self, share: f64) {
        self.lost_share = share;
    }

    /// Frames that came to the board and for which its chip had no room.
    pub fn overrun(&self) -> usize {
        self.overrun
    }

    /// Strangers send to the board from now on, at this rate.
    pub fn flood(&mut self, hostile: Hostile, frames_per_second: u64, now_us: u64) {
        self.flood = Some(Flood {
            hostile,
            frames_per_second,
            began_us: now_us,
            sent: 0,
        });
    }

    /// Strangers are silent from now on.
    pub fn calm(&mut self) {
        self.flood = None;
    }

    /// Carries what was sent since the last call, and lets the computers do what is due at this time.
    pub fn exchange(&mut self, radio: &mut impl Radio, now_us: u64) {
        self.update_memberships(radio, now_us);
        let frames = radio.take_sent();
        if let Some(network) = self.network_of(radio) {
            self.carry_to_computers(network, &frames);
        }
        self.poll_computers(radio, now_us);
        self.send_flood(radio, now_us);
    }

    fn update_memberships(&mut self, radio: &mut impl Radio, now_us: u64) {
        let router = self.router.as_ref().map(|router| router.credentials().clone());
        let networks = [
            (Network::AccessPoint, radio.access_point()),
            (Network::Router, router),
        ];
        for member in &mut self.members {
            member.update(&networks, radio, now_us);
        }
    }

    /// The network that the board is in.
    fn network_of(&self, radio: &impl Radio) -> Option<Network> {
        if radio.access_point().is_some() {
            return Some(Network::AccessPoint);
        }
        let router = self.router.as_ref()?;
        (radio.joined()? == router.credentials().ssid).then_some(Network::Router)
    }

    fn poll_computers(&mut self, radio: &mut impl Radio, now_us: u64) {
        for number in 0..self.members.len() {
            let member = &mut self.members[number];
            let frames = member.laptop.poll(now_us);
            if let Some(network) = member.joined {
                self.carry(radio, network, &frames);
            }
        }
        if let Some(router) = &mut self.router {
            let frames = router.poll(now_us);
            self.carry(radio, Network::Router, &frames);
        }
    }

    /// Carries frames of a computer.
    fn carry(&mut self, radio: &mut impl Radio, network: Network, frames: &[Vec<u8>]) {
        self.carry_to_computers(network, frames);
        if self.network_of(radio) == Some(network) {
            for frame in frames {
                self.carry_to_board(radio, frame);
            }
        }
    }

    fn carry_to_computers(&mut self, network: Network, frames: &[Vec<u8>]) {
        for frame in frames {
            let members = self
                .members
                .iter_mut()
                .filter(|member| member.joined == Some(network));
            let laptops = members.map(|member| &mut *member.laptop);
            let router = self.router.as_deref_mut().filter(|_| network == Network::Router);
            for computer in laptops.chain(router) {
                if is_for(computer.mac(), frame) && self.random.unit() >= self.lost_share {
                    computer.receive(frame);
                }
            }
        }
    }

    fn carry_to_board(&mut self, radio: &mut impl Radio, frame: &[u8]) {
        let arrives = is_for(radio.mac(), frame) && self.random.unit() >= self.lost_share;
        if arrives && !radio.send(frame) {
            self.overrun += 1;
        }
    }

    fn send_flood(&mut self, radio: &mut impl Radio, now_us: u64) {
        if let Some(flood) = &mut self.flood {
            for frame in flood.due(now_us) {
                self.overrun += usize::from(!radio.send(&frame));
            }
        }
    }
}

/// With the emulated board.
impl Air {
    /// Carries what was sent since the last call.
    pub fn exchange_with(&mut self, board: &mut Board) {
        let now_us = board.time_us();
        self.exchange(board.wifi(), now_us);
    }

    /// Lets the board run with everything around it.
    pub fn run_for(&mut self, board: &mut Board, duration_us: u64) {
        self.run_until(board, duration_us, |_, _| false);
    }

    /// Lets the board run until the condition holds, at most for this time. Returns whether it does.
    pub fn run_until(
        &mut self,
        board: &mut Board,
        limit_us: u64,
        mut condition: impl FnMut(&mut Self, &mut Board) -> bool,
    ) -> bool {
        let end_us = board.time_us() + limit_us;
        while board.time_us() < end_us {
            board.run_for(SLICE_US.min(end_us - board.time_us()));
            self.exchange_with(board);
            if condition(self, board) {
                return true;
            }
        }
        false
    }
}

impl Member {
    fn update(&mut self, networks: &[(Network, Option<Credentials>)], radio: &mut impl Radio, now_us: u64) {
        let joined = self.reachable(networks, now_us);
        if joined == self.joined {
            return;
        }
        let mac = self.laptop.mac();
        if self.joined == Some(Network::AccessPoint) {
            radio.client_left(mac);
        }
        if joined == Some(Network::AccessPoint) {
            radio.client_joined(mac);
        }
        self.joined = joined;
        self.laptop.joined();
    }

    /// The network that it is in, or that it joins now.
    fn reachable(&mut self, networks: &[(Network, Option<Credentials>)], now_us: u64) -> Option<Network> {
        let known = self.laptop.credentials.as_ref()?;
        let with_name = networks
            .iter()
            .filter_map(|(network, credentials)| Some((*network, credentials.as_ref()?)))
            .find(|(_, credentials)| credentials.ssid == known.ssid);
        let (network, credentials) = with_name?;
        if credentials == known {
            return Some(network);
        }
        if now_us >= self.next_attempt_us {
            self.refused += 1;
            self.next_attempt_us = now_us + RETRY_US;
        }
        None
    }
}

impl Flood {
    /// What is to be sent until this time and was not sent yet.
    fn due(&mut self, now_us: u64) -> Vec<Vec<u8>> {
        let due = (now_us - self.began_us) * self.frames_per_second / SECOND_US;
        let frames = (self.sent..due).map(|_| self.hostile.frame()).collect();
        self.sent = due;
        frames
    }
}

#[cfg(test)]
mod tests {
    use std::net::{Ipv4Addr, SocketAddrV4};

    use smoltcp::wire::Ipv4Cidr;

    use super::*;
    use crate::air::computer::{Connection, UdpPort};
    use crate::air::dhcp_server::DhcpAnswers;
    use crate::air::echo::{ECHO_PORT, Echo};
    use crate::air::hostile::Target;
    use crate::air::radio::MacAddress;

    const BOARD: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1);

    /// A chip, and an echo behind it.
    struct FakeRadio {
        echo: Echo,
        sent: Vec<Vec<u8>>,
        received: Vec<Vec<u8>>,
        access_point: Option<Credentials>,
        joined: Option<String>,
        clients: Vec<MacAddress>,
        room: usize,
    }

    impl Radio for FakeRadio {
        fn mac(&self) -> MacAddress {
            self.echo.computer.mac()
        }

        fn access_point(&self) -> Option<Credentials> {
            self.access_point.clone()
        }

        fn joined(&self) -> Option<String> {
            self.joined.clone()
        }

        fn take_sent(&mut self) -> Vec<Vec<u8>> {
            std::mem::take(&mut self.sent)
        }

        fn send(&mut self, frame: &[u8]) -> bool {
            let has_room = self.received.len() < self.room;
            if has_room {
                self.received.push(frame.to_vec());
            }
            has_room
        }

        fn client_joined(&mut self, mac: MacAddress) {
            assert!(!self.clients.contains(&mac));
            self.clients.push(mac);
        }

        fn client_left(&mut self, mac: MacAddress) {
            assert!(self.clients.contains(&mac));
            self.clients.retain(|client| *client != mac);
        }
    }

    struct Scene {
        air: Air,
        radio: FakeRadio,
        now_us: u64,
    }

    fn boards() -> Credentials {
        Credentials::new("Rover-1", "long enough")
    }

    fn at_home() -> Credentials {
        Credentials::new("Home", "12345678")
    }

    fn mac(number: u8) -> MacAddress {
        [2, 0, 0, 0, 0, number]
    }

    fn echo_at(address: Ipv4Addr) -> SocketAddrV4 {
        SocketAddrV4::new(address, ECHO_PORT)
    }

    impl Scene {
        fn new() -> Self {
            let radio = FakeRadio {
                echo: Echo::new(Ipv4Cidr::new(BOARD, 24)),
                sent: Vec::new(),
                received: Vec::new(),
                access_point: None,
                joined: None,
                clients: Vec::new(),
                room: usize::MAX,
            };
            let (air, now_us) = (Air::new(1), 0);
            Self { air, radio, now_us }
        }

        fn with_access_point() -> Self {
            let mut scene = Self::new();
            scene.radio.access_point = Some(boards());
            scene
        }

        /// A laptop at 192.168.4.`number`.
        fn add(&mut self, number: u8, credentials: Credentials) -> usize {
            let address = Ipv4Cidr::new(Ipv4Addr::new(192, 168, 4, number), 24);
            let mut laptop = Laptop::new(mac(number), Some(credentials));
            laptop.keep_address();
            laptop.set_address(Some(address));
            self.air.add(laptop)
        }

        fn run(&mut self, milliseconds: u64) {
            for _ in 0..milliseconds {
                self.now_us += 1000;
                for frame in std::mem::take(&mut self.radio.received) {
                    self.radio.echo.computer.receive(&frame);
                }
                self.radio.sent.extend(self.radio.echo.poll(self.now_us));
                self.air.exchange(&mut self.radio, self.now_us);
            }
        }

        /// How many of `count` datagrams come back.
        fn echoed(&mut self, laptop: usize, port: UdpPort, count: usize) -> usize {
            let mut echoed = 0;
            for _ in 0..count {
                self.air.laptop(laptop).send_to(port, b"echo", echo_at(BOARD));
                self.run(5);
                echoed += self.air.laptop(laptop).take_datagrams(port).len();
            }
            echoed
        }
    }

    #[test]
    fn only_the_right_name_and_passphrase_join() {
        let mut scene = Scene::with_access_point();
        let wrong = Credentials::new("Rover-1", "wrong enough");
        let laptops = [boards(), wrong, at_home()].map(|credentials| {
            let number = scene.air.members.len() as u8 + 2;
            scene.add(number, credentials)
        });
        let ports = laptops.map(|laptop| scene.air.laptop(laptop).bind_udp(14550));
        scene.run(3500);
        assert_eq!(scene.radio.clients, [mac(2)]);
        assert_eq!(
            laptops.map(|laptop| scene.air.is_joined(laptop)),
            [true, false, false]
        );
        assert_eq!(laptops.map(|laptop| scene.air.refused(laptop)), [0, 4, 0]);
        let echoed = [0, 1, 2].map(|index| scene.echoed(laptops[index], ports[index], 2));
        assert_eq!(echoed, [2, 0, 0]);
    }

    #[test]
    fn a_laptop_without_an_owner_joins_once_it_gets_the_credentials() {
        let mut scene = Scene::with_access_point();
        let laptop = scene.air.add(Laptop::new(mac(2), None));
        scene.run(10);
        assert!(!scene.air.is_joined(laptop) && scene.air.refused(laptop) == 0);
        for laptop in scene.air.laptops() {
            laptop.credentials = Some(boards());
        }
        scene.run(10);
        assert!(scene.air.is_joined(laptop));
    }

    #[test]
    fn an_access_point_that_goes_takes_its_clients_along_until_it_is_back() {
        let mut scene = Scene::with_access_point();
        let laptop = scene.add(2, boards());
        let port = scene.air.laptop(laptop).bind_udp(14550);
        assert_eq!(scene.echoed(laptop, port, 2), 2);
        scene.radio.access_point = None;
        assert_eq!(scene.echoed(laptop, port, 2), 0);
        assert!(scene.radio.clients.is_empty() && !scene.air.is_joined(laptop));
        scene.radio.access_point = Some(boards());
        assert_eq!(scene.echoed(laptop, port, 2), 2);
        assert_eq!(scene.radio.clients, [mac(2)]);
    }

    #[test]
    fn a_broadcast_reaches_all_and_anything_else_only_the_one_it_is_for() {
        let mut scene = Scene::with_access_point();
        let laptops = [2, 3].map(|number| scene.add(number, boards()));
        let ports = laptops.map(|laptop| scene.air.laptop(laptop).bind_udp(14550));
        scene.run(5);
        let from = scene.radio.echo.computer.bind_udp(14550);
        let mut reached = |last_byte| {
            let to = SocketAddrV4::new(Ipv4Addr::new(192, 168, 4, last_byte), 14550);
            scene.radio.echo.computer.send_to(from, b"x", to);
            scene.run(5);
            [0, 1].map(|index| {
                scene
                    .air
                    .laptop(laptops[index])
                    .take_datagrams(ports[index])
                    .len()
            })
        };
        assert_eq!(reached(255), [1, 1]);
        assert_eq!(reached(3), [0, 1]);
        assert_eq!(reached(4), [0, 0]);
    }

    #[test]
    fn laptops_of_one_network_reach_each_other() {
        let mut scene = Scene::with_access_point();
        let laptops = [2, 3].map(|number| scene.add(number, boards()));
        let ports = laptops.map(|laptop| scene.air.laptop(laptop).bind_udp(14550));
        scene.run(5);
        let to = SocketAddrV4::new(Ipv4Addr::new(192, 168, 4, 3), 14550);
        scene.air.laptop(laptops[0]).send_to(ports[0], b"hello", to);
        scene.run(5);
        let datagrams = scene.air.laptop(laptops[1]).take_datagrams(ports[1]);
        assert_eq!(datagrams.len(), 1);
        assert_eq!(datagrams[0].from.ip().octets(), [192, 168, 4, 2]);
    }

    #[test]
    fn a_lossy_network_loses_datagrams_and_no_byte_of_a_connection() {
        let mut scene = Scene::with_access_point();
        let laptop = scene.add(2, boards());
        let port = scene.air.laptop(laptop).bind_udp(14550);
        assert_eq!(scene.echoed(laptop, port, 10), 10);
        scene.air.lose(1.0);
        assert_eq!(scene.echoed(laptop, port, 10), 0);
        scene.air.lose(0.1);
        let echoed = scene.echoed(laptop, port, 200);
        assert!((140..185).contains(&echoed), "{echoed} of 200");
        let connection = scene.air.laptop(laptop).connect(echo_at(BOARD));
        let bytes: Vec<u8> = (0..50_000_u32)
            .map(|position| (position.wrapping_mul(position) >> 7) as u8)
            .collect();
        assert!(received_back(&mut scene, laptop, connection, &bytes) == bytes);
    }

    fn received_back(scene: &mut Scene, laptop: usize, connection: Connection, bytes: &[u8]) -> Vec<u8> {
        let (mut sent, mut received) = (0, Vec::new());
        for _ in 0..60_000 {
            sent += scene.air.laptop(laptop).send(connection, &bytes[sent..]);
            scene.run(1);
            received.extend(scene.air.laptop(laptop).take_received(connection));
            if received.len() == bytes.len() {
                break;
            }
        }
        received
    }

    #[test]
    fn frames_that_the_chip_has_no_room_for_are_counted() {
        let mut scene = Scene::with_access_point();
        let laptop = scene.add(2, boards());
        let port = scene.air.laptop(laptop).bind_udp(14550);
        assert_eq!((scene.echoed(laptop, port, 3), scene.air.overrun()), (3, 0));
        scene.radio.room = 0;
        assert_eq!((scene.echoed(laptop, port, 3), scene.air.overrun()), (0, 3));
    }

    #[test]
    fn a_board_that_joins_a_router_gets_an_address_and_reaches_its_laptops() {
        let mut scene = Scene::new();
        scene.air.set_router(Some(Router::new(at_home())));
        let laptop = scene.air.add(Laptop::new(mac(2), Some(at_home())));
        let board = scene.radio.mac();
        // In place of the board's DHCP client.
        let mut client = Laptop::new(board, None);
        let mut run = |scene: &mut Scene, milliseconds: u64| {
            for _ in 0..milliseconds {
                scene.now_us += 1000;
                for frame in std::mem::take(&mut scene.radio.received) {
                    client.receive(&frame);
                }
                scene.radio.sent = client.poll(scene.now_us);
                scene.air.exchange(&mut scene.radio, scene.now_us);
            }
            client.address()
        };
        assert_eq!(run(&mut scene, 11_000), None, "it has not joined");
        scene.radio.joined = Some("Home".into());
        scene.air.router().unwrap().answer_dhcp_by(DhcpAnswers::Silence);
        assert_eq!(run(&mut scene, 11_000), None, "no server");
        scene.air.router().unwrap().answer_dhcp_by(DhcpAnswers::Leases);
        let address = run(&mut scene, 60_000);
        assert!(address.is_some());
        assert_eq!(scene.air.router().unwrap().leased_to(board), address);
        assert!(scene.air.is_joined(laptop) && scene.radio.clients.is_empty());
        scene.air.set_router(None);
        run(&mut scene, 10);
        assert!(!scene.air.is_joined(laptop));
    }

    #[test]
    fn a_flood_comes_at_its_rate_until_it_is_over() {
        let mut scene = Scene::with_access_point();
        let target = Target::new(scene.radio.mac(), BOARD);
        scene.air.flood(Hostile::new(1, target), 300, scene.now_us);
        let mut received = 0;
        for _ in 0..2000 {
            scene.now_us += 1000;
            scene.air.exchange(&mut scene.radio, scene.now_us);
            received += std::mem::take(&mut scene.radio.received).len();
        }
        assert_eq!(received, 600);
        scene.air.calm();
        scene.run(1000);
        assert!(scene.radio.received.is_empty());
    }
}
