//! The wiring that parameters call for, and the tasks that follow pulses and the second serial port, in stepped time: from a
//! pin or a wire to the state of a pack.

use std::cell::RefCell;
use std::convert::Infallible;
use std::future::pending;

use embassy_futures::join::join;
use embassy_time::{Duration, Instant, Timer};
use embedded_hal::digital::ErrorType;
use embedded_hal_async::digital::Wait;
use rover_battmon::autopilot::{Autopilot, Start, Wiring};
use rover_battmon::battery::{BatteryState, Contents, Faults, PackStatus, ReadError, RetainedRecord};
use rover_battmon::pack::Pack;
use rover_battmon::sensor::{
    AnalogIn, AnalogPin, AnalogReadings, BitTiming, DriverEnable, SerialSetup, WantedReadings, Wires,
};
use rover_battmon::tasks::{
    ByteSource, CheckIn, ReceiveError, SeenPulses, SerialLine, Shared, hand_over_pulses, sample_batteries,
    serve_serial, watch_pulses,
};
use rover_battmon::vehicle::ArmState;
use rover_battmon_tools::sim::clock;
use support::commands::RUN_PREARM_CHECKS;
use support::desk::{DIVIDER, Desk, conversions, id_of, start_with};
use support::frames::{last_of, texts_of};
use support::requests::{arm, command_long};
use support::time::SECOND;
use support::vehicle::{OnHost, TestedVehicle};

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
        unimplemented!("no driver waits for it")
    }

    async fn wait_for_falling_edge(&mut self) -> Result<(), Infallible> {
        unimplemented!("no driver waits for it")
    }

    async fn wait_for_any_edge(&mut self) -> Result<(), Infallible> {
        unimplemented!("no driver waits for it")
    }
}

