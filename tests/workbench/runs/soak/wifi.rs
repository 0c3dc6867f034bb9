//! A laptop in the board's Wi-Fi network, with a ground station that only listens and reports that it is there.

use std::net::{Ipv4Addr, SocketAddrV4};

use crate::bench::{Bench, SECOND};
use emulator::air::computer::UdpPort;
use emulator::air::hostile::{Hostile, Target};
use emulator::air::laptop::Laptop;
use emulator::air::radio::Credentials;
use emulator::air::space::Air;
use support::frames::{HEARTBEAT, frames, of_message};
use support::requests::{GCS, heartbeat};

const UDP_PORT: u16 = 14550;
const BOARD: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1);
const LAPTOP_MAC: [u8; 6] = [2, 0, 0, 0, 0, 9];
const HOSTILE_FRAMES_PER_SECOND: u64 = 100;

/// From power-up until the network is there, at most.
const UP_WITHIN_US: u64 = 2 * SECOND;

pub struct Wifi {
    air: Air,
    laptop: usize,
    port: UdpPort,
    /// Where the board was heard.
    board: Option<SocketAddrV4>,
    heartbeat_due_us: u64,
    /// The first HEARTBEAT since news are expected.
    pub heard_us: Option<u64>,
    pub frames: u64,
}

impl Wifi {
    /// Gives a board that has not run yet a radio, and a laptop in reach its password.
    pub fn new(seed: u64, bench: &mut Bench) -> Self {
        bench.attach_wifi();
        let mut air = Air::new(seed);
        let is_up = air.run_until(bench, UP_WITHIN_US, |_, board| {
            board.wifi().access_point().is_some()
        });
        assert!(is_up, "{:?}", bench.log_lines());
        let network = bench.wifi().access_point().expect("it is up");
        let credentials = Credentials {
            ssid: network.ssid.clone(),
            passphrase: network.passphrase.clone(),
        };
        let laptop = air.add(Laptop::new(LAPTOP_MAC, Some(credentials)));
        Self {
            port: air.laptop(laptop).bind_udp(UDP_PORT),
            air,
            laptop,
            board: None,
            heartbeat_due_us: 0,
            heard_us: None,
            frames: 0,
        }
    }

    /// Lets the board run with the laptop in reach.
    pub fn run_for(&mut self, bench: &mut Bench, duration_us: u64) {
        self.air.run_for(bench, duration_us);
        let now_us = bench.time_us();
        self.receive(now_us);
        if self.heartbeat_due_us <= now_us {
            self.heartbeat_due_us = now_us + SECOND;
            if let Some(board) = self.board {
                let laptop = self.air.laptop(self.laptop);
                laptop.send_to(self.port, &heartbeat(GCS), board);
            }
        }
    }

    fn receive(&mut self, now_us: u64) {
        for datagram in self.air.laptop(self.laptop).take_datagrams(self.port) {
            self.board = Some(datagram.from);
            let bytes: Vec<_> = datagram.bytes.iter().map(|byte| (now_us, *byte)).collect();
            let frames = frames(&bytes);
            self.frames += frames.len() as u64;
            if !of_message(&frames, HEARTBEAT).is_empty() {
                self.heard_us.get_or_insert(now_us);
            }
        }
    }

    /// This share of all frames is lost from now on.
    pub fn lose(&mut self, share: f64) {
        self.air.lose(share);
    }

    /// Strangers send, too.
    pub fn flood(&mut self, seed: u64, bench: &mut Bench) {
        let target = Target::new(bench.wifi().mac(), BOARD);
        let hostile = Hostile::new(seed, target);
        let from_us = bench.time_us();
        self.air.flood(hostile, HOSTILE_FRAMES_PER_SECOND, from_us);
    }

    pub fn calm(&mut self) {
        self.air.calm();
    }
}
