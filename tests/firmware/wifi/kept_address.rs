//! Phones that keep their address while the board restarts.

use std::net::Ipv4Addr;

use emulator::LogLevel;
use smoltcp::wire::Ipv4Cidr;

use super::ground::{Ground, Station};
use emulator::air::laptop::Laptop;
use support::frames::{PARAM_VALUE, of_message};
use support::requests::param_read_by_name;
use workbench::bench::SECOND;

const STRANGER: [u8; 6] = [2, 0, 0, 0, 9, 9];

/// A phone that is served. It asks for no address any more.
fn connected_phone(ground: &mut Ground) -> Station {
    let mut phone = ground.found_station();
    assert!(is_heard(ground, &mut phone));
    ground.air.laptop(phone.laptop).keep_address();
    phone
}

fn is_heard(ground: &mut Ground, phone: &mut Station) -> bool {
    let answers = ground.ask(phone, &param_read_by_name("BATT_CAPACITY"));
    of_message(&answers, PARAM_VALUE).len() == 1
}

fn wait_until_joined(ground: &mut Ground, laptop: usize) {
    ground.wait_for_network(3 * SECOND);
    let is_joined = ground
        .air
        .run_until(&mut ground.bench, SECOND, |air, _| air.is_joined(laptop));
    assert!(is_joined);
}

#[test]
// Requirement: R-8
fn a_phone_that_keeps_its_address_over_a_reset_is_heard_at_once() {
    let mut ground = Ground::up();
    let mut phone = connected_phone(&mut ground);
    let credentials = ground.credentials();
    let address = Ipv4Cidr::new(Ipv4Addr::new(192, 168, 4, 2), 24);
    let stranger = Laptop::with_address(STRANGER, Some(credentials), address);
    let stranger = ground.air.add(stranger);

    ground.bench.reboot();
    wait_until_joined(&mut ground, stranger);
    let stranger = ground.connect(stranger);
    assert!(!ground.is_connected(&stranger));
    assert!(is_heard(&mut ground, &mut phone));
    assert_eq!(ground.bench.logged(LogLevel::Info, "has kept").len(), 1);
    assert!(ground.bench.logged(LogLevel::Info, "is lent").is_empty());
}

#[test]
// Requirement: R-8
fn a_phone_that_keeps_its_address_over_a_power_cycle_is_heard_at_once() {
    let mut ground = Ground::up();
    let mut phone = connected_phone(&mut ground);
    ground.bench.power_cycle();
    wait_until_joined(&mut ground, phone.laptop);
    assert!(is_heard(&mut ground, &mut phone));
    assert_eq!(ground.bench.logged(LogLevel::Info, "is lent").len(), 1);
}
