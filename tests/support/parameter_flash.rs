//! The flash of parameters of a board that is not new.

use embassy_futures::block_on;
use rover_battmon::memory::flash_map;
use rover_battmon::memory::storage::{Erase, Storage};
use rover_battmon::parameter::{ParameterId, VehicleParameter};
use rover_battmon_tools::sim::SimulatedFlash;

/// The motor drivers stand any pack: many tests arm with a 3S pack.
const NO_DRIVER_LIMIT: (ParameterId, f32) = (ParameterId::Vehicle(VehicleParameter::MotDrvVolt), 0.0);

/// Stores these values under their keys, and behind them what every vehicle under test has.
pub fn fill(flash: &SimulatedFlash, values: impl IntoIterator<Item = (u16, f32)>) {
    let mut storage = Storage::of_double_sectors(flash.clone(), flash_map::PARAMETERS);
    let (drivers, limit_v) = NO_DRIVER_LIMIT;
    block_on(async {
        for (key, value) in values.into_iter().chain([(drivers.key(), limit_v)]) {
            let stored = storage.store(key, value.to_bits(), &Erase::always).await;
            stored.expect("there is room");
        }
        // As a board has done that has run for a second.
        while !storage.is_prepared() {
            storage.prepare(&Erase::always).await.expect("it works");
        }
    });
}

/// The region after that.
pub fn flash_with(values: impl IntoIterator<Item = (u16, f32)>) -> Vec<u8> {
    let flash = SimulatedFlash::blank();
    fill(&flash, values);
    flash.content(flash_map::PARAMETERS)
}
