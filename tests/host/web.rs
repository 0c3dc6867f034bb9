//! The web server in stepped time, with a browser, or a client that pretends to be one, at the other end of a wire.

use std::cell::{Cell, RefCell};
use std::collections::VecDeque;
use std::convert::Infallible;
use std::fs;
use std::future::pending;

use embassy_futures::block_on;
use embassy_futures::join::{join, join_array};
use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_time::{Duration, Instant, Timer};
use embedded_io_async::{ErrorType, Write};
use rover_battmon::autopilot::{Autopilot, Start};
use rover_battmon::mavlink::dialect::{MavMessage, PARAM_REQUEST_READ_DATA};
use rover_battmon::mavlink::{Endpoint, LinkKind};
use rover_battmon::recorder::{LogSource, ReadFailed, Ring};
use rover_battmon::tasks::{ByteSource, CheckIn, Link, ReceiveError, Shared, now};
use rover_battmon::vehicle::ArmState;
use rover_battmon::web::{BUFFER_BYTES, Sender, Site, Slot, Slots, refuse, serve_request, serve_web_socket};
use rover_battmon_tools::frames::{FrameReader, frame};
use rover_battmon_tools::sim::clock::run_for;
use support::desk::LOW_VOLT;
use support::repository;
use support::requests::{arm_by_force, disarm, log_erase, param_set, setup_signing, stated_time};
use support::signer::{NEW_YEAR, OWNER, Signer};

use crate::logged_rover;

static CHECK_IN: CheckIn = CheckIn::new("", u32::MAX);

const OURS: &str = "Host: 192.168.4.1\r\n";

pub const UPGRADE: &str = "Upgrade: websocket\r\nConnection: keep-alive, Upgrade\r\nSec-WebSocket-Version: 13\r\n\
    Sec-WebSocket-Key: dGhlIHNhbXBsZSBub25jZQ==\r\n";

/// The content of a chip with logs; none, if it is empty.
pub struct Chip(pub Vec<u8>);

impl LogSource for Chip {
    fn read_log(&self, address: u32, bytes: &mut [u8]) -> Result<(), ReadFailed> {
        let part = self
            .0
            .get(address as usize..)
            .and_then(|rest| rest.get(..bytes.len()));
        bytes.copy_from_slice(part.ok_or(ReadFailed)?);
        Ok(())
    }
}

/// The board's end of a connection: what comes when, and what was sent.
#[derive(Default)]
struct Wire {
    coming: RefCell<VecDeque<(u64, Vec<u8>)>>,
    sent: RefCell<Vec<u8>>,
}

impl Wire {
    /// These pieces come, each at a time in milliseconds from the start; the other end stays open.
    fn with(pieces: impl IntoIterator<Item = (u64, Vec<u8>)>) -> Self {
        Self {
            coming: RefCell::new(pieces.into_iter().collect()),
            sent: RefCell::default(),
        }
    }

    fn send(&self, bytes: &[u8]) {
        self.coming.borrow_mut().push_back((0, bytes.into()));
    }

    fn sent(&self) -> Vec<u8> {
        self.sent.borrow().clone()
    }

    fn text(&self) -> String {
        String::from_utf8_lossy(&self.sent.borrow()).into_owned()
    }
}

impl ErrorType for &Wire {
    type Error = Infallible;
}

impl Write for &Wire {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        self.sent.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

impl ByteSource for &Wire {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        loop {
            let next = self.coming.borrow().front().map(|(at_ms, _)| *at_ms);
            match next {
                Some(at_ms) if Instant::now().as_millis() >= at_ms => break,
                _ => Timer::after_millis(1).await,
            }
        }
        let (at_ms, mut bytes) = self.coming.borrow_mut().pop_front().expect("it has come");
        let rest = bytes.split_off(buffer.len().min(bytes.len()));
        if !rest.is_empty() {
            self.coming.borrow_mut().push_front((at_ms, rest));
        }
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }
}

/// A browser that is not there any more.
struct Gone;

impl ByteSource for Gone {
    async fn receive(&mut self, _: &mut [u8]) -> Result<usize, ReceiveError> {
        Err(ReceiveError::Closed)
    }
}

/// Plays a scene with a server.
fn play<R>(scene: impl AsyncFnOnce(Site<'_>) -> R) -> R {
    play_with(&Chip(Vec::new()), scene)
}

fn play_with<R>(logs: &Chip, scene: impl AsyncFnOnce(Site<'_>) -> R) -> R {
    let played = run_for(Duration::from_secs(600), async {
        let shared = Shared::new(&Start::default());
        let slots = Slots::new();
        let site = Site {
            shared: &shared,
            logs,
            slots: &slots,
        };
        scene(site).await
    });
    played.expect("it ends within ten minutes")
}

async fn serve<'a>(wire: &Wire, site: Site<'a>) -> Option<Slot<'a>> {
    serve_request(wire, wire, &mut [0; BUFFER_BYTES], &["192.168.4.1"], site).await
}

