//! The page and MAVLink for browsers ([`web`](crate::web)), by TCP.
//!
//! There are five sockets. Four of them serve a connection each; while all of these are in use the fifth one answers 503. A connection
//! that is served needs a slot of [`Slots`] to get a page or a file, or to become a WebSocket; without a free one it gets 503 as well.
//!
//! Any of the four connections may become a WebSocket, but there is memory for two links only. So the links belong to the slots of
//! WebSockets, and a connection borrows that of its slot.

use core::cell::RefCell;

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

/// Connections that are served at a time: one for each slot, of a WebSocket or of a file.
pub(super) const CONNECTIONS: usize = 4;

/// Room for bytes from a browser while its link is busy.
const RECEIVED_BYTES: usize = 512;

/// Room for bytes to a browser until it confirms them.
const SENT_BYTES: usize = 1024;

/// Room for bytes from and to the connection that gets 503.
const REFUSED_RECEIVED_BYTES: usize = 128;
const REFUSED_SENT_BYTES: usize = 192;

/// Time-out of a browser that is to receive what was sent last and to close its side.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(3);

/// Time-out of a browser that got 503: another one may come.
const REFUSED_CLOSE_TIMEOUT: Duration = Duration::from_millis(250);

/// The buffers of the sockets.
pub(super) struct BrowserMemory {
    connections: [ConnectionMemory; CONNECTIONS],
    /// Of the connection that gets 503: received and sent bytes.
    refused: RefusedMemory,
}

type RefusedMemory = ([u8; REFUSED_RECEIVED_BYTES], [u8; REFUSED_SENT_BYTES]);

struct ConnectionMemory {
    received: [u8; RECEIVED_BYTES],
    sent: [u8; SENT_BYTES],
    /// Of the request and the pieces of the answer.
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

/// The server: what its sockets share.
struct Server<'s, 'a> {
    stack: Stack<'s>,
    service: &'s Service<'a>,
    /// Which connections may get a file or become a WebSocket.
    slots: Slots,
    /// The link of each slot for a WebSocket, by the slot's index.
    links: [WebSocketLink<'s, 'a>; WEB_SOCKETS],
}

/// The link of a slot for a WebSocket.
struct WebSocketLink<'s, 'a> {
    id: LinkId,
    /// The link is built here; borrowed while a connection has the slot.
    memory: RefCell<&'s mut Option<Link<'a>>>,
}

impl<'s, 'a> WebSocketLink<'s, 'a> {
    fn new(id: LinkId, memory: &'s mut Option<Link<'a>>) -> Self {
        let memory = RefCell::new(memory);
        Self { id, memory }
    }
}

/// Serves browsers.
pub(super) async fn serve_browsers(stack: Stack<'_>, memory: &mut BrowserMemory, service: &Service<'_>) {
    // Not in the server: it would be built on the stack, which has no room for links, and moved.
    let (mut first, mut second) = (None, None);
    let server = Server {
        stack,
        service,
        slots: Slots::new(),
        links: [
            WebSocketLink::new(LinkId::Web1, &mut first),
            WebSocketLink::new(LinkId::Web2, &mut second),
        ],
    };
    let BrowserMemory { connections, refused } = memory;
    let [one, two, three, four] = connections;
    join5(
        server.serve_connections(one),
        server.serve_connections(two),
        server.serve_connections(three),
        server.serve_connections(four),
        // Last: a new connection goes to the first socket that listens.
        server.refuse_connections(refused),
    )
    .await;
}

impl<'a> Server<'_, 'a> {
    /// Serves one connection after the other, on a socket with this memory.
    async fn serve_connections(&self, memory: &mut ConnectionMemory) {
        let ConnectionMemory {
            received,
            sent,
            buffer,
        } = memory;
        let socket = &RefCell::new(socket(self.stack, received, sent));
        let site = Site {
            shared: self.service.shared,
            logs: self.service.logs,
            slots: &self.slots,
        };
        loop {
            accept(socket, PORT).await;
            let name = own_address(socket);
            let web_socket = serve_request(TcpTransmitter(socket), socket, buffer, &[&name], site).await;
            if let Some(slot) = web_socket {
                self.serve_web_socket(socket, &slot).await;
            }
            close(socket, CLOSE_TIMEOUT).await;
        }
    }

    /// Serves the link of `slot` on a connection that has become a WebSocket.
    #[expect(
        clippy::await_holding_refcell_ref,
        reason = "the slot's holder alone borrows it"
    )]
    async fn serve_web_socket(&self, socket: &RefCell<TcpSocket<'_>>, slot: &Slot<'_>) {
        let Some(WebSocketLink { id, memory }) = self.links.get(slot.index) else {
            return;
        };
        // It is not borrowed, as a slot has one holder.
        let Ok(mut memory) = memory.try_borrow_mut() else {
            return;
        };
        let link = open(*id, slot.sender.access(), &mut memory, self.service);
        info!("{}: connected", id.name());
        let (shared, check_in) = (self.service.shared, self.service.check_in);
        serve_web_socket(TcpTransmitter(socket), socket, slot, link, shared, check_in).await;
        info!("{}: disconnected", id.name());
    }

    /// Answers 503 to connections that come while all other sockets are in use.
    async fn refuse_connections(&self, (received, sent): &mut RefusedMemory) {
        let socket = &RefCell::new(socket(self.stack, received, sent));
        loop {
            accept(socket, PORT).await;
            refuse(TcpTransmitter(socket), &self.slots).await;
            let receive_rest = async { while { socket }.receive(&mut [0; 32]).await.is_ok() {} };
            socket.borrow_mut().close();
            let _ = with_timeout(REFUSED_CLOSE_TIMEOUT, receive_rest).await;
            close(socket, REFUSED_CLOSE_TIMEOUT).await;
        }
    }
}

/// Opens a link in `memory`.
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
