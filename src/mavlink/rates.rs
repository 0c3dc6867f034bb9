//! The rates of one link: what the parameters say, and what ground stations ask for beyond that.

use heapless::Vec;

use super::scheduler::StreamScheduler;
use super::signing::LinkKind;
use super::{Peer, StreamGroup};
use crate::parameter::{ParameterId, Parameters, VehicleParameter};
use crate::time::Instant;

/// REQUEST_DATA_STREAM, stream ids: all of them, ArduPilot's of SYS_STATUS and of BATTERY_STATUS, and the one of both here.
const STREAM_ALL: u8 = 0;
const STREAM_EXTENDED_STATUS: u8 = 2;
const STREAM_EXTRA1: u8 = 10;
const STREAM_EXTRA3: u8 = 12;

/// Components that report the state of a radio: MAV_COMP_ID_TELEMETRY_RADIO (SiK and what follows it) and
/// MAV_COMP_ID_UDP_BRIDGE (Wi-Fi). Their system id is their own, the vehicle's or a ground station's.
const RADIO_COMPONENTS: [u8; 2] = [68, 240];

/// The highest rate of `SR0_EXTRA1`, in Hz.
const HIGHEST_RATE_HZ: f32 = 50.0;

/// Requests that are remembered, of all stations of a link: the four streams of two stations.
const REMEMBERED: usize = 8;

/// Ground stations send their requests for all streams at once, and again after 11 s or more.
const ROUND_US: u64 = 5_000_000;

/// The latest request of a station for a stream.
#[derive(Clone, Copy, Debug)]
struct StreamRequest {
    station: Peer,
    stream_id: u8,
    /// `None` to stop it.
    rate_hz: Option<u16>,
    received_at: Instant,
}

impl StreamRequest {
    /// Whether it is for the same stream, from the same station.
    fn is_about_that_of(&self, other: &Self) -> bool {
        (self.station, self.stream_id) == (other.station, other.stream_id)
    }

    /// Whether it overrides what its station requested in an earlier round: then the message of `earlier` has another rate until
    /// that is requested again.
    fn overrides(&self, earlier: &Self) -> bool {
        self.station == earlier.station
            && [STREAM_ALL, STREAM_EXTRA1].contains(&self.stream_id)
            && self.received_at.us_since(earlier.received_at) > ROUND_US
    }
}

/// The rates of one link.
#[derive(Debug)]
pub struct Rates {
    pub scheduler: StreamScheduler,
    /// `SR0_EXTRA1` when it was followed last; `None` if it is to be followed again.
    followed_hz: Option<f32>,
    /// The latest requests for streams.
    requests: Vec<StreamRequest, REMEMBERED>,
}

impl Rates {
    pub fn new(now: Instant) -> Self {
        Self {
            scheduler: StreamScheduler::new(now),
            followed_hz: None,
            requests: Vec::new(),
        }
    }

    /// Follows the parameters. A parameter that was set on another link wins here, too, if that changed it.
    pub fn follow(&mut self, parameters: &Parameters, now: Instant) {
        let rate_hz = parameters.get(VehicleParameter::Sr0Extra1);
        if self.followed_hz != Some(rate_hz) {
            self.followed_hz = Some(rate_hz);
            self.scheduler.set_extra1_rate(rate_hz, now);
        }
    }

    /// A ground station on this link has set a parameter, maybe to the value it had.
    pub fn parameter_set(&mut self, id: ParameterId) {
        if id == VehicleParameter::Sr0Extra1.into() {
            self.followed_hz = None;
        }
    }

    /// REQUEST_DATA_STREAM: changes live rates of this link and saves nothing. Ground stations send it unasked. Of each
    /// message the latest request counts, until `SR0_EXTRA1` is set. QGroundControl repeats its requests every 11 s: one that is the
    /// same as that station's previous one for the stream changes nothing, so what was set since stays.
    pub fn request_data_stream(
        &mut self,
        station: Peer,
        stream_id: u8,
        rate_hz: Option<u16>,
        parameters: &Parameters,
        now: Instant,
    ) {
        let is_known =
            [STREAM_ALL, STREAM_EXTRA1, STREAM_EXTENDED_STATUS, STREAM_EXTRA3].contains(&stream_id);
        let request = StreamRequest {
            station,
            stream_id,
            rate_hz,
            received_at: now,
        };
        if !is_known || self.is_repeated(request) {
            return;
        }
        // An earlier setting must not override the request later.
        self.follow(parameters, now);
        let rate_hz = rate_hz.map_or(0.0, f32::from).min(HIGHEST_RATE_HZ);
        let scheduler = &mut self.scheduler;
        match stream_id {
            STREAM_ALL | STREAM_EXTRA1 => scheduler.set_extra1_rate(rate_hz, now),
            STREAM_EXTENDED_STATUS => scheduler.set_group_rate(StreamGroup::ExtendedStatus, rate_hz, now),
            STREAM_EXTRA3 => scheduler.set_group_rate(StreamGroup::Extra3, rate_hz, now),
            _ => {}
        }
    }

    /// Whether the station's previous request for the stream was the same; remembers it.
    fn is_repeated(&mut self, request: StreamRequest) -> bool {
        let before = self
            .requests
            .iter_mut()
            .find(|before| request.is_about_that_of(before));
        if let Some(before) = before
            && before.rate_hz == request.rate_hz
        {
            before.received_at = request.received_at;
            return true;
        }
        self.requests
            .retain(|before| !request.is_about_that_of(before) && !request.overrides(before));
        if self.requests.is_full() {
            // A repeated request counts once more.
            self.requests.clear();
        }
        // There is room now.
        let _ = self.requests.push(request);
        false
    }
}

/// Whether a component can be the radio on a link of this kind: there is none on a cable.
pub fn is_radio(component_id: u8, link: LinkKind) -> bool {
    link == LinkKind::Radio && RADIO_COMPONENTS.contains(&component_id)
}
