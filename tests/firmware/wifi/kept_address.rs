//! Phones that keep their address while the board restarts.

use emulator::LogLevel;

use super::ground::{Ground, Station};
use support::frames::{PARAM_VALUE, of_message};
use support::requests::param_read_by_name;
use workbench::bench::{SECOND, TestedVehicle};

fn is_heard(ground: &mut Ground, phone: &mut Station) -> bool {
    let answers = ground.ask(phone, &param_read_by_name("BATT_CAPACITY"));
    of_message(&answers, PARAM_VALUE).len() == 1
}

#[test]
// Requirement: R-8
fn a_phone_that_keeps_its_address_over_a_reset_is_heard_at_once() {
    let mut ground = Ground::up();
    let mut phone = ground.found_station();
    assert!(is_heard(&mut ground, &mut phone));
    // It asks for no address any more.
    ground.air.laptop(phone.laptop).keep_address();

    ground.bench.reboot();
    ground.wait_for_network(3 * SECOND);
    let is_joined = ground
        .air
        .run_until(&mut ground.bench, SECOND, |air, _| air.is_joined(phone.laptop));
    assert!(is_joined);
    assert!(is_heard(&mut ground, &mut phone));
    assert_eq!(ground.bench.logged(LogLevel::Info, "has kept").len(), 1);
    assert!(ground.bench.logged(LogLevel::Info, "is lent").is_empty());
}
