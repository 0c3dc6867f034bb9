//! The parameters each pack has of its own.

#[cfg(not(target_os = "none"))]
use super::{Documentation, TakesEffect};
use super::{Kind, Parameter, Range, means};
use crate::sensor::MONITOR_CHOICES;

/// The analog pins of the board, by GPIO number.
const ANALOG_PINS: Range = Range::OneOf(&[
    (-1, means("none")),
    (26, means("GP26")),
    (27, means("GP27")),
    (28, means("GP28")),
    (29, means("GP29")),
]);

/// The same, and the pins of a converter on the bus, by ArduPilot's numbers.
const VOLTAGE_PINS: Range = Range::OneOf(&[
    (-1, means("none")),
    (26, means("GP26")),
    (27, means("GP27")),
    (28, means("GP28")),
    (29, means("GP29")),
    (50, means("AD7091R-5, channel 0")),
    (51, means("AD7091R-5, channel 1")),
    (52, means("AD7091R-5, channel 2")),
    (53, means("AD7091R-5, channel 3")),
]);

/// The same, and the pin for pulses.
const CURRENT_PINS: Range = Range::OneOf(&[
    (-1, means("none")),
    (17, means("GP17, pulses")),
    (26, means("GP26")),
    (27, means("GP27")),
    (28, means("GP28")),
    (29, means("GP29")),
    (50, means("AD7091R-5, channel 0")),
    (51, means("AD7091R-5, channel 1")),
    (52, means("AD7091R-5, channel 2")),
    (53, means("AD7091R-5, channel 3")),
]);

/// What ArduPilot's Rover can do about a battery.
const FAILSAFE_ACTIONS: Range = Range::OneOf(&[
    (0, means("Warn only")),
    (1, means("RTL")),
    (2, means("Hold")),
    (3, means("SmartRTL")),
    (4, means("SmartRTL or Hold")),
    (5, means("Terminate")),
    (6, means("Loiter or Hold")),
]);

