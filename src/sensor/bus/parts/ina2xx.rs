//! Texas Instruments' power monitors with one channel: INA219 (SBOS448), INA226 (SBOS547), INA228 (SLYS021),
//! INA231 (SBOS644), INA238 (SLYS025), INA260 (SBOS656), and by SPI INA239 (SLYS027).
//!
//! They differ in where their registers are and how fine they are, so one driver reads them by a table. The current comes
//! from the voltage over the shunt, not from the part's current register: that one needs a calibration, which a part whose
//! supply dipped has forgotten, and then it reads 0 A.

use core::ops::RangeInclusive;

use super::{TEXAS_INSTRUMENTS, positive_voltage};
use crate::battery::{Consumed, Counted, CurrentRange, Measurement, ReadError};
use crate::log::info;
use crate::sensor::bus::part::{FAST_MODE_HZ, Part};
use crate::sensor::bus::registers::Registers;
use crate::sensor::bus::{Address, SensorBus, Wiring};

/// The lowest four bits of an identification are the revision.
const REVISION: u16 = 0xf;

/// Values of [`Model::range_register`].
const RESET: u16 = 1 << 15;
const WIDE_RANGE: u16 = 0;

/// Identification, set-up and registers of a part.
#[derive(Debug)]
struct Model {
    name: &'static str,
    identity: Identity,
    /// Another register, which resets the part by its highest bit, and is 0 for the wide range of the shunt's voltage. A narrow
    /// one that was set before would show four times the current.
    range_register: Option<u8>,
    configuration_register: u8,
    /// Continuous conversions, averaged over a little less than the polling interval, so that little is missed between two
    /// readings.
    configuration: u16,
    /// In volts.
    voltage: Quantity,
    current: Current,
    counters: Option<Counters>,
}

/// Identification of a part.
#[derive(Debug)]
enum Identity {
    /// Its maker's number and its own, in these registers.
    Numbered {
        manufacturer_register: u8,
        register: u8,
        number: u16,
    },
    /// It has no numbers, but its configuration is this after a reset.
    Configured(u16),
}

/// A register and what a step of it is worth.
#[derive(Debug)]
struct Quantity {
    register: u8,
    width: Width,
    step: f32,
}

#[derive(Clone, Copy, Debug)]
enum Width {
    /// Two bytes.
    Bits16,
    /// Two bytes, whose codes end at ±32,000.
    Decimal,
    /// The upper 13 bits of two bytes, without a sign; flags follow.
    Bits13,
    /// The upper 20 bits of three bytes; the others are always 0.
    Bits20,
}

impl Width {
    /// The ends of the codes, which everything beyond them reads as, too.
    fn ends(self) -> RangeInclusive<i32> {
        let bits = match self {
            Self::Decimal => return -32_000..=32_000,
            Self::Bits13 => return -1..=(1 << 13) - 1,
            Self::Bits16 => 16,
            Self::Bits20 => 20,
        };
        -1 << (bits - 1)..=(1 << (bits - 1)) - 1
    }
}

#[derive(Debug)]
enum Current {
    /// The voltage over the shunt, in volts.
    OverShunt(Quantity),
    /// The shunt is in the part: in amperes.
    Inside(Quantity),
}

/// The INA228 adds up charge and energy itself, each in 40 bits that start over when they are full.
#[derive(Debug)]
struct Counters {
    calibration_register: u8,
    /// The calibration for a step of one ampere and a shunt of one ohm.
    calibration: f32,
    /// Steps of the current in the highest current.
    steps: f32,
    charge_register: u8,
    energy_register: u8,
    /// Joules in a step of the energy, for each ampere in a step of the current.
    energy_step: f32,
}

/// Parts that are distinguished by their identification.
#[derive(Debug)]
pub(in crate::sensor::bus) struct Family {
    addresses: &'static [Address],
    models: &'static [Model],
}

/// Parts with an I2C bus.
pub(in crate::sensor::bus) static ON_I2C: Family = Family {
    addresses: &[
        // Addresses that are set by a wire to ground or to the supply.
        Address::I2c(0x40),
        Address::I2c(0x41),
        Address::I2c(0x44),
        Address::I2c(0x45),
    ],
    models: &I2C_MODELS,
};

