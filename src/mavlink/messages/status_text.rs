//! STATUSTEXT (253).

use crate::announce::Severity;
use crate::mavlink::dialect::{MavSeverity, STATUSTEXT_DATA};

/// Characters in one message.
const CHUNK_BYTES: usize = 50;

/// Number of messages that a text of this many bytes needs.
pub(in crate::mavlink) fn chunks_of(text_bytes: usize) -> usize {
    if text_bytes <= CHUNK_BYTES {
        1
    } else {
        text_bytes / CHUNK_BYTES + 1
    }
}

/// The messages that carry `text`: one if it fits, else chunks under the common `id`, which must not be 0.
///
/// A receiver takes a chunk that is not full as the last one, so a text that fills its last chunk is followed by an
/// empty one.
pub fn status_texts(severity: Severity, text: &str, id: u16) -> impl Iterator<Item = STATUSTEXT_DATA> {
    let bytes = text.as_bytes();
    let chunks = chunks_of(bytes.len());
    let id = if chunks == 1 { 0 } else { id };
    let severity = match severity {
        Severity::Info => MavSeverity::MAV_SEVERITY_INFO,
        Severity::Notice => MavSeverity::MAV_SEVERITY_NOTICE,
        Severity::Warning => MavSeverity::MAV_SEVERITY_WARNING,
        Severity::Error => MavSeverity::MAV_SEVERITY_ERROR,
        Severity::Critical => MavSeverity::MAV_SEVERITY_CRITICAL,
    };
    (0..chunks).map(move |chunk| {
        let mut text = [0; CHUNK_BYTES];
        for (to, from) in text.iter_mut().zip(bytes.iter().skip(chunk * CHUNK_BYTES)) {
            *to = *from;
        }
        // A text of over 255 chunks would be 12 kB.
        STATUSTEXT_DATA {
            severity,
            text: text.into(),
            id,
            chunk_seq: chunk as u8,
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chunks(text: &str) -> Vec<(String, u16, u8)> {
        status_texts(Severity::Info, text, 7)
            .map(|message| {
                (
                    message.text.to_str().unwrap().to_string(),
                    message.id,
                    message.chunk_seq,
                )
            })
            .collect()
    }

    #[test]
    fn a_text_that_fits_is_one_message_without_id() {
        assert_eq!(chunks("short"), [("short".into(), 0, 0)]);
        let full = "x".repeat(50);
        assert_eq!(chunks(&full), [(full, 0, 0)]);
    }

    #[test]
    fn a_long_text_is_cut_into_chunks_of_one_id() {
        let text = format!("{}{}", "a".repeat(50), "b".repeat(30));
        assert_eq!(chunks(&text), [("a".repeat(50), 7, 0), ("b".repeat(30), 7, 1)]);
    }

    #[test]
    fn a_last_chunk_that_is_full_is_followed_by_an_empty_one() {
        let text = "x".repeat(100);
        assert_eq!(
            chunks(&text),
            [
                ("x".repeat(50), 7, 0),
                ("x".repeat(50), 7, 1),
                (String::new(), 7, 2)
            ]
        );
    }
}
