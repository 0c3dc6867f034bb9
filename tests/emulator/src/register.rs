//! A write to a peripheral register, with the bus's atomic aliases (datasheet 2.1.2).

/// Which of the four aliases of a peripheral was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Alias {
    /// `+0x0000`: plain write.
    Plain,
    /// `+0x1000`: flips the bits that are 1.
    Xor,
    /// `+0x2000`: sets the bits that are 1.
    Set,
    /// `+0x3000`: clears the bits that are 1.
    Clear,
}

/// One register write as a peripheral sees it.
#[derive(Clone, Copy, Debug)]
pub struct RegisterWrite {
    /// The value on the bus. Write-one-to-clear bits and FIFOs use it as it is.
    pub value: u32,
    pub alias: Alias,
}

impl RegisterWrite {
    pub fn plain(value: u32) -> Self {
        Self {
            value,
            alias: Alias::Plain,
        }
    }

    /// The alias is in bits 13:12 of the address.
    pub fn to_address(address: u32, value: u32) -> Self {
        let alias = match (address >> 12) & 3 {
            0 => Alias::Plain,
            1 => Alias::Xor,
            2 => Alias::Set,
            _ => Alias::Clear,
        };
        Self { value, alias }
    }

    /// What an ordinary read/write register holds afterwards.
    pub fn applied_to(self, old: u32) -> u32 {
        match self.alias {
            Alias::Plain => self.value,
            Alias::Xor => old ^ self.value,
            Alias::Set => old | self.value,
            Alias::Clear => old & !self.value,
        }
    }

    /// Like [`Self::applied_to`] for a register of which only the bits of `mask` exist.
    pub fn update(self, register: &mut u32, mask: u32) {
        *register = self.applied_to(*register) & mask;
    }
}

/// A field of a register value: `width` bits from bit `lowest`.
pub fn field(value: u32, lowest: u32, width: u32) -> u32 {
    (value >> lowest) & ((1 << width) - 1)
}

/// Bit `number` of a register value.
pub fn bit(value: u32, number: u32) -> bool {
    value >> number & 1 != 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn aliases_flip_set_and_clear() {
        let written = |address| RegisterWrite::to_address(address, 0b0110).applied_to(0b1010);
        assert_eq!(written(0x4003_4030), 0b0110);
        assert_eq!(written(0x4003_5030), 0b1100);
        assert_eq!(written(0x4003_6030), 0b1110);
        assert_eq!(written(0x4003_7030), 0b1000);
    }
}
