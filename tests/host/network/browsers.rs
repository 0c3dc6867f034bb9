//! Browsers, and those who pretend to be some.

use rover_battmon::net::Role;
use smoltcp::iface::SocketHandle;
use smoltcp::socket::tcp::State;

use super::phone::Phone;
use super::room::{Room, play};
use support::frames::{BATTERY_STATUS, assert_no_sequence_gap, of_message};
use support::requests;

use crate::web::{UPGRADE, get, masked};

const PORT: u16 = 80;

/// Sends a request on a connection of its own.
async fn ask(room: &Room<'_>, phone: &mut Phone, port: u16, request: &[u8]) -> SocketHandle {
    let socket = phone.connect_to(PORT, port);
    room.pass(5, &mut [&mut *phone]).await;
    let _ = phone.tcp(socket).send_slice(request);
    room.pass(20, &mut [&mut *phone]).await;
    socket
}

/// The status that has come, if any.
fn status(phone: &mut Phone, socket: SocketHandle) -> String {
    let answer = phone.tcp_bytes(socket);
    String::from_utf8_lossy(answer.get(9..12).unwrap_or_default()).into_owned()
}

#[test]
fn each_browser_has_a_link_and_one_more_gets_a_sentence() {
    play(Role::AccessPoint, async |room| {
        let (mut one, mut two) = (room.phone(2).await, room.phone(3).await);
        let upgrade = get("/", UPGRADE);
        let first = ask(room, &mut one, 50_000, upgrade.as_bytes()).await;
        let second = ask(room, &mut two, 50_000, upgrade.as_bytes()).await;
        assert_eq!(status(&mut one, first), "101");
        assert_eq!(status(&mut two, second), "101");
        let third = ask(room, &mut two, 50_001, upgrade.as_bytes()).await;
        let refused = two.tcp_bytes(third);
        let refused = String::from_utf8_lossy(&refused);
        assert!(refused.starts_with("HTTP/1.1 503 "), "{refused}");
        assert!(refused.ends_with("close another one, or try again."), "{refused}");
        two.tcp(third).close();
        room.pass(50, &mut [&mut one, &mut two]).await;
        // The two that are left for pages are taken by who sends nothing; the next one gets 503 at once.
        for port in [50_002, 50_003] {
            one.connect_to(PORT, port);
        }
        room.pass(20, &mut [&mut one]).await;
        two.sockets.remove(third);
        let surplus = ask(room, &mut two, 50_004, get("/", "").as_bytes()).await;
        assert_eq!(status(&mut two, surplus), "503");
        // Both links go on.
        room.pass(3_000, &mut [&mut one, &mut two]).await;
        assert!(one.tcp_bytes(first).len() > 300);
        assert!(two.tcp_bytes(second).len() > 300);
        two.tcp(second).close();
        room.pass(1_500, &mut [&mut one, &mut two]).await;
        let next = ask(room, &mut two, 50_005, upgrade.as_bytes()).await;
        assert_eq!(status(&mut two, next), "101", "its place is free");
    });
}

#[test]
fn a_browser_that_has_vanished_gives_its_place_after_three_seconds() {
    play(Role::AccessPoint, async |room| {
        let (mut owner, mut lost) = (room.phone(2).await, room.phone(3).await);
        let upgrade = get("/", UPGRADE);
        let kept = ask(room, &mut owner, 50_000, upgrade.as_bytes()).await;
        let vanished = ask(room, &mut lost, 50_000, upgrade.as_bytes()).await;
        assert_eq!(status(&mut owner, kept), "101");
        assert_eq!(status(&mut lost, vanished), "101");
        // From now on the other phone is out of reach.
        for (port, expected) in [(50_001, "503"), (50_002, "101")] {
            for _ in 0..2 {
                let beat = masked(0x82, &requests::heartbeat(requests::GCS));
                owner.tcp(kept).send_slice(&beat).expect("it is connected");
                room.pass(900, &mut [&mut owner]).await;
            }
            let asked = ask(room, &mut owner, port, upgrade.as_bytes()).await;
            room.pass(600, &mut [&mut owner]).await;
            assert_eq!(status(&mut owner, asked), expected);
        }
        assert_eq!(owner.tcp(kept).state(), State::Established);
    });
}

