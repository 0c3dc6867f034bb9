//! A vehicle's flash: a small chip for each of its regions, and the task that keeps it.

use std::cell::RefCell;
use std::ops::Range;

use embassy_futures::block_on;
use embassy_futures::select::select3;
use embassy_time::{Duration, Timer};
use embedded_storage_async::nor_flash::NorFlash;
use nor_flash::SmallFlash;
use rover_battmon::autopilot::Start;
use rover_battmon::crash::ParameterSource;
use rover_battmon::mavlink::{Endpoint, Framer, LinkKind};
use rover_battmon::memory::storage::Storage;
use rover_battmon::tasks::{CheckIn, Shared, Storages, keep_flash, now, reboot_requested};
use rover_battmon::time::Instant;
use rover_battmon_tools::sim::clock;
use support::desk::frames_of;
use support::frames::{Frame, texts_of};
use support::requests::param_set;
use support::vehicle::value_of;

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

    /// A start with this flash.
    pub fn started(&self, source: ParameterSource) -> Start {
        let mut start = Start::default();
        block_on(self.storages().boot(source, &mut start));
        start
    }
}

/// Runs the task on these, without a log. Random numbers are all the same.
pub async fn keep(storages: Storages<SmallFlash>, shared: &Shared) -> ! {
    keep_with_log(storages, SmallFlash::blank(), 0..0, shared).await
}

async fn keep_with_log<F: NorFlash>(
    storages: Storages<F>,
    log: F,
    log_range: Range<u32>,
    shared: &Shared,
) -> ! {
    let check_in = CheckIn::new("", u32::MAX);
    let entropy = async || Some([7; 32]);
    keep_flash(storages, log, log_range, entropy, shared, &check_in).await
}

/// A vehicle that keeps its flash in stepped time, with no other tasks, and a ground station by cable.
pub struct Vehicle {
    pub shared: Shared,
    endpoint: RefCell<Endpoint>,
}

impl Vehicle {
    fn new(start: &Start) -> Self {
        Self {
            shared: Shared::new(start),
            endpoint: RefCell::new(Endpoint::new("cable", LinkKind::Direct, 100_000, Instant::EPOCH)),
        }
    }

    /// Everything that is sent now.
    fn sent(&self) -> Vec<Frame> {
        let mut endpoint = self.endpoint.borrow_mut();
        self.shared.with(|autopilot| {
            autopilot.post_due(&mut endpoint, now());
            frames_of(autopilot, &mut endpoint, &mut Framer::new(), now(), usize::MAX)
        })
    }

    /// Delivers a request and returns the answers.
    pub fn ask(&self, request: &[u8]) -> Vec<Frame> {
        self.endpoint.borrow_mut().push(request);
        let handle = || {
            let mut endpoint = self.endpoint.borrow_mut();
            self.shared
                .with(|autopilot| autopilot.handle_next(&mut endpoint, now(), now()))
        };
        while handle().is_some() {}
        self.shared.with(|autopilot| autopilot.drive(now()));
        self.sent()
    }

    /// Sets a parameter, which is acknowledged at once, and returns the texts.
    pub fn set(&self, name: &str, value: f32) -> Vec<String> {
        let answers = self.ask(&param_set(name, value));
        assert_eq!(value_of(&answers, name), Some(value), "{name}");
        texts_of(&answers)
    }

    /// Lets time pass, and returns the texts.
    pub async fn wait(&self, seconds: u64) -> Vec<String> {
        let mut texts = Vec::new();
        for _ in 0..seconds {
            Timer::after_secs(1).await;
            texts.extend(texts_of(&self.sent()));
        }
        texts
    }
}

/// Runs a vehicle until the script ends or a restart that it requested is due, and returns it.
pub fn run<F: NorFlash>(
    start: &Start,
    storages: Storages<F>,
    (log, log_range): (F, Range<u32>),
    script: impl AsyncFnOnce(&Vehicle),
) -> Vehicle {
    let vehicle = Vehicle::new(start);
    clock::run_for(Duration::from_secs(24 * 3600), async {
        select3(
            keep_with_log(storages, log, log_range, &vehicle.shared),
            reboot_requested(&vehicle.shared, || true),
            script(&vehicle),
        )
        .await;
    });
    vehicle
}

impl Regions {
    /// Starts a vehicle with this flash, and runs it.
    pub fn run(&self, mut start: Start, script: impl AsyncFnOnce(&Vehicle)) -> Vehicle {
        let mut storages = self.storages();
        block_on(storages.boot(ParameterSource::Stored, &mut start));
        run(&start, storages, (SmallFlash::blank(), 0..0), script)
    }
}
