//! Reads what is stored, before the tasks start.

use embedded_storage_async::nor_flash::NorFlash;

use super::SigningStorage;
use crate::autopilot::{ParameterLoad, Start};
use crate::crash::ParameterSource;
use crate::log::warn;
use crate::memory::storage::Storage;
use crate::parameter::Parameters;

/// Reads the parameters from `parameter_storage` and the signing key from `signing_storage` into `start`. What can't be
/// read is at its default, and [`Autopilot::new`](crate::autopilot::Autopilot::new) reports it.
pub async fn boot<F: NorFlash>(
    parameter_storage: &mut Storage<F>,
    signing_storage: Storage<F>,
    source: ParameterSource,
    start: &mut Start,
) -> SigningStorage<F> {
    start.parameter_load = match source {
        ParameterSource::Stored => load_parameters(parameter_storage, &mut start.parameters).await,
        ParameterSource::Defaults => {
            start.parameters.mark_not_loaded();
            ParameterLoad::Skipped
        }
    };
    SigningStorage::load(signing_storage, &mut start.signing).await
}

async fn load_parameters<F: NorFlash>(
    storage: &mut Storage<F>,
    parameters: &mut Parameters,
) -> ParameterLoad {
    let result = storage
        .load(&mut |key, word| {
            let value = f32::from_bits(word);
            if parameters.restore(key, value).is_err() {
                warn!("stored parameter {} = {} does not fit this firmware", key, value);
            }
        })
        .await;
    if parameters.mend_sticks() {
        warn!("stored channels of the sticks do not fit each other: default");
    }
    match result {
        Ok(()) => ParameterLoad::Loaded,
        Err(error) => ParameterLoad::Damaged(error),
    }
}
