//! Task names retained over a reset, as characters: a pointer would be invalid after a firmware update.

use core::fmt::{self, Display, Formatter, Write};

/// A task's name as words of four characters.
pub type TaskNameWords = [u32; 4];

/// A task's name of 1 to 16 ASCII characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaskName(TaskNameWords);

impl TaskName {
    /// `name`, truncated; `None` if empty.
    pub fn new(name: &str) -> Option<Self> {
        let mut bytes = name.bytes();
        let word = [(); 4];
        Self::from_words(word.map(|()| u32::from_le_bytes([(); 4].map(|()| bytes.next().unwrap_or(0)))))
    }

    /// The name as words.
    pub fn to_words(self) -> TaskNameWords {
        self.0
    }

    /// The name in `words`; `None` for zeros.
    pub fn from_words(words: TaskNameWords) -> Option<Self> {
        (words != TaskNameWords::default()).then_some(Self(words))
    }
}

/// Drops characters that are not printable.
impl Display for TaskName {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let bytes = self.0.iter().flat_map(|word| word.to_le_bytes());
        bytes
            .filter(|byte| (b' '..=b'~').contains(byte))
            .try_for_each(|byte| f.write_char(char::from(byte)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn written(name: &str) -> Option<String> {
        TaskName::new(name).map(|name| name.to_string())
    }

    #[test]
    fn name_is_truncated_and_printable() {
        assert_eq!(written("UART0 reader").unwrap(), "UART0 reader");
        assert_eq!(written("seventeen letters").unwrap(), "seventeen letter");
        assert_eq!(written("a\n\u{7f}b\0c").unwrap(), "abc");
        assert_eq!(written(""), None);
    }

    proptest! {
        #[test]
        fn names_round_trip(name in "[ -~]{1,16}") {
            let words = TaskName::new(&name).unwrap().to_words();
            prop_assert_eq!(TaskName::from_words(words).unwrap().to_string(), name);
        }

        #[test]
        fn arbitrary_words_are_printable(words: TaskNameWords) {
            let written = TaskName::from_words(words).unwrap().to_string();
            prop_assert!(written.len() <= 16 && !written.contains(|character: char| character.is_control()));
        }
    }
}
