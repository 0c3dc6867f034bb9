//! Moves, sums, logic and shifts.

use super::{Core, Instruction, PC, SP, Step};

impl Core<'_> {
    /// Leaves the flags alone.
    #[inline(always)]
    pub fn set(&mut self, i: Instruction, register: usize, value: u32) -> Option<Step> {
        self.r[register] = value;
        i.done(1)
    }

    #[inline(always)]
    pub fn set_stack_pointer(&mut self, i: Instruction, value: u32) -> Option<Step> {
        self.lowest_stack_pointer = self.lowest_stack_pointer.min(value);
        self.set(i, SP, value)
    }

    /// N and Z are the result's.
    #[inline(always)]
    pub fn set_result(&mut self, i: Instruction, register: usize, value: u32) -> Option<Step> {
        self.flags.result = value;
        self.set(i, register, value)
    }

    #[inline(always)]
    pub fn set_sum(&mut self, i: Instruction, register: usize, a: u32, b: u32, carry: bool) -> Option<Step> {
        let sum = self.flags.add(a, b, carry);
        self.set(i, register, sum)
    }

    #[inline(always)]
    pub fn compare(&mut self, i: Instruction, a: u32, b: u32, carry: bool) -> Option<Step> {
        self.flags.add(a, b, carry);
        i.done(1)
    }

    #[inline(always)]
    pub fn logic(&mut self, i: Instruction, of: impl Fn(u32, u32) -> u32) -> Option<Step> {
        self.set_result(i, i.low(0), of(self.r[i.low(0)], self.r[i.low(3)]))
    }

    #[inline(always)]
    pub fn test(&mut self, i: Instruction) -> Option<Step> {
        self.flags.result = self.r[i.low(0)] & self.r[i.low(3)];
        i.done(1)
    }

    #[inline(always)]
    pub fn lsl_immediate(&mut self, i: Instruction) -> Option<Step> {
        let (value, shift) = (self.r[i.low(3)], i.immediate5());
        if shift != 0 {
            self.flags.c = value >> (32 - shift) & 1 != 0;
        }
        self.set_result(i, i.low(0), value << shift)
    }

    /// A shift of 0 stands for 32.
    #[inline(always)]
    pub fn lsr_immediate(&mut self, i: Instruction) -> Option<Step> {
        let (value, shift) = (self.r[i.low(3)], i.immediate5());
        let (result, carry) = match shift {
            0 => (0, value >> 31),
            _ => (value >> shift, value >> (shift - 1) & 1),
        };
        self.flags.c = carry != 0;
        self.set_result(i, i.low(0), result)
    }

    /// A shift of 0 stands for 32.
    #[inline(always)]
    pub fn asr_immediate(&mut self, i: Instruction) -> Option<Step> {
        let (value, shift) = (self.r[i.low(3)] as i32, i.immediate5());
        let (result, carry) = match shift {
            0 => (value >> 31, value >> 31),
            _ => (value >> shift, value >> (shift - 1) & 1),
        };
        self.flags.c = carry != 0;
        self.set_result(i, i.low(0), result as u32)
    }

    #[inline(always)]
    pub fn lsl_register(&mut self, i: Instruction) -> Option<Step> {
        let (value, shift) = self.value_and_shift(i);
        let result = match shift {
            0 => value,
            1..32 => {
                self.flags.c = value >> (32 - shift) & 1 != 0;
                value << shift
            }
            _ => {
                self.flags.c = shift == 32 && value & 1 != 0;
                0
            }
        };
        self.set_result(i, i.low(0), result)
    }

    #[inline(always)]
    pub fn lsr_register(&mut self, i: Instruction) -> Option<Step> {
        let (value, shift) = self.value_and_shift(i);
        let result = match shift {
            0 => value,
            1..32 => {
                self.flags.c = value >> (shift - 1) & 1 != 0;
                value >> shift
            }
            _ => {
                self.flags.c = shift == 32 && value >> 31 != 0;
                0
            }
        };
        self.set_result(i, i.low(0), result)
    }

    #[inline(always)]
    pub fn asr_register(&mut self, i: Instruction) -> Option<Step> {
        let (value, shift) = self.value_and_shift(i);
        let value = value as i32;
        let result = match shift {
            0 => value,
            1..32 => {
                self.flags.c = value >> (shift - 1) & 1 != 0;
                value >> shift
            }
            _ => {
                self.flags.c = value < 0;
                value >> 31
            }
        };
        self.set_result(i, i.low(0), result as u32)
    }

    #[inline(always)]
    pub fn ror(&mut self, i: Instruction) -> Option<Step> {
        let (value, shift) = self.value_and_shift(i);
        let result = value.rotate_right(shift & 31);
        if shift != 0 {
            self.flags.c = result >> 31 != 0;
        }
        self.set_result(i, i.low(0), result)
    }

    #[inline(always)]
    fn value_and_shift(&self, i: Instruction) -> (u32, u32) {
        (self.r[i.low(0)], self.r[i.low(3)] & 0xff)
    }

    #[inline(always)]
    pub fn add_high(&mut self, i: Instruction) -> Option<Step> {
        let sum = self
            .any_register(i, i.high_destination())
            .wrapping_add(self.any_register(i, i.high_source()));
        self.set_high(i, sum)
    }

    #[inline(always)]
    pub fn compare_high(&mut self, i: Instruction) -> Option<Step> {
        let (a, b) = (i.high_destination(), i.high_source());
        self.compare(i, self.any_register(i, a), !self.any_register(i, b), true)
    }

    #[inline(always)]
    pub fn mov_high(&mut self, i: Instruction) -> Option<Step> {
        self.set_high(i, self.any_register(i, i.high_source()))
    }

    #[inline(always)]
    fn any_register(&self, i: Instruction, register: usize) -> u32 {
        match register {
            PC => i.read_pc(),
            _ => self.r[register],
        }
    }

    #[inline(always)]
    fn set_high(&mut self, i: Instruction, value: u32) -> Option<Step> {
        match i.high_destination() {
            PC => i.jump(value & !1, 3),
            SP => self.set_stack_pointer(i, value),
            register => self.set(i, register, value),
        }
    }
}
