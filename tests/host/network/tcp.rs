//! Ground stations by TCP.

use rover_battmon::net::Role;
use smoltcp::socket::tcp::State;

use super::room::play;
use support::frames::{HEARTBEAT, PARAM_VALUE, assert_no_sequence_gap, of_message};
use support::requests;

#[test]
// Requirement: L-19
fn two_clients_have_a_link_each_and_a_third_is_refused() {
    play(Role::AccessPoint, async |room| {
        let (mut one, mut two, mut three) = (room.phone(2).await, room.phone(3).await, room.phone(4).await);
        let (first, second) = (one.connect(50_000), two.connect(50_001));
        room.pass(100, &mut [&mut one, &mut two]).await;
        let third = three.connect(50_002);
        room.pass(3_000, &mut [&mut one, &mut two, &mut three]).await;
        assert_eq!(three.tcp(third).state(), State::Closed);
        for frames in [one.tcp_frames(first), two.tcp_frames(second)] {
            assert!(frames.len() > 15, "{} frames", frames.len());
            assert_eq!(frames[0].sequence, 0);
            assert_no_sequence_gap(&frames);
        }

        // Each client is answered on its own link.
        one.tcp(first)
            .send_slice(&requests::param_read_by_name("BATT_CAPACITY"))
            .expect("it is connected");
        room.pass(100, &mut [&mut one, &mut two]).await;
        assert!(!of_message(&one.tcp_frames(first), PARAM_VALUE).is_empty());
        assert!(of_message(&two.tcp_frames(second), PARAM_VALUE).is_empty());
    });
}

#[test]
fn a_place_is_free_again_when_a_client_has_closed() {
    play(Role::AccessPoint, async |room| {
        let mut phone = room.phone(2).await;
        for round in 0..20 {
            let client = phone.connect(50_000 + round);
            room.pass(2_000, &mut [&mut phone]).await;
            let frames = phone.tcp_frames(client);
            assert!(!of_message(&frames, HEARTBEAT).is_empty(), "round {round}");
            assert_eq!(frames[0].sequence, 0, "a link of its own");
            phone.tcp(client).close();
            room.pass(50, &mut [&mut phone]).await;
            phone.sockets.remove(client);
        }
    });
}

#[test]
// Requirement: L-19
fn a_client_that_vanishes_frees_its_place() {
    play(Role::AccessPoint, async |room| {
        let (mut one, mut two) = (room.phone(2).await, room.phone(3).await);
        one.connect(50_000);
        two.connect(50_001);
        room.pass(2_000, &mut [&mut one, &mut two]).await;
        room.air.borrow_mut().leave(one.mac);
        room.air.borrow_mut().leave(two.mac);
        room.pass(9_000, &mut []).await;
        let mut three = room.phone(4).await;
        let early = three.connect(50_002);
        room.pass(100, &mut [&mut three]).await;
        assert_eq!(three.tcp(early).state(), State::Closed, "it may come back");
        room.pass(6_000, &mut [&mut three]).await;
        let client = three.connect(50_003);
        room.pass(2_000, &mut [&mut three]).await;
        assert!(!three.tcp_frames(client).is_empty());
    });
}

#[test]
fn a_client_that_does_not_read_stops_only_itself() {
    play(Role::AccessPoint, async |room| {
        let (mut reader, mut other) = (room.phone(2).await, room.phone(3).await);
        let (first, second) = (reader.connect(50_000), other.connect(50_001));
        let station = reader.listen(14550);
        room.pass(100, &mut [&mut reader, &mut other]).await;
        reader.send(station, &requests::heartbeat(requests::GCS));
        let _ = reader.tcp_frames(first);
        // The other one takes 2048 bytes, and then nothing any more.
        for _ in 0..5 {
            room.pass(2_000, &mut [&mut reader, &mut other]).await;
            assert!(reader.tcp_frames(first).len() > 8);
            assert!(reader.received_frames(station).len() > 8);
        }
        assert_eq!(other.tcp(second).state(), State::Established);
        assert_eq!(other.tcp(second).recv_queue(), 2_048);
        // It is asked less and less often for room, until its silence is that of one who has left.
        room.pass(60_000, &mut [&mut reader, &mut other]).await;
        assert_eq!(other.tcp(second).state(), State::Closed);
    });
}
