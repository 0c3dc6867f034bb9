//! The frame parser: whatever the chunks, the same frames are found, and every byte is taken.

use rover_battmon::mavlink::FrameParser;

use super::Input;

/// Message, sender and payload of a frame, and whether it is signed.
type Found = (u32, [u8; 2], Vec<u8>, bool);

fn parse(bytes: &[u8], mut chunk_bytes: impl FnMut() -> usize) -> Vec<Found> {
    let mut parser = FrameParser::new();
    let mut found = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() {
        let chunk = &rest[..chunk_bytes().clamp(1, rest.len())];
        let taken = parser.push(chunk);
        assert!(taken > 0, "no room after everything was handled");
        rest = &rest[taken..];
        collect(&mut parser, &mut found);
    }
    parser.give_up_waiting();
    collect(&mut parser, &mut found);
    assert_eq!(parser.statistics().frames as usize, found.len());
    found
}

fn collect(parser: &mut FrameParser, found: &mut Vec<Found>) {
    while let Some(frame) = parser.next_frame() {
        let payload = frame.payload.0.to_vec();
        let is_signed = frame.signed.is_some();
        assert!(frame.signed.is_none_or(|bytes| bytes.len() == payload.len() + 25));
        let sender = [frame.system_id, frame.component_id];
        found.push((frame.message_id, sender, payload, is_signed));
    }
}

/// The first bytes say how the rest arrives.
pub fn run(bytes: &[u8]) {
    let mut input = Input::new(bytes);
    let chunks = input.bytes(8);
    let stream = input.bytes(usize::MAX);
    let mut turn = 0;
    let uneven = parse(stream, || {
        turn += 1;
        let size = chunks.get(turn % chunks.len().max(1));
        size.map_or(1, |size| usize::from(*size))
    });
    assert_eq!(uneven, parse(stream, || 1), "byte by byte");
    assert_eq!(uneven, parse(stream, || usize::MAX), "all at once");
}
