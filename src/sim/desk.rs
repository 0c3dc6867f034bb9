//! The simulated vehicle and its links to ground stations.

use std::cell::{Cell, RefCell};
use std::fmt;
use std::future::pending;
use std::rc::Rc;

use embassy_futures::join::{join, join_array, join3, join4, join5};
use embassy_futures::select::{Either, select};
use embassy_time::{Duration, Ticker, Timer};

use super::tcp::POLL_MS;
use super::{
    Client, Clients, PackModel, PackSimulation, SimulatedBus, SimulatedFlash, SimulatedPack,
    SimulatedPackInput, SimulatedRover, UdpWire,
};
use crate::autopilot::Start;
use crate::battery::RetainedRecord;
use crate::crash::ParameterSource;
use crate::flash_map;
use crate::liveness::CheckIn;
use crate::mavlink::{LinkKind, SIMULATED_LINKS};
use crate::pack::Pack;
use crate::sensor::Buses;
use crate::storage::Storage;
use crate::tasks::{
    ByteSource, Link, ReceiveError, SerialLine, Shared, boot, drive, keep_learnt, keep_log, keep_parameters,
    keep_signing, read_bus, reboot_requested, refuse_link, sample_batteries, serve_link, serve_serial,
};
use crate::vehicle::{Indication, Indicators, Restart};

/// Maximum number of TCP clients; UDP has a link, too.
const MAX_CLIENTS: usize = SIMULATED_LINKS - 1;

/// Assumed capacity of a local link: more than all streams need.
const LINK_BYTES_PER_SECOND: u32 = 1_000_000;

/// The simulator has no watchdog that reads check-ins.
static UNWATCHED: CheckIn = CheckIn::new("", u32::MAX);

/// Runs the vehicle, and restarts it at a ground station's request. Ground stations connect by TCP; another one may
/// listen at the remote end of `udp`. Pack and flash survive a restart, connections don't. Prints a status line every
/// `line_interval`. Returns when a ground station requests the boot loader, which is not simulated.
pub async fn run(clients: &Clients, udp: &UdpWire, flash: SimulatedFlash, line_interval: Duration) {
    let pack = RefCell::new(SimulatedPack::full(PackModel::LIPO_3S_2200));
    let rover = SimulatedRover::default();
    loop {
        let mut storage = Storage::of_double_sectors(flash.clone(), flash_map::PARAMETERS);
        let signing_storage = Storage::new(flash.clone(), flash_map::SIGNING);
        let learnt_storage = Storage::new(flash.clone(), flash_map::LEARNT);
        let mut start = Start::default();
        let signing_storage = boot(&mut storage, signing_storage, ParameterSource::Stored, &mut start).await;
        let desk = Desk::new(&start, &pack, &flash);
        let mut memory = [RetainedRecord::BLANK; 2];
        let pack_simulation = PackSimulation::new(&pack, &rover, &desk.shared);
        let vehicle = join5(
            join3(
                sample_batteries(
                    SimulatedPackInput::new(&pack_simulation, &desk.shared),
                    &mut memory,
                    &desk.shared,
                    &UNWATCHED,
                ),
                read_bus(
                    Buses::i2c(SimulatedBus::new(&pack_simulation)),
                    &desk.shared,
                    &UNWATCHED,
                ),
                serve_serial(Some(NoDevice), &desk.shared, &UNWATCHED),
            ),
            drive(&rover, NoLamps, &desk.shared, &UNWATCHED),
            join4(
                keep_parameters(storage, &desk.shared, &UNWATCHED),
                keep_signing(signing_storage, &desk.shared, &UNWATCHED),
                keep_learnt(learnt_storage, &desk.shared, &UNWATCHED),
                keep_log(flash.clone(), flash_map::LOG, &desk.shared, &UNWATCHED),
            ),
            join(
                join_array([(); MAX_CLIENTS].map(|()| desk.serve(clients))),
                join(desk.refuse_surplus(clients), desk.serve_udp(udp)),
            ),
            desk.print_status(line_interval),
        );
        match select(vehicle, reboot_requested(&desk.shared, || desk.all_sent())).await {
            Either::First((_, never, ..)) => never,
            Either::Second(Restart::Firmware) => println!("Restarted."),
            Either::Second(Restart::Fault) => println!("A board would have crashed. Restarted."),
            Either::Second(Restart::BootLoader) => {
                return println!("A board would wait in its boot loader for another firmware.");
            }
        }
    }
}

fn tcp_link(flash: &SimulatedFlash) -> Link<'_> {
    Link::new("TCP", LinkKind::Direct, LINK_BYTES_PER_SECOND).with_logs(flash)
}

