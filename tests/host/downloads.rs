//! Files over a link: frames in, frames out, and a log of bytes.

use std::num::NonZeroU32;
use std::{fs, iter};

use proptest::prelude::*;
use rover_battmon::mavlink::{Changeable, Endpoint, Event, Framer, LinkKind, Signing};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, Parameters, VehicleParameter};
use rover_battmon::recorder::LogFile;
use rover_battmon::system::{LogProtocol, LogReader, SystemState};
use rover_battmon::time::Instant;
use rover_battmon::vehicle::{Fitness, Vehicle};
use rover_battmon::wifi::WifiCredentials;
use support::commands::REQUEST_MESSAGE;
use support::desk::EXTRA1;
use support::frames::{
    COMPONENT_METADATA, FILE_TRANSFER_PROTOCOL, Frame, GROUND_STATION, HEARTBEAT, LOG_DATA, LOG_ENTRY,
    LOG_REQUEST_END, STATUSTEXT, SYS_STATUS, encode_v2_from, frames, of_message, texts_of,
};
use support::repository;
use support::requests::{VEHICLE, command_long, log_data, log_erase, log_list};
use support::time::SECOND;

use crate::logged_rover::Rover;

const OTHER_STATION: [u8; 2] = [254, 190];

/// Our end of a link, and what it reads.
struct Bench {
    endpoint: Endpoint,
    framer: Framer,
    parameters: Parameters,
    vehicle: Vehicle,
    signing: Signing,
    wifi: WifiCredentials,
    files: Vec<(LogFile, Vec<u8>)>,
    now_us: u64,
}

impl Bench {
    fn new(sizes: &[u32]) -> Self {
        let files = (3u16..).zip(sizes).map(|(number, bytes)| {
            let content =
                (0..*bytes).map(|offset| (u32::from(number) * 31 + offset * 7 + offset / 251) as u8);
            let file = LogFile {
                number,
                bytes: *bytes,
                began_utc_s: None,
            };
            (file, content.collect())
        });
        Self {
            endpoint: Endpoint::new("bench", LinkKind::Direct, 100_000, Instant::EPOCH),
            framer: Framer::new(),
            parameters: Parameters::defaults(),
            vehicle: Vehicle::new(),
            signing: Signing::off(),
            wifi: WifiCredentials::absent(),
            files: files.collect(),
            now_us: 0,
        }
    }

    fn arm(&mut self) {
        self.vehicle
            .arm(Instant::from_micros(self.now_us), Fitness::Checked)
            .expect("it is fit");
    }

    fn state<'a>(&self, logs: &'a [LogFile]) -> SystemState<'a> {
        SystemState {
            now: Instant::from_micros(self.now_us),
            vehicle: self.vehicle.status(),
            armings: self.vehicle.armings(),
            logs,
            ..SystemState::default()
        }
    }

    fn logs(&self) -> Vec<LogFile> {
        self.files.iter().map(|(file, _)| *file).collect()
    }

    fn handle(&mut self, mut bytes: &[u8]) -> Vec<Event> {
        let logs = self.logs();
        let mut events = Vec::new();
        while !bytes.is_empty() {
            let taken = self.endpoint.push(bytes);
            bytes = &bytes[taken..];
            let state = self.state(&logs);
            events.extend(iter::from_fn(|| {
                self.endpoint.handle_next(
                    state.now,
                    state.now,
                    &state,
                    Changeable {
                        command: &mut None,
                        parameters: &mut self.parameters,
                        vehicle: &mut self.vehicle,
                        signing: &mut self.signing,
                        wifi: &mut self.wifi,
                    },
                )
            }));
        }
        events
    }

    fn post_due(&mut self) {
        let logs = self.logs();
        let state = self.state(&logs);
        self.endpoint.post_due(state.now, &state, &self.parameters);
    }

    /// The next frame, as the task of a wire gets it.
    fn next_frame(&mut self) -> Option<Vec<u8>> {
        let logs = self.logs();
        let state = self.state(&logs);
        while let Some(read) = self.endpoint.next_read(&state, &self.parameters) {
            let mut files = self.files.iter();
            let found = files.find(|(file, _)| file.number == read.number);
            let content = found.map_or(&[][..], |(_, content)| content);
            let rest = &content[content.len().min(read.offset as usize)..];
            let bytes = &rest[..rest.len().min(read.bytes.into())];
            self.endpoint.supply(read, bytes);
        }
        let message = self.endpoint.next_message(&state, &self.parameters)?;
        let system_id = self.parameters.system_id();
        Some(self.framer.frame(&message, system_id).to_vec())
    }

    fn sent_at_most(&mut self, messages: usize) -> Vec<Frame> {
        let bytes: Vec<_> = iter::from_fn(|| self.next_frame())
            .take(messages)
            .flatten()
            .map(|byte| (0, byte))
            .collect();
        frames(&bytes)
    }

    fn sent(&mut self) -> Vec<Frame> {
        self.sent_at_most(usize::MAX)
    }

    fn ask(&mut self, request: &[u8]) -> Vec<Frame> {
        self.handle(request);
        self.sent()
    }

    fn texts(&mut self, request: &[u8]) -> Vec<String> {
        texts_of(&self.ask(request))
    }
}

fn log_end(station: [u8; 2]) -> Vec<u8> {
    encode_v2_from(station, LOG_REQUEST_END, &VEHICLE)
}

