//! The parameter protocol: PARAM_REQUEST_LIST, PARAM_REQUEST_READ and PARAM_SET.
//!
//! Values travel as floats, whole numbers too (`MAV_PROTOCOL_CAPABILITY_PARAM_ENCODE_C_CAST`). The type in a PARAM_SET is
//! ignored: some ground stations always say REAL32.

use super::Context;
use crate::mavlink::dialect::{MavParamError, MavParamType, PARAM_ERROR_DATA, PARAM_VALUE_DATA};
use crate::mavlink::event::Event;
use crate::mavlink::payload::Name;
use crate::mavlink::{Message, Peer};
use crate::parameter::{Kind, NamedParameter, ParameterId, ParameterIdSet, Parameters, Refused, triggers};
use crate::time::{Cadence, Instant};
use crate::vehicle::ArmState;

/// A PARAM_VALUE on the wire: header, 25 bytes of payload, checksum.
const PARAM_VALUE_FRAME_BYTES: f32 = 37.0;

/// A list takes at most this share of the link.
const LIST_SHARE: f32 = 0.3;

/// PARAM_REQUEST_READ: read by name.
const BY_NAME: i16 = -1;

/// PARAM_VALUE, index: the parameter has none, since it is not listed, or its value comes unasked. Another index would count as
/// one of a list that a ground station reads: QGroundControl would ask for no missing ones, and MAVProxy would miscount.
const NO_INDEX: u16 = u16::MAX;

/// The PARAM_VALUE of a parameter.
pub fn param_value(id: ParameterId, parameters: &Parameters) -> Message {
    param_value_of(id.into(), parameters.get(id), parameters)
}

/// This value under a name of its parameter. A newer name is in no list.
fn param_value_of(named: NamedParameter, value: f32, parameters: &Parameters) -> Message {
    let index = parameters.listed_index(named.id).filter(|_| !named.is_newer());
    indexed_param_value(named, value, index, parameters)
}

fn indexed_param_value(
    named: NamedParameter,
    value: f32,
    index: Option<usize>,
    parameters: &Parameters,
) -> Message {
    Message::ParamValue(PARAM_VALUE_DATA {
        param_value: value,
        param_count: parameters.listed_count() as u16,
        param_index: index.map_or(NO_INDEX, |index| index as u16),
        param_id: Name::from(named.name().as_str()).0.into(),
        param_type: match named.id.row().kind {
            Kind::Int8 => MavParamType::MAV_PARAM_TYPE_INT8,
            Kind::Int16 => MavParamType::MAV_PARAM_TYPE_INT16,
            Kind::Int32 => MavParamType::MAV_PARAM_TYPE_INT32,
            Kind::Real32 => MavParamType::MAV_PARAM_TYPE_REAL32,
        },
    })
}

fn param_error(name: Name, index: i16, error: MavParamError, to: Peer) -> Message {
    Message::ParamError(PARAM_ERROR_DATA {
        param_index: index,
        target_system: to.system_id,
        target_component: to.component_id,
        param_id: name.0.into(),
        error,
    })
}

/// Answers PARAM_REQUEST_READ.
pub fn read(index: i16, name: Name, from: Peer, context: &mut Context<'_>) -> Event {
    let parameters = &*context.changeable.parameters;
    let named = if index == BY_NAME {
        NamedParameter::from_name(name.as_bytes())
    } else {
        let index = usize::try_from(index).ok();
        index
            .and_then(|index| parameters.listed().nth(index))
            .map(NamedParameter::from)
    };
    context.outbox.answer(match named {
        Some(named) => {
            let value = named.from_own(parameters.get(named.id));
            param_value_of(named, value, parameters)
        }
        None => param_error(name, index, MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST, from),
    });
    Event::Answered
}

