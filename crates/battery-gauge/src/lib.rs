//! Gauge of one battery pack: readings in; state of charge with its deviation, what of it is usable, events, faults and failsafe
//! levels out. It has no heap, reads no clock and does no I/O: time and readings are arguments.
//!
//! # What it estimates
//! | from | [`BatteryState`] has |
//! |---|---|
//! | the voltage alone | number of cells, state of charge (4 to 10 points RMS when warm, [more](#how-sure-it-is) when cold), faults, failsafe levels |
//! | and the current | charge and energy drawn, resistance, resting voltage, state of charge (1 to 3 points), what of it the load can use, time left |
//! | and several drives | capacity, resistance and curve of this pack: its age |
//! | a counter, a fuel gauge or cell voltages, where the sensor has them | the same, by those |
//!
//! Four chemistries have curves: LiPo, Li-ion, LiFePO4 and NiMH.
//!
//! # How sure it is
//! [`Readings::remaining_sigma_pct`] is one standard deviation of the estimate, in points. What is not known is `None`, never 0:
//! an estimate above 25 points is none. The project's `docs/battery-model.md` has methods, sources and errors on measured drives.
//!
//! # An estimate
//! A reading every 0.1 s of a 3S LiPo pack of 2200 mAh that rests at 12.6 V, and then supplies 4 A:
//!
//! ```
//! use battery_gauge::{BatteryMonitor, BatteryState, Instant, LoadState, Measurement, PackSettings, Tick};
//!
//! let settings = PackSettings {
//!     cell_count: Some(3),
//!     capacity_mah: Some(2200.0),
//!     ..PackSettings::default()
//! };
//! let mut monitor = BatteryMonitor::new();
//! let mut battery = BatteryState::default();
//! for second in 0..360 {
//!     let is_driven = second >= 60;
//!     let (voltage_v, current_a) = if is_driven { (12.2, 4.0) } else { (12.6, 0.0) };
//!     for tenth in 0..10 {
//!         let tick = Tick {
//!             now: Instant::from_micros(second * 1_000_000 + tenth * 100_000),
//!             load_state: if is_driven { LoadState::On } else { LoadState::Off },
//!         };
//!         let reading = Measurement {
//!             voltage_v: Some(voltage_v),
//!             current_a: Some(current_a),
//!             ..Measurement::default()
//!         };
//!         let _ = monitor.update(&mut battery, tick, Ok(reading), &settings);
//!     }
//! }
//! // 4 A for five minutes are 333 mAh, a seventh of the pack.
//! let drawn_mah = battery.consumed_mah().expect("the current is measured");
//! assert!((drawn_mah - 333.0).abs() < 2.0);
//! let remaining_pct = battery.readings.remaining_pct.expect("it has rested");
//! let sigma_pct = battery.readings.remaining_sigma_pct.expect("it is estimated");
//! println!("{remaining_pct:.0} ± {sigma_pct:.0} % left");
//! # assert_eq!(format!("{remaining_pct:.0} ± {sigma_pct:.0}"), "85 ± 2");
//! ```
//!
//! # The life of a monitor
//! ```
//! # use battery_gauge::{BatteryMonitor, BatteryState, LearntPack, Measurement, PackMemory, PackSettings, PackSource, Tick};
//! # let (mut battery, tick, settings) = (BatteryState::default(), Tick::default(), PackSettings::default());
//! # let reading = Ok(Measurement::default());
//! # let (flash, ram) = (None::<LearntPack>, None::<PackMemory>);
//! let mut monitor = BatteryMonitor::new();
//! // At the start: what flash holds of this pack, and RAM if it has outlasted the restart.
//! if let Some(learnt) = flash {
//!     monitor.restore_learnt(learnt);
//! }
//! if let Some(memory) = ram {
//!     monitor.restore(&memory);
//! }
//! // At each reading.
//! let update = monitor.update(&mut battery, tick, reading, &settings);
//! // Act on `update.failsafe`, announce `update.events`; now and then keep what has to outlast a restart.
//! let ram = monitor.memory(battery.status, PackSource::default()).to_words();
//! let flash = monitor.unsaved_learnt().map(LearntPack::to_words);
//! # let _ = (update, ram, flash);
//! ```
//!
//! # Acting at a charge
//! Thresholds are settings, too: here one of 20 % usable charge, which acts as soon as the estimate is certain enough.
//!
//! ```
//! use battery_gauge::{FailsafeLevel, FailsafeSettings, PackSettings, Thresholds};
//! # use battery_gauge::{BatteryMonitor, BatteryState, Instant, LoadState, Measurement, Tick};
//!
//! let settings = PackSettings {
//!     cell_count: Some(3),
//!     capacity_mah: Some(2200.0),
//!     failsafe: FailsafeSettings {
//!         low: Thresholds {
//!             usable_pct: Some(20.0),
//!             ..Thresholds::default()
//!         },
//!         ..FailsafeSettings::default()
//!     },
//!     ..PackSettings::default()
//! };
//! # let (mut monitor, mut battery, mut acted_pct) = (BatteryMonitor::new(), BatteryState::default(), None);
//! # for second in 0..2000 {
//! #     let is_driven = second >= 60;
//! #     let drawn = if is_driven { (second - 60) as f32 * 4.0 / 3.6 / 2200.0 } else { 0.0 };
//! #     let reading = Measurement {
//! #         voltage_v: Some(if is_driven { 12.3 - 2.2 * drawn } else { 12.6 }),
//! #         current_a: Some(if is_driven { 4.0 } else { 0.0 }),
//! #         ..Measurement::default()
//! #     };
//! #     for tenth in 0..10 {
//! #         let now = Instant::from_micros(second * 1_000_000 + tenth * 100_000);
//! #         let load_state = if is_driven { LoadState::On } else { LoadState::Off };
//! #         let update = monitor.update(&mut battery, Tick { now, load_state }, Ok(reading), &settings);
//! // At each reading.
//! if update.failsafe.contains(&FailsafeLevel::Low) {
//!     println!("{:?} % are usable: stop", battery.readings.usable_pct);
//! #   acted_pct = battery.readings.usable_pct;
//! }
//! #     }
//! # }
//! # assert!(acted_pct.is_some_and(|usable_pct| (19.0..=20.0).contains(&usable_pct)), "{acted_pct:?}");
//! ```
//!
//! # Load on or off
//! [`LoadState`] decides about the meaning of a current into the pack, of a missing voltage and of a rest. A product that knows
//! when its load is switched off passes that; one that does not calls it off after a minute without a current worth mentioning, and
//! on at once when there is one. Always on, a charge is taken for braking, and another pack for the same one.
//!
//! # Rates and costs
//! Readings were tried from one in ten seconds to 50 a second, also with pauses. A seldom one should be a mean since the one
//! before: of a load that changes, single samples each ten seconds cost up to 8 points. A pack takes 1.8 KB of RAM
//! with its state, and 9,500 (voltage alone) to 13,000 instructions a reading on a Cortex-M0+, most of them in float routines.
//!
//! # Names
//! Settings name the parameters that ArduPilot has for them, as `BATT_LOW_VOLT`, and states those of MAVLink's messages.
//!
//! With the feature `defmt` what a log shows has its formats.
#![cfg_attr(not(test), no_std)]

