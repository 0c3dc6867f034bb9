//! What a load can still draw: a cold pack stops long before it is empty.

use super::cell_model::CellModel;

/// Time in which a peak of the sag is forgotten, in seconds.
const FORGETTING_S: f32 = 3600.0;

/// The sag grows towards the end.
const GROWTH: f32 = 1.2;

/// Lower limit of what is used between full and the end, relative to the capacity.
const MIN_SPAN: f32 = 0.01;

/// The largest recent sag, and the charge at which it ends the drive.
#[derive(Clone, Copy, Debug)]
pub(super) struct Reserve {
    peak_v: f32,
    share: f32,
}

impl Reserve {
    /// No load was seen.
    pub const NEW: Self = Self {
        peak_v: 0.0,
        share: 0.0,
    };

    /// Takes the sag of a cell over `dt_s` seconds.
    pub fn update(&mut self, dt_s: f32, sag_v: f32) {
        let kept = 1.0 - (dt_s / FORGETTING_S).min(1.0);
        self.peak_v = (self.peak_v * kept).max(sag_v);
    }

    /// Computes the charge at which such a sag reaches the cell's minimum voltage.
    pub fn settle(&mut self, model: &CellModel) {
        self.share = model.share(model.cell.deep_discharge_v + GROWTH * self.peak_v);
    }

    /// What the load can still draw at this state of charge, relative to the capacity, from 0 to 1.
    pub fn available(&self, share: f32) -> f32 {
        (share - self.share).max(0.0)
    }

    /// The same relative to what the load can draw from a full pack.
    pub fn usable(&self, share: f32) -> f32 {
        (self.available(share) / (1.0 - self.share).max(MIN_SPAN)).min(1.0)
    }
}
