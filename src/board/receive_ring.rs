//! A ring in RAM into which DMA brings what a UART receives, without the processor: also while that waits for the flash chip
//! or has its interrupts off, and for as long as the board runs.

use core::sync::atomic::{AtomicU8, AtomicU32, Ordering, compiler_fence};

use embassy_rp::Peri;
use embassy_rp::dma::ChannelInstance;
use embassy_rp::pac;
use embassy_rp::pac::dma::regs::CtrlTrig;
use embassy_rp::pac::dma::vals::{DataSize, TreqSel};
use embassy_rp::pac::uart::Uart;

use crate::drivers::{COUNT_PERIOD, Overtaken, RingReader};

/// Reload value of the first channel's count, which the second channel writes. In RAM, as flash can't be read while it is written.
static TRANSFERS: AtomicU32 = AtomicU32::new(COUNT_PERIOD);

/// The ring, and how far it has been read.
pub struct ReceiveRing {
    bytes: &'static [AtomicU8],
    channel: pac::dma::Channel,
    reader: RingReader,
}

impl ReceiveRing {
    /// Begins to receive from `uart`, whose requests for DMA are `request`, into `bytes`, which is as long as its alignment.
    ///
    /// The first channel moves [`COUNT_PERIOD`] bytes. Then it starts the second one, which starts the first one again: a few
    /// cycles, in which the UART's FIFO holds what comes.
    pub fn start<First: ChannelInstance, Second: ChannelInstance>(
        _channels: (Peri<'static, First>, Peri<'static, Second>),
        uart: Uart,
        request: TreqSel,
        bytes: &'static [AtomicU8],
    ) -> Self {
        let channel = First::regs();
        channel.read_addr().write_value(uart.uartdr().as_ptr() as u32);
        channel.write_addr().write_value(bytes.as_ptr() as u32);
        channel
            .al1_ctrl()
            .write_value(receiving(request, bytes.len(), Second::number()).0);

        let second = Second::regs();
        second.read_addr().write_value(TRANSFERS.as_ptr() as u32);
        second
            .write_addr()
            .write_value(channel.al1_trans_count_trig().as_ptr() as u32);
        second.trans_count().write_value(1);
        second.ctrl_trig().write_value(restarting(Second::number()));

        // Errors do not hold reception: DMAONERR stays 0.
        uart.uartdmacr().modify(|control| control.set_rxdmae(true));
        Self {
            bytes,
            channel,
            reader: RingReader::new(bytes.len() as u32),
        }
    }

    /// Whether nothing was received that was not read yet.
    pub fn is_empty(&self) -> bool {
        !self.reader.has_unread(written(self.channel))
    }

    /// Moves what was received into `buffer`, as much as there is and fits, and returns how many bytes that are.
    ///
    /// # Errors
    /// It was not read in time.
    pub fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Overtaken> {
        let byte = |place: usize| {
            self.bytes
                .get(place)
                .map_or(0, |byte| byte.load(Ordering::Relaxed))
        };
        self.reader.read(|| written(self.channel), byte, buffer)
    }
}

/// Bytes the channel has written, modulo [`COUNT_PERIOD`]: its count changes when a byte is in RAM.
fn written(channel: pac::dma::Channel) -> u32 {
    // Bytes are moved after the first and before the second reading of the count.
    compiler_fence(Ordering::SeqCst);
    let remaining = channel.trans_count().read();
    compiler_fence(Ordering::SeqCst);
    COUNT_PERIOD.wrapping_sub(remaining)
}

/// Control of the channel that receives, into a ring, at `request`.
fn receiving(request: TreqSel, ring_bytes: usize, next: u8) -> CtrlTrig {
    let mut control = CtrlTrig(0);
    control.set_en(true);
    control.set_high_priority(true);
    control.set_data_size(DataSize::SIZE_BYTE);
    control.set_incr_write(true);
    control.set_ring_sel(true);
    control.set_ring_size(ring_bytes.trailing_zeros() as u8);
    control.set_chain_to(next);
    control.set_treq_sel(request);
    control.set_irq_quiet(true);
    control
}

/// Control of the channel `number`, which moves one word at once.
fn restarting(number: u8) -> CtrlTrig {
    let mut control = CtrlTrig(0);
    control.set_en(true);
    control.set_data_size(DataSize::SIZE_WORD);
    // To itself means to none.
    control.set_chain_to(number);
    control.set_treq_sel(TreqSel::PERMANENT);
    control.set_irq_quiet(true);
    control
}
