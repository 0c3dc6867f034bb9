//! Keeps in flash what has to outlast a restart: parameters, the signing key, what is learnt of the packs, Wi-Fi settings and
//! the log.
//!
//! One task does all of it, so one operation follows the other, and other tasks run in between: the one that feeds the
//! watchdog, too. Nothing waits for more than one thing of each other kind.

use core::ops::Range;
use core::pin::{Pin, pin};

use embassy_futures::select::{Either, select};
use embassy_futures::yield_now;
use embassy_time::{Duration, Timer};
use embedded_storage_async::nor_flash::NorFlash;

use super::{CheckIn, Shared, mark, now};
use crate::autopilot::{FlashJob, FlashResult, FlashStore, LOG_FULL, LogStep, ParameterLoad, Start};
use crate::battery::{LEARNT_WORDS, OLDER_LEARNT_WORDS};
use crate::crash::ParameterSource;
use crate::log::warn;
use crate::mavlink::{Signing, StoredSigning, ToStore};
use crate::memory::flash_map;
use crate::memory::storage::{Condition, Erase, MayErase, Prepared, Records, Storage, StorageError};
use crate::parameter::{Parameters, Refused, Unsaved, VehicleParameter};
use crate::recorder::dataflash::LastArming;
use crate::recorder::{Erasure, LogFile, PAYLOAD_BYTES, Ring, SECTOR_BYTES};
use crate::wifi::{Radio, StoredWifi, WIFI_WORDS};

/// Interval of checks for work without a request: of the log, or because a retry is due.
const IDLE_CHECK: Duration = Duration::from_millis(250);

/// Minimum pause of the log after an erase, which is as long as the erase otherwise: for others to use the flash and the
/// processor.
const LEAST_PAUSE: Duration = Duration::from_millis(50);

/// The telemetry port's first messages leave before the radio begins.
const RADIO_DELAY: Duration = Duration::from_millis(50);

/// Random numbers that were refused are asked for again after this.
const ENTROPY_RETRY_US: u64 = 10_000_000;

/// Time armed so far, before the tasks start.
const NOT_ARMED_US: u64 = 0;

/// Of the mark that damaged or half loaded parameters leave.
const MARK_KEY: u16 = VehicleParameter::ParamChecked.row().key;

/// Of the parameter that a reset keeps in flash: it may be lower than its default.
const KEPT_KEY: u16 = VehicleParameter::SignUsbAllow.row().key;

/// All storages but the log's.
pub struct Storages<F> {
    parameters: Storage<F>,
    signing: Storage<F>,
    stored_signing: StoredSigning,
    learnt: Storage<F, [u32; LEARNT_WORDS]>,
    wifi: Option<Storage<F, [u32; WIFI_WORDS]>>,
}

impl<F: NorFlash> Storages<F> {
    /// In these storages; names and passwords of networks are kept on a board with a radio only.
    pub fn new(
        parameters: Storage<F>,
        signing: Storage<F>,
        learnt: Storage<F, [u32; LEARNT_WORDS]>,
        wifi: Option<Storage<F, [u32; WIFI_WORDS]>>,
    ) -> Self {
        Self {
            parameters,
            signing,
            stored_signing: StoredSigning::default(),
            learnt,
            wifi,
        }
    }

    /// In the [regions](flash_map) of a board's flash.
    pub fn of_board(flash: F, radio: Radio) -> Self
    where
        F: Clone,
    {
        Self::new(
            Storage::of_double_sectors(flash.clone(), flash_map::PARAMETERS),
            Storage::new(flash.clone(), flash_map::SIGNING),
            Storage::new(flash.clone(), flash_map::LEARNT).widening(OLDER_LEARNT_WORDS),
            (radio == Radio::Present).then(|| Storage::new(flash, flash_map::WIFI)),
        )
    }

    /// Reads the parameters and the signing key into `start`, before the tasks start. What can't be read is at its default,
    /// and [`Autopilot::new`](crate::autopilot::Autopilot::new) reports it.
    pub async fn boot(&mut self, source: ParameterSource, start: &mut Start) {
        start.parameter_load = self.load_parameters(source, &mut start.parameters).await;
        self.load_signing(&mut start.signing).await;
    }

    /// Whether values are damaged is looked for even if none is taken: the next one that is stored would hide it.
    async fn load_parameters(
        &mut self,
        source: ParameterSource,
        parameters: &mut Parameters,
    ) -> ParameterLoad {
        if source == ParameterSource::Defaults {
            parameters.mark_not_read();
        }
        let mut unknown = 0;
        let mut found = |key, word| {
            if source == ParameterSource::Defaults && key != MARK_KEY {
                return;
            }
            let value = f32::from_bits(word);
            if let Err(refused) = parameters.restore(key, value) {
                warn!("stored parameter {} = {} does not fit this firmware", key, value);
                unknown += u16::from(refused == Refused::ReadOnly);
            }
        };
        let read = self.parameters.load(&mut found).await;
        if let Err(error) = read {
            warn!("parameter storage: {:?}", error);
            parameters.mark_damaged();
        }
        match self.parameters.condition() {
            _ if source == ParameterSource::Defaults => ParameterLoad::Skipped,
            Condition::OneRecordDamaged | Condition::Damaged if read.is_ok() => ParameterLoad::Interrupted,
            _ if unknown > 0 => ParameterLoad::Unknown(unknown),
            _ => ParameterLoad::Loaded,
        }
    }