/// The one with an SPI bus.
pub(in crate::sensor::bus) static ON_SPI: Family = Family {
    addresses: &[Address::ChipSelect],
    models: &[Model {
        name: "INA239",
        identity: numbered(0x3e, 0x3f, 0x2390),
        ..INA238
    }],
};

const fn numbered(manufacturer_register: u8, register: u8, number: u16) -> Identity {
    Identity::Numbered {
        manufacturer_register,
        register,
        number,
    }
}

static I2C_MODELS: [Model; 6] = [
    INA226,
    Model {
        name: "INA260",
        identity: numbered(0xfe, 0xff, 0x2270),
        range_register: None,
        configuration_register: 0x00,
        // As the INA226.
        configuration: 0x64df,
        voltage: Quantity {
            register: 0x02,
            width: Width::Bits16,
            step: 1.25e-3,
        },
        current: Current::Inside(Quantity {
            register: 0x01,
            width: Width::Bits16,
            step: 1.25e-3,
        }),
        counters: None,
    },
    Model {
        name: "INA228",
        identity: numbered(0x3e, 0x3f, 0x2280),
        range_register: Some(0x00),
        configuration_register: 0x01,
        // 16 times 540 µs for each of both voltages: 17.3 ms. The temperature would be the chip's, not the pack's.
        configuration: 0xb92a,
        voltage: Quantity {
            register: 0x05,
            width: Width::Bits20,
            step: 195.312_5e-6,
        },
        current: Current::OverShunt(Quantity {
            register: 0x04,
            width: Width::Bits20,
            step: 312.5e-9,
        }),
        counters: Some(Counters {
            calibration_register: 0x02,
            calibration: 13_107.2e6,
            steps: 524_288.0,
            charge_register: 0x0a,
            energy_register: 0x09,
            energy_step: 16.0 * 3.2,
        }),
    },
    INA238,
    // Models without numbers come last.
    Model {
        name: "INA231",
        identity: Identity::Configured(0x4127),
        ..INA226
    },
    Model {
        name: "INA219",
        identity: Identity::Configured(0x399f),
        range_register: None,
        configuration_register: 0x00,
        // The wide ranges, 32 V and 320 mV; 16 times 532 µs for each of both voltages: 17 ms.
        configuration: 0x3e67,
        voltage: Quantity {
            register: 0x02,
            width: Width::Bits13,
            step: 4e-3,
        },
        current: Current::OverShunt(Quantity {
            register: 0x01,
            width: Width::Decimal,
            step: 10e-6,
        }),
        counters: None,
    },
];

/// The first of the family.
const INA226: Model = Model {
    name: "INA226",
    identity: numbered(0xfe, 0xff, 0x2260),
    range_register: None,
    configuration_register: 0x00,
    // 16 times 588 µs for each of both voltages: 18.8 ms.
    configuration: 0x44df,
    voltage: Quantity {
        register: 0x02,
        width: Width::Bits16,
        step: 1.25e-3,
    },
    current: Current::OverShunt(Quantity {
        register: 0x01,
        width: Width::Bits16,
        step: 2.5e-6,
    }),
    counters: None,
};

/// An INA228 with 16 bits and without counters.
const INA238: Model = Model {
    name: "INA238",
    identity: numbered(0x3e, 0x3f, 0x2380),
    range_register: Some(0x00),
    configuration_register: 0x01,
    // As the INA228.
    configuration: 0xb92a,
    voltage: Quantity {
        register: 0x05,
        width: Width::Bits16,
        step: 3.125e-3,
    },
    current: Current::OverShunt(Quantity {
        register: 0x04,
        width: Width::Bits16,
        step: 5e-6,
    }),
    counters: None,
};

/// A power monitor that was recognised.
#[derive(Debug)]
pub(in crate::sensor::bus) struct Ina2xx {
    address: Address,
    model: &'static Model,
    counting: Option<Accumulators>,
}

