//! Which part of a file is asked for.

/// One range of bytes (RFC 9110, 14.1.2).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ByteRange {
    /// From the offset `first` on, to the offset `last` or the end.
    From { first: u32, last: Option<u32> },
    /// The last bytes, as many as this.
    Last(u32),
}

impl ByteRange {
    /// From the header `Range`; `None` for what may be answered with the whole: several ranges, or other units.
    pub fn parse(text: &str) -> Option<Self> {
        let range = text.strip_prefix("bytes=")?;
        match range.split_once('-')? {
            ("", bytes) => Some(Self::Last(number(bytes)?)),
            (first, "") => Some(Self::From {
                first: number(first)?,
                last: None,
            }),
            (first, last) => {
                let (first, last) = (number(first)?, number(last)?);
                (first <= last).then_some(Self::From {
                    first,
                    last: Some(last),
                })
            }
        }
    }

    /// The offsets of the first byte and behind the last one in a file of this length; `None` if it has no such bytes.
    pub fn within(self, bytes: u32) -> Option<(u32, u32)> {
        let (first, end) = match self {
            Self::From { first, last } => (
                first,
                last.map_or(bytes, |last| last.saturating_add(1).min(bytes)),
            ),
            Self::Last(count) => (bytes.saturating_sub(count), bytes),
        };
        (first < end).then_some((first, end))
    }
}

/// Digits alone: `parse` would take a sign.
fn number(text: &str) -> Option<u32> {
    text.bytes().all(|byte| byte.is_ascii_digit()).then_some(())?;
    text.parse().ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_lies_within_the_file() {
        for (text, part) in [
            ("bytes=0-", Some((0, 100))),
            ("bytes=40-", Some((40, 100))),
            ("bytes=40-49", Some((40, 50))),
            ("bytes=40-4000000000", Some((40, 100))),
            ("bytes=0-4294967295", Some((0, 100))),
            ("bytes=-30", Some((70, 100))),
            ("bytes=-300", Some((0, 100))),
            ("bytes=-0", None),
            ("bytes=100-", None),
        ] {
            let range = ByteRange::parse(text).unwrap_or_else(|| panic!("{text}"));
            assert_eq!(range.within(100), part, "{text}");
        }
    }

    #[test]
    fn what_is_no_single_range_is_ignored() {
        for text in [
            "",
            "bytes",
            "bytes=",
            "bytes=-",
            "bytes=5-4",
            "bytes=+1-2",
            "bytes=0-1,4-5",
            "lines=0-4",
            "bytes=99999999999-",
        ] {
            assert_eq!(ByteRange::parse(text), None, "{text}");
        }
    }
}
