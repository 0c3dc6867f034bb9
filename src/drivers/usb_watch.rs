//! Whether the USB device is stuck, by what its controller shows.
//!
//! Two things leave it stuck until it is rebuilt: a host that drops a control transfer halfway, because the driver waits
//! for that transfer's end without looking at what comes instead; and a bus error at the wrong moment, after which the
//! controller itself does nothing more (erratum RP2040-E15).

/// Time of the device between two observations, at least, for the work that is waiting.
pub const OBSERVATION_INTERVAL_MS: u64 = 100;

/// This many observations in a row have to look stuck. They are counted, not timed: what holds up the device, as an erase of
/// flash does, holds up the observations, too.
const PATIENCE: u8 = 5;

/// Transfer at the control endpoint.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ControlPipe {
    /// Nothing.
    Idle,
    /// A request or a bus reset that the device has not served, or an answer that the host has not fetched.
    Busy,
}

/// State of the controller at one moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct UsbObservation {
    /// A device that works is busy for some milliseconds only: it serves requests at once, and a host fetches an answer
    /// that it has asked for, or resets the bus.
    pub control: ControlPipe,
    /// Number of the last frame (0 to 2047), of which a host begins one each millisecond. `None` while none has to come:
    /// the host has given no address since the last reset, or has suspended the bus, or there is none.
    pub frame: Option<u16>,
}

/// Why the device is stuck.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(target_os = "none", derive(defmt::Format))]
pub enum UsbFault {
    /// A control transfer does not end.
    ControlPipeBusy,
    /// The controller counts no frames, and the bus is not suspended.
    NoFrames,
}

/// Finds out whether the device is stuck.
#[derive(Clone, Copy, Debug, Default)]
pub struct UsbWatch {
    frame: Option<u16>,
    /// Observations in a row with this sign.
    busy: u8,
    without_frames: u8,
}

impl UsbWatch {
    /// Takes an observation, [`OBSERVATION_INTERVAL_MS`] after the one before at the earliest.
    pub fn observe(&mut self, seen: UsbObservation) -> Option<UsbFault> {
        let is_frozen = seen.frame.is_some() && seen.frame == self.frame;
        self.frame = seen.frame;
        self.busy = in_a_row(self.busy, seen.control == ControlPipe::Busy);
        self.without_frames = in_a_row(self.without_frames, is_frozen);
        if self.busy >= PATIENCE {
            Some(UsbFault::ControlPipeBusy)
        } else if self.without_frames >= PATIENCE {
            Some(UsbFault::NoFrames)
        } else {
            None
        }
    }
}

fn in_a_row(before: u8, again: bool) -> u8 {
    if again { before.saturating_add(1) } else { 0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const QUIET: UsbObservation = UsbObservation {
        control: ControlPipe::Idle,
        frame: None,
    };
    const BUSY: UsbObservation = UsbObservation {
        control: ControlPipe::Busy,
        frame: None,
    };

    fn faults(observations: &[UsbObservation]) -> Vec<Option<UsbFault>> {
        let mut watch = UsbWatch::default();
        observations.iter().map(|seen| watch.observe(*seen)).collect()
    }

    fn frame(number: u64) -> UsbObservation {
        UsbObservation {
            frame: Some((number % 2048) as u16),
            ..QUIET
        }
    }

    #[test]
    fn a_transfer_without_end_is_found_at_the_fifth_look() {
        let found = faults(&[BUSY; 6]);
        assert_eq!(found[..4], [None; 4]);
        assert_eq!(found[4..], [Some(UsbFault::ControlPipeBusy); 2]);
    }

    #[test]
    fn a_frame_counter_that_stops_is_found_at_the_fifth_look_after() {
        let found = faults(&[frame(7); 7]);
        assert_eq!(found[..5], [None; 5]);
        assert_eq!(found[5..], [Some(UsbFault::NoFrames); 2]);
    }

    #[test]
    fn one_good_look_starts_the_count_again() {
        let seen = [BUSY, BUSY, BUSY, BUSY, QUIET, BUSY, BUSY, BUSY, BUSY];
        assert!(faults(&seen).iter().all(Option::is_none));
        let stopped = frame(7);
        let seen = [
            stopped, stopped, stopped, stopped, stopped, QUIET, stopped, stopped,
        ];
        assert!(faults(&seen).iter().all(Option::is_none));
    }

    #[test]
    fn no_host_and_a_suspended_bus_are_no_fault() {
        assert!(faults(&[QUIET; 1000]).iter().all(Option::is_none));
    }

    proptest! {
        /// A host that sends frames, looked at after as long as it takes, with transfers that end between two looks.
        #[test]
        fn a_working_device_raises_no_alarm(
            looks in prop::collection::vec((100u64..2_000, prop::bool::weighted(0.5)), 1..200),
        ) {
            let mut watch = UsbWatch::default();
            let (mut now_ms, mut busy) = (0, 0);
            for (after_ms, is_busy) in looks {
                now_ms += after_ms;
                busy = if is_busy && busy < 4 { busy + 1 } else { 0 };
                let control = if busy > 0 { ControlPipe::Busy } else { ControlPipe::Idle };
                prop_assert_eq!(watch.observe(UsbObservation { control, ..frame(now_ms) }), None);
            }
        }

        /// Whatever was seen before.
        #[test]
        fn a_stuck_device_is_found_whatever_was_before(
            before in prop::collection::vec((any::<bool>(), prop::option::of(0u16..2048)), 0..50),
            at in 0u64..2048,
            busy in any::<bool>(),
        ) {
            let mut watch = UsbWatch::default();
            for (busy, frame) in before {
                let control = if busy { ControlPipe::Busy } else { ControlPipe::Idle };
                watch.observe(UsbObservation { control, frame });
            }
            let stuck = if busy { BUSY } else { frame(at) };
            let found = (0..6).filter_map(|_| watch.observe(stuck)).last();
            prop_assert_eq!(found, Some(if busy { UsbFault::ControlPipeBusy } else { UsbFault::NoFrames }));
        }
    }
}