/// Puts the bytes of LOG_DATA messages in their places.
fn put(whole: &mut [u8], sent: &[Frame]) {
    for frame in of_message(sent, LOG_DATA) {
        let (offset, count) = (frame.u32(0) as usize, usize::from(frame.u8(6)));
        for place in 0..count {
            whole[offset + place] = frame.u8(7 + place);
        }
    }
}

#[test]
fn a_whole_log_is_listed_and_downloaded_as_it_is() {
    let mut bench = Bench::new(&[500, 12_345]);
    let listed = bench.ask(&log_list(0, u16::MAX));
    let entries = listed.iter().map(|frame| {
        assert_eq!(frame.message_id, LOG_ENTRY);
        // Id, number of files, the last id; time, size.
        (
            [8, 10, 12].map(|at| frame.u16(at)),
            [0, 4].map(|at| frame.u32(at)),
        )
    });
    let expected = [([1, 2, 2], [0, 500]), ([2, 2, 2], [0, 12_345])];
    assert_eq!(entries.collect::<Vec<_>>(), expected);
    let sent = bench.ask(&log_data(2, 0, u32::MAX));
    let mut whole = vec![0; 12_345];
    put(&mut whole, &sent);
    assert_eq!(whole, bench.files[1].1);
    assert_eq!(sent.len(), 12_345usize.div_ceil(90));
}

#[test]
fn streams_share_the_link_with_a_download_and_none_is_dropped() {
    let mut bench = Bench::new(&[900_000]);
    bench.handle(&log_data(1, 0, u32::MAX));
    let mut sent = Vec::new();
    for second in 0..60 {
        for tick in 0..10 {
            bench.now_us = second * SECOND + tick * SECOND / 10;
            bench.post_due();
            let frames = bench.sent_at_most(12);
            if tick == 0 {
                assert_eq!(frames[0].message_id, HEARTBEAT, "second {second}");
            }
            sent.extend(frames);
        }
    }
    let of = |id| of_message(&sent, id).len();
    assert_eq!(sent.len(), 60 * 120);
    assert_eq!(of(HEARTBEAT), 60);
    // SYS_STATUS is due twice a second, which is less than its share.
    assert_eq!(of(SYS_STATUS), 120);
    assert_eq!(of(LOG_DATA), 60 * 120 - 60 - 120);
    assert_eq!(bench.endpoint.statistics().dropped, 0);
    assert_eq!(of(STATUSTEXT), 0);
}

#[test]
fn a_stream_that_is_due_all_the_time_gets_one_message_in_25() {
    let mut bench = Bench::new(&[900_000]);
    bench.parameters.set(EXTRA1, 50.0).expect("in range");
    bench.handle(&log_data(1, 0, u32::MAX));
    let mut sent = Vec::new();
    for tick in 1..600 {
        bench.now_us = tick * SECOND / 50;
        bench.post_due();
        sent.extend(bench.sent_at_most(3));
    }
    let [data, streams] = [LOG_DATA, SYS_STATUS].map(|id| of_message(&sent, id).len());
    assert!(data.abs_diff(streams * 24) <= 24, "{data}, {streams}");
    assert_eq!(bench.endpoint.statistics().dropped, 0);
    assert!(of_message(&sent, STATUSTEXT).is_empty());
}

#[test]
// Requirement: AP-27
fn while_armed_downloads_are_refused_and_arming_ends_one() {
    const TEXT: &str = "Not while armed: disarm first";
    let mut bench = Bench::new(&[900_000]);
    bench.handle(&log_data(1, 0, u32::MAX));
    assert_eq!(bench.sent_at_most(10).len(), 10);
    bench.arm();
    assert!(bench.sent().len() <= 1, "what was built leaves");
    assert_eq!(bench.texts(&log_data(1, 0, 90)), [TEXT]);
    assert!(
        bench.texts(&log_data(1, 0, 90)).is_empty(),
        "not at each repetition"
    );
    bench.now_us += 5 * SECOND;
    assert_eq!(bench.texts(&log_erase()), [TEXT]);
    assert_eq!(of_message(&bench.ask(&log_list(0, u16::MAX)), LOG_ENTRY).len(), 1);
}

#[test]
fn arming_ends_a_download_also_where_the_link_took_nothing_meanwhile() {
    let mut bench = Bench::new(&[900_000]);
    let mut client = Client::new(OTHER_STATION);
    assert_eq!(client.with_path(&mut bench, OPEN, "/LOGS/00000003.BIN").0, ACK);
    bench.handle(&log_data(1, 0, u32::MAX));
    assert_eq!(bench.sent_at_most(10).len(), 10);
    bench.arm();
    bench.vehicle.disarm();
    assert!(bench.sent().len() <= 1, "what was built leaves");
    let answer = client.one(&mut bench, READ, 90, 0, &[]);
    assert_eq!(answer, (NAK, vec![INVALID_SESSION]));
    assert_eq!(bench.ask(&log_data(1, 0, 90)).len(), 1, "another one may begin");
}

