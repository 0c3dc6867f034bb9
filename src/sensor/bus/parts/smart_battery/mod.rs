//! Smart batteries by the Smart Battery Data Specification 1.1, as ArduPilot's generic driver reads them.

mod dialect;

use dialect::{Button, Current, Framing, Voltage, cell_voltages, sum_v};
pub(in crate::sensor::bus) use dialect::{
    Dialect, GENERIC, MAXELL, NEO_DESIGN, ROTOYE, SOLO, SUI_3_CELLS, SUI_6_CELLS,
};

use crate::battery::{
    BusError, ChargeState, Chemistry, Date, Faults, Gauge, GaugeReading, Measurement, Modes, Name,
    PackDetails, ReadError, Reported, Supply,
};
use crate::log::info;
use crate::sensor::bus::part::Part;
use crate::sensor::bus::smbus::{PacketErrorCode, SmBus};
use crate::sensor::bus::{Address, SensorBus, Wiring};

// Commands of the specification, chapter 5.1.
const BATTERY_MODE: u8 = 0x03;
const VOLTAGE: u8 = 0x09;
const CURRENT: u8 = 0x0a;
const MAX_ERROR: u8 = 0x0c;
const REMAINING_CAPACITY: u8 = 0x0f;
const FULL_CHARGE_CAPACITY: u8 = 0x10;
const BATTERY_STATUS: u8 = 0x16;
const CYCLE_COUNT: u8 = 0x17;
const DESIGN_CAPACITY: u8 = 0x18;
const DESIGN_VOLTAGE: u8 = 0x19;
const SPECIFICATION_INFO: u8 = 0x1a;
const MANUFACTURE_DATE: u8 = 0x1b;
const SERIAL_NUMBER: u8 = 0x1c;
const MANUFACTURER_NAME: u8 = 0x20;
const DEVICE_NAME: u8 = 0x21;
const DEVICE_CHEMISTRY: u8 = 0x22;

/// Battery mode: capacities are in steps of 10 mWh instead of 1 mAh.
const CAPACITY_MODE: u16 = 1 << 15;

/// Battery status: fully charged.
const FULLY_CHARGED: u16 = 1 << 5;

/// Its alarms: over temperature, and terminate discharge, with which a battery that is empty stops its load. That is no fault:
/// charged, it is as good as before.
const OVER_TEMPERATURE: u16 = 1 << 12;
const TERMINATE_DISCHARGE: u16 = 1 << 11;

/// The first version of the specification with a packet error code.
const VERSION_WITH_CODE: u16 = 3;

/// Says it had a packet error code, and has not (as ArduPilot found).
const WITHOUT_CODE: &[u8] = b"Hitachi maxell";

/// The highest power of ten that values are in steps of.
const HIGHEST_EXPONENT: u16 = 3;

/// A word that is not filled in.
const BLANK: u16 = 0xffff;

/// Bytes that a battery with a button reports of it.
const BUTTON_BYTES: usize = 6;

/// The button counts as held after this many readings in a row, as in ArduPilot.
const PRESSES_UNTIL_OFF: u8 = 7;

const ZERO_CELSIUS_K: f32 = 273.15;

/// Years are counted from here.
const FIRST_YEAR: u16 = 1980;

/// Facts that a battery is asked for once.
const INTRODUCTION: [u8; 8] = [
    BATTERY_MODE,
    VOLTAGE,
    FULL_CHARGE_CAPACITY,
    CYCLE_COUNT,
    DESIGN_CAPACITY,
    DESIGN_VOLTAGE,
    MANUFACTURE_DATE,
    SERIAL_NUMBER,
];

/// Address of every smart battery.
const ADDRESSES: [Address; 1] = [Address::I2c(0x0b)];

/// A smart battery that answered.
#[derive(Debug)]
pub(in crate::sensor::bus) struct SmartBattery {
    address: Address,
    dialect: &'static Dialect,
    code: PacketErrorCode,
    scale: Scale,
    cells: usize,
    /// For how many readings in a row its button has been pressed.
    presses: u8,
    /// Serial number, to notice another battery.
    serial: Option<u16>,
    details: PackDetails,
    reported: Reported,
    full_mah: Option<f32>,
    /// The slow value that is read next, by turns.
    slow_command: u8,
}