/// The answer to this request, which comes at once. One that is understood as a WebSocket is answered, too.
async fn ask(site: Site<'_>, request: &str) -> Vec<u8> {
    let wire = Wire::default();
    wire.send(request.as_bytes());
    serve(&wire, site).await;
    wire.sent.into_inner()
}

async fn text_for(site: Site<'_>, request: &str) -> String {
    String::from_utf8_lossy(&ask(site, request).await).into_owned()
}

fn answered(request: &str) -> String {
    play(async |site| text_for(site, request).await)
}

pub fn get(path: &str, headers: &str) -> String {
    format!("GET {path} HTTP/1.1\r\n{OURS}{headers}\r\n")
}

fn status(answer: &str) -> &str {
    answer.get(9..12).unwrap_or(answer)
}

#[test]
fn each_request_has_its_status() {
    let many = "X-Header: 1\r\n".repeat(40);
    let long = format!("X-Header: {}\r\n", "x".repeat(2_000));
    let long_path = format!("/{}", "x".repeat(1_100));
    let without = |line: &str| {
        UPGRADE
            .lines()
            .filter(|other| !other.starts_with(line))
            .map(|l| format!("{l}\r\n"))
            .collect::<String>()
    };
    let cases = [
        (get("/", ""), "200"),
        (get("/?from=home", ""), "200"),
        (get("/", "Accept-Encoding: identity\r\n"), "200"),
        (get("/parameters.json", ""), "200"),
        (get("/logs/", ""), "200"),
        (get("/logs/1.BIN", ""), "404"),
        // Paths.
        (get("/logs", ""), "404"),
        (get("/logs/1", ""), "404"),
        (get("/logs/+1.BIN", ""), "404"),
        (get("/logs/99999.BIN", ""), "404"),
        (get("/logs/../", ""), "404"),
        (get("/../../etc/passwd", ""), "404"),
        (get("//", ""), "404"),
        (get("/%2e%2e/", ""), "404"),
        (get("logs/", ""), "404"),
        (get("/favicon.ico", ""), "404"),
        // In absolute form.
        (get("http://192.168.4.1/", ""), "200"),
        (get("http://192.168.4.1", ""), "200"),
        (get("http://192.168.4.1:80/logs/?new", ""), "200"),
        (get("http://192.168.4.1?from=home", ""), "200"),
        (get("http://192.168.4.1/x", ""), "404"),
        (get("https://192.168.4.1/", ""), "404"),
        (get("http://evil.example/", ""), "421"),
        (get("http:///", ""), "421"),
        (get("http://192.168.4.1@evil.example/", ""), "421"),
        (
            "GET http://192.168.4.1/ HTTP/1.1\r\nHost: evil.example\r\n\r\n".into(),
            "421",
        ),
        ("GET http://192.168.4.1/ HTTP/1.1\r\n\r\n".into(), "400"),
        // The host that is asked, whatever for.
        ("GET / HTTP/1.1\r\n\r\n".into(), "400"),
        (format!("GET / HTTP/1.1\r\n{OURS}{OURS}\r\n"), "400"),
        ("GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n".into(), "421"),
        ("GET /x HTTP/1.1\r\nHost: evil.example\r\n\r\n".into(), "421"),
        ("POST / HTTP/1.1\r\nHost: evil.example\r\n\r\n".into(), "421"),
        (
            "GET / HTTP/1.1\r\nHost: 192.168.4.1.evil.example\r\n\r\n".into(),
            "421",
        ),
        ("GET / HTTP/1.1\r\nHost: 192.168.4.10\r\n\r\n".into(), "421"),
        (
            "GET / HTTP/1.1\r\nHost: 192.168.4.1:80@evil.example\r\n\r\n".into(),
            "421",
        ),
        (
            format!("GET / HTTP/1.1\r\nHost: evil.example\r\n{UPGRADE}\r\n"),
            "421",
        ),
        ("GET / HTTP/1.1\r\nHost: 192.168.4.1:80\r\n\r\n".into(), "200"),
        // Methods.
        (format!("HEAD / HTTP/1.1\r\n{OURS}\r\n"), "200"),
        (
            format!("POST / HTTP/1.1\r\n{OURS}Content-Length: 3\r\n\r\n"),
            "405",
        ),
        (format!("DELETE /logs/1.BIN HTTP/1.1\r\n{OURS}\r\n"), "405"),
        (format!("FROBNICATE / HTTP/1.1\r\n{OURS}\r\n"), "405"),
        (format!("OPTIONS * HTTP/1.1\r\n{OURS}\r\n"), "405"),
        // No request, or more than a head.
        ("\x16\x03\x01\x02".into(), "400"),
        ("get / http\r\n\r\n".into(), "400"),
        ("GET /\r\n\r\n".into(), "400"),
        ("GET / HTTP/2.0\r\nHost: 192.168.4.1\r\n\r\n".into(), "400"),
        (get("/", "no colon\r\n"), "400"),
        (get("/", "Content-Length: 0\r\n"), "200"),
        (get("/", "Content-Length: 5\r\n"), "400"),
        (get("/", "Content-Length: 0\r\nContent-Length: 5\r\n"), "400"),
        (get("/", "Content-Length: 0\r\nContent-Length: 0\r\n"), "400"),
        (get("/", "Content-Length: 0, 5\r\n"), "400"),
        (get("/", "Transfer-Encoding: chunked\r\n"), "400"),
        (format!("{}GET / HTTP/1.1\r\n\r\n", get("/", "")), "400"),
        // Too much.
        (get("/", &many), "431"),
        (get("/", &long), "431"),
        (get(&long_path, ""), "431"),
        // Upgrades.
        (get("/", UPGRADE), "101"),
        (get("http://192.168.4.1/", UPGRADE), "101"),
        (get("/", "Upgrade: h2c\r\nConnection: Upgrade\r\n"), "200"),
        (get("/", &without("Connection")), "400"),
        (get("/", &without("Sec-WebSocket-Key")), "400"),
        (get("/", &without("Sec-WebSocket-Version")), "400"),
        (get("/", &UPGRADE.replace("13", "8")), "400"),
        (get("/", &UPGRADE.replace("ZSBub25jZQ==", "")), "400"),
        (get("/logs/", UPGRADE), "400"),
        (get("/x", UPGRADE), "404"),
        (format!("POST / HTTP/1.1\r\n{OURS}{UPGRADE}\r\n"), "405"),
        (format!("GET / HTTP/1.0\r\n{OURS}{UPGRADE}\r\n"), "400"),
        // A page of someone else.
        (get("/logs/", "Origin: http://evil.example\r\n"), "403"),
        (get("/logs/1.BIN", "Origin: null\r\n"), "403"),
        (get("/logs/", "Origin: http://192.168.4.1\r\n"), "200"),
        (get("/logs/", "Origin: https://192.168.4.1\r\n"), "403"),
    ];
    for (request, expected) in cases {
        let answer = answered(&request);
        assert_eq!(status(&answer), expected, "{request}\n{answer}");
    }
}

