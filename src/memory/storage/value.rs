//! What can be stored: values of a fixed number of words.

/// A value of a fixed number of words. Its width decides the layout of the region.
pub trait Value: Copy + Default + PartialEq {
    /// A record: key, value and CRC-32.
    type Record: Copy + PartialEq + AsRef<[u8]> + AsMut<[u8]>;

    /// An erased record.
    const ERASED: Self::Record;

    /// Number of words.
    const WORDS: u8;

    /// The words.
    fn words(&self) -> &[u32];

    /// The words, to be read into.
    fn words_mut(&mut self) -> &mut [u32];
}

/// A parameter, or a part of the signing data.
impl Value for u32 {
    type Record = [u8; 12];
    const ERASED: Self::Record = [0xFF; 12];
    const WORDS: u8 = 1;

    fn words(&self) -> &[u32] {
        core::slice::from_ref(self)
    }

    fn words_mut(&mut self) -> &mut [u32] {
        core::slice::from_mut(self)
    }
}

/// The name and the password of a Wi-Fi network.
impl Value for [u32; 25] {
    type Record = [u8; 108];
    const ERASED: Self::Record = [0xFF; 108];
    const WORDS: u8 = 25;

    fn words(&self) -> &[u32] {
        self
    }

    fn words_mut(&mut self) -> &mut [u32] {
        self
    }
}

/// What is learnt of a pack.
impl Value for [u32; 14] {
    type Record = [u8; 64];
    const ERASED: Self::Record = [0xFF; 64];
    const WORDS: u8 = 14;

    fn words(&self) -> &[u32] {
        self
    }

    fn words_mut(&mut self) -> &mut [u32] {
        self
    }
}
