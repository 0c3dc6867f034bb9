//! Bit timing (5): segments of time quanta, each some cycles of the crystal.

use super::super::super::super::clock::{CLK_SYS_HZ, Cycle};
use super::{CNF1, CNF2, CNF3};

/// In quanta (5.2.5).
const INFORMATION_PROCESSING: u64 = 2;
/// Of a bit: a controller has to offer 8 to 25 (CAN 2.0, 10); the segments of this one can be shorter.
const QUANTA: std::ops::RangeInclusive<u64> = 5..=25;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    crystal_hz: u64,
    prescaler: u64,
    jump: u64,
    propagation: u64,
    phase_1: u64,
    phase_2: u64,
}

impl Timing {
    pub fn of(registers: &[u8; 128], crystal_hz: u64) -> Self {
        let of = |address: u8| u64::from(registers[usize::from(address)]);
        let (cnf1, cnf2, cnf3) = (of(CNF1), of(CNF2), of(CNF3));
        let phase_1 = (cnf2 >> 3 & 7) + 1;
        // BTLMODE: PS2 by CNF3, or the greater of PS1 and the information processing time.
        let phase_2 = match cnf2 >> 7 {
            1 => (cnf3 & 7) + 1,
            _ => phase_1.max(INFORMATION_PROCESSING),
        };
        Self {
            crystal_hz,
            prescaler: (cnf1 & 0x3f) + 1,
            jump: (cnf1 >> 6) + 1,
            propagation: (cnf2 & 7) + 1,
            phase_1,
            phase_2,
        }
    }

    fn quanta(self) -> u64 {
        1 + self.propagation + self.phase_1 + self.phase_2
    }

    /// 5.3 and 5.2.5.
    fn is_allowed(self) -> bool {
        self.propagation + self.phase_1 >= self.phase_2
            && self.phase_2 > self.jump
            && self.phase_2 >= INFORMATION_PROCESSING
            && QUANTA.contains(&self.quanta())
    }

    /// TQ is 2 x (BRP + 1) / FOSC.
    fn crystal_cycles(self) -> u64 {
        self.quanta() * 2 * self.prescaler
    }

    pub fn bits_per_second(self) -> Option<u64> {
        self.is_allowed().then(|| self.crystal_hz / self.crystal_cycles())
    }

    /// With segments that are not allowed it is off by so much that it understands no other node.
    pub fn bit(self) -> Cycle {
        let bit = self.crystal_cycles() * CLK_SYS_HZ / self.crystal_hz;
        if self.is_allowed() { bit } else { bit + bit / 10 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(cnf: [u8; 3], crystal_hz: u64) -> Timing {
        let mut registers = [0; 128];
        for (address, value) in [CNF1, CNF2, CNF3].into_iter().zip(cnf) {
            registers[usize::from(address)] = value;
        }
        Timing::of(&registers, crystal_hz)
    }

    #[test]
    fn the_data_sheets_example_is_125_kbit_at_20_mhz() {
        // 5.3: BRP 4, PropSeg 2, PS1 7, PS2 6, SJW 1.
        let example = timing([0x04, 0x80 | 6 << 3 | 1, 5], 20_000_000);
        assert_eq!(example.bits_per_second(), Some(125_000));
        assert_eq!(example.bit(), 1000);
    }

    #[test]
    fn the_crystal_decides_the_rate() {
        // 16 quanta: 1, 2, 7, 6.
        let cnf = [0x00, 0x80 | 6 << 3 | 1, 5];
        assert_eq!(timing(cnf, 16_000_000).bits_per_second(), Some(500_000));
        assert_eq!(timing(cnf, 8_000_000).bits_per_second(), Some(250_000));
        // 8 quanta of 125 ns: 1, 2, 3, 2.
        let fast = [0x00, 0x80 | 2 << 3 | 1, 1];
        assert_eq!(timing(fast, 16_000_000).bits_per_second(), Some(1_000_000));
    }

    #[test]
    fn segments_that_break_the_rules_have_no_rate() {
        for cnf in [
            // PS2 of one quantum.
            [0x00, 0x80 | 2 << 3 | 1, 0],
            // PS2 not longer than SJW.
            [0x40, 0x80 | 2 << 3 | 1, 1],
            // PS2 longer than the segments before it.
            [0x00, 0x80, 5],
        ] {
            assert_eq!(timing(cnf, 16_000_000).bits_per_second(), None, "{cnf:?}");
        }
    }
}
