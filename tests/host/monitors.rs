//! Every kind of monitor: whatever its source does, and whatever is set, its pack is measured, not connected, or unhealthy.

use proptest::prelude::*;
use rover_battmon::battery::{
    BatteryState, BusError, Contents, FailsafeLevel, Measurement, PackStatus, ReadError,
};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, Range, VehicleParameter};
use rover_battmon::sensor::{
    AnalogPin, AnalogReadings, CanEvent, CanFrame, ControllerReading, DroneCan, EngineReading, Pulses,
    SerialReading,
};
use rover_battmon::time::Instant;
use rover_battmon::vehicle::SideDrives;
use support::commands::{ACCEPTED, BATTERY_RESET, PREFLIGHT_STORAGE, RESET};
use support::desk::{DIVIDER, Desk, conversions, start_with};
use support::frames::texts_of;
use support::pack_report::{PackReport, UNKNOWN_MV};
use support::requests::{arm, command_long, command_long_2, do_set_mode, manual_control, param_set};
use support::time::SECOND;
use workbench::can::Transfer;
use workbench::can::transfers::{A, A_LATER, MODULE};

const TICK_US: u64 = 100_000;

/// A pack may become unhealthy this much later than after its time-out.
const MARGIN_US: u64 = SECOND;

const MANUAL: f32 = 0.0;
const HOLD: f32 = 2.0;

/// `BATT_MONITOR` of kinds that are fed in a way of their own; the others are parts on a bus.
const ANALOG_VOLTAGE: i32 = 3;
const ANALOG: i32 = 4;
const DRONECAN: i32 = 8;
const ESC: i32 = 9;
const SUM: i32 = 10;
const FUEL_FLOW: i32 = 11;
const FUEL_LEVEL_PWM: i32 = 12;
const GENERATOR: i32 = 17;
const GENERATOR_FUEL: i32 = 18;
const TORQEEDO: i32 = 23;
const FUEL_LEVEL_ANALOG: i32 = 24;
const SYNTHETIC: i32 = 25;
const EFI: i32 = 27;
const AD7091R5: i32 = 28;
const EXTERNAL: i32 = 29;
const ANALOG_CURRENT: i32 = 31;

/// Every value of `BATT_MONITOR` but 0.
fn kinds() -> Vec<i32> {
    let Range::OneOf(choices) = BatteryParameter::Monitor.row().range else {
        panic!("a list of kinds");
    };
    choices
        .iter()
        .map(|(number, _)| *number)
        .filter(|number| *number != 0)
        .collect()
}

/// For how long a pack of this kind may be without a reading.
fn timeout_us(kind: i32) -> u64 {
    match kind {
        DRONECAN | GENERATOR | GENERATOR_FUEL | TORQEEDO => 5 * SECOND,
        EXTERNAL => 2 * SECOND,
        EFI => SECOND,
        FUEL_LEVEL_PWM => 250_000,
        // Its member's, until that is unhealthy.
        SUM => TICK_US + 500_000,
        _ => TICK_US,
    }
}

/// Whether a reading without a voltage is a failed one.
fn measures_voltage(kind: i32) -> bool {
    ![
        SUM,
        FUEL_FLOW,
        FUEL_LEVEL_PWM,
        FUEL_LEVEL_ANALOG,
        GENERATOR,
        GENERATOR_FUEL,
        EFI,
        AD7091R5,
        ANALOG_CURRENT,
    ]
    .contains(&kind)
}

/// The behaviour of a source in a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Does {
    /// It reports 12.5 V, or 12.25 V, or a level.
    Measures,
    MeasuresLess,
    /// Its pack is unplugged, which it reports.
    HasNoPack,
    LosesVoltage,
    ReportsNan,
    ReportsTooMuch,
    Fails,
    Nothing,
}

const VOLTAGE_V: f32 = 12.5;
const LOWER_V: f32 = 12.25;

/// The expectation of a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fed {
    Measured,
    NoPack,
    /// No reading, or one that is not valid.
    Nothing,
}

