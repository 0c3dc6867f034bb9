//! SIO: the pins by hand, the divider, the spinlocks (datasheet 2.3.1), as core 0 sees them.
//!
//! A division takes no time. The interpolators and the FIFOs between the cores are not modelled.

/// GPIO_OUT and GPIO_OE: the register itself, then SET, CLR and XOR.
const GPIO_OUT: u32 = 0x010;
const GPIO_OUT_XOR: u32 = 0x01c;
const GPIO_OE: u32 = 0x020;
const GPIO_OE_XOR: u32 = 0x02c;
const GPIO_IN: u32 = 0x004;
const FIFO_ST: u32 = 0x050;
const SPINLOCK_ST: u32 = 0x05c;
const DIV_UDIVIDEND: u32 = 0x060;
const DIV_UDIVISOR: u32 = 0x064;
const DIV_SDIVIDEND: u32 = 0x068;
const DIV_SDIVISOR: u32 = 0x06c;
const DIV_QUOTIENT: u32 = 0x070;
const DIV_REMAINDER: u32 = 0x074;
const DIV_CSR: u32 = 0x078;
const SPINLOCK0: u32 = 0x100;
const SPINLOCK31: u32 = 0x17c;

/// FIFO_ST.RDY: there is room, as core 1 was never sent anything.
const FIFO_READY: u32 = 1 << 1;
const DIV_READY: u32 = 1;
const DIV_DIRTY: u32 = 1 << 1;

const PINS: u32 = (1 << 30) - 1;

#[derive(Clone, Default)]
pub struct Sio {
    /// The levels at the pins.
    pub gpio_in: u32,
    /// The levels that are put out, and at which pins.
    pub gpio_out: u32,
    pub gpio_oe: u32,
    claimed_spinlocks: u32,
    divider: Divider,
}

impl Sio {
    pub fn read(&mut self, offset: u32) -> u32 {
        match offset {
            GPIO_IN => self.gpio_in,
            GPIO_OUT..=GPIO_OUT_XOR => self.gpio_out,
            GPIO_OE..=GPIO_OE_XOR => self.gpio_oe,
            FIFO_ST => FIFO_READY,
            SPINLOCK_ST => self.claimed_spinlocks,
            DIV_UDIVIDEND..=DIV_CSR => self.divider.read(offset),
            SPINLOCK0..=SPINLOCK31 => self.claim_spinlock(offset),
            _ => 0,
        }
    }

    pub fn write(&mut self, offset: u32, value: u32) {
        match offset {
            GPIO_OUT..=GPIO_OUT_XOR => self.gpio_out = changed(self.gpio_out, offset, value),
            GPIO_OE..=GPIO_OE_XOR => self.gpio_oe = changed(self.gpio_oe, offset, value),
            DIV_UDIVIDEND..=DIV_CSR => self.divider.write(offset, value),
            SPINLOCK0..=SPINLOCK31 => self.claimed_spinlocks &= !spinlock(offset),
            _ => {}
        }
    }

    /// "Read: attempt to claim a lock. The return value is 0 on failure, or 1 << lock number."
    fn claim_spinlock(&mut self, offset: u32) -> u32 {
        let claimed = spinlock(offset) & !self.claimed_spinlocks;
        self.claimed_spinlocks |= claimed;
        claimed
    }
}

fn spinlock(offset: u32) -> u32 {
    1 << ((offset - SPINLOCK0) / 4)
}

/// What a write to GPIO_OUT or GPIO_OE, or to one of their aliases, makes of it.
fn changed(register: u32, offset: u32, value: u32) -> u32 {
    let value = value & PINS;
    match offset & 0xc {
        0x0 => value,
        0x4 => register | value,
        0x8 => register & !value,
        _ => register ^ value,
    }
}

/// The divider: "any operand write starts a new calculation", signed or unsigned by the register that is written.
#[derive(Clone, Default)]
struct Divider {
    dividend: u32,
    divisor: u32,
    quotient: u32,
    remainder: u32,
    is_dirty: bool,
}

impl Divider {
    fn read(&mut self, offset: u32) -> u32 {
        match offset {
            DIV_UDIVIDEND | DIV_SDIVIDEND => self.dividend,
            DIV_UDIVISOR | DIV_SDIVISOR => self.divisor,
            DIV_QUOTIENT => {
                self.is_dirty = false;
                self.quotient
            }
            DIV_REMAINDER => self.remainder,
            DIV_CSR if self.is_dirty => DIV_READY | DIV_DIRTY,
            _ => DIV_READY,
        }
    }

