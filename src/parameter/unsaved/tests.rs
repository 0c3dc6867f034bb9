use std::collections::BTreeMap;

use proptest::prelude::*;

use crate::parameter::{BatteryParameter, PARAMETER_COUNT, Pack, ParameterId, Parameters, VehicleParameter};
use crate::storage::StorageError::{self, Corrupt, Flash, Full};

use super::Unsaved::{self, Reset, Value};

const EXTRA1: ParameterId = ParameterId::Vehicle(VehicleParameter::Sr0Extra1);
const PARAMS: ParameterId = ParameterId::Vehicle(VehicleParameter::Sr0Params);
const VOLT_MULT: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::VoltMult);

/// Those of `changes`, which are not in flash yet.
fn changed(changes: &[(ParameterId, f32)]) -> Parameters {
    let mut parameters = Parameters::defaults();
    for (id, value) in changes {
        parameters.set(*id, *value).unwrap();
    }
    parameters
}

/// Writes everything that is due to a flash that answers as `answer` does; returns what it was asked for and what has to
/// be reported.
fn save(
    parameters: &mut Parameters,
    answer: impl Fn(Unsaved) -> Result<(), StorageError>,
) -> (Vec<Unsaved>, Vec<StorageError>) {
    let (mut asked, mut reports) = (Vec::new(), Vec::new());
    while let Some(unsaved) = parameters.next_unsaved() {
        asked.push(unsaved);
        assert!(asked.len() <= PARAMETER_COUNT + 1, "it does not end");
        match answer(unsaved) {
            Ok(()) => parameters.mark_saved(unsaved),
            Err(error) => reports.extend(parameters.mark_failed(unsaved, error)),
        }
    }
    (asked, reports)
}

#[test]
fn only_a_changed_value_has_to_be_saved_and_once() {
    let mut parameters = changed(&[(EXTRA1, 2.0)]);
    assert_eq!(parameters.next_unsaved(), None);
    parameters.set(EXTRA1, 5.0).unwrap();
    parameters.set(VOLT_MULT, 4.0).unwrap();
    let (asked, _) = save(&mut parameters, |_| Ok(()));
    assert_eq!(asked, [Value(EXTRA1, 5.0), Value(VOLT_MULT, 4.0)]);
    assert_eq!(parameters.next_unsaved(), None);
}

#[test]
fn with_stored_values_unread_a_default_has_to_be_saved_too() {
    let mut parameters = Parameters::defaults();
    parameters.leave_stored_unread();
    assert_eq!(parameters.next_unsaved(), None);
    parameters.set(EXTRA1, 2.0).unwrap();
    assert_eq!(parameters.next_unsaved(), Some(Value(EXTRA1, 2.0)));
    parameters.mark_saved(Value(EXTRA1, 2.0));
    assert_eq!(parameters.next_unsaved(), None);
}

#[test]
fn a_value_that_changes_while_it_is_saved_is_saved_again() {
    let mut parameters = changed(&[(EXTRA1, 5.0)]);
    parameters.set(EXTRA1, 6.0).unwrap();
    parameters.mark_saved(Value(EXTRA1, 5.0));
    assert_eq!(parameters.next_unsaved(), Some(Value(EXTRA1, 6.0)));
}

#[test]
fn a_reset_is_live_at_once_and_cleared_before_anything_is_stored() {
    let mut parameters = changed(&[(EXTRA1, 5.0), (VOLT_MULT, 4.0)]);
    parameters.reset();
    assert_eq!(parameters.get(EXTRA1), 2.0);
    parameters.set(VOLT_MULT, 4.1).unwrap();
    let (asked, _) = save(&mut parameters, |_| Ok(()));
    assert_eq!(asked, [Reset, Value(VOLT_MULT, 4.1)]);
    assert_eq!(parameters.get(VOLT_MULT), 4.1);
}