impl Does {
    /// The expectation of a tick with this behaviour, for a pack of this kind.
    fn feeds(self, kind: i32) -> Fed {
        match self {
            // A flow may be none.
            _ if kind == FUEL_FLOW => Fed::Measured,
            Self::Measures | Self::MeasuresLess => Fed::Measured,
            Self::Fails | Self::Nothing => Fed::Nothing,
            // A duty cycle that is not a number is not a flow.
            _ if kind == EFI => Fed::Measured,
            Self::ReportsNan => Fed::Nothing,
            // It is a level.
            _ if kind == GENERATOR_FUEL => Fed::Measured,
            Self::HasNoPack => match kind {
                SUM | FUEL_LEVEL_PWM => Fed::Nothing,
                ANALOG_CURRENT | FUEL_LEVEL_ANALOG => Fed::Measured,
                _ => Fed::NoPack,
            },
            Self::LosesVoltage if [GENERATOR, AD7091R5].contains(&kind) => Fed::Measured,
            Self::LosesVoltage | Self::ReportsTooMuch => Fed::Nothing,
        }
    }

    /// The report of an electric sensor: of one that is read, or that reports by itself.
    fn reading(self) -> Option<Result<Measurement, ReadError>> {
        let voltage_v = match self {
            Self::Measures => Some(VOLTAGE_V),
            Self::MeasuresLess => Some(LOWER_V),
            Self::HasNoPack => Some(0.0),
            Self::LosesVoltage => None,
            Self::ReportsNan => Some(f32::NAN),
            Self::ReportsTooMuch => Some(5e6),
            Self::Fails => return Some(Err(BusError::NoAnswer.into())),
            Self::Nothing => return None,
        };
        Some(Ok(Measurement {
            voltage_v,
            current_a: Some(1.0),
            ..Measurement::default()
        }))
    }
}

/// A rover whose first pack is of a kind, with all that measures it.
struct Rig {
    desk: Desk,
    kind: i32,
    bus: Option<DroneCan>,
    transfers: u8,
    pulses: Pulses,
    /// The driver pushes the stick in each tick.
    drives: bool,
}

impl Rig {
    fn new(kind: i32) -> Self {
        let mut named = vec![
            ("BATT_MONITOR", kind as f32),
            ("BATT_CURR_PIN", 27.0),
            ("BATT_CAPACITY", 2000.0),
            ("BATT_FS_UNH_ACT", HOLD),
            // Batteries have their own cells here.
            ("BATT_ARM_VOLT", 0.0),
        ];
        named.extend(match kind {
            DRONECAN => vec![("CAN_P1_DRIVER", 1.0)],
            ESC => vec![("SERIAL1_PROTOCOL", 16.0)],
            SUM => vec![("BATT2_MONITOR", ANALOG_VOLTAGE as f32), ("BATT_SUM_MASK", 2.0)],
            FUEL_FLOW | FUEL_LEVEL_PWM => vec![("BATT_CURR_PIN", 17.0)],
            FUEL_LEVEL_ANALOG => vec![("BATT_FL_PIN", 28.0)],
            GENERATOR | GENERATOR_FUEL => vec![("SERIAL1_PROTOCOL", 30.0), ("GEN_TYPE", 2.0)],
            TORQEEDO => vec![("SERIAL1_PROTOCOL", 39.0), ("TRQD1_TYPE", 1.0)],
            EFI => vec![("SERIAL1_PROTOCOL", 24.0), ("EFI_TYPE", 1.0), ("EFI_COEF1", 1.0)],
            _ => vec![],
        });
        let desk = Desk::starting(start_with(&named));
        let bus = desk
            .autopilot
            .can_setup()
            .map(|setup| DroneCan::new(setup, Instant::EPOCH));
        Self {
            desk,
            kind,
            bus,
            transfers: 0,
            pulses: Pulses::NONE,
            drives: false,
        }
    }

    fn state(&self) -> &BatteryState {
        self.desk.autopilot.battery(Pack::First)
    }

    /// A tick in which its source does this.
    fn tick(&mut self, does: Does) -> Fed {
        self.desk.now_us += TICK_US;
        if self.drives {
            let stick = manual_control(1, 0, 600);
            self.desk.receive_in_chunks(&stick, 64);
        }
        if let Some(bus) = &mut self.bus {
            let (settings, now) = (self.desk.autopilot.can_settings(), self.desk.now());
            bus.poll(&settings, now, |event| {
                self.desk.autopilot.add_can_event(&event, now)
            });
        }
        self.feed(does);
        self.desk.drive();
        does.feeds(self.kind)
    }

    fn ticks(&mut self, duration_us: u64, does: Does) {
        for _ in 0..duration_us / TICK_US {
            self.tick(does);
        }
    }

