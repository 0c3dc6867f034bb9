//! Something for each parameter.

use super::table::{BatteryParameter, VehicleParameter};
use super::{Pack, ParameterId};
use crate::battery::MAX_PACKS;

/// One `T` for each parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ForEachParameter<T> {
    vehicle: [T; VehicleParameter::COUNT],
    batteries: [[T; BatteryParameter::COUNT]; MAX_PACKS],
}

impl<T> ForEachParameter<T> {
    /// What `make` says for each of them.
    pub fn from_fn(make: impl Fn(ParameterId) -> T) -> Self {
        Self {
            vehicle: VehicleParameter::ALL.map(|parameter| make(parameter.into())),
            batteries: Pack::ALL.map(|pack| BatteryParameter::ALL.map(|parameter| make(parameter.of(pack)))),
        }
    }

    /// The one of `id`.
    pub fn get(&self, id: ParameterId) -> &T {
        match id {
            ParameterId::Vehicle(parameter) => &self.vehicle[parameter as usize],
            ParameterId::Battery(pack, parameter) => &self.batteries[pack as usize][parameter as usize],
        }
    }

    /// The one of `id`, to change it.
    pub fn get_mut(&mut self, id: ParameterId) -> &mut T {
        match id {
            ParameterId::Vehicle(parameter) => &mut self.vehicle[parameter as usize],
            ParameterId::Battery(pack, parameter) => &mut self.batteries[pack as usize][parameter as usize],
        }
    }
}