/// Set-up and last reading of the counters of a part.
#[derive(Debug)]
struct Accumulators {
    counters: &'static Counters,
    calibration: u16,
    /// Unit of the current, in amperes.
    step_a: f32,
    last: Option<Codes>,
}

#[derive(Clone, Copy, Debug)]
struct Codes {
    charge: [u8; COUNTER_BYTES],
    energy: [u8; COUNTER_BYTES],
}

const COUNTER_BYTES: usize = 5;

impl Part for Ina2xx {
    type Model = Family;

    const INTERVAL_US: u64 = 25_000;
    const HIGHEST_CLOCK_HZ: u32 = FAST_MODE_HZ;
    /// The conversions of a result, a tenth longer at the most, and the transfers of the set-up.
    const FIRST_RESULT_US: u64 = 30_000;

    fn addresses(family: &'static Family) -> &'static [Address] {
        family.addresses
    }

    async fn set_up(
        bus: &mut impl SensorBus,
        address: Address,
        wiring: &Wiring,
        family: &'static Family,
    ) -> Result<Self, ReadError> {
        let mut registers = Registers::new(bus, address);
        let model = recognise(&mut registers, family).await?;
        if let Some(register) = model.range_register {
            registers.write_u16(register, RESET).await?;
            registers.write_u16(register, WIDE_RANGE).await?;
        }
        registers
            .write_u16(model.configuration_register, model.configuration)
            .await?;
        let counting = model.counters.as_ref().map(|counters| counters.count(wiring));
        if let Some(counting) = &counting {
            registers
                .write_u16(counting.counters.calibration_register, counting.calibration)
                .await?;
        }
        info!("{} {:?}", model.name, address);
        Ok(Self {
            address,
            model,
            counting,
        })
    }

    fn range(&self, wiring: &Wiring) -> Option<(&'static str, f32)> {
        let Current::OverShunt(shunt) = &self.model.current else {
            return None;
        };
        let by_shunt_a = *shunt.width.ends().end() as f32 * shunt.step / wiring.shunt_ohm;
        let by_counters_a = self.counting.as_ref().map(Accumulators::full_scale_a);
        let current_a = by_counters_a.map_or(by_shunt_a, |limit_a| limit_a.min(by_shunt_a));
        Some((self.model.name, current_a))
    }

    async fn read(&mut self, bus: &mut impl SensorBus, wiring: &Wiring) -> Result<Measurement, ReadError> {
        let mut registers = Registers::new(bus, self.address);
        let (voltage_v, range) = self.model.voltage.read(&mut registers).await?;
        let (current_a, mut current_range) = match &self.model.current {
            Current::OverShunt(shunt) => {
                let (shunt_v, range) = shunt.read(&mut registers).await?;
                (shunt_v / wiring.shunt_ohm, range)
            }
            Current::Inside(current) => current.read(&mut registers).await?,
        };
        let codes = match &self.counting {
            Some(counting) => {
                if current_a.abs() >= counting.full_scale_a() {
                    current_range = CurrentRange::Over;
                }
                Some(counting.counters.read(&mut registers).await?)
            }
            None => None,
        };
        self.verify(&mut registers).await?;
        // The sign of a voltage is always 0.
        let voltage_v = positive_voltage(voltage_v, range)?;
        let counting = self.counting.as_mut().zip(codes);
        let counted = counting.and_then(|(counting, codes)| counting.advance(codes));
        Ok(Measurement {
            voltage_v: Some(voltage_v),
            current_a: Some(current_a),
            current_range,
            counted,
            ..Measurement::default()
        })
    }
}

impl Ina2xx {
    /// Makes sure that it is set up.
    async fn verify<B: SensorBus>(&self, registers: &mut Registers<'_, B>) -> Result<(), ReadError> {
        if let Some(register) = self.model.range_register {
            registers.expect_u16(register, WIDE_RANGE).await?;
        }
        if let Some(counting) = &self.counting {
            registers
                .expect_u16(counting.counters.calibration_register, counting.calibration)
                .await?;
        }
        registers
            .expect_u16(self.model.configuration_register, self.model.configuration)
            .await
    }
}

async fn recognise<B: SensorBus>(
    registers: &mut Registers<'_, B>,
    family: &'static Family,
) -> Result<&'static Model, ReadError> {
    for model in family.models {
        if model.is_at(registers).await? {
            return Ok(model);
        }
    }
    Err(ReadError::OtherPart)
}

