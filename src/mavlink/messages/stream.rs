//! Properties of a stream in the rows of the table of messages.

use super::{Stream, StreamKind};
use crate::pack::{MAX_PACKS, Pack};
use crate::system::SystemState;

/// Subject of a message, and with that whether there is one of it or one for each pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Subject {
    /// The whole vehicle.
    Vehicle,
    /// A pack. There is none of a pack that is not monitored or only used on board.
    EachPack,
    /// A pack that is a tank whose capacity is known.
    EachTank,
    /// A pack whose internal resistance is known.
    EachKnownResistance,
    /// A pack whose resting voltage is known.
    EachKnownRestingVoltage,
    /// A pack whose remaining charge is estimated here.
    EachKnownDeviation,
    /// A pack whose usable charge is known.
    EachKnownUsableCharge,
}

/// The group of streams in which ArduPilot sends a message (MAV_DATA_STREAM).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StreamGroup {
    /// MAV_DATA_STREAM_EXTENDED_STATUS.
    ExtendedStatus,
    /// MAV_DATA_STREAM_EXTRA3.
    Extra3,
}

/// Rate of a message unless a ground station asks for another interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DefaultRate {
    /// Once a second, and at no other rate: without HEARTBEAT ground stations lose the vehicle.
    EverySecond,
    /// At `SR0_EXTRA1`, until a ground station requests another rate of this group of ArduPilot's streams.
    Extra1(StreamGroup),
    /// Never.
    OnRequest,
    /// Never, but of a smart battery once on each link when its details are known or have changed, and when a ground
    /// station is new on it. Once the default interval is requested, every ten seconds.
    OnChange,
}

impl StreamKind {
    /// The streams with this message id: none unless it can be sent regularly, several of NAMED_VALUE_FLOAT.
    pub fn with_message_id(message_id: u32) -> impl Iterator<Item = Self> {
        let kinds = Self::ALL.into_iter();
        kinds.filter(move |kind| kind.message_id() == message_id)
    }

    /// Its streams: one of the vehicle, or one of each pack that can be.
    pub fn streams(self) -> impl Iterator<Item = Stream> + Clone {
        let count = match self.subject() {
            Subject::Vehicle => 1,
            _ => MAX_PACKS,
        };
        let packs = Pack::ALL.into_iter().take(count);
        packs.map(move |pack| self.of(pack))
    }

    /// Its streams that have something to report.
    pub(in crate::mavlink) fn reported_in(self, state: &SystemState<'_>) -> impl Iterator<Item = Stream> {
        self.streams().filter(|stream| stream.is_reported_in(state))
    }
}

impl Stream {
    /// Whether there is something to report.
    pub(in crate::mavlink) fn is_reported_in(self, state: &SystemState<'_>) -> bool {
        let Some(pack) = self.pack() else { return true };
        let battery = state.battery(pack);
        state.is_reported(pack)
            && match self.kind().subject() {
                Subject::Vehicle | Subject::EachPack => true,
                Subject::EachTank => state.is_tank(pack),
                Subject::EachKnownResistance => battery.resistance_ohm.is_some(),
                Subject::EachKnownRestingVoltage => battery.readings.resting_voltage_v.is_some(),
                Subject::EachKnownDeviation => battery.readings.remaining_sigma_pct.is_some(),
                Subject::EachKnownUsableCharge => battery.readings.usable_pct.is_some(),
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_stream_leads_back_to_its_row() {
        for kind in StreamKind::ALL {
            assert!(StreamKind::with_message_id(kind.message_id()).any(|other| other == kind));
            assert!(kind.streams().all(|stream| stream.kind() == kind), "{kind:?}");
        }
        assert_eq!(StreamKind::with_message_id(30).next(), None);
    }
}
