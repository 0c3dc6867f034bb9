//! Keeps the log in flash.

use core::ops::Range;

use embassy_time::{Duration, Instant, Timer};
use embedded_storage_async::nor_flash::NorFlash;

use super::{Shared, mark, now};
use crate::autopilot::LogStep;
use crate::liveness::CheckIn;
use crate::recorder::{Erasure, Outcome, Ring, SECTOR_BYTES};
use crate::storage::Erase;

/// How often the task looks whether there is something to write.
const IDLE_CHECK: Duration = Duration::from_millis(250);

/// Others have the flash and the processor for as long as an erase has taken, and at least for so long.
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
        while let Some(step) = shared.with(|autopilot| autopilot.next_log_step(now())) {
            run(step, &mut flash, shared).await;
            mark(check_in);
        }
        Timer::after(IDLE_CHECK).await;
    }
}

async fn run<F: NorFlash>(step: LogStep, flash: &mut F, shared: &Shared) {
    match step {
        LogStep::Program { address, bytes } => {
            let turn = shared.flash_turn().await;
            shared.away_from_sampling().await;
            let written = flash.write(address, &bytes).await;
            drop(turn);
            shared.with(|autopilot| autopilot.log_written(outcome(written), now()));
        }
        LogStep::Erase(erasure) => erase(erasure, flash, shared).await,
    }
}

/// Erases a sector, unless the rover was armed since.
async fn erase<F: NorFlash>(erasure: Erasure, flash: &mut F, shared: &Shared) {
    let turn = shared.flash_turn().await;
    if shared.may_erase() == Erase::Forbidden {
        return;
    }
    let began = Instant::now();
    let from = erasure.address();
    let mut erased = flash.erase(from, from + SECTOR_BYTES).await;
    if erased.is_ok() {
        erased = flash.write(erasure.mark_address(), &erasure.mark()).await;
    }
    drop(turn);
    shared.with(|autopilot| autopilot.log_erased(erasure, outcome(erased)));
    Timer::after(began.elapsed().max(LEAST_PAUSE)).await;
}

fn outcome<E>(result: Result<(), E>) -> Outcome {
    match result {
        Ok(()) => Outcome::Done,
        Err(_) => Outcome::Failed,
    }
}