    /// Samples with what the source does.
    fn feed(&mut self, does: Does) {
        let mut pins = AnalogReadings::NONE;
        let now = self.desk.now();
        match self.kind {
            ANALOG_VOLTAGE | ANALOG | SYNTHETIC | SUM | ANALOG_CURRENT | FUEL_LEVEL_ANALOG => {
                for pin in AnalogPin::ALL {
                    pins.set(pin, self.converted_v(does).map(conversions));
                }
            }
            FUEL_FLOW | FUEL_LEVEL_PWM => self.pulses(does),
            DRONECAN => self.battery_on_the_bus(does),
            EXTERNAL => self.companion(does),
            ESC | GENERATOR | GENERATOR_FUEL | TORQEEDO | EFI => {
                if let Some(reading) = self.reported(does) {
                    self.desk.autopilot.add_serial_reading(reading, now);
                }
            }
            _ => {
                if let Some(reading) = does.reading() {
                    self.desk.autopilot.add_bus_reading(Pack::First, reading, now);
                }
            }
        }
        self.desk.sample(pins);
    }

    /// A converter has a code, or fails.
    fn converted_v(&self, does: Does) -> Result<f32, ReadError> {
        let has_voltage = ![ANALOG_CURRENT, FUEL_LEVEL_ANALOG].contains(&self.kind);
        match does {
            Does::Measures => Ok(VOLTAGE_V / DIVIDER),
            Does::MeasuresLess => Ok(LOWER_V / DIVIDER),
            Does::HasNoPack => Ok(if has_voltage { 0.0 } else { 1.0 }),
            Does::Nothing => Err(ReadError::Timeout),
            _ => Err(ReadError::Conversion),
        }
    }

    /// Pulses have a width, or there are none.
    fn pulses(&mut self, does: Does) {
        let width_us = match does {
            Does::Measures => Some(1500),
            Does::MeasuresLess => Some(1400),
            Does::ReportsTooMuch => Some(3000),
            _ => None,
        };
        for pulse in 0..4 {
            if let Some(width_us) = width_us {
                let rise = self.desk.now().before_us((4 - pulse) * 20_000);
                self.pulses.rise(rise);
                self.pulses.fall(rise.after_us(width_us));
            }
        }
        self.desk.autopilot.set_pulses(self.pulses);
    }

    fn battery_on_the_bus(&mut self, does: Does) {
        match does {
            Does::Measures => self.receive(&A),
            Does::MeasuresLess => self.receive(&A_LATER),
            _ => {
                if let Some(Ok(measurement)) = does.reading() {
                    let event = CanEvent::Reading(Pack::First, measurement);
                    self.desk.autopilot.add_can_event(&event, self.desk.now());
                }
            }
        }
    }

    fn receive(&mut self, transfer: &Transfer) {
        let now = self.desk.now();
        self.transfers = self.transfers.wrapping_add(1) & 0x1f;
        for frame in frames(transfer, self.transfers) {
            let deliver = |event| self.desk.autopilot.add_can_event(&event, now);
            self.bus.as_mut().expect("a bus").receive(&frame, now, deliver);
        }
    }

    fn companion(&mut self, does: Does) {
        let mut report = PackReport::of_voltage(0, (VOLTAGE_V * 1000.0) as u16);
        report.current_ca = 100;
        match does {
            Does::Measures => {}
            Does::MeasuresLess => report.voltages_mv[0] = (LOWER_V * 1000.0) as u16,
            Does::HasNoPack => report.voltages_mv[0] = 0,
            Does::LosesVoltage | Does::ReportsNan => report.voltages_mv[0] = UNKNOWN_MV,
            Does::ReportsTooMuch => report.consumed_mah = i32::MAX,
            Does::Fails | Does::Nothing => return,
        }
        self.desk.receive_in_chunks(&report.frame(), 64);
    }

    /// Devices on the serial line report by themselves, and some know no voltage.
    fn reported(&self, does: Does) -> Option<SerialReading> {
        let measurement = does.reading()?.ok()?;
        let or_nan = |number| {
            if does == Does::ReportsNan {
                f32::NAN
            } else {
                number
            }
        };
        Some(match self.kind {
            ESC => SerialReading::Controller(ControllerReading {
                voltage_v: measurement.voltage_v,
                current_a: measurement.current_a,
                ..ControllerReading::default()
            }),
            GENERATOR => SerialReading::GeneratorElectrical(measurement),
            TORQEEDO => SerialReading::Torqeedo(measurement),
            GENERATOR_FUEL => SerialReading::GeneratorFuel(Measurement {
                contents: Contents::Fuel,
                state_of_charge: Some(or_nan(0.5)),
                ..Measurement::default()
            }),
            _ => SerialReading::Efi(EngineReading {
                injection_ms: or_nan(2.0),
                speed_rpm: 3000,
            }),
        })
    }

