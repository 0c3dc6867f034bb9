//! The flash of parameters of a board that is not new.

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::ReadNorFlash;
use rover_battmon::memory::flash_map;
use rover_battmon::memory::storage::{Erase, Storage};
use rover_battmon::parameter::{ParameterId, VehicleParameter};
use rover_battmon_tools::sim::SimulatedFlash;

use crate::bench::PARAMETER_BYTES;

/// The motor drivers stand any pack: many tests arm with a 3S pack.
const NO_DRIVER_LIMIT: (ParameterId, f32) = (ParameterId::Vehicle(VehicleParameter::MotDrvVolt), 0.0);

/// The flash after these values were stored under their keys, and behind them what every bench has.
pub fn flash_with(values: impl IntoIterator<Item = (u16, f32)>) -> Vec<u8> {
    let mut flash = SimulatedFlash::open(None).expect("it needs no file");
    let mut storage = Storage::of_double_sectors(flash.clone(), flash_map::PARAMETERS);
    let mut image = vec![0; PARAMETER_BYTES];
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
        let start = flash_map::PARAMETERS.start;
        flash.read(start, &mut image).await.expect("it is inside");
    });
    image
}
