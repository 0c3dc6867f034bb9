//! The page and MAVLink for browsers ([`web`](crate::web)), by TCP.
//!
//! Any connection may become a WebSocket, but two links are all there is memory for. So a connection is handed over to the
//! one that has the link, until that is over.

use core::cell::RefCell;

use embassy_futures::join::{join3, join5};
use embassy_net::Stack;
use embassy_net::tcp::TcpSocket;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, with_timeout};
use heapless::String;

use super::service::Service;
use super::tcp::{TcpReceiver, TcpTransmitter, accept, close, socket};
use crate::log::info;
use crate::mavlink::LinkId;
use crate::numbers::text;
use crate::tasks::ByteSource;
use crate::web::{
    Attended, BUFFER_BYTES, Place, Places, Site, WEB_SOCKETS, attend, refuse, serve_web_socket,
};

/// The port of HTTP.
const PORT: u16 = 80;

/// Those of WebSockets, and two that get a page or a file. One more gets 503.
pub(super) const CONNECTIONS: usize = 4;

/// What a browser sends while its link is busy.
const RECEIVED_BYTES: usize = 512;

/// What is sent until a browser confirms it.
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
    refused: RefusedMemory,
}

struct ConnectionMemory {
    received: [u8; RECEIVED_BYTES],
    sent: [u8; SENT_BYTES],
    buffer: [u8; BUFFER_BYTES],
}

struct RefusedMemory {
    received: [u8; REFUSED_RECEIVED_BYTES],
    sent: [u8; REFUSED_SENT_BYTES],
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
            refused: RefusedMemory {
                received: [0; REFUSED_RECEIVED_BYTES],
                sent: [0; REFUSED_SENT_BYTES],
            },
        }
    }
}

/// A connection, and the signal that its link is over.
struct Connection<'s> {
    socket: RefCell<TcpSocket<'s>>,
    link_is_over: Signal<NoopRawMutex, ()>,
}

/// A connection that has become a WebSocket, for the link that its place has.
type Handover<'a, 's> = Signal<NoopRawMutex, (&'a Connection<'s>, Place<'a>)>;

/// Serves browsers.
pub(super) async fn serve_browsers(stack: Stack<'_>, memory: &mut BrowserMemory, service: &Service<'_>) {
    let places = Places::new();
    let BrowserMemory { connections, refused } = memory;
    let opened = connections.each_mut().map(|memory| {
        let ConnectionMemory {
            received,
            sent,
            buffer,
        } = memory;
        let connection = Connection {
            socket: RefCell::new(socket(stack, received, sent)),
            link_is_over: Signal::new(),
        };
        (connection, buffer)
    });
    let [
        (one, buffer_1),
        (two, buffer_2),
        (three, buffer_3),
        (four, buffer_4),
    ] = opened;
    // Last: whoever connects gets the first that listens.
    let surplus = RefCell::new(socket(stack, &mut refused.received, &mut refused.sent));
    let handovers: [Handover<'_, '_>; WEB_SOCKETS] = [const { Signal::new() }; WEB_SOCKETS];
    let site = Site {
        shared: service.shared,
        logs: service.logs,
        places: &places,
    };
    let [first, second] = &handovers;
    join3(
        join5(
            serve_connection(&one, buffer_1, &handovers, site),
            serve_connection(&two, buffer_2, &handovers, site),
            serve_connection(&three, buffer_3, &handovers, site),
            serve_connection(&four, buffer_4, &handovers, site),
            refuse_surplus(&surplus, &places),
        ),
        serve_links(LinkId::Web1, first, service),
        serve_links(LinkId::Web2, second, service),
    )
    .await;
}

/// Serves one request after the other.
async fn serve_connection<'a, 's>(
    connection: &'a Connection<'s>,
    buffer: &mut [u8],
    handovers: &[Handover<'a, 's>; WEB_SOCKETS],
    site: Site<'a>,
) {
    let socket = &connection.socket;
    loop {
        accept(socket, PORT).await;
        let name = own_address(socket);
        let (transmitter, receiver) = (TcpTransmitter(socket), TcpReceiver(socket));
        let attended = attend(transmitter, receiver, buffer, &[&name], site).await;
        if let Attended::WebSocket(place) = attended
            && let Some(handover) = handovers.get(place.index)
        {
            connection.link_is_over.reset();
            handover.signal((connection, place));
            connection.link_is_over.wait().await;
        }
        close(socket, FAREWELL).await;
    }
}

/// The address that a browser has connected to.
fn own_address(socket: &RefCell<TcpSocket<'_>>) -> String<15> {
    match socket.borrow().local_endpoint() {
        Some(endpoint) => text(format_args!("{}", endpoint.addr)),
        None => String::new(),
    }
}

/// Serves one WebSocket after the other, each with a link of its own.
async fn serve_links(id: LinkId, handover: &Handover<'_, '_>, service: &Service<'_>) {
    loop {
        let (connection, place) = handover.wait().await;
        info!("{}: connected", id.name());
        let link = service.open(id, 0, place.sender.access());
        let socket = &connection.socket;
        let (transmitter, receiver) = (TcpTransmitter(socket), TcpReceiver(socket));
        serve_web_socket(
            transmitter,
            receiver,
            &place,
            &link,
            service.shared,
            service.check_in,
        )
        .await;
        info!("{}: disconnected", id.name());
        connection.link_is_over.signal(());
    }
}

/// Answers 503 to those who come while all other connections are in use.
async fn refuse_surplus(socket: &RefCell<TcpSocket<'_>>, places: &Places) {
    loop {
        accept(socket, PORT).await;
        refuse(TcpTransmitter(socket), places).await;
        let receive_rest = async { while TcpReceiver(socket).receive(&mut [0; 32]).await.is_ok() {} };
        socket.borrow_mut().close();
        let _ = with_timeout(REFUSED_FAREWELL, receive_rest).await;
        close(socket, REFUSED_FAREWELL).await;
    }
}
