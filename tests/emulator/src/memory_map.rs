//! The peripheral address map (datasheet 2.2.2): which block lies at an address, which model
//! answers for it, and which bit of RESETS holds it in reset (2.14.3).

use super::soc::Id;

/// Who answers for a block.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Model {
    /// A model of this folder.
    Own(Id),
    /// The memory that USB device controller and processor share.
    UsbMemory,
    /// The crate `rp2040-emu`.
    Crate,
    /// Registers that read back what was written; nothing that is emulated depends on them.
    Storage,
    /// No model: registers read back what was written, and the access is recorded.
    None,
}

#[derive(Debug)]
pub struct Block {
    pub name: &'static str,
    pub base: u32,
    pub model: Model,
    pub reset_bit: Option<u32>,
}

const fn block(name: &'static str, base: u32, model: Model, reset_bit: Option<u32>) -> Block {
    Block {
        name,
        base,
        model,
        reset_bit,
    }
}

pub const RESETS_BASE: u32 = 0x4000_c000;
pub const IO_BANK0_BASE: u32 = 0x4001_4000;
/// Its bit in RESETS.
pub const IO_BANK0_RESET: u32 = 5;
pub const PADS_BANK0_BASE: u32 = 0x4001_c000;

pub static BLOCKS: [Block; 37] = [
    block("SYSINFO", 0x4000_0000, Model::Crate, Some(19)),
    block("SYSCFG", 0x4000_4000, Model::None, Some(18)),
    block("CLOCKS", 0x4000_8000, Model::Crate, None),
    block("RESETS", RESETS_BASE, Model::Crate, None),
    block("PSM", 0x4001_0000, Model::Own(Id::PowerState), None),
    block("IO_BANK0", IO_BANK0_BASE, Model::Crate, Some(IO_BANK0_RESET)),
    block("IO_QSPI", 0x4001_8000, Model::Storage, Some(6)),
    block("PADS_BANK0", PADS_BANK0_BASE, Model::Crate, Some(8)),
    block("PADS_QSPI", 0x4002_0000, Model::Storage, Some(9)),
    block("XOSC", 0x4002_4000, Model::Crate, None),
    block("PLL_SYS", 0x4002_8000, Model::Crate, Some(12)),
    block("PLL_USB", 0x4002_c000, Model::Crate, Some(13)),
    block("BUSCTRL", 0x4003_0000, Model::None, Some(1)),
    block("UART0", 0x4003_4000, Model::Own(Id::Uart0), Some(22)),
    block("UART1", 0x4003_8000, Model::Own(Id::Uart1), Some(23)),
    block("SPI0", 0x4003_c000, Model::None, Some(16)),
    block("SPI1", 0x4004_0000, Model::Own(Id::Spi1), Some(17)),
    block("I2C0", 0x4004_4000, Model::Own(Id::I2c0), Some(3)),
    block("I2C1", 0x4004_8000, Model::Own(Id::I2c1), Some(4)),
    block("ADC", 0x4004_c000, Model::Own(Id::Adc), Some(0)),
    block("PWM", 0x4005_0000, Model::Own(Id::Pwm), Some(14)),
    block("TIMER", 0x4005_4000, Model::Own(Id::Timer), Some(21)),
    block("WATCHDOG", 0x4005_8000, Model::Own(Id::Watchdog), None),
    block("RTC", 0x4005_c000, Model::None, Some(15)),
    block("ROSC", 0x4006_0000, Model::Crate, None),
    block(
        "VREG_AND_CHIP_RESET",
        0x4006_4000,
        Model::Own(Id::ChipReset),
        None,
    ),
    block("TBMAN", 0x4006_c000, Model::None, Some(20)),
    block("DMA", 0x5000_0000, Model::Own(Id::Dma), Some(2)),
    block("USBCTRL_DPRAM", 0x5010_0000, Model::UsbMemory, Some(24)),
    block("USBCTRL", 0x5011_0000, Model::Own(Id::Usb), Some(24)),
    block("PIO0", 0x5020_0000, Model::Own(Id::Pio0), Some(10)),
    block("PIO1", 0x5030_0000, Model::Own(Id::Pio1), Some(11)),
    block("XIP_AUX", 0x5040_0000, Model::None, None),
    block("XIP_CTRL", 0x1400_0000, Model::Own(Id::XipControl), None),
    block("XIP_SRAM", 0x1500_0000, Model::None, None),
    block("XIP_SSI", 0x1800_0000, Model::Own(Id::Ssi), None),
    block("PPB", 0xe000_0000, Model::Crate, None),
];

/// A peripheral takes 16 KB: its registers, and their XOR, SET and CLEAR aliases.
const BLOCK_MASK: u32 = !0x3fff;
/// APB blocks follow each other from SYSINFO to ROSC without a gap.
const APB_BASE: u32 = 0x4000_0000;
const APB_GAPLESS_END: u32 = 0x4006_8000;

/// The block at an address; `None` where "unmapped address ranges raise a bus error" (2.2).
pub fn block_at(address: u32) -> Option<&'static Block> {
    if (APB_BASE..APB_GAPLESS_END).contains(&address) {
        return BLOCKS.get(((address - APB_BASE) / 0x4000) as usize);
    }
    let base = address & BLOCK_MASK;
    BLOCKS.iter().find(|block| block.base == base)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_block_is_found_at_its_base_and_its_aliases() {
        for block in &BLOCKS {
            for address in [block.base, block.base + 0x3ffc] {
                assert_eq!(block_at(address).map(|found| found.name), Some(block.name));
            }
        }
    }

    #[test]
    fn what_the_datasheet_leaves_out_is_unmapped() {
        for address in [
            0x4006_8000,
            0x4007_0000,
            0x5000_4000,
            0x5010_4000,
            0x6000_0000,
            0x1600_0000,
        ] {
            assert!(block_at(address).is_none(), "{address:#x}");
        }
    }

    #[test]
    fn no_two_blocks_share_a_reset_bit_except_the_two_halves_of_usb() {
        let bits: Vec<u32> = BLOCKS.iter().filter_map(|block| block.reset_bit).collect();
        let mut distinct = bits.clone();
        distinct.sort_unstable();
        distinct.dedup();
        assert_eq!(bits.len(), distinct.len() + 1);
        assert_eq!(distinct.len(), 24, "25 bits, of which JTAG (7) has no registers");
    }
}