mod basis;
mod charge;
mod charge_state;
mod chemistry;
mod consumption;
mod details;
mod diagnosis;
mod estimator;
mod event;
mod failsafe;
mod learnt;
mod learnt_text;
mod low_pass;
mod measurement;
mod memory;
mod monitor;
mod reported;
mod reporters;
mod resistance;
mod rest;
mod settings;
mod state;
mod swap;
mod time;

pub use chemistry::Chemistry;
pub use consumption::Gap;
pub use details::{Date, Name, PackDetails};
pub use event::{PackEvent, PackEvents};
pub use failsafe::{ReachedLevels, is_below};
pub use learnt::{
    END_OF_LIFE_LOSS, LEARNT_CURVE, LEARNT_WORDS, LastCharge, LearntCapacity, LearntPack, LearntResistance,
    LessonObstacle, OLDER_LEARNT_WORDS, Offset,
};
pub use learnt_text::LearntTextError;
pub use measurement::{
    Amount, BusError, CellVoltages, Consumed, Contents, Counted, CurrentRange, Extremes, Gauge, GaugeReading,
    LoadState, MAX_CELLS, Measurement, Measuring, MeasuringScale, ReadError, Supply, Thermometer, Tick,
};
pub use memory::{PACK_WORDS, PackMemory, PackSource};
pub use monitor::{BatteryMonitor, FAILED_READS_UNTIL_UNHEALTHY, MIN_CONNECTED_VOLTAGE_V, PackUpdate};
pub use reported::{ChargeState, Faults, GaugeReport, Modes, Reported};
pub use settings::{
    ChargeLimits, CurrentScale, FailsafeSettings, MissingSetting, PackSettings, SuggestedThresholds,
    Thresholds, VoltageSource,
};
pub use state::{
    BatteryState, ChargeSource, FailsafeLevel, FailsafeTimer, FailsafeTimers, PackStatus, Readings,
    ReportedVoltage, Visibility,
};
pub use time::{Instant, Lasting};
