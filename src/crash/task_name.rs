//! The name of a task, as bytes: what a pointer leads to may be another firmware's by the time it is followed.

use core::fmt::{self, Display, Formatter, Write};

/// A task's name as plain words, four characters in each.
pub type TaskNameWords = [u32; 4];

/// A name of 1 to 16 characters of ASCII.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaskName(TaskNameWords);

impl TaskName {
    /// As much of `name` as fits; `None` if it is empty.
    pub fn new(name: &str) -> Option<Self> {
        let mut bytes = name.bytes();
        let word = [(); 4];
        Self::from_words(word.map(|()| u32::from_le_bytes([(); 4].map(|()| bytes.next().unwrap_or(0)))))
    }

    /// The same as words.
    pub fn to_words(self) -> TaskNameWords {
        self.0
    }

    /// The name these words are; `None` for zeros.
    pub fn from_words(words: TaskNameWords) -> Option<Self> {
        (words != TaskNameWords::default()).then_some(Self(words))
    }
}

/// What can't be printed is left out.
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
    fn a_name_is_as_much_as_fits_of_what_can_be_printed() {
        assert_eq!(written("UART0 reader").unwrap(), "UART0 reader");
        assert_eq!(written("seventeen letters").unwrap(), "seventeen letter");
        assert_eq!(written("a\n\u{7f}b\0c").unwrap(), "abc");
        assert_eq!(written(""), None);
    }

    proptest! {
        #[test]
        fn a_name_is_the_same_behind_its_words(name in "[ -~]{1,16}") {
            let words = TaskName::new(&name).unwrap().to_words();
            prop_assert_eq!(TaskName::from_words(words).unwrap().to_string(), name);
        }

        #[test]
        fn whatever_words_hold_can_be_printed(words: TaskNameWords) {
            let written = TaskName::from_words(words).unwrap().to_string();
            prop_assert!(written.len() <= 16 && !written.contains(|character: char| character.is_control()));
        }
    }
}
