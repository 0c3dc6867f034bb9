//! The page and MAVLink for browsers ([`web`](crate::web)), by TCP.
//!
//! Any connection may become a WebSocket, but two links are all there is memory for: its place says which one it has.

use core::cell::{Cell, RefCell};

use embassy_futures::join::join5;
use embassy_net::Stack;
use embassy_net::tcp::TcpSocket;
use embassy_time::{Duration, with_timeout};
use heapless::String;

use super::service::Service;
use super::tcp::{TcpTransmitter, accept, close, socket};
use crate::log::info;
use crate::mavlink::{Access, LinkId};
use crate::numbers::text;
use crate::tasks::{ByteSource, Link};
use crate::web::{
    Attended, BUFFER_BYTES, Place, Places, Site, WEB_SOCKETS, attend, refuse, serve_web_socket,
};

/// The port of HTTP.
const PORT: u16 = 80;

/// Connections of WebSockets, and two that get a page or a file. One more gets 503.
pub(super) const CONNECTIONS: usize = 4;

/// Room for bytes from a browser while its link is busy.
const RECEIVED_BYTES: usize = 512;

/// Room for bytes to a browser until it confirms them.
const SENT_BYTES: usize = 1024;

/// The same of the one that gets 503.
const REFUSED_RECEIVED_BYTES: usize = 128;
const REFUSED_SENT_BYTES: usize = 192;

/// Time for a browser to receive what was sent last and to close its side.
const FAREWELL: Duration = Duration::from_secs(3);

/// The same of the one that gets 503: another one may come.
const REFUSED_FAREWELL: Duration = Duration::from_millis(250);

/// The buffers of the connections.
pub(super) struct BrowserMemory {
    connections: [ConnectionMemory; CONNECTIONS],
    /// Of the connection that gets 503: received and sent bytes.
    refused: RefusedMemory,
}

type RefusedMemory = ([u8; REFUSED_RECEIVED_BYTES], [u8; REFUSED_SENT_BYTES]);

struct ConnectionMemory {
    received: [u8; RECEIVED_BYTES],
    sent: [u8; SENT_BYTES],
    buffer: [u8; BUFFER_BYTES],
}

impl BrowserMemory {
    /// Empty buffers.
    pub const fn new() -> Self {
        const CONNECTION: ConnectionMemory = ConnectionMemory {
            received: [0; RECEIVED_BYTES],
            sent: [0; SENT_BYTES],
            buffer: [0; BUFFER_BYTES],
        };
        Self {
            connections: [CONNECTION; CONNECTIONS],
            refused: ([0; REFUSED_RECEIVED_BYTES], [0; REFUSED_SENT_BYTES]),
        }
    }
}

/// The link of a place for a WebSocket.
struct LinkSlot<'m, 'a> {
    id: LinkId,
    /// Memory in which the link is built; `None` while a connection uses it.
    memory: Cell<Option<&'m mut Option<Link<'a>>>>,
}

/// Serves browsers.
pub(super) async fn serve_browsers(stack: Stack<'_>, memory: &mut BrowserMemory, service: &Service<'_>) {
    let places = Places::new();
    let (mut first, mut second) = (None, None);
    let slot = |id, memory| LinkSlot {
        id,
        memory: Cell::new(Some(memory)),
    };
    let links: [_; WEB_SOCKETS] = [slot(LinkId::Web1, &mut first), slot(LinkId::Web2, &mut second)];
    let BrowserMemory { connections, refused } = memory;
    let [one, two, three, four] = connections;
    join5(
        serve_connection(stack, one, &links, &places, service),
        serve_connection(stack, two, &links, &places, service),
        serve_connection(stack, three, &links, &places, service),
        serve_connection(stack, four, &links, &places, service),
        // Last: a new connection goes to the first socket that listens.
        refuse_surplus(stack, refused, &places),
    )
    .await;
}

/// Serves one request after the other.
async fn serve_connection<'a>(
    stack: Stack<'_>,
    memory: &mut ConnectionMemory,
    links: &[LinkSlot<'_, 'a>; WEB_SOCKETS],
    places: &Places,
    service: &Service<'a>,
) {
    let ConnectionMemory {
        received,
        sent,
        buffer,
    } = memory;
    let socket = &RefCell::new(socket(stack, received, sent));
    let site = Site {
        shared: service.shared,
        logs: service.logs,
        places,
    };
    loop {
        accept(socket, PORT).await;
        let name = own_address(socket);
        let attended = attend(TcpTransmitter(socket), socket, buffer, &[&name], site).await;
        if let Attended::WebSocket(place) = attended
            && let Some(slot) = links.get(place.index)
        {
            serve_place(socket, &place, slot, service).await;
        }
        close(socket, FAREWELL).await;
    }
}

/// Serves a connection that has become a WebSocket.
async fn serve_place<'a>(
    socket: &RefCell<TcpSocket<'_>>,
    place: &Place<'_>,
    slot: &LinkSlot<'_, 'a>,
    service: &Service<'a>,
) {
    // A place has one holder.
    let Some(memory) = slot.memory.take() else {
        return;
    };
    let link = open(slot.id, place.sender.access(), memory, service);
    info!("{}: connected", slot.id.name());
    serve_web_socket(
        TcpTransmitter(socket),
        socket,
        place,
        link,
        service.shared,
        service.check_in,
    )
    .await;
    info!("{}: disconnected", slot.id.name());
    slot.memory.set(Some(memory));
}

/// Opens a link.
// Not inlined: it is built on the stack, and would take room there all the time.
#[inline(never)]
fn open<'s, 'a>(
    id: LinkId,
    access: Access,
    memory: &'s mut Option<Link<'a>>,
    service: &Service<'a>,
) -> &'s mut Link<'a> {
    memory.insert(service.open(id, 0, access))
}

/// The address that a browser has connected to.
fn own_address(socket: &RefCell<TcpSocket<'_>>) -> String<15> {
    match socket.borrow().local_endpoint() {
        Some(endpoint) => text(format_args!("{}", endpoint.addr)),
        None => String::new(),
    }
}

/// Answers 503 to those who come while all other connections are in use.
async fn refuse_surplus(stack: Stack<'_>, (received, sent): &mut RefusedMemory, places: &Places) {
    let socket = &RefCell::new(socket(stack, received, sent));
    loop {
        accept(socket, PORT).await;
        refuse(TcpTransmitter(socket), places).await;
        let receive_rest = async { while { socket }.receive(&mut [0; 32]).await.is_ok() {} };
        socket.borrow_mut().close();
        let _ = with_timeout(REFUSED_FAREWELL, receive_rest).await;
        close(socket, REFUSED_FAREWELL).await;
    }
}
