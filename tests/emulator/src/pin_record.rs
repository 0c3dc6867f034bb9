//! What happens at pins over time, for tests that decode it.

use std::collections::BTreeMap;

use super::board::Board;
use super::bus::SystemBus;
use super::clock::Cycle;
use super::pins::{PinDrive, level_drive, pin_drive, pio_of};
use super::pio::Pio;
use super::pwm::PwmOutput;

/// A pin has another level from this moment on.
pub type Edge = (Cycle, bool);

/// The PWM makes something else of a pin from this moment on; `None`: it drives it no longer.
pub type PwmChange = (Cycle, Option<PwmOutput>);

#[derive(Clone)]
struct PinRecord {
    drive: PinDrive,
    edges: Vec<Edge>,
    pwm_changes: Vec<PwmChange>,
}

impl PinRecord {
    fn starting_with(drive: PinDrive) -> Self {
        Self {
            drive,
            edges: Vec::new(),
            pwm_changes: Vec::new(),
        }
    }

    fn note(&mut self, drive: PinDrive, now: Cycle) {
        if drive == self.drive {
            return;
        }
        match (self.drive, drive) {
            (_, PinDrive::Pwm(output)) => self.pwm_changes.push((now, Some(output))),
            (PinDrive::Pwm(_), _) => self.pwm_changes.push((now, None)),
            _ => {}
        }
        if let Some(level) = steady_level(drive)
            && steady_level(self.drive) != Some(level)
        {
            self.edges.push((now, level));
        }
        self.drive = drive;
    }
}

/// A pin that nothing drives is pulled low; one that the PWM drives has no steady level.
fn steady_level(drive: PinDrive) -> Option<bool> {
    match drive {
        PinDrive::Nothing => Some(false),
        PinDrive::Level(level) => Some(level),
        PinDrive::Pwm(_) => None,
    }
}

/// The pins that are recorded.
#[derive(Clone, Default)]
pub struct PinRecorder {
    records: BTreeMap<usize, PinRecord>,
}

impl SystemBus {
    /// To be called whenever a pin may have changed.
    pub(super) fn observe_pins(&mut self) {
        self.observe_i2c_lines();
        self.observe_inputs();
        let pio_changes = self.soc.pios.each_mut().map(Pio::take_changes);
        for (&pin, record) in &mut self.pin_recorder.records {
            if let Some(number) = pio_of(&self.chip, pin) {
                for &(at, outputs) in &pio_changes[number] {
                    record.note(level_drive(outputs.level(pin)), at);
                }
            }
            record.note(pin_drive(&self.chip, &self.soc, pin, self.now), self.now);
        }
    }
}

impl Board {
    /// Record what happens at a pin from now on.
    pub fn record_pin(&mut self, pin: usize) {
        let drive = pin_drive(&self.bus.chip, &self.bus.soc, pin, self.bus.now);
        let record = PinRecord::starting_with(drive);
        self.bus.pin_recorder.records.insert(pin, record);
    }

    /// Take the edges at a recorded pin since they were taken last. A pin that nothing drives counts
    /// as low; while the PWM drives it there are none ([`Self::take_pwm_changes`]).
    pub fn take_edges(&mut self, pin: usize) -> Vec<Edge> {
        std::mem::take(&mut self.recorded(pin).edges)
    }

    /// Take what the PWM has made of a recorded pin since it was taken last: an entry at each change,
    /// at the moment it came into force.
    pub fn take_pwm_changes(&mut self, pin: usize) -> Vec<PwmChange> {
        std::mem::take(&mut self.recorded(pin).pwm_changes)
    }

    fn recorded(&mut self, pin: usize) -> &mut PinRecord {
        let record = self.bus.pin_recorder.records.get_mut(&pin);
        record.unwrap_or_else(|| panic!("GP{pin} is not recorded: use record_pin"))
    }
}