struct Desk<'a> {
    shared: Shared,
    pack: &'a RefCell<SimulatedPack>,
    flash: &'a SimulatedFlash,
    links: RefCell<Vec<Rc<Link<'a>>>>,
    status: Cell<Totals>,
}

/// No device on the serial line is simulated: a pack that is measured so is unhealthy.
struct NoDevice;

impl ByteSource for NoDevice {
    async fn receive(&mut self, _: &mut [u8]) -> Result<usize, ReceiveError> {
        pending().await
    }
}

impl SerialLine for NoDevice {
    async fn send(&mut self, _: &[u8]) {}
}

/// The simulator has neither lamps nor a buzzer.
struct NoLamps;

impl Indicators for NoLamps {
    fn show(&mut self, _: Indication) {}
}

impl<'a> Desk<'a> {
    fn new(start: &Start, pack: &'a RefCell<SimulatedPack>, flash: &'a SimulatedFlash) -> Self {
        Self {
            shared: Shared::new(start),
            pack,
            flash,
            links: RefCell::default(),
            status: Cell::default(),
        }
    }

    /// Serves one client after the other, each with its own link: schedule, sequence numbers and counters.
    async fn serve(&self, clients: &Clients) {
        loop {
            let Client {
                address,
                transmitter,
                receiver,
            } = clients.next().await;
            println!("{address} connected");
            let link = Rc::new(tcp_link(self.flash));
            self.links.borrow_mut().push(link.clone());
            serve_link(transmitter, receiver, &self.shared, &link, &UNWATCHED).await;
            self.links.borrow_mut().retain(|other| !Rc::ptr_eq(other, &link));
            println!("{address} disconnected");
        }
    }

    /// Refuses clients while all links are in use. If queued, their commands would be executed at an arbitrary later
    /// time.
    async fn refuse_surplus(&self, clients: &Clients) -> ! {
        loop {
            while self.links.borrow().len() == MAX_CLIENTS
                && let Some(client) = clients.try_next()
            {
                self.refuse(client).await;
            }
            Timer::after_millis(POLL_MS).await;
        }
    }

    async fn refuse(&self, client: Client) {
        println!("{} refused: all {MAX_CLIENTS} links are in use", client.address);
        let reason = format!("Simulator: all {MAX_CLIENTS} links are in use");
        refuse_link(
            client.transmitter,
            &self.shared,
            &tcp_link(self.flash),
            &reason,
            &UNWATCHED,
        )
        .await;
        client.receiver.refuse();
    }

    /// Serves the remote end of `wire`, whether or not it listens.
    async fn serve_udp(&self, wire: &UdpWire) {
        let link = Link::new("UDP", LinkKind::Radio, LINK_BYTES_PER_SECOND).with_logs(self.flash);
        let (transmitter, receiver) = wire.split();
        serve_link(transmitter, receiver, &self.shared, &link, &UNWATCHED).await;
    }

    fn all_sent(&self) -> bool {
        self.links.borrow().iter().all(|link| link.is_idle())
    }

    async fn print_status(&self, line_interval: Duration) {
        let mut lines = Ticker::every(line_interval);
        loop {
            lines.next().await;
            println!("{}", self.next_status());
        }
    }

    /// The status since the previous call.
    fn next_status(&self) -> Status {
        let links = self.links.borrow();
        let pack = self.pack.borrow();
        let before = self.status.get();
        let now = Totals {
            samples: self.shared.with(|autopilot| autopilot.samples()),
            frames: links.iter().map(|link| link.statistics().sent).sum(),
        };
        self.status.set(now);
        Status {
            voltage_v: self
                .shared
                .with(|autopilot| autopilot.battery(Pack::First).voltage_v),
            current_a: pack.current_a(),
            charge: pack.charge(),
            samples: now.samples.wrapping_sub(before.samples),
            // The count of a disconnected client is lost.
            frames: now.frames.saturating_sub(before.frames),
            dropped: links.iter().map(|link| link.statistics().dropped).sum(),
            clients: links.len(),
        }
    }
}

#[derive(Clone, Copy, Default)]
struct Totals {
    samples: u32,
    frames: u32,
}

/// The terminal's status line, with rates since the previous one.
struct Status {
    voltage_v: Option<f32>,
    current_a: f32,
    charge: f32,
    samples: u32,
    frames: u32,
    dropped: u32,
    clients: usize,
}

impl fmt::Display for Status {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.voltage_v {
            Some(voltage_v) => write!(f, "{voltage_v:6.3} V")?,
            None => write!(f, "  unknown")?,
        }
        write!(
            f,
            "  {:4.1} A  {:3.0} % left | {} samples | {} clients, {} frames, {} dropped",
            self.current_a,
            self.charge * 100.0,
            self.samples,
            self.clients,
            self.frames,
            self.dropped,
        )
    }
}