parameters! {
    /// A parameter that each pack has of its own.
    BatteryParameter

    Monitor {
        key: 64,
        name: "MONITOR",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(MONITOR_CHOICES),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AfterReboot,
        label: "Battery monitoring",
        description: "How the pack is monitored. While it is 0, the pack's other parameters are not listed.",
    }
    VoltPin {
        key: 65,
        name: "VOLT_PIN",
        kind: Kind::Int8,
        default: 26.0,
        range: VOLTAGE_PINS,
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Battery voltage pin",
        description: "The GPIO number of the analog pin that senses the battery's voltage. \
                      The Freenove board has its divider on GP26.",
    }
    VoltMult {
        key: 66,
        name: "VOLT_MULT",
        kind: Kind::Real32,
        default: 3.95,
        range: Range::Between(0.1, 100.0),
        step: 0.01,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Voltage multiplier",
        description: "The battery's voltage divided by the voltage at the pin. To calibrate, multiply it by the voltage \
                      a multimeter shows and divide by the one reported.",
    }
    VltOffset {
        key: 67,
        name: "VLT_OFFSET",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-3.3, 3.3),
        step: 0.01,
        unit: "V",
        takes_effect: TakesEffect::AtOnce,
        label: "Voltage offset",
        description: "The voltage at the pin when the battery's voltage is zero.",
    }
    Capacity {
        key: 68,
        name: "CAPACITY",
        kind: Kind::Int32,
        default: 3300.0,
        range: Range::Between(0.0, 1_000_000.0),
        step: 50.0,
        unit: "mAh",
        takes_effect: TakesEffect::AtOnce,
        label: "Capacity",
        description: "The charge the full pack holds; of a tank, the millilitres. 0: not known.",
    }
    CurrPin {
        key: 69,
        name: "CURR_PIN",
        kind: Kind::Int8,
        default: -1.0,
        range: CURRENT_PINS,
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Battery current pin",
        description: "The GPIO number of the analog pin that a current sensor is wired to. The Freenove board has no \
                      current sensor. GP17 is for the pulses of a fuel sensor (FuelFlow, FuelLevelPWM), and for nothing else.",
    }
    AmpPervlt {
        key: 70,
        name: "AMP_PERVLT",
        kind: Kind::Real32,
        default: 17.0,
        range: Range::Between(-1000.0, 1000.0),
        step: 0.1,
        unit: "A/V",
        takes_effect: TakesEffect::AtOnce,
        label: "Current sensor's scale",
        description: "How many amperes one volt at the current pin stands for. For FuelFlow: how many millilitres one pulse \
                      stands for.",
    }
    AmpOffset {
        key: 71,
        name: "AMP_OFFSET",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-3.3, 3.3),
        step: 0.001,
        unit: "V",
        takes_effect: TakesEffect::AtOnce,
        label: "Current sensor's offset",
        description: "The voltage at the current pin while no current flows.",
    }
    Options {
        key: 72,
        name: "OPTIONS",
        kind: Kind::Int32,
        default: 0.0,
        range: Range::Bits(&[
            (6, means("Send resting voltage to ground stations")),
            (8, means("Internal use only")),
            (9, means("Sum uses the lowest voltage")),
        ]),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Options",
        description: "What is done differently for this pack. The resting voltage is the one the pack would have without \
                      load. A pack for internal use is monitored but not reported. The last option is for a sum of packs: \
                      it takes their lowest voltage instead of the mean.",
    }
    SerialNum {
        key: 73,
        name: "SERIAL_NUM",
        kind: Kind::Int32,
        default: -1.0,
        // Every whole number up to there is a float.
        range: Range::Between(-1.0, 16_777_215.0),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Serial number",
        description: "A number to tell this pack from others of its kind. -1: none.",
    }
    SumMask {
        key: 74,
        name: "SUM_MASK",
        kind: Kind::Int16,
        default: 0.0,
        range: Range::Bits(&[
            (0, means("pack 1")),
            (1, means("pack 2")),
            (2, means("pack 3")),
            (3, means("pack 4")),
            (4, means("pack 5")),
            (5, means("pack 6")),
            (6, means("pack 7")),
            (7, means("pack 8")),
            (8, means("pack 9")),
        ]),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Packs of a sum",
        description: "The packs that a sum of packs adds up. 0: all with a higher number than its own.",
    }
    MaxVolt {
        key: 75,
        name: "MAX_VOLT",
        kind: Kind::Real32,
        default: 12.6,
        range: Range::Between(7.0, 100.0),
        step: 0.1,
        unit: "V",
        takes_effect: TakesEffect::AtOnce,
        label: "Voltage when full",
        description: "The full pack's voltage without load, from which a synthetic current is estimated.",
    }
    Chem {
        key: 76,
        name: "CHEM",
        kind: Kind::Int8,
        default: 1.0,
        range: Range::OneOf(&[(1, means("LiPo")), (2, means("LiFe")), (3, means("Li-ion")), (4, means("NiMH"))]),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Chemistry",
        description: "What the cells are made of. (ArduPilot has no such parameter.)",
    }
    Cells {
        key: 77,
        name: "CELLS",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::Between(0.0, 16.0),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Cells in series",
        description: "How many cells are in series. 0: taken from the voltage at rest, for LiPo and Li-ion only. \
                      (ArduPilot has no such parameter.)",
    }
    LowTimer {
        key: 78,
        name: "LOW_TIMER",
        kind: Kind::Int8,
        default: 10.0,
        range: Range::Between(0.0, 120.0),
        step: 1.0,
        unit: "s",
        takes_effect: TakesEffect::AtOnce,
        label: "Time until a low voltage counts",
        description: "How long the voltage has to stay below a threshold before the pack counts as low or critical. \
                      0 turns both voltage thresholds off.",
    }
    FsVoltsrc {
        key: 79,
        name: "FS_VOLTSRC",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("Raw Voltage")), (1, means("Sag Compensated Voltage"))]),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Voltage for the thresholds",
        description: "Whether the voltage thresholds look at the voltage as it is measured, or at the one the pack would \
                      have without load.",
    }
    LowVolt {
        key: 80,
        name: "LOW_VOLT",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 120.0),
        step: 0.1,
        unit: "V",
        takes_effect: TakesEffect::AtOnce,
        label: "Low voltage",
        description: "Below this voltage for longer than LOW_TIMER, while the rover is armed, the pack is low: FS_LOW_ACT \
                      says what happens then. Below it at any moment, the rover does not arm. 0 turns it off.",
    }
    LowMah {
        key: 81,
        name: "LOW_MAH",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 1_000_000.0),
        step: 50.0,
        unit: "mAh",
        takes_effect: TakesEffect::AtOnce,
        label: "Low charge",
        description: "With less charge left than this, while the rover is armed, the pack is low: FS_LOW_ACT says what \
                      happens then. It does not arm with less, either. 0 turns it off.",
    }
    CrtVolt {
        key: 82,
        name: "CRT_VOLT",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 120.0),
        step: 0.1,
        unit: "V",
        takes_effect: TakesEffect::AtOnce,
        label: "Critical voltage",
        description: "Below this voltage for longer than LOW_TIMER, while the rover is armed, the pack is critical: FS_CRT_ACT \
                      says what happens then. Below it at any moment, the rover does not arm. 0 turns it off.",
    }
    CrtMah {
        key: 83,
        name: "CRT_MAH",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 1_000_000.0),
        step: 50.0,
        unit: "mAh",
        takes_effect: TakesEffect::AtOnce,
        label: "Critical charge",
        description: "With less charge left than this, while the rover is armed, the pack is critical: FS_CRT_ACT says what \
                      happens then. It does not arm with less, either. 0 turns it off.",
    }
    WattMax {
        key: 84,
        name: "WATT_MAX",
        kind: Kind::Int16,
        default: 0.0,
        range: Range::Between(0.0, 32_767.0),
        step: 1.0,
        unit: "W",
        takes_effect: TakesEffect::AtOnce,
        label: "Highest power",
        description: "A load above this power is reported as an over-current fault. 0 turns it off.",
    }
    FsLowAct {
        key: 85,
        name: "FS_LOW_ACT",
        kind: Kind::Int8,
        default: 0.0,
        range: FAILSAFE_ACTIONS,
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Action when low",
        description: "What the rover does when the pack is low. This rover knows no position, so it holds where an action \
                      needs one (RTL, SmartRTL, Loiter). Terminate disarms it until a restart or a battery reset.",
    }
    FsCrtAct {
        key: 86,
        name: "FS_CRT_ACT",
        kind: Kind::Int8,
        default: 0.0,
        range: FAILSAFE_ACTIONS,
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Action when critical",
        description: "What the rover does when the pack is critical. This rover knows no position, so it holds where an \
                      action needs one (RTL, SmartRTL, Loiter). Terminate disarms it until a restart or a battery reset.",
    }
    ArmVolt {
        key: 87,
        name: "ARM_VOLT",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 120.0),
        step: 0.1,
        unit: "V",
        takes_effect: TakesEffect::AtOnce,
        label: "Voltage to arm",
        description: "Below this measured voltage the rover does not arm. 0 turns it off.",
    }
    ArmMah {
        key: 88,
        name: "ARM_MAH",
        kind: Kind::Int32,
        default: 0.0,
        range: Range::Between(0.0, 1_000_000.0),
        step: 50.0,
        unit: "mAh",
        takes_effect: TakesEffect::AtOnce,
        label: "Charge to arm",
        description: "With less charge left than this the rover does not arm. It takes a pack whose current is measured. \
                      0 turns it off.",
    }
    I2cBus {
        key: 89,
        name: "I2C_BUS",
        kind: Kind::Int8,
        default: 1.0,
        range: Range::OneOf(&[(1, means("I2C1: SDA GP14, SCL GP15"))]),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AfterReboot,
        label: "I2C bus",
        description: "The bus that the pack's power monitor or smart battery is wired to. This board has one.",
    }
    I2cAddr {
        key: 90,
        name: "I2C_ADDR",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::Between(0.0, 127.0),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AfterReboot,
        label: "I2C address",
        description: "The address of the pack's power monitor or smart battery on the bus. 0: it is looked for where parts \
                      of its kind usually are. With several of a kind, set each one's.",
    }
    Shunt {
        key: 91,
        name: "SHUNT",
        kind: Kind::Real32,
        default: 0.0005,
        range: Range::Between(0.0001, 1.0),
        step: 0.0001,
        unit: "Ohm",
        takes_effect: TakesEffect::AfterReboot,
        label: "Shunt resistor",
        description: "The resistor at the power monitor that the pack's current flows through. The INA260 has its own.",
    }
    MaxAmps {
        key: 92,
        name: "MAX_AMPS",
        kind: Kind::Real32,
        default: 90.0,
        range: Range::Between(0.1, 400.0),
        step: 0.1,
        unit: "A",
        takes_effect: TakesEffect::AfterReboot,
        label: "Highest current",
        description: "The highest current that the INA228's own counters have to count. It measures no more than 163.84 mV \
                      across the shunt. The other power monitors do without.",
    }
    Channel {
        key: 93,
        name: "CHANNEL",
        kind: Kind::Int8,
        default: 1.0,
        range: Range::Between(1.0, 3.0),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AfterReboot,
        label: "Channel",
        description: "The channel of the INA3221 that measures the pack. Packs with the same address share the chip.",
    }
    FlVltMin {
        key: 94,
        name: "FL_VLT_MIN",
        kind: Kind::Real32,
        default: 0.5,
        range: Range::Between(0.01, 10.0),
        step: 0.01,
        unit: "V",
        takes_effect: TakesEffect::AtOnce,
        label: "Fuel level: voltage when empty",
        description: "The voltage at the pin when the tank is empty, straightened by FL_FF and its like.",
    }
    FlVMult {
        key: 95,
        name: "FL_V_MULT",
        kind: Kind::Real32,
        default: 0.5,
        range: Range::Between(0.01, 10.0),
        step: 0.01,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Fuel level: voltage multiplier",
        description: "1 divided by the difference between the voltage of the full tank and that of the empty one.",
    }
    FlFltr {
        key: 96,
        name: "FL_FLTR",
        kind: Kind::Real32,
        default: 0.3,
        range: Range::Between(-1.0, 1.0),
        step: 0.1,
        unit: "Hz",
        takes_effect: TakesEffect::AtOnce,
        label: "Fuel level: filter",
        description: "Where the filter against sloshing cuts off; 0.2 to 0.5 Hz suit. -1 turns it off.",
    }
    FlPin {
        key: 97,
        name: "FL_PIN",
        kind: Kind::Int8,
        default: -1.0,
        range: ANALOG_PINS,
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Fuel level: pin",
        description: "The GPIO number of the analog pin that a fuel level sensor is wired to.",
    }
    FlFf {
        key: 98,
        name: "FL_FF",
        kind: Kind::Real32,
        default: 1.0,
        range: Range::Between(-10.0, 10.0),
        step: 0.01,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Fuel level: first order term",
        description: "The voltage at the pin is straightened: FL_OFF + FL_FF * V + FL_FS * V^2 + FL_FT * V^3.",
    }
    FlFs {
        key: 99,
        name: "FL_FS",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-10.0, 10.0),
        step: 0.01,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Fuel level: second order term",
        description: "See FL_FF.",
    }
    FlFt {
        key: 100,
        name: "FL_FT",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-10.0, 10.0),
        step: 0.01,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Fuel level: third order term",
        description: "See FL_FF.",
    }
    FlOff {
        key: 101,
        name: "FL_OFF",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-10.0, 10.0),
        step: 0.01,
        unit: "V",
        takes_effect: TakesEffect::AtOnce,
        label: "Fuel level: offset term",
        description: "See FL_FF.",
    }
}
