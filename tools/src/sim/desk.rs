//! The simulated vehicle and its links to ground stations.

use std::cell::{Cell, RefCell};
use std::rc::Rc;

use embassy_futures::join::{join, join_array, join3};
use embassy_futures::select::{Either, select};
use embassy_time::{Duration, Ticker, Timer};
use rover_battmon::autopilot::Start;
use rover_battmon::battery::{RetainedMemory, RetainedRecord};
use rover_battmon::mavlink::{LinkKind, SIMULATED_LINKS};
use rover_battmon::pack::Pack;
use rover_battmon::sensor::Buses;
use rover_battmon::tasks::{Link, Shared, Storages, reboot_requested, refuse_link, serve_link};
use rover_battmon::vehicle::Restart;

use super::browsers::Browsers;
use super::console::{Level, print_line};
use super::fleet::Role;
use super::links::{LINK_BYTES_PER_SECOND, POLL_MS, UNWATCHED};
use super::scenario::{Player, Scenario};
use super::station::Station;
use super::status::{Comparison, Status};
use super::tasks::{Hardware, NotSimulated, boot};
use super::{
    Client, Clients, PackSimulation, SimulatedBus, SimulatedFlash, SimulatedPack, SimulatedPackInput,
    SimulatedRover, UdpWire,
};

/// Maximum number of TCP clients; UDP and two browsers have links, too.
const MAX_CLIENTS: usize = SIMULATED_LINKS - 3;

/// A ground station by UDP has gone when this many status lines, one a second, were printed since it was heard.
const MOST_SILENT_LINES: u32 = 5;

/// Options of a simulation.
pub struct Setup<'a> {
    /// What the rover is among others.
    pub role: Role<'a>,
    /// Address for ground stations by TCP, if they may connect.
    pub clients: Option<&'a Clients>,
    /// At its remote end another ground station may listen.
    pub udp: &'a UdpWire,
    /// Address for browsers, if they may connect.
    pub web: Option<&'a Clients>,
    /// Survives a restart of the vehicle.
    pub flash: SimulatedFlash,
    /// What happens to the rover until its first restart.
    pub scenario: Option<&'static Scenario>,
    /// Simulated time after which the status is shown again.
    pub status_interval: Duration,
}

/// Runs the vehicle, and restarts it at a ground station's request. Pack, flash and retained RAM survive a restart, connections don't.
/// Returns when a ground station requests the boot loader, which is not simulated.
pub async fn run(setup: Setup<'_>) {
    let pack = RefCell::new(setup.role.pack(setup.scenario));
    let rover = SimulatedRover::default();
    let mut scenario = setup.scenario;
    let mut memory = [RetainedRecord::BLANK; 2];
    loop {
        match run_until_restart(&setup, scenario.take(), &pack, &rover, &mut memory).await {
            Restart::Firmware => setup.role.show_line("Restarted."),
            Restart::Fault => setup.role.show_line("A board would have crashed. Restarted."),
            Restart::BootLoader => {
                return setup
                    .role
                    .show_line("A board would wait in its boot loader for another firmware.");
            }
        }
    }
}

async fn run_until_restart(
    setup: &Setup<'_>,
    scenario: Option<&'static Scenario>,
    pack: &RefCell<SimulatedPack>,
    rover: &SimulatedRover,
    memory: &mut RetainedMemory,
) -> Restart {
    let (desk, storages) = start(setup.role, &setup.flash, scenario, pack).await;
    let links = join3(
        desk.serve_tcp(setup.clients),
        join(
            desk.serve_udp(setup.udp),
            desk.browsers.serve(setup.web, &desk.shared),
        ),
        async {
            if scenario.is_some() || setup.role.shows_announcements() {
                let show = |level, text: &str| setup.role.show_event(level, text);
                desk.serve_station(scenario, show).await;
            }
        },
    );
    let vehicle = join3(
        desk.run_vehicle(storages, rover, memory),
        links,
        desk.show_status(setup.role, setup.status_interval),
    );
    match select(vehicle, reboot_requested(&desk.shared, || desk.all_sent())).await {
        Either::First((.., never)) => never,
        Either::Second(restart) => restart,
    }
}

/// The vehicle as it starts from its flash.
async fn start<'a>(
    role: Role<'_>,
    flash: &'a SimulatedFlash,
    scenario: Option<&'static Scenario>,
    pack: &'a RefCell<SimulatedPack>,
) -> (Desk<'a>, Storages<SimulatedFlash>) {
    let mut start = Start::default();
    if let Some(scenario) = scenario {
        scenario.set_up(&mut start.parameters);
    }
    // The thresholds of its own pack count, not those of the scenario's.
    role.set_up(&mut start);
    let storages = boot(flash, &mut start).await;
    (Desk::new(&start, pack, flash), storages)
}

fn tcp_link(flash: &SimulatedFlash) -> Link<'_> {
    Link::new("TCP", LinkKind::Direct, LINK_BYTES_PER_SECOND).with_logs(flash)
}

struct Desk<'a> {
    shared: Shared,
    pack: &'a RefCell<SimulatedPack>,
    flash: &'a SimulatedFlash,
    /// Of TCP.
    links: RefCell<Vec<Rc<Link<'a>>>>,
    udp: Link<'a>,
    browsers: Browsers<'a>,
    totals: Cell<Totals>,
    /// Status lines since the ground station at the other end of UDP was heard.
    udp_silence: Cell<u32>,
}