/// Sends `bytes` every `interval_us` until `until_us`, after these errors.
#[derive(Default)]
struct Telemetry {
    errors: Vec<ReceiveError>,
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
        if let Some(error) = self.errors.pop() {
            return Err(error);
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
    fn read(&mut self, _: rover_battmon::time::Instant, _: WantedReadings) -> AnalogReadings {
        AnalogReadings::failed(ReadError::Conversion)
    }
}

/// The state of the second pack with these settings, each second.
fn states(
    seconds: u64,
    settings: &[(&str, f32)],
    pin: Option<PulsedPin>,
    telemetry: Option<Telemetry>,
) -> Vec<BatteryState> {
    let check_ins = [0; 3].map(|_| CheckIn::new("", 600));
    let seen = SeenPulses::new();
    let states = RefCell::new(Vec::new());
    let mut memory = [RetainedRecord::BLANK; 2];
    clock::run_for(Duration::from_millis(seconds * 1000 + 50), async {
        let shared = Shared::new(&start_with(settings));
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

const FLOW: [(&str, f32); 4] = [
    ("BATT2_MONITOR", 11.0),
    ("BATT2_CURR_PIN", 17.0),
    ("BATT2_CAPACITY", 100.0),
    ("BATT2_AMP_PERVLT", 0.5),
];

const MOTOR_CONTROLLER: [(&str, f32); 1] = [("BATT2_MONITOR", 9.0)];

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
    let settings = [
        ("BATT2_MONITOR", 12.0),
        ("BATT2_CURR_PIN", 17.0),
        ("BATT2_CAPACITY", 2000.0),
    ];
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
        ..Telemetry::default()
    };
    let states = states(8, &MOTOR_CONTROLLER, None, Some(telemetry));
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
fn errors_on_the_line_do_not_end_its_reading() {
    let telemetry = Telemetry {
        // For 3.2 s.
        errors: [ReceiveError::LineError, ReceiveError::BytesLost(3)].repeat(50),
        bytes: FRAME.to_vec(),
        interval_us: 32_000,
        until_us: u64::MAX,
    };
    let states = states(5, &MOTOR_CONTROLLER, None, Some(telemetry));
    let statuses = [2, 4].map(|second: usize| states[second - 1].status);
    assert_eq!(statuses, [PackStatus::Unhealthy, PackStatus::Healthy]);
    assert_eq!(states[1].readings.voltage_v, None, "never heard");
}

#[test]
fn what_is_wired_follows_the_parameters() {
    const NOT_SET_UP: &str = "port not set up";
    const PIN_TAKEN: &str = "pin already in use";
    const SILENT: &str = "no reading in time";
    let (nothing, none) = (Autopilot::new(&Start::default()).wiring(), &[][..]);
    let bus = |crystal_mhz, bit_rate| Wiring {
        can: Some(BitTiming::new(crystal_mhz, bit_rate).expect("a timing")),
        ..nothing
    };
    let port = |baud, wires, driver_enable| Wiring {
        serial: Some(SerialSetup {
            baud,
            wires,
            driver_enable,
        }),
        ..nothing
    };
    let pulses = Wiring {
        uses_pulses: true,
        ..nothing
    };
    let part = Wiring {
        uses_spi_part: true,
        ..nothing
    };
    let part_and_motor = Wiring {
        serial: port(19_200, Wires::OneWire, DriverEnable::Gp22).serial,
        ..part
    };
    let esc = port(115_200, Wires::ReceiveOnly, DriverEnable::None);
    let engine = port(115_200, Wires::BothWays, DriverEnable::None);
    let generator = port(9_600, Wires::ReceiveOnly, DriverEnable::None);
    let protocol = |number: f32| ("SERIAL1_PROTOCOL", number);
    let (can, slow_crystal) = (("CAN_P1_DRIVER", 1.0), ("CAN_P1_CRYSTAL", 8.0));
    let half_rate = ("CAN_P1_BITRATE", 500_000.0);
    let (fuel_cell, richen_power) = (("GEN_TYPE", 2.0), ("GEN_TYPE", 3.0));
    let (motor, its_driver) = (("TRQD1_TYPE", 1.0), ("TRQD1_DE_PIN", 22.0));
    let third = |kind: f32| ("BATT3_MONITOR", kind);
    for (kind, more, wiring, reason) in [
        (8.0, none, nothing, NOT_SET_UP),
        (8.0, &[can], bus(16, 1_000_000), SILENT),
        (8.0, &[can, slow_crystal], nothing, NOT_SET_UP),
        (8.0, &[can, slow_crystal, half_rate], bus(8, 500_000), SILENT),
        (9.0, &[protocol(30.0)], nothing, NOT_SET_UP),
        (9.0, &[protocol(30.0), can], bus(16, 1_000_000), SILENT),
        (9.0, &[protocol(16.0)], esc, SILENT),
        (12.0, none, pulses, SILENT),
        (12.0, &[can], bus(16, 1_000_000), PIN_TAKEN),
        (11.0, &[can], bus(16, 1_000_000), PIN_TAKEN),
        (17.0, none, nothing, NOT_SET_UP),
        (17.0, &[protocol(30.0)], nothing, NOT_SET_UP),
        (18.0, &[protocol(30.0)], nothing, NOT_SET_UP),
        (17.0, &[protocol(30.0), fuel_cell], generator, SILENT),
        (18.0, &[protocol(30.0), fuel_cell], generator, SILENT),
        // RichenPower's generator has no tank.
        (
            18.0,
            &[protocol(30.0), richen_power, third(17.0)],
            generator,
            NOT_SET_UP,
        ),
        (23.0, none, nothing, NOT_SET_UP),
        (26.0, none, part, SILENT),
        (
            26.0,
            &[protocol(39.0), motor, its_driver, third(23.0)],
            part_and_motor,
            PIN_TAKEN,
        ),
        (27.0, none, nothing, NOT_SET_UP),
        (27.0, &[protocol(24.0), ("EFI_TYPE", 1.0)], engine, SILENT),
    ] {
        let own = [
            ("BATT2_MONITOR", kind),
            ("BATT2_CURR_PIN", 17.0),
            ("BATT2_CAPACITY", 100.0),
        ];
        let mut desk = Desk::starting(start_with(&[&own[..], more].concat()));
        assert_eq!(desk.autopilot.wiring(), wiring, "{kind} {more:?}");
        desk.autopilot.open(&mut desk.endpoint);
        for _ in 0..60 {
            desk.now_us += 100_000;
            desk.sample(AnalogReadings::NONE);
        }
        desk.post_due(desk.now_us);
        let texts = texts_of(&desk.sent());
        let announced = |text: &str| texts.iter().any(|other| other == text);
        assert!(
            announced(&format!("Battery 2 unhealthy: {reason}")),
            "{kind} {more:?}: {texts:?}"
        );
        let is_too_slow = more == [can, slow_crystal];
        assert_eq!(
            announced("CAN off: 1 Mbit/s needs a 16 MHz crystal"),
            is_too_slow,
            "{texts:?}"
        );
    }
}

/// A vehicle with these parameters and a device at its second serial port.
fn with_device(parameters: &[(&str, f32)]) -> OnHost {
    OnHost::with_stored(parameters.iter().map(|(name, value)| (id_of(name), *value)))
}

#[test]
// Requirement: AP-9
fn a_generator_and_its_tank_are_measured_and_it_says_that_it_runs() {
    let mut vehicle = with_device(&[
        ("BATT2_MONITOR", 17.0),
        ("BATT3_MONITOR", 18.0),
        ("BATT3_CAPACITY", 100.0),
        ("SERIAL1_PROTOCOL", 30.0),
        ("GEN_TYPE", 2.0),
    ]);
    for _ in 0..8 {
        // The figures of the maker's manual of the FCPM, section 7.4, with an emptier tank: 100 W into the battery.
        vehicle.board().serial.send(b"<152.5,48.7,1600,1700,100,2,0>\n");
        vehicle.run_for(SECOND / 2);
    }
    let frames = vehicle.frames_since(0);
    let output = last_of(&frames, 1);
    assert_eq!((output.voltage_mv(0), output.current_ca()), (48_700, -205));
    let tank = last_of(&frames, 2);
    assert_eq!((tank.remaining_pct(), tank.consumed_mah()), (50, 50));
    assert_eq!(tank.voltage_mv(0), u16::MAX, "a tank has none");
    let mut running = texts_of(&frames);
    running.retain(|text| text.starts_with("Fuel cell"));
    assert_eq!(running, ["Fuel cell running"]);
}

#[test]
// Requirement: AP-9
fn an_engine_takes_what_its_injectors_let_through() {
    const REQUEST_BYTES: usize = 13;
    let mut vehicle = with_device(&[
        ("BATT2_MONITOR", 27.0),
        ("BATT2_CAPACITY", 2000.0),
        ("SERIAL1_PROTOCOL", 24.0),
        ("EFI_TYPE", 1.0),
        // cm³ a minute for each percent of duty cycle, and less this.
        ("EFI_COEF1", 0.8),
        ("EFI_COEF2", 2.0),
    ]);
    let mut answered = 0;
    let mut run_at = |speed_rpm: u16, seconds: u64| {
        // 24 ms of injection.
        let [high, low] = speed_rpm.to_be_bytes();
        let content = [0, 0x5d, 0xc0, 0x5a, 0x5a, high, low];
        let mut crc = flate2::Crc::new();
        crc.update(&content);
        let answer = [&[0, 7][..], &content, &crc.sum().to_be_bytes()].concat();
        for _ in 0..1_000 * seconds {
            vehicle.run_for(1_000);
            let requests = vehicle.board().serial.sent().len() / REQUEST_BYTES;
            if requests > answered {
                answered = requests;
                vehicle.board().serial.send(&answer);
            }
        }
        (answered, vehicle.frames_since(0))
    };
    // In each 20 ms: 120 %, so 94 cm³ a minute.
    let (requests, frames) = run_at(3000, 20);
    assert!(requests.abs_diff(200) <= 3, "{requests} requests");
    let tank = last_of(&frames, 1);
    // 5.64 l/h, 31.3 ml in 20 s.
    assert!(tank.current_ca().abs_diff(564) <= 1, "{} cl/h", tank.current_ca());
    assert!(
        (30..=32).contains(&tank.consumed_mah()),
        "{} ml",
        tank.consumed_mah()
    );
    assert_eq!((tank.remaining_pct(), tank.voltage_mv(0)), (98, u16::MAX));
    let (_, frames) = run_at(90, 2);
    assert_eq!(last_of(&frames, 1).current_ca(), 0);
}

#[test]
// Requirement: S-5
fn a_pin_that_is_read_as_a_voltage_is_no_current_or_level_and_refuses_arming() {
    let first = [("BATT_MONITOR", 3.0), ("BATT_CELLS", 3.0)];
    let second = |kind: f32, pin: &'static str, gpio: f32| {
        [("BATT2_MONITOR", kind), (pin, gpio), ("BATT2_CAPACITY", 2000.0)]
    };
    let (voltage_pin, current_pin, level_pin) = ("BATT2_VOLT_PIN", "BATT2_CURR_PIN", "BATT2_FL_PIN");
    let none = [("BATT_CAPACITY", 3300.0)];
    let third = [("BATT3_MONITOR", 31.0), ("BATT3_CURR_PIN", 28.0)];
    // The state of the second pack: its voltage, current and level, and whether its pin is taken.
    for (settings, more, voltage, rest, is_taken) in [
        (second(3.0, voltage_pin, 26.0), &none[..], true, false, false),
        (second(31.0, current_pin, 27.0), &none, false, true, false),
        (second(31.0, current_pin, 26.0), &none, false, false, true),
        (
            second(4.0, current_pin, 27.0),
            &[(voltage_pin, 26.0)],
            true,
            true,
            false,
        ),
        // The voltage goes on.
        (
            second(4.0, current_pin, 26.0),
            &[(voltage_pin, 26.0)],
            true,
            false,
            true,
        ),
        (
            second(4.0, current_pin, 27.0),
            &[(voltage_pin, 27.0)],
            true,
            false,
            true,
        ),
        (second(24.0, level_pin, 28.0), &none, false, true, false),
        (second(24.0, level_pin, 26.0), &none, false, false, true),
        (second(24.0, level_pin, 28.0), &third, false, false, true),
    ] {
        let mut desk = Desk::starting(start_with(&[&first[..], &settings, more].concat()));
        let mut readings = AnalogReadings::NONE;
        for (pin, pin_v) in [
            (AnalogPin::Gp26, 3.1),
            (AnalogPin::Gp27, 1.5),
            (AnalogPin::Gp28, 1.5),
        ] {
            readings.set(pin, Ok(conversions(pin_v)));
        }
        for _ in 0..20 {
            desk.now_us += 100_000;
            desk.sample(readings);
        }
        let measured = desk.autopilot.battery(Pack::Second).readings;
        let has_rest = measured.current_a.is_some() || measured.fuel_l_h.is_some();
        let has_level = measured.remaining_pct.is_some() && measured.voltage_v.is_none();
        assert_eq!(measured.voltage_v.is_some(), voltage, "{settings:?} {measured:?}");
        assert_eq!(has_rest || has_level, rest, "{settings:?} {measured:?}");
        desk.ask(&arm());
        desk.receive_in_chunks(&command_long(RUN_PREARM_CHECKS, 0.0), 64);
        let texts = texts_of(&desk.sent());
        let refused = texts.iter().filter(|text| text.contains("pin already in use"));
        assert_eq!(refused.count(), usize::from(is_taken), "{settings:?} {texts:?}");
        assert_eq!(desk.autopilot.battery(Pack::First).status, PackStatus::Healthy);
    }
}

#[test]
// Requirement: AP-4
fn a_sum_has_no_part_in_another_and_one_in_a_mask_refuses_arming() {
    let (own, other_sum, third, fourth) = (1.0, 2.0, 4.0, 8.0);
    for (mask, members, is_refused) in [
        (0.0, 0b1100, false),
        (own + third, 0b0100, false),
        (third + fourth, 0b1100, false),
        (other_sum + third, 0b0100, true),
    ] {
        let mut desk = Desk::starting(start_with(&[
            ("BATT_MONITOR", 10.0),
            ("BATT_SUM_MASK", mask),
            ("BATT2_MONITOR", 10.0),
            ("BATT2_SUM_MASK", third + fourth),
            ("BATT3_MONITOR", 3.0),
            ("BATT3_VOLT_PIN", 26.0),
            ("BATT4_MONITOR", 3.0),
            ("BATT4_VOLT_PIN", 26.0),
        ]));
        let mut readings = AnalogReadings::NONE;
        readings.set(AnalogPin::Gp26, Ok(conversions(3.0)));
        for _ in 0..20 {
            desk.now_us += 100_000;
            desk.sample(readings);
        }
        let members_of = |pack| desk.autopilot.battery(pack).members;
        assert_eq!(
            [Pack::First, Pack::Second].map(members_of),
            [members, 0b1100],
            "{mask}"
        );
        desk.receive_in_chunks(&command_long(RUN_PREARM_CHECKS, 0.0), 64);
        let texts = texts_of(&desk.sent());
        let refused = texts
            .iter()
            .filter(|text| *text == "PreArm: Battery 1 sums another sum");
        assert_eq!(refused.count(), usize::from(is_refused), "{mask} {texts:?}");
    }
}

#[test]
// Requirement: S-5
fn servo_pulses_and_a_flow_at_the_same_pin_are_neither() {
    let both = [
        ("BATT_MONITOR", 11.0),
        ("BATT_CURR_PIN", 17.0),
        ("BATT_AMP_PERVLT", 0.5),
        ("BATT_CAPACITY", 100.0),
        ("BATT2_MONITOR", 12.0),
        ("BATT2_CAPACITY", 2000.0),
    ];
    for (pin, are_taken) in [(17.0, true), (-1.0, false)] {
        let pins = [("BATT2_CURR_PIN", pin)];
        let mut desk = Desk::starting(start_with(&[&both[..], &pins].concat()));
        for _ in 0..20 {
            desk.now_us += 100_000;
            desk.sample(AnalogReadings::NONE);
        }
        let error = |pack| desk.autopilot.battery(pack).read_error;
        let taken = Some(ReadError::PinTaken);
        assert_eq!(
            [Pack::First, Pack::Second].map(|pack| error(pack) == taken),
            [are_taken; 2]
        );
        if are_taken {
            // Another pin is set: at once it is a flow.
            desk.set(id_of("BATT2_CURR_PIN"), -1.0);
            desk.now_us += 100_000;
            desk.sample(AnalogReadings::NONE);
            assert_eq!(desk.autopilot.battery(Pack::First).read_error, None);
        }
    }
}

#[test]
// Requirement: L-21
fn a_hot_pack_is_hot_until_its_thermometer_reads_less_or_is_taken_away() {
    let hot = || {
        let mut desk = Desk::starting(start_with(&[
            ("BATT_MONITOR", 3.0),
            ("BATT_CELLS", 3.0),
            ("BATT2_MONITOR", 10.0),
            ("BATT2_CELLS", 3.0),
            ("BATT2_SUM_MASK", 1.0),
            ("TEMP1_TYPE", 5.0),
            ("TEMP1_PIN", 28.0),
            ("TEMP1_SRC", 3.0),
            ("TEMP1_SRC_ID", 1.0),
            ("TEMP1_A1", 100.0),
        ]));
        assert!(is_too_hot_at(&mut desk, 0.7));
        desk
    };
    let mut desk = hot();
    // Beyond the range, with a broken lead, and cool.
    for (pin_v, is_too_hot) in [(1.56, true), (3.3, true), (0.3, false)] {
        assert_eq!(is_too_hot_at(&mut desk, pin_v), is_too_hot, "{pin_v} V");
    }
    for (name, value) in [("TEMP1_TYPE", 0.0), ("TEMP1_SRC", 0.0), ("TEMP1_SRC_ID", 3.0)] {
        let mut desk = hot();
        assert!(is_too_hot_at(&mut desk, 1.56));
        desk.set(id_of(name), value);
        assert!(!is_too_hot_at(&mut desk, 1.56), "{name}");
    }
}

/// Whether the first pack and its sum, not one of them, are too hot after some seconds with this voltage at the thermometer.
fn is_too_hot_at(desk: &mut Desk, pin_v: f32) -> bool {
    let mut readings = AnalogReadings::NONE;
    readings.set(AnalogPin::Gp26, Ok(conversions(11.4 / DIVIDER)));
    readings.set(AnalogPin::Gp28, Ok(conversions(pin_v)));
    for _ in 0..50 {
        desk.now_us += 100_000;
        desk.sample(readings);
    }
    let [pack, sum] = [Pack::First, Pack::Second].map(|pack| {
        let faults = desk.autopilot.battery(pack).readings.faults;
        faults.contains(Faults::OVER_TEMPERATURE)
    });
    assert_eq!(pack, sum);
    pack
}

/// Neither the reading with the pull before nor one with the pull that it has from now on.
#[test]
// Requirement: AP-30
fn a_pin_whose_pull_changes_has_no_reading_in_that_tick() {
    let mut desk = Desk::starting(start_with(&[]));
    let mut readings = AnalogReadings::NONE;
    readings.set(AnalogPin::Gp26, Ok(conversions(2.0)));
    readings.set(AnalogPin::Gp28, Ok(conversions(1.0)));
    desk.sample(readings);
    for (name, value) in [
        ("TEMP1_TYPE", 5.0),
        ("TEMP1_PIN", 28.0),
        ("TEMP1_SRC", 3.0),
        ("TEMP1_SRC_ID", 1.0),
        ("TEMP1_A0", 25.0),
    ] {
        desk.set(id_of(name), value);
    }
    let temperature_c = |desk: &mut Desk| {
        desk.now_us += 100_000;
        desk.sample(readings);
        desk.autopilot.battery(Pack::First).temperature_c
    };
    assert_eq!(temperature_c(&mut desk), None);
    assert_eq!(temperature_c(&mut desk), Some(25.0));
}
