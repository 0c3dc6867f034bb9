//! MAVLink: what a ground station sees.
//!
//! A message is built from a [`SystemState`] by a plain function, waits in the [`Outbox`] of a link, and becomes a frame
//! in the [`Framer`] when the wire takes it.

mod battery_status;
mod framer;
mod heartbeat;
mod message;
mod outbox;
mod scheduler;
mod sys_status;
mod system_state;
mod units;

/// The dialect whose messages are used: `development` is `common` with BATTERY_STATUS_V2.
pub use ::mavlink::dialects::development as dialect;

pub use battery_status::build_battery_status;
pub use framer::Framer;
pub use heartbeat::build_heartbeat;
pub use message::{Message, Stream};
pub use outbox::{Outbox, Posted};
pub use scheduler::StreamScheduler;
pub use sys_status::build_sys_status;
pub use system_state::{LinkStatistics, SystemState};

/// The component id of the autopilot, `MAV_COMP_ID_AUTOPILOT1`.
pub const COMPONENT_ID: u8 = 1;
