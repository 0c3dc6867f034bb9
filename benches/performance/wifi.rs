//! What a Pico W's radio takes of the processor, and how punctual the board is beside it.

use std::net::{Ipv4Addr, SocketAddrV4};

use crate::figures::{Figure, Table};
use crate::running::VOLTAGE_CODE;
use emulator::Board;
use emulator::air::computer::Connection;
use emulator::air::hostile::{Hostile, Target};
use emulator::air::laptop::Laptop;
use emulator::air::radio::Credentials;
use emulator::air::space::Air;
use support::requests::param_set;
use workbench::bench::{Bench, CYCLES_PER_US, SECOND};

const BOARD: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1);
const TCP_PORT: u16 = 5760;

const UP_WITHIN_US: u64 = 3 * SECOND;
const MEASURED_US: u64 = 5 * SECOND;

/// Of every kind and length, from strangers in the network.
const HOSTILE_FRAMES_PER_SECOND: u64 = 1_000;

pub fn tables() -> Vec<Table> {
    let mut bench = Bench::power_up(VOLTAGE_CODE);
    bench.attach_wifi();
    let mut air = Air::new(1);
    let up_us = {
        let is_up = |_: &mut Air, board: &mut Board| board.wifi().access_point().is_some();
        assert!(air.run_until(&mut bench, UP_WITHIN_US, is_up));
        bench.time_us()
    };
    let idle = awake_percent(&mut bench, &mut air, |_| {});
    let (laptop, connection) = connect(&mut bench, &mut air);
    let read = |air: &mut Air| drop(air.laptop(laptop).take_received(connection));
    let served = awake_percent(&mut bench, &mut air, read);
    let target = Target::new(bench.wifi().mac(), BOARD);
    let now_us = bench.time_us();
    air.flood(Hostile::new(1, target), HOSTILE_FRAMES_PER_SECOND, now_us);
    let flooded = awake_percent(&mut bench, &mut air, read);

    let percent = |what: &str, value| Figure::new(format!("Wi-Fi: {what}"), value).with_digits(2);
    let awake = vec![
        percent("no one in the network", idle),
        percent("a station by TCP at 50 Hz", served),
        percent("and 1000 hostile frames a second", flooded),
    ];
    let times = vec![Figure::new("Wi-Fi: from power to the network", up_us as f64)];
    vec![
        Table::new("awake, a Pico W with one pack", "% of the time", awake),
        Table::new("a Pico W", "µs", times),
    ]
}

/// A ground station that asks for the highest rate.
fn connect(bench: &mut Bench, air: &mut Air) -> (usize, Connection) {
    let network = bench.wifi().access_point().expect("it is up");
    let credentials = Credentials {
        ssid: network.ssid.clone(),
        passphrase: network.passphrase.clone(),
    };
    let laptop = air.add(Laptop::new([2, 0, 0, 0, 0, 1], Some(credentials)));
    let has_address = |air: &mut Air, _: &mut Board| air.laptop(laptop).address().is_some();
    assert!(air.run_until(bench, UP_WITHIN_US, has_address));
    let connection = air.laptop(laptop).connect(SocketAddrV4::new(BOARD, TCP_PORT));
    air.run_for(bench, SECOND);
    air.laptop(laptop)
        .send(connection, &param_set("SR0_EXTRA1", 50.0));
    air.run_for(bench, SECOND);
    (laptop, connection)
}

/// The share of the time in which the processor is awake, in percent, while the laptops do something each millisecond.
fn awake_percent(bench: &mut Bench, air: &mut Air, act: impl Fn(&mut Air)) -> f64 {
    let before = bench.awake_cycles();
    air.run_until(bench, MEASURED_US, |air, _| {
        act(air);
        false
    });
    let awake_cycles = bench.awake_cycles() - before;
    100.0 * awake_cycles as f64 / (MEASURED_US * CYCLES_PER_US) as f64
}
