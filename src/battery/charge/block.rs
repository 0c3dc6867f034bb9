//! Blocks of ten seconds, whose means are compared with the model.

use super::second::Sum;

/// Duration of a block, less what a second may vary, in seconds.
const DURATION_S: f32 = 9.99;

pub(super) const HOURS_PER_SECOND: f32 = 1.0 / 3600.0;

/// A load of a cell over some time.
#[derive(Clone, Copy, Debug)]
pub(super) struct Load {
    /// In seconds.
    pub duration_s: f32,
    /// Mean, in amperes.
    pub current_a: f32,
    /// Mean of what is left of earlier loads, in amperes
    /// ([`Polarisation::current_a`](super::polarisation::Polarisation::current_a)).
    pub slow_a: f32,
}

/// Means over a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct Block {
    pub load: Load,
    /// Of a cell, in volts, if measured.
    pub cell_v: Option<f32>,
}

/// Sums up to a block.
#[derive(Clone, Copy, Debug)]
pub(super) struct BlockSum {
    cell_v: Sum,
    current_a: Sum,
    slow_a: Sum,
    duration_s: f32,
}

impl Load {
    /// No load, neither now nor before.
    pub const NONE: Self = Self {
        duration_s: 0.0,
        current_a: 0.0,
        slow_a: 0.0,
    };

    /// The voltage it takes off a cell with this resistance and slow share, in volts.
    pub fn sag_v(&self, ohm: f32, slow_share: f32) -> f32 {
        ohm * (self.current_a + slow_share * self.slow_a)
    }

    /// Charge drawn, in ampere-hours.
    pub fn drawn_ah(&self) -> f32 {
        self.current_a * self.duration_s * HOURS_PER_SECOND
    }
}

impl BlockSum {
    /// Nothing yet.
    pub const NEW: Self = Self {
        cell_v: Sum::NEW,
        current_a: Sum::NEW,
        slow_a: Sum::NEW,
        duration_s: 0.0,
    };

    /// Takes a second; returns the block, once it is complete.
    pub fn add(&mut self, load: &Load, cell_v: Option<f32>) -> Option<Block> {
        self.duration_s += load.duration_s;
        self.current_a.add(load.duration_s, load.current_a);
        self.slow_a.add(load.duration_s, load.slow_a);
        if let Some(cell_v) = cell_v {
            self.cell_v.add(load.duration_s, cell_v);
        }
        if self.duration_s < DURATION_S {
            return None;
        }
        let complete = core::mem::replace(self, Self::NEW);
        Some(Block {
            load: Load {
                duration_s: complete.duration_s,
                current_a: complete.current_a.mean(complete.duration_s)?,
                slow_a: complete.slow_a.mean(complete.duration_s)?,
            },
            cell_v: complete.cell_v.mean(complete.duration_s),
        })
    }

    /// Charge drawn since the last block, in ampere-hours.
    pub fn drawn_ah(&self) -> f32 {
        self.current_a.integral() * HOURS_PER_SECOND
    }
}