/// Units of the words of a battery.
#[derive(Clone, Copy, Debug)]
struct Scale {
    /// Volts.
    voltage: f32,
    /// Amperes.
    current: f32,
    /// Milliampere-hours.
    capacity: f32,
}

impl Part for SmartBattery {
    type Model = Dialect;

    const INTERVAL_US: u64 = 100_000;
    /// The specification's limit.
    const HIGHEST_CLOCK_HZ: u32 = 100_000;
    const REFUSES_COMMANDS: bool = true;

    fn addresses(_: &Dialect) -> &'static [Address] {
        &ADDRESSES
    }

    async fn set_up(
        bus: &mut impl SensorBus,
        address: Address,
        _: &Wiring,
        dialect: &'static Dialect,
    ) -> Result<Self, ReadError> {
        // A battery without packet error code can't send it, and one with it can be asked without.
        let mut commands = SmBus::new(bus, address, dialect.code.unwrap_or(PacketErrorCode::Absent));
        dialect.read_voltage(&mut commands).await?;
        let mut commands = SmBus::new(bus, address, PacketErrorCode::Absent);
        let [info] = commands.words([SPECIFICATION_INFO]).await?.map(known);
        let [manufacturer] = commands.names([MANUFACTURER_NAME]).await?;
        let code = dialect
            .code
            .unwrap_or_else(|| packet_error_code(info, manufacturer));
        let mut commands = SmBus::new(bus, address, code);
        let words = commands.words(INTRODUCTION).await?.map(known);
        let [manufacturer, device, chemistry] = commands
            .names([MANUFACTURER_NAME, DEVICE_NAME, DEVICE_CHEMISTRY])
            .await?;
        let [
            mode,
            voltage,
            full,
            cycles,
            design_capacity,
            design_voltage,
            manufactured,
            serial,
        ] = words;
        let scale = Scale::new(info.unwrap_or(0), dialect)?.in_mode(mode, design_voltage);
        let pack_v = voltage.map(|voltage| f32::from(voltage) * scale.voltage);
        let cells = dialect.cells.count(&mut commands, pack_v).await?;
        info!("smart battery {:?}, {} cells", address, cells);
        Ok(Self {
            address,
            dialect,
            code,
            scale,
            cells,
            presses: 0,
            serial,
            details: PackDetails {
                manufacturer,
                device,
                serial_number: serial.map(i32::from),
                manufactured: manufactured.and_then(date),
                chemistry: chemistry_of(chemistry),
                cycle_count: cycles,
                design_capacity_mah: filled(design_capacity, scale.capacity),
                design_voltage_v: filled(design_voltage, scale.voltage),
                state_of_health_pct: None,
            },
            reported: Reported::NONE,
            full_mah: filled(full, scale.capacity),
            slow_command: CYCLE_COUNT,
        })
    }

    async fn check(&mut self, bus: &mut impl SensorBus) -> Result<(), ReadError> {
        if self.serial.is_none() {
            return Ok(());
        }
        let [serial] = self.commands(bus).words([SERIAL_NUMBER]).await?;
        match serial {
            None => Err(BusError::NoAnswer.into()),
            Some(_) if serial == self.serial => Ok(()),
            Some(_) => Err(ReadError::OtherPart),
        }
    }

    async fn read(&mut self, bus: &mut impl SensorBus, _: &Wiring) -> Result<Measurement, ReadError> {
        // First, and well after the voltages: SUI's batteries are known to stall otherwise.
        let current_a = self.current_a(bus).await?;
        let [voltage, remaining, slow] = self
            .commands(bus)
            .words([VOLTAGE, REMAINING_CAPACITY, self.slow_command])
            .await?
            .map(known);
        self.note_slow(slow);
        let pack_v = voltage.map(|voltage| f32::from(voltage) * self.scale.voltage);
        let cells_mv = self
            .dialect
            .cells
            .read(&mut self.commands(bus), self.cells)
            .await?;
        let voltage_v = match self.dialect.voltage {
            Voltage::OfPack => pack_v.ok_or(BusError::NoAnswer)?,
            Voltage::SumOfCells => sum_v(&cells_mv, self.cells).ok_or(BusError::NoAnswer)?,
        };
        Ok(Measurement {
            voltage_v: Some(voltage_v),
            current_a,
            gauge: GaugeReading::expected(remaining.zip(self.full_mah).map(|(remaining, full_mah)| Gauge {
                remaining_mah: f32::from(remaining) * self.scale.capacity,
                full_mah,
            })),
            temperature_c: self.temperature_c(bus).await?,
            cells: cell_voltages(voltage_v, &cells_mv),
            details: self.details,
            reported: self.reported,
            supply: self.supply(bus).await?,
            ..Measurement::default()
        })
    }
}