#[test]
fn list_of_logs_is_json_without_chunks_for_every_version() {
    for version in ["1.0", "1.1"] {
        let answer = answered(&format!("GET /logs/ HTTP/{version}\r\n{OURS}\r\n"));
        assert!(answer.ends_with("\r\n\r\n[\n]\n"), "{answer}");
        assert!(!answer.contains("Transfer-Encoding"), "{answer}");
    }
    let head = answered(&format!("HEAD /logs/ HTTP/1.1\r\n{OURS}\r\n"));
    assert!(head.ends_with("\r\n\r\n"), "no content: {head}");
}

#[test]
fn every_answer_forbids_frames_and_guessing_and_ends_the_connection() {
    let refused = "GET / HTTP/1.1\r\nHost: evil.example\r\n\r\n".to_owned();
    for request in [get("/", ""), get("/x", ""), get("/logs/", ""), refused] {
        let answer = answered(&request);
        for header in [
            "\r\nConnection: close\r\n",
            "frame-ancestors 'none'",
            "\r\nX-Content-Type-Options: nosniff\r\n",
            "\r\nCross-Origin-Resource-Policy: same-origin\r\n",
            "\r\nCache-Control: no-cache\r\n",
        ] {
            assert!(answer.contains(header), "{header}: {answer}");
        }
        for header in ["Access-Control", "Set-Cookie"] {
            assert!(!answer.contains(header), "{answer}");
        }
    }
}

#[test]
fn page_is_sent_compressed_and_not_again_to_who_has_it() {
    let answer = answered(&get("/", "Accept-Encoding: identity\r\n"));
    assert!(answer.contains("Content-Encoding: gzip\r\n"), "{answer}");
    let (_, tag) = answer.split_once("ETag: ").expect("it has one");
    let tag = tag.lines().next().expect("it has one");
    let again = answered(&get("/", &format!("If-None-Match: {tag}\r\n")));
    assert_eq!(status(&again), "304");
    assert!(again.ends_with("\r\n\r\n"), "no content");
    let other = answered(&get("/", "If-None-Match: \"00000000\"\r\n"));
    assert_eq!(status(&other), "200");
    let head = answered(&format!("HEAD / HTTP/1.1\r\n{OURS}\r\n"));
    assert!(head.ends_with("\r\n\r\n"), "no content: {head}");
    assert_eq!(status(&head), "200");
}

