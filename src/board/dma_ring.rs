//! A ring in RAM into which DMA brings what a peripheral has, without the processor: also while that waits for the flash chip
//! or has its interrupts off, and for as long as the board runs.

use core::sync::atomic::{AtomicU8, AtomicU16, AtomicU32, Ordering, compiler_fence};

use embassy_rp::Peri;
use embassy_rp::dma::ChannelInstance;
use embassy_rp::pac;
use embassy_rp::pac::dma::Channel;
use embassy_rp::pac::dma::regs::{ChanAbort, CtrlTrig};
use embassy_rp::pac::dma::vals::{DataSize, TreqSel};
use embassy_rp::pac::uart::Uart;

use crate::drivers::{COUNT_PERIOD, Overtaken, RingReader};

/// Reload value of the first channel's count, which the second channel writes. In RAM, as flash can't be read while it is written.
static TRANSFERS: AtomicU32 = AtomicU32::new(COUNT_PERIOD);

/// An abort waits for transfers that have begun, which take some cycles each.
const MAX_POLLS: u32 = 1_000;

/// One transfer.
pub trait RingWord {
    /// Its size.
    const SIZE: DataSize;
}

impl RingWord for AtomicU8 {
    const SIZE: DataSize = DataSize::SIZE_BYTE;
}

impl RingWord for AtomicU16 {
    const SIZE: DataSize = DataSize::SIZE_HALFWORD;
}

/// A DMA channel with its number.
struct NumberedChannel {
    registers: Channel,
    number: u8,
}

impl NumberedChannel {
    fn of<C: ChannelInstance>(_: Peri<'static, C>) -> Self {
        Self {
            registers: C::regs(),
            number: C::number(),
        }
    }
}

/// The ring with its two channels: the first one moves [`COUNT_PERIOD`] words. Then it starts the second one, which starts the
/// first one again: a few cycles, in which the peripheral's FIFO holds what comes.
pub struct DmaRing<W: 'static> {
    words: &'static [W],
    source: *mut u32,
    request: TreqSel,
    first: NumberedChannel,
    second: NumberedChannel,
}

impl<W: RingWord> DmaRing<W> {
    /// For what comes from the register `source`, whose requests for DMA are `request`, into `words`, which are as long as their
    /// alignment.
    pub fn new<First: ChannelInstance, Second: ChannelInstance>(
        (first, second): (Peri<'static, First>, Peri<'static, Second>),
        source: *mut u32,
        request: TreqSel,
        words: &'static [W],
    ) -> Self {
        Self {
            words,
            source,
            request,
            first: NumberedChannel::of(first),
            second: NumberedChannel::of(second),
        }
    }

    /// Begins at the first place.
    pub fn start(&self) {
        let first = self.first.registers;
        first.read_addr().write_value(self.source as u32);
        first.write_addr().write_value(self.words.as_ptr() as u32);
        first.al1_ctrl().write_value(self.receiving().0);

        let second = self.second.registers;
        second.read_addr().write_value(TRANSFERS.as_ptr() as u32);
        second
            .write_addr()
            .write_value(first.al1_trans_count_trig().as_ptr() as u32);
        second.trans_count().write_value(1);
        second.ctrl_trig().write_value(restarting(self.second.number));
    }

    /// Ends it, whatever state it is in. The peripheral makes no requests any more.
    pub fn stop(&self) {
        let mut channels = ChanAbort(0);
        channels.set_chan_abort(1 << self.first.number | 1 << self.second.number);
        pac::DMA.chan_abort().write_value(channels);
        let _ =
            (0..MAX_POLLS).find(|_| pac::DMA.chan_abort().read().chan_abort() & channels.chan_abort() == 0);
    }

    /// Whether a bus error has ended it.
    pub fn is_halted(&self) -> bool {
        !self.first.registers.ctrl_trig().read().busy() && !self.second.registers.ctrl_trig().read().busy()
    }

    /// Words that have come, modulo [`COUNT_PERIOD`]: the channel's count changes when a word is in RAM.
    pub fn written(&self) -> u32 {
        // Words are moved after the first and before the second reading of the count.
        compiler_fence(Ordering::SeqCst);
        let remaining = self.first.registers.trans_count().read();
        compiler_fence(Ordering::SeqCst);
        COUNT_PERIOD.wrapping_sub(remaining)
    }

    /// Control of the channel that receives.
    fn receiving(&self) -> CtrlTrig {
        let mut control = CtrlTrig(0);
        control.set_en(true);
        control.set_high_priority(true);
        control.set_data_size(W::SIZE);
        control.set_incr_write(true);
        control.set_ring_sel(true);
        control.set_ring_size(size_of_val(self.words).trailing_zeros() as u8);
        control.set_chain_to(self.second.number);
        control.set_treq_sel(self.request);
        control.set_irq_quiet(true);
        // Writing a one clears an error.
        control.set_read_error(true);
        control.set_write_error(true);
        control
    }
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

/// Bytes that a UART receives, with the reading position.
pub struct ReceiveRing {
    ring: DmaRing<AtomicU8>,
    reader: RingReader,
}

impl ReceiveRing {
    /// Begins to receive from `uart`, whose requests for DMA are `request`, into `bytes`, which is as long as its alignment.
    pub fn start<First: ChannelInstance, Second: ChannelInstance>(
        channels: (Peri<'static, First>, Peri<'static, Second>),
        uart: Uart,
        request: TreqSel,
        bytes: &'static [AtomicU8],
    ) -> Self {
        let ring = DmaRing::new(channels, uart.uartdr().as_ptr().cast(), request, bytes);
        ring.start();
        // Errors do not hold reception: DMAONERR stays 0.
        uart.uartdmacr().modify(|control| control.set_rxdmae(true));
        Self {
            ring,
            reader: RingReader::new(bytes.len() as u32),
        }
    }

    /// Whether nothing was received that was not read yet.
    pub fn is_empty(&self) -> bool {
        !self.reader.has_unread(self.ring.written())
    }

    /// Moves what was received into `buffer`, as much as there is and fits, and returns how many bytes that are.
    ///
    /// # Errors
    /// It was not read in time.
    pub fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Overtaken> {
        let byte = |place: usize| {
            self.ring
                .words
                .get(place)
                .map_or(0, |byte| byte.load(Ordering::Relaxed))
        };
        self.reader.read(|| self.ring.written(), byte, buffer)
    }
}
