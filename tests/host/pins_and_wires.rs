//! The tasks that follow pulses and a motor controller's telemetry, in stepped time: from a pin or a wire to the state of a
//! pack.

use std::cell::RefCell;
use std::convert::Infallible;
use std::future::pending;

use embassy_futures::join::join;
use embassy_time::{Duration, Instant, Timer};
use embedded_hal::digital::ErrorType;
use embedded_hal_async::digital::Wait;
use rover_battmon::autopilot::Start;
use rover_battmon::battery::{BatteryState, Contents, PackStatus, ReadError, RetainedRecord};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, Parameters};
use rover_battmon::sensor::{AdcCount, AnalogIn, AnalogPin};
use rover_battmon::tasks::{
    ByteSource, CheckIn, ReceiveError, SeenPulses, SerialLine, Shared, hand_over_pulses, serve_serial,
    watch_pulses,
};
use rover_battmon::vehicle::ArmState;
use rover_battmon_tools::sim::{clock, sample_batteries};

const MONITOR: BatteryParameter = BatteryParameter::Monitor;
const CURR_PIN: BatteryParameter = BatteryParameter::CurrPin;
const CAPACITY: BatteryParameter = BatteryParameter::Capacity;
const AMP_PERVLT: BatteryParameter = BatteryParameter::AmpPervlt;

/// A pin that is high for `width_us` in each `period_us`, from `first_us` until `until_us`.
#[derive(Clone, Copy)]
struct PulsedPin {
    first_us: u64,
    until_us: u64,
    width_us: u64,
    period_us: u64,
}

impl PulsedPin {
    /// When the pin changes next, and whether it is high until then.
    fn level(&self, now_us: u64) -> (bool, Option<u64>) {
        if now_us < self.first_us {
            return (false, Some(self.first_us));
        }
        if now_us >= self.until_us {
            return (false, None);
        }
        let phase_us = (now_us - self.first_us) % self.period_us;
        if phase_us < self.width_us {
            (true, Some(now_us + self.width_us - phase_us))
        } else {
            (false, Some(now_us + self.period_us - phase_us))
        }
    }

    async fn wait_for(&self, wanted: bool) -> Result<(), Infallible> {
        loop {
            match self.level(Instant::now().as_micros()) {
                (is_high, _) if is_high == wanted => return Ok(()),
                (_, Some(next_us)) => Timer::at(Instant::from_micros(next_us)).await,
                (_, None) => pending().await,
            }
        }
    }
}

impl ErrorType for PulsedPin {
    type Error = Infallible;
}

impl Wait for PulsedPin {
    async fn wait_for_high(&mut self) -> Result<(), Infallible> {
        self.wait_for(true).await
    }

    async fn wait_for_low(&mut self) -> Result<(), Infallible> {
        self.wait_for(false).await
    }

    async fn wait_for_rising_edge(&mut self) -> Result<(), Infallible> {
        self.wait_for(false).await?;
        self.wait_for(true).await
    }

    async fn wait_for_falling_edge(&mut self) -> Result<(), Infallible> {
        self.wait_for(true).await?;
        self.wait_for(false).await
    }

    async fn wait_for_any_edge(&mut self) -> Result<(), Infallible> {
        unimplemented!("no driver waits for it")
    }
}

/// Sends `bytes` every `interval_us` until `until_us`.
struct Telemetry {
    bytes: Vec<u8>,
    interval_us: u64,
    until_us: u64,
}

impl ByteSource for Telemetry {
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        Timer::after_micros(self.interval_us).await;
        if Instant::now().as_micros() > self.until_us {
            pending::<()>().await;
        }
        buffer[..self.bytes.len()].copy_from_slice(&self.bytes);
        Ok(self.bytes.len())
    }
}

impl SerialLine for Telemetry {
    async fn send(&mut self, _: &[u8]) {
        unimplemented!("nothing is sent to a motor controller")
    }
}

/// A converter that no test reads.
struct NoConverter;

impl AnalogIn for NoConverter {
    async fn convert(&mut self, _: AnalogPin) -> Result<AdcCount, ReadError> {
        Err(ReadError::Conversion)
    }
}

/// The state of the second pack with these settings, each second.
fn states(
    seconds: u64,
    settings: &[(BatteryParameter, f32)],
    pin: Option<PulsedPin>,
    telemetry: Option<Telemetry>,
) -> Vec<BatteryState> {
    let mut parameters = Parameters::defaults();
    for (parameter, value) in settings {
        parameters.set(parameter.of(Pack::Second), *value).unwrap();
    }
    let check_ins = [0; 3].map(|_| CheckIn::new("", 600));
    let seen = SeenPulses::new();
    let states = RefCell::new(Vec::new());
    let mut memory = [RetainedRecord::BLANK; 2];
    clock::run_for(Duration::from_millis(seconds * 1000 + 50), async {
        let shared = Shared::new(&Start::with_parameters(parameters));
        let watch = async {
            loop {
                Timer::after_secs(1).await;
                states
                    .borrow_mut()
                    .push(shared.with(|autopilot| *autopilot.battery(Pack::Second)));
                let now_us = Instant::now().as_micros() as u32;
                assert!(
                    check_ins
                        .iter()
                        .all(|check_in| !check_in.is_overdue(ArmState::Disarmed, now_us))
                );
            }
        };
        let drivers = join(
            hand_over_pulses(pin.is_some().then_some(&seen), &shared, &check_ins[0]),
            serve_serial(telemetry, &shared, &check_ins[1]),
        );
        let watch_pin = async {
            match pin {
                Some(pin) => watch_pulses(pin, &seen).await,
                None => pending().await,
            }
        };
        let battery = sample_batteries(NoConverter, &mut memory, &shared, &check_ins[2]);
        join(join(drivers, watch_pin), join(battery, watch)).await
    });
    states.take()
}

