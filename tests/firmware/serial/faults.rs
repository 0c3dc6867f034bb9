//! Faults on the serial line: each makes the packs that are measured by it unhealthy, is announced once, is recovered from, and
//! delays no other pack.

use super::{
    BAUD, LARGE_FUEL_CELL, PORT, RICHEN_POWER, protocol_4, report, richen_power, send, with_generator,
};
use emulator::{LogLevel, Random};
use support::charge_states::UNHEALTHY;
use support::frames::{BATTERY_STATUS, BatteryStatus, last_of, of_message, texts_of};
use workbench::bench::{Bench, MILLISECOND, SECOND};

/// A generator and what it reports.
struct Faulty {
    bench: Bench,
    fine: Vec<u8>,
    /// Of the second pack then, in millivolts.
    voltage_mv: u16,
}

fn fuel_cell() -> Faulty {
    Faulty::new(
        LARGE_FUEL_CELL,
        protocol_4("48,6.1,49.9,1200,1300,0,-499,2,0,0,"),
        49_900,
    )
}

fn richen() -> Faulty {
    Faulty::new(RICHEN_POWER, richen_power(0, 4995, 1234), 49_950)
}

impl Faulty {
    fn new(kind: f32, fine: Vec<u8>, voltage_mv: u16) -> Self {
        let mut bench = with_generator(kind);
        report(&mut bench, &fine, 6);
        let faulty = Self {
            bench,
            fine,
            voltage_mv,
        };
        assert!(faulty.unhealthy().is_empty());
        faulty
    }

    fn unhealthy(&self) -> Vec<(u64, String)> {
        self.bench.logged(LogLevel::Warn, "battery 2: unhealthy")
    }

    /// `fault` lasts for ten seconds, half a second each time. The second pack becomes unhealthy, and healthy again when it has
    /// ended; both are announced once, and the first pack keeps its rate.
    fn assert_survives(mut self, mut fault: impl FnMut(&mut Bench)) {
        let from_us = self.bench.time_us();
        for _ in 0..20 {
            let end_us = self.bench.time_us() + 500 * MILLISECOND;
            fault(&mut self.bench);
            let remaining_us = end_us - self.bench.time_us();
            self.bench.run_for(remaining_us);
        }
        let unhealthy = self.unhealthy();
        assert_eq!(unhealthy.len(), 1, "{unhealthy:?}");
        println!("unhealthy after {} ms", (unhealthy[0].0 - from_us) / MILLISECOND);
        let frames = self.bench.frames();
        assert_eq!(last_of(&frames, 1).charge_state(), UNHEALTHY);
        self.assert_rate_of_first_since(from_us);

        report(&mut self.bench, &self.fine, 20);
        let frames = self.bench.frames();
        assert_eq!(last_of(&frames, 1).voltage_mv(0), self.voltage_mv);
        assert_ne!(last_of(&frames, 1).charge_state(), UNHEALTHY);
        let texts = texts_of(&frames);
        for text in [
            "Battery 2 unhealthy: no reading in time",
            "Battery 2 healthy again",
        ] {
            let count = texts.iter().filter(|announced| *announced == text).count();
            assert_eq!(count, 1, "{text}: {texts:?}");
        }
        // The restart that the parameters needed.
        assert_eq!(self.bench.resets().len(), 1, "{:?}", self.bench.resets());
        assert!(self.bench.bus_errors().is_empty());
    }

    fn assert_rate_of_first_since(&mut self, from_us: u64) {
        let frames = self.bench.frames_since(from_us);
        let reports = of_message(&frames, BATTERY_STATUS);
        let first = reports
            .iter()
            .filter(|frame| BatteryStatus(frame).instance() == 0);
        let seconds = (self.bench.time_us() - from_us) as f64 / SECOND as f64;
        let count = first.count() as f64;
        assert!((count - 10.0 * seconds).abs() <= 2.0, "{count} in {seconds} s");
    }
}

#[test]
fn silence() {
    fuel_cell().assert_survives(|_| {});
    richen().assert_survives(|_| {});
}

#[test]
fn open_line() {
    let mut faulty = fuel_cell();
    faulty.bench.disconnect_uart_receiver(PORT);
    faulty.assert_survives(|_| {});
}

#[test]
fn line_held_low() {
    // A break of 300 ms.
    let hold = |bench: &mut Bench| {
        let now_us = bench.time_us();
        bench.uart_send_at_baud(PORT, now_us, &[0], 30);
    };
    fuel_cell().assert_survives(hold);
    richen().assert_survives(hold);
}

#[test]
fn wrong_baud() {
    for faulty in [fuel_cell(), richen()] {
        let fine = faulty.fine.clone();
        faulty.assert_survives(|bench| {
            let now_us = bench.time_us();
            bench.uart_send_at_baud(PORT, now_us, &fine, 57_600);
        });
    }
}

#[test]
fn frames_that_are_too_short_or_too_long() {
    for faulty in [fuel_cell(), richen()] {
        let place = faulty.fine.len() / 2;
        let mut short = faulty.fine.clone();
        short.remove(place);
        let mut long = faulty.fine.clone();
        long.insert(place, b',');
        let mut turn = [short, long].into_iter().cycle();
        faulty.assert_survives(|bench| send(bench, &turn.next().unwrap()));
    }
}

#[test]
fn wrong_checksum() {
    for (faulty, place) in [(fuel_cell(), 3), (richen(), 4)] {
        let mut wrong = faulty.fine.clone();
        wrong[place] ^= 1;
        faulty.assert_survives(|bench| send(bench, &wrong));
    }
}

#[test]
fn nothing_but_noise() {
    for faulty in [fuel_cell(), richen()] {
        let mut random = Random::new(7);
        faulty.assert_survives(|bench| {
            let mut noise = [0; 480];
            random.fill(&mut noise);
            send(bench, &noise);
        });
    }
}

#[test]
fn noise_between_frames_costs_none_of_them() {
    for mut faulty in [fuel_cell(), richen()] {
        let mut random = Random::new(3);
        for _ in 0..20 {
            let mut noise = [0; 20];
            random.fill(&mut noise);
            let now_us = faulty.bench.time_us();
            let end_us = faulty.bench.uart_send_at_baud(PORT, now_us, &noise, BAUD);
            faulty.bench.uart_send_at_baud(PORT, end_us, &faulty.fine, BAUD);
            faulty.bench.run_for(500 * MILLISECOND);
        }
        assert!(faulty.unhealthy().is_empty());
        let frames = faulty.bench.frames();
        assert_eq!(last_of(&frames, 1).voltage_mv(0), faulty.voltage_mv);
    }
}
