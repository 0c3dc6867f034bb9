//! Downloads of logs, as ground stations do them.

use crate::bench::{Bench, MILLISECOND, TestedVehicle};
use support::frames::{FILE_TRANSFER_PROTOCOL, Frame, LOG_DATA, LOG_ENTRY, of_message};
use support::requests::{ftp, ftp_open, log_data, log_list};

const STEP_US: u64 = 50 * MILLISECOND;

/// Enough for as many files as there can be.
const LIST_US: u64 = 600 * MILLISECOND;

/// A download that has not sent anything new for this long has ended.
const SILENCE_US: u64 = 1_000 * MILLISECOND;

/// The log files on the board: id and bytes.
pub fn list(bench: &mut Bench) -> Vec<(u16, u32)> {
    let entries = entries(bench).into_iter();
    entries.map(|entry| (entry.u16(8), entry.u32(4))).collect()
}

/// LOG_ENTRY of each file.
fn entries(bench: &mut Bench) -> Vec<Frame> {
    bench.run_until_silent();
    let position = bench.sent().len();
    bench.request(&log_list(0, u16::MAX));
    bench.run_for(LIST_US);
    let frames = bench.frames_from(position);
    let entries = of_message(&frames, LOG_ENTRY);
    assert!(!entries.is_empty(), "no list");
    // An empty list is one entry of no file.
    let of_files = entries.into_iter().filter(|entry| entry.u16(8) > 0);
    of_files.cloned().collect()
}

/// LOG_REQUEST_DATA, and what comes of it.
pub struct Download {
    id: u16,
    bytes: u32,
    /// Before it, this many bytes were sent.
    position: usize,
    pub began_us: u64,
}

impl Download {
    /// Requests this many bytes of a file, and all of them if there are more.
    pub fn begin(bench: &mut Bench, id: u16, bytes: u32) -> Self {
        bench.run_until_silent();
        let download = Self {
            id,
            bytes,
            position: bench.sent().len(),
            began_us: bench.time_us(),
        };
        bench.request(&log_data(id, 0, bytes));
        download
    }

    /// Everything that was sent since.
    pub fn frames(&self, bench: &mut Bench) -> Vec<Frame> {
        bench.frames_from(self.position)
    }

    /// Lets time pass until it ends, and returns everything that was sent since it began. `meanwhile` is done again and
    /// again.
    pub fn run(&self, bench: &mut Bench, mut meanwhile: impl FnMut(&mut Bench)) -> Vec<Frame> {
        let mut received = 0;
        let mut received_us = bench.time_us();
        loop {
            meanwhile(bench);
            bench.run_for(STEP_US);
            let frames = self.frames(bench);
            let data = of_message(&frames, LOG_DATA);
            if data.last().is_some_and(|frame| end_of(frame) >= self.bytes) {
                return frames;
            }
            if data.len() > received {
                (received, received_us) = (data.len(), bench.time_us());
            }
            let silent_us = bench.time_us() - received_us;
            assert!(silent_us < SILENCE_US, "{received} pieces of log {}", self.id);
        }
    }
}

/// Where the bytes of a LOG_DATA end in the file.
fn end_of(frame: &Frame) -> u32 {
    frame.u32(0) + u32::from(frame.u8(6))
}

/// What LOG_DATA messages carry, which follow one another.
pub fn content(frames: &[Frame]) -> Vec<u8> {
    let mut content = Vec::new();
    for frame in of_message(frames, LOG_DATA) {
        assert_eq!(frame.u32(0) as usize, content.len(), "a gap");
        let bytes = usize::from(frame.u8(6));
        content.extend((0..bytes).map(|place| frame.u8(7 + place)));
    }
    content
}

/// A whole file by LOG_REQUEST_DATA.
pub fn download(bench: &mut Bench, (id, bytes): (u16, u32)) -> Vec<u8> {
    let frames = Download::begin(bench, id, bytes).run(bench, |_| ());
    content(&frames)
}

const ACK: u8 = 128;
const NAK: u8 = 129;
const BURST: u8 = 15;
const END_OF_FILE: u8 = 6;
const MOST_BYTES: u8 = 239;

/// An answer of MAVLink FTP.
struct Answer<'a>(&'a Frame);

impl Answer<'_> {
    fn sequence(&self) -> u16 {
        self.0.u16(3)
    }

    fn opcode(&self) -> u8 {
        self.0.u8(6)
    }

    fn is_last(&self) -> bool {
        self.opcode() == NAK || self.0.u8(9) == 1
    }

    fn offset(&self) -> u32 {
        self.0.u32(11)
    }

    fn data(&self) -> Vec<u8> {
        let bytes = usize::from(self.0.u8(7));
        (0..bytes).map(|place| self.0.u8(15 + place)).collect()
    }
}

/// A whole file by MAVLink FTP, in bursts.
pub fn get(bench: &mut Bench, path: &str) -> Vec<u8> {
    let answers = bench.ask(&ftp_open(1, path));
    let opened = of_message(&answers, FILE_TRANSFER_PROTOCOL);
    assert_eq!(Answer(opened[0]).opcode(), ACK, "{path}");
    let mut sequence = Answer(opened[0]).sequence();
    let mut content = Vec::new();
    loop {
        bench.run_until_silent();
        let position = bench.sent().len();
        sequence = sequence.wrapping_add(1);
        bench.request(&ftp(sequence, BURST, MOST_BYTES, content.len() as u32, &[]));
        let frames = burst(bench, position);
        let answers = of_message(&frames, FILE_TRANSFER_PROTOCOL);
        for answer in answers.into_iter().map(Answer) {
            sequence = answer.sequence();
            if answer.opcode() == NAK {
                assert_eq!(answer.data(), [END_OF_FILE]);
                return content;
            }
            assert_eq!(answer.offset() as usize, content.len(), "a gap");
            content.extend(answer.data());
        }
    }
}

/// Lets time pass until the last answer to a burst.
fn burst(bench: &mut Bench, position: usize) -> Vec<Frame> {
    for _ in 0..200 {
        bench.run_for(STEP_US);
        let frames = bench.frames_from(position);
        let answers = of_message(&frames, FILE_TRANSFER_PROTOCOL);
        if answers.last().is_some_and(|frame| Answer(frame).is_last()) {
            return frames;
        }
    }
    panic!("the burst does not end");
}