#[test]
fn of_a_log_that_is_gone_there_is_a_text_and_no_data() {
    const GONE: &str = "There is no such log: read the list again";
    let mut bench = Bench::new(&[9000, 500]);
    bench.ask(&log_list(0, u16::MAX));
    bench.handle(&log_data(1, 0, u32::MAX));
    assert_eq!(bench.sent_at_most(10).len(), 10);
    bench.files.remove(0);
    let sent = bench.sent();
    assert_eq!(texts_of(&sent), ["Log can't be read: download broken off"]);
    assert!(of_message(&sent, LOG_DATA).len() <= 1, "what was built leaves");
    for (us, texts) in [
        (0, &[GONE][..]),
        (0, &[]),
        (5 * SECOND - 1, &[]),
        (5 * SECOND, &[GONE]),
        (6 * SECOND, &[]),
    ] {
        bench.now_us = us;
        let sent = bench.ask(&log_data(1, 900, 180));
        assert_eq!(texts_of(&sent), texts, "{us}");
        assert_eq!(of_message(&sent, LOG_DATA).len(), 0, "{us}");
    }
    let sent = bench.ask(&log_data(2, 0, u32::MAX));
    let mut whole = vec![0; 500];
    put(&mut whole, &sent);
    assert_eq!(whole, bench.files[0].1, "the other one is there");
}

#[test]
fn ftp_reports_a_log_that_is_gone_as_failed() {
    let mut bench = Bench::new(&[9000]);
    let mut client = Client::new(GROUND_STATION);
    assert_eq!(client.with_path(&mut bench, OPEN, "/LOGS/00000003.BIN").0, ACK);
    bench.files.clear();
    assert_eq!(client.one(&mut bench, READ, 90, 0, &[]), (NAK, vec![FAIL]));
    assert_eq!(client.one(&mut bench, BURST, 90, 0, &[]), (NAK, vec![FAIL]));
}

#[test]
fn another_station_that_reads_by_ftp_on_the_same_link_keeps_the_logs() {
    let mut bench = Bench::new(&[900]);
    let mut client = Client::new(OTHER_STATION);
    assert_eq!(client.with_path(&mut bench, OPEN, "/LOGS/00000003.BIN").0, ACK);
    for second in [4, 8] {
        bench.now_us = second * SECOND;
        assert_eq!(client.one(&mut bench, READ, 90, 0, &[]).0, ACK);
    }
    bench.now_us = 18 * SECOND - 1;
    assert_eq!(
        bench.texts(&log_erase()),
        ["Log download in use by another station"]
    );
    bench.now_us = 18 * SECOND;
    assert_eq!(bench.handle(&log_erase()), [Event::LogsErased]);
}

/// A rover whose oldest file is erased ahead as soon as nothing reads it: it was disarmed just now.
fn about_to_erase(drives: u32) -> Rover {
    let mut rover = Rover::new();
    rover.desk.set(VehicleParameter::LogFileDsrmrot, 1.0);
    for drive in 0..drives {
        rover.drive(2);
        if drive + 1 < drives {
            rover.run(20);
        }
    }
    rover
}

fn has_file(rover: &Rover, number: u16) -> bool {
    rover
        .desk
        .autopilot
        .logs()
        .iter()
        .any(|file| file.number == number)
}

#[test]
fn erasing_ahead_waits_for_each_reader_of_that_file() {
    let drives = (2..9).find(|drives| {
        let mut rover = about_to_erase(*drives);
        assert!(has_file(&rover, 1));
        rover.run(30);
        !has_file(&rover, 1)
    });
    let drives = drives.expect("the ring is small");
    let others = [LogReader::Browser(0), LogReader::Link(9, LogProtocol::LogData)];
    for reader in [
        LogReader::Browser(1),
        LogReader::Link(7, LogProtocol::LogData),
        LogReader::Link(7, LogProtocol::FileTransfer),
    ] {
        let mut rover = about_to_erase(drives);
        let newest = rover.desk.autopilot.logs().last().expect("one").number;
        for _ in 0..5 {
            let now = rover.desk.now();
            let autopilot = &mut rover.desk.autopilot;
            assert!(autopilot.locate_log(1, 0, reader, now).is_some());
            for other in others {
                autopilot.locate_log(newest, 0, other, now);
            }
            rover.run(9);
            assert!(has_file(&rover, 1), "{reader:?}");
        }
        rover.run(21);
        assert!(
            !has_file(&rover, 1),
            "{reader:?} has taken nothing for ten seconds"
        );
    }
}

#[test]
fn erasing_is_up_to_the_core() {
    let mut bench = Bench::new(&[900]);
    assert_eq!(bench.handle(&log_erase()), [Event::LogsErased]);
    assert!(bench.sent().is_empty());
    bench.arm();
    assert_eq!(bench.handle(&log_erase()), [Event::Answered]);
}

#[test]
fn bytes_that_come_late_are_ignored() {
    let mut bench = Bench::new(&[900]);
    bench.handle(&log_data(1, 0, u32::MAX));
    let logs = bench.logs();
    let read = bench
        .endpoint
        .next_read(&bench.state(&logs), &bench.parameters)
        .expect("something to read");
    bench.handle(&log_end(GROUND_STATION));
    bench.endpoint.supply(read, &[1; 90]);
    assert!(bench.sent().is_empty());
}

const TERMINATE: u8 = 1;
const RESET: u8 = 2;
const LIST: u8 = 3;
const OPEN: u8 = 4;
const READ: u8 = 5;
const CREATE: u8 = 6;
const WRITE: u8 = 7;
const CHECKSUM: u8 = 14;
const BURST: u8 = 15;
const LIST_WITH_TIME: u8 = 16;

const ACK: u8 = 128;
const NAK: u8 = 129;

const FAIL: u8 = 1;
const INVALID_SIZE: u8 = 3;
const INVALID_SESSION: u8 = 4;
const NO_SESSIONS: u8 = 5;
const END_OF_FILE: u8 = 6;
const UNKNOWN_COMMAND: u8 = 7;
const PROTECTED: u8 = 9;
const NOT_FOUND: u8 = 10;

