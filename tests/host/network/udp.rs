//! Ground stations by UDP.

use rover_battmon::net::Role;

use smoltcp::iface::SocketHandle;

use super::phone::{BOARD, Datagram, Phone};
use super::room::{Room, play};
use support::commands::SET_MESSAGE_INTERVAL;
use support::frames::{
    Frame, HEARTBEAT, PARAM_VALUE, SYS_STATUS, SysStatus, assert_no_sequence_gap, of_message,
};
use support::requests;

const PORT: u16 = 14550;

/// A datagram that fits into the memory for what is received, and into the queue of its link.
const FLOOD_BYTES: usize = 700;

/// Two phones that have a link each, and nothing unread yet.
async fn two_stations(room: &Room<'_>) -> ([Phone; 2], [SocketHandle; 2]) {
    let (mut one, mut two) = (room.phone(2).await, room.phone(3).await);
    let sockets = [one.listen(PORT), two.listen(PORT)];
    one.send(sockets[0], &requests::heartbeat(requests::GCS));
    two.send(sockets[1], &requests::heartbeat(requests::GCS));
    room.pass(1_000, &mut [&mut one, &mut two]).await;
    let _ = (one.received(sockets[0]), two.received(sockets[1]));
    ([one, two], sockets)
}

#[test]
fn a_ground_station_is_found_by_broadcast_and_then_gets_everything_by_unicast() {
    play(Role::AccessPoint, async |room| {
        let mut phone = room.phone(2).await;
        let station = phone.listen(PORT);
        room.pass(3_100, &mut [&mut phone]).await;
        let found = phone.received_frames(station);
        assert_eq!(found.len(), 3);
        assert!(found.iter().all(|frame| frame.message_id == HEARTBEAT));

        phone.send(station, &requests::heartbeat(requests::GCS));
        room.pass(5_000, &mut [&mut phone]).await;
        let datagrams = phone.received(station);
        let is_ours = |datagram: &Datagram| datagram.from == BOARD && datagram.bytes.len() <= 512;
        assert!(datagrams.iter().all(is_ours));
        let mut frames = found;
        frames.extend(datagrams.iter().flat_map(|datagram| datagram.frames()));
        assert!(frames.len() > 25, "{} frames", frames.len());
        assert_eq!(frames[0].sequence, 0);
        assert_no_sequence_gap(&frames);
    });
}

#[test]
// Requirement: R-8
fn a_phone_that_takes_no_broadcasts_is_found_by_its_address() {
    play(Role::AccessPoint, async |room| {
        // The phones before it have left, and their addresses no longer answer.
        let gone = [room.phone(2).await, room.phone(3).await];
        let mut phone = room.phone(4).await;
        for other in &gone {
            room.air.borrow_mut().leave(other.mac);
        }
        let station = phone.listen_to_own_address(PORT);
        room.pass(8_000, &mut [&mut phone]).await;
        let found = phone.received_frames(station);
        assert!(found.len() >= 2, "{}", found.len());
        phone.send(station, &requests::heartbeat(requests::GCS));
        room.pass(1_000, &mut [&mut phone]).await;
        assert!(phone.received_frames(station).len() > 4);
    });
}

#[test]
// Requirement: L-19
fn two_stations_have_a_link_each_and_a_third_gets_nothing_until_one_is_silent() {
    play(Role::AccessPoint, async |room| {
        let (mut one, mut two, mut three) = (room.phone(2).await, room.phone(3).await, room.phone(4).await);
        let sockets = [one.listen(PORT), two.listen(40_000), three.listen(PORT)];
        let mut third_since = None;
        for second in 0..35 {
            one.send(sockets[0], &requests::heartbeat(requests::GCS));
            if second < 10 {
                two.send(sockets[1], &requests::heartbeat(requests::GCS));
            }
            if second >= 3 {
                three.send(sockets[2], &requests::heartbeat(requests::GCS));
            }
            room.pass(1_000, &mut [&mut one, &mut two, &mut three]).await;
            assert!(one.received_frames(sockets[0]).len() > 4, "second {second}");
            let for_three = three.received_frames(sockets[2]);
            if third_since.is_none() && !for_three.is_empty() {
                assert_eq!(for_three[0].sequence, 0, "its own link, from the start");
                third_since = Some(second);
            }
            assert_eq!(!for_three.is_empty(), third_since.is_some(), "second {second}");
            let for_two = two.received_frames(sockets[1]);
            if third_since != Some(second) {
                assert_eq!(!for_two.is_empty(), third_since.is_none(), "second {second}");
            }
        }
        assert!(matches!(third_since, Some(19..=21)), "{third_since:?}");
    });
}

