//! The board in another network: joined, lost, found again, and its own network instead.

use super::ground::{Ground, UDP_PORT};
use crate::update::updated;
use emulator::RadioFault;
use emulator::air::dhcp_server::DhcpAnswers;
use emulator::air::laptop::Laptop;
use emulator::air::radio::Credentials;
use emulator::air::router::Router;
use support::frames::{HEARTBEAT, of_message, texts_of};
use support::requests::wifi_config;
use workbench::bench::{SECOND, TestedVehicle, Wire};

const STATION: u8 = 2;

const PASSWORD: &str = "our own password";

fn home() -> Credentials {
    Credentials::new("home", PASSWORD)
}

/// A board that was set up by USB to join the network of the house, which may be there.
fn sent_home(password: &str) -> Ground {
    let mut ground = Ground::up();
    ground.bench.use_wire(Wire::Usb);
    ground.bench.ask(&wifi_config("home", password, STATION));
    ground
}

fn switch_router_on(ground: &mut Ground) {
    let router = Router::new(home());
    ground.bench.wifi().add_network(router.network());
    ground.air.set_router(Some(router));
}

fn switch_router_off(ground: &mut Ground) {
    ground.bench.wifi().remove_network("home");
    ground.air.set_router(None);
}

fn is_home(ground: &mut Ground) -> bool {
    ground.bench.wifi().joined() == Some("home")
}

fn texts(ground: &mut Ground) -> Vec<String> {
    let mut texts = texts_of(&ground.bench.frames());
    texts.retain(|text| text.contains("Wi-Fi"));
    texts
}

/// A board that has joined the network of the house.
fn joined() -> Ground {
    let mut ground = sent_home(PASSWORD);
    switch_router_on(&mut ground);
    ground.run_for(8 * SECOND);
    assert!(is_home(&mut ground), "{:?}", ground.bench.log_lines());
    ground
}

const OWN_NETWORK: &str = "No Wi-Fi network: access point instead";

#[test]
// Requirement: R-7
fn the_board_joins_a_network_and_finds_it_again() {
    let mut ground = joined();
    let said = texts(&mut ground);
    let is_address = |text: &String| text.starts_with("Wi-Fi address 192.168.1.");
    assert!(said.iter().any(is_address), "{said:?}");

    let laptop = ground.air.add(Laptop::new([2, 0, 0, 0, 0, 9], Some(home())));
    let mut station = ground.listen(laptop);
    let frames = ground.hear_for(&mut station, 6 * SECOND);
    assert!(of_message(&frames, HEARTBEAT).len() >= 2, "on port {UDP_PORT}");

    switch_router_off(&mut ground);
    ground.run_for(10 * SECOND);
    let said = texts(&mut ground);
    assert!(said.contains(&"Wi-Fi network lost".into()), "{said:?}");
    switch_router_on(&mut ground);
    ground.run_for(25 * SECOND);
    assert!(is_home(&mut ground), "{:?}", ground.bench.log_lines());
    ground.assert_not_reset();
}

#[test]
// Requirement: R-7
fn without_its_network_for_a_minute_the_board_opens_its_own() {
    for (password, is_there, text) in [
        (PASSWORD, false, "Wi-Fi network not found"),
        ("not our password", true, "Wi-Fi network refuses the password"),
    ] {
        let mut ground = sent_home(password);
        if is_there {
            switch_router_on(&mut ground);
        }
        ground.run_for(50 * SECOND);
        assert!(ground.bench.wifi().access_point().is_none(), "{text}");
        ground.wait_for_network(30 * SECOND);
        ground.run_for(SECOND);
        let said = texts(&mut ground);
        assert_eq!(said.iter().filter(|said| *said == text).count(), 1, "{said:?}");
        assert!(said.contains(&OWN_NETWORK.into()), "{said:?}");
        ground.assert_not_reset();
    }
}

#[test]
// Requirement: R-7
fn a_password_that_the_chip_refuses_to_change_delays_the_boards_own_network_by_no_fault() {
    let mut ground = sent_home("not our password");
    ground.bench.wifi().set_fault(Some(RadioFault::StaysAssociated));
    switch_router_on(&mut ground);
    ground.run_for(50 * SECOND);
    assert!(ground.bench.wifi().access_point().is_none());
    ground.wait_for_network(25 * SECOND);
    ground.run_for(SECOND);
    assert_eq!(texts(&mut ground), ["Wi-Fi network can't be joined", OWN_NETWORK]);
    ground.assert_not_reset();
}

#[test]
// Requirement: R-7
fn a_radio_that_fails_meanwhile_does_not_delay_the_boards_own_network() {
    let mut ground = sent_home(PASSWORD);
    for _ in 0..3 {
        ground.run_for(12 * SECOND);
        ground.bench.wifi().set_fault(Some(RadioFault::SilentAfter(3)));
        ground.run_for(10 * SECOND);
        ground.bench.wifi().set_fault(None);
    }
    ground.wait_for_network(20 * SECOND);
    ground.run_for(SECOND);
    let said = texts(&mut ground);
    assert!(said.contains(&OWN_NETWORK.into()), "{said:?}");
    ground.assert_not_reset();
}

#[test]
// Requirement: R-7
fn a_board_that_its_network_excludes_joins_it_again() {
    let mut ground = joined();
    ground.bench.forget_sent();
    ground.bench.wifi().deauthenticated();
    ground.run_for(10 * SECOND);
    assert!(is_home(&mut ground), "{:?}", ground.bench.log_lines());
    let said = texts(&mut ground);
    assert_eq!(said[..2], ["Wi-Fi network lost", "Wi-Fi network joined"]);
    assert!(said[2].starts_with("Wi-Fi address 192.168.1."), "{said:?}");
    ground.assert_not_reset();
}

#[test]
fn a_network_that_gives_no_address_is_announced_once() {
    let mut ground = sent_home(PASSWORD);
    switch_router_on(&mut ground);
    let router = ground.air.router().expect("it is on");
    router.answer_dhcp_by(DhcpAnswers::Silence);
    ground.run_for(50 * SECOND);
    ground.wait_for_network(60 * SECOND);
    let said = texts(&mut ground);
    let text = "Wi-Fi network gives no address";
    assert_eq!(said.iter().filter(|said| *said == text).count(), 1, "{said:?}");
    ground.assert_not_reset();
}

#[test]
fn its_networks_are_kept_over_an_update() {
    let mut bench = updated();
    bench.attach_wifi();
    let mut ground = Ground::around(bench);
    switch_router_on(&mut ground);
    ground.run_for(8 * SECOND);
    assert!(is_home(&mut ground), "{:?}", ground.bench.log_lines());

    switch_router_off(&mut ground);
    ground.run_for(60 * SECOND);
    ground.wait_for_network(30 * SECOND);
    let password = ground.credentials().passphrase;
    assert_eq!(password.as_deref(), Some("the rover's password"));
}
