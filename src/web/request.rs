//! Requests of browsers, from their heads.

use heapless::String;
use httparse::{EMPTY_HEADER, Header};

use super::byte_range::ByteRange;
use super::head::{Refusal, Status, accept_key, refusal};

/// Browsers send up to 17.
const MAX_HEADERS: usize = 32;

/// More than our own tags have.
pub const TAG_BYTES: usize = 24;

/// The base64 of 16 bytes.
const KEY_BYTES: usize = 24;

/// The only version of WebSocket (RFC 6455).
const WEB_SOCKET_VERSION: &str = "13";

const EXTENSION: &str = ".BIN";

const SCHEME: &str = "http://";

/// Origin of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// Our page, in a browser.
    Own,
    /// No page: browsers state an origin with each WebSocket.
    Program,
    /// A page of someone else, in a browser that reaches us.
    Foreign,
}

/// Wanted part of the answer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Method {
    Get,
    /// The head alone.
    Head,
}

/// Subject of a request.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Target {
    Page,
    Parameters,
    LogList,
    /// The log file with this number, if there is one.
    Log(u16),
    /// To be a link from now on; has the key that accepts it.
    WebSocket([u8; 28]),
}

/// The tag of a file that the sender has already.
pub type Tag = String<TAG_BYTES>;

/// A request that is understood.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Request {
    pub method: Method,
    pub sender: Sender,
    pub target: Target,
    /// The tag of the file that the sender has: the whole, or of a log a part.
    pub has: Option<Tag>,
    pub range: Option<ByteRange>,
}

/// The headers of a request.
struct Headers<'a>(&'a [Header<'a>]);

impl<'a> Headers<'a> {
    fn all(&self, name: &str) -> impl Iterator<Item = &'a str> {
        let of_name = self
            .0
            .iter()
            .filter(move |header| header.name.eq_ignore_ascii_case(name));
        of_name.map(|header| core::str::from_utf8(header.value).unwrap_or_default().trim())
    }

    fn get(&self, name: &str) -> Option<&'a str> {
        self.all(name).next()
    }

    /// The only one of this name, if there is one.
    fn only(&self, name: &str) -> Result<Option<&'a str>, Refusal> {
        let mut found = self.all(name);
        match (found.next(), found.next()) {
            (first, None) => Ok(first),
            _ => Err(refusal(Status::BadRequest, "A header is there twice.")),
        }
    }

    /// Whether a list has an entry.
    fn lists(&self, name: &str, entry: &str) -> bool {
        let mut entries = self.all(name).flat_map(|list| list.split(','));
        entries.any(|listed| listed.trim().eq_ignore_ascii_case(entry))
    }

    /// A tag. One that is longer than ours is another file's, as an empty one is.
    fn tag(&self, name: &str) -> Option<Tag> {
        Some(self.get(name)?.try_into().unwrap_or_default())
    }
}

impl Request {
    /// From the whole head of a request to one of the `names` that are ours.
    ///
    /// # Errors
    /// It is not to us, or asks for what we don't have, or is not understood.
    pub fn parse(head: &[u8], names: &[&str]) -> Result<Self, Refusal> {
        let mut headers = [EMPTY_HEADER; MAX_HEADERS];
        let mut parsed = httparse::Request::new(&mut headers);
        match parsed.parse(head) {
            Ok(httparse::Status::Complete(length)) if length == head.len() => {}
            Err(httparse::Error::TooManyHeaders) => {
                return Err(refusal(Status::HeaderFieldsTooLarge, "Too many headers."));
            }
            // Nothing may follow before it is answered.
            Ok(_) | Err(_) => return Err(refusal(Status::BadRequest, "This is no request of HTTP.")),
        }
        let headers = Headers(parsed.headers);
        let (authority, path) = split_target(parsed.path.unwrap_or_default());
        let sender = sender(&headers, authority, names)?;
        let method = method(parsed.method.unwrap_or_default())?;
        if headers.get("Transfer-Encoding").is_some()
            || !matches!(headers.only("Content-Length")?, None | Some("0"))
        {
            return Err(refusal(Status::BadRequest, "A request has no body here."));
        }
        let mut target = path
            .and_then(target)
            .ok_or(refusal(Status::NotFound, "There is nothing of this name."))?;
        if headers.lists("Upgrade", "websocket") {
            target = Target::WebSocket(upgrade(&headers, method, target, parsed.version)?);
        }
        Ok(Self {
            method,
            sender,
            target,
            has: headers.tag(match target {
                Target::Log(_) => "If-Range",
                _ => "If-None-Match",
            }),
            range: headers.get("Range").and_then(ByteRange::parse),
        })
    }
}

