//! What the radio's own processor runs: its program, the limits of each country, and the data of this board.

use cyw43::{A4, Aligned};

/// The program of the CYW43439, as the driver uploads it at each start.
pub(super) static PROGRAM: Aligned<A4, [u8; 231_077]> = Aligned(*cyw43_firmware::CYW43_43439A0);

/// Country locale matrix: which channels and powers are allowed where.
pub(super) static COUNTRIES: &[u8] = cyw43_firmware::CYW43_43439A0_CLM;

/// What the program has to know of the module on a Pico W, as lines `name=value` (the values that the driver's release
/// 0.6.0 carried in its source, `nvram.rs`).
const BOARD_DATA_LINES: &[u8] = include_bytes!("nvram.txt");

/// A zero after each line and one at the end, filled up to whole words.
const BOARD_DATA_BYTES: usize = (BOARD_DATA_LINES.len() + 1).next_multiple_of(4);

/// The same as the chip reads it.
pub(super) static BOARD_DATA: Aligned<A4, [u8; BOARD_DATA_BYTES]> = Aligned(ended_by_zeros(BOARD_DATA_LINES));

const fn ended_by_zeros(lines: &[u8]) -> [u8; BOARD_DATA_BYTES] {
    let mut data = [0; BOARD_DATA_BYTES];
    let mut at = 0;
    while at < lines.len() {
        if lines[at] != b'\n' {
            data[at] = lines[at];
        }
        at += 1;
    }
    data
}
