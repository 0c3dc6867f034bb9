//! A vehicle's flash: a small chip for each of its regions, and the task that keeps it.

use nor_flash::SmallFlash;
use rover_battmon::memory::storage::Storage;
use rover_battmon::tasks::{CheckIn, Shared, Storages, keep_flash};

/// The chips. None is there for the log.
pub struct Regions {
    pub parameters: SmallFlash,
    pub signing: SmallFlash,
    pub learnt: SmallFlash,
    /// Of a board with a radio.
    pub wifi: Option<SmallFlash>,
}

impl Regions {
    /// Blank ones, without a radio.
    pub fn blank() -> Self {
        Self {
            parameters: SmallFlash::blank(),
            signing: SmallFlash::blank(),
            learnt: SmallFlash::blank(),
            wifi: None,
        }
    }

    pub fn storages(&self) -> Storages<SmallFlash> {
        Storages::new(
            Storage::new(self.parameters.clone(), SmallFlash::REGION),
            Storage::new(self.signing.clone(), SmallFlash::REGION),
            Storage::new(self.learnt.clone(), SmallFlash::REGION),
            self.wifi
                .clone()
                .map(|chip| Storage::new(chip, SmallFlash::REGION)),
        )
    }
}

/// Runs the task. Random numbers are all the same.
pub async fn keep(storages: Storages<SmallFlash>, shared: &Shared) -> ! {
    let check_in = CheckIn::new("", u32::MAX);
    keep_flash(
        storages,
        SmallFlash::blank(),
        0..0,
        async || Some([7; 32]),
        shared,
        &check_in,
    )
    .await
}
