use std::collections::BTreeMap;

use proptest::prelude::*;

use crate::memory::storage::FlashFault;
use crate::memory::storage::StorageError::{self, Corrupt, Full, NoErasedSpace};
use crate::pack::Pack;
use crate::parameter::{
    BatteryParameter, PARAMETER_COUNT, ParameterId, ParameterIdSet, Parameters, SaveFailure, VehicleParameter,
};

use super::Unsaved::{self, Reset, Value};

const EXTRA1: ParameterId = ParameterId::Vehicle(VehicleParameter::Sr0Extra1);
const PARAMS: ParameterId = ParameterId::Vehicle(VehicleParameter::Sr0Params);
const VOLT_MULT: ParameterId = ParameterId::Battery(Pack::First, BatteryParameter::VoltMult);

const FLASH: StorageError = StorageError::Flash(FlashFault::NotVerified);

/// Parameters with unsaved `changes`.
fn changed(changes: &[(ParameterId, f32)]) -> Parameters {
    let mut parameters = Parameters::defaults();
    for (id, value) in changes {
        parameters.set(*id, *value).unwrap();
    }
    parameters
}

/// Writes all due changes to a flash that returns `answer`; returns the writes and the errors to report.
fn save(
    parameters: &mut Parameters,
    answer: impl Fn(Unsaved) -> Result<(), StorageError>,
) -> (Vec<Unsaved>, Vec<StorageError>) {
    let (mut written, mut reports) = (Vec::new(), Vec::new());
    while let Some(unsaved) = parameters.next_unsaved() {
        written.push(unsaved);
        assert!(written.len() <= PARAMETER_COUNT + 1, "endless");
        match answer(unsaved) {
            Ok(()) => parameters.mark_saved(unsaved),
            Err(error) => reports.extend(parameters.mark_failed(unsaved, error)),
        }
    }
    (written, reports)
}

/// Saves with a flash that works; returns the writes.
fn save_all(parameters: &mut Parameters) -> Vec<Unsaved> {
    save(parameters, |_| Ok(())).0
}

/// A flash that is too full for one parameter.
fn without_room_for(full: ParameterId) -> impl Fn(Unsaved) -> Result<(), StorageError> {
    move |unsaved| match unsaved {
        Value(id, _) if id == full => Err(Full),
        _ => Ok(()),
    }
}

#[test]
fn only_changed_values_are_saved_once() {
    let mut parameters = changed(&[(EXTRA1, 2.0)]);
    assert_eq!(parameters.next_unsaved(), None);
    parameters.set(EXTRA1, 5.0).unwrap();
    parameters.set(VOLT_MULT, 4.0).unwrap();
    let written = save_all(&mut parameters);
    assert_eq!(written, [Value(EXTRA1, 5.0), Value(VOLT_MULT, 4.0)]);
    assert_eq!(parameters.next_unsaved(), None);
}

#[test]
fn defaults_are_saved_if_flash_was_not_loaded() {
    let mut parameters = Parameters::defaults();
    parameters.mark_not_read();
    assert_eq!(parameters.next_unsaved(), None);
    parameters.set(EXTRA1, 2.0).unwrap();
    assert_eq!(parameters.next_unsaved(), Some(Value(EXTRA1, 2.0)));
    parameters.mark_saved(Value(EXTRA1, 2.0));
    assert_eq!(parameters.next_unsaved(), None);
}

#[test]
fn value_changed_during_saving_is_saved_again() {
    let mut parameters = changed(&[(EXTRA1, 5.0)]);
    parameters.set(EXTRA1, 6.0).unwrap();
    parameters.mark_saved(Value(EXTRA1, 5.0));
    assert_eq!(parameters.next_unsaved(), Some(Value(EXTRA1, 6.0)));
}

#[test]
fn reset_is_live_at_once_and_erases_before_storing() {
    let mut parameters = changed(&[(EXTRA1, 5.0), (VOLT_MULT, 4.0)]);
    parameters.reset();
    assert_eq!(parameters.get(EXTRA1), 2.0);
    parameters.set(VOLT_MULT, 4.1).unwrap();
    assert_eq!(save_all(&mut parameters), [Reset, Value(VOLT_MULT, 4.1)]);
    assert_eq!(parameters.get(VOLT_MULT), 4.1);
}

