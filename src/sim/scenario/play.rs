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

/// The first time that something was heard.
#[derive(Clone, Debug)]
struct Sighting {
    at: SimulatedTime,
    /// The charge of the pack, and what was estimated of it.
    charges: String,
}

/// A scenario that is played.
#[derive(Debug)]
pub(in crate::sim) struct Player {
    scenario: &'static Scenario,
    /// Of each sight of the scenario.
    sightings: RefCell<Vec<Option<Sighting>>>,
    throttle: Cell<Option<i16>>,
}

impl Player {
    /// At the start of a scenario.
    pub fn new(scenario: &'static Scenario) -> Self {
        Self {
            scenario,
            sightings: RefCell::new(vec![None; scenario.sights.len()]),
            throttle: Cell::new(None),
        }
    }

    /// Does every step in its time, and returns at the end. `show` prints what a step is.
    pub async fn play<H: Fn(Heard)>(
        &self,
        station: &Station<H>,
        pack: &RefCell<SimulatedPack>,
        show: impl Fn(&str),
    ) {
        let start = Instant::now();
        let mut turns = Ticker::every(TURN);
        let mut steps = self.scenario.steps.iter().peekable();
        while start.elapsed() < Duration::from_secs(self.scenario.end_s.into()) {
            let is_due = |step: &&Step| Duration::from_secs(step.at_s.into()) <= start.elapsed();
            while let Some(step) = steps.next_if(is_due) {
                show(step.what);
                self.take(step, station, pack);
            }
            if let Some(throttle) = self.throttle.get() {
                station.drive(throttle);
            }
            turns.next().await;
        }
    }

    fn take<H: Fn(Heard)>(&self, step: &Step, station: &Station<H>, pack: &RefCell<SimulatedPack>) {
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

    /// Notes what the vehicle has announced, with the charge of the pack and what is estimated of it.
    pub fn note(&self, text: &str, charges: impl Fn() -> String) {
        let mut sightings = self.sightings.borrow_mut();
        for (sighting, sight) in sightings.iter_mut().zip(self.scenario.sights) {
            if sight.texts.iter().any(|wanted| text.starts_with(wanted)) {
                sighting.get_or_insert_with(|| Sighting {
                    at: SimulatedTime::now(),
                    charges: charges(),
                });
            }
        }
    }

    /// What was seen, in one sentence.
    pub fn closing(&self) -> String {
        let mut sentence = String::from("Seen:");
        for (place, (sighting, sight)) in self
            .sightings
            .borrow()
            .iter()
            .zip(self.scenario.sights)
            .enumerate()
        {
            let comma = if place == 0 { "" } else { "," };
            // A string takes everything.
            let _ = match sighting {
                Some(Sighting { at, charges }) => {
                    write!(sentence, "{comma} {} at {at} ({charges})", sight.name)
                }
                None => write!(sentence, "{comma} {} never", sight.name),
            };
        }
        sentence + "."
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closing_sentence_has_the_first_time_of_each_sight() {
        let player = Player::new(Scenario::named("drain").unwrap());
        let charges = || "9 % left, 15 ±4 % estimated".to_owned();
        player.note("Battery 1 has 3 cells", charges);
        player.note("Battery 1 is low 10.77V used 0 mAh", charges);
        player.note("Battery 1 low: 10.85V 15% left", || "later".to_owned());
        player.note("HOLD, armed", charges);
        assert_eq!(
            player.closing(),
            "Seen: low at 0:00 (9 % left, 15 ±4 % estimated), critical never, \
             HOLD at 0:00 (9 % left, 15 ±4 % estimated)."
        );
    }
}
