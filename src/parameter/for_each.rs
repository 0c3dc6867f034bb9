//! Something for each parameter.

use super::{PARAMETER_COUNT, ParameterId};

/// One `T` for each parameter.
#[derive(Clone, Debug, PartialEq)]
pub struct ForEachParameter<T>([T; PARAMETER_COUNT]);

impl<T: Copy + Default> ForEachParameter<T> {
    /// What `make` returns for each of them.
    pub fn from_fn(make: impl Fn(ParameterId) -> T) -> Self {
        let mut all = Self::default();
        all.set_all(make);
        all
    }

    /// Replaces each by what `make` returns for it.
    pub fn set_all(&mut self, make: impl Fn(ParameterId) -> T) {
        for id in ParameterId::all() {
            self.set(id, make(id));
        }
    }

    /// Replaces each by what `update` makes of it.
    pub fn update_all(&mut self, mut update: impl FnMut(T) -> T) {
        for one in &mut self.0 {
            *one = update(*one);
        }
    }

    /// The one of `id`.
    pub fn get(&self, id: ParameterId) -> T {
        // Each has its place, but the compiler does not see that: an index would leave a panicking path.
        self.0.get(id.number()).copied().unwrap_or_default()
    }

    /// Replaces the one of `id`.
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
    fn each_has_its_own() {
        let keys = ForEachParameter::from_fn(ParameterId::key);
        for id in ParameterId::all() {
            assert_eq!(keys.get(id), id.key(), "{}", id.name());
        }
    }
}