#[test]
fn a_slow_request_is_not_waited_for() {
    play(async |site| {
        let request = get("/", "");
        let slow = Wire::with(
            request
                .bytes()
                .enumerate()
                .map(|(index, byte)| (200 * index as u64, vec![byte])),
        );
        serve(&slow, site).await;
        assert_eq!(status(&slow.text()), "408");
        assert_eq!(Instant::now().as_millis() / 100, 30);
        let silent = Wire::default();
        serve(&silent, site).await;
        assert_eq!(silent.text(), "", "a browser has opened it in advance");
        assert_eq!(Instant::now().as_millis() / 100, 60);
        let in_pieces = Wire::with(request.bytes().map(|byte| (0, vec![byte])));
        serve(&in_pieces, site).await;
        assert_eq!(status(&in_pieces.text()), "200");
        let gone = Wire::default();
        serve_request(&gone, Gone, &mut [0; BUFFER_BYTES], &["192.168.4.1"], site).await;
        assert_eq!(gone.text(), "");
    });
}

/// Delivers a request by cable, as the owner.
fn ask_by_cable(site: Site<'_>, request: &[u8]) {
    let mut cable = Endpoint::new("cable", LinkKind::Direct, 100_000, now());
    cable.push(request);
    let handled = |autopilot: &mut Autopilot| autopilot.handle_next(&mut cable, now(), now());
    assert!(site.shared.with(handled).is_some());
}

