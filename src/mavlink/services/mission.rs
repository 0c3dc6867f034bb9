//! The mission protocol of a rover without missions, fences and rally points: each list is empty and stays so. Ground stations ask for
//! all three on connecting, and report an error if there is no answer.

use crate::mavlink::dialect::{MISSION_ACK_DATA, MISSION_COUNT_DATA, MavMissionResult, MavMissionType};
use crate::mavlink::requests::{Mission, MissionRequest};
use crate::mavlink::{Message, Peer};

/// Answers a request for a list, or a change of one.
pub fn answer(request: &Mission, from: Peer) -> Message {
    let list = request.list;
    let is_one_list = list != MavMissionType::MAV_MISSION_TYPE_ALL;
    let acknowledge = |result| {
        Message::MissionAck(MISSION_ACK_DATA {
            target_system: from.system_id,
            target_component: from.component_id,
            mavtype: result,
            mission_type: list,
            opaque_id: 0,
        })
    };
    match request.request {
        MissionRequest::List if is_one_list => Message::MissionCount(MISSION_COUNT_DATA {
            count: 0,
            target_system: from.system_id,
            target_component: from.component_id,
            mission_type: list,
            opaque_id: 0,
        }),
        // To store nothing is to clear.
        MissionRequest::Clear | MissionRequest::Store { items: 0 } => {
            acknowledge(MavMissionResult::MAV_MISSION_ACCEPTED)
        }
        MissionRequest::List | MissionRequest::Store { .. } | MissionRequest::Item => {
            acknowledge(MavMissionResult::MAV_MISSION_UNSUPPORTED)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use MavMissionType::*;

    const GCS: Peer = Peer {
        system_id: 255,
        component_id: 190,
    };

    #[test]
    fn every_list_is_empty_and_takes_nothing() {
        let answers = |list, request| match answer(&Mission { list, request }, GCS) {
            Message::MissionCount(count) => {
                assert_eq!((count.target_system, count.target_component), (255, 190));
                assert_eq!(count.mission_type, list);
                (Some(count.count), None)
            }
            Message::MissionAck(ack) => {
                assert_eq!((ack.target_system, ack.target_component), (255, 190));
                assert_eq!(ack.mission_type, list);
                (None, Some(ack.mavtype as u8))
            }
            other => panic!("{other:?}"),
        };
        const ACCEPTED: (Option<u16>, Option<u8>) = (None, Some(0));
        const UNSUPPORTED: (Option<u16>, Option<u8>) = (None, Some(3));
        for list in [
            MAV_MISSION_TYPE_MISSION,
            MAV_MISSION_TYPE_FENCE,
            MAV_MISSION_TYPE_RALLY,
        ] {
            assert_eq!(answers(list, MissionRequest::List), (Some(0), None));
            assert_eq!(answers(list, MissionRequest::Clear), ACCEPTED);
            assert_eq!(answers(list, MissionRequest::Store { items: 0 }), ACCEPTED);
            assert_eq!(answers(list, MissionRequest::Store { items: 1 }), UNSUPPORTED);
            assert_eq!(answers(list, MissionRequest::Item), UNSUPPORTED);
        }
        assert_eq!(answers(MAV_MISSION_TYPE_ALL, MissionRequest::Clear), ACCEPTED);
        assert_eq!(answers(MAV_MISSION_TYPE_ALL, MissionRequest::List), UNSUPPORTED);
    }
}