/// The client of one station: counts its requests.
struct Client {
    station: [u8; 2],
    session: u8,
    sequence: u16,
}

/// The content of an answer.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Answer {
    sequence: u16,
    session: u8,
    opcode: u8,
    request: u8,
    is_complete: bool,
    offset: u32,
    data: Vec<u8>,
}

impl Client {
    fn new(station: [u8; 2]) -> Self {
        Self {
            station,
            session: 1,
            sequence: 65_530,
        }
    }

    fn request(&self, opcode: u8, size: u8, offset: u32, data: &[u8]) -> Vec<u8> {
        let mut payload = vec![0, VEHICLE[0], VEHICLE[1]];
        payload.extend(self.sequence.to_le_bytes());
        payload.extend([self.session, opcode, size, 0, 0, 0]);
        payload.extend(offset.to_le_bytes());
        payload.extend(data);
        encode_v2_from(self.station, FILE_TRANSFER_PROTOCOL, &payload)
    }

    fn answers(&self, sent: &[Frame]) -> Vec<Answer> {
        let answer = |frame: &Frame| {
            assert_eq!([frame.u8(1), frame.u8(2)], self.station);
            Answer {
                sequence: frame.u16(3),
                session: frame.u8(5),
                opcode: frame.u8(6),
                request: frame.u8(8),
                is_complete: frame.u8(9) == 1,
                offset: frame.u32(11),
                data: (0..usize::from(frame.u8(7)))
                    .map(|place| frame.u8(15 + place))
                    .collect(),
            }
        };
        of_message(sent, FILE_TRANSFER_PROTOCOL)
            .into_iter()
            .map(answer)
            .collect()
    }

    /// The answers to a request, with a new sequence number.
    fn ask(&mut self, bench: &mut Bench, opcode: u8, size: u8, offset: u32, data: &[u8]) -> Vec<Answer> {
        self.sequence = self.sequence.wrapping_add(1);
        let sent = bench.ask(&self.request(opcode, size, offset, data));
        let answers = self.answers(&sent);
        for (place, answer) in (1..).zip(&answers) {
            assert_eq!(answer.sequence, self.sequence.wrapping_add(place));
            assert_eq!((answer.session, answer.request), (self.session, opcode));
        }
        answers
    }

    fn one(&mut self, bench: &mut Bench, opcode: u8, size: u8, offset: u32, data: &[u8]) -> (u8, Vec<u8>) {
        let answers = self.ask(bench, opcode, size, offset, data);
        assert_eq!(answers.len(), 1, "{answers:?}");
        (answers[0].opcode, answers[0].data.clone())
    }

    fn with_path(&mut self, bench: &mut Bench, opcode: u8, path: &str) -> (u8, Vec<u8>) {
        self.one(bench, opcode, path.len() as u8, 0, path.as_bytes())
    }

    /// A whole file by bursts of messages with this many bytes, of which every fifth is lost and read again.
    fn get(&mut self, bench: &mut Bench, path: &str, bytes: u8) -> Vec<u8> {
        assert_eq!(self.with_path(bench, OPEN, path).0, ACK);
        let mut whole = Vec::new();
        let mut gaps = Vec::new();
        let mut count = 0;
        let mut offset = 0;
        loop {
            let answers = self.ask(bench, BURST, bytes, offset, &[]);
            let last = answers.last().expect("an answer").clone();
            for answer in answers.iter().filter(|answer| answer.opcode == ACK) {
                assert_eq!(answer.offset, offset);
                offset += answer.data.len() as u32;
                count += 1;
                if count % 5 == 0 {
                    gaps.push((answer.offset, answer.data.len()));
                    whole.resize(offset as usize, 0);
                } else {
                    whole.extend(&answer.data);
                }
            }
            assert!(last.is_complete);
            self.sequence = last.sequence;
            if last.opcode == NAK {
                assert_eq!((last.offset, last.data), (offset, vec![END_OF_FILE]));
                break;
            }
        }
        for (at, length) in gaps {
            let (opcode, data) = self.one(bench, READ, bytes, at, &[]);
            assert_eq!((opcode, data.len()), (ACK, length));
            whole[at as usize..at as usize + length].copy_from_slice(&data);
        }
        assert_eq!(
            self.one(bench, READ, bytes, offset, &[]),
            (NAK, vec![END_OF_FILE])
        );
        assert_eq!(self.one(bench, TERMINATE, 0, 0, &[]), (ACK, vec![]));
        whole
    }
}

#[test]
fn logs_are_listed_in_their_directory() {
    let mut bench = Bench::new(&[500; 20]);
    let mut client = Client::new(GROUND_STATION);
    let path = "/APM/LOGS";
    let mut names = Vec::new();
    loop {
        let size = path.len() as u8;
        let (opcode, data) = client.one(&mut bench, LIST, size, names.len() as u32, path.as_bytes());
        if opcode == NAK {
            assert_eq!(data, [END_OF_FILE]);
            break;
        }
        let entries = String::from_utf8(data).expect("text");
        names.extend(entries.split_terminator('\0').map(String::from));
    }
    let expected: Vec<_> = (3..23).map(|number| format!("F{number:08}.BIN\t500")).collect();
    assert_eq!(names, expected);
    bench.files[0].0.began_utc_s = NonZeroU32::new(1_790_000_000);
    let (opcode, with_times) = client.with_path(&mut bench, LIST_WITH_TIME, "/LOGS");
    let expected = b"F00000003.BIN\t500\t1790000000\0F00000004.BIN\t500\t0\0";
    assert!(
        opcode == ACK && with_times.starts_with(expected),
        "{with_times:?}"
    );
    for (list, expected) in [
        (LIST, &b"DLOGS\0Fgeneral.json\t"[..]),
        (LIST_WITH_TIME, b"DLOGS\t0\0Fgeneral.json\t"),
    ] {
        let (opcode, root) = client.with_path(&mut bench, list, "/");
        assert!(opcode == ACK && root.starts_with(expected), "{root:?}");
    }
    assert_eq!(client.with_path(&mut bench, LIST, "/etc"), (NAK, vec![NOT_FOUND]));
    assert_eq!(client.one(&mut bench, LIST, 0, 0, &[]), (NAK, vec![INVALID_SIZE]));
}

