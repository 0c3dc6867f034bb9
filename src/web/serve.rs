//! Serves the request of a connection.

use core::future::pending;

use embassy_futures::select::{Either, select};
use embassy_time::{Duration, with_timeout};
use embedded_io_async::Write;

use super::answer::{Answer, answer};
use super::content::Content;
use super::head::{Refusal, Status, refusal};
use super::request::{Method, Request};
use super::slots::{Purpose, Slot, Slots};
use crate::recorder::LogSource;
use crate::system::LogReader;
use crate::tasks::{ByteSource, Shared};

/// The shortest buffer: it takes the head of a request, of which browsers send 400 to 700 bytes, the head of an answer, and the
/// pieces of a log.
pub const BUFFER_BYTES: usize = 1024;

/// Time-out of a request. Browsers also open connections in advance, and send nothing.
const REQUEST_TIMEOUT: Duration = Duration::from_secs(3);

/// Time-out of each write of an answer.
const WRITE_TIMEOUT: Duration = Duration::from_secs(12);

const HEAD_END: &[u8] = b"\r\n\r\n";

macro_rules! no_slot {
    () => {
        "The rover serves two browsers at a time: close another one, or try again."
    };
}

const NO_SLOT: Refusal = refusal(Status::ServiceUnavailable, no_slot!());

/// The answer without a free slot, for a connection without a buffer.
const NO_CONNECTION: &str = concat!(
    "HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nRetry-After: 1\r\n",
    "Content-Type: text/plain; charset=utf-8\r\n\r\n",
    no_slot!()
);

/// Content of a server.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    /// The core.
    pub shared: &'a Shared,
    /// The recorded files.
    pub logs: &'a dyn LogSource,
    /// Limits the connections that are served at a time.
    pub slots: &'a Slots,
}

/// Why a request has not come whole.
enum NoHead {
    Closed,
    Refused(Refusal),
}

/// Reads the request of a connection to one of the `names` that are ours, and answers it. `buffer` has [`BUFFER_BYTES`] at least.
///
/// Returns the slot of a connection that has become a WebSocket, for [`serve_web_socket`](super::serve_web_socket). Any other one is
/// to be closed.
pub async fn serve_request<'a>(
    mut writer: impl Write,
    mut reader: impl ByteSource,
    buffer: &mut [u8],
    names: &[&str],
    site: Site<'a>,
) -> Option<Slot<'a>> {
    let request = match read_head(&mut reader, buffer).await {
        Ok(head) => Request::parse(head, names),
        Err(NoHead::Refused(refusal)) => Err(refusal),
        Err(NoHead::Closed) => return None,
    };
    let response = match request {
        Ok(request) => respond(&request, site).await,
        Err(refusal) => Response::refused(refusal),
    };
    // A client that has left needs no answer.
    send_response(&response, &mut writer, buffer, site).await?;
    match response.answer {
        Answer::WebSocket(_) => response.slot,
        _ => None,
    }
}

/// Answers 503 to a connection whatever its request is, because all others are in use.
pub async fn refuse(mut writer: impl Write, slots: &Slots) {
    slots.end_stalled_files();
    // A client that has left needs no answer.
    let _ = send(NO_CONNECTION.as_bytes(), &mut writer).await;
}

/// Reads the head of a request.
async fn read_head<'a>(reader: &mut impl ByteSource, buffer: &'a mut [u8]) -> Result<&'a [u8], NoHead> {
    let mut length = 0;
    let read = with_timeout(REQUEST_TIMEOUT, read_to_end_of_head(reader, buffer, &mut length)).await;
    match read {
        Ok(Ok(())) => Ok(buffer.get(..length).unwrap_or_default()),
        Ok(Err(why)) => Err(why),
        Err(_) if length == 0 => Err(NoHead::Closed),
        Err(_) => Err(NoHead::Refused(refusal(
            Status::RequestTimeout,
            "The request has not come whole in time.",
        ))),
    }
}

async fn read_to_end_of_head(
    reader: &mut impl ByteSource,
    buffer: &mut [u8],
    length: &mut usize,
) -> Result<(), NoHead> {
    loop {
        let room = buffer.get_mut(*length..).unwrap_or_default();
        if room.is_empty() {
            let reason = "The request is too long.";
            return Err(NoHead::Refused(refusal(Status::HeaderFieldsTooLarge, reason)));
        }
        // The end of the head may have begun before.
        let searched = length.saturating_sub(HEAD_END.len() - 1);
        *length += reader.receive(room).await.map_err(|_| NoHead::Closed)?;
        let head = buffer.get(..*length).unwrap_or_default();
        if !head.first().is_some_and(u8::is_ascii_uppercase) {
            let reason = "This is no request of HTTP.";
            return Err(NoHead::Refused(refusal(Status::BadRequest, reason)));
        }
        let new = head.get(searched..).unwrap_or_default();
        if new.windows(HEAD_END.len()).any(|bytes| bytes == HEAD_END) {
            return Ok(());
        }
    }
}

/// An answer to be sent, and the slot that it needs if it is not a refusal.
struct Response<'a> {
    answer: Answer,
    method: Method,
    slot: Option<Slot<'a>>,
}

impl Response<'_> {
    fn refused(refusal: Refusal) -> Self {
        Self {
            answer: Answer::Refused(refusal),
            method: Method::Get,
            slot: None,
        }
    }
}

/// The answer to a request: a refusal if it needs a slot and gets none.
async fn respond<'a>(request: &Request, site: Site<'a>) -> Response<'a> {
    let answer = site.shared.with(|autopilot| answer(request, autopilot));
    let purpose = match answer {
        Answer::Refused(refusal) => return Response::refused(refusal),
        Answer::WebSocket(_) => Purpose::WebSocket,
        _ => Purpose::File,
    };
    match site.slots.take(purpose, request.sender).await {
        Some(slot) => Response {
            answer,
            method: request.method,
            slot: Some(slot),
        },
        None => Response::refused(NO_SLOT),
    }
}

/// Sends `bytes`; `None` if the peer has left, or does not read.
async fn send(bytes: &[u8], writer: &mut impl Write) -> Option<()> {
    let sent = with_timeout(WRITE_TIMEOUT, writer.write_all(bytes)).await;
    sent.ok()?.ok()
}

/// Sends an answer piece by piece, each with a time-out of its own; `None` if it ends early, as when its slot has to be released.
async fn send_response(
    response: &Response<'_>,
    writer: &mut impl Write,
    buffer: &mut [u8],
    site: Site<'_>,
) -> Option<()> {
    let Response { answer, method, slot } = response;
    // A log needs a slot.
    let reader = LogReader::Browser(slot.as_ref().map_or(0, |slot| slot.index as u8));
    let send_pieces = async {
        let mut content = Content::of(answer, *method);
        let mut bytes = answer.head(buffer).len();
        while bytes > 0 {
            send(buffer.get(..bytes).unwrap_or_default(), writer).await?;
            if let Some(slot) = slot {
                slot.note_use();
            }
            bytes = content.next_piece(buffer, reader, site.logs, site.shared);
        }
        Some(())
    };
    let release_requested = async {
        match slot {
            Some(slot) => slot.release_requested().await,
            None => pending().await,
        }
    };
    match select(send_pieces, release_requested).await {
        Either::First(sent) => sent,
        Either::Second(()) => None,
    }
}
