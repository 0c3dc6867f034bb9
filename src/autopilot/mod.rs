//! The core: owns parameters, packs, vehicle and signing, and takes every decision between them.
//!
//! [`Autopilot`] does no I/O and reads no clock. Tasks (or a program with one loop, or a test) hand it times, readings
//! and received bytes; it hands out pins to read, motor outputs, messages and values to save. What other tasks have to do
//! after a call is in [`Work`].

mod announcement;
mod announcement_limit;
#[expect(
    clippy::module_inception,
    reason = "the file is named after its type, and the folder as well"
)]
mod autopilot;
mod broadcast;
mod can;
mod can_watch;
mod channel;
mod driving;
mod learnt;
mod links;
mod logs;
mod packs;
mod recording;
mod sampling;
mod save_state;
mod saving;
mod silence;
mod start;
mod wifi;
mod wifi_state;
mod wiring;
mod work;

pub use announcement::{ANNOUNCEMENT_BYTES, Announcement, AnnouncementText};
pub use autopilot::Autopilot;
pub use channel::Channel;
pub use driving::Outputs;
pub use learnt::{LearntJob, PackIdentity};
pub use recording::{LogFailure, LogStep};
pub use sampling::{SAMPLING_INTERVAL_US, SAMPLING_RESOLUTION_US, SamplingProgress, SamplingTick};
pub use start::{ParameterLoad, Start};
pub use wiring::Wiring;
pub use work::Work;
