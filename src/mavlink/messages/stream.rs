//! Properties of a stream in the rows of the table of messages.

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
