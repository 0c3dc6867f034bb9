//! Types that can be stored: values of a fixed number of words.

/// A value of a fixed number of words. Its width decides the layout of the region.
pub trait Value: Copy {
    /// Number of words: 25 at most.
    const WORDS: usize;

    /// The words.
    fn words(&self) -> &[u32];

    /// The value of these words.
    fn from_words(words: impl Iterator<Item = u32>) -> Self;
}

/// A parameter, or a part of the signing data.
impl Value for u32 {
    const WORDS: usize = 1;

    fn words(&self) -> &[u32] {
        core::slice::from_ref(self)
    }

    fn from_words(mut words: impl Iterator<Item = u32>) -> Self {
        words.next().unwrap_or_default()
    }
}

/// Learnt data of a pack, or the name and the password of a Wi-Fi network.
impl<const N: usize> Value for [u32; N] {
    const WORDS: usize = N;

    fn words(&self) -> &[u32] {
        self
    }

    fn from_words(words: impl Iterator<Item = u32>) -> Self {
        let mut value = [0; N];
        value
            .iter_mut()
            .zip(words)
            .for_each(|(place, word)| *place = word);
        value
    }
}
