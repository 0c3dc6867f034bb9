//! The rates of one link: what the parameters say, and what ground stations ask for beyond that.

use super::requests::{DataStream, RadioStatus};
use super::scheduler::StreamScheduler;
use super::signing::LinkKind;
use crate::parameter::{ParameterId, Parameters, VehicleParameter};
use crate::time::Instant;

/// REQUEST_DATA_STREAM, stream ids: all of them, and the one with the battery in it.
const STREAM_ALL: u8 = 0;
const STREAM_EXTRA1: u8 = 10;

/// Components that report the state of a radio: MAV_COMP_ID_TELEMETRY_RADIO (SiK and what follows it) and
/// MAV_COMP_ID_UDP_BRIDGE (Wi-Fi). Their system id is their own, the vehicle's or a ground station's.
const RADIO_COMPONENTS: [u8; 2] = [68, 240];

/// The highest rate of `SR0_EXTRA1`, in Hz.
const HIGHEST_RATE_HZ: f32 = 50.0;

/// The rates of one link.
#[derive(Debug)]
pub(super) struct Rates {
    pub scheduler: StreamScheduler,
    /// What a ground station asked for by REQUEST_DATA_STREAM. It holds on this link until `SR0_EXTRA1` is set.
    requested_hz: Option<f32>,
    /// `SR0_EXTRA1` when it was looked at last.
    parameter_hz: f32,
    /// The rate that was scheduled last.
    scheduled_hz: f32,
}

impl Rates {
    pub fn new(now: Instant) -> Self {
        Self {
            scheduler: StreamScheduler::new(now),
            requested_hz: None,
            parameter_hz: 0.0,
            scheduled_hz: 0.0,
        }
    }

    /// Follows the parameters. A parameter that was set on another link wins here, too, if that changed it.
    pub fn follow(&mut self, parameters: &Parameters, now: Instant) {
        let parameter_hz = parameters.get(VehicleParameter::Sr0Extra1);
        if parameter_hz != self.parameter_hz {
            self.requested_hz = None;
        }
        self.parameter_hz = parameter_hz;
        let rate_hz = self.requested_hz.unwrap_or(parameter_hz);
        if rate_hz != self.scheduled_hz {
            self.scheduled_hz = rate_hz;
            self.scheduler.set_extra1_rate(rate_hz, now);
        }
    }

    /// A ground station on this link has set a parameter, maybe to the value it had.
    pub fn parameter_set(&mut self, id: ParameterId) {
        if id == VehicleParameter::Sr0Extra1.into() {
            self.requested_hz = None;
        }
    }

    /// REQUEST_DATA_STREAM: changes the live rate of this link and saves nothing. Ground stations send it unasked.
    pub fn request_data_stream(&mut self, request: &DataStream) {
        if [STREAM_ALL, STREAM_EXTRA1].contains(&request.stream_id) {
            let rate_hz = request.rate_hz.map_or(0.0, f32::from);
            self.requested_hz = Some(rate_hz.min(HIGHEST_RATE_HZ));
        }
    }

    /// RADIO_STATUS of the radio on this link.
    pub fn radio_status(&mut self, status: &RadioStatus, now: Instant) {
        self.scheduler.radio_buffer_free(status.free_percent, now);
    }
}

/// Whether a component can be the radio on a link of this kind: there is none on a cable.
pub(super) fn is_radio(component_id: u8, link: LinkKind) -> bool {
    link == LinkKind::Radio && RADIO_COMPONENTS.contains(&component_id)
}
