//! A pack that collapses under load earlier than its reserve expects: the next drive warns earlier.

use super::cell_model::CellModel;
use super::load::Reserve;
use crate::battery::learnt::Collapse;

/// At a higher charge, from 0 to 1, a stalled motor takes a cell below the end.
const HIGHEST: f32 = 0.5;

/// A cell whose mean over ten seconds is less above the end, in volts, has collapsed: a failsafe may stop the rover meanwhile.
const COLLAPSED_V: f32 = 0.05;

/// A cell that is this far above the end, in volts, at this share of the largest recent sag has passed its last collapse.
const PASSED_V: f32 = 0.1;
const PASSING_SAG: f32 = 0.75;

/// The latest collapse of a pack, as this drive has shown it.
#[derive(Clone, Copy, Debug)]
pub enum LastCollapse {
    /// The drive adds nothing to what is learnt.
    Learnt,
    Seen(Collapse),
    /// The drive has passed it.
    Passed,
}

impl LastCollapse {
    /// The collapse that the pack is expected to repeat.
    pub fn expected(&self, learnt: Option<Collapse>) -> Option<Collapse> {
        match self {
            Self::Learnt => learnt,
            Self::Seen(collapse) => Some(*collapse),
            Self::Passed => None,
        }
    }

    /// Takes the mean voltage of a cell over ten seconds of load and its sag, at this state of charge from 0 to 1, in a drive
    /// with this mean resistance of a cell, in ohms.
    pub fn update(
        &mut self,
        soc: f32,
        cell_v: f32,
        sag_v: f32,
        drive_ohm: Option<f32>,
        reserve: &Reserve,
        model: &CellModel,
    ) {
        let end_v = model.terminal_end_v();
        if cell_v < end_v + COLLAPSED_V {
            let continues = matches!(self, Self::Seen(seen) if seen.soc() >= soc);
            if !continues
                && soc < HIGHEST
                && let Some(collapse) = drive_ohm.and_then(|ohm| Collapse::new(soc, ohm))
            {
                *self = Self::Seen(collapse);
            }
        } else if let Some(expected) = self.expected(model.learnt.collapse)
            && soc < expected.soc_at(model.known_ohm())
            && cell_v >= end_v + PASSED_V
            && sag_v >= PASSING_SAG * reserve.peak_v()
        {
            *self = Self::Passed;
        }
    }

    /// The next drive counts more by this difference at the same charge. A rest that corrects the estimate alone is no reason:
    /// the next drive starts from another charge, and counts with the same capacity.
    pub fn correct(&mut self, difference: f32) {
        if let Self::Seen(collapse) = self {
            *self = collapse.corrected(difference).map_or(Self::Learnt, Self::Seen);
        }
    }
}