#[test]
// Requirement: L-18
fn value_set_after_a_failed_reset_waits_for_the_reset() {
    let mut parameters = changed(&[(EXTRA1, 5.0)]);
    parameters.reset();
    assert_eq!(save(&mut parameters, |_| Err(FLASH)), (vec![Reset], vec![FLASH]));
    assert_eq!(parameters.next_unsaved(), None, "waits for a retry");

    parameters.set(VOLT_MULT, 4.1).unwrap();
    assert_eq!(save(&mut parameters, |_| Err(FLASH)), (vec![Reset], vec![FLASH]));
    parameters.retry_failed();
    assert_eq!(save(&mut parameters, |_| Err(FLASH)), (vec![Reset], vec![]));
    assert_eq!(parameters.get(VOLT_MULT), 4.1);

    parameters.retry_failed();
    assert_eq!(save_all(&mut parameters), [Reset, Value(VOLT_MULT, 4.1)]);
    assert_eq!(parameters.save_failure(), None);
}

#[test]
// Requirement: L-18
fn value_without_space_does_not_block_the_others() {
    let mut parameters = changed(&[(EXTRA1, 5.0), (PARAMS, 7.0), (VOLT_MULT, 4.0)]);
    let (written, reports) = save(&mut parameters, without_room_for(EXTRA1));
    assert_eq!(
        written,
        [Value(EXTRA1, 5.0), Value(PARAMS, 7.0), Value(VOLT_MULT, 4.0)]
    );
    assert_eq!(
        (reports, parameters.save_failure().map(|failure| failure.error)),
        (vec![Full], Some(Full))
    );

    parameters.set(PARAMS, 8.0).unwrap();
    let (written, reports) = save(&mut parameters, without_room_for(EXTRA1));
    assert_eq!((written, reports), (vec![Value(PARAMS, 8.0)], vec![]));
    parameters.set(EXTRA1, 6.0).unwrap();
    assert_eq!(parameters.next_unsaved(), Some(Value(EXTRA1, 6.0)), "set again");
}

#[test]
fn failed_flash_is_tried_once_and_all_changes_wait() {
    for error in [FLASH, Corrupt] {
        let mut parameters = changed(&[(EXTRA1, 5.0), (PARAMS, 7.0)]);
        let (written, reports) = save(&mut parameters, |_| Err(error));
        assert_eq!((written, reports), (vec![Value(EXTRA1, 5.0)], vec![error]));
        parameters.retry_failed();
        let written = save_all(&mut parameters);
        assert_eq!(written, [Value(EXTRA1, 5.0), Value(PARAMS, 7.0)]);
    }
}

#[test]
fn changes_without_erased_space_are_counted_and_wait_together() {
    let mut parameters = changed(&[(EXTRA1, 5.0), (PARAMS, 7.0)]);
    assert_eq!(parameters.save_failure(), None);
    let (written, reports) = save(&mut parameters, |_| Err(NoErasedSpace));
    assert_eq!((written.len(), reports), (1, vec![NoErasedSpace]));
    parameters.set(VOLT_MULT, 4.0).unwrap();
    parameters.set(PARAMS, 8.0).unwrap();
    save(&mut parameters, |_| Err(NoErasedSpace));
    let failure = parameters.save_failure();
    assert_eq!(
        failure,
        Some(SaveFailure {
            error: NoErasedSpace,
            changes: 3
        })
    );
    parameters.retry_failed();
    let written = save_all(&mut parameters);
    assert_eq!(
        written,
        [Value(EXTRA1, 5.0), Value(PARAMS, 8.0), Value(VOLT_MULT, 4.0)]
    );
    assert_eq!(parameters.save_failure(), None);
}

#[test]
fn failure_is_reported_again_after_a_set_or_a_new_error() {
    let mut parameters = changed(&[(EXTRA1, 5.0)]);
    let mut reports_of = |set: Option<(ParameterId, f32)>, error| {
        if let Some((id, value)) = set {
            parameters.set(id, value).unwrap();
        }
        parameters.retry_failed();
        save(&mut parameters, |_| Err(error)).1
    };
    assert_eq!(reports_of(None, FLASH), [FLASH]);
    assert_eq!(reports_of(None, FLASH), []);
    assert_eq!(
        reports_of(None, StorageError::Flash(FlashFault::Other)),
        [],
        "the flash again"
    );
    assert_eq!(reports_of(Some((PARAMS, 7.0)), FLASH), [FLASH]);
    assert_eq!(reports_of(Some((EXTRA1, 6.0)), FLASH), [FLASH]);
    assert_eq!(reports_of(Some((EXTRA1, 6.0)), FLASH), [FLASH], "the same value");
    assert_eq!(reports_of(None, Full), [Full], "one for both");
    assert_eq!(reports_of(None, Full), []);
}

#[test]
fn reset_clears_failed_changes() {
    let mut parameters = changed(&[(EXTRA1, 5.0)]);
    save(&mut parameters, |_| Err(Full));
    parameters.reset();
    assert_eq!(save_all(&mut parameters), [Reset]);
    assert_eq!(parameters.save_failure(), None);
}

