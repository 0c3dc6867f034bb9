//! A WebSocket as a link.

use core::cell::RefCell;

use edge_ws::FrameType;
use embassy_futures::select::{Either, select};
use embassy_time::{Duration, with_timeout};
use embedded_io_async::{Error, ErrorKind, ErrorType, Write};

use super::decoder::{End, FrameDecoder, header};
use super::request::Sender;
use super::slots::Slot;
use crate::mavlink::Access;
use crate::tasks::{ByteSource, CheckIn, Link, ReceiveError, Shared, serve_link};

/// Time-out of each write: a browser that takes nothing for this long has left. Until then it loses what its own link has no room
/// for.
const WRITE_TIMEOUT: Duration = Duration::from_secs(12);

/// Time-out of the close frame, which has the reason.
const CLOSE_TIMEOUT: Duration = Duration::from_millis(500);

/// Serves `link` on a connection that has become a WebSocket, until it is closed or its slot has to be released.
pub async fn serve_web_socket(
    mut writer: impl Write,
    reader: impl ByteSource,
    slot: &Slot<'_>,
    link: &Link<'_>,
    shared: &Shared,
    check_in: &CheckIn,
) {
    let decoder = RefCell::new(FrameDecoder::default());
    let transmitter = FrameWriter {
        writer: &mut writer,
        decoder: &decoder,
    };
    let receiver = FrameReader {
        reader,
        decoder: &decoder,
        link,
        slot,
        frames: 0,
    };
    let serving = serve_link(transmitter, receiver, shared, link, check_in);
    let end = match select(serving, slot.release_requested()).await {
        Either::First(()) => decoder.borrow().end(),
        Either::Second(()) => Some(End::SlotTaken),
    };
    if let Some(end) = end {
        let [high, low] = end.code().to_be_bytes();
        let mut close = header(FrameType::Close, 2);
        let _ = close.extend_from_slice(&[high, low]);
        let _ = with_timeout(CLOSE_TIMEOUT, writer.write_all(&close)).await;
    }
}

impl Sender {
    /// Access of the request's origin on a WebSocket.
    pub fn access(self) -> Access {
        match self {
            Self::Own => Access::Page,
            Self::Program => Access::Full,
            Self::Foreign => Access::Listen,
        }
    }
}

/// The way to a browser: each frame of MAVLink is a binary message.
struct FrameWriter<'a, W> {
    writer: &'a mut W,
    decoder: &'a RefCell<FrameDecoder>,
}

impl<W: Write> FrameWriter<'_, W> {
    async fn send(&mut self, bytes: &[u8]) -> Result<(), ErrorKind> {
        match with_timeout(WRITE_TIMEOUT, self.writer.write_all(bytes)).await {
            Ok(sent) => sent.map_err(|error| error.kind()),
            Err(_) => Err(ErrorKind::TimedOut),
        }
    }

    async fn send_pong(&mut self) -> Result<(), ErrorKind> {
        let pong = self.decoder.borrow_mut().take_pong();
        match pong {
            Some(pong) => self.send(&pong).await,
            None => Ok(()),
        }
    }
}

impl<W: Write> ErrorType for FrameWriter<'_, W> {
    type Error = ErrorKind;
}

impl<W: Write> Write for FrameWriter<'_, W> {
    /// Takes a whole frame of MAVLink.
    async fn write(&mut self, frame: &[u8]) -> Result<usize, ErrorKind> {
        self.send_pong().await?;
        let header = header(FrameType::Binary(false), frame.len());
        self.send(&header).await?;
        self.send(frame).await?;
        Ok(frame.len())
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        self.send_pong().await
    }
}

/// Frames from a browser.
struct FrameReader<'a, R> {
    reader: R,
    decoder: &'a RefCell<FrameDecoder>,
    link: &'a Link<'a>,
    slot: &'a Slot<'a>,
    /// MAVLink frames that were received, valid by their checksums.
    frames: u32,
}

impl<R: ByteSource> ByteSource for FrameReader<'_, R> {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        let frames = self.link.statistics().received.frames;
        if frames != self.frames {
            self.frames = frames;
            self.slot.note_use();
        }
        if self.decoder.borrow().end().is_some() {
            return Err(ReceiveError::Closed);
        }
        // A chunk without MAVLink is returned, too: the others have their turn, and what is behind it does not pass for new.
        let received = self.reader.receive(buffer).await?;
        let received = buffer.get_mut(..received).unwrap_or_default();
        let mut decoder = self.decoder.borrow_mut();
        let length = decoder.decode(received);
        if decoder.has_pong() {
            self.link.wake_writer();
        }
        Ok(length)
    }
}
