//! Plays a scenario.

use std::cell::{Cell, RefCell};

use embassy_time::{Duration, Instant, Ticker};

use super::{Action, Scenario, Step};
use crate::sim::SimulatedPack;
use crate::sim::console::{Level, simulated_time};
use crate::sim::station::Station;

/// Between two messages of the sticks: they time out after 1.5 s (`FS_TIMEOUT`).
const TURN: Duration = Duration::from_millis(200);

/// The first time that something was heard.
#[derive(Clone, Debug)]
struct Sighting {
    at: String,
    /// The charge of the pack, and what was estimated of it.
    charges: String,
}

/// A scenario that is played.
#[derive(Debug)]
pub struct Player {
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
    pub async fn play<H: Fn(Level, &str)>(
        &self,
        station: &Station<H>,
        pack: &RefCell<SimulatedPack>,
        show: impl Fn(&str),
    ) {
        let start = Instant::now();
        let mut turns = Ticker::every(TURN);
        let mut steps = self.scenario.steps.iter().peekable();
        while start.elapsed() < Duration::from_secs(self.scenario.end_s.into()) {
            let is_due = |(at_s, ..): &&Step| Duration::from_secs((*at_s).into()) <= start.elapsed();
            while let Some((_, what, actions)) = steps.next_if(is_due) {
                show(what);
                self.take(actions, station, pack);
            }
            if let Some(throttle) = self.throttle.get() {
                station.drive(throttle);
            }
            turns.next().await;
        }
    }

    fn take<H: Fn(Level, &str)>(
        &self,
        actions: &[Action],
        station: &Station<H>,
        pack: &RefCell<SimulatedPack>,
    ) {
        for action in actions {
            match action {
                Action::Set(name, value) => station.set(name, *value),
                Action::Mode(mode) => station.set_mode(*mode),
                Action::Arm(arm_state) => station.arm(*arm_state),
                Action::Throttle(throttle) => {
                    // A stick drives once it has been centred.
                    station.drive(0);
                    self.throttle.set(Some(*throttle));
                }
                Action::Unplug => pack.borrow_mut().unplug(),
                Action::PlugIn(plugged) => pack.borrow_mut().clone_from(plugged),
            }
        }
    }

    /// Notes what the vehicle has announced, with the charge of the pack and what is estimated of it.
    pub fn note(&self, text: &str, charges: impl Fn() -> String) {
        let mut sightings = self.sightings.borrow_mut();
        for (sighting, (_, texts)) in sightings.iter_mut().zip(self.scenario.sights) {
            if texts.iter().any(|wanted| text.starts_with(wanted)) {
                sighting.get_or_insert_with(|| Sighting {
                    at: simulated_time(),
                    charges: charges(),
                });
            }
        }
    }

    /// What was seen, in one sentence; charges stand where they have changed. `charges` are those of now.
    pub fn closing(&self, charges: String) -> String {
        let mut parts = Vec::new();
        let mut written = "";
        let sightings = self.sightings.borrow();
        for (sighting, (name, _)) in sightings.iter().zip(self.scenario.sights) {
            parts.push(match sighting {
                Some(sighting) if sighting.charges == written => format!("{name} at {}", sighting.at),
                Some(sighting) => format!("{name} at {} ({})", sighting.at, sighting.charges),
                None => format!("{name} never"),
            });
            written = sighting
                .as_ref()
                .map_or(written, |sighting| sighting.charges.as_str());
        }
        if charges != written {
            parts.push(format!("at the end {charges}"));
        }
        format!("Seen: {}. Ctrl-C ends it.", parts.join(", "))
    }
}

#[cfg(test)]
mod tests {
    use embassy_time::Timer;

    use super::*;
    use crate::sim::clock;

    #[test]
    fn the_closing_sentence_has_the_first_time_of_each_sight() {
        let closing = clock::run_for(Duration::from_secs(100), async {
            let player = Player::new(Scenario::named("drain").unwrap());
            let charges = || "9 % left, 15 ±4 % estimated".to_owned();
            player.note("Battery 1 has 3 cells", charges);
            Timer::after_secs(61).await;
            player.note("Battery 1 is low 10.77V used 0 mAh", charges);
            Timer::after_secs(5).await;
            player.note("Battery 1 low: 10.85V 15% left", || "later".to_owned());
            player.note("HOLD, armed", charges);
            player.closing("4 % left, 5 ±2 % estimated".to_owned())
        });
        assert_eq!(
            closing.unwrap(),
            "Seen: low at 1:01 (9 % left, 15 ±4 % estimated), critical never, HOLD at 1:06, \
             at the end 4 % left, 5 ±2 % estimated. Ctrl-C ends it."
        );
    }
}