/// Plays a scene with a log of this content.
fn play_with_a_log(scene: impl AsyncFnOnce(Site<'_>, &[u8])) {
    let mut rover = logged_rover::Rover::new();
    rover.drive(3);
    rover.run(20);
    let content = rover.file(1);
    let ring = block_on(Ring::scan(&mut rover.flash, logged_rover::Flash::REGION));
    play_with(&Chip(rover.chip()), async |site| {
        site.shared.with(|autopilot| autopilot.logs_found(ring));
        scene(site, &content).await;
    });
}

/// Head and content of what is answered to a request without a body.
async fn fetched(site: Site<'_>, path: &str, headers: &str) -> (String, Vec<u8>) {
    let mut head = ask(site, &get(path, headers)).await;
    let end = head.windows(4).position(|bytes| bytes == b"\r\n\r\n");
    let content = head.split_off(end.expect("a head") + 4);
    (String::from_utf8(head).expect("text"), content)
}

#[test]
fn a_log_is_listed_and_sent_whole_or_in_part_unless_armed() {
    play_with_a_log(async |site, whole| {
        let bytes = whole.len();
        let list = format!(
            "[\n{{\"number\":1,\"bytes\":{bytes},\"time_utc\":null,\"name\":\"rover-00000001.BIN\"}}\n]\n"
        );
        assert_eq!(fetched(site, "/logs/", "").await.1, list.as_bytes());
        let if_range = |tag: &str| format!("Range: bytes=100-\r\nIf-Range: \"{tag}\"\r\n");
        for (headers, expected, part) in [
            (String::new(), "200", whole),
            ("Range: bytes=100-299\r\n".into(), "206", &whole[100..300]),
            ("Range: bytes=100-\r\n".into(), "206", &whole[100..]),
            ("Range: bytes=-50\r\n".into(), "206", &whole[bytes - 50..]),
            (if_range(&format!("1-{bytes}")), "206", &whole[100..]),
            (if_range("another"), "200", whole),
            (if_range(&"a".repeat(60)), "200", whole),
            (
                "Range: bytes=99999999-\r\n".into(),
                "416",
                b"The log has no such bytes.",
            ),
        ] {
            let (head, content) = fetched(site, "/logs/1.BIN", &headers).await;
            assert_eq!(status(&head), expected, "{headers}");
            assert!(content == part, "{headers}");
            assert!(
                head.contains(&format!("\r\nContent-Length: {}\r\n", part.len())),
                "{head}"
            );
            let is_log = expected != "416";
            assert_eq!(head.contains("filename=\"rover-00000001.BIN\""), is_log, "{head}");
            assert_eq!(
                head.contains(&format!("/{bytes}\r\n")),
                expected == "206",
                "{head}"
            );
        }
        ask_by_cable(site, &arm_by_force());
        assert_eq!(status(&fetched(site, "/logs/1.BIN", "").await.0), "409");
        assert_eq!(status(&fetched(site, "/logs/", "").await.0), "200");
    });
}

#[test]
fn arming_breaks_off_a_log_also_where_the_browser_took_nothing_meanwhile() {
    play_with_a_log(async |site, whole| {
        let wire = Wire::default();
        wire.send(get("/logs/1.BIN", "").as_bytes());
        let mut buffer = [0; BUFFER_BYTES];
        let sending = serve_request(Slow(&wire), &wire, &mut buffer, &["192.168.4.1"], site);
        let arming = async {
            Timer::after_secs(5).await;
            ask_by_cable(site, &arm_by_force());
            ask_by_cable(site, &disarm());
        };
        join(sending, arming).await;
        let sent = wire.sent().len();
        assert!(sent > BUFFER_BYTES, "it had begun");
        assert!(sent < whole.len(), "{sent} of {}", whole.len());
        assert_eq!(status(&fetched(site, "/logs/1.BIN", "").await.0), "200");
    });
}

#[test]
fn each_browser_keeps_its_log_until_it_is_complete() {
    play_with_a_log(async |site, _| {
        let wire = Wire::default();
        wire.send(get("/logs/1.BIN", "").as_bytes());
        let mut buffer = [0; BUFFER_BYTES];
        let sending = serve_request(Slow(&wire), &wire, &mut buffer, &["192.168.4.1"], site);
        let erasing = async {
            Timer::after_secs(7).await;
            // Another browser's is complete.
            assert_eq!(status(&fetched(site, "/logs/1.BIN", "").await.0), "200");
            ask_by_cable(site, &log_erase());
            site.shared.with(|autopilot| autopilot.logs().len())
        };
        assert_eq!(join(sending, erasing).await.1, 1, "it is being read");
        ask_by_cable(site, &log_erase());
        assert_eq!(site.shared.with(|autopilot| autopilot.logs().len()), 0);
    });
}

#[test]
fn with_a_key_logs_are_read_as_sign_wifi_allow_says() {
    play_with_a_log(async |site, _| {
        ask_by_cable(site, &setup_signing([OWNER; 32], NEW_YEAR));
        for (allowed, expected) in [(0.0, "403"), (1.0, "200")] {
            ask_by_cable(site, &param_set("SIGN_WIFI_ALLOW", allowed));
            for path in ["/logs/", "/logs/1.BIN"] {
                let (head, _) = fetched(site, path, "").await;
                assert_eq!(status(&head), expected, "{path} {allowed}");
            }
        }
    });
}

/// A browser that takes nothing.
struct Stuck;

impl ErrorType for Stuck {
    type Error = Infallible;
}

impl Write for Stuck {
    async fn write(&mut self, _: &[u8]) -> Result<usize, Infallible> {
        pending().await
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        pending().await
    }
}

/// The time at which sending the page to a browser that takes nothing ends.
async fn stuck_until_ms(site: Site<'_>) -> u64 {
    let wire = Wire::default();
    wire.send(get("/", "").as_bytes());
    serve_request(Stuck, &wire, &mut [0; BUFFER_BYTES], &["192.168.4.1"], site).await;
    Instant::now().as_millis()
}

#[test]
fn two_files_are_sent_at_a_time_and_a_stalled_transfer_is_ended_for_another() {
    play(async |site| {
        let third = async {
            Timer::after_millis(2_900).await;
            let answer = text_for(site, &get("/", "")).await;
            assert_eq!(status(&answer), "503", "{answer}");
            assert!(answer.contains("two browsers at a time"), "a sentence");
            // A refusal needs no slot.
            assert_eq!(status(&text_for(site, &get("/x", "")).await), "404");
            Timer::after_millis(200).await;
            assert_eq!(status(&text_for(site, &get("/", "")).await), "200");
        };
        let stuck = join_array([stuck_until_ms(site), stuck_until_ms(site)]);
        let (mut ended_ms, ()) = join(stuck, third).await;
        ended_ms.sort_unstable();
        // One has made room; the other one is not waited for forever.
        assert_eq!(ended_ms, [3_100, 12_000]);
    });
}

#[test]
fn stalled_transfers_end_when_all_connections_are_in_use() {
    play(async |site| {
        let others = async {
            for at_ms in [2_900, 3_100] {
                Timer::at(Instant::from_millis(at_ms)).await;
                let wire = Wire::default();
                refuse(&wire, site.slots).await;
                assert_eq!(status(&wire.text()), "503");
            }
        };
        let stuck = join_array([stuck_until_ms(site), stuck_until_ms(site)]);
        assert_eq!(join(stuck, others).await.0, [3_100; 2]);
    });
}

/// A browser that takes a piece every two seconds.
struct Slow<'a>(&'a Wire);

impl ErrorType for Slow<'_> {
    type Error = Infallible;
}

impl Write for Slow<'_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Infallible> {
        Timer::after_secs(2).await;
        self.0.write(bytes).await
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        Ok(())
    }
}

#[test]
fn a_slow_download_that_goes_on_keeps_its_slot() {
    play(async |site| {
        let slow = || async {
            let wire = Wire::default();
            wire.send(get("/", "").as_bytes());
            serve_request(Slow(&wire), &wire, &mut [0; BUFFER_BYTES], &["192.168.4.1"], site).await;
            let page = fs::read(repository().join("web/page.html.gz")).expect("it can be read");
            assert!(wire.sent().ends_with(&page), "it is whole");
        };
        let third = async {
            for _ in 0..10 {
                Timer::after_secs(1).await;
                assert_eq!(status(&text_for(site, &get("/", "")).await), "503");
            }
        };
        join(join_array([slow(), slow()]), third).await;
    });
}

