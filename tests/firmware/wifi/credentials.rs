//! The network's name and password: whose they are, who gets to know them, and what strangers get.

use super::ground::Ground;
use emulator::air::laptop::Laptop;
use emulator::air::radio::Credentials;
use support::frames::{WIFI_CONFIG_AP, of_message};
use support::requests::wifi_config;
use workbench::bench::{Bench, DIVIDER_CODE, SECOND, TestedVehicle, Wire};

/// WIFI_CONFIG_AP_MODE.
const ACCESS_POINT: u8 = 1;

/// Where its response is: 0 none, 1 accepted.
const RESPONSE: usize = 97;
const ACCEPTED: u8 = 1;

#[test]
fn the_password_is_the_boards_own_and_survives_a_restart() {
    let mut ground = Ground::up();
    let first = ground.credentials();
    assert!(first.ssid.starts_with("rover-"), "{first:?}");
    ground.bench.reboot();
    ground.wait_for_network(2 * SECOND);
    assert_eq!(ground.credentials(), first);

    let other = Ground::of(Bench::power_up_seeded(DIVIDER_CODE, 2)).credentials();
    assert_ne!(other.ssid, first.ssid);
    assert_ne!(other.passphrase, first.passphrase);
}

#[test]
fn who_does_not_know_the_password_is_not_in_the_network() {
    let mut ground = Ground::up();
    let mut wrong = ground.credentials();
    wrong.passphrase = Some("a guess of mine".into());
    let stranger = ground.air.add(Laptop::new([2, 0, 0, 0, 0, 77], Some(wrong)));
    ground.run_for(3 * SECOND);
    assert!(!ground.air.is_joined(stranger));
    assert!(ground.air.refused(stranger) >= 2);
}

#[test]
fn only_by_usb_or_signed_is_another_password_set() {
    let mut ground = Ground::up();
    let before = ground.credentials();
    let request = wifi_config("", "another password", ACCESS_POINT);
    assert!(of_message(&ground.bench.ask(&request), WIFI_CONFIG_AP).is_empty());
    let mut station = ground.connected_station();
    assert!(of_message(&ground.ask(&mut station, &request), WIFI_CONFIG_AP).is_empty());
    assert_eq!(ground.credentials(), before);

    ground.bench.use_wire(Wire::Usb);
    let answers = ground.bench.ask(&request);
    let answer = of_message(&answers, WIFI_CONFIG_AP)[0];
    assert_eq!(answer.u8(RESPONSE), ACCEPTED);
    let password = answer.text(32, 64);
    assert!(!password.contains("another"), "no answer shows a password");
    ground.run_for(2 * SECOND);
    ground.wait_for_network(4 * SECOND);
    let expected = Credentials::new(&before.ssid, "another password");
    assert_eq!(ground.credentials(), expected);
    // The station is out, and comes back with the new password.
    let laptop = ground.laptop();
    let station = ground.connect(laptop);
    assert!(ground.is_connected(&station));
}
