//! The parameters of the whole vehicle.

#[cfg(not(target_os = "none"))]
use super::{Documentation, TakesEffect};
use super::{Kind, Parameter, Range, means};

/// What a link accepts without a signature.
const UNSIGNED_ALLOWED: Range = Range::OneOf(&[
    (0, means("Nothing")),
    (1, means("Requests that only read")),
    (2, means("Everything")),
]);

parameters! {
    /// A parameter of the whole vehicle.
    VehicleParameter

    SysidThismav {
        key: 1,
        name: "SYSID_THISMAV",
        kind: Kind::Int16,
        default: 1.0,
        range: Range::Between(1.0, 255.0),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "MAVLink system id",
        description: "The system id by which this vehicle is told from others on the same link.",
    }
    Serial0Baud {
        key: 2,
        name: "SERIAL0_BAUD",
        kind: Kind::Int32,
        default: 115.0,
        range: Range::OneOf(&[
            (9, means("9600")),
            (19, means("19200")),
            (38, means("38400")),
            (57, means("57600")),
            (111, means("111100")),
            (115, means("115200")),
            (230, means("230400")),
            (256, means("256000")),
            (460, means("460800")),
            (500, means("500000")),
            (921, means("921600")),
        ]),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AfterReboot,
        label: "Telemetry baud rate",
        description: "The baud rate of the telemetry port UART0, in ArduPilot's coding.",
    }
    Sr0Extra1 {
        key: 3,
        name: "SR0_EXTRA1",
        kind: Kind::Int16,
        default: 2.0,
        range: Range::Between(0.0, 50.0),
        step: 1.0,
        unit: "Hz",
        takes_effect: TakesEffect::AtOnce,
        label: "Rate of the battery telemetry",
        description: "How often SYS_STATUS and each BATTERY_STATUS are sent. 0 sends none. \
                      (ArduPilot streams these in EXT_STAT and EXTRA3.)",
    }
    Sr0Params {
        key: 4,
        name: "SR0_PARAMS",
        kind: Kind::Int16,
        default: 10.0,
        range: Range::Between(1.0, 50.0),
        step: 1.0,
        unit: "Hz",
        takes_effect: TakesEffect::AtOnce,
        label: "Rate of parameter lists",
        description: "How often a batch of parameters is sent while a ground station reads the list. \
                      Whatever the rate, the list takes at most 30 % of the link.",
    }
    ArmingCheck {
        key: 5,
        name: "ARMING_CHECK",
        kind: Kind::Int32,
        default: 1.0,
        range: Range::Bits(&[(0, means("All")), (6, means("RC Channels")), (8, means("Battery Level"))]),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Checks before arming",
        description: "What is checked before the rover arms. 0 checks nothing.",
    }
    FsTimeout {
        key: 6,
        name: "FS_TIMEOUT",
        kind: Kind::Real32,
        default: 1.5,
        range: Range::Between(1.0, 100.0),
        step: 0.5,
        unit: "s",
        takes_effect: TakesEffect::AtOnce,
        label: "Time until a silent driver counts",
        description: "When control inputs have come and stay away for longer, an armed rover holds.",
    }
    FsGcsTimeout {
        key: 8,
        name: "FS_GCS_TIMEOUT",
        kind: Kind::Real32,
        default: 5.0,
        range: Range::Between(2.0, 120.0),
        step: 1.0,
        unit: "s",
        takes_effect: TakesEffect::AtOnce,
        label: "Time until a silent ground station counts",
        description: "When the heartbeats of ground stations have come and stay away for longer, an armed rover holds. \
                      They come once a second.",
    }
    SignUartAllow {
        key: 9,
        name: "SIGN_UART_ALLOW",
        kind: Kind::Int8,
        default: 0.0,
        range: UNSIGNED_ALLOWED,
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Unsigned messages on the telemetry port",
        description: "What the telemetry port accepts without the right signature while a signing key is set. \
                      RADIO_STATUS is always accepted.",
    }
    SignUsbAllow {
        key: 10,
        name: "SIGN_USB_ALLOW",
        kind: Kind::Int8,
        default: 2.0,
        range: UNSIGNED_ALLOWED,
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Unsigned messages on USB",
        description: "What USB accepts without the right signature while a signing key is set. \
                      With less than everything, somebody who has lost the key can't set up another one.",
    }
    MotSlewrate {
        key: 7,
        name: "MOT_SLEWRATE",
        kind: Kind::Int16,
        default: 100.0,
        range: Range::Between(0.0, 1000.0),
        step: 1.0,
        unit: "%/s",
        takes_effect: TakesEffect::AtOnce,
        label: "Fastest change of throttle",
        description: "How fast the throttle follows its lever, in percent of full throttle each second. 0: at once.",
    }
}
