//! Addresses for phones.

use rover_battmon::net::{NetReport, Role};
use smoltcp::wire::Ipv4Cidr;
use std::net::Ipv4Addr;

use crate::phone::Phone;
use crate::room::play;
use crate::support::frames::HEARTBEAT;
use crate::support::requests;

#[test]
fn phones_get_an_address_and_are_found_one_after_the_other() {
    play(Role::AccessPoint, async |room| {
        let mut phones = [2, 3].map(|number| Phone::without_address(&room.air, number));
        let asked = phones.each_mut().map(Phone::ask_for_address);
        let [one, two] = &mut phones;
        room.pass(3_000, &mut [one, two]).await;
        let addresses = [0, 1].map(|index| phones[index].take_address(asked[index]).expect("one was given"));
        let mut given = addresses.each_ref().map(|config| config.address);
        given.sort();
        assert_eq!(
            given,
            [2, 3].map(|number| Ipv4Cidr::new(Ipv4Addr::new(192, 168, 4, number), 24))
        );
        assert!(addresses.iter().all(|config| config.router.is_none()));

        let stations = phones.each_mut().map(|phone| phone.listen(14550));
        let [one, two] = &mut phones;
        room.pass(2_000, &mut [one, two]).await;
        one.send(stations[0], &requests::heartbeat(6));
        room.pass(100, &mut [one, two]).await;
        let _ = two.received_frames(stations[1]);
        room.pass(3_000, &mut [one, two]).await;
        let found = two.received_frames(stations[1]);
        assert_eq!(found.len(), 3, "one a second, now by unicast");
        assert!(found.iter().all(|frame| frame.message_id == HEARTBEAT));
        let connected = one.received_frames(stations[0]);
        for (before, after) in connected.iter().zip(&connected[1..]) {
            assert_eq!(
                after.sequence,
                before.sequence.wrapping_add(1),
                "it hears its own link only"
            );
        }
        two.send(stations[1], &requests::heartbeat(6));
        room.pass(2_000, &mut [one, two]).await;
        assert!(two.received_frames(stations[1]).len() > 10);
        assert_eq!(
            *room.reports.borrow(),
            [NetReport::AddressObtained([192, 168, 4, 1])]
        );
    });
}
