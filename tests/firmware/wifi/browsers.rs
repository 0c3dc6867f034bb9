//! Browsers: the page, MAVLink by WebSocket, logs, and those who mean no good.

use super::driving::{arm_by, is_driving, rover};
use super::ground::{Ground, Station, UPGRADE, WEB_PORT, end_of_head, web_socket_frame};
use crate::stack;
use rover_battmon::memory::flash_map;
use support::frames::{BATTERY_STATUS, LOG_DATA, PARAM_VALUE, assert_no_sequence_gap, of_message};
use support::requests::{VEHICLE, VEHICLE_ID, log_data, log_list, manual_control, param_request_list};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND};
use workbench::log_flash::{LogFlash, noise};

fn get(path: &str, headers: &str) -> Vec<u8> {
    format!("GET {path} HTTP/1.1\r\nHost: 192.168.4.1\r\n{headers}\r\n").into_bytes()
}

/// Head and content of an answer.
fn split(answer: &[u8]) -> (String, &[u8]) {
    let (head, content) = answer.split_at(end_of_head(answer).expect("a head"));
    (String::from_utf8(head.into()).expect("text"), content)
}

fn length(head: &str) -> usize {
    let mut lines = head.lines();
    let length = lines.find_map(|line| line.strip_prefix("Content-Length: "));
    length.expect("it has one").parse().expect("a number")
}

#[test]
fn page_and_descriptions_come_whole_within_a_second() {
    let mut ground = Ground::up();
    let laptop = ground.laptop();
    for path in ["/", "/parameters.json"] {
        let (answer, took_us) = ground.fetch(laptop, &get(path, ""), SECOND);
        let (head, content) = split(&answer);
        println!("{path}: {} bytes in {took_us} us", answer.len());
        assert!(head.starts_with("HTTP/1.1 200 OK"), "{head}");
        assert!(content.starts_with(&[0x1f, 0x8b]), "gzip");
        assert_eq!(content.len(), length(&head));
        assert!(took_us < SECOND, "{took_us}");
    }
    ground.assert_not_reset();
}

#[test]
// Requirement: OWN-7
fn two_browsers_are_served_beside_two_by_udp_and_two_by_tcp() {
    let mut ground = Ground::up();
    let mut stations = vec![ground.found_station(), ground.found_station()];
    stations.push(ground.connected_station());
    stations.push(ground.connected_station());
    let browsers = [ground.laptop(), ground.laptop()];
    for laptop in browsers {
        stations.push(ground.open_web_socket(laptop));
    }
    for station in &mut stations {
        ground.send(station, &param_request_list(VEHICLE));
        let frames = ground.hear_for(station, 2 * SECOND);
        let values = of_message(&frames, PARAM_VALUE);
        assert!(values.len() >= usize::from(values[0].u16(4)), "{}", values.len());
        assert_no_sequence_gap(&frames);
    }
    ground.assert_not_reset();
}

/// How long a log takes by TCP.
fn download_by_tcp(ground: &mut Ground, station: &mut Station, bytes: usize) -> u64 {
    ground.ask(station, &log_list(0, u16::MAX));
    let began_us = ground.bench.time_us();
    ground.send(station, &log_data(1, 0, bytes as u32));
    let frames = ground.hear_for(station, 10 * SECOND);
    let data = of_message(&frames, LOG_DATA);
    let received: usize = data.iter().map(|frame| usize::from(frame.u8(6))).sum();
    assert_eq!(received, bytes);
    data.last().expect("some").at_us - began_us
}

#[test]
fn log_comes_as_fast_as_by_tcp() {
    let mut log = LogFlash::erased_ahead();
    let content = noise(1, 30);
    log.add(&content);
    let offset = flash_map::LOG.start;
    let mut ground = Ground::of(Bench::power_up_with_flash(DIVIDER_CODE, offset, log.bytes()));
    ground.run_for(2 * SECOND);
    let laptop = ground.laptop();
    let (answer, took_us) = ground.fetch(laptop, &get("/logs/1.BIN", ""), 10 * SECOND);
    let (head, file) = split(&answer);
    assert_eq!(length(&head), content.len());
    assert!(file == content);

    let mut station = ground.connect(laptop);
    let by_tcp_us = download_by_tcp(&mut ground, &mut station, content.len());
    let percent = 100 * by_tcp_us / took_us;
    println!(
        "{} bytes in {took_us} us, by TCP in {by_tcp_us} us: {percent} %",
        content.len()
    );
    assert!(percent >= 80, "{percent} %");
    ground.assert_not_reset();
}

/// What those send who mean no good.
fn hostile_requests() -> Vec<Vec<u8>> {
    vec![
        Vec::new(),
        b"GET / HTTP/1.1\r\nX: ".to_vec(),
        [b"GET / HTTP/1.1\r\nX: ".to_vec(), vec![b'x'; 1_400]].concat(),
        b"GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n".to_vec(),
        b"POST / HTTP/1.1\r\nHost: 192.168.4.1\r\nContent-Length: 100000\r\n\r\n".to_vec(),
        vec![0xff; 1_000],
        get("/logs/../../", ""),
        get("/", "Upgrade: websocket\r\n"),
        [UPGRADE, &[0x82, 1, 0][..]].concat(),
        [UPGRADE, &web_socket_frame(&[0; 600])[..]].concat(),
        get("/", ""),
    ]
}

#[test]
fn hostile_requests_disturb_neither_the_driver_nor_the_measurement() {
    let mut ground = rover();
    let mut driver = ground.found_station();
    arm_by(&mut driver, &mut ground);
    let others = [ground.laptop(), ground.laptop()];
    ground.bench.forget_stack_use();
    ground.bench.take_ticks();
    let began_us = ground.bench.time_us();
    let requests = hostile_requests();
    let mut open = Vec::new();
    for turn in 0..400 {
        ground.send(&mut driver, &manual_control(VEHICLE_ID, 0, 500));
        let laptop = others[turn % others.len()];
        let connection = ground.connect_to(WEB_PORT, laptop);
        open.push((laptop, connection));
        ground.run_for(15 * MILLISECOND);
        let request = &requests[turn % requests.len()];
        ground.air.laptop(laptop).send(connection, request);
        ground.run_for(10 * MILLISECOND);
        if open.len() > 6 {
            let (laptop, connection) = open.remove(0);
            ground.air.laptop(laptop).forget(connection);
        }
        if turn > 10 {
            assert!(is_driving(&ground.bench), "turn {turn}");
        }
    }
    let seconds = (ground.bench.time_us() - began_us) / SECOND;
    let frames = ground.heard_since(&mut driver, began_us);
    assert_no_sequence_gap(&frames);
    let packs = of_message(&frames, BATTERY_STATUS).len() as u64;
    assert!(packs + 1 >= 2 * seconds, "{packs} in {seconds} s");
    let worst_us = super::load::worst_sampling_us(&mut ground, 10 * seconds - 1);
    println!("sampling: off by {worst_us} us at most");
    assert!(worst_us <= super::load::JITTER_US, "{worst_us}");
    stack::assert_free(&mut ground.bench, "hostile requests, and a driver by UDP");
    ground.assert_not_reset();
}