/// A request of a ground station, or an attempt to write.
#[derive(Clone, Debug)]
enum Step {
    Set(usize, f32),
    Reset,
    Retry,
    /// One write with its result.
    Write(Result<(), StorageError>),
    /// One successful write with a request during it.
    WriteWhile(Box<Step>),
}

fn steps() -> impl Strategy<Value = Vec<Step>> {
    // Few parameters and values, so that they collide.
    let asked = prop_oneof![
        6 => (0..6_usize, 1..4_u8).prop_map(|(number, value)| Step::Set(number, f32::from(value))),
        1 => Just(Step::Reset),
        1 => Just(Step::Retry),
    ];
    let result = prop_oneof![
        3 => Just(Ok(())),
        1 => Just(Err(FLASH)),
        1 => Just(Err(Full)),
        1 => Just(Err(NoErasedSpace)),
    ];
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
    let parameter = if number < packs.len() {
        BatteryParameter::Capacity
    } else {
        BatteryParameter::VoltMult
    };
    parameter.of(packs[number % packs.len()])
}

/// The parameters, their expected values, and the flash.
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
            Step::Write(_) | Step::WriteWhile(_) => unreachable!("no request"),
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

    /// The parameters after a restart.
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
    // Requirement: L-18
    fn latest_values_are_live_and_saved_once_flash_works(steps in steps()) {
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

const CHECKED: ParameterId = ParameterId::Vehicle(VehicleParameter::ParamChecked);
const DAMAGED: Unsaved = Value(CHECKED, f32::from_bits(1));
const HALF_LOADED: Unsaved = Value(CHECKED, f32::from_bits(2));
const NO_MARK: Unsaved = Value(CHECKED, 0.0);

fn set_of(id: ParameterId) -> ParameterIdSet {
    let mut set = ParameterIdSet::default();
    set.insert(id);
    set
}

#[test]
fn the_mark_of_a_trouble_is_saved_before_all_and_taken_back_after_all() {
    let mut parameters = changed(&[(VOLT_MULT, 4.0)]);
    parameters.set_by_file(VOLT_MULT, 1);
    parameters.end_file(1, &set_of(VOLT_MULT));
    assert_eq!(parameters.trouble(), None);
    let written = save_all(&mut parameters);
    assert_eq!(written, [HALF_LOADED, Value(VOLT_MULT, 4.0), NO_MARK]);

    parameters.mark_damaged();
    parameters.set(EXTRA1, 5.0).unwrap();
    assert_eq!(save_all(&mut parameters), [DAMAGED, Value(EXTRA1, 5.0)]);
    parameters.confirm();
    assert_eq!(save_all(&mut parameters), [NO_MARK]);
}

#[test]
// Requirement: L-18
fn nothing_is_saved_before_a_mark_that_could_not_be() {
    let mut parameters = changed(&[(VOLT_MULT, 4.0)]);
    parameters.set_by_file(VOLT_MULT, 1);
    let (written, reports) = save(&mut parameters, without_room_for(CHECKED));
    assert_eq!((written, reports), (vec![HALF_LOADED], vec![Full]));
    parameters.set(EXTRA1, 5.0).unwrap();
    assert_eq!(parameters.next_unsaved(), None);
    parameters.retry_failed();
    let written = save_all(&mut parameters);
    assert_eq!(written, [HALF_LOADED, Value(EXTRA1, 5.0), Value(VOLT_MULT, 4.0)]);
}

#[test]
fn a_mark_stays_while_a_value_of_its_file_is_not_saved() {
    let mut parameters = changed(&[(EXTRA1, 5.0), (VOLT_MULT, 4.0)]);
    parameters.set_by_file(VOLT_MULT, 1);
    parameters.end_file(1, &set_of(VOLT_MULT));
    let (written, _) = save(&mut parameters, without_room_for(EXTRA1));
    assert_eq!(written, [HALF_LOADED, Value(EXTRA1, 5.0), Value(VOLT_MULT, 4.0)]);
    assert_eq!(parameters.trouble(), None);
    parameters.retry_failed();
    assert_eq!(save_all(&mut parameters), [Value(EXTRA1, 5.0), NO_MARK]);
}

#[test]
fn a_reset_takes_every_mark_with_it() {
    let mut parameters = changed(&[(VOLT_MULT, 4.0)]);
    parameters.mark_damaged();
    parameters.set_by_file(VOLT_MULT, 1);
    parameters.reset();
    assert_eq!(parameters.trouble(), None);
    assert_eq!(save_all(&mut parameters), [Reset]);
}
