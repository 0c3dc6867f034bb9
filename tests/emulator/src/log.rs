//! The firmware's defmt log, decoded.

use std::fmt;

use defmt_decoder::{DecodeError, StreamDecoder, Table};

/// Severity of a log line, as defmt has them.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum LogLevel {
    /// `defmt::println!`: no level.
    Print,
    Trace,
    Debug,
    Info,
    Warn,
    Error,
}

/// One line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct LogLine {
    /// When the firmware published it, in microseconds since power-up.
    pub time_us: u64,
    pub level: LogLevel,
    pub text: String,
}

impl fmt::Display for LogLine {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "{:>12.6} {:?} {}",
            self.time_us as f64 / 1e6,
            self.level,
            self.text
        )
    }
}

/// What each frame ends with (rzCOBS, defmt's default encoding).
const FRAME_END: u8 = 0;

/// Decodes the byte stream of RTT channel 0.
pub struct LogDecoder {
    table: Option<&'static Table>,
    decoder: Option<Box<dyn StreamDecoder + Send + Sync>>,
    /// What the decoder was given of the frame that is not complete yet.
    begun: Vec<u8>,
    pub lines: Vec<LogLine>,
}

impl LogDecoder {
    pub fn new(table: Option<&'static Table>) -> Self {
        Self {
            table,
            decoder: table.map(Table::new_stream_decoder),
            begun: Vec::new(),
            lines: Vec::new(),
        }
    }

    /// A reset ends the stream in the middle of whatever was being written.
    pub fn restart(&mut self) {
        self.decoder = self.table.map(Table::new_stream_decoder);
        self.begun.clear();
    }

    pub fn receive(&mut self, bytes: &[u8], time_us: u64) {
        let Some(decoder) = &mut self.decoder else { return };
        decoder.received(bytes);
        self.begun.extend(bytes);
        if let Some(end) = self.begun.iter().rposition(|byte| *byte == FRAME_END) {
            self.begun.drain(..=end);
        }
        loop {
            match decoder.decode() {
                Ok(frame) => self.lines.push(LogLine {
                    time_us,
                    level: level(frame.level().map(|level| level.as_str())),
                    text: frame.display_message().to_string(),
                }),
                Err(DecodeError::UnexpectedEof) => return,
                Err(DecodeError::Malformed) => self.lines.push(malformed(time_us)),
            }
        }
    }
}

/// A decoder cannot be cloned: a new one receives the bytes that this one has of an incomplete frame.
impl Clone for LogDecoder {
    fn clone(&self) -> Self {
        let mut copy = Self::new(self.table);
        copy.receive(&self.begun, 0);
        copy.lines.clone_from(&self.lines);
        copy
    }
}

/// A frame that cannot be decoded is a line of its own, so that no test overlooks it.
fn malformed(time_us: u64) -> LogLine {
    LogLine {
        time_us,
        level: LogLevel::Error,
        text: "a malformed defmt frame".to_owned(),
    }
}

fn level(name: Option<&str>) -> LogLevel {
    match name {
        Some("trace") => LogLevel::Trace,
        Some("debug") => LogLevel::Debug,
        Some("info") => LogLevel::Info,
        Some("warn") => LogLevel::Warn,
        Some("error") => LogLevel::Error,
        _ => LogLevel::Print,
    }
}
