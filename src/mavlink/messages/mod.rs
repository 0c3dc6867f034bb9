//! The messages that are sent: each built by a plain function, every field set explicitly.

mod battery_info;
mod battery_status;
mod battery_status_v2;
mod command_ack;
mod file_transfer;
mod fuel_status;
mod heartbeat;
mod message;
mod pack_announcement;
mod pack_facts;
mod smart_battery_info;
mod status_text;
mod sys_status;
mod units;
mod vehicle_announcement;
mod version;

pub use battery_info::build_battery_info;
pub use battery_status::build_battery_status;
pub use battery_status_v2::build_battery_status_v2;
pub use command_ack::CommandAck;
pub use file_transfer::FileTransferNak;
pub use fuel_status::build_fuel_status;
pub use heartbeat::build_heartbeat;
pub use message::{Message, Stream};
pub use pack_announcement::pack_announcement;
pub use smart_battery_info::build_smart_battery_info;
pub(super) use status_text::chunks_of;
pub use status_text::status_texts;
pub use sys_status::build_sys_status;
pub use vehicle_announcement::vehicle_announcement;
pub(super) use vehicle_announcement::{
    CheckedBy, arming_failure_text, lever_deflected_text, terminated_text,
};
pub use version::{build_autopilot_version, build_protocol_version};
