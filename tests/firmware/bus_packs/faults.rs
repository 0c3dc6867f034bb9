//! Faults on the bus: each makes its own pack unhealthy, is announced once, is recovered from, and delays no other pack.
//! And the bus's clock.

use std::cell::RefCell;
use std::rc::Rc;

use super::with_second_pack;
use emulator::i2c_devices::{Ina226, Pec, RegisterMap, SmartBattery};
use emulator::{Board, I2cDevice, LogLevel};
use support::charge_states::UNHEALTHY;
use support::frames::{last_of, statuses_of, texts_of};
use support::monitor_types::{INA2XX, SMART_BATTERY};
use workbench::bench::{Bench, CYCLES_PER_US, DIVIDER_CODE, MILLISECOND, SECOND, TestedVehicle};
use workbench::i2c_bus::{BUS, shared};

const MONITOR_AT: u8 = 0x40;
const BATTERY_AT: u8 = 0x0b;

const CYCLES_PER_MS: u64 = MILLISECOND * CYCLES_PER_US;

/// The third pack is a smart battery, which is fine, and the first one is on the divider.
struct Faulty<D> {
    bench: Bench,
    part: Rc<RefCell<D>>,
}

/// The second pack is a power monitor.
fn with_monitor() -> Faulty<RegisterMap<Ina226>> {
    let part = shared(Ina226::new(0.0005));
    part.borrow_mut().set(12.0, 1.0);
    let mut bench = Bench::running(DIVIDER_CODE);
    let fine = SmartBattery::new(Pec::Right);
    bench.i2c(BUS).attach(BATTERY_AT, Box::new(fine));
    Faulty::of(
        bench,
        (INA2XX, MONITOR_AT),
        part,
        &[("BATT3_MONITOR", SMART_BATTERY)],
    )
}

impl<D: I2cDevice + 'static> Faulty<D> {
    /// After two seconds in which all packs were fine.
    fn of(bench: Bench, second: (f32, u8), part: Rc<RefCell<D>>, parameters: &[(&str, f32)]) -> Self {
        let mut bench = with_second_pack(bench, second, &part, parameters);
        bench.run_for(2 * SECOND);
        assert!(bench.logged(LogLevel::Warn, "unhealthy").is_empty());
        for fine in ["battery 2: Healthy", "battery 3: Healthy"] {
            assert!(!bench.logged(LogLevel::Info, fine).is_empty(), "{fine}");
        }
        Self { bench, part }
    }

    /// `fault` makes the second pack unhealthy within five seconds, which is announced once with this reason; when it
    /// has ended, the pack recovers by itself, which is announced once, too. The other packs keep their rate.
    fn assert_survives(&mut self, reason: &str, fault: impl FnOnce(&mut Self), end: impl FnOnce(&mut Self)) {
        fault(self);
        let from_us = self.bench.time_us();
        let is_noticed = |board: &mut Board| {
            let mut lines = board.log_lines().iter();
            lines.any(|line| line.text.contains("battery 2: unhealthy"))
        };
        assert!(self.bench.run_until(5 * SECOND, is_noticed), "not noticed");
        println!(
            "{reason}: unhealthy {} ms after the fault",
            (self.bench.time_us() - from_us) / MILLISECOND
        );
        self.bench.run_for(10 * SECOND);
        self.assert_announced_once(&format!("Battery 2 unhealthy: {reason}"));
        let frames = self.bench.frames();
        assert_eq!(last_of(&frames, 1).charge_state(), UNHEALTHY);
        assert_ne!(last_of(&frames, 0).charge_state(), UNHEALTHY);
        self.assert_rate_of_others_since(from_us);

        end(self);
        self.bench.run_for(8 * SECOND);
        self.assert_announced_once("Battery 2 healthy again");
        self.assert_announced_once(&format!("Battery 2 unhealthy: {reason}"));
        let frames = self.bench.frames();
        assert_ne!(last_of(&frames, 1).charge_state(), UNHEALTHY);
        assert_eq!(last_of(&frames, 1).sum_of_cells_mv(), 12_000);
        assert_eq!(self.bench.resets().len(), 1, "{:?}", self.bench.resets());
        assert!(self.bench.bus_errors().is_empty());
    }

    fn assert_announced_once(&mut self, text: &str) {
        let texts = texts_of(&self.bench.frames());
        let announced = texts.iter().filter(|announced| *announced == text).count();
        assert_eq!(announced, 1, "{text}: {texts:?}");
    }

    /// Every tick of the first pack is on time, and so is every report of it.
    fn assert_rate_of_others_since(&mut self, from_us: u64) {
        let frames = self.bench.frames_since(from_us);
        let seconds = (self.bench.time_us() - from_us) as f64 / SECOND as f64;
        for instance in [0, 2] {
            let count = statuses_of(&frames, instance).len();
            assert!(
                (count as f64 - 10.0 * seconds).abs() <= 2.0,
                "pack {instance}: {count} in {seconds} s"
            );
        }
        let rates: Vec<_> = self.bench.logged(LogLevel::Info, "samples/s");
        let rates = rates.iter().filter(|(time_us, _)| *time_us > from_us + SECOND);
        for (time_us, line) in rates {
            assert!(line.contains("10 samples/s"), "{time_us}: {line}");
        }
    }

    /// No reading of the third pack, which is on the same bus, was missed since the tick before which the second one's part
    /// was set up: that may take the bus for longer than a tick.
    fn assert_neighbour_is_read(&self) {
        let (set_up_us, _) = self.bench.logged(LogLevel::Info, "battery 2: Healthy")[0];
        let mut missed = self.bench.logged(LogLevel::Warn, "battery 3");
        missed.retain(|(at_us, _)| *at_us > set_up_us + 50 * MILLISECOND);
        assert!(missed.is_empty(), "set up at {set_up_us} us: {missed:?}");
    }
}

