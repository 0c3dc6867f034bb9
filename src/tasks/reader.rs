//! Reads one link and handles what ground stations ask for.

use core::fmt::Write;

use embassy_futures::yield_now;
use embassy_time::{Duration, Instant, with_timeout};
use heapless::String;

use super::{ANNOUNCEMENT_BYTES, Link, Shared, mark};
use crate::liveness::CheckIn;
use crate::log::{info, warn};
use crate::mavlink::dialect::MavSeverity;
use crate::mavlink::{Action, Event};

/// Bytes handled in one go.
const CHUNK_BYTES: usize = 64;

/// A sender that has been silent for so long will not end the frame it began. Radios that send in slots split frames by
/// less.
const PAUSE: Duration = Duration::from_millis(250);

const BANNER: &str = concat!("rover-battmon ", env!("CARGO_PKG_VERSION"));

/// Why nothing was received.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum ReceiveError {
    /// Bytes were lost on the way; more can be received.
    BytesLost,
    /// The other end is gone.
    Closed,
}

/// Something bytes come from.
pub trait ByteSource {
    /// Waits for bytes and puts them into `buffer`; says how many, at least one.
    ///
    /// # Errors
    /// Bytes were lost, or there will be no more.
    // The futures stay on one executor, so `Send` need not be promised.
    #[allow(async_fn_in_trait)]
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError>;
}

/// Handles what `source` delivers until it is closed.
pub async fn read_frames(mut source: impl ByteSource, shared: &Shared, link: &Link, check_in: &CheckIn) {
    let mut chunk = [0; CHUNK_BYTES];
    loop {
        match with_timeout(PAUSE, source.receive(&mut chunk)).await {
            Ok(Ok(received)) => handle(chunk.get(..received).unwrap_or(&chunk), shared, link),
            Ok(Err(ReceiveError::BytesLost)) => {
                link.with(|endpoint| endpoint.count_overrun());
                warn!("{}: received bytes were lost", link.name());
            }
            Ok(Err(ReceiveError::Closed)) => return,
            Err(_) => {
                link.with(|endpoint| endpoint.give_up_waiting());
                handle(&[], shared, link);
            }
        }
        mark(check_in);
        // A sender that never pauses must leave the others their turn.
        yield_now().await;
    }
}

/// Handles all frames that end in `bytes`.
fn handle(mut bytes: &[u8], shared: &Shared, link: &Link) {
    loop {
        let taken = link.with(|endpoint| endpoint.push(bytes));
        bytes = bytes.get(taken..).unwrap_or(&[]);
        while let Some(event) = handle_next(shared, link) {
            react(event, shared, link);
        }
        if bytes.is_empty() {
            return;
        }
    }
}

fn handle_next(shared: &Shared, link: &Link) -> Option<Event> {
    let now_us = Instant::now().as_micros();
    shared.with_system_state(|state| {
        link.with(|endpoint| {
            shared.with_parameters(|parameters| {
                shared.with_vehicle(|vehicle| {
                    shared.with_signing(|signing| {
                        endpoint.handle_next(now_us, state, parameters, vehicle, signing)
                    })
                })
            })
        })
    })
}

fn react(event: Event, shared: &Shared, link: &Link) {
    match event {
        Event::Ignored => return,
        Event::GroundStationHeard => {
            shared.ground_station_heard.signal(());
            return;
        }
        Event::Answered => {}
        Event::Driven => shared.to_drive.signal(()),
        Event::ListRequested => {
            link.with(|endpoint| endpoint.say(MavSeverity::MAV_SEVERITY_INFO, BANNER));
            link.say_notices(shared);
        }
        Event::ParameterSet(id) => {
            let value = shared.parameter(id);
            info!("{}: {} set to {}", link.name(), id.name().as_str(), value);
            shared.to_save.signal(());
        }
        Event::ParameterRefused => {
            if link.refusals.allows() {
                warn!("{}: a parameter was refused", link.name());
            }
        }
        Event::Command(action) => {
            info!("{}: {:?}", link.name(), action);
            act(action, shared);
        }
        Event::CommandRefused(number) => {
            if link.refusals.allows() {
                warn!("{}: command {} refused", link.name(), number);
            }
        }
        Event::SigningSetUp(change) => {
            info!("{}: signing: {:?}", link.name(), change);
            shared.to_save_signing.signal(change);
        }
        Event::SigningRefused(refused) => {
            if link.refusals.allows() {
                warn!("{}: signing not set up: {:?}", link.name(), refused);
            }
        }
        Event::Unauthorized { to_report } => {
            if let Some(count) = to_report {
                report_unauthorized(count, shared, link);
            }
            return;
        }
    }
    link.to_write.signal(());
    link.to_schedule.signal(());
}

fn report_unauthorized(count: u32, shared: &Shared, link: &Link) {
    warn!("{}: not signed with the key, ignored: {}", link.name(), count);
    let mut text: String<ANNOUNCEMENT_BYTES> = String::new();
    // It fits.
    let _ = write!(text, "{}: not signed with the key, ignored: {count}", link.name());
    shared.announce(MavSeverity::MAV_SEVERITY_WARNING, &text);
}

fn act(action: Action, shared: &Shared) {
    match action {
        Action::Reboot => shared.to_reboot.signal(()),
        Action::ResetParameters => {
            shared.to_clear.set(true);
            shared.to_save.signal(());
        }
        Action::ResetBatteries { mask, percent } => shared.request_battery_reset(mask, percent),
    }
}