#[test]
fn a_log_is_read_whole_in_spite_of_losses() {
    for (size, bytes) in [(0, 239), (1, 239), (80 * 30, 80), (100_000, 239), (100_001, 80)] {
        let mut bench = Bench::new(&[500, size]);
        let whole = Client::new(GROUND_STATION).get(&mut bench, "/APM/LOGS/00000004.BIN", bytes);
        assert!(whole == bench.files[1].1, "{size} in {bytes}");
    }
}

/// As ArduPilot and PX4 compute that of a file.
fn checksum(bytes: &[u8]) -> u32 {
    bytes.iter().fold(0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte), |crc, _| {
            (crc >> 1) ^ (0xEDB8_8320 * (crc & 1))
        })
    })
}

#[test]
fn the_size_of_a_log_is_known_when_it_is_open_and_its_checksum_is_that_of_ardupilot() {
    let mut bench = Bench::new(&[0x0001_0203]);
    let crc = checksum(&bench.files[0].1);
    let mut client = Client::new(GROUND_STATION);
    for (opcode, answer) in [(OPEN, vec![3, 2, 1, 0]), (CHECKSUM, crc.to_le_bytes().to_vec())] {
        assert_eq!(
            client.with_path(&mut bench, opcode, "/LOGS/00000003.BIN"),
            (ACK, answer)
        );
    }
    let unknown = client.with_path(&mut bench, CHECKSUM, "/LOGS/00000009.BIN");
    assert_eq!(unknown, (NAK, vec![NOT_FOUND]));
}

/// The text behind `key` in a JSON file, up to one of `ends`.
fn json_value<'a>(json: &'a str, key: &str, ends: [char; 2]) -> &'a str {
    let (_, rest) = json.split_once(key).expect("it has the key");
    rest.split(ends).next().expect("a value")
}

/// As QGroundControl reads them: the address of the first file by COMPONENT_METADATA, in it that of the second.
fn read_descriptions(bench: &mut Bench) -> Vec<u8> {
    let mut client = Client::new(GROUND_STATION);
    let sent = bench.ask(&command_long(REQUEST_MESSAGE, COMPONENT_METADATA as f32));
    let [metadata] = of_message(&sent, COMPONENT_METADATA)[..] else {
        panic!("{sent:?}");
    };
    assert_eq!(metadata.text(8, 100), "mftp://general.json");
    let general = client.get(bench, "/general.json", 80);
    assert_eq!(metadata.u32(4), checksum(&general));
    let general = String::from_utf8(general).expect("text");
    assert_eq!(json_value(&general, "\"type\":", [',', '}']), "1");
    let uri = json_value(&general, "\"uri\":\"", ['"', '}']);
    let path = uri.strip_prefix("mftp:/").expect("an address of MAVLink FTP");
    let descriptions = client.get(bench, path, 239);
    let crc = json_value(&general, "\"fileCrc\":", [',', '}']);
    assert_eq!(crc, checksum(&descriptions).to_string());
    descriptions
}

#[test]
fn descriptions_of_the_parameters_are_read_also_while_armed() {
    let written = fs::read(repository().join("docs/parameters.json.xz")).expect("it is there");
    let mut bench = Bench::new(&[]);
    assert!(read_descriptions(&mut bench) == written);
    bench.arm();
    assert!(read_descriptions(&mut bench) == written);
}

#[test]
fn arming_does_not_end_the_reading_of_descriptions() {
    let mut bench = Bench::new(&[]);
    let mut client = Client::new(GROUND_STATION);
    assert_eq!(client.with_path(&mut bench, OPEN, "/parameters.json.xz").0, ACK);
    bench.handle(&client.request(BURST, 100, 0, &[]));
    assert_eq!(bench.sent_at_most(5).len(), 5);
    bench.arm();
    let rest = client.answers(&bench.sent());
    let last = rest.last().expect("the end of the file");
    assert_eq!((last.opcode, &last.data[..]), (NAK, &[END_OF_FILE][..]));
    assert_eq!(client.one(&mut bench, READ, 90, 0, &[]).0, ACK);
}

#[test]
fn every_parameter_is_read_at_once() {
    let mut bench = Bench::new(&[]);
    let whole = Client::new(GROUND_STATION).get(&mut bench, "@PARAM/param.pck?withdefaults=1", 80);
    let count = bench.parameters.listed_count() as u16;
    assert_eq!(whole[..2], 0x671cu16.to_le_bytes());
    assert_eq!(whole[2..6], [count.to_le_bytes(), count.to_le_bytes()].concat());
}

