//! Smart batteries by the Smart Battery Data Specification 1.1, as ArduPilot's generic driver reads them.

mod dialect;

use dialect::{Button, Current, Framing, Voltage, cell_voltages, cells_of, known, sum_v};
pub(in crate::sensor::bus) use dialect::{
    Dialect, GENERIC, MAXELL, NEO_DESIGN, ROTOYE, SOLO, SUI_3_CELLS, SUI_6_CELLS,
};

use crate::battery::{
    BusError, CellVoltages, ChargeState, Chemistry, CurrentRange, Date, Faults, Gauge, GaugeReading,
    GaugeReport, Measurement, Modes, Name, PackDetails, ReadError, Reported, Supply,
};
use crate::log::info;
use crate::sensor::bus::part::Part;
use crate::sensor::bus::parts::COUNTING_READINGS;
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

/// Battery status: fully charged; empty, which the alarm to terminate the discharge says, too; below the remaining capacity at
/// which the battery warns. None of these is a fault: charged, it is as good as before.
const FULLY_CHARGED: u16 = 1 << 5;
const EMPTY: u16 = 1 << 4 | 1 << 11;
const REMAINING_CAPACITY_ALARM: u16 = 1 << 9;

/// Its alarm of a fault.
const OVER_TEMPERATURE: u16 = 1 << 12;

/// The first version of the specification with a packet error code.
const VERSION_WITH_CODE: u16 = 3;

/// Says it had a packet error code, and has not (as ArduPilot found).
const WITHOUT_CODE: &[u8] = b"Hitachi maxell";

/// The highest power of ten that values are in steps of.
const HIGHEST_EXPONENT: u16 = 3;

/// Bytes that a battery with a button reports of it.
const BUTTON_BYTES: usize = 6;

/// The button counts as held after this many readings in a row, as in ArduPilot.
const PRESSES_UNTIL_OFF: u8 = 7;

const ZERO_CELSIUS_K: f32 = 273.15;

/// Years are counted from here.
const FIRST_YEAR: u16 = 1980;

/// Facts that a battery is asked for when it is met, or is back after a silence, and then in each turn until it has answered.
const FACTS: [u8; 8] = [
    MANUFACTURER_NAME,
    DEVICE_NAME,
    DEVICE_CHEMISTRY,
    DESIGN_CAPACITY,
    DESIGN_VOLTAGE,
    MANUFACTURE_DATE,
    SERIAL_NUMBER,
    SPECIFICATION_INFO,
];

/// Values of which each reading has the next one.
const SLOW: [u8; 4] = [CYCLE_COUNT, FULL_CHARGE_CAPACITY, BATTERY_STATUS, MAX_ERROR];

/// Readings of a turn, which takes a little more than a second and ends with the facts.
const TURN: u8 = 12;

/// A fact that was refused in the introduction, which takes the place of the first turn, and in each of the two turns after
/// that is taken as missing.
const SETTLED: u8 = 3 * TURN;

/// The last turn is repeated. It is after those in which cells are counted.
const LAST_COUNTING: u8 = TURN + COUNTING_READINGS;
const LAST_TURN: u8 = LAST_COUNTING.next_multiple_of(TURN);

/// After this many failed readings in a row a battery was silent for more than a second.
const SILENT: u8 = 5;

/// Address of every smart battery.
const ADDRESSES: [Address; 1] = [Address::I2c(0x0b)];

/// A smart battery that answered. Its words are as it sent them; `None` are those that it has refused so far.
#[derive(Debug)]
pub(in crate::sensor::bus) struct SmartBattery {
    address: Address,
    dialect: &'static Dialect,
    info: Option<u16>,
    mode: Option<u16>,
    full: Option<u16>,
    status: Option<u16>,
    max_error: Option<u16>,
    cycles: Option<u16>,
    design_capacity: Option<u16>,
    design_voltage: Option<u16>,
    manufactured: Option<u16>,
    /// To notice another battery.
    serial: Option<u16>,
    manufacturer: Name,
    device: Name,
    chemistry: Option<Chemistry>,
    /// 0 if they are not known.
    cells: u8,
    /// For how many readings in a row its button has been pressed.
    presses: u8,
    /// Readings that have failed in a row.
    failures: u8,
    /// Readings since the introduction began, up to those of the last turn.
    readings: u8,
}