#[test]
fn what_is_set_after_a_reset_that_failed_stays_and_waits_for_it() {
    let mut parameters = changed(&[(EXTRA1, 5.0)]);
    parameters.reset();
    assert_eq!(save(&mut parameters, |_| Err(Flash)), (vec![Reset], vec![Flash]));
    assert_eq!(parameters.next_unsaved(), None, "it waits");

    parameters.set(VOLT_MULT, 4.1).unwrap();
    assert_eq!(save(&mut parameters, |_| Err(Flash)), (vec![Reset], vec![Flash]));
    parameters.retry_failed();
    assert_eq!(save(&mut parameters, |_| Err(Flash)), (vec![Reset], vec![]));
    assert_eq!(parameters.get(VOLT_MULT), 4.1);

    parameters.retry_failed();
    let (asked, _) = save(&mut parameters, |_| Ok(()));
    assert_eq!(asked, [Reset, Value(VOLT_MULT, 4.1)]);
    assert_eq!(parameters.save_failure(), None);
}

#[test]
fn one_without_room_does_not_keep_back_the_others() {
    let no_room_for_extra1 = |unsaved| match unsaved {
        Value(EXTRA1, _) => Err(Full),
        _ => Ok(()),
    };
    let mut parameters = changed(&[(EXTRA1, 5.0), (PARAMS, 7.0), (VOLT_MULT, 4.0)]);
    let (asked, reports) = save(&mut parameters, no_room_for_extra1);
    assert_eq!(
        asked,
        [Value(EXTRA1, 5.0), Value(PARAMS, 7.0), Value(VOLT_MULT, 4.0)]
    );
    assert_eq!((reports, parameters.save_failure()), (vec![Full], Some(Full)));

    parameters.set(PARAMS, 8.0).unwrap();
    let (asked, reports) = save(&mut parameters, no_room_for_extra1);
    assert_eq!((asked, reports), (vec![Value(PARAMS, 8.0)], vec![]));
}

#[test]
fn a_flash_that_fails_is_asked_once_and_everything_waits() {
    for error in [Flash, Corrupt] {
        let mut parameters = changed(&[(EXTRA1, 5.0), (PARAMS, 7.0)]);
        let (asked, reports) = save(&mut parameters, |_| Err(error));
        assert_eq!((asked, reports), (vec![Value(EXTRA1, 5.0)], vec![error]));
        parameters.retry_failed();
        let (asked, _) = save(&mut parameters, |_| Ok(()));
        assert_eq!(asked, [Value(EXTRA1, 5.0), Value(PARAMS, 7.0)]);
    }
}

#[test]
fn a_failure_is_reported_again_for_another_set_and_for_another_reason() {
    let mut parameters = changed(&[(EXTRA1, 5.0)]);
    let mut reports_of = |set: Option<(ParameterId, f32)>, error| {
        if let Some((id, value)) = set {
            parameters.set(id, value).unwrap();
        }
        parameters.retry_failed();
        save(&mut parameters, |_| Err(error)).1
    };
    assert_eq!(reports_of(None, Flash), [Flash]);
    assert_eq!(reports_of(None, Flash), []);
    assert_eq!(reports_of(Some((PARAMS, 7.0)), Flash), [Flash]);
    assert_eq!(reports_of(Some((EXTRA1, 6.0)), Flash), [Flash]);
    assert_eq!(reports_of(Some((EXTRA1, 6.0)), Flash), [Flash], "the same value");
    assert_eq!(reports_of(None, Full), [Full, Full], "one for each");
    assert_eq!(reports_of(None, Full), []);
}

#[test]
fn a_reset_forgets_what_could_not_be_saved() {
    let mut parameters = changed(&[(EXTRA1, 5.0)]);
    save(&mut parameters, |_| Err(Full));
    parameters.reset();
    assert_eq!(save(&mut parameters, |_| Ok(())).0, [Reset]);
    assert_eq!(parameters.save_failure(), None);
}

