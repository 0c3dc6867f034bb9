//! The condition flags, of which N and Z are computed when they are asked for.

const N: u32 = 1 << 31;
const Z: u32 = 1 << 30;
const C: u32 = 1 << 29;
const V: u32 = 1 << 28;

pub struct Flags {
    /// N and Z are those of this value.
    pub result: u32,
    pub c: bool,
    /// In bit 31; the other bits mean nothing.
    v: u32,
}

impl Flags {
    /// `None` for N and Z at once, which no result has.
    pub fn of(xpsr: u32) -> Option<Self> {
        let result = match (xpsr & N != 0, xpsr & Z != 0) {
            (true, true) => return None,
            (true, false) => N,
            (false, true) => 0,
            (false, false) => 1,
        };
        Some(Self {
            result,
            c: xpsr & C != 0,
            v: (xpsr & V) << 3,
        })
    }

    pub fn put_into(&self, xpsr: u32) -> u32 {
        let n = self.result & N;
        let z = if self.result == 0 { Z } else { 0 };
        let c = if self.c { C } else { 0 };
        xpsr & !(N | Z | C | V) | n | z | c | (self.v >> 3 & V)
    }

    /// The sum, of which all flags are from now on.
    #[inline(always)]
    pub fn add(&mut self, a: u32, b: u32, carry: bool) -> u32 {
        let wide = u64::from(a) + u64::from(b) + u64::from(carry);
        self.result = wide as u32;
        self.c = wide >> 32 != 0;
        self.v = (a ^ self.result) & (b ^ self.result);
        self.result
    }

    /// Whether a condition holds (ARMv6-M A6.3).
    #[inline(always)]
    pub fn pass(&self, condition: u16) -> bool {
        let n = self.result & N != 0;
        let z = self.result == 0;
        let v = self.v & N != 0;
        let holds = match condition >> 1 {
            0 => z,
            1 => self.c,
            2 => n,
            3 => v,
            4 => self.c && !z,
            5 => n == v,
            _ => !z && n == v,
        };
        holds == (condition & 1 == 0)
    }
}