#[test]
fn a_file_of_parameters_ends_when_other_ones_are_listed() {
    let mut bench = Bench::new(&[]);
    let mut client = Client::new(GROUND_STATION);
    assert_eq!(client.with_path(&mut bench, OPEN, "@PARAM/param.pck").0, ACK);
    assert_eq!(client.one(&mut bench, READ, 80, 0, &[]).0, ACK);
    // A value leaves the list as it is.
    bench.parameters.set(VehicleParameter::Sr0Extra1, 4.0).unwrap();
    assert_eq!(client.one(&mut bench, READ, 80, 80, &[]).0, ACK);
    bench
        .parameters
        .set(BatteryParameter::Monitor.of(Pack::Second), 4.0)
        .unwrap();
    for opcode in [READ, BURST] {
        let ended = client.one(&mut bench, opcode, 80, 160, &[]);
        assert_eq!(ended, (NAK, vec![NOT_FOUND]));
    }
    client.get(&mut bench, "@PARAM/param.pck", 80);
}

#[test]
fn a_file_of_parameters_is_announced_as_a_list() {
    let mut bench = Bench::new(&[]);
    let client = Client::new(GROUND_STATION);
    let open = client.request(OPEN, 16, 0, b"@PARAM/param.pck");
    assert_eq!(bench.handle(&open), [Event::ListRequested]);
}

/// A file as MAVProxy packs it, of numbers with a fraction.
pub fn packed(values: &[(&str, f32)]) -> Vec<u8> {
    const FLOAT: u8 = 4;
    let mut records = Vec::new();
    for (name, value) in values {
        records.extend([FLOAT, (name.len() as u8 - 1) << 4]);
        records.extend(name.as_bytes());
        records.extend(value.to_le_bytes());
    }
    let header = [0x671b, values.len() as u16, 6 + records.len() as u16].map(u16::to_le_bytes);
    [header.concat(), records].concat()
}

const TWO: [(&str, f32); 2] = [("BATT_VLT_OFFSET", 0.5), ("SR0_EXTRA1", 7.0)];

#[test]
fn parameters_are_written_in_spite_of_losses() {
    let mut bench = Bench::new(&[]);
    let mut client = Client::new(GROUND_STATION);
    let file = packed(&TWO);
    assert_eq!(
        client.with_path(&mut bench, CREATE, "@PARAM/param.pck"),
        (ACK, vec![])
    );
    // A block that comes too early is not answered; of the first one the answer is lost.
    for (place, is_answered) in [
        (1, false),
        (0, true),
        (0, true),
        (2, false),
        (1, true),
        (2, true),
        (4, false),
        (3, true),
        (4, true),
    ] {
        let block = file.chunks(10).nth(place).expect("there is this block");
        let offset = place as u32 * 10;
        let answers = client.ask(&mut bench, WRITE, block.len() as u8, offset, block);
        let answers: Vec<_> = answers
            .iter()
            .map(|answer| (answer.opcode, answer.offset))
            .collect();
        assert_eq!(
            answers,
            Vec::from_iter(is_answered.then_some((ACK, offset))),
            "block {place}"
        );
    }
    assert_eq!(client.one(&mut bench, TERMINATE, 0, 0, &[]), (ACK, vec![]));
    assert_eq!(bench.parameters.get(EXTRA1), 7.0);
    assert_eq!(
        bench.parameters.get(BatteryParameter::VltOffset.of(Pack::First)),
        0.5
    );
    assert!(bench.parameters.next_unsaved().is_some());
}

#[test]
fn a_file_of_parameters_that_is_cut_short_fails_at_its_end_also_when_asked_again() {
    let mut bench = Bench::new(&[]);
    let mut client = Client::new(GROUND_STATION);
    let file = packed(&TWO);
    client.with_path(&mut bench, CREATE, "@PARAM/param.pck");
    let length = file.len() as u8 - 1;
    client.one(&mut bench, WRITE, length, 0, &file[..usize::from(length)]);
    assert_eq!(client.one(&mut bench, TERMINATE, 0, 0, &[]), (NAK, vec![FAIL]));
    client.sequence = client.sequence.wrapping_sub(1);
    assert_eq!(client.one(&mut bench, TERMINATE, 0, 0, &[]), (NAK, vec![FAIL]));
    assert_eq!(
        client.one(&mut bench, WRITE, 1, 0, &[1]),
        (NAK, vec![INVALID_SESSION])
    );
}

#[test]
fn parameters_that_were_not_set_are_reported() {
    let mut bench = Bench::new(&[]);
    let client = Client::new(GROUND_STATION);
    let file = packed(&[TWO[0], ("SR0_EXTRA1", 127.0)]);
    bench.ask(&client.request(CREATE, 16, 0, b"@PARAM/param.pck"));
    let events = bench.handle(&client.request(WRITE, file.len() as u8, 0, &file));
    assert_eq!(events, [Event::ParametersSet]);
    let texts = bench.texts(&client.request(TERMINATE, 0, 0, &[]));
    assert_eq!(texts, ["Parameters not set: SR0_EXTRA1"]);
}

/// A file with a new system id as the first of many parameters.
fn with_system_id() -> Vec<u8> {
    let names = Pack::ALL.map(|pack| BatteryParameter::FsCrtAct.of(pack).name());
    let mut values = vec![("SYSID_THISMAV", 42.0)];
    values.extend(names.iter().map(|name| (name.as_str(), 1.0)));
    values.push(TWO[1]);
    packed(&values)
}