/// The authority of a target, if it is in absolute form, and its path behind the first slash, if it has one.
fn split_target(target: &str) -> (Option<&str>, Option<&str>) {
    let target = target.split_once('?').map_or(target, |(target, _)| target);
    match target.strip_prefix(SCHEME) {
        Some(rest) => {
            let (authority, path) = rest.split_once('/').unwrap_or((rest, ""));
            (Some(authority), Some(path))
        }
        None => (None, target.strip_prefix('/')),
    }
}

/// Its origin. A name that is not ours may have been made to lead here by someone else (DNS rebinding): the browser takes
/// their page for ours then.
fn sender(headers: &Headers<'_>, authority: Option<&str>, names: &[&str]) -> Result<Sender, Refusal> {
    let Some(host) = headers.only("Host")? else {
        return Err(refusal(Status::BadRequest, "A request names one host."));
    };
    let is_ours = |host| names.iter().any(|name| is_at(host, name));
    if !is_ours(host) || !authority.is_none_or(is_ours) {
        return Err(refusal(
            Status::MisdirectedRequest,
            "This is not the address of the rover.",
        ));
    }
    let is_own = |origin: &str| {
        let origin = origin.strip_prefix(SCHEME);
        origin.is_some_and(|origin| origin.eq_ignore_ascii_case(host))
    };
    let mut origins = headers.all("Origin").peekable();
    Ok(if origins.peek().is_none() {
        Sender::Program
    } else if origins.all(is_own) {
        Sender::Own
    } else {
        Sender::Foreign
    })
}

/// Whether a host is `name`, at whatever port.
fn is_at(host: &str, name: &str) -> bool {
    let Some((begin, rest)) = host.split_at_checked(name.len()) else {
        return false;
    };
    let is_port = |port: &str| port.bytes().all(|byte| byte.is_ascii_digit());
    begin.eq_ignore_ascii_case(name) && (rest.is_empty() || rest.strip_prefix(':').is_some_and(is_port))
}

fn method(name: &str) -> Result<Method, Refusal> {
    match name {
        "GET" => Ok(Method::Get),
        "HEAD" => Ok(Method::Head),
        _ => Err(refusal(Status::MethodNotAllowed, "Only GET and HEAD are served.")),
    }
}

/// Target at a path, which has no slash before it.
fn target(path: &str) -> Option<Target> {
    match path {
        "" => Some(Target::Page),
        "parameters.json" => Some(Target::Parameters),
        "logs/" => Some(Target::LogList),
        _ => {
            let digits = path.strip_prefix("logs/")?.strip_suffix(EXTENSION)?;
            digits.bytes().all(|byte| byte.is_ascii_digit()).then_some(())?;
            digits.parse().ok().map(Target::Log)
        }
    }
}

/// The key that accepts an upgrade to a WebSocket.
fn upgrade(
    headers: &Headers<'_>,
    method: Method,
    target: Target,
    version: Option<u8>,
) -> Result<[u8; 28], Refusal> {
    let key = headers
        .get("Sec-WebSocket-Key")
        .filter(|key| key.len() == KEY_BYTES);
    let is_right = target == Target::Page
        && method == Method::Get
        && version == Some(1)
        && headers.lists("Connection", "Upgrade")
        && headers.get("Sec-WebSocket-Version") == Some(WEB_SOCKET_VERSION);
    match key {
        Some(key) if is_right => Ok(accept_key(key)),
        _ => Err(refusal(
            Status::BadRequest,
            "A WebSocket is opened at /, with a key and version 13.",
        )),
    }
}
