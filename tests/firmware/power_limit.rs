//! The power limit of a pack, at the pins of the motors: a simulated pack supplies them by the square of their duties.

use std::cell::RefCell;
use std::rc::Rc;

use crate::rover::{CUSTOM_MODE_ENABLED, MANUAL, VEHICLE_ID};
use crate::wheels::duties;
use emulator::i2c_devices::{Ina226, RegisterMap};
use support::frames::texts_of;
use support::monitor_types::INA2XX;
use support::motor_poles::motors;
use support::requests::{arm, manual_control, set_mode};
use workbench::bench::{Bench, DIVIDER_CODE, MILLISECOND, SECOND};
use workbench::i2c_bus::{BUS, shared};

const MONITOR_AT: u8 = 0x40;

const PACK_V: f64 = 11.4;
const LIMIT_W: f64 = 20.0;

struct Limited {
    bench: Bench,
    monitor: Rc<RefCell<RegisterMap<Ina226>>>,
    /// All motors at full duty.
    full_w: f64,
}

impl Limited {
    /// Armed in MANUAL.
    fn new() -> Self {
        let monitor = shared(Ina226::new(0.0005));
        let mut bench = Bench::running(DIVIDER_CODE);
        bench.i2c(BUS).attach(MONITOR_AT, Box::new(Rc::clone(&monitor)));
        bench.set_all(&[
            ("BATT_MONITOR", INA2XX),
            ("BATT_CELLS", 3.0),
            ("BATT_WATT_MAX", LIMIT_W as f32),
        ]);
        monitor.borrow_mut().set(PACK_V, 0.0);
        bench.reboot();
        bench.run_for(2 * SECOND);
        bench.ask(&arm());
        bench.ask(&set_mode(VEHICLE_ID, CUSTOM_MODE_ENABLED, MANUAL));
        let full_w = 52.0;
        let mut rover = Self {
            bench,
            monitor,
            full_w,
        };
        rover.steer_for(1, 0, 0);
        rover
    }

    /// Power of the motors without a limit.
    fn assert_unlimited(&mut self, steering: i16, throttle: i16) {
        let unlimited = self.steer_for(2, steering, throttle);
        let most_w = unlimited.iter().copied().fold(0.0, f64::max);
        assert!(most_w > 1.5 * LIMIT_W, "{most_w} W");
    }

    fn drawn_w(&self) -> f64 {
        let share = |motor| {
            let (positive, negative) = duties(motor, &self.bench);
            (positive - negative).powi(2)
        };
        self.full_w * motors().map(share).sum::<f64>() / motors().count() as f64
    }

    /// The power every 100 ms.
    fn steer_for(&mut self, seconds: u64, steering: i16, throttle: i16) -> Vec<f64> {
        let mut powers = Vec::new();
        for step in 0..50 * seconds {
            let drawn_w = self.drawn_w();
            if step % 5 == 0 {
                powers.push(drawn_w);
                let request = manual_control(VEHICLE_ID, steering, throttle);
                self.bench.send(&request);
            }
            self.monitor.borrow_mut().set(PACK_V, drawn_w / PACK_V);
            self.bench.run_for(20 * MILLISECOND);
        }
        powers
    }

    /// Within five seconds the power is the limit, and stays so.
    fn assert_limited(&mut self, steering: i16, throttle: i16) {
        self.steer_for(5, steering, throttle);
        let limited = self.steer_for(5, steering, throttle);
        assert!(
            limited
                .iter()
                .all(|power_w| (power_w / LIMIT_W - 1.0).abs() < 0.05),
            "{limited:.1?}"
        );
    }

    fn announced(&mut self, text: &str) -> usize {
        let texts = texts_of(&self.bench.frames());
        texts.iter().filter(|announced| announced.contains(text)).count()
    }
}

#[test]
// Requirement: AP-28
fn straight_ahead_a_pack_supplies_its_limit_and_all_again_when_the_load_falls() {
    let mut rover = Limited::new();
    rover.assert_unlimited(0, 1000);
    rover.assert_limited(0, 1000);
    assert_eq!(rover.announced("Battery 1 limits the motors: over 20W"), 1);
    // Downhill.
    rover.full_w = 15.0;
    let released = rover.steer_for(6, 0, 1000);
    assert_eq!(released.last(), Some(&15.0), "{released:.1?}");
    rover.full_w = 52.0;
    rover.assert_limited(0, 1000);
    assert_eq!(rover.announced("limits the motors"), 1);
    assert_eq!(rover.announced("fault"), 0);
}

#[test]
// Requirement: AP-28
fn turning_on_the_spot_is_limited_too() {
    let mut rover = Limited::new();
    rover.assert_unlimited(1000, 0);
    rover.assert_limited(1000, 0);
    rover.assert_limited(-1000, 0);
}

#[test]
// Requirement: AP-28
fn a_wire_that_breaks_while_driving_holds_the_limit() {
    let mut rover = Limited::new();
    rover.assert_limited(0, 1000);
    let held_w = rover.drawn_w();
    rover.bench.i2c(BUS).detach(MONITOR_AT);
    let held = rover.steer_for(10, 0, 1000);
    assert!(
        held.iter().all(|power_w| (power_w / held_w - 1.0).abs() < 0.03),
        "{held:.1?}"
    );
    assert_eq!(rover.announced("Battery 1 unhealthy"), 1);
}