    fn write(&mut self, offset: u32, value: u32) {
        match offset {
            DIV_UDIVIDEND | DIV_SDIVIDEND => self.dividend = value,
            DIV_UDIVISOR | DIV_SDIVISOR => self.divisor = value,
            DIV_QUOTIENT => self.quotient = value,
            DIV_REMAINDER => self.remainder = value,
            _ => return,
        }
        self.is_dirty = true;
        match offset {
            DIV_UDIVIDEND | DIV_UDIVISOR => self.divide_unsigned(),
            DIV_SDIVIDEND | DIV_SDIVISOR => self.divide_signed(),
            _ => {}
        }
    }

    /// By zero the quotient is all ones, and the remainder the dividend (2.3.1.5).
    fn divide_unsigned(&mut self) {
        self.quotient = self.dividend.checked_div(self.divisor).unwrap_or(u32::MAX);
        self.remainder = self.dividend.checked_rem(self.divisor).unwrap_or(self.dividend);
    }

    /// By zero the quotient is one of the sign that the dividend has not.
    fn divide_signed(&mut self) {
        let (dividend, divisor) = (self.dividend as i32, self.divisor as i32);
        (self.quotient, self.remainder) = match (divisor, dividend) {
            (0, ..0) => (1, self.dividend),
            (0, _) => (u32::MAX, self.dividend),
            _ => (
                dividend.wrapping_div(divisor) as u32,
                dividend.wrapping_rem(divisor) as u32,
            ),
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pins_are_set_cleared_and_toggled() {
        let mut sio = Sio::default();
        sio.write(GPIO_OUT, 0b0110);
        sio.write(GPIO_OUT + 4, 0b1000);
        sio.write(GPIO_OUT + 8, 0b0010);
        sio.write(GPIO_OUT_XOR, 0b0101);
        assert_eq!(sio.read(GPIO_OUT), 0b1001);
        sio.write(GPIO_OE, u32::MAX);
        assert_eq!((sio.read(GPIO_OE), sio.gpio_out), (0x3fff_ffff, 0b1001));
    }

    #[test]
    fn a_spinlock_is_claimed_once_until_it_is_released() {
        let mut sio = Sio::default();
        assert_eq!(sio.read(SPINLOCK31), 1 << 31);
        assert_eq!((sio.read(SPINLOCK31), sio.read(SPINLOCK_ST)), (0, 1 << 31));
        sio.write(SPINLOCK31, 0);
        assert_eq!(sio.read(SPINLOCK31), 1 << 31);
    }

    fn divided(registers: [u32; 2], dividend: i32, divisor: i32) -> (i32, i32) {
        let mut sio = Sio::default();
        sio.write(registers[0], dividend as u32);
        sio.write(registers[1], divisor as u32);
        assert_eq!(sio.read(DIV_CSR), DIV_READY | DIV_DIRTY);
        let results = (sio.read(DIV_QUOTIENT) as i32, sio.read(DIV_REMAINDER) as i32);
        assert_eq!(sio.read(DIV_CSR), DIV_READY);
        results
    }

    #[test]
    fn divisions_are_signed_or_not_and_by_zero_as_the_datasheet_has_them() {
        let (unsigned, signed) = ([DIV_UDIVIDEND, DIV_UDIVISOR], [DIV_SDIVIDEND, DIV_SDIVISOR]);
        assert_eq!(divided(unsigned, 23, 7), (3, 2));
        assert_eq!(divided(unsigned, -1, 0x10), (0x0fff_ffff, 0xf));
        assert_eq!(divided(unsigned, 5, 0), (-1, 5));
        assert_eq!(divided(signed, -23, 7), (-3, -2));
        assert_eq!(divided(signed, -5, 0), (1, -5));
        assert_eq!(divided(signed, 5, 0), (-1, 5));
        assert_eq!(divided(signed, i32::MIN, -1), (i32::MIN, 0));
    }

    #[test]
    fn results_that_were_saved_are_put_back() {
        let mut sio = Sio::default();
        for (offset, value) in [
            (DIV_UDIVIDEND, 9),
            (DIV_UDIVISOR, 2),
            (DIV_REMAINDER, 5),
            (DIV_QUOTIENT, 6),
        ] {
            sio.write(offset, value);
        }
        assert_eq!((sio.read(DIV_REMAINDER), sio.read(DIV_QUOTIENT)), (5, 6));
    }
}