    /// Unreadable data count as a lost key: [`Signing::trouble`] reports it.
    async fn load_signing(&mut self, signing: &mut Signing) {
        let stored = &mut self.stored_signing;
        let read = self.signing.load(&mut |key, word| stored.found(key, word)).await;
        if let Err(error) = read {
            warn!("signing storage: {:?}", error);
        }
        *signing = stored.restore(self.signing.condition());
        // Before the first frame leaves: what is signed from now on must not be signed again after the next start.
        if let Some(what) = signing.next_unsaved(now(), NOT_ARMED_US) {
            match self.write_signing(&what, &Erase::always).await {
                Ok(()) => signing.mark_saved(&what),
                Err(_) => signing.mark_failed(),
            }
        }
    }

    /// Unreadable data are as if they were never set.
    async fn load_wifi(&mut self, shared: &Shared) {
        let Some(storage) = &mut self.wifi else { return };
        let mut stored = StoredWifi::default();
        let read = storage.load(&mut |key, words| stored.found(key, &words)).await;
        if let Err(error) = read {
            warn!("Wi-Fi storage: {:?}", error);
        }
        shared.with(|autopilot| autopilot.wifi_loaded(stored, now()));
    }

    /// Saves what has to be saved until `other` is done, which gets its turns meanwhile.
    // `dyn`: there is one such function.
    async fn save_during(
        &mut self,
        mut other: Pin<&mut dyn Future<Output = ()>>,
        shared: &Shared,
        check_in: &CheckIn,
    ) {
        loop {
            mark(check_in);
            self.save(shared, check_in).await;
            if let Either::First(()) = select(other.as_mut(), shared.to_save.wait()).await {
                return;
            }
        }
    }

    /// Does the next thing of each kind, if there is one, and erases ahead once nothing is left.
    async fn save(&mut self, shared: &Shared, check_in: &CheckIn) {
        if shared.waits_for_watchdog() {
            return;
        }
        for store in FlashStore::ALL {
            if let Some(job) = shared.with(|autopilot| autopilot.next_flash_job(store, now())) {
                let result = self.run(&job, shared).await;
                shared.with(|autopilot| autopilot.flash_done(&job, result, now()));
                go_on(shared, check_in).await;
            }
        }
        if shared.to_save.signaled() {
            return;
        }
        prepare(&mut self.parameters, shared, check_in).await;
        prepare(&mut self.signing, shared, check_in).await;
        prepare(&mut self.learnt, shared, check_in).await;
        if let Some(storage) = &mut self.wifi {
            prepare(storage, shared, check_in).await;
        }
    }

    async fn run(&mut self, job: &FlashJob, shared: &Shared) -> FlashResult {
        let may_erase = || shared.may_erase();
        match job {
            FlashJob::Parameter(Unsaved::Reset) => self.parameters.clear_but(KEPT_KEY, &may_erase).await?,
            FlashJob::Parameter(Unsaved::Value(id, value)) => {
                let word = value.to_bits();
                self.parameters.store(id.key(), word, &may_erase).await?;
            }
            FlashJob::Signing(what) => self.write_signing(what, &may_erase).await?,
            FlashJob::ReadLearnt(identity) => return self.learnt.read(identity.key()).await,
            FlashJob::WriteLearnt(identity, learnt) => {
                let is_dispensable = |key| shared.with(|autopilot| !autopilot.is_learnt_in_use(key));
                self.learnt
                    .store_replacing(identity.key(), learnt.to_words(), &is_dispensable, &may_erase)
                    .await?;
            }
            FlashJob::Wifi(record) => {
                // A board without a radio has nothing to store.
                if let Some(storage) = &mut self.wifi {
                    storage.store(record.key(), record.to_words(), &may_erase).await?;
                }
            }
        }
        Ok(None)
    }

    async fn write_signing(&mut self, what: &ToStore, may_erase: MayErase<'_>) -> Result<(), StorageError> {
        if *what == ToStore::Nothing {
            self.signing.start_over(may_erase).await?;
            self.stored_signing = StoredSigning::default();
        }
        for (key, word) in self.stored_signing.words(what) {
            self.signing.store(key, word, may_erase).await?;
            self.stored_signing.found(key, word);
        }
        Ok(())
    }
}

