//! MAVLink: what a ground station sees.
//!
//! A stream that is due waits in the [`Outbox`] of a link until the wire is free; then its message is built from a
//! [`SystemState`](crate::system::SystemState) by a plain function, and becomes a frame in the [`Framer`]. What is received goes through the
//! [`FrameParser`] to a dispatcher, which gives it to the service it is for. [`Endpoint`] is all of that for one link,
//! without the wire.
#![allow(
    deprecated,
    reason = "ground stations still use messages and commands that the dialect marks as superseded"
)]

mod details_change;
mod dispatcher;
mod endpoint;
mod event;
mod framer;
mod links;
mod messages;
mod outbox;
mod parser;
mod payload;
mod rates;
mod requests;
mod scheduler;
mod sender_clocks;
mod services;
mod signing;
mod slowdown;
mod stations;

/// The dialect whose messages are used: `development` is `common` with BATTERY_STATUS_V2.
pub use ::mavlink::dialects::development as dialect;
pub(crate) use endpoint::BroadcastPosition;
pub use endpoint::Endpoint;
pub use event::{Action, Event, SetupRefused, SigningChange, WifiRefused};
pub use framer::Framer;
pub use links::{LinkId, MAX_LINKS, SIMULATED_LINKS};
pub use messages::{
    BroadcastCommand, Burst, CommandAck, ComponentMetadata, DefaultRate, FileAnswer, FileAnswerHeader,
    FileData, FileError, FileOutcome, MAX_FILE_BYTES, Message, Outgoing, Stream, StreamGroup, StreamKind,
    Subject, ToFrame, build_autopilot_version, build_available_mode, build_battery_info,
    build_battery_status, build_battery_status_v2, build_charge_deviation, build_component_metadata,
    build_fuel_status, build_heartbeat, build_protocol_version, build_resistance, build_resting_voltage,
    build_smart_battery_info, build_sys_status, build_usable_charge, status_texts,
};
pub use outbox::{Outbox, Posted};
pub use parser::Peer;
pub use parser::{FrameParser, ReceivedFrame, begins_with_frame};
pub use payload::{Name, Payload};
pub use scheduler::{Interval, IntervalRefused, StreamScheduler};
pub use services::Changeable;
pub use services::log_download::LogRead;
pub use signing::{
    AcceptUnsigned, Access, LinkKind, Signing, SigningKey, SigningTrouble, StoredSigning, Timestamp, ToStore,
};
pub use stations::STATION_SILENCE_US;

/// The component id of the autopilot, `MAV_COMP_ID_AUTOPILOT1`.
pub const COMPONENT_ID: u8 = 1;
