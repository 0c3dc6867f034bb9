//! The heads of answers, and their status codes.

use core::fmt::{self, Write};

use base64ct::{Base64, Encoding};
use sha1::{Digest, Sha1};

/// Suffix with which a key is hashed (RFC 6455).
const WEB_SOCKET_ID: &[u8] = b"258EAFA5-E914-47DA-95CA-C5AB0DC85B11";

/// In each answer. The page loads nothing from elsewhere, and no other page can show it in a frame, where a touch on something
/// else would press its buttons.
const ALWAYS: &str = "\
Connection: close\r\n\
Cache-Control: no-cache\r\n\
Content-Security-Policy: default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; \
connect-src 'self' ws:; base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\
Cross-Origin-Resource-Policy: same-origin\r\n\
X-Content-Type-Options: nosniff\r\n";

/// A status of HTTP (RFC 9110).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Status {
    SwitchingProtocols,
    Ok,
    PartialContent,
    NotModified,
    BadRequest,
    Forbidden,
    NotFound,
    MethodNotAllowed,
    RequestTimeout,
    Conflict,
    RangeNotSatisfiable,
    MisdirectedRequest,
    HeaderFieldsTooLarge,
    ServiceUnavailable,
}

impl Status {
    /// Its number and name, as the first line of an answer has them.
    pub fn line(self) -> &'static str {
        match self {
            Self::SwitchingProtocols => "101 Switching Protocols",
            Self::Ok => "200 OK",
            Self::PartialContent => "206 Partial Content",
            Self::NotModified => "304 Not Modified",
            Self::BadRequest => "400 Bad Request",
            Self::Forbidden => "403 Forbidden",
            Self::NotFound => "404 Not Found",
            Self::MethodNotAllowed => "405 Method Not Allowed",
            Self::RequestTimeout => "408 Request Timeout",
            Self::Conflict => "409 Conflict",
            Self::RangeNotSatisfiable => "416 Range Not Satisfiable",
            Self::MisdirectedRequest => "421 Misdirected Request",
            Self::HeaderFieldsTooLarge => "431 Request Header Fields Too Large",
            Self::ServiceUnavailable => "503 Service Unavailable",
        }
    }
}

/// Why a request is refused: a status, and a sentence for the user.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Refusal {
    pub status: Status,
    pub reason: &'static str,
}

/// A refusal with this status, for this reason.
pub const fn refusal(status: Status, reason: &'static str) -> Refusal {
    Refusal { status, reason }
}

/// Writes the head of an answer. What does not fit is left out: all heads fit.
pub struct HeadWriter<'a> {
    buffer: &'a mut [u8],
    length: usize,
}

impl<'a> HeadWriter<'a> {
    /// One of an answer with this status.
    pub fn new(buffer: &'a mut [u8], status: Status) -> Self {
        let mut head = Self { buffer, length: 0 };
        head.add(format_args!("HTTP/1.1 {}\r\n", status.line()));
        if status != Status::SwitchingProtocols {
            head.add(format_args!("{ALWAYS}"));
        }
        head
    }

    /// Adds a header.
    pub fn header(mut self, name: &str, value: impl fmt::Display) -> Self {
        self.add(format_args!("{name}: {value}\r\n"));
        self
    }

    fn add(&mut self, text: fmt::Arguments<'_>) {
        let _ = self.write_fmt(text);
    }

    /// The head, with the empty line that ends it.
    pub fn end(mut self) -> &'a [u8] {
        self.add(format_args!("\r\n"));
        let Self { buffer, length } = self;
        buffer.get(..length).unwrap_or_default()
    }
}

impl Write for HeadWriter<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        let end = self.length + text.len();
        let free = self.buffer.get_mut(self.length..end).ok_or(fmt::Error)?;
        free.copy_from_slice(text.as_bytes());
        self.length = end;
        Ok(())
    }
}

/// Accepts a WebSocket with this key: it shows that the request was understood.
pub fn accept_key(key: &str) -> [u8; 28] {
    let hash = Sha1::new()
        .chain_update(key)
        .chain_update(WEB_SOCKET_ID)
        .finalize();
    let mut text = [0; 28];
    // It has just this size.
    let _ = Base64::encode(&hash, &mut text);
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn key_is_accepted_as_in_the_standard() {
        assert_eq!(
            accept_key("dGhlIHNhbXBsZSBub25jZQ=="),
            *b"s3pPLMBiTxaQ9kYGzzhZRbK+xOo="
        );
    }
}
