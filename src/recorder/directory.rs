//! Which log files there are, and where.

use core::num::NonZeroU32;

use heapless::Vec;

use super::front::{Header, PAYLOAD_BYTES};

/// Files that are listed at most. With more, the oldest is no longer listed.
pub const MAX_FILES: usize = 64;

/// A log file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LogFile {
    /// From 1; after 65535 comes 1.
    pub number: u16,
    /// Length, bytes.
    pub bytes: u32,
    /// When it began, in seconds since 1970 (UTC); `None` if that is unknown.
    pub began_utc_s: Option<NonZeroU32>,
}

/// Place of a part of a file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileSpan {
    /// Its sector.
    pub sequence: u32,
    /// Its offset in the payload of the sector.
    pub offset: u32,
    /// Bytes from there on, to the end of the sector or file.
    pub bytes: u32,
}

/// The files, oldest first.
#[derive(Debug, Default)]
pub struct Directory {
    files: Vec<LogFile, MAX_FILES>,
    /// The first sector of each.
    first: Vec<u32, MAX_FILES>,
}

impl Directory {
    pub fn files(&self) -> &[LogFile] {
        &self.files
    }

    /// The first sector of the oldest file.
    pub fn oldest_sequence(&self) -> Option<u32> {
        self.first.first().copied()
    }

    /// The newest file and its first sector.
    pub fn newest(&self) -> Option<(LogFile, u32)> {
        Some((*self.files.last()?, *self.first.last()?))
    }

    /// Adds an empty file. There is never another one of the same number, nor more than [`MAX_FILES`]: an older one is
    /// removed.
    pub fn push(&mut self, number: u16, first: u32) {
        if let Some(index) = self.files.iter().position(|file| file.number == number) {
            self.remove(index);
        }
        if self.files.is_full() {
            self.remove(0);
        }
        let file = LogFile {
            number,
            bytes: 0,
            began_utc_s: None,
        };
        if self.files.push(file).is_ok() {
            // As many as there are files.
            let _ = self.first.push(first);
        }
    }

    /// The newest file has grown by this many bytes.
    pub fn grow(&mut self, bytes: u32) {
        if let Some(file) = self.files.last_mut() {
            file.bytes += bytes;
        }
    }

    /// The newest file began at this moment, in seconds since 1970.
    pub fn date(&mut self, began_utc_s: NonZeroU32) {
        if let Some(file) = self.files.last_mut() {
            file.began_utc_s = Some(began_utc_s);
        }
    }

    /// Takes over a sector that a scan found, after all that are older, of a file that has this date. Not one that contradicts
    /// them.
    pub fn take_over(&mut self, header: Header, began_utc_s: Option<NonZeroU32>) {
        let first = header.first_sequence();
        if !self.is_newest(header.number, first) {
            if first < self.end() {
                return;
            }
            self.push(header.number, first);
        }
        if let Some(file) = self.files.last_mut() {
            file.bytes = (u32::from(header.index) + 1) * PAYLOAD_BYTES;
            file.began_utc_s = began_utc_s;
        }
    }

    fn is_newest(&self, number: u16, first: u32) -> bool {
        self.newest()
            .is_some_and(|(file, newest_first)| file.number == number && newest_first == first)
    }

    /// The sector after the newest file.
    fn end(&self) -> u32 {
        self.newest()
            .map_or(0, |(file, first)| first + file.bytes.div_ceil(PAYLOAD_BYTES))
    }

    /// The last sector of the file with this index, if it is not empty.
    pub fn last_sequence(&self, index: usize) -> Option<u32> {
        let bytes = self.files.get(index)?.bytes.checked_sub(1)?;
        Some(self.first.get(index)? + bytes / PAYLOAD_BYTES)
    }

    /// The file with this index is shorter by this many bytes.
    pub fn shorten(&mut self, index: usize, bytes: u32) {
        if let Some(file) = self.files.get_mut(index) {
            file.bytes = file.bytes.saturating_sub(bytes);
        }
    }

    /// Removes files without content.
    pub fn remove_empty(&mut self) {
        while let Some(index) = self.files.iter().position(|file| file.bytes == 0) {
            self.remove(index);
        }
    }

    /// Removes the newest file, if it is empty.
    pub fn pop_if_empty(&mut self) {
        if self.files.last().is_some_and(|file| file.bytes == 0) {
            self.files.pop();
            self.first.pop();
        }
    }

    /// Removes the oldest file.
    pub fn remove_oldest(&mut self) {
        self.remove(0);
    }

    /// Removes all files.
    pub fn clear(&mut self) {
        self.files.clear();
        self.first.clear();
    }

    /// Place of the bytes of a file from `offset` on; `None` beyond its end.
    pub fn locate(&self, number: u16, offset: u32) -> Option<FileSpan> {
        let mut files = self.files.iter().zip(&self.first);
        let (file, first) = files.find(|(file, _)| file.number == number)?;
        let left = file.bytes.checked_sub(offset).filter(|left| *left > 0)?;
        let in_sector = offset % PAYLOAD_BYTES;
        Some(FileSpan {
            sequence: first + offset / PAYLOAD_BYTES,
            offset: in_sector,
            bytes: left.min(PAYLOAD_BYTES - in_sector),
        })
    }

    fn remove(&mut self, index: usize) {
        remove(&mut self.files, index);
        remove(&mut self.first, index);
    }
}

/// Moves what is behind `index` forward by one. `Vec::remove` has a panic that stays linked.
fn remove<T: Copy>(entries: &mut Vec<T, MAX_FILES>, index: usize) {
    let Some(last) = entries.pop() else {
        return;
    };
    let mut follower = last;
    for entry in entries.iter_mut().skip(index).rev() {
        core::mem::swap(entry, &mut follower);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn numbers(directory: &Directory) -> std::vec::Vec<u16> {
        directory.files().iter().map(|file| file.number).collect()
    }

    fn directory(numbers: impl IntoIterator<Item = u16>) -> Directory {
        let mut directory = Directory::default();
        for number in numbers {
            directory.push(number, 100 + u32::from(number));
            directory.grow(1);
        }
        directory
    }

    #[test]
    fn any_file_can_be_removed() {
        for index in 0..4 {
            let mut directory = directory(1..=4);
            directory.remove(index);
            let kept: std::vec::Vec<_> = (1..=4)
                .filter(|number| usize::from(*number) != index + 1)
                .collect();
            assert_eq!(numbers(&directory), kept);
            let first: std::vec::Vec<_> = kept.iter().map(|number| 100 + u32::from(*number)).collect();
            assert_eq!(directory.first.as_slice(), first);
        }
    }

    #[test]
    fn oldest_file_gives_way_to_one_too_many() {
        assert_eq!(
            numbers(&directory(1..=70)),
            (7..=70).collect::<std::vec::Vec<_>>()
        );
    }

    #[test]
    fn number_is_never_listed_twice() {
        assert_eq!(numbers(&directory([1, 2, 3, 2])), [1, 3, 2]);
    }

    #[test]
    fn sector_that_contradicts_older_ones_is_not_taken_over() {
        let mut found = Directory::default();
        for (number, index, sequence) in [(2, 1, 23), (3, 2, 24)] {
            let header = Header {
                sequence,
                number,
                index,
            };
            found.take_over(header, None);
        }
        let bytes = 2 * PAYLOAD_BYTES;
        let file = LogFile {
            number: 2,
            bytes,
            began_utc_s: None,
        };
        assert_eq!(found.files(), [file]);
        assert_eq!(found.oldest_sequence(), Some(22));
    }
}