/// What a ground station does, and what becomes of an attempt to write.
#[derive(Clone, Debug)]
enum Step {
    Set(usize, f32),
    Reset,
    Retry,
    /// One write, and how it ends.
    Write(Result<(), StorageError>),
    /// One write that ends well, during which this happens.
    WriteWhile(Box<Step>),
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    // Few parameters and few values, so that they meet.
    let asked = prop_oneof![
        6 => (0..6_usize, 1..4_u8).prop_map(|(number, value)| Step::Set(number, f32::from(value))),
        1 => Just(Step::Reset),
        1 => Just(Step::Retry),
    ];
    let result = prop_oneof![3 => Just(Ok(())), 1 => Just(Err(Flash)), 1 => Just(Err(Full))];
    let step = prop_oneof![
        3 => asked.clone(),
        3 => result.prop_map(Step::Write),
        1 => asked.prop_map(|during| Step::WriteWhile(Box::new(during))),
    ];
    prop::collection::vec(step, 0..60)
}

/// Six parameters that take 1, 2 and 3.
fn numbered(number: usize) -> ParameterId {
    let packs = [Pack::First, Pack::Second, Pack::Third];
    let capacity = |number: usize| BatteryParameter::Capacity.of(packs[number % packs.len()]);
    let multiplier = |number: usize| BatteryParameter::VoltMult.of(packs[number % packs.len()]);
    if number < packs.len() {
        capacity(number)
    } else {
        multiplier(number)
    }
}

/// The parameters, what they should be, and the flash.
#[derive(Default)]
struct Model {
    live: Parameters,
    expected: BTreeMap<u16, f32>,
    stored: BTreeMap<u16, f32>,
}

impl Model {
    fn ask(&mut self, step: &Step) {
        match step {
            Step::Set(number, value) => {
                let id = numbered(*number);
                self.live.set(id, *value).unwrap();
                self.expected.insert(id.key(), *value);
            }
            Step::Reset => {
                self.live.reset();
                self.expected.clear();
            }
            Step::Retry => self.live.retry_failed(),
            Step::Write(_) | Step::WriteWhile(_) => unreachable!("nothing is asked"),
        }
    }

    fn store(&mut self, unsaved: Unsaved) {
        match unsaved {
            Reset => self.stored.clear(),
            Value(id, value) => {
                self.stored.insert(id.key(), value);
            }
        }
    }

    fn take(&mut self, step: &Step) {
        match step {
            Step::Write(result) => {
                let Some(unsaved) = self.live.next_unsaved() else {
                    return;
                };
                match result {
                    Ok(()) => {
                        self.store(unsaved);
                        self.live.mark_saved(unsaved);
                    }
                    Err(error) => {
                        let _ = self.live.mark_failed(unsaved, *error);
                        assert!(self.live.save_failure().is_some());
                    }
                }
            }
            Step::WriteWhile(during) => {
                let Some(unsaved) = self.live.next_unsaved() else {
                    return;
                };
                self.store(unsaved);
                self.ask(during);
                self.live.mark_saved(unsaved);
            }
            asked => self.ask(asked),
        }
        for id in ParameterId::all() {
            let expected = self.expected.get(&id.key()).copied();
            assert_eq!(
                self.live.get(id),
                expected.unwrap_or(id.default_value()),
                "{}",
                id.name()
            );
        }
    }

    /// What a restart would find.
    fn after_a_restart(&self) -> Parameters {
        let mut parameters = Parameters::defaults();
        for (key, value) in &self.stored {
            parameters.restore(*key, *value).unwrap();
        }
        parameters
    }
}

proptest! {
    #[test]
    fn whatever_fails_what_was_set_last_is_live_and_in_flash_once_that_works(steps in steps()) {
        let mut model = Model::default();
        for step in &steps {
            model.take(step);
        }
        model.live.retry_failed();
        while model.live.next_unsaved().is_some() {
            model.take(&Step::Write(Ok(())));
        }
        prop_assert_eq!(model.live.save_failure(), None);
        let restarted = model.after_a_restart();
        for id in ParameterId::all() {
            prop_assert_eq!(restarted.get(id), model.live.get(id), "{}", id.name());
        }
    }
}
