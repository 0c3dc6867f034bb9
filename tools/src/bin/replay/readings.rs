//! The readings of all packs in a log, each put together from the entries that follow it.

use rover_battmon::battery::CellVoltages;
use rover_battmon::pack::{MAX_PACKS, Pack};
use rover_battmon::vehicle::ArmState;
use rover_battmon_tools::recordings::entry::{Content, Entry, Estimate, Part, Sample};

/// Puts readings together. One is whole when the next one of its pack begins, the rover is armed or disarmed, or the file ends.
#[derive(Debug)]
pub struct Readings {
    arm_state: ArmState,
    begun: [Option<Sample>; MAX_PACKS],
    latest_s: [f64; MAX_PACKS],
    backward_steps: usize,
}

impl Readings {
    /// Of a log in which the vehicle is armed or disarmed at first.
    pub fn beginning(arm_state: ArmState) -> Self {
        Self {
            arm_state,
            begun: [None; MAX_PACKS],
            latest_s: [0.0; MAX_PACKS],
            backward_steps: 0,
        }
    }

    /// Takes an entry, and gives each reading that is whole then to `take`.
    pub fn add(&mut self, entry: &Entry, mut take: impl FnMut(Pack, Sample)) {
        match &entry.content {
            Content::Arming(state) | Content::ArmState(state) => {
                self.finish(&mut take);
                self.arm_state = *state;
            }
            Content::Reading(pack, sample) => self.begin(*pack, sample, take),
            Content::Estimate(pack, estimate) => self.complete(*pack, |begun| add_estimate(begun, estimate)),
            Content::Cells(pack, part, millivolts) => {
                self.complete(*pack, |begun| add_cells(begun, *part, millivolts));
            }
            _ => {}
        }
    }

    fn begin(&mut self, pack: Pack, sample: &Sample, mut take: impl FnMut(Pack, Sample)) {
        let place = usize::from(pack.instance());
        let latest_s = &mut self.latest_s[place];
        self.backward_steps += usize::from(sample.time_s < *latest_s);
        *latest_s = sample.time_s;
        let armed = self.arm_state == ArmState::Armed;
        if let Some(whole) = self.begun[place].replace(Sample { armed, ..*sample }) {
            take(pack, whole);
        }
    }

    fn complete(&mut self, pack: Pack, complete: impl FnOnce(&mut Sample)) {
        if let Some(begun) = &mut self.begun[usize::from(pack.instance())] {
            complete(begun);
        }
    }

    /// Readings so far that are earlier than the one before of the same pack.
    pub fn backward_steps(&self) -> usize {
        self.backward_steps
    }

    /// Gives what is begun to `take`.
    pub fn finish(&mut self, mut take: impl FnMut(Pack, Sample)) {
        for (pack, begun) in Pack::ALL.into_iter().zip(&mut self.begun) {
            if let Some(sample) = begun.take() {
                take(pack, sample);
            }
        }
    }
}

fn add_estimate(sample: &mut Sample, estimate: &Estimate) {
    sample.healthy = estimate.is_healthy;
    if let Some(reported) = &mut sample.reported {
        reported.remaining_pct = estimate.remaining_pct.or(reported.remaining_pct);
        reported.charge_state = estimate.charge_state;
        reported.faults = estimate.faults;
        reported.extremes = estimate.extremes;
    }
}

fn add_cells(sample: &mut Sample, part: Part, millivolts: &[u16]) {
    let millivolts = [sample.cells.millivolts(), millivolts].concat();
    sample.cells = CellVoltages::from_millivolts(&millivolts);
    if part == Part::Further {
        drop_incomplete_cells(sample);
    }
}

/// A log has columns for the first cells of a larger stack only: their number is not the stack's. ArduPilot's has 14.
fn drop_incomplete_cells(sample: &mut Sample) {
    let cells_v: f32 = sample
        .cells
        .millivolts()
        .iter()
        .map(|mv| f32::from(*mv) / 1000.0)
        .sum();
    let missing_v = sample.voltage_v.unwrap_or(cells_v) - cells_v;
    if missing_v > 0.5 * cells_v / sample.cells.count() as f32 {
        sample.cells = CellVoltages::NONE;
    }
}
