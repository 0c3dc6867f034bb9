//! A map from parameters to values.

use super::ParameterId;
use super::id::VARIABLE_COUNT;

/// One `T` for each parameter that is not constant.
#[derive(Clone, Debug, PartialEq)]
pub struct ForEachParameter<T>([T; VARIABLE_COUNT]);

impl<T: Copy + Default> ForEachParameter<T> {
    /// Initialised with `make` for each parameter.
    pub fn from_fn(make: impl Fn(ParameterId) -> T) -> Self {
        let mut all = Self::default();
        all.set_all(make);
        all
    }

    /// Sets each to `make` of its parameter.
    pub fn set_all(&mut self, make: impl Fn(ParameterId) -> T) {
        for id in ParameterId::all() {
            self.set(id, make(id));
        }
    }

    /// Sets each to `update` of itself.
    pub fn update_all(&mut self, mut update: impl FnMut(T) -> T) {
        for one in &mut self.0 {
            *one = update(*one);
        }
    }

    /// All values: much faster than by their ids.
    pub fn values(&self) -> impl Iterator<Item = T> {
        self.0.iter().copied()
    }

    /// The value of `id`, of a constant the default.
    pub fn get(&self, id: ParameterId) -> T {
        self.0.get(id.number()).copied().unwrap_or_default()
    }

    /// Sets the value of `id`.
    pub fn set(&mut self, id: ParameterId, value: T) {
        if let Some(place) = self.0.get_mut(id.number()) {
            *place = value;
        }
    }
}

impl<T: Copy + Default> Default for ForEachParameter<T> {
    fn default() -> Self {
        Self([T::default(); VARIABLE_COUNT])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_has_its_value() {
        let keys = ForEachParameter::from_fn(ParameterId::key);
        for id in ParameterId::all() {
            assert_eq!(keys.get(id), id.key(), "{}", id.name());
        }
    }
}
