//! What the simulator's tasks share: the firmware's state, the pack, and a link for each client.

use std::cell::RefCell;
use std::fmt;
use std::rc::Rc;

use embassy_futures::select::select;

use super::{Clients, PackModel, SimulatedPack};
use crate::liveness::CheckIn;
use crate::tasks::{Link, Shared, schedule_telemetry, write_frames};

/// The simulator: one vehicle on a desk, with as many ground stations as connect.
pub struct Desk {
    /// What the firmware's tasks tell each other.
    pub shared: Shared,
    /// The pack behind the divider.
    pub pack: RefCell<SimulatedPack>,
    links: RefCell<Vec<Rc<Link>>>,
}

impl Desk {
    /// A desk with a full 3S pack and nobody connected.
    pub fn new() -> Self {
        Self {
            shared: Shared::new(),
            pack: RefCell::new(SimulatedPack::full(PackModel::LIPO_3S_2200)),
            links: RefCell::new(Vec::new()),
        }
    }

    /// Serves one client after the other, each with a link of its own: its own schedule, sequence numbers and losses.
    pub async fn serve(&self, clients: &Clients) -> ! {
        // The simulator has no watchdog, so nobody looks at these.
        let (scheduler, writer) = (CheckIn::new("", u32::MAX), CheckIn::new("", u32::MAX));
        loop {
            let wire = clients.next().await;
            println!("{} connected", wire.peer());
            let peer = wire.peer();
            let link = Rc::new(Link::new("TCP"));
            self.links.borrow_mut().push(link.clone());
            select(
                schedule_telemetry(&self.shared, &link, &scheduler),
                write_frames(wire, &self.shared, &link, &writer),
            )
            .await;
            self.links.borrow_mut().retain(|other| !Rc::ptr_eq(other, &link));
            println!("{peer} disconnected");
        }
    }

    /// A line about this moment; `before` is the last one.
    pub fn status(&self, before: &Status) -> Status {
        let links = self.links.borrow();
        let pack = self.pack.borrow();
        let samples = self.shared.samples();
        let frames = links.iter().map(|link| link.statistics().sent).sum();
        let dropped = links.iter().map(|link| link.statistics().dropped).sum();
        Status {
            voltage_v: self.shared.battery().voltage_v,
            current_a: pack.current_a(),
            charge: pack.charge(),
            samples,
            new_samples: samples.wrapping_sub(before.samples),
            frames,
            // A client that leaves takes its count along.
            new_frames: u32::saturating_sub(frames, before.frames),
            dropped,
            clients: links.len(),
        }
    }
}

impl Default for Desk {
    fn default() -> Self {
        Self::new()
    }
}

/// What the terminal's status line says.
#[derive(Clone, Debug, Default)]
pub struct Status {
    voltage_v: Option<f32>,
    current_a: f32,
    charge: f32,
    samples: u32,
    new_samples: u32,
    frames: u32,
    new_frames: u32,
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
            self.new_samples,
            self.clients,
            self.new_frames,
            self.dropped,
        )
    }
}
