//! Ground stations by UDP.

use rover_battmon::net::Role;

use crate::phone::BOARD;
use crate::room::play;
use crate::support::frames::HEARTBEAT;
use crate::support::requests;

const PORT: u16 = 14550;

#[test]
fn a_ground_station_is_found_by_broadcast_and_then_gets_everything_by_unicast() {
    play(Role::AccessPoint, async |room| {
        let mut phone = room.phone(2);
        let station = phone.listen(PORT);
        room.pass(3_100, &mut [&mut phone]).await;
        let found = phone.received_frames(station);
        assert_eq!(found.len(), 3);
        assert!(found.iter().all(|frame| frame.message_id == HEARTBEAT));

        phone.send(station, &requests::heartbeat(6));
        room.pass(5_000, &mut [&mut phone]).await;
        let datagrams = phone.received(station);
        assert!(datagrams.iter().all(|datagram| datagram.from == BOARD && datagram.bytes.len() <= 512));
        let mut frames = found;
        frames.extend(datagrams.iter().flat_map(|datagram| datagram.frames()));
        assert!(frames.len() > 30, "{} frames", frames.len());
        for (number, frame) in frames.iter().enumerate() {
            assert_eq!(frame.sequence, number as u8, "a ground station takes gaps for losses");
        }
    });
}