    fn announced(&mut self) -> Vec<String> {
        self.desk.post_due(self.desk.now_us);
        texts_of(&self.desk.sent())
    }

    /// Asserts that this tick's reading is shown.
    fn assert_measured(&self, does: Does) {
        let state = self.state();
        assert_eq!(state.status, PackStatus::Healthy, "kind {}: {state:?}", self.kind);
        if measures_voltage(self.kind) {
            let volts = if does == Does::Measures {
                VOLTAGE_V
            } else {
                LOWER_V
            };
            let measured_v = state.readings.voltage_v.expect("a voltage");
            assert!((measured_v - volts).abs() < 0.01, "kind {}: {state:?}", self.kind);
        }
    }
}

/// The frames of a transfer with this transfer id, which is in the last byte of each.
fn frames(transfer: &Transfer, transfer_id: u8) -> Vec<CanFrame> {
    let frame = |(id, data): &(u32, &[u8])| {
        let mut data = data.to_vec();
        *data.last_mut().unwrap() |= transfer_id;
        CanFrame::new(*id, &data).unwrap()
    };
    transfer.0.iter().map(frame).collect()
}

/// A change while the rover runs. Not before the next start does it affect how packs are measured.
#[derive(Clone, Copy, Debug)]
enum Change {
    /// Another kind.
    Kind,
    /// No kind at all.
    Disabled,
    /// The connections of its source.
    Wiring,
    /// Every parameter is at its default: command 245.
    Defaults,
}

impl Change {
    fn apply(self, rig: &mut Rig) {
        let other = if rig.kind == ANALOG_VOLTAGE {
            DRONECAN
        } else {
            ANALOG_VOLTAGE
        };
        let settings = match self {
            Self::Kind => vec![("BATT_MONITOR", other as f32)],
            Self::Disabled => vec![("BATT_MONITOR", 0.0)],
            Self::Wiring => vec![
                ("CAN_P1_DRIVER", 0.0),
                ("CAN_P1_BITRATE", 125_000.0),
                ("CAN_D1_UC_NODE", 77.0),
                ("SERIAL1_PROTOCOL", 0.0),
                ("GEN_TYPE", 3.0),
                ("EFI_TYPE", 0.0),
                ("TRQD1_TYPE", 2.0),
                ("BATT_I2C_ADDR", 33.0),
                ("BATT_CHANNEL", 3.0),
            ],
            Self::Defaults => {
                rig.desk.ask(&command_long(PREFLIGHT_STORAGE, RESET));
                vec![]
            }
        };
        for (name, value) in settings {
            rig.desk.ask(&param_set(name, value));
        }
    }
}

#[test]
// Requirement: S-4, S-11
fn changed_settings_never_freeze_a_pack() {
    for kind in kinds() {
        for change in [Change::Kind, Change::Disabled, Change::Wiring, Change::Defaults] {
            for drives in [false, true] {
                // Refused while armed; and it puts a pin that acts at once elsewhere.
                let is_reset = matches!(change, Change::Defaults);
                let has_own_pin = [
                    ANALOG,
                    FUEL_FLOW,
                    FUEL_LEVEL_PWM,
                    FUEL_LEVEL_ANALOG,
                    ANALOG_CURRENT,
                ];
                if is_reset
                    && (drives || has_own_pin.contains(&kind) || [SUM, EFI, GENERATOR_FUEL].contains(&kind))
                {
                    continue;
                }
                let mut rig = Rig::new(kind);
                rig.ticks(3 * SECOND, Does::Measures);
                rig.assert_measured(Does::Measures);
                if drives {
                    let result = rig.desk.result_of(&arm());
                    assert_eq!(result, ACCEPTED, "kind {kind}: {:?}", rig.announced());
                    rig.desk.ask(&do_set_mode(MANUAL));
                    rig.desk.receive_in_chunks(&manual_control(1, 0, 0), 64);
                    rig.drives = true;
                    rig.ticks(SECOND, Does::Measures);
                    assert_ne!(rig.desk.drive(), SideDrives::COAST);
                }
                change.apply(&mut rig);
                // The measuring goes on.
                rig.ticks(2 * timeout_us(kind) + MARGIN_US, Does::MeasuresLess);
                rig.assert_measured(Does::MeasuresLess);
                if kind == FUEL_FLOW {
                    continue;
                }
                rig.ticks(timeout_us(kind) + MARGIN_US, Does::Nothing);
                let case = format!("kind {kind}, {change:?}, drives: {drives}");
                assert_eq!(rig.state().status, PackStatus::Unhealthy, "{case}");
                if drives {
                    rig.ticks(5 * SECOND, Does::Nothing);
                    assert_eq!(rig.state().failsafe, FailsafeLevel::Unhealthy, "{case}");
                } else {
                    rig.ticks(SECOND, Does::Nothing);
                    assert_ne!(rig.desk.result_of(&arm()), ACCEPTED, "{case}");
                }
            }
        }
    }
}

