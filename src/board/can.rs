//! The CAN controller, served in an interrupt.
#![expect(
    unsafe_code,
    reason = "an executor in an interrupt is run by its handler, which has to promise what it is"
)]

use core::future::poll_fn;
use core::pin::{Pin, pin};
use core::task::{Context, Poll};

use embassy_executor::{InterruptExecutor, SendSpawner};
use embassy_rp::Peri;
use embassy_rp::gpio::{Input, Pull};
use embassy_rp::interrupt;
use embassy_rp::interrupt::{InterruptExt, Priority};
use embassy_rp::peripherals::{PIN_13, PIN_17};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

use super::spi::{CanSpi, SharedSpi};
use crate::drivers::mcp2515::{self, CanExchange};
use crate::sensor::BitTiming;

/// An interrupt of no peripheral (RP2040 datasheet, 2.3.2).
static EXECUTOR: InterruptExecutor = InterruptExecutor::new();

/// Exchange between the controller's loop and the task that uses the bus.
pub type BoardCan = CanExchange<CriticalSectionRawMutex>;

static EXCHANGE: BoardCan = CanExchange::new();

/// Pins of the controller, besides those of the bus.
pub struct CanPins {
    /// Chip select, active low.
    pub select: Peri<'static, PIN_13>,
    /// Interrupt, active low.
    pub interrupt: Peri<'static, PIN_17>,
}

/// The controller, for a task in an interrupt: two frames may fill its buffers while another task runs.
pub struct CanController {
    spi: CanSpi,
    interrupt: Input<'static>,
    timing: BitTiming,
}

impl CanController {
    /// The controller, from now on not selected.
    pub fn new(bus: &'static SharedSpi, pins: CanPins, timing: BitTiming) -> Self {
        Self {
            spi: CanSpi::new(bus, pins.select.into()),
            // An open line must not be noise.
            interrupt: Input::new(pins.interrupt, Pull::Up),
            timing,
        }
    }

    /// Serves the controller.
    pub async fn serve(self) -> ! {
        let mut serve = pin!(mcp2515::serve(self.spi, self.interrupt, self.timing, &EXCHANGE));
        poll_fn(|context| poll_quickly(serve.as_mut(), context)).await
    }
}

/// Polls from RAM, where memory.x places it: while flash is read line by line, frames would be lost on a full bus.
#[inline(never)]
fn poll_quickly<F: Future>(future: Pin<&mut F>, context: &mut Context<'_>) -> Poll<F::Output> {
    future.poll(context)
}

/// The exchange, for tasks.
pub fn can_exchange() -> &'static BoardCan {
    &EXCHANGE
}

/// Starts tasks above all others and below the interrupts of the timer, UARTs and USB; to be called once. embassy-rp gives those
/// of DMA and of pins the same, lowest priority: they wait until these tasks have had their turn, and the other way round.
pub fn interrupt_spawner() -> SendSpawner {
    interrupt::SWI_IRQ_1.set_priority(Priority::P3);
    EXECUTOR.start(interrupt::SWI_IRQ_1)
}

#[interrupt]
unsafe fn SWI_IRQ_1() {
    // SAFETY: this is the handler, and the interrupt comes only after `start`, which allows it.
    unsafe { EXECUTOR.on_interrupt() }
}

/// Whether an executor is the one in the interrupt.
pub(super) fn is_executor(id: u32) -> bool {
    let start = &raw const EXECUTOR as u32;
    id.wrapping_sub(start) < size_of::<InterruptExecutor>() as u32
}