/// Answers PARAM_SET: the value that is now live, after an error if that is not the one asked for. A trigger's value is
/// acknowledged first, since ground stations repeat what they do not see, and then it reads 0 again.
pub fn set(name: Name, value: f32, from: Peer, context: &mut Context<'_>) -> Event {
    let (parameters, outbox) = (&mut *context.changeable.parameters, &mut *context.outbox);
    let error = |error| param_error(name, BY_NAME, error, from);
    let Some(named) = NamedParameter::from_name(name.as_bytes()) else {
        outbox.answer(error(MavParamError::MAV_PARAM_ERROR_DOES_NOT_EXIST));
        return Event::ParameterUnknown;
    };
    let (id, own) = (named.id, named.to_own(value));
    let result = match context.changeable.vehicle.arm_state() {
        ArmState::Disarmed => parameters.set(id, own),
        ArmState::Armed => parameters.set_while_armed(id, own),
    };
    let event = match result {
        Ok(()) if triggers(id, value) => {
            outbox.answer(param_value_of(named, value, parameters));
            Event::Triggered(id)
        }
        Ok(()) => {
            context.rates.parameter_set(id);
            Event::ParameterSet(id)
        }
        Err(refused) => {
            outbox.answer(error(match refused {
                Refused::OutOfRange | Refused::OtherChemistry => {
                    MavParamError::MAV_PARAM_ERROR_VALUE_OUT_OF_RANGE
                }
                Refused::ReadOnly => MavParamError::MAV_PARAM_ERROR_READ_ONLY,
                Refused::Armed | Refused::NotWhileArmed => MavParamError::MAV_PARAM_ERROR_PERMISSION_DENIED,
            }));
            Event::ParameterRefused(id, refused)
        }
    };
    let live = parameters.get(id);
    let is_meant = named.is_newer() && live == own;
    // Several values of a newer name mean the same: a ground station waits for its own.
    let shown = if is_meant { value } else { named.from_own(live) };
    outbox.answer(param_value_of(named, shown, parameters));
    event
}

/// A list of parameters on its way out, and those that have changed behind it, in batches that leave most of the link to others.
///
/// Each is sent once, whatever is shown or hidden meanwhile, and the list ends when all that are shown have been sent.
#[derive(Debug, Default)]
pub struct ParameterList {
    /// The parameters of the list that were sent; `None` if none is being sent.
    sent: Option<ParameterIdSet>,
    changed: ParameterIdSet,
    pace: Option<Pace>,
}

/// When how much may leave.
#[derive(Debug)]
struct Pace {
    batches: Cadence,
    credited_at: Instant,
    /// Bytes that may leave now.
    credit_bytes: f32,
}

impl ParameterList {
    /// Starts the list, or starts it again.
    pub fn start(&mut self, now: Instant) {
        self.sent = Some(ParameterIdSet::default());
        self.pace = Some(Pace::starting_at(now));
    }

    /// Has these sent, too: their values have changed.
    pub fn report(&mut self, changed: &ParameterIdSet, now: Instant) {
        self.changed.insert_all(changed);
        self.pace.get_or_insert_with(|| Pace::starting_at(now));
    }

    /// When the next batch is due; `None` while there is nothing to send.
    pub fn next_due(&self) -> Option<Instant> {
        self.pace.as_ref().map(|pace| pace.batches.due())
    }

    /// Lets the next batch go if it is due: what the list's share of a link of `bytes_per_second` has been good for since
    /// the last one. `rate_hz` is `SR0_PARAMS`.
    pub fn release(&mut self, now: Instant, rate_hz: f32, bytes_per_second: u32) {
        let Some(pace) = &mut self.pace else { return };
        pace.batches.set_interval((1e6 / rate_hz) as u64, now);
        if !pace.batches.take(now) {
            return;
        }
        let share = bytes_per_second as f32 * LIST_SHARE;
        let elapsed_s = now.us_since(pace.credited_at) as f32 / 1e6;
        // The part of a frame that a batch leaves counts for the next.
        let most_bytes = share / rate_hz + PARAM_VALUE_FRAME_BYTES;
        pace.credit_bytes = (pace.credit_bytes + share * elapsed_s).min(most_bytes);
        pace.credited_at = now;
    }