impl Dialect {
    /// Reads the voltage where the dialect has it. Every battery reports that, so without it none is connected, whose other
    /// answers would all count as refused.
    async fn read_voltage<B: SensorBus>(&self, commands: &mut SmBus<'_, B>) -> Result<(), ReadError> {
        match self.voltage {
            Voltage::OfPack => {
                let [voltage] = commands.words([VOLTAGE]).await?.map(known);
                voltage.map(|_| ()).ok_or(BusError::NoAnswer.into())
            }
            Voltage::SumOfCells => {
                let count = self.cells.count(commands, None).await?;
                let cells_mv = self.cells.read(commands, count).await?;
                sum_v(&cells_mv, count)
                    .map(|_| ())
                    .ok_or(BusError::NoAnswer.into())
            }
        }
    }
}

impl SmartBattery {
    fn commands<'a, B: SensorBus>(&self, bus: &'a mut B) -> SmBus<'a, B> {
        SmBus::new(bus, self.address, self.code)
    }

    /// A word that is refused once stays as it was.
    fn note_slow(&mut self, word: Option<u16>) {
        self.slow_command = match self.slow_command {
            CYCLE_COUNT => {
                self.details.cycle_count = word.or(self.details.cycle_count);
                FULL_CHARGE_CAPACITY
            }
            FULL_CHARGE_CAPACITY => {
                self.full_mah = filled(word, self.scale.capacity).or(self.full_mah);
                BATTERY_STATUS
            }
            BATTERY_STATUS => {
                if let Some(status) = word {
                    let is_empty = status & TERMINATE_DISCHARGE != 0;
                    self.reported.charge_state = is_empty.then_some(ChargeState::Emergency);
                    self.reported
                        .faults
                        .set(Faults::OVER_TEMPERATURE, status & OVER_TEMPERATURE != 0);
                    self.reported.modes.set(Modes::FULL, status & FULLY_CHARGED != 0);
                }
                MAX_ERROR
            }
            _ => {
                let error_pct = word.and_then(|word| u8::try_from(word).ok());
                self.reported.gauge.error_pct = error_pct.filter(|percent| *percent <= 100);
                CYCLE_COUNT
            }
        };
        self.details.state_of_health_pct = self.state_of_health_pct();
    }

    /// Its capacity as a share of that of its design. A new battery may hold more.
    fn state_of_health_pct(&self) -> Option<u8> {
        let share = self.full_mah? / self.details.design_capacity_mah?;
        Some((share * 100.0 + 0.5).min(100.0) as u8)
    }

    /// The specification counts what flows into the battery.
    async fn current_a(&self, bus: &mut impl SensorBus) -> Result<Option<f32>, ReadError> {
        match self.dialect.current {
            Current::Word => {
                let [current] = self.commands(bus).words([CURRENT]).await?;
                Ok(current.map(|current| -f32::from(current as i16) * self.scale.current))
            }
            Current::WordOrTenths { tenths } => {
                let [current, tenths] = self.commands(bus).words([CURRENT, tenths]).await?;
                let current_a = current.map(|current| -f32::from(current as i16) * self.scale.current);
                let tenths_a = known(tenths).map(|tenths| -f32::from(tenths as i16) * 0.1);
                Ok(tenths_a.or(current_a))
            }
            Current::Long { command, framing } => {
                let mut commands = self.commands(bus);
                let milliamperes = match framing {
                    Framing::Block => commands.block(command).await?,
                    Framing::Bare => commands.bare(command).await?,
                };
                Ok(Some(-(i32::from_le_bytes(milliamperes) as f32) * 1e-3))
            }
        }
    }

    /// Of the hottest place. A sensor that is not fitted reads 0 or nothing.
    async fn temperature_c(&self, bus: &mut impl SensorBus) -> Result<Option<f32>, ReadError> {
        let mut hottest = None;
        for command in self.dialect.temperatures {
            let [tenths_k] = self.commands(bus).words([*command]).await?.map(known);
            hottest = hottest.max(tenths_k.filter(|tenths_k| *tenths_k > 0));
        }
        Ok(hottest.map(|tenths_k| f32::from(tenths_k) * 0.1 - ZERO_CELSIUS_K))
    }

    /// Whether it is being switched off by its button.
    async fn supply(&mut self, bus: &mut impl SensorBus) -> Result<Supply, ReadError> {
        let Some(Button { command, byte, bit }) = self.dialect.button else {
            return Ok(Supply::On);
        };
        let state: [u8; BUTTON_BYTES] = self.commands(bus).block(command).await?;
        let is_pressed = state.get(byte).is_some_and(|byte| byte & bit != 0);
        self.presses = if is_pressed {
            self.presses.saturating_add(1)
        } else {
            0
        };
        Ok(if self.presses >= PRESSES_UNTIL_OFF {
            Supply::PoweringOff
        } else {
            Supply::On
        })
    }
}

