//! Parameters, the log and everything else take turns at a flash that takes its time.

use embassy_futures::block_on;
use embassy_futures::select::select;
use embassy_time::{Duration, Timer};
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use rover_battmon::autopilot::{SamplingProgress, Start};
use rover_battmon::battery::RetainedRecord;
use rover_battmon::mavlink::{Endpoint, LinkKind};
use rover_battmon::memory::flash_map;
use rover_battmon::parameter::{Parameters, VehicleParameter};
use rover_battmon::sensor::AnalogReadings;
use rover_battmon::tasks::{CheckIn, Shared, Storages, keep_flash, now};
use rover_battmon::wifi::Radio;
use rover_battmon_tools::sim::{SimulatedFlash, clock};
use support::requests::param_set;

/// A page takes as long as on the slowest chip.
#[derive(Clone)]
struct SlowFlash(SimulatedFlash);

impl ErrorType for SlowFlash {
    type Error = <SimulatedFlash as ErrorType>::Error;
}

impl ReadNorFlash for SlowFlash {
    const READ_SIZE: usize = SimulatedFlash::READ_SIZE;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Self::Error> {
        self.0.read(offset, bytes).await
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl NorFlash for SlowFlash {
    const WRITE_SIZE: usize = SimulatedFlash::WRITE_SIZE;
    const ERASE_SIZE: usize = SimulatedFlash::ERASE_SIZE;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Self::Error> {
        Timer::after_millis(400).await;
        self.0.erase(from, to).await
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Self::Error> {
        Timer::after_micros(3_200).await;
        self.0.write(offset, bytes).await
    }
}

/// Lets a vehicle that logs while disarmed run beside `script`.
fn run(flash: &SlowFlash, script: impl AsyncFnOnce(&Shared)) {
    let check_in = CheckIn::new("", u32::MAX);
    clock::run_for(Duration::from_secs(60), async {
        let mut parameters = Parameters::defaults();
        parameters.set(VehicleParameter::LogDisarmed, 1.0).unwrap();
        let shared = Shared::new(&Start::with_parameters(parameters));
        let storages = Storages::of_board(flash.clone(), Radio::Absent);
        let task = keep_flash(
            storages,
            flash.clone(),
            flash_map::LOG,
            async || None,
            &shared,
            &check_in,
        );
        select(select(task, sample(&shared)), script(&shared)).await;
    });
}

/// Samples, which fills the log, and drives, which begins it.
async fn sample(shared: &Shared) {
    let mut memory = [RetainedRecord::BLANK; 2];
    loop {
        Timer::after_millis(100).await;
        shared.with(|autopilot| {
            let mut tick = autopilot.begin_sampling(now(), AnalogReadings::NONE);
            while autopilot.sample_next(&mut tick) != SamplingProgress::Complete {}
            autopilot.end_sampling(tick, &mut memory);
            autopilot.drive(now());
        });
    }
}

fn set(shared: &Shared, name: &str, value: f32) {
    let mut endpoint = Endpoint::new("desk", LinkKind::Direct, 100_000, now());
    endpoint.push(&param_set(name, value));
    let handle =
        |endpoint: &mut Endpoint| shared.with(|autopilot| autopilot.handle_next(endpoint, now(), now()));
    while handle(&mut endpoint).is_some() {}
}

fn logged_bytes(shared: &Shared) -> u32 {
    shared.with(|autopilot| autopilot.logs().iter().map(|file| file.bytes).sum())
}

#[test]
fn parameters_that_are_set_without_a_pause_leave_the_log_its_turns() {
    let flash = SlowFlash(SimulatedFlash::open(None).expect("it needs no file"));
    run(&flash, async |shared| {
        for number in 0..5_000 {
            set(shared, "BATT_CAPACITY", 1000.0 + number as f32);
            Timer::after_millis(2).await;
        }
        let bytes = logged_bytes(shared);
        // All parameters, and whatever happened.
        assert!(bytes > 10_000, "{bytes} bytes in ten seconds");
    });
}

#[test]
fn a_parameter_is_saved_at_once_while_the_log_erases_ahead() {
    let flash = SlowFlash(SimulatedFlash::open(None).expect("it needs no file"));
    // Something else was in every sector, so each has to be erased.
    for sector in flash_map::LOG.step_by(SlowFlash::ERASE_SIZE) {
        block_on(flash.0.clone().write(sector, &[0; 64])).expect("it is inside");
    }
    run(&flash, async |shared| {
        Timer::after_secs(5).await;
        for number in 0..20 {
            set(shared, "BATT_CAPACITY", 1000.0 + number as f32);
            Timer::after_millis(450).await;
            let unsaved = shared.with(|autopilot| autopilot.parameters().next_unsaved());
            assert_eq!(unsaved, None, "{number}");
        }
    });
}
