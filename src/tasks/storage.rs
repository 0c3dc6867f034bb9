//! Keeps the parameters in flash.

use embassy_time::{Duration, Instant, with_timeout};
use embedded_storage_async::nor_flash::NorFlash;

use super::{Shared, mark};
use crate::liveness::CheckIn;
use crate::log::{info, warn};
use crate::mavlink::dialect::MavSeverity;
use crate::parameter::{Parameters, SAVE_RETRY_INTERVAL_US, SaveFailures, Unsaved, save_failure_text};
use crate::storage::{Storage, StorageError};

/// How often the task is seen while there is nothing to save.
const IDLE_CHECK: Duration = Duration::from_secs(1);

/// Before what could not be written is tried again without being asked.
pub(super) const RETRY_INTERVAL: Duration = Duration::from_micros(SAVE_RETRY_INTERVAL_US);

const TOO_MANY_RESETS: &str = "5 quick resets: started with default parameters";

/// Reads the parameters from flash into `parameters`. What is not there, can't be trusted or is out of range by now stays as
/// it is.
///
/// # Errors
/// Not everything could be read. The parameters are usable all the same.
pub async fn load_parameters<F: NorFlash>(
    storage: &mut Storage<F>,
    parameters: &mut Parameters,
) -> Result<(), StorageError> {
    storage
        .load(&mut |key, word| {
            let value = f32::from_bits(word);
            if parameters.restore(key, value).is_err() {
                warn!("stored parameter {} = {} does not fit this firmware", key, value);
            }
        })
        .await
}

/// Reports to ground stations and the log what `load_parameters` found; `None` if it was not asked because of too many resets.
pub fn report_load(shared: &Shared, result: Option<Result<(), StorageError>>) {
    match result {
        Some(Ok(())) => info!("parameters loaded"),
        None => {
            warn!("{}", TOO_MANY_RESETS);
            shared.notice(MavSeverity::MAV_SEVERITY_CRITICAL, TOO_MANY_RESETS);
        }
        Some(Err(error)) => {
            warn!("parameter storage: {:?}", error);
            shared.notice(
                MavSeverity::MAV_SEVERITY_CRITICAL,
                "Parameter storage damaged: check parameters",
            );
        }
    }
}

/// Writes what was set to flash, and clears it when the parameters were reset.
///
/// A value is live and acknowledged before it is written. An erase of the flash stops everything for 45 ms, typically;
/// the others get their turn after each operation.
pub async fn keep_parameters<F: NorFlash>(mut storage: Storage<F>, shared: &Shared, check_in: &CheckIn) -> ! {
    let mut failures = SaveFailures::default();
    loop {
        mark(check_in);
        let asked = with_timeout(IDLE_CHECK, shared.to_save.wait()).await.is_ok();
        let retry = failures.take_retry(Instant::now().as_micros());
        if retry {
            shared.with_parameters(Parameters::retry_failed);
        }
        if asked || retry {
            save(&mut storage, shared, &mut failures, check_in).await;
        }
        if let Some(error) = failures.take_report(Instant::now().as_micros()) {
            shared.announce(MavSeverity::MAV_SEVERITY_CRITICAL, save_failure_text(error));
        }
    }
}

async fn save<F: NorFlash>(
    storage: &mut Storage<F>,
    shared: &Shared,
    failures: &mut SaveFailures,
    check_in: &CheckIn,
) {
    while let Some(unsaved) = shared.with_parameters(|parameters| parameters.next_unsaved()) {
        match write(storage, unsaved).await {
            Ok(()) => shared.with_parameters(|parameters| parameters.mark_saved(unsaved)),
            Err(error) => {
                warn!("parameter storage: {:?}", error);
                let news = shared.with_parameters(|parameters| parameters.mark_failed(unsaved, error));
                failures.add(news, Instant::now().as_micros());
            }
        }
        mark(check_in);
    }
}

async fn write<F: NorFlash>(storage: &mut Storage<F>, unsaved: Unsaved) -> Result<(), StorageError> {
    match unsaved {
        Unsaved::Reset => {
            storage.clear().await?;
            info!("stored parameters cleared");
        }
        Unsaved::Value(id, value) => {
            storage.store(id.key(), value.to_bits()).await?;
            info!("{} saved", id.name().as_str());
        }
    }
    Ok(())
}
