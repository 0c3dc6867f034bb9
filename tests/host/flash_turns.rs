//! Parameters, the log and everything else take turns at a flash that takes its time.

use std::ops::Range;

use embassy_futures::block_on;
use embassy_futures::select::select;
use embassy_time::Timer;
use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use rover_battmon::autopilot::{SamplingProgress, Start};
use rover_battmon::battery::RetainedRecord;
use rover_battmon::memory::flash_map;
use rover_battmon::parameter::{Parameters, VehicleParameter};
use rover_battmon::recorder::MAX_SECTORS;
use rover_battmon::sensor::AnalogReadings;
use rover_battmon::tasks::{Shared, Storages, now};
use rover_battmon::wifi::Radio;
use rover_battmon_tools::sim::SimulatedFlash;
use support::requests::{arm_by_force, disarm};

use crate::regions::{self, Vehicle};

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
fn run(flash: &SlowFlash, script: impl AsyncFnOnce(&Vehicle)) {
    let mut parameters = Parameters::defaults();
    parameters.set(VehicleParameter::LogDisarmed, 1.0).unwrap();
    run_with(parameters, flash, script);
}

/// Lets a vehicle run beside `script`.
fn run_with(parameters: Parameters, flash: &(impl NorFlash + Clone), script: impl AsyncFnOnce(&Vehicle)) {
    let storages = Storages::of_board(flash.clone(), Radio::Absent);
    let log = (flash.clone(), flash_map::LOG);
    regions::run(
        &Start::with_parameters(parameters),
        storages,
        log,
        async |vehicle| {
            select(sample(&vehicle.shared), script(vehicle)).await;
        },
    );
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

fn logged_bytes(vehicle: &Vehicle) -> u32 {
    vehicle
        .shared
        .with(|autopilot| autopilot.logs().iter().map(|file| file.bytes).sum())
}

#[test]
fn parameters_that_are_set_without_a_pause_leave_the_log_its_turns() {
    let flash = SlowFlash(SimulatedFlash::blank());
    run(&flash, async |vehicle| {
        for number in 0..5_000 {
            vehicle.set("BATT_CAPACITY", 1000.0 + number as f32);
            Timer::after_millis(2).await;
        }
        let bytes = logged_bytes(vehicle);
        // All parameters, and whatever happened.
        assert!(bytes > 10_000, "{bytes} bytes in ten seconds");
    });
}

#[test]
fn a_parameter_is_saved_at_once_while_the_log_erases_ahead() {
    let flash = SlowFlash(SimulatedFlash::blank());
    // Something else was in every sector, so each has to be erased.
    for sector in flash_map::LOG.step_by(SlowFlash::ERASE_SIZE) {
        block_on(flash.0.clone().write(sector, &[0; 64])).expect("it is inside");
    }
    run(&flash, async |vehicle| {
        Timer::after_secs(5).await;
        for number in 0..20 {
            vehicle.set("BATT_CAPACITY", 1000.0 + number as f32);
            Timer::after_millis(450).await;
            let unsaved = vehicle
                .shared
                .with(|autopilot| autopilot.parameters().next_unsaved());
            assert_eq!(unsaved, None, "{number}");
        }
    });
}

/// Erases of the sectors of a range.
fn erases(flash: &SimulatedFlash, range: Range<u32>) -> Vec<u32> {
    let erases = &flash.chip().erases;
    let place = |at| erases.len() - ((flash_map::CHIP_BYTES - at) / flash_map::SECTOR_BYTES) as usize;
    erases[place(range.start)..place(range.end)].to_vec()
}

/// A chip whose log is filled with this byte.
fn with_log_of(byte: u8) -> SimulatedFlash {
    let mut flash = SimulatedFlash::blank();
    let filled = vec![byte; flash_map::LOG.len()];
    block_on(flash.write(flash_map::LOG.start, &filled)).expect("it is blank");
    flash
}

/// All that can be erased ahead: one remains for the next lap.
const SECTORS_AHEAD: u64 = MAX_SECTORS as u64 - 1;

#[test]
fn sectors_of_the_log_are_prepared_once_and_blank_ones_are_not_erased() {
    for (byte, expected) in [(0xff, 0), (0, SECTORS_AHEAD)] {
        let flash = with_log_of(byte);
        for (erased, marked) in [(expected, SECTORS_AHEAD), (0, 0)] {
            let before = flash.chip().operations();
            let a_minute = async |_: &Vehicle| Timer::after_secs(60).await;
            run_with(Parameters::defaults(), &flash, a_minute);
            let operations = flash.chip().operations() - before;
            assert_eq!(operations, erased + marked, "{byte:#x}");
        }
        let erased: u32 = erases(&flash, flash_map::LOG).iter().sum();
        assert_eq!(u64::from(erased), expected, "{byte:#x}");
    }
}

#[test]
fn the_log_of_an_armed_rover_is_not_erased() {
    let flash = with_log_of(0);
    run_with(Parameters::defaults(), &flash, async |vehicle| {
        Timer::after_secs(1).await;
        vehicle.ask(&arm_by_force());
        let before = erases(&flash, flash_map::LOG);
        Timer::after_secs(10).await;
        assert_eq!(erases(&flash, flash_map::LOG), before);
        vehicle.ask(&disarm());
        Timer::after_secs(10).await;
        assert_ne!(erases(&flash, flash_map::LOG), before);
    });
}

#[test]
// Requirement: W-1
fn a_thousand_parameters_that_are_set_cost_a_page_each_and_four_erases_in_turn() {
    let flash = SimulatedFlash::blank();
    run_with(Parameters::defaults(), &flash, async |vehicle| {
        vehicle.set("LOG_BITMASK", 0.0);
        Timer::after_secs(60).await;
        let before = flash.chip().programs;
        for number in 0..1_000 {
            vehicle.set("BATT_SERIAL_NUM", number as f32);
            Timer::after_millis(100).await;
        }
        let programs = flash.chip().programs - before;
        assert!((1_000..=1_100).contains(&programs), "{programs}");
    });
    let erases = erases(&flash, flash_map::PARAMETERS);
    let total: u32 = erases.iter().sum();
    assert!((1..=4).contains(&total), "{erases:?}");
    let most = total.div_ceil(erases.len() as u32);
    assert!(erases.iter().all(|sector| *sector <= most), "in turn: {erases:?}");
}
