//! Plays a scenario.

use std::cell::{Cell, RefCell};
use std::fmt::Write;

use embassy_time::{Duration, Instant, Ticker};

use super::{Action, Scenario, Step};
use crate::sim::SimulatedPack;
use crate::sim::console::SimulatedTime;
use crate::sim::station::{Heard, Station};

/// Between two messages of the sticks: they time out after 1.5 s (`FS_TIMEOUT`).
const TURN: Duration = Duration::from_millis(200);

/// When something that was looked for was heard first.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Sighting {
    /// What the closing sentence calls it.
    pub name: &'static str,
    /// When, if at all.
    pub at: Option<SimulatedTime>,
}

/// The state of a scenario that is played.
#[derive(Debug)]
pub struct Player {
    scenario: &'static Scenario,
    sightings: RefCell<Vec<Sighting>>,
    throttle: Cell<Option<i16>>,
}

impl Player {
    /// At the start of a scenario.
    pub fn new(scenario: &'static Scenario) -> Self {
        let sightings = scenario.sights.iter().map(|sight| Sighting {
            name: sight.name,
            at: None,
        });
        Self {
            scenario,
            sightings: RefCell::new(sightings.collect()),
            throttle: Cell::new(None),
        }
    }

    /// Does every step in its time, and returns after the last one. `show` prints what a step is.
    pub async fn play<H: Fn(Heard)>(
        &self,
        station: &Station<H>,
        pack: &RefCell<SimulatedPack>,
        show: impl Fn(&str),
    ) {
        let start = Instant::now();
        let mut turns = Ticker::every(TURN);
        let mut steps = self.scenario.steps.iter().peekable();
        while steps.peek().is_some() {
            let elapsed_s = start.elapsed().as_secs();
            while let Some(step) = steps.next_if(|step| u64::from(step.at_s) <= elapsed_s) {
                self.take(step, station, pack, &show);
            }
            if let Some(throttle) = self.throttle.get() {
                station.drive(throttle);
            }
            turns.next().await;
        }
    }

    fn take<H: Fn(Heard)>(
        &self,
        step: &Step,
        station: &Station<H>,
        pack: &RefCell<SimulatedPack>,
        show: impl Fn(&str),
    ) {
        show(step.what);
        for action in step.actions {
            match *action {
                Action::Set(name, value) => station.set(name, value),
                Action::Mode(mode) => station.set_mode(mode),
                Action::Arm(arm_state) => station.arm(arm_state),
                Action::Throttle(throttle) => self.throttle.set(Some(throttle)),
                Action::Unplug => pack.borrow_mut().unplug(),
                Action::PlugIn(plugged) => *pack.borrow_mut() = plugged.pack(),
            }
        }
    }

    /// Notes what the vehicle has announced at `now`.
    pub fn note(&self, text: &str, now: SimulatedTime) {
        let mut sightings = self.sightings.borrow_mut();
        for (sighting, sight) in sightings.iter_mut().zip(self.scenario.sights) {
            if text.starts_with(sight.text) {
                sighting.at.get_or_insert(now);
            }
        }
    }

    /// What was seen, in one sentence.
    pub fn closing(&self) -> String {
        let mut sentence = String::from("Seen:");
        for (place, sighting) in self.sightings.borrow().iter().enumerate() {
            let comma = if place == 0 { "" } else { "," };
            // A string takes everything.
            let _ = match sighting.at {
                Some(at) => write!(sentence, "{comma} {} at {at}", sighting.name),
                None => write!(sentence, "{comma} {} never", sighting.name),
            };
        }
        sentence + "."
    }
}