#[test]
fn slow_connections_delay_a_page_by_three_seconds_and_the_close_timeout() {
    // The answer to the last one is never taken.
    for begin in ["GET / HTTP/1.1\r\nX: ", "G", "", &get("/", "")] {
        play(Role::AccessPoint, async |room| {
            let (mut owner, mut one, mut two) =
                (room.phone(2).await, room.phone(3).await, room.phone(4).await);
            let open = ask(room, &mut owner, 50_000, get("/", UPGRADE).as_bytes()).await;
            assert_eq!(status(&mut owner, open), "101");
            ask(room, &mut two, 50_000, get("/", UPGRADE).as_bytes()).await;
            let now_ms = || embassy_time::Instant::now().as_millis();
            let began_ms = now_ms();
            for port in 50_001..50_004 {
                ask(room, &mut one, port, begin.as_bytes()).await;
            }
            let mut heard_ms = now_ms();
            for port in 50_001.. {
                let page = owner.connect_to(PORT, port);
                room.pass(5, &mut [&mut owner, &mut one, &mut two]).await;
                let _ = owner.tcp(page).send_slice(get("/", "").as_bytes());
                room.pass(45, &mut [&mut owner, &mut one, &mut two]).await;
                if !owner.tcp_bytes(open).is_empty() {
                    heard_ms = now_ms();
                }
                assert!(now_ms() - heard_ms < 600, "the open one is served all the time");
                let status = status(&mut owner, page);
                owner.tcp(page).abort();
                owner.poll();
                owner.sockets.remove(page);
                if status == "200" {
                    break;
                }
            }
            let delay_ms = now_ms() - began_ms;
            assert!((3_000..6_400).contains(&delay_ms), "{begin:?}: {delay_ms} ms");
        });
    }
}

#[test]
fn ten_thousand_hostile_requests_cost_a_station_by_udp_nothing() {
    let opened = |frames: &[Vec<u8>]| [get("/", UPGRADE).into_bytes(), frames.concat()].concat();
    let requests = [
        Vec::new(),
        b"GET / HTTP/1.1\r\nX: ".to_vec(),
        [b"GET / HTTP/1.1\r\nX: ".to_vec(), vec![b'x'; 2_000]].concat(),
        b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n".to_vec(),
        b"PUT /logs/1.BIN HTTP/1.1\r\nHost: 192.168.4.1\r\nContent-Length: 99999\r\n\r\n".to_vec(),
        vec![0xff; 2_000],
        get("/logs/../../", "").into_bytes(),
        get("/", "Upgrade: websocket\r\n").into_bytes(),
        opened(&[masked(0x82, &[0; 300]), vec![0x82, 1, 0]]),
        opened(&[masked(0xc2, &[0; 300])]),
        opened(&[masked(0x02, &requests::arm()), masked(0x82, &[])]),
        get("/", "").into_bytes(),
    ];
    play(Role::AccessPoint, async |room| {
        let mut station = room.phone(2).await;
        let mut hostile = room.phone(3).await;
        let socket = station.listen(14550);
        room.pass(2_100, &mut [&mut station]).await;
        station.send(socket, &requests::heartbeat(requests::GCS));
        room.pass(100, &mut [&mut station]).await;
        let _ = station.received_frames(socket);
        let began_ms = embassy_time::Instant::now().as_millis();
        let mut frames = Vec::new();
        for round in 0..10_000_u64 {
            let connection = hostile.connect_to(PORT, 40_000 + (round % 20_000) as u16);
            room.pass(2, &mut [&mut station, &mut hostile]).await;
            let request = &requests[round as usize % requests.len()];
            let _ = hostile.tcp(connection).send_slice(request);
            room.pass(6, &mut [&mut station, &mut hostile]).await;
            // Every other one vanishes without a word.
            if round % 2 == 0 {
                hostile.tcp(connection).abort();
                hostile.poll();
            }
            hostile.sockets.remove(connection);
            if round % 100 == 0 {
                station.send(socket, &requests::heartbeat(requests::GCS));
            }
            frames.extend(station.received_frames(socket));
        }
        frames.extend(station.received_frames(socket));
        let seconds = (embassy_time::Instant::now().as_millis() - began_ms) / 1_000;
        assert_no_sequence_gap(&frames);
        let packs = of_message(&frames, BATTERY_STATUS).len() as u64;
        assert!(packs + 1 >= 2 * seconds, "{packs} in {seconds} s");
        // Afterwards a browser is served.
        room.pass(20_000, &mut [&mut station, &mut hostile]).await;
        let page = ask(room, &mut hostile, 50_000, get("/", "").as_bytes()).await;
        assert_eq!(status(&mut hostile, page), "200");
    });
}
