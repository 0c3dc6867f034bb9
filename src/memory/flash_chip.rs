//! Makes of flash chips: copies differ from the one that the boot loader is made for.

use super::identity::BoardId;

/// Bytes of the longest unique id.
pub const UNIQUE_ID_BYTES: usize = 16;

/// Zetta's ZD25Q16: its id of 16 bytes is unique in all of them only.
const ZETTA: JedecId = JedecId(0xba_6015);

/// Bit QE of status register 2: quad reads are enabled.
const QUAD_ENABLED: u8 = 1 << 1;

/// Manufacturer, type and capacity of a flash chip (JEDEC JEP106; "Read Identification", 9Fh).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct JedecId(pub u32);

impl JedecId {
    /// Bytes of its unique id that are needed.
    pub fn unique_id_bytes(self) -> usize {
        if self == ZETTA {
            UNIQUE_ID_BYTES
        } else {
            BoardId::BYTES
        }
    }

    /// The board's id, of the chip's unique id; `None` if it has none, as a copy of a chip may: then nothing drives the line.
    pub fn board_id(self, unique_id: &[u8]) -> Option<BoardId> {
        let is_silence = [0, u8::MAX]
            .iter()
            .any(|level| unique_id.iter().all(|byte| byte == level));
        if is_silence {
            return None;
        }
        match <[u8; BoardId::BYTES]>::try_from(unique_id) {
            Ok(id) => Some(BoardId(id)),
            Err(_) => Some(BoardId(fnv(unique_id).to_be_bytes())),
        }
    }
}

/// Wear of the chip's status registers by the second stage, which runs after each page that is written.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum RegisterWear {
    /// The chip keeps bit QE: they are not written.
    #[default]
    None,
    /// The chip does not keep bit QE, so each time it is written, as volatile. A chip that does not know such a write may
    /// store the registers: that takes 10 to 30 ms, and wears them out after some 100,000 times.
    EachPage,
}

impl RegisterWear {
    /// Of a chip whose status register 2 has this value after the second stage has run.
    pub fn of(status_2: u8) -> Self {
        match status_2 & QUAD_ENABLED {
            0 => Self::EachPage,
            _ => Self::None,
        }
    }
}

/// FNV-1a of 64 bits.
fn fnv(bytes: &[u8]) -> u64 {
    let add = |hash: u64, byte: &u8| (hash ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
    bytes.iter().fold(0xcbf2_9ce4_8422_2325, add)
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINBOND: JedecId = JedecId(0xef_4015);

    #[test]
    fn the_hash_is_that_of_its_authors() {
        // Test vectors of FNV-1a, 64 bits.
        assert_eq!(fnv(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(fnv(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(fnv(b"foobar"), 0x8594_4171_f739_67e8);
    }

    #[test]
    fn a_board_has_the_first_8_bytes_but_for_chips_that_share_them() {
        let id: [u8; 8] = [0xe6, 0x60, 0x58, 0x38, 0x83, 0x45, 0x0a, 0x2c];
        assert_eq!(WINBOND.unique_id_bytes(), 8);
        assert_eq!(WINBOND.board_id(&id), Some(BoardId(id)));
        assert_eq!(ZETTA.unique_id_bytes(), 16);
        let (mut one, mut other) = ([7; 16], [7; 16]);
        (one[15], other[15]) = (1, 2);
        assert_ne!(ZETTA.board_id(&one), ZETTA.board_id(&other));
        assert_eq!(ZETTA.board_id(&one), Some(BoardId(fnv(&one).to_be_bytes())));
    }

    #[test]
    fn silence_is_not_an_id() {
        for (chip, level) in [(WINBOND, 0), (WINBOND, 0xff), (ZETTA, 0), (ZETTA, 0xff)] {
            let silence = vec![level; chip.unique_id_bytes()];
            assert_eq!(chip.board_id(&silence), None);
        }
    }

    #[test]
    fn registers_are_not_written_where_quad_reads_are_enabled() {
        for (status_2, expected) in [
            (0b10, RegisterWear::None),
            (0x42, RegisterWear::None),
            (0, RegisterWear::EachPage),
            (0x40, RegisterWear::EachPage),
        ] {
            assert_eq!(RegisterWear::of(status_2), expected, "{status_2:#x}");
        }
    }
}
