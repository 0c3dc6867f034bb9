//! Our end of a link on a desk, and a ground station at the other end.

// Not every test program uses all of it.
#![allow(dead_code)]

use rover_battmon::battery::BatteryState;
use rover_battmon::mavlink::{Endpoint, Event, Framer, LinkKind, Signing, SystemState};
use rover_battmon::parameter::Parameters;
use rover_battmon::vehicle::Vehicle;

use crate::support::frames::{Frame, frames};

/// Our end of a fast link, and the parameters and packs it serves.
pub struct Desk {
    pub batteries: Vec<BatteryState>,
    pub endpoint: Endpoint,
    pub framer: Framer,
    pub parameters: Parameters,
    pub vehicle: Vehicle,
    pub signing: Signing,
    pub now_us: u64,
}

impl Desk {
    pub fn new() -> Self {
        Self::with_packs(&[])
    }

    pub fn with_packs(batteries: &[BatteryState]) -> Self {
        Self {
            batteries: batteries.to_vec(),
            endpoint: Endpoint::new(LinkKind::Radio, 100_000, 0),
            framer: Framer::new(),
            parameters: Parameters::defaults(),
            vehicle: Vehicle::new(),
            signing: Signing::off(),
            now_us: 0,
        }
    }

    /// Delivers bytes in chunks of `chunk` and returns what came of them.
    pub fn receive_in_chunks(&mut self, bytes: &[u8], chunk: usize) -> Vec<Event> {
        let mut events = Vec::new();
        for mut part in bytes.chunks(chunk) {
            while !part.is_empty() {
                let taken = self.endpoint.push(part);
                assert!(taken > 0, "no room for another byte");
                part = &part[taken..];
                events.extend(self.handle_all());
            }
        }
        events
    }

    /// Handles every frame of what was delivered.
    pub fn handle_all(&mut self) -> Vec<Event> {
        let state = state_of(&self.batteries, &self.vehicle);
        std::iter::from_fn(|| {
            self.endpoint.handle_next(
                self.now_us,
                &state,
                &mut self.parameters,
                &mut self.vehicle,
                &mut self.signing,
            )
        })
        .collect()
    }

    /// Posts what is due at `now_us`.
    pub fn post_due(&mut self, now_us: u64) {
        let state = state_of(&self.batteries, &self.vehicle);
        self.endpoint.post_due(now_us, &state, &self.parameters);
    }

    /// Delivers a request and returns the answers.
    pub fn ask(&mut self, request: &[u8]) -> Vec<Frame> {
        self.receive_in_chunks(request, 64);
        self.sent()
    }

    /// Everything that waits to leave.
    pub fn sent(&mut self) -> Vec<Frame> {
        self.sent_at_most(usize::MAX)
    }

    /// The messages that leave while the wire takes so many.
    pub fn sent_at_most(&mut self, messages: usize) -> Vec<Frame> {
        let mut bytes = Vec::new();
        let state = state_of(&self.batteries, &self.vehicle);
        let link = self.endpoint.kind();
        for _ in 0..messages {
            let Some(message) = self.endpoint.take(&state, &self.parameters) else {
                break;
            };
            let frame = self
                .framer
                .signed_frame(&message, 1, &mut self.signing, link, self.now_us);
            bytes.extend(frame.iter().map(|byte| (0, *byte)));
        }
        frames(&bytes)
    }
}

/// What is told of packs and a vehicle.
fn state_of<'a>(batteries: &'a [BatteryState], vehicle: &Vehicle) -> SystemState<'a> {
    SystemState {
        batteries,
        vehicle: vehicle.status(),
        ..SystemState::default()
    }
}