impl Model {
    async fn is_at<B: SensorBus>(&self, registers: &mut Registers<'_, B>) -> Result<bool, ReadError> {
        match self.identity {
            Identity::Numbered {
                manufacturer_register,
                register,
                number,
            } => {
                let manufacturer = registers.read_u16(manufacturer_register).await?;
                let identity = registers.read_u16(register).await?;
                Ok(manufacturer == TEXAS_INSTRUMENTS && identity & !REVISION == number)
            }
            Identity::Configured(after_reset) => {
                let configuration = registers.read_u16(self.configuration_register).await?;
                // It may have been set up before the board restarted.
                Ok([after_reset, self.configuration].contains(&configuration))
            }
        }
    }
}

impl Quantity {
    /// Its value, and whether that is within the range.
    async fn read<B: SensorBus>(
        &self,
        registers: &mut Registers<'_, B>,
    ) -> Result<(f32, CurrentRange), ReadError> {
        let code = match self.width {
            Width::Bits13 => i32::from(registers.read_u16(self.register).await? >> 3),
            Width::Bits16 | Width::Decimal => i32::from(registers.read_u16(self.register).await? as i16),
            Width::Bits20 => {
                let [high, middle, low] = registers.read(self.register).await?;
                // Shifting back brings the sign along.
                i32::from_be_bytes([high, middle, low, 0]) >> 12
            }
        };
        Ok((
            code as f32 * self.step,
            CurrentRange::of_code(code, self.width.ends()),
        ))
    }
}

impl Counters {
    /// The calibration is a whole number; what a step is worth follows from it.
    fn count(&'static self, wiring: &Wiring) -> Accumulators {
        let wanted_a = wiring.max_current_a / self.steps;
        let calibration = (self.calibration * wanted_a * wiring.shunt_ohm + 0.5).clamp(1.0, 32_767.0) as u16;
        Accumulators {
            counters: self,
            calibration,
            step_a: f32::from(calibration) / (self.calibration * wiring.shunt_ohm),
            last: None,
        }
    }

    async fn read<B: SensorBus>(&self, registers: &mut Registers<'_, B>) -> Result<Codes, ReadError> {
        Ok(Codes {
            charge: registers.read(self.charge_register).await?,
            energy: registers.read(self.energy_register).await?,
        })
    }
}

impl Accumulators {
    /// The current from which on its counters count too little, in amperes.
    fn full_scale_a(&self) -> f32 {
        self.step_a * self.counters.steps
    }

    /// Takes a reading whose counts are used. Returns those since the one before; `None` the first time.
    fn advance(&mut self, codes: Codes) -> Option<Counted> {
        let last = self.last.replace(codes)?;
        Some(Counted::Increment(self.counted(&codes, &last)))
    }

    /// The energy counts up whichever way the current flows, so it goes by the sign of the charge.
    fn counted(&self, now: &Codes, before: &Codes) -> Consumed {
        let charge_c = steps_between(now.charge, before.charge) * self.step_a;
        let energy_j = steps_between(now.energy, before.energy) * self.step_a * self.counters.energy_step;
        Consumed::from_si(charge_c, if charge_c < 0.0 { -energy_j } else { energy_j })
    }
}

/// Modulo 2^40, the difference that is nearer to 0.
fn steps_between(now: [u8; COUNTER_BYTES], before: [u8; COUNTER_BYTES]) -> f32 {
    let at_the_top = |[a, b, c, d, e]: [u8; COUNTER_BYTES]| i64::from_be_bytes([a, b, c, d, e, 0, 0, 0]);
    (at_the_top(now).wrapping_sub(at_the_top(before)) >> 24) as f32
}
