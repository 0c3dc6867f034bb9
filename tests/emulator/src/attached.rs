//! Devices that a test attaches. They belong to its thread, and only it knows how to make another one.

use send_wrapper::SendWrapper;

/// What is attached. A board with nothing attached may be copied and given to other threads.
pub struct Attached<T>(Option<SendWrapper<T>>);

impl<T> Default for Attached<T> {
    fn default() -> Self {
        Self(None)
    }
}

impl<T> Attached<T> {
    pub fn get(&self) -> Option<&T> {
        self.0.as_deref()
    }

    pub fn get_mut(&mut self) -> Option<&mut T> {
        self.0.as_deref_mut()
    }
}

impl<T: Default> Attached<T> {
    pub fn get_or_default(&mut self) -> &mut T {
        self.0.get_or_insert_with(|| SendWrapper::new(T::default()))
    }
}

impl<T> Clone for Attached<T> {
    fn clone(&self) -> Self {
        assert!(
            self.0.is_none(),
            "a board to which a test has attached devices cannot be copied: attach them to the copies"
        );
        Self(None)
    }
}