#[test]
fn a_new_system_id_takes_effect_when_the_session_of_its_file_ends() {
    for end in [TERMINATE, RESET] {
        let mut bench = Bench::new(&[]);
        let mut client = Client::new(GROUND_STATION);
        let file = with_system_id();
        client.with_path(&mut bench, CREATE, "@PARAM/param.pck");
        for (place, block) in file.chunks(80).enumerate() {
            let written = client.one(&mut bench, WRITE, block.len() as u8, place as u32 * 80, block);
            assert_eq!(written, (ACK, vec![]), "block {place}");
        }
        assert_eq!(bench.parameters.get(VehicleParameter::SysidThismav), 1.0);
        let sent = bench.ask(&client.request(end, 0, 0, &[]));
        // The station waits for an answer of the system that it has asked.
        assert_eq!(sent.iter().map(|frame| frame.system_id).collect::<Vec<_>>(), [1]);
        assert_eq!(client.answers(&sent)[0].opcode, ACK);
        assert_eq!(bench.parameters.get(EXTRA1), 7.0);
        assert_eq!(bench.parameters.get(VehicleParameter::SysidThismav), 42.0);
        bench.now_us += SECOND;
        bench.post_due();
        assert!(bench.sent().iter().all(|frame| frame.system_id == 42));
    }
}

#[test]
fn a_file_that_did_not_come_whole_leaves_the_system_id() {
    for end in [TERMINATE, RESET, CREATE] {
        let mut bench = Bench::new(&[]);
        let mut client = Client::new(GROUND_STATION);
        let file = with_system_id();
        client.with_path(&mut bench, CREATE, "@PARAM/param.pck");
        client.one(&mut bench, WRITE, 80, 0, &file[..80]);
        client.with_path(&mut bench, end, "@PARAM/param.pck");
        assert_eq!(bench.parameters.get(VehicleParameter::SysidThismav), 1.0);
    }
}

#[test]
fn a_repeated_request_is_answered_alike_and_not_twice_while_it_is_served() {
    let mut bench = Bench::new(&[900]);
    let client = Client::new(GROUND_STATION);
    for request in [
        client.request(OPEN, 18, 0, b"/LOGS/00000003.BIN"),
        client.request(READ, 100, 850, &[]),
        client.request(CHECKSUM, 18, 0, b"/LOGS/00000003.BIN"),
        client.request(LIST, 5, 0, b"/LOGS"),
        client.request(BURST, 239, 0, &[]),
        client.request(TERMINATE, 0, 0, &[]),
    ] {
        let first = client.answers(&bench.ask(&request));
        assert!(!first.is_empty());
        assert_eq!(client.answers(&bench.ask(&request)), first);
        if ![OPEN, TERMINATE].contains(&first[0].request) {
            bench.handle(&request);
            assert_eq!(client.answers(&bench.ask(&request)), first);
        }
    }
}

#[test]
fn one_station_has_the_session_of_a_link_until_it_is_silent() {
    let mut bench = Bench::new(&[900]);
    let (mut first, mut second) = (Client::new(GROUND_STATION), Client::new(OTHER_STATION));
    let path = "/LOGS/00000003.BIN";
    assert_eq!(first.with_path(&mut bench, OPEN, path).0, ACK);
    assert_eq!(second.with_path(&mut bench, OPEN, path), (NAK, vec![NO_SESSIONS]));
    assert_eq!(
        second.one(&mut bench, READ, 90, 0, &[]),
        (NAK, vec![INVALID_SESSION])
    );
    second.one(&mut bench, TERMINATE, 0, 0, &[]);
    second.one(&mut bench, RESET, 0, 0, &[]);
    bench.now_us = 9 * SECOND;
    assert_eq!(first.one(&mut bench, READ, 90, 0, &[]).0, ACK);
    bench.now_us = 18 * SECOND;
    assert_eq!(second.with_path(&mut bench, OPEN, path), (NAK, vec![NO_SESSIONS]));
    bench.now_us = 19 * SECOND;
    assert_eq!(second.with_path(&mut bench, OPEN, path).0, ACK);
    assert_eq!(
        first.one(&mut bench, READ, 90, 0, &[]),
        (NAK, vec![INVALID_SESSION])
    );
    assert_eq!(second.one(&mut bench, RESET, 0, 0, &[]), (ACK, vec![]));
    assert_eq!(first.with_path(&mut bench, OPEN, path).0, ACK);
}

#[test]
fn what_is_not_possible_is_refused_with_its_reason() {
    let mut bench = Bench::new(&[900]);
    let mut client = Client::new(GROUND_STATION);
    for (opcode, path, error) in [
        (OPEN, "/LOGS/00000004.BIN", NOT_FOUND),
        (OPEN, "/LOGS", NOT_FOUND),
        (OPEN, "/etc/passwd", NOT_FOUND),
        (OPEN, "@PARAM/param.pck?start=60000", FAIL),
        (CREATE, "/LOGS/00000003.BIN", PROTECTED),
        (CREATE, "/new", PROTECTED),
        (CREATE, "/general.json", PROTECTED),
        (LIST, "/general.json", NOT_FOUND),
        (CHECKSUM, "/general.json", FAIL),
        (8, "/LOGS/00000003.BIN", PROTECTED),
        (13, "/LOGS/00000003.BIN", PROTECTED),
        (READ, "x", INVALID_SESSION),
        (BURST, "x", INVALID_SESSION),
        (WRITE, "x", INVALID_SESSION),
        (17, "x", UNKNOWN_COMMAND),
        (127, "x", UNKNOWN_COMMAND),
    ] {
        let answer = client.with_path(&mut bench, opcode, path);
        assert_eq!(answer, (NAK, vec![error]), "{opcode} {path}");
    }
    assert_eq!(
        client.one(&mut bench, OPEN, 240, 0, &[b'/'; 200]),
        (NAK, vec![INVALID_SIZE])
    );
    assert_eq!(client.one(&mut bench, 0, 0, 0, &[]), (ACK, vec![]));
    for opcode in [ACK, NAK, 255] {
        assert!(client.ask(&mut bench, opcode, 0, 0, &[]).is_empty());
    }
}

