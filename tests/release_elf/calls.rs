//! Calls and jumps in Thumb code (encodings: ARMv6-M, A6.7).

use workbench::program::Program;

/// Where an undefined instruction (`udf`, A6.7.72) leads to: a HardFault.
pub const TRAP: u32 = u32::MAX;

/// An instruction, or a constant beside the code, that leads to another address.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Call {
    pub from: u32,
    pub to: u32,
}

/// Every `bl`, `b` and `udf` of a program, and every address of a function that it loads from a constant.
pub fn calls(program: &Program) -> Vec<Call> {
    let direct = program.code().flat_map(|(start, code)| branches(start, code));
    let by_address = program
        .constants()
        .flat_map(|(start, bytes)| function_addresses(start, bytes));
    direct.chain(by_address).collect()
}

fn branches(start: u32, code: &[u8]) -> Vec<Call> {
    let halfwords: Vec<u16> = code
        .chunks_exact(2)
        .map(|pair| u16::from_le_bytes([pair[0], pair[1]]))
        .collect();
    let mut found = Vec::new();
    let mut index = 0;
    while let Some(&first) = halfwords.get(index) {
        let from = start + 2 * index as u32;
        let is_wide = first >> 11 > 0b11100;
        let offset = match halfwords.get(index + 1) {
            Some(&second) if is_wide => call_offset(first, second),
            _ => jump_offset(first),
        };
        let target = offset.map(|offset| from.wrapping_add(4).wrapping_add_signed(offset));
        let to = target.or((first >> 8 == 0xde).then_some(TRAP));
        found.extend(to.map(|to| Call { from, to }));
        index += if is_wide { 2 } else { 1 };
    }
    found
}

/// `bl` (A6.7.13): S:I1:I2:imm10:imm11:0.
fn call_offset(first: u16, second: u16) -> Option<i32> {
    if first >> 11 != 0b11110 || second & 0xd000 != 0xd000 {
        return None;
    }
    let bit = |number: u16| u32::from(second >> number & 1);
    let sign = u32::from(first >> 10 & 1);
    let (i1, i2) = (1 ^ bit(13) ^ sign, 1 ^ bit(11) ^ sign);
    let offset =
        sign << 24 | i1 << 23 | i2 << 22 | u32::from(first & 0x3ff) << 12 | u32::from(second & 0x7ff) << 1;
    Some((offset << 7) as i32 >> 7)
}

/// `b` (A6.7.10), encoding T2: imm11:0.
fn jump_offset(instruction: u16) -> Option<i32> {
    (instruction >> 11 == 0b11100).then(|| (i32::from(instruction) << 21) >> 20)
}

/// Words that are an odd address in flash: functions are called so.
fn function_addresses(start: u32, bytes: &[u8]) -> Vec<Call> {
    let words = bytes
        .chunks_exact(4)
        .map(|word| u32::from_le_bytes([word[0], word[1], word[2], word[3]]));
    (start..)
        .step_by(4)
        .zip(words)
        .filter(|(_, word)| word >> 24 == 0x10 && word & 1 == 1)
        .map(|(from, word)| Call { from, to: word & !1 })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn targets(code: &[u16]) -> Vec<u32> {
        let bytes: Vec<u8> = code.iter().flat_map(|halfword| halfword.to_le_bytes()).collect();
        branches(0x1001_0000, &bytes).iter().map(|call| call.to).collect()
    }

    #[test]
    fn calls_jumps_and_traps_are_found_and_nothing_else() {
        // Calls as the assembler encodes them: back, to the next instruction, far ahead.
        assert_eq!(call_offset(0xf7ff, 0xfd29), Some(-1454));
        assert_eq!(targets(&[0xf000, 0xf800]), [0x1001_0004]);
        assert_eq!(targets(&[0xf3ff, 0xd7ff]), [0x1001_0004 + 0x00ff_fffe]);
        // Jumps, and a conditional one.
        assert_eq!(targets(&[0xe7fe, 0xe000, 0xd0fe]), [0x1001_0000, 0x1001_0006]);
        assert_eq!(targets(&[0xdefe]), [TRAP]);
        // mrs r0, primask; then dmb: the second half of a wide instruction is no jump.
        assert!(targets(&[0xf3ef, 0x8010, 0xf3bf, 0x8f5f]).is_empty());
    }

    #[test]
    fn a_constant_that_is_the_address_of_a_function_counts() {
        let bytes = [0x1000_0101_u32, 0x1000_0100, 7].map(u32::to_le_bytes).concat();
        let call = Call {
            from: 0x1001_0000,
            to: 0x1000_0100,
        };
        assert_eq!(function_addresses(0x1001_0000, &bytes), [call]);
    }
}
