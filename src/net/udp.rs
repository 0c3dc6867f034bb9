//! MAVLink by UDP: each ground station has a link of its own.

use core::cell::{Cell, RefCell};
use core::convert::Infallible;
use core::net::SocketAddrV4;

use embassy_futures::select::select;
use embassy_futures::{poll_once, yield_now};
use embassy_net::udp::{UdpMetadata, UdpSocket};
use embassy_net::{IpAddress, IpEndpoint};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::pipe::Pipe;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer};
use embedded_io_async::{ErrorType, Write};

use super::datagram::{DATAGRAM_BYTES, Datagram};
use super::ingress_filter::{RefusalLog, may_log};
use super::sender::Sender;
use super::service::Service;
use super::socket::{PacketQueue, until};
use super::stations::{Admission, Discovery, SLOTS, Stations};
use crate::log::{info, warn};
use crate::mavlink::{Access, LinkId, begins_with_frame};
use crate::tasks::{ByteSource, Link, ReceiveError, now};

/// The port of MAVLink by UDP, on both sides: QGroundControl, MAVProxy and others listen there.
pub(super) const PORT: u16 = 14550;

/// Received bytes that wait for their link: two of the largest frames, or fifteen short ones. A larger datagram is lost; ground stations send each
/// frame in one of its own.
const QUEUE_BYTES: usize = 768;

/// A station that was not heard for this long has left. Its time-outs have acted long before.
const STATION_TIMEOUT: Duration = Duration::from_secs(10);

/// Buffers of the way to a station.
pub(super) struct SlotMemory {
    /// Datagrams that wait for the radio.
    pub sent: PacketQueue<1, DATAGRAM_BYTES>,
    /// The next one, put together meanwhile. In a future it would take several times its size.
    pub datagram: Datagram,
}

impl SlotMemory {
    /// Nothing is to be sent.
    pub const fn new() -> Self {
        Self {
            sent: PacketQueue::new(),
            datagram: Datagram::new(),
        }
    }
}

/// The links by UDP, and the stations that have them.
pub(super) struct UdpLinks {
    pub stations: RefCell<Stations>,
    slots: [Slot; SLOTS],
    pub discovery: Discovery,
    refusal_log: RefusalLog,
}

/// Bytes that wait for a link.
struct Slot {
    received: Pipe<NoopRawMutex, QUEUE_BYTES>,
    lost_bytes: Cell<u32>,
    /// A station got the slot.
    opened: Signal<NoopRawMutex, SocketAddrV4>,
}

impl UdpLinks {
    pub fn new() -> Self {
        Self {
            stations: RefCell::default(),
            slots: [const { Slot::new() }; SLOTS],
            discovery: Discovery::new(),
            refusal_log: RefusalLog::default(),
        }
    }

    /// Forgets all stations.
    pub fn reset(&self) {
        for (index, slot) in self.slots.iter().enumerate() {
            self.close(index, slot);
            slot.opened.reset();
        }
    }

    /// The station is gone, and what it has sent last is of no use.
    fn close(&self, index: usize, slot: &Slot) {
        self.stations.borrow_mut().release(index);
        slot.received.clear();
        slot.lost_bytes.set(0);
    }

    /// Takes what `station` has sent.
    fn take(&self, datagram: &[u8], station: SocketAddrV4) {
        let known = self.stations.borrow().slot_of(station);
        let index = known.or_else(|| self.admit(datagram, station));
        if let Some(slot) = index.and_then(|index| self.slots.get(index)) {
            slot.queue(datagram);
        }
    }

    /// Gives a slot to a station that sends MAVLink, if one is free.
    fn admit(&self, datagram: &[u8], station: SocketAddrV4) -> Option<usize> {
        if !begins_with_frame(datagram) {
            return None;
        }
        let admission = self.stations.borrow_mut().admit(station);
        match admission {
            Admission::Admitted(index) => {
                self.slots.get(index)?.opened.signal(station);
                Some(index)
            }
            Admission::Refused(count) => {
                self.log_refusal(station, count);
                None
            }
        }
    }

    fn log_refusal(&self, station: SocketAddrV4, count: u32) {
        if may_log(&self.refusal_log) {
            let address = station.ip().octets();
            warn!(
                "UDP: {:?} refused, no link is free: {} datagrams so far",
                address, count
            );
        }
    }
}