#[test]
fn each_request_is_answered_wherever_it_lies_in_the_queue() {
    play(Role::AccessPoint, async |room| {
        let mut phone = room.phone(2).await;
        let station = phone.listen(PORT);
        // In all several times as long as the queue.
        for number in 1..=200 {
            phone.send(station, &requests::param_read_by_name("BATT_MONITOR"));
            room.pass(20, &mut [&mut phone]).await;
            let frames = phone.received_frames(station);
            assert_eq!(of_message(&frames, PARAM_VALUE).len(), 1, "request {number}");
        }
    });
}

#[test]
fn each_station_has_its_own_rates() {
    play(Role::AccessPoint, async |room| {
        let ([mut one, mut two], sockets) = two_stations(room).await;
        one.send(
            sockets[0],
            &requests::command_long_2(SET_MESSAGE_INTERVAL, SYS_STATUS as f32, 20_000.0),
        );
        room.pass(1_000, &mut [&mut one, &mut two]).await;
        let _ = (one.received(sockets[0]), two.received(sockets[1]));
        room.pass(2_000, &mut [&mut one, &mut two]).await;
        let count = |frames: &[Frame]| of_message(frames, SYS_STATUS).len();
        assert_eq!(count(&one.received_frames(sockets[0])), 100);
        assert!(count(&two.received_frames(sockets[1])) < 10);
    });
}

#[test]
// Requirement: L-19
fn what_is_no_mavlink_gets_no_slot() {
    play(Role::AccessPoint, async |room| {
        let mut noisy = Vec::new();
        for number in 2..6 {
            noisy.push(room.phone(number).await);
        }
        let sockets: Vec<_> = noisy.iter_mut().map(|phone| phone.listen(PORT)).collect();
        let mut seed = fastrand::Rng::with_seed(23);
        for length in 0..=1_472 {
            for (phone, socket) in noisy.iter_mut().zip(&sockets) {
                let mut garbage = vec![0; length];
                seed.fill(&mut garbage);
                if let Some(first) = garbage.first_mut() {
                    *first = 0xfd;
                }
                phone.send(*socket, &garbage);
                phone.poll();
            }
            room.pass(2, &mut noisy.iter_mut().collect::<Vec<_>>()).await;
        }
        let mut damaged = requests::heartbeat(requests::GCS);
        damaged[12] ^= 1;
        noisy[0].send(sockets[0], &damaged);

        let mut phone = room.phone(10).await;
        let station = phone.listen(PORT);
        phone.send(station, &requests::heartbeat(requests::GCS));
        let _ = noisy[0].received(sockets[0]);
        room.pass(3_000, &mut [&mut phone, &mut noisy[0]]).await;
        assert!(phone.received_frames(station).len() > 10);
        let found = noisy[0].received_frames(sockets[0]);
        assert_eq!(found.len(), 3, "it is found, once a second, and has no link");
        assert!(found.iter().all(|frame| frame.message_id == HEARTBEAT));
    });
}

#[test]
fn a_flood_of_one_station_leaves_the_other_its_link() {
    play(Role::AccessPoint, async |room| {
        let ([mut one, mut two], sockets) = two_stations(room).await;
        let mut flood = requests::heartbeat(requests::GCS);
        flood.resize(FLOOD_BYTES, 0xfd);
        for ms in 0..3_000 {
            // As many as the radio takes.
            for _ in 0..4 {
                two.send(sockets[1], &flood);
            }
            if ms % 100 == 0 {
                one.send(sockets[0], &requests::param_read_by_name("BATT_CAPACITY"));
            }
            room.pass(1, &mut [&mut one, &mut two]).await;
        }
        let frames = one.received_frames(sockets[0]);
        assert_eq!(of_message(&frames, PARAM_VALUE).len(), 30);
        let heartbeats = of_message(&frames, HEARTBEAT).len();
        assert_eq!(heartbeats, 3, "the flooded board goes on");
        let flooded = two.received_frames(sockets[1]);
        let status = of_message(&flooded, SYS_STATUS);
        let errors = SysStatus(status.last().expect("its link goes on, too")).errors_comm();
        assert!(errors > 4_000, "{errors} errors: the flood arrives at its link");
    });
}

#[test]
fn a_station_that_does_not_answer_for_its_address_stops_only_itself() {
    play(Role::AccessPoint, async |room| {
        let ([mut one, mut two], sockets) = two_stations(room).await;
        room.air.borrow_mut().leave(two.mac);
        // The board forgets a hardware address after a minute.
        for second in 0..120 {
            one.send(sockets[0], &requests::heartbeat(requests::GCS));
            // It can send, and does not hear.
            two.send(sockets[1], &requests::heartbeat(requests::GCS));
            room.pass(1_000, &mut [&mut one, &mut two]).await;
            assert!(one.received_frames(sockets[0]).len() > 4, "second {second}");
        }
        room.air.borrow_mut().join(two.mac);
        let _ = two.received(sockets[1]);
        room.pass(1_500, &mut [&mut one, &mut two]).await;
        let heard = two.received_frames(sockets[1]);
        assert!(heard.len() > 4, "{} frames", heard.len());
    });
}