/// A slot for a WebSocket, if there is one.
async fn open<'a>(site: Site<'a>, headers: &str) -> Option<Slot<'a>> {
    let wire = Wire::default();
    wire.send(get("/", &format!("{UPGRADE}{headers}")).as_bytes());
    match serve(&wire, site).await {
        Some(slot) => {
            assert!(
                wire.text()
                    .contains("Sec-WebSocket-Accept: s3pPLMBiTxaQ9kYGzzhZRbK+xOo=\r\n")
            );
            Some(slot)
        }
        None => {
            assert_eq!(status(&wire.text()), "503");
            None
        }
    }
}

const FOREIGN: &str = "Origin: https://firmware.example\r\n";

/// The slot that one of ours gets while this one is released as soon as that is requested.
async fn open_instead_of<'a>(site: Site<'a>, released: Slot<'_>) -> Option<Slot<'a>> {
    let release = async {
        released.release_requested().await;
        drop(released);
    };
    join(open(site, ""), release).await.0
}

#[test]
fn there_are_two_web_sockets_and_our_page_takes_over_that_of_a_foreign_one() {
    play(async |site| {
        let ours = open(site, "Origin: http://192.168.4.1\r\n")
            .await
            .expect("it is the first");
        assert_eq!(ours.sender, Sender::Own);
        // Silent for longer than the foreign page.
        Timer::after_secs(10).await;
        let foreign = open(site, FOREIGN).await.expect("it is the second");
        assert_eq!(foreign.sender, Sender::Foreign);
        assert!(open(site, FOREIGN).await.is_none(), "foreign ones wait");
        let second = open_instead_of(site, foreign).await;
        assert!(second.is_some(), "it has the slot of the foreign one");
    });
}

#[test]
fn the_web_socket_that_was_silent_for_longest_is_taken_over_after_three_seconds() {
    play(async |site| {
        let first = open(site, "").await.expect("it is the first");
        Timer::after_secs(1).await;
        let second = open(site, "").await.expect("it is the second");
        first.note_use();
        Timer::after_millis(2_999).await;
        assert!(open(site, "").await.is_none(), "both were heard");
        assert!(open(site, FOREIGN).await.is_none());
        first.note_use();
        Timer::after_millis(1).await;
        let third = open_instead_of(site, second).await;
        let third = third.expect("it has the slot of the second");
        Timer::after_secs(1).await;
        third.note_use();
        Timer::after_secs(2).await;
        let fourth = open_instead_of(site, first).await;
        assert!(fourth.is_some(), "it has the slot of the first");
        assert!(open(site, "").await.is_none(), "the third was heard");
    });
}

#[test]
fn a_slot_is_reserved_for_three_seconds_for_one_of_ours_that_was_refused() {
    play(async |site| {
        let first = open(site, "").await.expect("it is the first");
        let second = open(site, "").await.expect("it is the second");
        assert!(open(site, "").await.is_none());
        drop(first);
        for _ in 0..29 {
            assert!(open(site, FOREIGN).await.is_none(), "it is kept");
            Timer::after_millis(100).await;
        }
        let ours = open(site, "").await.expect("it is for ours");
        assert!(open(site, FOREIGN).await.is_none(), "there is no other");
        drop((second, ours));
        Timer::after_millis(100).await;
        assert!(open(site, FOREIGN).await.is_some(), "ours has not come again");
    });
}

/// A frame of a client, with this first byte.
pub fn masked(first: u8, payload: &[u8]) -> Vec<u8> {
    const MASK: [u8; 4] = [0x12, 0x34, 0x56, 0x78];
    let mut bytes = vec![first];
    match payload.len() {
        short @ ..126 => bytes.push(0x80 | short as u8),
        long => {
            bytes.push(0x80 | 126);
            bytes.extend((long as u16).to_be_bytes());
        }
    }
    bytes.extend(MASK);
    bytes.extend(
        payload
            .iter()
            .zip(MASK.iter().cycle())
            .map(|(byte, mask)| byte ^ mask),
    );
    bytes
}

const BINARY: u8 = 0x82;
const PING: u8 = 0x89;
const CLOSE: u8 = 0x88;

fn read_parameter(name: &str) -> Vec<u8> {
    let request = PARAM_REQUEST_READ_DATA {
        param_index: -1,
        target_system: 1,
        target_component: 1,
        param_id: name.into(),
    };
    frame(0, &MavMessage::PARAM_REQUEST_READ(request))
}

/// Serves a WebSocket with what comes for so long, and returns what was sent: the payloads by kind of frame, and whether it has ended.
fn served(sender: &str, coming: &[Vec<u8>], seconds: u64) -> (Vec<(u8, Vec<u8>)>, bool) {
    play(async |site| served_at(site, sender, coming, seconds).await)
}