fn packet_error_code(info: Option<u16>, manufacturer: Name) -> PacketErrorCode {
    let version = info.unwrap_or(0) >> 4 & 0xf;
    if version >= VERSION_WITH_CODE && manufacturer.as_bytes() != WITHOUT_CODE {
        PacketErrorCode::Sent
    } else {
        PacketErrorCode::Absent
    }
}

impl Scale {
    /// The specification info has powers of ten for voltages, and for currents and capacities.
    fn new(info: u16, dialect: &Dialect) -> Result<Self, ReadError> {
        let [voltage, current] = [8, 12].map(|at| info >> at & 0xf);
        if voltage > HIGHEST_EXPONENT || current > HIGHEST_EXPONENT {
            return Err(ReadError::OtherPart);
        }
        Ok(Self {
            voltage: 1e-3 * power_of_ten(voltage),
            current: 1e-3 * power_of_ten(current),
            capacity: power_of_ten(current) * dialect.capacity_factor,
        })
    }

    /// A battery that counts energy, in steps of 10 mWh, has the charge that is at its design voltage.
    fn in_mode(self, mode: Option<u16>, design_voltage: Option<u16>) -> Self {
        match filled(design_voltage, self.voltage) {
            Some(design_voltage_v) if mode.unwrap_or(0) & CAPACITY_MODE != 0 => Self {
                capacity: self.capacity * 10.0 / design_voltage_v,
                ..self
            },
            _ => self,
        }
    }
}

fn power_of_ten(exponent: u16) -> f32 {
    (0..exponent).fold(1.0, |power, _| power * 10.0)
}

/// Value of a word; 0 is not filled in.
fn filled(word: Option<u16>, step: f32) -> Option<f32> {
    word.filter(|word| *word > 0).map(|word| f32::from(word) * step)
}

/// A word that is filled in. Undriven lines read as one that is not.
fn known(word: Option<u16>) -> Option<u16> {
    word.filter(|word| *word != BLANK)
}

/// (year − 1980) × 512 + month × 32 + day.
fn date(word: u16) -> Option<Date> {
    let (month, day) = ((word >> 5 & 0xf) as u8, (word & 0x1f) as u8);
    let is_date = (1..=12).contains(&month) && day >= 1;
    is_date.then_some(Date {
        year: FIRST_YEAR + (word >> 9),
        month,
        day,
    })
}

/// The specification suggests four letters.
fn chemistry_of(name: Name) -> Option<Chemistry> {
    const BEGINNINGS: [(&[u8], Chemistry); 6] = [
        (b"LION", Chemistry::LiIon),
        (b"LI-I", Chemistry::LiIon),
        (b"LIP", Chemistry::LiPo),
        (b"LFP", Chemistry::LiFe),
        (b"LIFE", Chemistry::LiFe),
        (b"NIMH", Chemistry::NiMh),
    ];
    let is_beginning = |letters: &[u8]| {
        let beginning = name.as_bytes().get(..letters.len());
        beginning.is_some_and(|beginning| beginning.eq_ignore_ascii_case(letters))
    };
    let found = BEGINNINGS.iter().find(|(letters, _)| is_beginning(letters));
    found.map(|(_, chemistry)| *chemistry)
}
