//! The MPU of the Cortex-M0+: eight regions (datasheet 2.4.6, ARMv6-M B3.5).
//!
//! Reads and writes of privileged code are checked, which all of it is here; fetches of instructions are not. Memory types
//! do nothing.

use std::ops::Range;

use super::access_log::Direction;
use super::register::{bit, field};

pub const TYPE: u32 = 0xe000_ed90;
pub const RASR: u32 = 0xe000_eda0;
const CTRL: u32 = 0xe000_ed94;
const RNR: u32 = 0xe000_ed98;
const RBAR: u32 = 0xe000_ed9c;

const REGIONS: usize = 8;
/// Of data regions, at bit 8.
const TYPE_VALUE: u32 = (REGIONS as u32) << 8;

const ENABLE: u32 = 0;
/// With negative priority, as in HardFault, it is enabled, too.
const IN_HARD_FAULT: u32 = 1;
/// Without a region the default map holds.
const DEFAULT_MAP: u32 = 2;
const RBAR_VALID: u32 = 4;
const RASR_MASK: u32 = 0x1707_ff3f;

const HARD_FAULT: u32 = 3;

#[derive(Clone, Copy, Default)]
struct Region {
    base: u32,
    attributes: u32,
}

impl Region {
    /// Regions are from 256 bytes on, aligned to their size, in eighths that can be left out.
    fn covers(self, address: u32) -> bool {
        let size_log2 = field(self.attributes, 1, 5) + 1;
        let is_inside = bit(self.attributes, 0)
            && size_log2 >= 8
            && u64::from(address) >> size_log2 == u64::from(self.base) >> size_log2;
        let eighth = (u64::from(address) >> (size_log2.max(3) - 3) & 7) as u32;
        is_inside && !bit(self.attributes, 8 + eighth)
    }

    /// What lies in it, eighths that are left out included; `None` while it is off.
    fn extent(self) -> Option<Range<u64>> {
        let size_log2 = field(self.attributes, 1, 5) + 1;
        let start = u64::from(self.base) >> size_log2 << size_log2;
        bit(self.attributes, 0).then_some(start..start + (1 << size_log2))
    }

    /// AP for privileged code (B3.5.9).
    fn permits(self, direction: Direction) -> bool {
        match field(self.attributes, 24, 3) {
            0 => false,
            1..=3 => true,
            _ => direction == Direction::Read,
        }
    }
}

#[derive(Clone, Default)]
pub struct Mpu {
    ctrl: u32,
    number: u32,
    regions: [Region; REGIONS],
    /// From the lowest to the highest region: most accesses lie outside, and need no look at each.
    all_regions: Range<u64>,
}

impl Mpu {
    pub fn read(&self, register: u32) -> u32 {
        let region = self.regions[self.number as usize];
        match register {
            TYPE => TYPE_VALUE,
            CTRL => self.ctrl,
            RNR => self.number,
            RBAR => region.base | self.number,
            _ => region.attributes,
        }
    }

    pub fn write(&mut self, register: u32, value: u32) {
        match register {
            CTRL => self.ctrl = value & 0b111,
            RNR => self.number = value % REGIONS as u32,
            RBAR => {
                if bit(value, RBAR_VALID) {
                    self.number = value % REGIONS as u32;
                }
                self.regions[self.number as usize].base = value & 0xffff_ff00;
            }
            RASR => self.regions[self.number as usize].attributes = value & RASR_MASK,
            _ => {}
        }
        self.all_regions = self.extent_of_all();
    }

    fn extent_of_all(&self) -> Range<u64> {
        let extents = self.regions.iter().filter_map(|region| region.extent());
        extents
            .reduce(|all, one| all.start.min(one.start)..all.end.max(one.end))
            .unwrap_or_default()
    }

    /// Whether an access is permitted while an exception is handled, 0 for none. The highest region that covers it counts.
    #[inline]
    pub fn permits(&self, address: u32, direction: Direction, exception: u32) -> bool {
        let is_enabled = bit(self.ctrl, ENABLE);
        if !is_enabled || exception == HARD_FAULT && !bit(self.ctrl, IN_HARD_FAULT) {
            return true;
        }
        if !self.all_regions.contains(&u64::from(address)) {
            return bit(self.ctrl, DEFAULT_MAP);
        }
        self.regions_permit(address, direction)
    }