/// Units of the words of a battery.
#[derive(Clone, Copy, Debug)]
struct Scale {
    /// Volts.
    voltage: f32,
    /// Amperes.
    current: f32,
    /// Milliampere-hours, once that is known.
    capacity: Option<f32>,
}

impl Part for SmartBattery {
    type Model = Dialect;

    const INTERVAL_US: u64 = 100_000;
    /// The specification's limit.
    const HIGHEST_CLOCK_HZ: u32 = 100_000;
    const IS_ANNOUNCED: bool = true;

    fn addresses(_: &Dialect) -> &'static [Address] {
        &ADDRESSES
    }

    async fn set_up(
        bus: &mut impl SensorBus,
        address: Address,
        _: &Wiring,
        dialect: &'static Dialect,
    ) -> Result<Self, ReadError> {
        let code = dialect.code.unwrap_or(PacketErrorCode::Absent);
        dialect.read_voltage(&mut SmBus::new(bus, address, code)).await?;
        let mut battery = Self::unknown(address, dialect);
        // A battery without packet error code can't send it, and one with it can be asked without. What says whether it has
        // one is checked with all other facts.
        for fact in [MANUFACTURER_NAME, SPECIFICATION_INFO]
            .iter()
            .chain(&FACTS)
            .chain(&SLOW)
        {
            battery.ask(bus, *fact).await?;
        }
        info!("smart battery {:?}, info {:?}", address, battery.info);
        Ok(battery)
    }

    async fn begin_turn(&mut self, bus: &mut impl SensorBus) -> Result<(), ReadError> {
        let was_silent = self.failures >= SILENT;
        // Until it was read.
        self.failures = self.failures.saturating_add(1);
        let Some(serial) = self.serial else {
            if was_silent {
                let mut commands = self.commands(bus);
                self.dialect.read_voltage(&mut commands).await?;
                return Err(ReadError::OtherPart);
            }
            return Ok(());
        };
        let answer = self.commands(bus).word(SERIAL_NUMBER).await?;
        if answer.ok_or(BusError::NoAnswer)? != serial {
            return Err(ReadError::OtherPart);
        }
        if was_silent {
            self.readings = 0;
        }
        Ok(())
    }

    async fn read(&mut self, bus: &mut impl SensorBus, _: &Wiring) -> Result<Measurement, ReadError> {
        let has_scale = self.has_scale();
        // First, and well after the voltages: SUI's batteries are known to stall otherwise.
        let (current_a, current_range) = self.current_a(bus).await?;
        let mut commands = self.commands(bus);
        let voltage = known(commands.word(VOLTAGE).await?);
        let mode = known(commands.word(BATTERY_MODE).await?);
        let remaining = known(commands.word(REMAINING_CAPACITY).await?);
        self.note_mode(mode);
        let scale = self.scale();
        let pack_v = voltage.map(|voltage| f32::from(voltage) * scale.voltage);
        let (voltage_v, cells) = self.voltages(bus, pack_v).await?;
        self.ask_next(bus).await?;
        if !has_scale {
            self.failures = 0;
            return Err(ReadError::Timeout);
        }
        let of_capacity = |word: Option<u16>| filled(word, scale.capacity?);
        let gauge = remaining.zip(of_capacity(self.full)).zip(scale.capacity);
        let reading = Measurement {
            voltage_v: Some(voltage_v),
            current_a,
            current_range: match gauge {
                Some(_) => current_range.counted(),
                None => current_range,
            },
            gauge: GaugeReading::expected(gauge.map(|((remaining, full_mah), step_mah)| Gauge {
                remaining_mah: f32::from(remaining) * step_mah,
                full_mah,
            })),
            temperature_c: self.temperature_c(bus).await?,
            cells,
            details: PackDetails {
                manufacturer: self.manufacturer,
                device: self.device,
                serial_number: self.serial.map(i32::from),
                manufactured: self.manufactured.and_then(date),
                chemistry: self.chemistry,
                cycle_count: self.cycles,
                design_capacity_mah: of_capacity(self.design_capacity),
                design_voltage_v: filled(self.design_voltage, scale.voltage),
                state_of_health_pct: self.state_of_health_pct(),
            },
            reported: self.reported(),
            supply: self.supply(bus).await?,
            ..Measurement::default()
        };
        self.failures = 0;
        Ok(reading)
    }
}