#[test]
// Requirement: AP-12, S-7
fn a_part_that_is_unplugged_and_plugged_in_again() {
    let mut faulty = with_monitor();
    faulty.assert_survives(
        "no answer",
        |faulty| faulty.bench.i2c(BUS).detach(MONITOR_AT),
        |faulty| {
            // It lost its supply, and with it what was set.
            faulty.part.borrow_mut().power_cycle();
            let part = Rc::clone(&faulty.part);
            faulty.bench.i2c(BUS).attach(MONITOR_AT, Box::new(part));
        },
    );
    faulty.assert_neighbour_is_read();
}

/// All packs on the bus are lost while it is held; the one on the divider is not.
fn assert_bus_is_held(hold: impl FnOnce(&mut Bench), release: impl FnOnce(&mut Bench)) {
    let mut faulty = with_monitor();
    hold(&mut faulty.bench);
    let from_us = faulty.bench.time_us();
    faulty.bench.run_for(5 * SECOND);
    for pack in [2, 3] {
        faulty.assert_announced_once(&format!("Battery {pack} unhealthy: bus held low"));
    }
    faulty.assert_rate_of_others_since(from_us);
    release(&mut faulty.bench);
    faulty.bench.run_for(8 * SECOND);
    for pack in [2, 3] {
        faulty.assert_announced_once(&format!("Battery {pack} healthy again"));
    }
}

#[test]
// Requirement: AP-12
fn a_line_that_is_held() {
    assert_bus_is_held(
        |bench| bench.i2c(BUS).hold_scl(),
        |bench| bench.i2c(BUS).release_scl(),
    );
    assert_bus_is_held(
        |bench| bench.i2c(BUS).hold_sda(u32::MAX),
        |bench| bench.i2c(BUS).release_sda(),
    );
}

#[test]
fn a_data_line_that_nine_clocks_free_is_no_fault_at_all() {
    let mut faulty = with_monitor();
    faulty.bench.i2c(BUS).hold_sda(9);
    faulty.bench.run_for(5 * SECOND);
    assert!(faulty.bench.logged(LogLevel::Warn, "unhealthy").is_empty());
}

/// The second pack is a smart battery, the third one on a power monitor.
fn with_battery(pec: Pec) -> Faulty<SmartBattery> {
    let part = shared(SmartBattery::new(pec));
    part.borrow_mut().set(12.0, 1.0, 25.0);
    let mut bench = Bench::running(DIVIDER_CODE);
    let mut fine = Ina226::new(0.0005);
    fine.set(11.0, 1.0);
    bench.i2c(BUS).attach(MONITOR_AT, Box::new(fine));
    let parameters = [("BATT2_CELLS", 0.0), ("BATT3_MONITOR", INA2XX)];
    Faulty::of(bench, (SMART_BATTERY, BATTERY_AT), part, &parameters)
}

#[test]
fn a_battery_that_stretches_the_clock_as_far_as_it_may() {
    let mut faulty = with_battery(Pec::Right);
    // 3 ms after each byte: a word takes 18 ms.
    faulty.part.borrow_mut().set_stretch(3 * CYCLES_PER_MS);
    faulty.bench.run_for(5 * SECOND);
    assert!(faulty.bench.logged(LogLevel::Warn, "unhealthy").is_empty());
}

#[test]
fn a_battery_that_hangs_whenever_it_is_asked() {
    let mut faulty = with_battery(Pec::Right);
    faulty.assert_survives(
        "no reading in time",
        |faulty| faulty.part.borrow_mut().set_stretch(50 * CYCLES_PER_MS),
        |faulty| faulty.part.borrow_mut().set_stretch(0),
    );
    let unhealthy = faulty.bench.logged(LogLevel::Warn, "battery 3: unhealthy");
    assert!(unhealthy.is_empty(), "{unhealthy:?}");
}

/// START, address and pointer, RESTART, address and two bytes, STOP.
const BITS_OF_A_READ: u64 = 1 + 18 + 1 + 27 + 1;
const CYCLES_PER_S: u64 = 125_000_000;

fn clock_hz(bench: &mut Bench) -> u64 {
    bench.i2c(BUS).take_transactions();
    bench.run_for(SECOND);
    let transfers = bench.i2c(BUS).take_transactions();
    let shortest = transfers
        .iter()
        .filter(|transfer| transfer.acked && transfer.written.len() == 1 && transfer.read.len() == 2)
        .map(|transfer| transfer.end - transfer.start)
        .min()
        .expect("something is read");
    BITS_OF_A_READ * CYCLES_PER_S / shortest
}

#[test]
fn the_clock_is_as_fast_as_the_slowest_part_stands() {
    let part = shared(Ina226::new(0.0005));
    part.borrow_mut().set(12.0, 1.0);
    let bench = Bench::running(DIVIDER_CODE);
    let mut bench = with_second_pack(bench, (INA2XX, MONITOR_AT), &part, &[]);
    let fast_hz = clock_hz(&mut bench);
    assert!((350_000..=400_000).contains(&fast_hz), "{fast_hz} Hz");

    let battery = SmartBattery::new(Pec::None);
    bench.i2c(BUS).attach(BATTERY_AT, Box::new(battery));
    bench.set("BATT3_MONITOR", SMART_BATTERY);
    bench.reboot();
    let slow_hz = clock_hz(&mut bench);
    assert!((90_000..=100_000).contains(&slow_hz), "{slow_hz} Hz");
}
