//! The CAN controller, served in an interrupt.
#![expect(
    unsafe_code,
    reason = "an executor in an interrupt is run by its handler, which has to promise what it is"
)]

use embassy_executor::InterruptExecutor;
use embassy_rp::Peri;
use embassy_rp::gpio::{Input, Pull};
use embassy_rp::interrupt;
use embassy_rp::interrupt::{InterruptExt, Priority};
use embassy_rp::peripherals::{PIN_13, PIN_17};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;

use super::running::name_task;
use super::spi::{CanSpi, SharedSpi};
use crate::log::warn;
use crate::mcp2515::{self, CanExchange};
use crate::sensor::BitTiming;

/// How the controller is called in a crash record.
const TASK: &str = "CAN controller";

/// An interrupt of no peripheral (RP2040 datasheet, 2.3.2).
static EXECUTOR: InterruptExecutor = InterruptExecutor::new();

/// What the controller's loop and the task "CAN" share.
pub type BoardCan = CanExchange<CriticalSectionRawMutex>;

static EXCHANGE: BoardCan = CanExchange::new();

/// Pins of the controller, besides those of the bus.
pub struct CanPins {
    /// Chip select, active low.
    pub select: Peri<'static, PIN_13>,
    /// Interrupt, active low.
    pub interrupt: Peri<'static, PIN_17>,
}

#[embassy_executor::task]
async fn serve(spi: CanSpi, interrupt: Input<'static>, timing: BitTiming) -> ! {
    mcp2515::serve(spi, interrupt, timing, &EXCHANGE).await
}

/// Serves the controller from now on, above all tasks and below all other interrupts: two frames may fill its buffers while a task
/// runs.
pub fn start_can(bus: &'static SharedSpi, pins: CanPins, timing: BitTiming) -> &'static BoardCan {
    let spi = CanSpi::new(bus, pins.select.into());
    // Modules have no pull-up for it: it is no open drain. An open line must not be noise.
    let line = Input::new(pins.interrupt, Pull::Up);
    interrupt::SWI_IRQ_1.set_priority(Priority::P3);
    let spawner = EXECUTOR.start(interrupt::SWI_IRQ_1);
    match serve(spi, line, timing) {
        Ok(token) => {
            name_task(token.id(), TASK);
            spawner.spawn(token);
        }
        Err(error) => warn!("CAN controller could not be started: {}", error),
    }
    &EXCHANGE
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
