//! Parameters of a pack.

use super::monitor_kind::{MONITOR_CHOICES, MonitorKind};
use super::{Access, Kind, Listed, Parameter, Range, means};
#[cfg(not(target_os = "none"))]
use super::{Documentation, TakesEffect};

/// Most motor controllers: `BATT_ESC_MASK` has a bit for each.
pub const MAX_CONTROLLERS: usize = 12;

/// Analog pins of the board, by GPIO number.
pub(super) const ANALOG_PINS: Range = Range::OneOf(&[
    (-1, means("none")),
    (26, means("GP26")),
    (27, means("GP27")),
    (28, means("GP28")),
    (29, means("GP29")),
]);

/// Also the channels of an ADC on the I2C bus, with ArduPilot's numbers.
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

/// Cells of any chemistry; which of these a pack may have, its `CHEM` says.
const CELL_VOLTAGES: Range = Range::ZeroOrBetween(0.8, 4.35);

/// Also the pulse input.
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

/// Failsafe actions of ArduPilot's Rover.
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
    /// A parameter of a pack.
    BatteryParameter

    Monitor {
        key: 64,
        name: "MONITOR",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(MONITOR_CHOICES),
    } Documentation {
        label: "Battery monitoring",
        description: "Kind of sensor. While it is 0, the pack's other parameters are not listed.",
        takes_effect: TakesEffect::AfterReboot,
    }
    VoltPin {
        key: 65,
        name: "VOLT_PIN",
        kind: Kind::Int8,
        default: 26.0,
        range: VOLTAGE_PINS,
    } Documentation {
        label: "Battery voltage pin",
        description: "Pin that measures the pack's voltage. The Freenove board has its divider on GP26.",
    }
    VoltMult {
        key: 66,
        name: "VOLT_MULT",
        kind: Kind::Real32,
        default: 3.95,
        range: Range::Between(0.1, 100.0),
    } Documentation {
        label: "Voltage multiplier",
        description: "The battery's voltage divided by the pin's. To calibrate, multiply it by the voltage a \
                      multimeter shows and divide by the one reported.",
        step: 0.01,
    }
    VltOffset {
        key: 67,
        name: "VLT_OFFSET",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-3.3, 3.3),
    } Documentation {
        label: "Voltage offset",
        description: "The voltage at the pin when the battery's voltage is zero.",
        unit: "V",
        step: 0.01,
    }
    Capacity {
        key: 68,
        name: "CAPACITY",
        kind: Kind::Int32,
        default: 3300.0,
        range: Range::Between(0.0, 1_000_000.0),
    } Documentation {
        label: "Capacity",
        description: "Capacity of the full pack; of a tank, in millilitres. 0: unknown.",
        unit: "mAh",
        step: 50.0,
    }
    CurrPin {
        key: 69,
        name: "CURR_PIN",
        kind: Kind::Int8,
        default: -1.0,
        range: CURRENT_PINS,
    } Documentation {
        label: "Battery current pin",
        description: "Pin of the current sensor. The Freenove board has none. GP17 is only for the pulses of a fuel \
                      sensor (FuelFlow, FuelLevelPWM).",
    }
    AmpPervlt {
        key: 70,
        name: "AMP_PERVLT",
        kind: Kind::Real32,
        default: 17.0,
        range: Range::Between(-1000.0, 1000.0),
    } Documentation {
        label: "Current sensor scale",
        description: "Amperes per volt at the current pin; for FuelFlow, millilitres per pulse.",
        unit: "A/V",
        step: 0.1,
    }
    AmpOffset {
        key: 71,
        name: "AMP_OFFSET",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-3.3, 3.3),
    } Documentation {
        label: "Current sensor offset",
        description: "Voltage at the current pin at zero current.",
        unit: "V",
        step: 0.001,
    }
    Options {
        key: 72,
        name: "OPTIONS",
        kind: Kind::Int32,
        default: 0.0,
        range: Range::Bits(&[
            (0, means("Ignore DroneCAN SoC")),
            (1, means("MPPT reports input voltage and current")),
            (2, means("MPPT powered off when disarmed")),
            (3, means("MPPT powered on when armed")),
            (4, means("MPPT powered off at boot")),
            (5, means("MPPT powered on at boot")),
            (6, means("Send resting voltage to ground stations")),
            (7, means("Allow DroneCAN InfoAux to be from a different CAN node")),
            (8, means("Internal use only")),
            (9, means("Sum uses the lowest voltage")),
            (10, means("Allow DroneCAN dynamic node update on hot-swap")),
        ]),
    } Documentation {
        label: "Options",
        description: "The resting voltage is the voltage without load. A pack for internal use is monitored but not \
                      reported. Without bit 9 a sum of packs reports the mean of their voltages.",
    }
    SerialNum {
        key: 73,
        name: "SERIAL_NUM",
        kind: Kind::Int32,
        default: -1.0,
        // A float represents every whole number in this range.
        range: Range::Between(-1.0, 16_777_215.0),
    } Documentation {
        label: "Serial number",
        description: "Serial number that identifies this pack. -1: none.",
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
    } Documentation {
        label: "Packs of a sum",
        description: "Members of a sum of packs. 0: all packs with a higher number, without other sums.",
    }
    MaxVolt {
        key: 75,
        name: "MAX_VOLT",
        kind: Kind::Real32,
        default: 12.6,
        range: Range::Between(7.0, 100.0),
    } Documentation {
        label: "Voltage when full",
        description: "Resting voltage of the full pack, for the synthetic current sensor.",
        unit: "V",
        step: 0.1,
    }
    Chem {
        key: 76,
        name: "CHEM",
        kind: Kind::Int8,
        default: 1.0,
        range: Range::OneOf(&[(1, means("LiPo")), (2, means("LiFe")), (3, means("Li-ion")), (4, means("NiMH"))]),
    } Documentation {
        label: "Chemistry",
        description: "Cell chemistry. (ArduPilot has no such parameter.)",
    }
    Cells {
        key: 77,
        name: "CELLS",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::Between(0.0, 16.0),
    } Documentation {
        label: "Cells in series",
        description: "Number of cells in series. 0: detected from the resting voltage, LiPo and Li-ion only. \
                      (ArduPilot has no such parameter.)",
    }
    LowTimer {
        key: 78,
        name: "LOW_TIMER",
        kind: Kind::Int8,
        default: 10.0,
        range: Range::Between(0.0, 120.0),
    } Documentation {
        label: "Low voltage timer",
        description: "Time the voltage has to stay below a threshold. 0 disables both voltage thresholds.",
        unit: "s",
    }
    FsVoltsrc {
        key: 79,
        name: "FS_VOLTSRC",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[
            (0, means("Raw Voltage")),
            (1, means("Sag Compensated Voltage")),
            (2, means("Weakest Cell")),
        ]),
    } Documentation {
        label: "Voltage for the thresholds",
        description: "Voltage compared with the thresholds: as measured, compensated for the sag under load, or that of \
                      the weakest measured cell times the number of cells. Without a current or without each cell it \
                      is as measured. (ArduPilot has no 2.)",
    }
    LowVolt {
        key: 80,
        name: "LOW_VOLT",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 120.0),
    } Documentation {
        label: "Low voltage",
        description: "Below this voltage for longer than LOW_TIMER an armed rover executes FS_LOW_ACT. Below it a \
                      rover does not arm. 0: disabled.",
        unit: "V",
        step: 0.1,
    }
    LowMah {
        key: 81,
        name: "LOW_MAH",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 1_000_000.0),
    } Documentation {
        label: "Low charge",
        description: "With less remaining charge than this an armed rover executes FS_LOW_ACT, and a disarmed one \
                      does not arm. Without a current sensor FS_LOW_ACT waits until the charge is surely less. \
                      0: disabled.",
        unit: "mAh",
        step: 50.0,
    }
    CrtVolt {
        key: 82,
        name: "CRT_VOLT",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 120.0),
    } Documentation {
        label: "Critical voltage",
        description: "Below this voltage for longer than LOW_TIMER an armed rover executes FS_CRT_ACT. Below it a \
                      rover does not arm. 0: disabled.",
        unit: "V",
        step: 0.1,
    }
    CrtMah {
        key: 83,
        name: "CRT_MAH",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 1_000_000.0),
    } Documentation {
        label: "Critical charge",
        description: "With less remaining charge than this an armed rover executes FS_CRT_ACT, and a disarmed one \
                      does not arm. Without a current sensor FS_CRT_ACT waits until the charge is surely less. \
                      0: disabled.",
        unit: "mAh",
        step: 50.0,
    }
    WattMax {
        key: 84,
        name: "WATT_MAX",
        kind: Kind::Int16,
        default: 0.0,
        range: Range::Between(0.0, 32_767.0),
    } Documentation {
        label: "Maximum power",
        description: "Limits the motors so that the pack supplies at most this power, to 5 % of their duty at the least. A load \
                      that stays more than 10 % above it then is an over-current fault. 0: disabled.",
        unit: "W",
    }
    FsLowAct {
        key: 85,
        name: "FS_LOW_ACT",
        kind: Kind::Int8,
        default: 0.0,
        range: FAILSAFE_ACTIONS,
    } Documentation {
        label: "Action when low",
        description: "Action when the pack is low. RTL, SmartRTL and Loiter need a position and enter Hold. Terminate \
                      disarms until a restart, a battery reset or a fuller pack. Chosen when the pack is low already, it \
                      acts the next time.",
    }
    FsCrtAct {
        key: 86,
        name: "FS_CRT_ACT",
        kind: Kind::Int8,
        default: 0.0,
        range: FAILSAFE_ACTIONS,
    } Documentation {
        label: "Action when critical",
        description: "Action when the pack is critical. RTL, SmartRTL and Loiter need a position and enter Hold. \
                      Terminate disarms until a restart, a battery reset or a fuller pack. Chosen when the pack is \
                      critical already, it acts the next time.",
    }
    ArmVolt {
        key: 87,
        name: "ARM_VOLT",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 120.0),
    } Documentation {
        label: "Minimum voltage to arm",
        description: "The rover does not arm below this measured voltage. 0: disabled.",
        unit: "V",
        step: 0.1,
    }
    ArmMah {
        key: 88,
        name: "ARM_MAH",
        kind: Kind::Int32,
        default: 0.0,
        range: Range::Between(0.0, 1_000_000.0),
    } Documentation {
        label: "Minimum charge to arm",
        description: "The rover does not arm with less remaining charge. 0: disabled.",
        unit: "mAh",
        step: 50.0,
    }
    I2cBus {
        key: 89,
        name: "I2C_BUS",
        kind: Kind::Int8,
        default: 1.0,
        range: Range::OneOf(&[(1, means("I2C1: SDA GP14, SCL GP15"))]),
    } Documentation {
        label: "I2C bus",
        description: "Bus of the pack's power monitor or smart battery.",
        takes_effect: TakesEffect::AfterReboot,
    }
    I2cAddr {
        key: 90,
        name: "I2C_ADDR",
        kind: Kind::Int8,
        default: 0.0,
        // Others are reserved (I2C specification UM10204, table 4).
        range: Range::ZeroOrBetween(8.0, 119.0),
    } Documentation {
        label: "I2C address",
        description: "Address on the bus. 0: the usual addresses of its kind are probed. With several of a kind, set \
                      each address.",
        takes_effect: TakesEffect::AfterReboot,
    }
    Shunt {
        key: 91,
        name: "SHUNT",
        kind: Kind::Real32,
        default: 0.0005,
        range: Range::Between(0.0001, 1.0),
    } Documentation {
        label: "Shunt resistor",
        description: "Shunt resistor of the power monitor. The INA260 has its own.",
        unit: "Ohm",
        step: 0.0001,
        takes_effect: TakesEffect::AfterReboot,
    }
    MaxAmps {
        key: 92,
        name: "MAX_AMPS",
        kind: Kind::Real32,
        default: 90.0,
        range: Range::Between(0.1, 400.0),
    } Documentation {
        label: "Maximum current",
        description: "Full scale of the INA228's current and counters, at most 163.84 mV across the shunt. Other \
                      power monitors ignore it.",
        unit: "A",
        step: 0.1,
        takes_effect: TakesEffect::AfterReboot,
    }
    Channel {
        key: 93,
        name: "CHANNEL",
        kind: Kind::Int8,
        default: 1.0,
        range: Range::Between(1.0, 3.0),
    } Documentation {
        label: "Channel",
        description: "Channel of the INA3221 that measures the pack. Packs with the same address share the chip.",
        takes_effect: TakesEffect::AfterReboot,
    }
    FlVltMin {
        key: 94,
        name: "FL_VLT_MIN",
        kind: Kind::Real32,
        default: 0.5,
        range: Range::Between(0.01, 10.0),
    } Documentation {
        label: "Fuel level: voltage when empty",
        description: "Voltage of the empty tank, after linearisation by FL_FF, FL_FS, FL_FT and FL_OFF.",
        unit: "V",
        step: 0.01,
    }
    FlVMult {
        key: 95,
        name: "FL_V_MULT",
        kind: Kind::Real32,
        default: 0.5,
        range: Range::Between(0.01, 10.0),
    } Documentation {
        label: "Fuel level: voltage multiplier",
        description: "Reciprocal of the voltage difference between full and empty tank.",
        step: 0.01,
    }
    FlFltr {
        key: 96,
        name: "FL_FLTR",
        kind: Kind::Real32,
        default: 0.3,
        range: Range::Between(-1.0, 1.0),
    } Documentation {
        label: "Fuel level: filter",
        description: "Cutoff frequency of the filter against sloshing, usually 0.2 to 0.5 Hz. -1: disabled.",
        unit: "Hz",
        step: 0.1,
    }
    FlPin {
        key: 97,
        name: "FL_PIN",
        kind: Kind::Int8,
        default: -1.0,
        range: ANALOG_PINS,
    } Documentation {
        label: "Fuel level: pin",
        description: "Pin of the fuel level sensor.",
    }
    FlFf {
        key: 98,
        name: "FL_FF",
        kind: Kind::Real32,
        default: 1.0,
        range: Range::Between(-10.0, 10.0),
    } Documentation {
        label: "Fuel level: first order term",
        description: "The pin's voltage V is linearised: FL_OFF + FL_FF * V + FL_FS * V^2 + FL_FT * V^3.",
        step: 0.01,
    }
    FlFs {
        key: 99,
        name: "FL_FS",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-10.0, 10.0),
    } Documentation {
        label: "Fuel level: second order term",
        description: "See FL_FF.",
        step: 0.01,
    }
    FlFt {
        key: 100,
        name: "FL_FT",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-10.0, 10.0),
    } Documentation {
        label: "Fuel level: third order term",
        description: "See FL_FF.",
        step: 0.01,
    }
    FlOff {
        key: 101,
        name: "FL_OFF",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-10.0, 10.0),
    } Documentation {
        label: "Fuel level: offset term",
        description: "See FL_FF.",
        unit: "V",
        step: 0.01,
    }
    LowPct {
        key: 102,
        name: "LOW_PCT",
        kind: Kind::Real32,
        default: 15.0,
        range: Range::Between(0.0, 100.0),
    } Documentation {
        label: "Low charge state",
        description: "Below this remaining charge the pack is announced as low; armed it acts with FS_PCT_EN. 0: \
                      disabled. (ArduPilot has no such parameter; PX4's is BAT_LOW_THR.)",
        unit: "%",
    }
    CrtPct {
        key: 103,
        name: "CRT_PCT",
        kind: Kind::Real32,
        default: 7.0,
        range: Range::Between(0.0, 100.0),
    } Documentation {
        label: "Critical charge state",
        description: "Below this remaining charge the pack is announced as critical; armed it acts with FS_PCT_EN. \
                      0: disabled. (ArduPilot has no such parameter; PX4's is BAT_CRIT_THR.)",
        unit: "%",
    }
    EmrPct {
        key: 104,
        name: "EMR_PCT",
        kind: Kind::Real32,
        default: 5.0,
        range: Range::Between(0.0, 100.0),
    } Documentation {
        label: "Emergency charge state",
        description: "Below this remaining charge the pack is announced as nearly empty, and a disarmed rover does \
                      not arm. 0: disabled. (ArduPilot has no such parameter; PX4's is BAT_EMERGEN_THR.)",
        unit: "%",
    }
    FsUnhAct {
        key: 105,
        name: "FS_UNH_ACT",
        kind: Kind::Int8,
        default: 0.0,
        range: FAILSAFE_ACTIONS,
    } Documentation {
        label: "Action when unhealthy",
        description: "Action when an armed rover has had no healthy reading of the pack for 5 s, or when the pack has \
                      reported for 5 s that it is failed or unhealthy. Chosen when it is unhealthy already, it acts the \
                      next time. (ArduPilot has no such parameter and warns.)",
    }
    LrnCap {
        key: 106,
        name: "LRN_CAP",
        kind: Kind::Int32,
        default: 0.0,
        range: Range::Between(0.0, 10_000_000.0),
        access: Access::ReadOnly,
    } Documentation {
        label: "Learnt capacity",
        description: "Capacity of the full pack, learnt from its drives. 0: not learnt. (ArduPilot has no such \
                      parameter.)",
        unit: "mAh",
    }
    LrnRes {
        key: 107,
        name: "LRN_RES",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 100_000_000.0),
        access: Access::ReadOnly,
    } Documentation {
        label: "Learnt resistance",
        description: "Resistance of the warm pack, learnt from its drives. 0: not learnt. (ArduPilot has no such \
                      parameter.)",
        unit: "mOhm",
        step: 0.1,
    }
    LrnErase {
        key: 108,
        name: "LRN_ERASE",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("Keep")), (1, means("Erase"))]),
        access: Access::Trigger,
    } Documentation {
        label: "Erase what is learnt",
        description: "Set to 1, it erases what is learnt of the pack with the present SERIAL_NUM, and reads 0 again. \
                      A reset of all parameters keeps it. (ArduPilot has no such parameter.)",
    }
    CurrMult {
        key: 109,
        name: "CURR_MULT",
        kind: Kind::Real32,
        default: 1.0,
        range: Range::Between(0.1, 10.0),
        listed: Listed::WithMonitor(MonitorKind::Can),
    } Documentation {
        label: "Current multiplier",
        description: "Factor applied to the current that a DroneCAN battery or charger reports.",
        step: 0.1,
    }
    EscMask {
        key: 110,
        name: "ESC_MASK",
        kind: Kind::Int32,
        default: 0.0,
        // A float represents every whole number in this range.
        range: Range::Between(0.0, ((1 << MAX_CONTROLLERS) - 1) as f32),
        listed: Listed::WithMonitor(MonitorKind::Esc),
    } Documentation {
        label: "ESC mask",
        description: "Motor controllers that supply this pack's measurement, one bit each from bit 0. 0: all.",
    }
    FsPctEn {
        key: 111,
        name: "FS_PCT_EN",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("Announce only")), (1, means("Act"))]),
    } Documentation {
        label: "Failsafe by percent",
        description: "1: an armed rover executes FS_LOW_ACT below LOW_PCT and FS_CRT_ACT below CRT_PCT or EMR_PCT, once \
                      usable charge was below for LOW_TIMER (0: at once) and remaining charge plus two standard \
                      deviations is below that + 20 %. (ArduPilot has no such parameter.)",
    }
    Curve10 {
        key: 112,
        name: "CURVE_10",
        kind: Kind::Real32,
        default: 0.0,
        range: CELL_VOLTAGES,
        listed: Listed::WithCurve,
    } Documentation {
        label: "Curve: cell at 10 %",
        description: "Resting voltage of a cell at this charge. Those that are set replace the chemistry's curve, if they \
                      rise. 0: not set. (ArduPilot has no such parameter.)",
        unit: "V",
        step: 0.001,
    }
    Curve30 {
        key: 113,
        name: "CURVE_30",
        kind: Kind::Real32,
        default: 0.0,
        range: CELL_VOLTAGES,
        listed: Listed::WithCurve,
    } Documentation {
        label: "Curve: cell at 30 %",
        description: "See CURVE_10.",
        unit: "V",
        step: 0.001,
    }
    Curve50 {
        key: 114,
        name: "CURVE_50",
        kind: Kind::Real32,
        default: 0.0,
        range: CELL_VOLTAGES,
        listed: Listed::WithCurve,
    } Documentation {
        label: "Curve: cell at 50 %",
        description: "See CURVE_10.",
        unit: "V",
        step: 0.001,
    }
    Curve70 {
        key: 115,
        name: "CURVE_70",
        kind: Kind::Real32,
        default: 0.0,
        range: CELL_VOLTAGES,
        listed: Listed::WithCurve,
    } Documentation {
        label: "Curve: cell at 70 %",
        description: "See CURVE_10.",
        unit: "V",
        step: 0.001,
    }
    Curve90 {
        key: 116,
        name: "CURVE_90",
        kind: Kind::Real32,
        default: 0.0,
        range: CELL_VOLTAGES,
        listed: Listed::WithCurve,
    } Documentation {
        label: "Curve: cell at 90 %",
        description: "See CURVE_10.",
        unit: "V",
        step: 0.001,
    }
}

impl BatteryParameter {
    /// The points of the owner's curve, from 10 to 90 %.
    pub const CURVE: [Self; 5] = [
        Self::Curve10,
        Self::Curve30,
        Self::Curve50,
        Self::Curve70,
        Self::Curve90,
    ];
}
