//! What flash holds of a pack, as words.

// Not every test program uses all of it.
use rover_battmon::battery::LEARNT_WORDS;

/// Words of a pack of two cells of which this capacity and 20 mOhm a cell were learnt, and no charge is kept.
pub fn learnt_words(serial_number: Option<i32>, capacity_mah: f32) -> [u32; LEARNT_WORDS] {
    let [lipo, cells] = [1, 2];
    let mut words = [0; LEARNT_WORDS];
    words[0] = u32::from_le_bytes([lipo, cells, 1, 0]);
    words[1] = serial_number.unwrap_or(-1) as u32;
    words[2] = capacity_mah.to_bits();
    words[3] = 0.02_f32.to_bits();
    words[4] = 0.02_f32.to_bits();
    words[5] = 0.02_f32.to_bits();
    words[6] = (-1.0_f32).to_bits();
    words
}