async fn served_at(
    site: Site<'_>,
    sender: &str,
    coming: &[Vec<u8>],
    seconds: u64,
) -> (Vec<(u8, Vec<u8>)>, bool) {
    let slot = open(site, sender).await.expect("there is one");
    let wire = Wire::default();
    coming.iter().for_each(|bytes| wire.send(bytes));
    let link = Link::new("WEB", LinkKind::Wifi, 100_000).with_access(slot.sender.access());
    let serving = serve_web_socket(&wire, &wire, &slot, &link, site.shared, &CHECK_IN);
    let end = select(serving, Timer::after_secs(seconds)).await;
    (sent_frames(&wire.sent()), matches!(end, Either::First(())))
}

fn sent_frames(mut bytes: &[u8]) -> Vec<(u8, Vec<u8>)> {
    let mut frames = Vec::new();
    while let [kind, length, rest @ ..] = bytes {
        let (length, rest) = match length {
            126 => (usize::from(u16::from_be_bytes([rest[0], rest[1]])), &rest[2..]),
            _ => (usize::from(*length), rest),
        };
        frames.push((*kind, rest[..length].to_vec()));
        bytes = &rest[length..];
    }
    frames
}

/// The parameters of which values were sent.
fn values(sent: &[(u8, Vec<u8>)]) -> Vec<String> {
    let stream: Vec<u8> = sent
        .iter()
        .filter(|(kind, _)| *kind == BINARY)
        .flat_map(|(_, bytes)| bytes.clone())
        .collect();
    let frames = FrameReader::default().take(&stream);
    let values = frames.iter().filter_map(|frame| match &frame.message {
        Some(MavMessage::PARAM_VALUE(value)) => Some(value.param_id.to_str().unwrap().to_owned()),
        _ => None,
    });
    values.collect()
}

#[test]
fn messages_are_pieces_of_a_stream_in_both_directions() {
    let requests = [read_parameter("BATT_CAPACITY"), read_parameter("FS_TIMEOUT")].concat();
    let pieces: Vec<_> = requests.chunks(7).map(|piece| masked(BINARY, piece)).collect();
    let as_message = vec![masked(BINARY, &requests)];
    let (first, rest) = requests.split_at(30);
    let fragments = vec![
        masked(0x02, first),
        masked(0x00, &[]),
        masked(PING, b"still there?"),
        masked(0x80, rest),
    ];
    let bytewise = masked(BINARY, &requests)
        .into_iter()
        .map(|byte| vec![byte])
        .collect();
    for coming in [pieces, as_message, fragments, bytewise] {
        let (sent, has_ended) = served("", &coming, 2);
        assert_eq!(values(&sent), ["BATT_CAPACITY", "FS_TIMEOUT"]);
        assert!(!has_ended);
    }
}

#[test]
fn only_a_browser_is_judged_by_the_time_that_it_states() {
    const TOO_LATE: &str = "Command waited for too long: refused";
    let stated = masked(BINARY, &stated_time(1_000));
    let arm = masked(BINARY, &arm_by_force());
    for (sender, is_armed) in [("", true), ("Origin: http://192.168.4.1\r\n", false)] {
        play(async |site| {
            let slot = open(site, sender).await.expect("it is the first");
            // MAVProxy states its time every ten seconds.
            let wire = Wire::with([(100, stated.clone()), (8_000, arm.clone())]);
            let link = Link::new("WEB", LinkKind::Wifi, 100_000).with_access(slot.sender.access());
            let serving = serve_web_socket(&wire, &wire, &slot, &link, site.shared, &CHECK_IN);
            select(serving, Timer::after_secs(9)).await;
            let arm_state = site.shared.with(|autopilot| autopilot.vehicle().arm_state());
            assert_eq!(arm_state == ArmState::Armed, is_armed, "{sender}");
            let sent = sent_frames(&wire.sent());
            let text = sent.iter().any(|(_, bytes)| {
                bytes
                    .windows(TOO_LATE.len())
                    .any(|part| part == TOO_LATE.as_bytes())
            });
            assert_eq!(text, !is_armed, "{sender}");
        });
    }
}

#[test]
fn only_mavlink_frames_of_right_checksum_keep_a_slot() {
    let request = read_parameter("BATT_CAPACITY");
    let mut broken = request.clone();
    broken[12] ^= 1;
    for (payload, kind, keeps) in [
        (request.clone(), BINARY, true),
        (broken, BINARY, false),
        (request[..20].to_vec(), BINARY, false),
        (Vec::new(), BINARY, false),
        (request[..20].to_vec(), PING, false),
    ] {
        play(async |site| {
            let slot = open(site, "").await.expect("it is the first");
            let other = open(site, "").await.expect("it is the second");
            let wire = Wire::with((1..10).map(|second| (1_000 * second, masked(kind, &payload))));
            let link = Link::new("WEB", LinkKind::Wifi, 100_000);
            let serving = async {
                serve_web_socket(&wire, &wire, &slot, &link, site.shared, &CHECK_IN).await;
                drop(slot);
                pending::<()>().await;
            };
            let asking = async {
                Timer::after_millis(3_500).await;
                other.note_use();
                open(site, "").await.is_some()
            };
            let asked = select(serving, asking).await;
            assert!(
                matches!(asked, Either::Second(gets) if gets != keeps),
                "{payload:?}"
            );
            let code = 1001_u16.to_be_bytes().to_vec();
            assert_eq!(sent_frames(&wire.sent()).contains(&(CLOSE, code)), !keeps);
        });
    }
}