/// Something was done, and more of it may follow; now it is the others' turn.
async fn go_on(shared: &Shared, check_in: &CheckIn) {
    mark(check_in);
    shared.to_save.signal(());
    yield_now().await;
}

/// Erases the sector that `storage` needs next, unless the vehicle is armed: a block at a time.
async fn prepare<F: NorFlash>(storage: &mut Records<F>, shared: &Shared, check_in: &CheckIn) {
    while !storage.is_prepared() && shared.may_erase() == Erase::Allowed {
        let prepared = storage.prepare(&|| shared.may_erase()).await;
        mark(check_in);
        yield_now().await;
        match prepared {
            Ok(Prepared::Partly) => {}
            Ok(Prepared::AsFarAsPossible) => return,
            Err(error) => {
                warn!("storage: no sector erased ahead: {:?}", error);
                return;
            }
        }
    }
}

/// Has a password made of what `entropy` gives, if there is none.
async fn make_password(entropy: &mut impl AsyncFnMut() -> Option<[u8; 32]>, shared: &Shared) {
    if shared.with(|autopilot| autopilot.needs_entropy()) {
        let entropy = entropy().await;
        shared.with(|autopilot| autopilot.entropy_collected(entropy, now()));
    }
}

/// Reads what was not read before the tasks start: what is learnt of the packs first, then Wi-Fi settings, then which logs there
/// are in the sectors of `log_range`, an address range of `log`. Then writes whatever has to be saved and recorded, and
/// erases ahead of it while disarmed. `entropy` gives 32 random bytes for the first password, or is asked again later.
pub async fn keep_flash<F: NorFlash>(
    mut storages: Storages<F>,
    mut log: F,
    log_range: Range<u32>,
    mut entropy: impl AsyncFnMut() -> Option<[u8; 32]>,
    shared: &Shared,
    check_in: &CheckIn,
) -> ! {
    if storages.wifi.is_some() {
        let delay = pin!(Timer::after(RADIO_DELAY));
        storages.save_during(delay, shared, check_in).await;
        storages.load_wifi(shared).await;
        make_password(&mut entropy, shared).await;
    }
    let scan = async {
        let ring = Ring::scan(&mut log, log_range).await;
        let newest = shared.with(|autopilot| autopilot.logs_found(ring));
        if let Some(newest) = newest
            && ends_armed(&mut log, newest, shared).await
        {
            shared.with(|autopilot| autopilot.last_run_ended_armed(now()));
        }
    };
    storages.save_during(pin!(scan), shared, check_in).await;
    let mut entropy_due = now().after_us(ENTROPY_RETRY_US);
    loop {
        if now() >= entropy_due {
            entropy_due = now().after_us(ENTROPY_RETRY_US);
            make_password(&mut entropy, shared).await;
        }
        let pause = keep_log(&mut log, shared).await;
        let pause = pin!(async {
            select(Timer::after(pause), shared.to_write_log.wait()).await;
        });
        storages.save_during(pause, shared, check_in).await;
    }
}

/// Whether a log ends while armed. Read in blocks, of which a payload has whole ones, some at a turn.
async fn ends_armed<F: NorFlash>(flash: &mut F, log: LogFile, shared: &Shared) -> bool {
    const BLOCK_BYTES: usize = 32;
    const TURN_BYTES: u32 = 256;
    const { assert!(PAYLOAD_BYTES.is_multiple_of(BLOCK_BYTES as u32)) };
    let mut read = LastArming::new(LOG_FULL);
    let mut block = [0; BLOCK_BYTES];
    for at in (0..log.bytes).step_by(BLOCK_BYTES) {
        let Some(piece) = shared.with(|autopilot| autopilot.log_piece(log.number, at)) else {
            return false;
        };
        if flash.read(piece.address, &mut block).await.is_err() {
            return false;
        }
        let bytes = block.iter().take(piece.bytes as usize);
        bytes.for_each(|byte| read.add(*byte));
        if at % TURN_BYTES == 0 {
            yield_now().await;
        }
    }
    read.is_armed()
}

/// Does what the log needs next, if anything, and returns how long others have the flash and the processor then.
async fn keep_log<F: NorFlash>(flash: &mut F, shared: &Shared) -> Duration {
    if shared.waits_for_watchdog() {
        return IDLE_CHECK;
    }
    match shared.with(|autopilot| autopilot.next_log_step(now())) {
        None => IDLE_CHECK,
        Some(LogStep::Program { address, bytes }) => {
            let written = flash.write(address, &bytes).await;
            shared.with(|autopilot| autopilot.log_written(written.map_err(drop), now()));
            Duration::MIN
        }
        Some(LogStep::Erase(erasure)) => erase(erasure, flash, shared).await,
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
    shared.with(|autopilot| autopilot.log_erased(erasure, erased.map_err(drop)));
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
