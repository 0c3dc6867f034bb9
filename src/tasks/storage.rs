//! Keeps the parameters in flash.

use embassy_time::{Duration, Instant, with_timeout};
use embedded_storage_async::nor_flash::NorFlash;

use super::{Shared, mark};
use crate::liveness::CheckIn;
use crate::log::{info, warn};
use crate::mavlink::dialect::MavSeverity;
use crate::parameter::Parameters;
use crate::storage::{Storage, StorageError};

/// How often the task is seen while there is nothing to save.
const IDLE_CHECK: Duration = Duration::from_secs(1);

/// Before what could not be written is tried again without being asked: a worn sector won't recover, and each try stops
/// everything for the time of an erase.
pub(super) const RETRY_INTERVAL: Duration = Duration::from_secs(60);

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

/// Tells ground stations and the log what `load_parameters` found; `None` if it was not asked because of too many resets.
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

/// Writes what was set to flash, and clears it when asked to.
///
/// A value is live and acknowledged before it is written. An erase of the flash stops everything for 45 ms, typically;
/// the others get their turn after each operation.
pub async fn keep_parameters<F: NorFlash>(mut storage: Storage<F>, shared: &Shared, check_in: &CheckIn) -> ! {
    let mut retry_at = Instant::MAX;
    let mut failure_said = false;
    loop {
        mark(check_in);
        let asked = with_timeout(IDLE_CHECK, shared.to_save.wait()).await.is_ok();
        if !asked && Instant::now() < retry_at {
            continue;
        }
        shared.storage_busy.set(true);
        let result = save(&mut storage, shared, check_in).await;
        shared.storage_busy.set(false);
        retry_at = Instant::MAX;
        if let Err(error) = result {
            warn!("parameter storage: {:?}", error);
            retry_at = Instant::now() + RETRY_INTERVAL;
            if !failure_said {
                failure_said = true;
                shared.notice(MavSeverity::MAV_SEVERITY_CRITICAL, failure_text(error));
            }
        }
    }
}

/// What an owner is told of values that are live and can't be saved.
fn failure_text(error: StorageError) -> &'static str {
    match error {
        StorageError::Full => "Parameters can't be saved: too many changed",
        StorageError::Flash | StorageError::Corrupt => "Parameters can't be saved: flash worn out?",
    }
}

async fn save<F: NorFlash>(
    storage: &mut Storage<F>,
    shared: &Shared,
    check_in: &CheckIn,
) -> Result<(), StorageError> {
    if shared.to_clear.take() {
        shared.with_parameters(|parameters| *parameters = Parameters::defaults());
        if let Err(error) = storage.clear().await {
            shared.to_clear.set(true);
            return Err(error);
        }
        info!("parameters reset to defaults");
    }
    while let Some((id, value)) = shared.with_parameters(|parameters| parameters.next_unsaved()) {
        storage.store(id.key(), value.to_bits()).await?;
        shared.with_parameters(|parameters| parameters.mark_saved(id, value));
        info!("{} saved", id.name().as_str());
        mark(check_in);
    }
    Ok(())
}
