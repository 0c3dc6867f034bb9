//! Parameters of the vehicle, and what the codes of baud rates mean.

use super::{Access, Bearing, Kind, Listed, Parameter, Range, means};
#[cfg(not(target_os = "none"))]
use super::{Documentation, TakesEffect};

/// Unsigned messages a link accepts.
const UNSIGNED_ALLOWED: Range = Range::OneOf(&[
    (0, means("Nothing")),
    (1, means("Requests that only read")),
    (2, means("Everything")),
]);

const SERVICE: Access = Access::Setting(Bearing::Service);

parameters! {
    /// A parameter of the vehicle.
    VehicleParameter

    SysidThismav {
        key: 1,
        name: "SYSID_THISMAV",
        kind: Kind::Int16,
        default: 1.0,
        range: Range::Between(1.0, 255.0),
    } Documentation {
        label: "MAVLink system id",
        description: "System id of this vehicle, unique on the link.",
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
    } Documentation {
        label: "Telemetry baud rate",
        description: "Baud rate of the telemetry port UART0, in ArduPilot's coding.",
        takes_effect: TakesEffect::AfterReboot,
    }
    Sr0Extra1 {
        key: 3,
        name: "SR0_EXTRA1",
        kind: Kind::Int16,
        default: 2.0,
        range: Range::Between(0.0, 50.0),
        access: SERVICE,
    } Documentation {
        label: "Rate of the battery telemetry",
        description: "Rate of SYS_STATUS and each BATTERY_STATUS. 0: off. A ground station's stream requests change its \
                      link's rates until this is set: EXTENDED_STATUS that of SYS_STATUS, EXTRA3 that of \
                      BATTERY_STATUS, EXTRA1 and ALL both.",
        unit: "Hz",
    }
    Sr0Params {
        key: 4,
        name: "SR0_PARAMS",
        kind: Kind::Int16,
        default: 10.0,
        range: Range::Between(1.0, 50.0),
        access: SERVICE,
    } Documentation {
        label: "Rate of parameter lists",
        description: "Rate of batches of a parameter list, which takes at most 30 % of the link.",
        unit: "Hz",
    }
    ArmingCheck {
        key: 5,
        name: "ARMING_CHECK",
        kind: Kind::Int32,
        default: 1.0,
        range: Range::Bits(&[(0, means("All")), (6, means("RC Channels")), (8, means("Battery Level")), (10, means("Logging"))]),
    } Documentation {
        label: "Checks before arming",
        description: "Arming checks. 0: none.",
    }
    FsTimeout {
        key: 6,
        name: "FS_TIMEOUT",
        kind: Kind::Real32,
        default: 1.5,
        range: Range::Between(1.0, 100.0),
    } Documentation {
        label: "Time-out of control inputs",
        description: "Without control inputs for longer, once there were any, an armed rover enters Hold.",
        unit: "s",
        step: 0.5,
    }
    FsGcsTimeout {
        key: 8,
        name: "FS_GCS_TIMEOUT",
        kind: Kind::Real32,
        default: 5.0,
        range: Range::Between(2.0, 120.0),
    } Documentation {
        label: "Time-out of ground stations",
        description: "Without a ground station's heartbeat for longer, once there was one, an armed rover enters Hold. \
                      Heartbeats are sent once a second.",
        unit: "s",
    }
    SignUartAllow {
        key: 9,
        name: "SIGN_UART_ALLOW",
        kind: Kind::Int8,
        default: 0.0,
        range: UNSIGNED_ALLOWED,
    } Documentation {
        label: "Unsigned messages on the telemetry port",
        description: "Unsigned messages accepted on the telemetry port while a signing key is set, besides \
                      RADIO_STATUS.",
    }
    SignUsbAllow {
        key: 10,
        name: "SIGN_USB_ALLOW",
        kind: Kind::Int8,
        default: 2.0,
        range: UNSIGNED_ALLOWED,
    } Documentation {
        label: "Unsigned messages on USB",
        description: "Unsigned messages accepted on USB while a signing key is set. Unless everything is, a lost key \
                      can't be replaced.",
    }
    SignWifiAllow {
        key: 15,
        name: "SIGN_WIFI_ALLOW",
        kind: Kind::Int8,
        default: 0.0,
        range: UNSIGNED_ALLOWED,
    } Documentation {
        label: "Unsigned messages by Wi-Fi",
        description: "Unsigned messages accepted by Wi-Fi while a signing key is set.",
    }
    MotSlewrate {
        key: 7,
        name: "MOT_SLEWRATE",
        kind: Kind::Int16,
        default: 100.0,
        range: Range::Between(0.0, 1000.0),
    } Documentation {
        label: "Throttle slew rate",
        description: "Maximum rate of change of the throttle, towards neutral at least 100 %/s. 0: unlimited.",
        unit: "%/s",
    }
    MotBatWattTc {
        key: 54,
        name: "MOT_BAT_WATT_TC",
        kind: Kind::Real32,
        default: 2.0,
        range: Range::Between(0.1, 10.0),
    } Documentation {
        label: "Time constant of the power limit",
        description: "How fast the motors are limited and released by BATT_WATT_MAX.",
        unit: "s",
        step: 0.1,
    }
    MotDrvVolt {
        key: 53,
        name: "MOT_DRV_VOLT",
        kind: Kind::Real32,
        // The highest recommended motor supply of a DRV8837 (TI SLVSBA4).
        default: 11.0,
        range: Range::Between(0.0, 60.0),
    } Documentation {
        label: "Voltage limit of the motor drivers",
        description: "Above it a pack at the board's divider does not arm; another one is announced once. 0: no limit. \
                      (ArduPilot has no such parameter.)",
        unit: "V",
        step: 0.1,
    }
    LogBitmask {
        key: 11,
        name: "LOG_BITMASK",
        kind: Kind::Int32,
        default: 520.0,
        range: Range::Bits(&[(3, means("System Performance")), (9, means("Battery Monitor"))]),
        access: SERVICE,
    } Documentation {
        label: "Log bitmask",
        description: "Records of the log, besides parameters, messages, events and modes. 0: no log.",
    }
    LogDisarmed {
        key: 12,
        name: "LOG_DISARMED",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("Disabled")), (1, means("Enabled"))]),
        access: SERVICE,
    } Documentation {
        label: "Logging while disarmed",
        description: "Logs while disarmed, too. Otherwise the log goes on for 15 s after disarming.",
    }
    LogBlkRatemax {
        key: 13,
        name: "LOG_BLK_RATEMAX",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 1000.0),
        access: SERVICE,
    } Documentation {
        label: "Maximum logging rate",
        description: "Maximum rate of each pack's records in the log. 0: as many as the log's share of 250 bytes per \
                      second allows, of all packs together.",
        unit: "Hz",
    }
    LogFileDsrmrot {
        key: 14,
        name: "LOG_FILE_DSRMROT",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("Disabled")), (1, means("Enabled"))]),
        access: SERVICE,
    } Documentation {
        label: "New log after disarming",
        description: "Ends the log file after disarming; the next arming begins another one.",
    }
    WifiMode {
        key: 16,
        name: "WIFI_MODE",
        kind: Kind::Int8,
        default: 1.0,
        range: Range::OneOf(&[(0, means("Off")), (1, means("Access point")), (2, means("Station"))]),
        access: SERVICE,
    } Documentation {
        label: "Wi-Fi mode",
        description: "Wi-Fi of a board that has a radio. An access point has a network of its own; a station joins the \
                      network set by WIFI_CONFIG_AP. A change of any WIFI_ parameter while armed takes effect at \
                      disarming. (ArduPilot has no such parameter.)",
    }
    WifiChannel {
        key: 17,
        name: "WIFI_CHANNEL",
        kind: Kind::Int8,
        default: 6.0,
        range: Range::Between(1.0, 11.0),
        access: SERVICE,
    } Documentation {
        label: "Wi-Fi channel",
        description: "Channel of the access point in the 2.4 GHz band. A station uses its network's. (ArduPilot has no \
                      such parameter.)",
    }
    WifiPwrSave {
        key: 18,
        name: "WIFI_PWR_SAVE",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("Disabled")), (1, means("Enabled"))]),
        access: SERVICE,
    } Documentation {
        label: "Wi-Fi power save",
        description: "Lets the radio sleep between packets, which delays what it receives. (ArduPilot has no such \
                      parameter.)",
    }
    WifiShow {
        key: 19,
        name: "WIFI_SHOW",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("Hide")), (1, means("Show"))]),
        access: Access::Trigger,
    } Documentation {
        label: "Show the Wi-Fi password",
        description: "Set to 1 by USB, it shows the name and the password of the access point as messages on USB, and \
                      reads 0 again. (ArduPilot has no such parameter.)",
    }
    Serial1Protocol {
        key: 20,
        name: "SERIAL1_PROTOCOL",
        kind: Kind::Int8,
        default: 16.0,
        range: Range::OneOf(&[
            (16, means("ESC Telemetry")),
            (24, means("EFI")),
            (30, means("Generator")),
            (39, means("Torqeedo")),
        ]),
    } Documentation {
        label: "Protocol of the second serial port",
        description: "What is connected to UART1 (GP4, GP5). The pins stay untouched while no pack is measured by it. \
                      (ArduPilot's default is MAVLink2.)",
        takes_effect: TakesEffect::AfterReboot,
    }
    Serial1Baud {
        key: 29,
        name: "SERIAL1_BAUD",
        kind: Kind::Int32,
        default: 9.0,
        range: Range::OneOf(&[
            (9, means("9600")),
            (19, means("19200")),
            (38, means("38400")),
            (57, means("57600")),
            (111, means("111100")),
            (115, means("115200")),
        ]),
        listed: Listed::WithSerialProtocol(30.0),
    } Documentation {
        label: "Baud rate of the second serial port",
        description: "Baud rate of a generator at UART1, in ArduPilot's coding; the other protocols have a rate of their \
                      own. (ArduPilot's default is 57.)",
        takes_effect: TakesEffect::AfterReboot,
    }
    GenType {
        key: 21,
        name: "GEN_TYPE",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[
            (0, means("Disabled")),
            (1, means("IE 650w 800w Fuel Cell")),
            (2, means("IE 2.4kW Fuel Cell")),
            (3, means("Richenpower")),
        ]),
        listed: Listed::WithSerialProtocol(30.0),
    } Documentation {
        label: "Generator type",
        description: "Kind of generator at the second serial port.",
        takes_effect: TakesEffect::AfterReboot,
    }
    EfiType {
        key: 22,
        name: "EFI_TYPE",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("None")), (1, means("Serial-MS"))]),
        listed: Listed::WithSerialProtocol(24.0),
    } Documentation {
        label: "EFI type",
        description: "Kind of engine control unit at the second serial port.",
        takes_effect: TakesEffect::AfterReboot,
    }
    EfiCoef1 {
        key: 30,
        name: "EFI_COEF1",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 1.0),
        listed: Listed::WithSerialProtocol(24.0),
    } Documentation {
        label: "EFI calibration coefficient 1",
        description: "Flow of fuel for each percent of the injectors' duty cycle, in cm³ per minute. 0: not calibrated, the \
                      flow is unknown.",
        step: 0.001,
    }
    EfiCoef2 {
        key: 31,
        name: "EFI_COEF2",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(0.0, 10.0),
        listed: Listed::WithSerialProtocol(24.0),
    } Documentation {
        label: "EFI calibration coefficient 2",
        description: "Subtracted from the flow of fuel that EFI_COEF1 gives, in cm³ per minute.",
        step: 0.01,
    }
    Trqd1Type {
        key: 23,
        name: "TRQD1_TYPE",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("Disabled")), (1, means("Tiller")), (2, means("Motor"))]),
        listed: Listed::WithSerialProtocol(39.0),
    } Documentation {
        label: "Torqeedo connection type",
        description: "Place of this board on the bus of the Torqeedo motor at the second serial port.",
        takes_effect: TakesEffect::AfterReboot,
    }
    Trqd1DePin {
        key: 24,
        name: "TRQD1_DE_PIN",
        kind: Kind::Int8,
        default: -1.0,
        range: Range::OneOf(&[(-1, means("None, the transceiver switches by itself")), (22, means("GP22"))]),
        listed: Listed::WithSerialProtocol(39.0),
    } Documentation {
        label: "Torqeedo DE pin",
        description: "Pin that is high while this board sends: the driver enable of the RS-485 transceiver. An \
                      INA239 can't be selected then.",
        takes_effect: TakesEffect::AfterReboot,
    }
    CanP1Driver {
        key: 25,
        name: "CAN_P1_DRIVER",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("Disabled")), (1, means("First driver"))]),
    } Documentation {
        label: "CAN bus",
        description: "Whether an MCP2515 (SPI1, chip select GP13, interrupt GP17) connects the board to a DroneCAN bus. \
                      GP17 takes no pulses of a fuel sensor then. Disabled, the pins stay untouched.",
        takes_effect: TakesEffect::AfterReboot,
    }
    CanP1Bitrate {
        key: 26,
        name: "CAN_P1_BITRATE",
        kind: Kind::Int32,
        default: 1_000_000.0,
        range: Range::OneOf(&[
            (125_000, means("125 kbit/s")),
            (250_000, means("250 kbit/s")),
            (500_000, means("500 kbit/s")),
            (1_000_000, means("1 Mbit/s, 16 MHz crystal only")),
        ]),
        listed: Listed::WithCan,
    } Documentation {
        label: "CAN bit rate",
        description: "Bit rate of the CAN bus, the same for everything on it.",
        unit: "bit/s",
        takes_effect: TakesEffect::AfterReboot,
    }
    CanP1Crystal {
        key: 27,
        name: "CAN_P1_CRYSTAL",
        kind: Kind::Int8,
        default: 16.0,
        range: Range::OneOf(&[(8, means("8 MHz")), (16, means("16 MHz"))]),
        listed: Listed::WithCan,
    } Documentation {
        label: "CAN controller's crystal",
        description: "Frequency of the MCP2515's crystal, which is printed on it. With 8 MHz the bit rate is 500 kbit/s at \
                      most. (ArduPilot has no such parameter.)",
        unit: "MHz",
        takes_effect: TakesEffect::AfterReboot,
    }
    CanD1UcNode {
        key: 28,
        name: "CAN_D1_UC_NODE",
        kind: Kind::Int8,
        default: 10.0,
        range: Range::Between(0.0, 125.0),
        listed: Listed::WithCan,
    } Documentation {
        label: "Own DroneCAN node id",
        description: "Node id of this board, unique on the bus. With an id of its own the board also assigns ids to nodes \
                      that have none. 0: assigned by another node.",
        takes_effect: TakesEffect::AfterReboot,
    }
    ParamChecked {
        key: 52,
        name: "PARAM_CHECKED",
        kind: Kind::Int8,
        default: 0.0,
        range: Range::OneOf(&[(0, means("Keep")), (1, means("Confirm"))]),
        access: Access::Trigger,
    } Documentation {
        label: "Confirm the parameters",
        description: "Set to 1, it lets the rover arm with parameters that were damaged, half loaded or out of range, and reads \
                      0 again. (ArduPilot has no such parameter.)",
    }
}

/// Baud rate of a `SERIAL0_BAUD` code: thousands, rounded.
pub fn serial_baud(code: i32) -> u32 {
    match code {
        9 => 9_600,
        19 => 19_200,
        38 => 38_400,
        57 => 57_600,
        111 => 111_100,
        230 => 230_400,
        256 => 256_000,
        460 => 460_800,
        500 => 500_000,
        921 => 921_600,
        // The default, also for an invalid code.
        _ => 115_200,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_code_has_its_documented_rate() {
        let Range::OneOf(codes) = VehicleParameter::Serial0Baud.row().range else {
            panic!("a list of codes");
        };
        for (code, rate) in codes {
            assert_eq!(serial_baud(*code).to_string(), rate.text());
        }
    }
}
