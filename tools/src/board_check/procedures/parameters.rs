//! Reads and sets parameters.

use rover_battmon::mavlink::dialect::{
    MavMessage, PARAM_REQUEST_LIST_DATA, PARAM_REQUEST_READ_DATA, PARAM_VALUE_DATA,
};

use crate::board_check::evidence::{Evidence, Interruption, ParameterList};
use crate::board_check::session::Session;
use crate::frames::{AUTOPILOT, set_parameter};

/// A list pauses for less, also on a slow link.
const LIST_PAUSE_US: u64 = 3_000_000;

/// A single answer takes less.
const ANSWER_TIMEOUT_US: u64 = 2_000_000;

/// The index of a parameter that belongs to no list.
const UNLISTED: u16 = u16::MAX;

/// Downloads all parameters; what is missing of the list is asked for once more, one by one.
pub fn download(session: &mut Session<'_>, evidence: &mut Evidence) -> Result<(), Interruption> {
    session.send(&MavMessage::PARAM_REQUEST_LIST(PARAM_REQUEST_LIST_DATA {
        target_system: session.system_id(),
        target_component: AUTOPILOT,
    }));
    let mut list = ParameterList::default();
    while !is_complete(&list) && session.wait_for(LIST_PAUSE_US, any_value)?.is_some() {
        take_received(session, &mut list);
    }
    for index in missing(&list) {
        ask_by_index(session, index);
        session.wait_for(ANSWER_TIMEOUT_US, any_value)?;
    }
    take_received(session, &mut list);
    evidence.parameters = Some(list);
    Ok(())
}

fn any_value(message: &MavMessage) -> Option<PARAM_VALUE_DATA> {
    match message {
        MavMessage::PARAM_VALUE(value) => Some(value.clone()),
        _ => None,
    }
}

/// Takes every value that was received, for several may come at once.
fn take_received(session: &Session<'_>, list: &mut ParameterList) {
    let received = session.record().received.iter();
    for value in received.filter_map(|received| any_value(&received.message)) {
        add(list, &value);
    }
}

fn add(list: &mut ParameterList, value: &PARAM_VALUE_DATA) {
    if value.param_index == UNLISTED {
        return;
    }
    list.count = Some(value.param_count);
    let name = value.param_id.to_str().unwrap_or_default();
    list.by_index
        .insert(value.param_index, (name.into(), value.param_value));
}

fn is_complete(list: &ParameterList) -> bool {
    list.count
        .is_some_and(|count| list.by_index.len() >= usize::from(count))
}

fn missing(list: &ParameterList) -> Vec<u16> {
    let all = 0..list.count.unwrap_or(0);
    all.filter(|index| !list.by_index.contains_key(index)).collect()
}

fn ask_by_index(session: &mut Session<'_>, index: u16) {
    // The message has 15 bits for it.
    let Ok(param_index) = i16::try_from(index) else {
        return;
    };
    session.send(&MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
        param_index,
        target_system: session.system_id(),
        target_component: AUTOPILOT,
        param_id: "".into(),
    }));
}

/// Reads a parameter; `None` without an answer.
pub(super) fn read(session: &mut Session<'_>, name: &str) -> Result<Option<f32>, Interruption> {
    session.send(&MavMessage::PARAM_REQUEST_READ(PARAM_REQUEST_READ_DATA {
        param_index: -1,
        target_system: session.system_id(),
        target_component: AUTOPILOT,
        param_id: name.into(),
    }));
    answer_of(session, name)
}

/// Sets a parameter; returns the value that the board answers, `None` without an answer.
pub(super) fn set(session: &mut Session<'_>, name: &str, value: f32) -> Result<Option<f32>, Interruption> {
    post_set(session, name, value);
    answer_of(session, name)
}

/// Sets a parameter without waiting.
pub(super) fn post_set(session: &mut Session<'_>, name: &str, value: f32) {
    session.send(&set_parameter(session.system_id(), name, value));
}

/// The value of a parameter that the board answers; `None` without an answer.
pub(super) fn answer_of(session: &mut Session<'_>, name: &str) -> Result<Option<f32>, Interruption> {
    session.wait_for(ANSWER_TIMEOUT_US, |message| {
        let value = any_value(message)?;
        (value.param_id.to_str() == Ok(name)).then_some(value.param_value)
    })
}