impl Dialect {
    /// Reads the voltage where the dialect has it. Every battery reports that, so without it none is connected, whose other
    /// answers would all count as refused.
    async fn read_voltage<B: SensorBus>(&self, commands: &mut SmBus<'_, B>) -> Result<(), ReadError> {
        match self.voltage {
            Voltage::OfPack => {
                let voltage = known(commands.word(VOLTAGE).await?);
                voltage.map(|_| ()).ok_or(BusError::NoAnswer.into())
            }
            Voltage::SumOfCells => {
                let count = self.cells.fixed();
                let cells_mv = self.cells.read(commands, count).await?;
                sum_v(&cells_mv, count)
                    .map(|_| ())
                    .ok_or(BusError::NoAnswer.into())
            }
        }
    }
}

impl SmartBattery {
    fn unknown(address: Address, dialect: &'static Dialect) -> Self {
        Self {
            address,
            dialect,
            info: None,
            mode: None,
            full: None,
            status: None,
            max_error: None,
            cycles: None,
            design_capacity: None,
            design_voltage: None,
            manufactured: None,
            serial: None,
            manufacturer: Name::EMPTY,
            device: Name::EMPTY,
            chemistry: None,
            cells: dialect.cells.fixed() as u8,
            presses: 0,
            failures: 0,
            readings: TURN,
        }
    }

