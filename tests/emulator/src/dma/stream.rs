//! The channels that bring results of the converter into RAM.
//!
//! While nothing else depends on the time of their transfers, these may be made late: they follow from the time alone.

use super::super::adc;
use super::super::register::bit;
use super::channel::{Channel, Field};
use super::{Dma, channel_register};

const DMA_BASE: u32 = 0x5000_0000;

/// The channels as all of them are set.
#[derive(Clone, Copy)]
pub struct ConverterStream {
    /// The channels that read the converter's FIFO, and those that these start, one bit each. None if one of them does
    /// something else than to move results into RAM or to start one of them again.
    pub channels: u32,
    /// They raise no interrupt, and no other channel is paced by the converter.
    pub is_private: bool,
}

impl ConverterStream {
    /// No channel reads the converter's FIFO.
    pub const NONE: Self = Self {
        channels: 0,
        is_private: true,
    };

    const SHARED: Self = Self {
        channels: 0,
        is_private: false,
    };

    pub fn of(dma: &Dma) -> Self {
        let paced = mask(dma, |channel| {
            channel.is_enabled() && channel.request() == adc::DMA_REQUEST
        });
        let (mut found, mut left) = (0, paced);
        while left != 0 {
            let number = left.trailing_zeros();
            let channel = &dma.channels[number as usize];
            let restarts = restarted(channel).is_some_and(|number| bit(paced, number));
            if !fills_ram(channel) && !restarts {
                return Self::SHARED;
            }
            found |= 1 << number;
            left = (left | started(dma, number)) & !found;
        }
        let interrupting = dma.inte & mask(dma, |channel| !channel.is_quiet());
        Self {
            channels: found,
            is_private: found & (interrupting | dma.faults.failing) == 0,
        }
    }
}

fn mask(dma: &Dma, condition: impl Fn(&Channel) -> bool) -> u32 {
    let bits = dma.channels.iter().enumerate();
    bits.map(|(number, channel)| u32::from(condition(channel)) << number)
        .sum()
}

fn fills_ram(channel: &Channel) -> bool {
    channel.request() == adc::DMA_REQUEST && channel.reads_only(adc::FIFO_ADDRESS) && channel.writes_ram()
}

/// The channel whose count this one only writes, from RAM.
fn restarted(channel: &Channel) -> Option<u32> {
    let offset = channel.only_target()?.checked_sub(DMA_BASE)?;
    let (number, register, _) = channel_register(offset)?;
    let restarts = channel.is_unpaced() && channel.reads_ram() && register == Field::TransCount;
    restarts.then_some(number as u32)
}

/// The channel that starts when this one has finished.
fn started(dma: &Dma, number: u32) -> u32 {
    let next = dma.channels[number as usize].chain_to();
    match dma.channels.get(next) {
        Some(channel) if next != number as usize && channel.is_enabled() => 1 << next,
        _ => 0,
    }
}
