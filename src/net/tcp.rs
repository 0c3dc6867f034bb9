//! MAVLink by TCP: each client has a link of its own.

use core::cell::RefCell;
use core::task::Poll;

use embassy_futures::poll_once;
use embassy_net::Stack;
use embassy_net::tcp::{State, TcpSocket};
use embassy_time::{Duration, with_timeout};
use embedded_io_async::{ErrorKind, ErrorType, Write};

use super::service::Service;
use super::socket::until;
use crate::log::info;
use crate::mavlink::{Access, LinkId};
use crate::tasks::{ByteSource, ReceiveError};

/// Clients that can be connected at a time.
pub(super) const CLIENTS: usize = 2;

/// The port of MAVLink by TCP, as ArduPilot's.
const PORT: u16 = 5760;

/// Room for bytes from a client while its link is busy: TCP has it wait for the rest.
const TCP_RECEIVED_BYTES: usize = 512;

/// Room for bytes to a client until it confirms them.
const TCP_SENT_BYTES: usize = 1024;

/// Interval at which a silent client is asked whether it is still connected.
const KEEP_ALIVE: Duration = Duration::from_secs(3);

/// A client that has not answered that for this long has left.
const KEEP_ALIVE_TIMEOUT: Duration = Duration::from_secs(12);

/// Time for a client to receive what was sent last and to close its side.
const CLOSE_TIMEOUT: Duration = Duration::from_secs(1);

/// Time-out of a reset, which waits for the radio.
const RESET_TIMEOUT: Duration = Duration::from_millis(100);

/// The buffers of a TCP socket.
pub(super) struct TcpMemory {
    received: [u8; TCP_RECEIVED_BYTES],
    sent: [u8; TCP_SENT_BYTES],
}

impl TcpMemory {
    /// Empty buffers.
    pub const fn new() -> Self {
        Self {
            received: [0; TCP_RECEIVED_BYTES],
            sent: [0; TCP_SENT_BYTES],
        }
    }
}

/// Serves one client after the other on a socket of its own. While all of these serve a client, the connection of another one is
/// reset.
pub(super) async fn serve_clients(
    id: LinkId,
    stack: Stack<'_>,
    memory: &mut TcpMemory,
    service: &Service<'_>,
) -> ! {
    let socket = RefCell::new(socket(stack, &mut memory.received, &mut memory.sent));
    loop {
        accept(&socket, PORT).await;
        info!("{}: connected", id.name());
        let link = service.open(id, 0, Access::Full);
        service.serve(TcpTransmitter(&socket), &socket, &link).await;
        info!("{}: disconnected", id.name());
        close(&socket, CLOSE_TIMEOUT).await;
    }
}

/// A socket that notices when its client has left.
pub(super) fn socket<'s>(stack: Stack<'s>, received: &'s mut [u8], sent: &'s mut [u8]) -> TcpSocket<'s> {
    let mut socket = TcpSocket::new(stack, received, sent);
    socket.set_keep_alive(Some(KEEP_ALIVE));
    socket.set_timeout(Some(KEEP_ALIVE_TIMEOUT));
    // A frame does not wait for the next one.
    socket.set_nagle_enabled(false);
    socket
}

/// Waits for a client at `port`.
pub(super) async fn accept(socket: &RefCell<TcpSocket<'_>>, port: u16) {
    // It listens from the first poll on.
    let _ = poll_once(socket.borrow_mut().accept(port));
    until(|| !matches!(socket.borrow().state(), State::Listen | State::SynReceived)).await;
}

/// Closes the connection. A client that has not taken what was sent last within `timeout` is reset.
pub(super) async fn close(socket: &RefCell<TcpSocket<'_>>, timeout: Duration) {
    socket.borrow_mut().close();
    let closed = until(|| matches!(socket.borrow().state(), State::Closed | State::TimeWait));
    let _ = with_timeout(timeout, closed).await;
    socket.borrow_mut().abort();
    let reset = until(|| socket.borrow().remote_endpoint().is_none());
    let _ = with_timeout(RESET_TIMEOUT, reset).await;
}

/// The way to a client.
pub(super) struct TcpTransmitter<'a, 's>(pub &'a RefCell<TcpSocket<'s>>);

impl ErrorType for TcpTransmitter<'_, '_> {
    type Error = ErrorKind;
}

impl Write for TcpTransmitter<'_, '_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        until(|| {
            let socket = self.0.borrow();
            socket.can_send() || !socket.may_send()
        })
        .await;
        match poll_once(self.0.borrow_mut().write(bytes)) {
            Poll::Ready(Ok(written)) => Ok(written),
            _ => Err(ErrorKind::NotConnected),
        }
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

/// Bytes from a client.
impl ByteSource for &RefCell<TcpSocket<'_>> {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        until(|| {
            let socket = self.borrow();
            socket.can_recv() || !socket.may_recv()
        })
        .await;
        match poll_once(self.borrow_mut().read(buffer)) {
            Poll::Ready(Ok(received)) if received > 0 => Ok(received),
            _ => Err(ReceiveError::Closed),
        }
    }
}
