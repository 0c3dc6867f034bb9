//! Estimators under judgement, behind one trait.

use battery_gauge::{BatteryMonitor, BatteryState, Faults, LearntPack, LoadState, PackEvent, PackSettings};

use crate::sample::{Sample, reading, tick};

/// What an estimator reports after a reading.
#[derive(Clone, Copy, Debug, Default)]
pub struct Report {
    /// State of charge and its standard deviation, in percent.
    pub remaining_pct: Option<f32>,
    pub sigma_pct: Option<f32>,
    /// Usable charge and its standard deviation, in percent.
    pub usable_pct: Option<f32>,
    pub usable_sigma_pct: Option<f32>,
    /// Time until the pack can't serve the load, in seconds.
    pub time_left_s: Option<f32>,
    /// Whether it has announced a fault of the pack, its sensor or its settings.
    pub has_fault: bool,
}

impl Report {
    /// Whether each number is one.
    pub fn is_finite(&self) -> bool {
        let numbers = [
            self.remaining_pct,
            self.sigma_pct,
            self.usable_pct,
            self.usable_sigma_pct,
            self.time_left_s,
        ];
        numbers.iter().flatten().all(|number| number.is_finite())
    }
}

/// An estimator of a pack's charge, with what it keeps over power cycles.
pub trait Estimator: Clone + Default + Send + Sync {
    /// Heading of its column.
    const NAME: &'static str;

    /// Power comes on, with what flash holds of the pack and these settings.
    fn start(&mut self, settings: &PackSettings);

    fn update(&mut self, sample: &Sample) -> Report;

    /// The owner sets the remaining charge, in percent.
    fn set_remaining(&mut self, remaining_pct: f32);

    /// Capacity that it has learnt, in ampere-hours.
    fn capacity_ah(&self) -> Option<f64>;
}

/// The estimator of the crate.
#[derive(Clone)]
pub struct Monitor {
    monitor: BatteryMonitor,
    battery: BatteryState,
    settings: PackSettings,
    learnt: LearntPack,
}

impl Default for Monitor {
    fn default() -> Self {
        Self {
            monitor: BatteryMonitor::new(),
            battery: BatteryState::default(),
            settings: PackSettings::default(),
            learnt: LearntPack::UNKNOWN,
        }
    }
}

impl Monitor {
    /// What flash would hold if power went off now.
    fn kept(&self) -> LearntPack {
        self.monitor.unsaved_learnt().copied().unwrap_or(self.learnt)
    }
}

impl Estimator for Monitor {
    const NAME: &'static str = "today";

    fn start(&mut self, settings: &PackSettings) {
        let learnt = self.kept();
        *self = Self {
            settings: *settings,
            learnt,
            ..Self::default()
        };
        self.monitor.restore_learnt(learnt);
    }

    fn update(&mut self, sample: &Sample) -> Report {
        let Self {
            monitor,
            battery,
            settings,
            ..
        } = self;
        let update = monitor.update(battery, tick(sample), reading(sample), settings);
        let readings = &battery.readings;
        Report {
            remaining_pct: readings.remaining_pct,
            sigma_pct: readings.remaining_sigma_pct,
            usable_pct: readings.usable_pct,
            usable_sigma_pct: readings.usable_sigma_pct,
            time_left_s: readings.time_remaining_s,
            has_fault: readings.faults.intersects(DOUBTS) || update.events.iter().any(is_fault),
        }
    }

    fn set_remaining(&mut self, remaining_pct: f32) {
        let Self {
            monitor,
            battery,
            settings,
            ..
        } = self;
        monitor.reset(battery, LoadState::On, remaining_pct, settings);
    }

    fn capacity_ah(&self) -> Option<f64> {
        Some(f64::from(self.kept().capacity_mah()?) / 1000.0)
    }
}

/// Faults that a wrong sensor or wrong settings seem to be.
const DOUBTS: Faults = Faults::CELLS_CONFIGURATION.union(Faults::SPIKES);

/// Whether the owner reads that something is wrong.
fn is_fault(event: &PackEvent) -> bool {
    matches!(
        event,
        PackEvent::CellsAmbiguous { .. }
            | PackEvent::CurrentOverRange(_)
            | PackEvent::CurrentLost
            | PackEvent::CurrentReversed
            | PackEvent::SensorFailed(_)
            | PackEvent::CapacityAboveLabel(_)
    )
}