    /// The next parameter of the batch.
    pub fn take(&mut self, parameters: &Parameters) -> Option<Message> {
        let pace = self.pace.as_mut()?;
        if pace.credit_bytes < PARAM_VALUE_FRAME_BYTES {
            return None;
        }
        pace.credit_bytes -= PARAM_VALUE_FRAME_BYTES;
        if let Some(sent) = &mut self.sent {
            if let Some(id) = parameters.listed().find(|id| !sent.contains(*id)) {
                sent.insert(id);
                return Some(param_value(id, parameters));
            }
            self.sent = None;
        }
        let Some(id) = self.changed.take_any() else {
            self.pace = None;
            return None;
        };
        Some(indexed_param_value(
            id.into(),
            parameters.get(id),
            None,
            parameters,
        ))
    }
}

impl Pace {
    fn starting_at(now: Instant) -> Self {
        Self {
            batches: Cadence::starting_at(now, 1),
            credited_at: now,
            credit_bytes: PARAM_VALUE_FRAME_BYTES,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::Pack;
    use crate::parameter::BatteryParameter;
    use crate::time::at_us;

    /// Everything is listed.
    fn all_packs() -> Parameters {
        let mut parameters = Parameters::defaults();
        for pack in Pack::ALL {
            parameters.set(BatteryParameter::Monitor.of(pack), 3.0).unwrap();
        }
        parameters
    }

    fn list_bytes_by_second(bytes_per_second: u32, rate_hz: f32) -> Vec<usize> {
        let parameters = Parameters::defaults();
        let mut list = ParameterList::default();
        let mut seconds = Vec::new();
        let (mut now, mut lists) = (Instant::EPOCH, 0);
        // Ask again whenever the list is through, so that its share is asked for all the time.
        while now < at_us(20_000_000) {
            if list.next_due().is_none() {
                lists += 1;
                let credit = list.pace.take();
                assert!(credit.is_none());
                list.start(now);
            }
            list.release(now, rate_hz, bytes_per_second);
            while list.take(&parameters).is_some() {
                seconds.resize((now.as_micros() / 1_000_000) as usize + 1, 0);
                *seconds.last_mut().unwrap() += PARAM_VALUE_FRAME_BYTES as usize;
            }
            now = list.next_due().unwrap_or(now).max(now.after_us(1000));
        }
        assert!(lists > 1);
        seconds
    }

    #[test]
    // Requirement: AP-26
    fn a_list_takes_its_share_of_the_link_and_no_more() {
        for (baud, rate_hz) in [(9_600, 10.0), (57_600, 10.0), (57_600, 1.0), (115_200, 50.0)] {
            let bytes_per_second = baud / 10;
            let share = bytes_per_second as f32 * LIST_SHARE;
            for (second, bytes) in list_bytes_by_second(bytes_per_second, rate_hz).iter().enumerate() {
                // A list that starts may send one parameter at once.
                let list_bytes = Parameters::defaults().listed().count() as f32 * PARAM_VALUE_FRAME_BYTES;
                let lists_started = 1.0 + share / list_bytes;
                let allowed = share + (1.0 + lists_started.ceil()) * PARAM_VALUE_FRAME_BYTES;
                assert!(
                    (*bytes as f32) <= allowed,
                    "{baud} baud: {bytes} bytes in second {second}"
                );
            }
        }
    }

    #[test]
    fn a_list_is_complete_and_in_order() {
        let parameters = all_packs();
        let mut list = ParameterList::default();
        list.start(Instant::EPOCH);
        let mut indices = Vec::new();
        while let Some(now) = list.next_due() {
            list.release(now, 10.0, 960);
            while let Some(Message::ParamValue(value)) = list.take(&parameters) {
                assert_eq!(usize::from(value.param_count), parameters.listed().count());
                indices.push(usize::from(value.param_index));
            }
        }
        assert_eq!(indices, (0..parameters.listed().count()).collect::<Vec<_>>());
    }
}
