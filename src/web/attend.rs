//! Serves a connection.

use core::future::pending;

use embassy_futures::select::{Either, select};
use embassy_time::{Duration, with_timeout};
use embedded_io_async::Write;

use super::answer::{Answer, answer};
use super::content::Content;
use super::head::{Refusal, Status, refusal};
use super::places::{Place, Places, Purpose};
use super::request::{Method, Request};
use crate::recorder::LogSource;
use crate::system::LogReader;
use crate::tasks::{ByteSource, Shared};

/// The shortest buffer: it takes the head of a request, of which browsers send 400 to 700 bytes, the head of an answer, and the
/// pieces of a log.
pub const BUFFER_BYTES: usize = 1024;

/// A request comes within this time. Browsers also open connections in advance, and send nothing.
const REQUEST_PATIENCE: Duration = Duration::from_secs(3);

/// Write time-out of an answer.
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

/// Content of a server.
#[derive(Clone, Copy)]
pub struct Site<'a> {
    /// The core.
    pub shared: &'a Shared,
    /// The recorded files.
    pub logs: &'a dyn LogSource,
    /// Limit of connections that are served at a time.
    pub places: &'a Places,
}

/// Result of a connection.
pub enum Attended<'a> {
    /// It is to be closed.
    Answered,
    /// It is a WebSocket now.
    WebSocket(Place<'a>),
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
    let admitted = match request {
        Ok(request) => admit(&request, site).await,
        Err(refusal) => Admitted::refused(refusal),
    };
    // A client that has left needs no answer.
    let sent = send_answer(&admitted, &mut writer, buffer, site).await;
    match (admitted.answer, admitted.place, sent) {
        (Answer::WebSocket(_), Some(place), Some(())) => Attended::WebSocket(place),
        _ => Attended::Answered,
    }
}

/// Refuses a connection whatever its request is, because all others are in use.
pub async fn refuse(mut writer: impl Write, places: &Places) {
    places.end_stalled_files();
    // A client that has left needs no answer.
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

/// An answer to be sent, and the place that it needs if it is more than a sentence.
struct Admitted<'a> {
    answer: Answer,
    method: Method,
    place: Option<Place<'a>>,
}

impl Admitted<'_> {
    fn refused(refusal: Refusal) -> Self {
        Self {
            answer: Answer::Refused(refusal),
            method: Method::Get,
            place: None,
        }
    }
}

/// The answer to a request: a refusal if it needs a place and gets none.
async fn admit<'a>(request: &Request, site: Site<'a>) -> Admitted<'a> {
    let answer = site.shared.with(|autopilot| answer(request, autopilot));
    let purpose = match answer {
        Answer::Refused(refusal) => return Admitted::refused(refusal),
        Answer::WebSocket(_) => Purpose::WebSocket,
        _ => Purpose::File,
    };
    match site.places.take(purpose, request.sender).await {
        Some(place) => Admitted {
            answer,
            method: request.method,
            place: Some(place),
        },
        None => Admitted::refused(NO_PLACE),
    }
}

/// Sends `bytes`; `None` if the peer has left, or does not read.
async fn send(bytes: &[u8], writer: &mut impl Write) -> Option<()> {
    let sent = with_timeout(READER_PATIENCE, writer.write_all(bytes)).await;
    sent.ok()?.ok()
}

/// Sends an answer piece by piece, each of which may take its time; `None` if it ends early, as when its place is wanted.
async fn send_answer(
    admitted: &Admitted<'_>,
    writer: &mut impl Write,
    buffer: &mut [u8],
    site: Site<'_>,
) -> Option<()> {
    let Admitted {
        answer,
        method,
        place,
    } = admitted;
    // A log needs a place.
    let reader = LogReader::Browser(place.as_ref().map_or(0, |place| place.index as u8));
    let send_pieces = async {
        let mut content = Content::of(answer, *method);
        let mut bytes = answer.head(buffer).len();
        while bytes > 0 {
            send(buffer.get(..bytes).unwrap_or_default(), writer).await?;
            place.iter().for_each(Place::note_use);
            bytes = content.next_piece(buffer, reader, site.logs, site.shared);
        }
        Some(())
    };
    let is_wanted = async {
        match place {
            Some(place) => place.is_wanted().await,
            None => pending().await,
        }
    };
    match select(send_pieces, is_wanted).await {
        Either::First(sent) => sent,
        Either::Second(()) => None,
    }
}
