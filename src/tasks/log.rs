//! Keeps the log in flash.

use core::ops::Range;

use embassy_time::{Duration, Timer};
use embedded_storage_async::nor_flash::NorFlash;

use super::{CheckIn, Shared, mark, now};
use crate::autopilot::LogStep;
use crate::recorder::{Erasure, FlashOutcome, Ring, SECTOR_BYTES};

/// How often the task looks whether there is something to write.
const IDLE_CHECK: Duration = Duration::from_millis(250);

/// Minimum pause after an erase, which is as long as the erase otherwise: for others to use the flash and the processor.
const LEAST_PAUSE: Duration = Duration::from_millis(50);

/// Reads which logs there are in the sectors of `range`, an address range of `flash`; then writes the log, and erases ahead
/// of it while disarmed.
pub async fn keep_log<F: NorFlash>(
    mut flash: F,
    range: Range<u32>,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    mark(check_in);
    let ring = Ring::scan(&mut flash, range).await;
    shared.with(|autopilot| autopilot.logs_found(ring));
    loop {
        mark(check_in);
        while let Some(pause) = work(&mut flash, shared).await {
            mark(check_in);
            Timer::after(pause).await;
        }
        Timer::after(IDLE_CHECK).await;
    }
}

/// Does what the log needs next, if anything, and returns how long others have the flash and the processor then. That is
/// decided in its turn at the flash: nothing is erased that was due when the rover was still disarmed.
async fn work<F: NorFlash>(flash: &mut F, shared: &Shared) -> Option<Duration> {
    let _turn = shared.flash_turn().await;
    match shared.with(|autopilot| autopilot.next_log_step(now()))? {
        LogStep::Program { address, bytes } => {
            shared.away_from_sampling().await;
            let written = flash.write(address, &bytes).await;
            shared.with(|autopilot| autopilot.log_written(outcome(written), now()));
            Some(Duration::MIN)
        }
        LogStep::Erase(erasure) => Some(erase(erasure, flash, shared).await),
    }
}

/// Erases a sector, and returns the pause after it.
async fn erase<F: NorFlash>(erasure: Erasure, flash: &mut F, shared: &Shared) -> Duration {
    let began = now();
    let from = erasure.address();
    let is_blank = erasure.is_first_use() && is_blank(from, flash).await;
    let mut erased = Ok(());
    if !is_blank {
        erased = flash.erase(from, from + SECTOR_BYTES).await;
    }
    if erased.is_ok() {
        erased = flash.write(erasure.mark_address(), &erasure.mark()).await;
    }
    shared.with(|autopilot| autopilot.log_erased(erasure, outcome(erased)));
    let pause = if is_blank { Duration::MIN } else { LEAST_PAUSE };
    Duration::from_micros(now().us_since(began)).max(pause)
}

/// Whether a sector reads blank.
async fn is_blank<F: NorFlash>(from: u32, flash: &mut F) -> bool {
    const ERASED: u8 = 0xFF;
    let mut part = [0; 64];
    for address in (from..from + SECTOR_BYTES).step_by(part.len()) {
        let read = flash.read(address, &mut part).await;
        if read.is_err() || part.iter().any(|byte| *byte != ERASED) {
            return false;
        }
    }
    true
}

fn outcome<E>(result: Result<(), E>) -> FlashOutcome {
    match result {
        Ok(()) => FlashOutcome::Done,
        Err(_) => FlashOutcome::Failed,
    }
}