const FLOW: [(BatteryParameter, f32); 4] = [
    (MONITOR, 11.0),
    (CURR_PIN, 17.0),
    (CAPACITY, 100.0),
    (AMP_PERVLT, 0.5),
];

#[test]
fn what_flows_through_a_sensor_is_missing_from_the_tank() {
    // 10 Hz of 0.5 ml for 10 s: 18 l/h.
    let pin = PulsedPin {
        first_us: 1_005_000,
        until_us: 11_000_000,
        width_us: 5_000,
        period_us: 100_000,
    };
    let states = states(30, &FLOW, Some(pin), None);
    let last = states.last().unwrap();
    assert_eq!(
        (last.status, last.contents),
        (PackStatus::Healthy, Contents::Fuel)
    );
    assert_eq!(
        (last.consumed_ml(), last.readings.fuel_l_h),
        (Some(50.0), Some(0.0))
    );
    assert!((last.readings.remaining_pct.unwrap() - 50.0).abs() < 0.01);
    assert_eq!((last.readings.voltage_v, last.consumed_wh), (None, None));
    let flowing = &states[5];
    assert!(
        (flowing.readings.fuel_l_h.unwrap() - 18.0).abs() < 0.01,
        "{flowing:?}"
    );
}

#[test]
fn pulses_that_are_short_or_fast_are_counted() {
    let pin = PulsedPin {
        first_us: 1_000_000,
        until_us: 3_000_000,
        width_us: 20,
        period_us: 1_000,
    };
    let states = states(5, &FLOW, Some(pin), None);
    assert_eq!(states[4].consumed_ml(), Some(1000.0));
    assert_eq!(states[4].readings.remaining_pct, Some(0.0));
}

#[test]
fn what_is_high_at_the_start_is_no_pulse() {
    let pin = PulsedPin {
        first_us: 0,
        until_us: 2_000_000,
        width_us: 2_000_000,
        period_us: 2_000_000,
    };
    let states = states(5, &FLOW, Some(pin), None);
    assert_eq!(states[4].consumed_ml(), Some(0.0));
}

#[test]
fn the_width_of_pulses_is_the_level_and_silence_is_unhealthy() {
    let settings = [(MONITOR, 12.0), (CURR_PIN, 17.0), (CAPACITY, 2000.0)];
    let pin = PulsedPin {
        first_us: 3_000_000,
        until_us: 10_000_000,
        width_us: 1_300,
        period_us: 20_000,
    };
    let states = states(15, &settings, Some(pin), None);
    assert_eq!(states[1].status, PackStatus::Unhealthy, "nothing yet");
    assert_eq!(states[5].status, PackStatus::Healthy);
    assert_eq!(states[5].readings.remaining_pct, Some(25.0));
    assert_eq!(states[5].consumed_ml(), Some(1500.0));
    // A quarter of a second until the level is not known, and half a second more until that counts.
    assert_eq!(states[9].status, PackStatus::Healthy);
    assert_eq!(states[10].status, PackStatus::Unhealthy);
    assert_eq!(states[10].readings.remaining_pct, Some(25.0), "the last good one");
}

/// 25 °C, 16.80 V, 12.34 A, 300 mAh.
const FRAME: [u8; 10] = [0x19, 0x06, 0x90, 0x04, 0xd2, 0x01, 0x2c, 0x00, 0x64, 0x97];

#[test]
fn an_esc_reports_voltage_current_and_temperature_until_it_times_out() {
    let telemetry = Telemetry {
        bytes: FRAME.to_vec(),
        interval_us: 32_000,
        until_us: 5_000_000,
    };
    let states = states(8, &[(MONITOR, 9.0)], None, Some(telemetry));
    let working = &states[3];
    assert_eq!(working.status, PackStatus::Healthy);
    assert!((working.readings.voltage_v.unwrap() - 16.8).abs() < 1e-3);
    assert!((working.readings.current_a.unwrap() - 12.34).abs() < 1e-3);
    assert_eq!(working.temperature_c, Some(25.0));
    assert_eq!(
        working.consumed_mah(),
        Some(0.0),
        "its own counter stands, so nothing is integrated"
    );
    assert_eq!(states[4].status, PackStatus::Healthy);
    assert_eq!(states[5].status, PackStatus::Unhealthy);
}

#[test]
fn a_motor_controller_that_was_never_heard_is_unhealthy() {
    let telemetry = Telemetry {
        bytes: vec![0x55; 10],
        interval_us: 32_000,
        until_us: u64::MAX,
    };
    let states = states(3, &[(MONITOR, 9.0)], None, Some(telemetry));
    assert_eq!(states[1].status, PackStatus::Unhealthy);
    assert_eq!(states[1].readings.voltage_v, None);
}

#[test]
fn with_neither_pulses_nor_telemetry_only_the_packs_are_unhealthy() {
    let silent = || Telemetry {
        bytes: FRAME.to_vec(),
        interval_us: 32_000,
        until_us: 0,
    };
    for settings in [&[(MONITOR, 12.0), (CURR_PIN, 17.0)][..], &[(MONITOR, 9.0)]] {
        let states = states(5, settings, None, Some(silent()));
        assert_eq!(states[4].status, PackStatus::Unhealthy);
    }
}
