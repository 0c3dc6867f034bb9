//! The page and MAVLink for browsers ([`web`](crate::web)), by TCP.
//!
//! Any connection may become a WebSocket, but two links are all there is memory for: its slot says which one it has.

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
use crate::web::{BUFFER_BYTES, Site, Slot, Slots, WEB_SOCKETS, refuse, serve_request, serve_web_socket};

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

/// Time-out of a browser that is to receive what was sent last and to close its side.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(3);

/// The same of the one that gets 503: another one may come.
const REFUSED_CLOSE_TIMEOUT: Duration = Duration::from_millis(250);

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

/// The link of a WebSocket's slot.
struct LinkSlot<'m, 'a> {
    id: LinkId,
    /// Memory in which the link is built; `None` while a connection uses it.
    memory: Cell<Option<&'m mut Option<Link<'a>>>>,
}

/// Serves browsers.
pub(super) async fn serve_browsers(stack: Stack<'_>, memory: &mut BrowserMemory, service: &Service<'_>) {
    let slots = Slots::new();
    let (mut first, mut second) = (None, None);
    let link = |id, memory| LinkSlot {
        id,
        memory: Cell::new(Some(memory)),
    };
    let links: [_; WEB_SOCKETS] = [link(LinkId::Web1, &mut first), link(LinkId::Web2, &mut second)];
    let BrowserMemory { connections, refused } = memory;
    let [one, two, three, four] = connections;
    join5(
        serve_connection(stack, one, &links, &slots, service),
        serve_connection(stack, two, &links, &slots, service),
        serve_connection(stack, three, &links, &slots, service),
        serve_connection(stack, four, &links, &slots, service),
        // Last: a new connection goes to the first socket that listens.
        refuse_surplus(stack, refused, &slots),
    )
    .await;
}

/// Serves one request after the other.
async fn serve_connection<'a>(
    stack: Stack<'_>,
    memory: &mut ConnectionMemory,
    links: &[LinkSlot<'_, 'a>; WEB_SOCKETS],
    slots: &Slots,
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
        slots,
    };
    loop {
        accept(socket, PORT).await;
        let name = own_address(socket);
        let slot = serve_request(TcpTransmitter(socket), socket, buffer, &[&name], site).await;
        if let Some(slot) = slot
            && let Some(link) = links.get(slot.index)
        {
            serve_link(socket, &slot, link, service).await;
        }
        close(socket, CLOSE_TIMEOUT).await;
    }
}

/// Serves a connection that has become a WebSocket.
async fn serve_link<'a>(
    socket: &RefCell<TcpSocket<'_>>,
    slot: &Slot<'_>,
    link_slot: &LinkSlot<'_, 'a>,
    service: &Service<'a>,
) {
    // A slot has one holder.
    let Some(memory) = link_slot.memory.take() else {
        return;
    };
    let link = open(link_slot.id, slot.sender.access(), memory, service);
    info!("{}: connected", link_slot.id.name());
    serve_web_socket(
        TcpTransmitter(socket),
        socket,
        slot,
        link,
        service.shared,
        service.check_in,
    )
    .await;
    info!("{}: disconnected", link_slot.id.name());
    link_slot.memory.set(Some(memory));
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
async fn refuse_surplus(stack: Stack<'_>, (received, sent): &mut RefusedMemory, slots: &Slots) {
    let socket = &RefCell::new(socket(stack, received, sent));
    loop {
        accept(socket, PORT).await;
        refuse(TcpTransmitter(socket), slots).await;
        let receive_rest = async { while { socket }.receive(&mut [0; 32]).await.is_ok() {} };
        socket.borrow_mut().close();
        let _ = with_timeout(REFUSED_CLOSE_TIMEOUT, receive_rest).await;
        close(socket, REFUSED_CLOSE_TIMEOUT).await;
    }
}
