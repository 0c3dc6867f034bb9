//! A map from parameters to values.

use super::{PARAMETER_COUNT, ParameterId};

/// One `T` for each parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ForEachParameter<T>([T; PARAMETER_COUNT]);

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

    /// The value of `id`.
    pub fn get(&self, id: ParameterId) -> T {
        // In bounds for every id, but an index would leave a panicking path.
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
        Self([T::default(); PARAMETER_COUNT])
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
