//! The fields of an instruction, and how execution goes on after it.

/// A halfword and where it stands.
#[derive(Clone, Copy)]
pub struct Instruction {
    pub opcode: u16,
    pub pc: u32,
}

/// An instruction was executed.
#[derive(Clone, Copy)]
pub struct Step {
    /// The address of the next one.
    pub next: u32,
    pub cycles: u64,
}

impl Instruction {
    /// The number of a low register in three bits.
    #[inline(always)]
    pub fn low(self, shift: u32) -> usize {
        usize::from(self.opcode >> shift & 7)
    }

    /// Any register, where four bits name the source.
    #[inline(always)]
    pub fn high_source(self) -> usize {
        usize::from(self.opcode >> 3 & 15)
    }

    /// Any register, where the destination's fourth bit stands apart.
    #[inline(always)]
    pub fn high_destination(self) -> usize {
        usize::from(self.opcode >> 4 & 8 | self.opcode & 7)
    }

    #[inline(always)]
    pub fn immediate3(self) -> u32 {
        u32::from(self.opcode >> 6 & 7)
    }

    #[inline(always)]
    pub fn immediate5(self) -> u32 {
        u32::from(self.opcode >> 6 & 31)
    }

    #[inline(always)]
    pub fn immediate7(self) -> u32 {
        u32::from(self.opcode & 0x7f)
    }

    /// Also a list of low registers.
    #[inline(always)]
    pub fn immediate8(self) -> u32 {
        u32::from(self.opcode & 0xff)
    }

    /// What PC reads as.
    #[inline(always)]
    pub fn read_pc(self) -> u32 {
        self.pc.wrapping_add(4)
    }

    #[inline(always)]
    pub fn aligned_pc(self) -> u32 {
        self.read_pc() & !3
    }

    /// The distance of a branch, in the lowest bits as halfwords.
    #[inline(always)]
    pub fn signed_offset(self, bits: u32) -> u32 {
        sign_extend(u32::from(self.opcode) << 1, bits + 1)
    }

    /// The distance of BL (A6.7.13).
    #[inline(always)]
    pub fn offset_of_call(self, second: u16) -> u32 {
        let (first, second) = (u32::from(self.opcode), u32::from(second));
        let s = first >> 10 & 1;
        let i1 = second >> 13 & 1 ^ s ^ 1;
        let i2 = second >> 11 & 1 ^ s ^ 1;
        let offset = s << 24 | i1 << 23 | i2 << 22 | (first & 0x3ff) << 12 | (second & 0x7ff) << 1;
        sign_extend(offset, 25)
    }

    /// On to the instruction behind it.
    #[inline(always)]
    pub fn done(self, cycles: u64) -> Option<Step> {
        let next = self.pc.wrapping_add(2);
        Some(Step { next, cycles })
    }

    #[inline(always)]
    pub fn branch(self, offset: u32, cycles: u64) -> Option<Step> {
        self.jump(self.read_pc().wrapping_add(offset) & !1, cycles)
    }

    /// A branch to itself is for the scheduler, which lets time pass at once.
    #[inline(always)]
    pub fn jump(self, next: u32, cycles: u64) -> Option<Step> {
        (next != self.pc).then_some(Step { next, cycles })
    }
}

#[inline(always)]
fn sign_extend(value: u32, bits: u32) -> u32 {
    ((value << (32 - bits)) as i32 >> (32 - bits)) as u32
}
