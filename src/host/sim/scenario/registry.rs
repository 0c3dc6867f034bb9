//! The scenarios there are.

use super::story::Scenario;
use super::{cold, drain, loose_wire, swap};

impl Scenario {
    /// All scenarios.
    pub const ALL: [&'static Self; 4] = [&drain::DRAIN, &swap::SWAP, &cold::COLD, &loose_wire::LOOSE_WIRE];

    /// The one of this name.
    pub fn named(name: &str) -> Option<&'static Self> {
        Self::ALL.into_iter().find(|scenario| scenario.name == name)
    }
}

#[cfg(test)]
mod tests {
    use super::super::story::Action;
    use super::*;
    use crate::parameter::{ParameterId, Parameters};

    #[test]
    fn every_step_can_be_done_in_its_turn() {
        for scenario in Scenario::ALL {
            let times: Vec<_> = scenario.steps.iter().map(|step| step.at_s).collect();
            assert!(times.is_sorted(), "{}: {times:?}", scenario.name);
            assert!(
                times.iter().all(|at_s| *at_s < scenario.end_s),
                "{}: {times:?}",
                scenario.name
            );
            scenario.set_up(&mut Parameters::defaults());
            for action in scenario.steps.iter().flat_map(|step| step.actions) {
                if let Action::Set(name, value) = *action {
                    let id = ParameterId::from_name(name.as_bytes()).expect(name);
                    Parameters::defaults().set(id, value).expect(name);
                }
            }
        }
    }

    #[test]
    fn each_takes_about_a_minute_and_has_a_name_of_its_own() {
        for scenario in Scenario::ALL {
            let wall_s = f64::from(scenario.end_s) / scenario.speedup;
            assert!((45.0..=75.0).contains(&wall_s), "{}: {wall_s} s", scenario.name);
            let same = Scenario::ALL.iter().filter(|other| other.name == scenario.name);
            assert_eq!(same.count(), 1);
            assert!(Scenario::named(scenario.name).is_some());
        }
        assert!(Scenario::named("flood").is_none());
    }
}
