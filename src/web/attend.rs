//! Serves a connection.

use core::fmt::Write as _;

use embassy_time::{Duration, with_timeout};
use embedded_io_async::Write;
use heapless::String;

use super::answer::{Answer, LogPart, answer, list_entry};
use super::places::{Places, WebSocketPlace};
use super::request::{Method, Request};
use super::status::{Refusal, Status, refusal};
use crate::recorder::LogSource;
use crate::tasks::{ByteSource, Shared, read_file};

/// The shortest buffer: it takes the head of a request, of which browsers send 400 to 700 bytes, the head of an answer, and the
/// pieces of a log.
pub const BUFFER_BYTES: usize = 1024;

/// A request comes within this time. Browsers also open connections in advance, and send nothing.
const REQUEST_PATIENCE: Duration = Duration::from_secs(3);

/// So long who reads an answer may take no byte of it.
const READER_PATIENCE: Duration = Duration::from_secs(12);

const HEAD_END: &[u8] = b"\r\n\r\n";

macro_rules! no_place {
    () => {
        "The rover serves two browsers at a time: close another one, or try again."
    };
}

const NO_PLACE: Refusal = refusal(Status::ServiceUnavailable, no_place!());

/// The same without a buffer.
const NO_CONNECTION: &str = concat!(
    "HTTP/1.1 503 Service Unavailable\r\nConnection: close\r\nRetry-After: 1\r\n",
    "Content-Type: text/plain; charset=utf-8\r\n\r\n",
    no_place!()
);

/// What a server serves.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    /// The core.
    pub shared: &'a Shared,
    /// What is recorded.
    pub logs: &'a dyn LogSource,
    /// Who is served at a time.
    pub places: &'a Places,
}

/// What became of a connection.
pub enum Attended<'a> {
    /// It is to be closed.
    Answered,
    /// It is a WebSocket now.
    WebSocket(WebSocketPlace<'a>),
}

/// Why a request has not come whole.
enum NoHead {
    Closed,
    Refused(Refusal),
}

/// Reads the request of a connection to one of the `names` that are ours, and answers it, but for what follows on a WebSocket.
/// `buffer` has [`BUFFER_BYTES`] at least.
pub async fn attend<'a>(
    mut writer: impl Write,
    mut reader: impl ByteSource,
    buffer: &mut [u8],
    names: &[&str],
    site: Site<'a>,
) -> Attended<'a> {
    let request = match read_head(&mut reader, buffer).await {
        Ok(head) => Request::parse(head, names),
        Err(NoHead::Refused(refusal)) => Err(refusal),
        Err(NoHead::Closed) => return Attended::Answered,
    };
    match request {
        Ok(request) => serve(&request, &mut writer, buffer, site).await,
        Err(refusal) => {
            send_refusal(refusal, &mut writer, buffer).await;
            Attended::Answered
        }
    }
}

/// Says to who has connected that there is no place, whatever the request is.
pub async fn refuse(mut writer: impl Write) {
    // Who has left needs no answer.
    let _ = send(NO_CONNECTION.as_bytes(), &mut writer).await;
}

/// Reads the head of a request.
async fn read_head<'a>(reader: &mut impl ByteSource, buffer: &'a mut [u8]) -> Result<&'a [u8], NoHead> {
    let mut length = 0;
    let read = with_timeout(REQUEST_PATIENCE, read_to_end_of_head(reader, buffer, &mut length)).await;
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
        // What ends the head may have begun before.
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

/// Answers a request.
async fn serve<'a>(
    request: &Request,
    writer: &mut impl Write,
    buffer: &mut [u8],
    site: Site<'a>,
) -> Attended<'a> {
    let answer = site.shared.with(|autopilot| answer(request, autopilot));
    if let Answer::WebSocket(_) = answer {
        let Some(place) = site.places.take_web_socket(request.sender).await else {
            send_refusal(NO_PLACE, writer, buffer).await;
            return Attended::Answered;
        };
        return match send(answer.head(buffer), writer).await {
            Ok(()) => Attended::WebSocket(place),
            Err(Gone) => Attended::Answered,
        };
    }
    if let Answer::Refused(refusal) = answer {
        send_refusal(refusal, writer, buffer).await;
    } else if let Some(_place) = site.places.take_file() {
        // Who has left needs no answer.
        let _ = send_answer(&answer, request.method, writer, buffer, site).await;
    } else {
        send_refusal(NO_PLACE, writer, buffer).await;
    }
    Attended::Answered
}

/// Who reads has left, or takes nothing.
struct Gone;

async fn send(bytes: &[u8], writer: &mut impl Write) -> Result<(), Gone> {
    let sent = with_timeout(READER_PATIENCE, writer.write_all(bytes)).await;
    match sent {
        Ok(Ok(())) => Ok(()),
        Ok(Err(_)) | Err(_) => Err(Gone),
    }
}

async fn send_refusal(refusal: Refusal, writer: &mut impl Write, buffer: &mut [u8]) {
    let head = Answer::Refused(refusal);
    if send(head.head(buffer), writer).await.is_ok() {
        let _ = send(refusal.reason.as_bytes(), writer).await;
    }
}

async fn send_answer(
    answer: &Answer,
    method: Method,
    writer: &mut impl Write,
    buffer: &mut [u8],
    site: Site<'_>,
) -> Result<(), Gone> {
    send(answer.head(buffer), writer).await?;
    match (answer, method) {
        (Answer::File(file), Method::Get) => {
            // Piece by piece: each may take its time.
            for piece in file.content.chunks(BUFFER_BYTES) {
                send(piece, writer).await?;
            }
            Ok(())
        }
        (Answer::LogList, Method::Get) => send_list(writer, site.shared).await,
        (Answer::Log(part), Method::Get) => send_log(part, writer, buffer, site).await,
        _ => Ok(()),
    }
}

/// The list as JSON, each entry a chunk: meanwhile logs grow, and come and go.
async fn send_list(writer: &mut impl Write, shared: &Shared) -> Result<(), Gone> {
    send_chunk("[", writer).await?;
    let mut place = 0;
    while let Some(entry) = shared.with(|autopilot| list_entry(place, autopilot)) {
        send_chunk(&entry, writer).await?;
        place += 1;
    }
    send_chunk("\n]\n", writer).await?;
    send_chunk("", writer).await
}

/// An empty one is the end.
async fn send_chunk(text: &str, writer: &mut impl Write) -> Result<(), Gone> {
    let mut chunk: String<128> = String::new();
    // The longest fits.
    let _ = write!(chunk, "{:x}\r\n{text}\r\n", text.len());
    send(chunk.as_bytes(), writer).await
}

/// Ends early when the rover is armed, or the log is erased: who has got less than announced asks for the rest.
async fn send_log(
    part: &LogPart,
    writer: &mut impl Write,
    buffer: &mut [u8],
    site: Site<'_>,
) -> Result<(), Gone> {
    let mut offset = part.first;
    while offset < part.end {
        if site.shared.with(|autopilot| autopilot.system_state().is_armed()) {
            return Err(Gone);
        }
        let bytes = buffer.len().min((part.end - offset) as usize);
        let wanted = buffer.get_mut(..bytes).unwrap_or_default();
        let filled = read_file(part.file.number, offset, wanted, site.logs, site.shared);
        if filled == 0 {
            return Err(Gone);
        }
        send(buffer.get(..filled).unwrap_or_default(), writer).await?;
        offset += filled as u32;
    }
    Ok(())
}