#[test]
// Requirement: S-1
fn packs_are_unhealthy_when_they_always_were_and_not_before() {
    for kind in kinds().into_iter().filter(|kind| *kind != FUEL_FLOW) {
        let mut rig = Rig::new(kind);
        rig.ticks(2 * SECOND, Does::Measures);
        let before = timeout_us(kind) / TICK_US;
        rig.ticks(before * TICK_US, Does::Nothing);
        rig.assert_measured(Does::Measures);
        rig.ticks(500_000, Does::Nothing);
        assert_eq!(rig.state().status, PackStatus::Unhealthy, "kind {kind}");
        let texts = rig.announced();
        let is_text = |text: &String| text.starts_with("Battery 1 unhealthy: ");
        assert_eq!(
            texts.iter().filter(|text| is_text(text)).count(),
            1,
            "kind {kind}: {texts:?}"
        );
        let mut unheard = Rig::new(kind);
        unheard.ticks(timeout_us(kind) + SECOND, Does::Nothing);
        assert_eq!(unheard.state().status, PackStatus::Unhealthy, "kind {kind}");
    }
}

#[test]
// Requirement: S-2
fn reading_without_the_voltage_that_its_kind_measures_is_a_failed_one() {
    for kind in kinds() {
        let has_voltage_by_itself = [ANALOG_VOLTAGE, ANALOG, SYNTHETIC].contains(&kind);
        if !measures_voltage(kind) || has_voltage_by_itself {
            continue;
        }
        let mut rig = Rig::new(kind);
        rig.ticks(2 * SECOND, Does::Measures);
        rig.announced();
        rig.ticks(timeout_us(EXTERNAL) + SECOND, Does::LosesVoltage);
        let state = *rig.state();
        assert_eq!((state.status, kind), (PackStatus::Unhealthy, kind));
        // A report of a component without a voltage is not a reading.
        let reason = if kind == EXTERNAL {
            "no reading in time"
        } else {
            "impossible value"
        };
        assert_eq!(
            rig.announced(),
            [format!("Battery 1 unhealthy: {reason}")],
            "kind {kind}"
        );
    }
}

#[test]
fn charge_of_a_module_that_knows_none_is_estimated_here() {
    let mut rig = Rig::new(DRONECAN);
    for _ in 0..20 * SECOND / TICK_US {
        rig.receive(&MODULE);
        rig.tick(Does::Nothing);
        assert_ne!(rig.state().readings.remaining_pct, Some(0.0));
    }
    let readings = &rig.state().readings;
    assert_eq!(readings.voltage_v, Some(VOLTAGE_V));
    // Three resting cells of 4.17 V.
    let remaining_pct = readings.remaining_pct.expect("an estimate");
    assert!(remaining_pct > 80.0, "{remaining_pct} %");
}

fn any_step() -> impl Strategy<Value = (Does, u8, Option<Change>)> {
    let does = prop::sample::select(vec![
        Does::Measures,
        Does::MeasuresLess,
        Does::HasNoPack,
        Does::LosesVoltage,
        Does::ReportsNan,
        Does::ReportsTooMuch,
        Does::Fails,
        Does::Nothing,
    ]);
    // Pins act at once; they are another property's.
    let change = prop::option::weighted(
        0.2,
        prop::sample::select(vec![Change::Kind, Change::Disabled, Change::Wiring]),
    );
    // Up to seven seconds.
    (does, prop_oneof![4 => 1..4u8, 1 => 1..70u8], change)
}