    fn commands<'a, B: SensorBus>(&self, bus: &'a mut B) -> SmBus<'a, B> {
        let code = self.dialect.code.unwrap_or_else(|| self.packet_error_code());
        SmBus::new(bus, self.address, code)
    }

    fn packet_error_code(&self) -> PacketErrorCode {
        let version = self.info.unwrap_or(0) >> 4 & 0xf;
        if version >= VERSION_WITH_CODE && self.manufacturer.as_bytes() != WITHOUT_CODE {
            PacketErrorCode::Sent
        } else {
            PacketErrorCode::Absent
        }
    }

    /// Whether what it has refused until now is missing.
    fn is_settled(&self) -> bool {
        self.readings >= SETTLED
    }

    /// Whether its voltages and currents are scaled as it has said, or it does not say that.
    fn has_scale(&self) -> bool {
        self.info.is_some() || self.is_settled()
    }

    /// Whether it is the turn of the cells to be counted.
    fn counts_cells(&self) -> bool {
        self.has_scale() && self.readings < LAST_COUNTING && self.readings.is_multiple_of(TURN)
    }

    /// Asks for what is next.
    async fn ask_next(&mut self, bus: &mut impl SensorBus) -> Result<(), ReadError> {
        let reading = self.readings;
        self.readings = match reading + 1 {
            next if next == LAST_TURN + TURN => LAST_TURN,
            next => next,
        };
        let place = usize::from(reading % TURN);
        if let Some(slow) = SLOW.get(place % SLOW.len()) {
            self.ask(bus, *slow).await?;
        }
        let fact = FACTS.get((place + FACTS.len()).wrapping_sub(TURN.into()));
        if let Some(fact) = fact.filter(|fact| reading < TURN || self.is_unknown(**fact)) {
            self.ask(bus, *fact).await?;
        }
        Ok(())
    }

    /// A value that is refused stays as it was.
    async fn ask(&mut self, bus: &mut impl SensorBus, command: u8) -> Result<(), ReadError> {
        let mut commands = self.commands(bus);
        let Some(place) = self.word(command) else {
            let name = commands.name(command).await?;
            self.note_name(command, name);
            return Ok(());
        };
        let is_serial = command == SERIAL_NUMBER;
        let answer = known(commands.word(command).await?);
        let before = *place;
        // A serial number of 0 is not filled in.
        *place = answer.filter(|word| !is_serial || *word != 0).or(before);
        match command {
            SPECIFICATION_INFO | SERIAL_NUMBER if before.is_some() && *place != before => {
                Err(ReadError::OtherPart)
            }
            SPECIFICATION_INFO => Scale::check(self.info),
            _ => Ok(()),
        }
    }

    fn note_name(&mut self, command: u8, name: Name) {
        match command {
            _ if name.is_empty() => {}
            MANUFACTURER_NAME => self.manufacturer = name,
            DEVICE_NAME => self.device = name,
            _ => self.chemistry = chemistry_of(name),
        }
    }

    fn is_unknown(&mut self, command: u8) -> bool {
        match (self.word(command), command) {
            (Some(word), _) => word.is_none(),
            (None, MANUFACTURER_NAME) => self.manufacturer.is_empty(),
            (None, DEVICE_NAME) => self.device.is_empty(),
            (None, _) => self.chemistry.is_none(),
        }
    }

    /// Takes the mode of a reading. In another one the capacities are other numbers.
    fn note_mode(&mut self, mode: Option<u16>) {
        let before = self.mode;
        self.mode = mode.or(before);
        if before.is_some_and(|before| (before ^ self.mode.unwrap_or(before)) & CAPACITY_MODE != 0) {
            (self.full, self.design_capacity) = (None, None);
        }
    }

    /// Place of the answer to a command; `None` if that is a name.
    fn word(&mut self, command: u8) -> Option<&mut Option<u16>> {
        Some(match command {
            FULL_CHARGE_CAPACITY => &mut self.full,
            BATTERY_STATUS => &mut self.status,
            CYCLE_COUNT => &mut self.cycles,
            MAX_ERROR => &mut self.max_error,
            DESIGN_CAPACITY => &mut self.design_capacity,
            DESIGN_VOLTAGE => &mut self.design_voltage,
            SPECIFICATION_INFO => &mut self.info,
            MANUFACTURE_DATE => &mut self.manufactured,
            SERIAL_NUMBER => &mut self.serial,
            _ => return None,
        })
    }
    /// Its units. A battery that counts energy, in steps of 10 mWh, has the charge that is at its design voltage.
    fn scale(&self) -> Scale {
        let info = self.info.unwrap_or(0);
        let [voltage, current] = exponents(info).map(power_of_ten);
        let voltage_v = 1e-3 * voltage;
        let charge_mah = current * self.dialect.capacity_factor;
        let mode = self.mode.or(self.is_settled().then_some(0));
        Scale {
            voltage: voltage_v,
            current: 1e-3 * current,
            capacity: match mode.map(|mode| mode & CAPACITY_MODE) {
                None => None,
                Some(0) => Some(charge_mah),
                Some(_) => {
                    filled(self.design_voltage, voltage_v).map(|design_v| charge_mah * 10.0 / design_v)
                }
            },
        }
    }

    /// The pack's, and those of its cells. Once in a turn they are counted.
    async fn voltages(
        &mut self,
        bus: &mut impl SensorBus,
        pack_v: Option<f32>,
    ) -> Result<(f32, CellVoltages), ReadError> {
        let mut commands = self.commands(bus);
        let cells = &self.dialect.cells;
        let count = match self.cells {
            0 if self.counts_cells() => cells.most(&mut commands).await?,
            known => known.into(),
        };
        let cells_mv = cells.read(&mut commands, count).await?;
        let voltage_v = match self.dialect.voltage {
            Voltage::OfPack => pack_v,
            Voltage::SumOfCells => sum_v(&cells_mv, count),
        };
        let voltage_v = voltage_v.ok_or(BusError::NoAnswer)?;
        if self.cells == 0 {
            self.cells = cells_of(voltage_v, &cells_mv) as u8;
        }
        Ok((voltage_v, cell_voltages(voltage_v, &cells_mv, self.cells.into())))
    }

    fn reported(&self) -> Reported {
        let status = self.status.unwrap_or(0);
        let has = |flags: u16| status & flags != 0;
        let mut reported = Reported {
            charge_state: if has(EMPTY) {
                Some(ChargeState::Emergency)
            } else {
                has(REMAINING_CAPACITY_ALARM).then_some(ChargeState::Low)
            },
            gauge: GaugeReport {
                error_pct: self
                    .max_error
                    .filter(|percent| *percent <= 100)
                    .map(|percent| percent as u8),
                ..GaugeReport::NONE
            },
            ..Reported::NONE
        };
        reported
            .faults
            .set(Faults::OVER_TEMPERATURE, has(OVER_TEMPERATURE));
        reported.modes.set(Modes::FULL, has(FULLY_CHARGED));
        reported
    }

    /// Its capacity as a share of that of its design. A new battery may hold more.
    fn state_of_health_pct(&self) -> Option<u8> {
        let share = filled(self.full, 100.0)? / filled(self.design_capacity, 1.0)?;
        Some((share + 0.5).min(100.0) as u8)
    }

    /// The current, and whether its word shows it. The specification counts what flows into the battery.
    async fn current_a(&self, bus: &mut impl SensorBus) -> Result<(Option<f32>, CurrentRange), ReadError> {
        let value = |word: Option<u16>, step_a: f32| {
            let current_a = word.map(|word| -f32::from(word as i16) * step_a);
            let range = word.map(|word| CurrentRange::of_word(word as i16));
            (current_a, range.unwrap_or_default())
        };
        match self.dialect.current {
            Current::Word => {
                let current = self.commands(bus).word(CURRENT).await?;
                Ok(value(current, self.scale().current))
            }
            Current::WordOrTenths { tenths } => {
                let current = self.commands(bus).word(CURRENT).await?;
                let tenths = known(self.commands(bus).word(tenths).await?);
                Ok(match tenths {
                    None => value(current, self.scale().current),
                    tenths => value(tenths, 0.1),
                })
            }
            Current::Long { command, framing } => {
                let mut commands = self.commands(bus);
                let milliamperes = match framing {
                    Framing::Block => commands.block(command).await?,
                    Framing::Bare => commands.bare(command).await?,
                };
                let current_a = -(i32::from_le_bytes(milliamperes) as f32) * 1e-3;
                Ok((Some(current_a), CurrentRange::Within))
            }
        }
    }

    /// Of the hottest place. A sensor that is not fitted reads 0 or nothing.
    async fn temperature_c(&self, bus: &mut impl SensorBus) -> Result<Option<f32>, ReadError> {
        let mut hottest = None;
        for command in self.dialect.temperatures {
            let tenths_k = known(self.commands(bus).word(*command).await?);
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

impl Scale {
    /// Makes sure that a specification information has a scale that is known.
    fn check(info: Option<u16>) -> Result<(), ReadError> {
        let is_known = |exponent: &u16| *exponent <= HIGHEST_EXPONENT;
        match exponents(info.unwrap_or(0)).iter().all(is_known) {
            true => Ok(()),
            false => Err(ReadError::OtherPart),
        }
    }
}

/// The specification information has powers of ten for voltages, and for currents and capacities.
fn exponents(info: u16) -> [u16; 2] {
    [8, 12].map(|at| info >> at & 0xf)
}

fn power_of_ten(exponent: u16) -> f32 {
    (0..exponent).fold(1.0, |power, _| power * 10.0)
}

/// Value of a word; 0 is not filled in.
fn filled(word: Option<u16>, step: f32) -> Option<f32> {
    word.filter(|word| *word > 0).map(|word| f32::from(word) * step)
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
