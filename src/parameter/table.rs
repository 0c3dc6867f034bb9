//! Every parameter there is.

/// One row of the table.
#[derive(Clone, Copy, Debug)]
pub struct Parameter {
    /// Which parameter this row describes.
    pub id: ParameterId,
    /// The key of its value in flash. It stays for ever and is never given to another parameter.
    pub key: u16,
    /// Its name in ArduPilot 4.6, at most 16 characters.
    pub name: &'static str,
    /// The type a ground station is told.
    pub kind: Kind,
    /// The value it has until somebody sets it.
    pub default: f32,
    /// Which values it takes.
    pub range: Range,
    /// The step by which a ground station's controls change it.
    pub step: f32,
    /// The unit of its value, empty for a plain number.
    pub unit: &'static str,
    /// When a change takes effect.
    pub takes_effect: TakesEffect,
    /// A few words for a list.
    pub label: &'static str,
    /// What it does, for its owner.
    pub description: &'static str,
}

/// The type of a parameter's value. On the wire every value travels as a float.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// A whole number, `MAV_PARAM_TYPE_INT8`.
    Int8,
    /// A whole number, `MAV_PARAM_TYPE_INT16`.
    Int16,
    /// A whole number, `MAV_PARAM_TYPE_INT32`.
    Int32,
    /// `MAV_PARAM_TYPE_REAL32`.
    Real32,
}

/// Which values a parameter takes.
#[derive(Clone, Copy, Debug)]
pub enum Range {
    /// From the first to the second, both included.
    Between(f32, f32),
    /// One of these, each with its meaning.
    OneOf(&'static [(i32, &'static str)]),
}

impl Range {
    /// Whether `value` is one of them; NaN never is.
    pub fn contains(&self, value: f32) -> bool {
        match *self {
            Self::Between(lowest, highest) => (lowest..=highest).contains(&value),
            Self::OneOf(values) => values.iter().any(|(allowed, _)| *allowed as f32 == value),
        }
    }
}

/// When a change of a parameter takes effect.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum TakesEffect {
    /// With the next reading or message.
    AtOnce,
    /// When the board has been restarted.
    AfterReboot,
}

/// Declares the parameters: their names in code, and the table with one row each, in the same order.
macro_rules! parameters {
    ($($id:ident { $($field:ident: $value:expr),* $(,)? })*) => {
        /// The name of a parameter in code; its number is its row in [`TABLE`].
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        #[cfg_attr(target_os = "none", derive(defmt::Format))]
        #[repr(u8)]
        pub enum ParameterId {
            $(#[doc = concat!("The row `", stringify!($id), "` of the table.")] $id,)*
        }

        /// Every parameter there is.
        pub static TABLE: [Parameter; PARAMETER_COUNT] =
            [$(Parameter { id: ParameterId::$id, $($field: $value),* }),*];

        /// How many parameters there are.
        pub const PARAMETER_COUNT: usize = [$(ParameterId::$id),*].len();
    };
}

parameters! {
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
            (9, "9600"),
            (19, "19200"),
            (38, "38400"),
            (57, "57600"),
            (111, "111100"),
            (115, "115200"),
            (230, "230400"),
            (256, "256000"),
            (460, "460800"),
            (500, "500000"),
            (921, "921600"),
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
    BattMonitor {
        key: 64,
        name: "BATT_MONITOR",
        kind: Kind::Int8,
        default: 3.0,
        range: Range::OneOf(&[(0, "Disabled"), (3, "Analog Voltage Only")]),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AfterReboot,
        label: "Battery monitoring",
        description: "How the battery is monitored.",
    }
    BattVoltPin {
        key: 65,
        name: "BATT_VOLT_PIN",
        kind: Kind::Int8,
        default: 26.0,
        range: Range::OneOf(&[(26, "GP26"), (27, "GP27"), (28, "GP28"), (29, "GP29")]),
        step: 1.0,
        unit: "",
        takes_effect: TakesEffect::AtOnce,
        label: "Battery voltage pin",
        description: "The GPIO number of the analog pin that senses the battery's voltage. \
                      The Freenove board has its divider on GP26.",
    }
    BattVoltMult {
        key: 66,
        name: "BATT_VOLT_MULT",
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
    BattVltOffset {
        key: 67,
        name: "BATT_VLT_OFFSET",
        kind: Kind::Real32,
        default: 0.0,
        range: Range::Between(-3.3, 3.3),
        step: 0.01,
        unit: "V",
        takes_effect: TakesEffect::AtOnce,
        label: "Voltage offset",
        description: "The voltage at the pin when the battery's voltage is zero.",
    }
}