proptest! {
    #[test]
    // Requirement: S-1
    fn whatever_a_source_does_its_pack_is_measured_not_connected_or_unhealthy(
        kind in prop::sample::select(kinds()),
        steps in prop::collection::vec(any_step(), 1..40),
    ) {
        let mut rig = Rig::new(kind);
        let mut last = (Fed::Measured, 0);
        for (does, ticks, change) in steps {
            if let Some(change) = change {
                change.apply(&mut rig);
            }
            for _ in 0..ticks {
                let fed = rig.tick(does);
                if fed != Fed::Nothing {
                    last = (fed, rig.desk.now_us);
                }
                let is_in_time = |since_us| rig.desk.now_us - since_us <= timeout_us(kind) + MARGIN_US;
                match rig.state().status {
                    PackStatus::Unhealthy => prop_assert_ne!(fed, Fed::Measured),
                    PackStatus::Healthy => prop_assert!(is_in_time(last.1) && last.0 == Fed::Measured),
                    PackStatus::NotConnected => prop_assert!(is_in_time(last.1) && last.0 == Fed::NoPack),
                    PackStatus::Unknown => prop_assert!(is_in_time(0)),
                    PackStatus::Disabled => prop_assert!(false, "it is monitored"),
                }
            }
        }
    }
}

#[test]
fn packs_that_are_not_on_the_boards_divider_are_announced_once_above_what_the_drivers_stand() {
    const TOO_HIGH: &str = "Battery 1 voltage above MOT_DRV_VOLT";
    let on_divider = [ANALOG_VOLTAGE, ANALOG, SYNTHETIC];
    for (kind, pin) in kinds()
        .into_iter()
        .map(|kind| (kind, 26.0))
        .chain([(ANALOG, 28.0)])
    {
        let mut rig = Rig::new(kind);
        rig.desk.set(BatteryParameter::VoltPin.of(Pack::First), pin);
        rig.desk.set(VehicleParameter::MotDrvVolt, LOWER_V - 0.5);
        let endpoint = &mut rig.desk.endpoint;
        rig.desk.autopilot.open(endpoint);
        let mut texts = Vec::new();
        for does in [Does::Measures, Does::MeasuresLess, Does::Fails, Does::Measures] {
            rig.ticks(3 * SECOND, does);
            texts.extend(rig.announced());
        }
        let announced = texts.iter().filter(|text| *text == TOO_HIGH).count();
        let refused = texts_of(&rig.desk.ask(&arm())).contains(&format!("Arm: {TOO_HIGH}"));
        let has_voltage = rig.state().readings.voltage_v.is_some();
        assert!(has_voltage || !measures_voltage(kind), "{kind}");
        let is_on_divider = on_divider.contains(&kind) && pin == 26.0;
        assert_eq!(refused, is_on_divider, "{kind}, GP{pin}");
        let is_announced = has_voltage && !is_on_divider && kind != SUM;
        assert_eq!(announced, usize::from(is_announced), "{kind}, GP{pin}: {texts:?}");
    }
}

#[test]
// Requirement: S-4
fn a_kind_that_is_set_while_driving_acts_after_the_restart_alone() {
    const INA2XX: f32 = 21.0;
    for kind in [0.0, SUM as f32, SYNTHETIC as f32] {
        let mut desk = Desk::starting(start_with(&[
            ("BATT_MONITOR", INA2XX),
            ("BATT_CELLS", 3.0),
            ("BATT_LOW_MAH", 3290.0),
            ("BATT_FS_LOW_ACT", HOLD),
        ]));
        let tick = |desk: &mut Desk| {
            desk.now_us += TICK_US;
            let measured = Measurement {
                voltage_v: Some(12.5),
                current_a: Some(10.0),
                ..Measurement::default()
            };
            let now = desk.now();
            desk.autopilot.add_bus_reading(Pack::First, Ok(measured), now);
            desk.sample(AnalogReadings::NONE);
        };
        tick(&mut desk);
        desk.ask(&command_long_2(BATTERY_RESET, 1.0, 100.0));
        for request in [arm(), do_set_mode(MANUAL)] {
            assert_eq!(desk.result_of(&request), ACCEPTED);
        }
        desk.ask(&param_set("BATT_MONITOR", kind));
        // 10 mAh are drawn in 3.6 s.
        for _ in 0..30 {
            tick(&mut desk);
        }
        assert_eq!(
            desk.autopilot.battery(Pack::First).failsafe,
            FailsafeLevel::None,
            "{kind}"
        );
        for _ in 0..20 {
            tick(&mut desk);
        }
        assert_eq!(
            desk.autopilot.battery(Pack::First).failsafe,
            FailsafeLevel::Low,
            "{kind}"
        );
        desk.drive();
        assert_eq!(desk.vehicle().drives(), SideDrives::BRAKE, "{kind}");
    }
}