/// Frames that come at once, as many as are left.
struct Flood {
    frame: Vec<u8>,
    left: Cell<u32>,
}

impl ByteSource for &Flood {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        if self.left.get() == 0 {
            pending::<()>().await;
        }
        self.left.update(|left| left - 1);
        buffer[..self.frame.len()].copy_from_slice(&self.frame);
        Ok(self.frame.len())
    }
}

#[test]
fn a_flood_of_pings_or_empty_frames_leaves_others_their_turn() {
    for frame in [masked(PING, b""), masked(BINARY, b"")] {
        play(async |site| {
            let slot = open(site, "").await.expect("it is the first");
            let link = Link::new("WEB", LinkKind::Wifi, 100_000);
            let flood = Flood {
                frame,
                left: Cell::new(1_000),
            };
            let wire = Wire::default();
            let serving = serve_web_socket(&wire, &flood, &slot, &link, site.shared, &CHECK_IN);
            let others = async {
                let mut turns = 0;
                while flood.left.get() > 0 {
                    yield_now().await;
                    turns += 1;
                }
                turns
            };
            let turns = select(serving, others).await;
            assert!(matches!(turns, Either::Second(900..)), "{turns:?}");
        });
    }
}

#[test]
fn a_ping_is_answered_once_with_what_it_has() {
    let (sent, _) = served("", &[masked(PING, b"hello")], 2);
    let pongs: Vec<_> = sent.iter().filter(|(kind, _)| *kind == 0x8a).collect();
    assert_eq!(pongs, [&(0x8a, b"hello".to_vec())]);
}

#[test]
fn frames_against_the_rules_end_it_with_their_code() {
    let unmasked = vec![BINARY, 1, 0];
    let huge = [vec![BINARY, 0xff], u64::MAX.to_be_bytes().to_vec(), vec![0; 4]].concat();
    let long_ping = [vec![PING, 0x80 | 126, 0, 126], vec![0; 4]].concat();
    for (coming, code) in [
        (vec![unmasked], 1002),
        // Reserved bits and kinds.
        (vec![masked(BINARY | 0x40, b"x")], 1002),
        (vec![masked(0x83, b"x")], 1002),
        (vec![masked(0x8b, b"x")], 1002),
        // Not in order.
        (vec![masked(0x80, b"x")], 1002),
        (vec![masked(0x02, b"x"), masked(BINARY, b"y")], 1002),
        (vec![masked(0x09, b"x")], 1002),
        (vec![long_ping], 1002),
        (vec![masked(0x81, b"text")], 1003),
        (vec![masked(BINARY, &[0; 4097])], 1009),
        (vec![huge], 1009),
        (vec![masked(CLOSE, &[0x03, 0xe8])], 1000),
        (vec![masked(CLOSE, &[])], 1000),
    ] {
        let (sent, has_ended) = served("", &coming, 2);
        assert!(has_ended, "{code}: {coming:?}");
        let (kind, reason) = sent.last().expect("it says why");
        assert_eq!(
            (*kind, reason.as_slice()),
            (CLOSE, &u16::to_be_bytes(code)[..]),
            "{coming:?}"
        );
        assert_eq!(values(&sent), [""; 0]);
    }
}

#[test]
fn a_foreign_page_hears_and_gets_no_answer() {
    let (sent, has_ended) = served(FOREIGN, &[masked(BINARY, &read_parameter("BATT_CAPACITY"))], 5);
    assert!(!has_ended);
    assert!(sent.len() > 10, "telemetry comes: {}", sent.len());
    assert_eq!(values(&sent), [""; 0]);
}

#[test]
fn a_foreign_page_is_obeyed_only_if_it_signs() {
    let request = param_set("BATT_LOW_VOLT", 10.5);
    let signed = Signer::new(OWNER).sign(&request);
    for (has_key, request, expected) in [
        (false, &request, 0.0),
        (true, &request, 0.0),
        (true, &signed, 10.5),
    ] {
        play(async |site| {
            if has_key {
                ask_by_cable(site, &setup_signing([OWNER; 32], NEW_YEAR));
            }
            served_at(site, FOREIGN, &[masked(BINARY, request)], 1).await;
            let value = site.shared.with(|autopilot| autopilot.parameters().get(LOW_VOLT));
            assert_eq!(value, expected, "has a key: {has_key}");
        });
    }
}