impl<'a> Desk<'a> {
    fn new(start: &Start, pack: &'a RefCell<SimulatedPack>, flash: &'a SimulatedFlash) -> Self {
        Self {
            shared: Shared::new(start),
            pack,
            flash,
            links: RefCell::default(),
            udp: Link::new("UDP", LinkKind::Radio, LINK_BYTES_PER_SECOND).with_logs(flash),
            browsers: Browsers::new(flash),
            totals: Cell::default(),
            udp_silence: Cell::new(MOST_SILENT_LINES),
        }
    }

    /// Runs the vehicle's tasks, all but those of its links.
    async fn run_vehicle(
        &self,
        storages: Storages<SimulatedFlash>,
        rover: &SimulatedRover,
        memory: &mut RetainedMemory,
    ) {
        let pack = PackSimulation::new(self.pack, rover, &self.shared);
        let hardware = Hardware {
            pins: SimulatedPackInput::new(&pack),
            bus: Buses::i2c(SimulatedBus::new(&pack)),
            line: NotSimulated,
            wheels: rover,
            lamps: NotSimulated,
            entropy: None,
        };
        hardware
            .run(storages, self.flash.clone(), memory, &self.shared)
            .await;
    }

    /// Serves who connects to `clients`, and refuses who is too many.
    async fn serve_tcp(&self, clients: Option<&Clients>) {
        if let Some(clients) = clients {
            join(
                join_array([(); MAX_CLIENTS].map(|()| self.serve(clients))),
                self.refuse_surplus(clients),
            )
            .await;
        }
    }

    /// Serves one client after the other, each with its own link: schedule, sequence numbers and counters.
    async fn serve(&self, clients: &Clients) {
        loop {
            let client = clients.next().await;
            print_line(&format!("{} connected", client.address));
            let link = Rc::new(tcp_link(self.flash));
            self.links.borrow_mut().push(link.clone());
            serve_link(&client, &client, &self.shared, &link, &UNWATCHED).await;
            self.links.borrow_mut().retain(|other| !Rc::ptr_eq(other, &link));
            print_line(&format!("{} disconnected", client.address));
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
        print_line(&format!(
            "{} refused: all {MAX_CLIENTS} links are in use",
            client.address
        ));
        let reason = format!("Simulator: all {MAX_CLIENTS} links are in use");
        refuse_link(&client, &self.shared, &tcp_link(self.flash), &reason, &UNWATCHED).await;
        client.refuse();
    }

    /// Serves the remote end of `wire`, whether or not it listens.
    async fn serve_udp(&self, wire: &UdpWire) {
        serve_link(wire, wire.receiver(), &self.shared, &self.udp, &UNWATCHED).await;
    }

    /// Shows what the vehicle announces, and plays the scenario, if there is one.
    async fn serve_station(&self, scenario: Option<&'static Scenario>, show: impl Fn(Level, &str)) {
        let player = scenario.map(Player::new);
        let station = Station::new(|level, text: &str| {
            if let Some(player) = &player {
                player.note(text, || self.comparison().charges());
            }
            show(level, text);
        });
        // The link of a program on this computer, as those of TCP.
        let link = Link::new("scenario", LinkKind::Direct, LINK_BYTES_PER_SECOND);
        let play = async {
            if let Some(player) = &player {
                player
                    .play(&station, self.pack, |step| show(Level::Info, step))
                    .await;
                show(Level::Info, &player.closing(self.comparison().charges()));
            }
        };
        join(
            serve_link(&station, &station, &self.shared, &link, &UNWATCHED),
            play,
        )
        .await;
    }

    fn all_sent(&self) -> bool {
        self.stations().all(|link| link.is_idle())
    }

    /// The links by TCP and of browsers.
    fn stations(&self) -> impl Iterator<Item = Rc<Link<'a>>> {
        let by_tcp = self.links.borrow().clone();
        by_tcp.into_iter().chain(self.browsers.links())
    }

    async fn show_status(&self, role: Role<'_>, interval: Duration) -> ! {
        let mut times = Ticker::every(interval);
        loop {
            times.next().await;
            role.show_status(self.next_status());
        }
    }

    /// The true and the estimated state of the pack.
    fn comparison(&self) -> Comparison {
        let pack = self.pack.borrow();
        self.shared
            .with(|autopilot| Comparison::new(&pack, autopilot.battery(Pack::First)))
    }

    /// The status since the previous call.
    fn next_status(&self) -> Status {
        let links: Vec<_> = self.stations().collect();
        let before = self.totals.get();
        let now = Totals {
            samples: self.shared.with(|autopilot| autopilot.samples()),
            frames: links.iter().map(|link| link.statistics().sent).sum(),
            udp_frames: self.udp.statistics().received.frames,
        };
        self.totals.set(now);
        self.udp_silence.set(match now.udp_frames == before.udp_frames {
            true => self.udp_silence.get().saturating_add(1),
            false => 0,
        });
        let by_udp = usize::from(self.udp_silence.get() < MOST_SILENT_LINES);
        Status {
            comparison: self.comparison(),
            vehicle: self.shared.with(|autopilot| autopilot.vehicle().status()),
            stations: links.len() + by_udp,
            samples: now.samples.wrapping_sub(before.samples),
            // The count of a disconnected client is lost.
            frames: now.frames.saturating_sub(before.frames),
            dropped: links.iter().map(|link| link.statistics().dropped).sum(),
        }
    }
}

#[derive(Clone, Copy, Default)]
struct Totals {
    samples: u32,
    /// Sent by TCP and to browsers.
    frames: u32,
    /// Received by UDP.
    udp_frames: u32,
}

#[cfg(test)]
mod tests;