    /// Whether no access to these addresses is refused, whatever is being handled.
    pub fn leaves_open(&self, addresses: Range<u64>) -> bool {
        !bit(self.ctrl, ENABLE)
            || bit(self.ctrl, DEFAULT_MAP)
                && (self.all_regions.end <= addresses.start || addresses.end <= self.all_regions.start)
    }

    fn regions_permit(&self, address: u32, direction: Direction) -> bool {
        let mut regions = self.regions.iter().rev();
        match regions.find(|region| region.covers(address)) {
            Some(region) => region.permits(direction),
            None => bit(self.ctrl, DEFAULT_MAP),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ON: u32 = 1 << ENABLE | 1 << DEFAULT_MAP;
    const READ_ONLY: u32 = 5 << 24;
    const FULL_ACCESS: u32 = 3 << 24;

    fn size_log2(bits: u32) -> u32 {
        (bits - 1) << 1 | 1
    }

    fn with_region(number: u32, base: u32, attributes: u32) -> Mpu {
        let mut mpu = Mpu::default();
        mpu.write(RBAR, base | 1 << RBAR_VALID | number);
        mpu.write(RASR, attributes);
        mpu.write(CTRL, ON);
        mpu
    }

    fn write_is_permitted(mpu: &Mpu, address: u32) -> bool {
        mpu.permits(address, Direction::Write, 0)
    }

    #[test]
    fn there_are_eight_regions_and_none_after_reset() {
        let mpu = Mpu::default();
        assert_eq!(mpu.read(TYPE), 0x0000_0800, "2.4.8");
        assert_eq!(mpu.read(CTRL), 0);
        assert!(write_is_permitted(&mpu, 0x2000_0000));
    }

    #[test]
    fn what_a_region_covers_follows_from_its_size_its_eighths_and_the_default_map() {
        let some_eighths = size_log2(8) | 0xfe << 8;
        let alone = size_log2(12) | FULL_ACCESS;
        for (base, attributes, control, address, is_permitted) in [
            (0x1fff_0000, size_log2(16), ON, 0x1ffe_ffff, true),
            (0x1fff_0000, size_log2(16), ON, 0x1fff_0000, false),
            (0x1fff_0000, size_log2(16), ON, 0x1fff_ffff, false),
            (0x1fff_0000, size_log2(16), ON, 0x2000_0000, true),
            (0x2000_0000, some_eighths, ON, 0x2000_001c, false),
            (0x2000_0000, some_eighths, ON, 0x2000_0020, true),
            (0x2000_0000, alone, 1 << ENABLE, 0x2000_0000, true),
            (0x2000_0000, alone, 1 << ENABLE, 0x2000_1000, false),
        ] {
            let mut mpu = with_region(0, base, attributes);
            mpu.write(CTRL, control);
            assert_eq!(write_is_permitted(&mpu, address), is_permitted, "{address:#x}");
        }
    }

    #[test]
    fn reads_can_be_permitted_alone_and_the_highest_region_counts() {
        let mut mpu = with_region(1, 0x2000_0000, size_log2(12) | READ_ONLY);
        assert!(mpu.permits(0x2000_0100, Direction::Read, 0));
        assert!(!write_is_permitted(&mpu, 0x2000_0100));
        mpu.write(RNR, 2);
        mpu.write(RBAR, 0x2000_0000);
        mpu.write(RASR, size_log2(8) | FULL_ACCESS);
        assert!(write_is_permitted(&mpu, 0x2000_0000));
        assert!(!write_is_permitted(&mpu, 0x2000_0100));
        assert_eq!(mpu.read(RBAR), 0x2000_0002);
    }

    #[test]
    fn a_hard_fault_handler_is_not_checked_unless_asked_for() {
        let mut mpu = with_region(0, 0x1fff_0000, size_log2(16));
        let permitted = |mpu: &Mpu| mpu.permits(0x1fff_0000, Direction::Write, HARD_FAULT);
        assert!(permitted(&mpu));
        mpu.write(CTRL, ON | 1 << IN_HARD_FAULT);
        assert!(!permitted(&mpu));
    }
}
