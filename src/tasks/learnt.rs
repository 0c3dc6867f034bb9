//! Keeps what is learnt of the packs in flash.

use embassy_time::{Duration, with_timeout};
use embedded_storage_async::nor_flash::NorFlash;

use super::prepare::prepare;
use super::{CheckIn, Shared, mark, now};
use crate::autopilot::LearntJob;
use crate::battery::LEARNT_WORDS;
use crate::memory::storage::Storage;

/// How often the task is seen while there is nothing to do.
const IDLE_CHECK: Duration = Duration::from_secs(1);

/// Reads what is stored of the packs that are monitored, and writes what is learnt of them.
pub async fn keep_learnt<F: NorFlash>(
    mut storage: Storage<F, [u32; LEARNT_WORDS]>,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    loop {
        mark(check_in);
        while let Some(job) = shared.with(|autopilot| autopilot.next_learnt_job(now())) {
            run(job, &mut storage, shared).await;
            mark(check_in);
        }
        prepare(&mut storage, shared).await;
        // With or without a request: a retry may be due.
        let _ = with_timeout(IDLE_CHECK, shared.to_keep_learnt.wait()).await;
    }
}

async fn run<F: NorFlash>(job: LearntJob, storage: &mut Storage<F, [u32; LEARNT_WORDS]>, shared: &Shared) {
    let _turn = shared.flash_turn().await;
    match job {
        LearntJob::Read(identity) => {
            let stored = storage.read(identity.key()).await;
            shared.with(|autopilot| autopilot.learnt_read(identity, stored));
        }
        LearntJob::Write(identity, learnt) => {
            let is_dispensable = |key| shared.with(|autopilot| !autopilot.is_learnt_in_use(key));
            let may_erase = || shared.may_erase();
            let written = storage
                .store_replacing(identity.key(), learnt.to_words(), &is_dispensable, &may_erase)
                .await;
            shared.with(|autopilot| {
                autopilot.learnt_written(identity.pack, &learnt, written.map(drop), now());
            });
        }
    }
}