impl Slot {
    const fn new() -> Self {
        Self {
            received: Pipe::new(),
            lost_bytes: Cell::new(0),
            opened: Signal::new(),
        }
    }

    /// Has a datagram wait, whole or not at all.
    fn queue(&self, datagram: &[u8]) {
        if datagram.len() > self.received.free_capacity() {
            let lost = self.lost_bytes.get().saturating_add(datagram.len() as u32);
            self.lost_bytes.set(lost);
            return;
        }
        // There is room for it, so it does not wait. `try_write` would stop at the end of the queue's memory.
        let _ = poll_once(self.received.write_all(datagram));
    }
}

/// Takes what ground stations send, one datagram a turn.
pub(super) async fn receive(mut socket: UdpSocket<'_>, links: &UdpLinks) -> ! {
    let _ = socket.bind(PORT);
    loop {
        until(|| socket.may_recv()).await;
        socket
            .recv_from_with(|datagram, metadata: UdpMetadata| {
                links.take(datagram, station_of(metadata.endpoint));
            })
            .await;
        yield_now().await;
    }
}

fn station_of(endpoint: IpEndpoint) -> SocketAddrV4 {
    let IpAddress::Ipv4(address) = endpoint.addr;
    SocketAddrV4::new(address, endpoint.port)
}

/// Serves one station after the other, each with a link of its own: its own schedule, rates and counters.
pub(super) async fn serve_stations(
    index: usize,
    id: LinkId,
    mut sender: Sender<'_>,
    datagram: &mut Datagram,
    links: &UdpLinks,
    service: &Service<'_>,
) {
    let Some(slot) = links.slots.get(index) else {
        return;
    };
    loop {
        let station = slot.opened.wait().await;
        info!("{}: {:?} connected", id.name(), station.ip().octets());
        let first_sequence = links.discovery.end_for(*station.ip());
        let link = service.open(id, first_sequence, Access::Full);
        datagram.clear();
        let transmitter = UdpTransmitter {
            sender: &mut sender,
            station,
            datagram,
            handed_over: 0,
            link: &link,
        };
        let service = service.serve(transmitter, slot, &link);
        select(service, until_silent(&link)).await;
        links.close(index, slot);
        info!("{}: {:?} is silent", id.name(), station.ip().octets());
    }
}

/// Waits until no good frame has come for [`STATION_TIMEOUT`].
async fn until_silent(link: &Link<'_>) {
    let mut frames = link.statistics().received.frames;
    let mut heard_at = now();
    while now().us_since(heard_at) < STATION_TIMEOUT.as_micros() {
        Timer::after_secs(1).await;
        let frames_now = link.statistics().received.frames;
        if frames_now != frames {
            frames = frames_now;
            heard_at = now();
        }
    }
}

/// The way to a station. Frames are sent together while there are more of them.
struct UdpTransmitter<'a, 's> {
    sender: &'a mut Sender<'s>,
    station: SocketAddrV4,
    datagram: &'a mut Datagram,
    /// The frames of the datagram that was handed over last.
    handed_over: u32,
    link: &'a Link<'a>,
}

impl ErrorType for UdpTransmitter<'_, '_> {
    type Error = Infallible;
}

impl Write for UdpTransmitter<'_, '_> {
    /// Takes a whole frame.
    async fn write(&mut self, frame: &[u8]) -> Result<usize, Infallible> {
        if self.datagram.add(frame).is_err() {
            self.send().await;
            // It is empty now, and the largest frame fits.
            let _ = self.datagram.add(frame);
        }
        Ok(frame.len())
    }

    async fn flush(&mut self) -> Result<(), Infallible> {
        if !self.datagram.is_empty() {
            self.send().await;
        }
        Ok(())
    }
}

impl UdpTransmitter<'_, '_> {
    async fn send(&mut self) {
        if self.sender.make_room().await.is_err() {
            self.link.count_lost(self.handed_over);
        }
        self.handed_over = self.datagram.frames();
        let handed_over = self.sender.hand_over(self.datagram.bytes(), self.station);
        if handed_over.is_err() {
            self.link.count_lost(self.handed_over);
        }
        self.datagram.clear();
    }
}

/// Bytes from a station.
impl ByteSource for &Slot {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        match self.lost_bytes.take() {
            0 => Ok(self.received.read(buffer).await),
            lost => Err(ReceiveError::BytesLost(lost)),
        }
    }
}