#[test]
fn a_burst_over_a_slow_line_ends_before_its_station_gives_up() {
    // Of a message with 239 bytes, at 57600 Bd.
    const MESSAGE_US: u64 = 46_000;
    let mut bench = Bench::new(&[100_000]);
    let mut client = Client::new(GROUND_STATION);
    assert_eq!(client.with_path(&mut bench, OPEN, "/LOGS/00000003.BIN").0, ACK);
    let began_us = bench.now_us;
    bench.handle(&client.request(BURST, 239, 0, &[]));
    let mut sent = Vec::new();
    while let Some(frame) = bench.next_frame() {
        sent.extend(frame.into_iter().map(|byte| (0, byte)));
        bench.now_us += MESSAGE_US;
    }
    let answers = client.answers(&frames(&sent));
    let complete = answers.iter().position(|answer| answer.is_complete);
    assert_eq!(complete, Some(answers.len() - 1));
    let took_us = bench.now_us - began_us;
    assert!((1_800_000..2_300_000).contains(&took_us), "{took_us}");
}

#[test]
fn while_armed_files_are_not_opened_and_arming_closes_one() {
    let mut bench = Bench::new(&[900_000]);
    let mut client = Client::new(GROUND_STATION);
    let path = "/LOGS/00000003.BIN";
    assert_eq!(client.with_path(&mut bench, OPEN, path).0, ACK);
    bench.handle(&client.request(BURST, 239, 0, &[]));
    assert_eq!(bench.sent_at_most(5).len(), 5);
    bench.arm();
    assert!(bench.sent().len() <= 1, "what was built leaves");
    for (opcode, path, error) in [
        (OPEN, path, FAIL),
        (CHECKSUM, path, FAIL),
        (OPEN, "@PARAM/param.pck", NOT_FOUND),
        (CREATE, "@PARAM/param.pck", FAIL),
    ] {
        assert_eq!(client.with_path(&mut bench, opcode, path), (NAK, vec![error]));
    }
    assert_eq!(
        client.one(&mut bench, READ, 90, 0, &[]),
        (NAK, vec![INVALID_SESSION])
    );
    assert_eq!(client.with_path(&mut bench, LIST, "/LOGS").0, ACK);
}

#[test]
fn both_protocols_at_once_deliver_whole_files() {
    let mut bench = Bench::new(&[20_000]);
    let mut client = Client::new(OTHER_STATION);
    assert_eq!(client.with_path(&mut bench, OPEN, "/LOGS/00000003.BIN").0, ACK);
    bench.handle(&log_data(1, 0, u32::MAX));
    let sent = bench.ask(&client.request(BURST, 239, 0, &[]));
    let mut whole = vec![0; 20_000];
    put(&mut whole, &sent);
    assert!(whole == bench.files[0].1);
    let read: Vec<u8> = client
        .answers(&sent)
        .into_iter()
        .filter(|answer| answer.opcode == ACK)
        .flat_map(|answer| answer.data)
        .collect();
    assert!(read == bench.files[0].1);
}

fn any_request() -> impl Strategy<Value = (u8, u8, u8, u32, Vec<u8>)> {
    let path = prop_oneof![
        Just(b"/LOGS/00000003.BIN".to_vec()),
        Just(b"/LOGS".to_vec()),
        Just(b"@PARAM/param.pck?withdefaults=1".to_vec()),
        prop::collection::vec(any::<u8>(), 0..239),
    ];
    let offset = prop_oneof![0u32..2000, any::<u32>()];
    (0u8..18, 0u8..3, path, offset, any::<u8>()).prop_map(|(opcode, session, data, offset, size)| {
        // Most name the size that they have.
        let size = if size < 200 { data.len() as u8 } else { size };
        (opcode, session, size, offset, data)
    })
}

proptest! {
    #[test]
    fn any_requests_are_answered_in_the_format(
        requests in prop::collection::vec((any_request(), any::<bool>(), 0usize..20), 1..30),
    ) {
        let mut bench = Bench::new(&[1000]);
        let mut clients = [Client::new(GROUND_STATION), Client::new(OTHER_STATION)];
        for ((opcode, session, size, offset, data), is_other, messages) in requests {
            let client = &mut clients[usize::from(is_other)];
            client.session = session;
            client.sequence = client.sequence.wrapping_add(1);
            bench.handle(&client.request(opcode, size, offset, &data));
            for frame in bench.sent_at_most(messages) {
                if frame.message_id != FILE_TRANSFER_PROTOCOL {
                    continue;
                }
                let (opcode, size) = (frame.u8(6), frame.u8(7));
                prop_assert!([ACK, NAK].contains(&opcode));
                prop_assert!(size <= 239);
                prop_assert!(frame.payload_len() <= 15 + usize::from(size));
                prop_assert!(opcode == ACK || size == 1);
            }
        }
    }
}
