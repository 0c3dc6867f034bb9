//! Reads what is stored, before the tasks start.

use embedded_storage_async::nor_flash::NorFlash;

use super::SigningStorage;
use crate::autopilot::{ParameterLoad, Start};
use crate::battery::{RetainedMemory, recall};
use crate::crash::ParameterSource;
use crate::log::warn;
use crate::parameter::Parameters;
use crate::storage::Storage;

/// Reads the parameters from `parameter_storage`, the signing key from `signing_storage`, and what was retained of the
/// packs over a reset. What can't be read is at its default, and [`Autopilot::new`](crate::autopilot::Autopilot::new)
/// reports it.
pub async fn boot<F: NorFlash>(
    parameter_storage: &mut Storage<F>,
    signing_storage: Storage<F>,
    source: ParameterSource,
    memory: &RetainedMemory,
) -> (Start, SigningStorage<F>) {
    let mut parameters = Parameters::defaults();
    let parameter_load = match source {
        ParameterSource::Stored => load_parameters(parameter_storage, &mut parameters).await,
        ParameterSource::Defaults => {
            parameters.mark_not_loaded();
            ParameterLoad::Skipped
        }
    };
    let (signing_storage, signing) = SigningStorage::load(signing_storage).await;
    let start = Start {
        parameters,
        parameter_load,
        signing,
        packs: recall(memory),
    };
    (start, signing_storage)
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
    match result {
        Ok(()) => ParameterLoad::Loaded,
        Err(error) => ParameterLoad::Damaged(error),
    }
}
