//! BATTERY_STATUS and BATTERY_STATUS_V2 of another component: MAVLink's sentinels become `None`.

use core::array;
use core::ops::RangeInclusive;

use crate::battery::{CellVoltages, ChargeState, CurrentRange, Faults, Modes, Reported};
use crate::mavlink::dialect::MavBatteryStatusFlags as Flags;
use crate::mavlink::payload::Payload;
use crate::pack::Pack;
use crate::sensor::ExternalReading;

/// Fields of `voltages`; those of `voltages_ext` follow after other fields.
const CELLS: usize = 10;
const EXT_CELLS: usize = 4;

const CURRENT_CONSUMED: usize = 0;
const ENERGY_CONSUMED: usize = 4;
const TEMPERATURE: usize = 8;
const VOLTAGES: usize = 10;
const CURRENT_BATTERY: usize = 30;
const ID: usize = 32;
const BATTERY_REMAINING: usize = 35;
const TIME_REMAINING: usize = 36;
const CHARGE_STATE: usize = 40;
const VOLTAGES_EXT: usize = 41;
const MODE: usize = 49;
const FAULT_BITMASK: usize = 50;

/// Fields of BATTERY_STATUS_V2.
mod v2 {
    pub const VOLTAGE: usize = 0;
    pub const CURRENT: usize = 4;
    pub const CAPACITY_CONSUMED: usize = 8;
    pub const STATE_OF_CHARGE: usize = 16;
    pub const STATUS_FLAGS: usize = 20;
    pub const TEMPERATURE: usize = 24;
    pub const ID: usize = 26;
}

/// `MAV_BATTERY_MODE_AUTO_DISCHARGING`
const AUTO_DISCHARGING: u8 = 1;

const VOLTAGE_UNKNOWN_MV: u16 = u16::MAX;
const TEMPERATURE_UNKNOWN_CDEGC: i16 = i16::MAX;
const CURRENT_UNKNOWN_CA: i16 = -1;

/// The ends of a current, in hundredths of an ampere: senders that limit it to the field do so on either side of 0.
const CURRENT_ENDS_CA: RangeInclusive<i32> = -32_767..=32_767;

/// A cell has no more, in millivolts: what is above is the voltage of several.
const HIGHEST_CELL_MV: u16 = 5_000;

// Divisors, since a product with the inverse is not the number nearest to what was sent: 10.5 V would be below 10.5 V.
const MILLIVOLTS_PER_VOLT: f32 = 1e3;
const HUNDREDTHS: f32 = 1e2;
const MAH_PER_AH: f32 = 1e3;
const HECTOJOULES_PER_WATT_HOUR: f32 = 36.0;

type CellFields = [u16; CELLS + EXT_CELLS];

/// The flag of BATTERY_STATUS_V2 that goes with each fault.
pub const FLAGS_OF_FAULTS: [(Faults, Flags); 14] = [
    (
        Faults::DEEP_DISCHARGE,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_UNDER_VOLT,
    ),
    (Faults::SPIKES, Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_OVER_VOLT),
    (
        Faults::CELL_FAIL,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_CELL_IMBALANCE,
    ),
    (
        Faults::CELL_DIFFERS,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_CELL_IMBALANCE,
    ),
    (
        Faults::OVER_CURRENT,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_OVER_CURRENT,
    ),
    (
        Faults::OVER_TEMPERATURE,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_OVER_TEMPERATURE,
    ),
    (
        Faults::UNDER_TEMPERATURE,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_UNDER_TEMPERATURE,
    ),
    (
        Faults::INCOMPATIBLE_VOLTAGE,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_INCOMPATIBLE_VOLTAGE,
    ),
    (
        Faults::INCOMPATIBLE_FIRMWARE,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_INCOMPATIBLE_FIRMWARE,
    ),
    (
        Faults::CELLS_CONFIGURATION,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_INCOMPATIBLE_CELLS_CONFIGURATION,
    ),
    (Faults::BAD_BATTERY, Flags::MAV_BATTERY_STATUS_FLAGS_BAD_BATTERY),
    (
        Faults::NEEDS_SERVICE,
        Flags::MAV_BATTERY_STATUS_FLAGS_REQUIRES_SERVICE,
    ),
    (
        Faults::SHORT_CIRCUIT,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_SHORT_CIRCUIT,
    ),
    (
        Faults::SWITCHED_OFF,
        Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_PROTECTION_SYSTEM,
    ),
];

/// The flag of BATTERY_STATUS_V2 that goes with each mode.
pub const FLAGS_OF_MODES: [(Modes, Flags); 3] = [
    (Modes::BALANCING, Flags::MAV_BATTERY_STATUS_FLAGS_CELL_BALANCING),
    (Modes::STORING, Flags::MAV_BATTERY_STATUS_FLAGS_AUTO_DISCHARGING),
    (
        Modes::PROTECTED,
        Flags::MAV_BATTERY_STATUS_FLAGS_PROTECTIONS_ENABLED,
    ),
];

/// `None` if there is no such pack, or if its voltage is unknown: a component whose sensor has failed is not a source.
pub fn pack_reading(payload: &Payload<'_>) -> Option<ExternalReading> {
    let pack = Pack::from_instance(payload.u8(ID))?;
    let fields = cell_fields(payload);
    let known = known_fields(&fields)?;
    let current_ca = payload.i16(CURRENT_BATTERY);
    let temperature_cdegc = payload.i16(TEMPERATURE);
    let time_remaining_s = payload.i32(TIME_REMAINING);
    Some(ExternalReading {
        pack,
        voltage_v: sum_v(known),
        cells: cells(known),
        current_a: (current_ca != CURRENT_UNKNOWN_CA).then(|| f32::from(current_ca) / HUNDREDTHS),
        current_range: CurrentRange::of_code(current_ca.into(), CURRENT_ENDS_CA),
        consumed_mah: amount(payload.i32(CURRENT_CONSUMED)),
        consumed_wh: amount(payload.i32(ENERGY_CONSUMED)).map(|hj| hj / HECTOJOULES_PER_WATT_HOUR),
        state_of_charge: share(payload.u8(BATTERY_REMAINING)),
        temperature_c: (temperature_cdegc != TEMPERATURE_UNKNOWN_CDEGC)
            .then(|| f32::from(temperature_cdegc) / HUNDREDTHS),
        reported: reported(payload),
        // 0 is unknown.
        time_remaining_s: (time_remaining_s > 0).then_some(time_remaining_s as f32),
    })
}

/// The reading of a BATTERY_STATUS_V2.
pub fn pack_reading_v2(payload: &Payload<'_>) -> Option<ExternalReading> {
    let known = |offset: usize| Some(payload.f32(offset)).filter(|value| value.is_finite());
    let flags = Flags::from_bits_truncate(payload.u32(v2::STATUS_FLAGS));
    let (faults, modes) = faults_and_modes(flags);
    let is_share = |percent: &f32| (0.0..=HUNDREDTHS).contains(percent);
    let temperature_cdegc = payload.i16(v2::TEMPERATURE);
    Some(ExternalReading {
        pack: Pack::from_instance(payload.u8(v2::ID))?,
        voltage_v: known(v2::VOLTAGE).filter(|voltage_v| *voltage_v >= 0.0)?,
        cells: CellVoltages::NONE,
        current_a: known(v2::CURRENT),
        current_range: CurrentRange::Within,
        consumed_mah: known(v2::CAPACITY_CONSUMED).map(|ah| ah * MAH_PER_AH),
        consumed_wh: None,
        state_of_charge: known(v2::STATE_OF_CHARGE)
            .filter(is_share)
            .map(|percent| percent / HUNDREDTHS),
        temperature_c: (temperature_cdegc != TEMPERATURE_UNKNOWN_CDEGC)
            .then(|| f32::from(temperature_cdegc) / HUNDREDTHS),
        reported: Reported {
            faults,
            charge_state: charge_state_v2(flags),
            modes,
            ..Reported::NONE
        },
        time_remaining_s: None,
    })
}

/// The faults and modes that go with these flags. Cells that are not balanced differ: that one has failed is not said.
fn faults_and_modes(flags: Flags) -> (Faults, Modes) {
    let faults = FLAGS_OF_FAULTS.iter().filter(|(_, flag)| flags.contains(*flag));
    let faults = faults.fold(Faults::empty(), |all, (fault, _)| all | *fault);
    let modes = FLAGS_OF_MODES.iter().filter(|(_, flag)| flags.contains(*flag));
    let modes = modes.fold(Modes::empty(), |all, (mode, _)| all | *mode);
    (faults - Faults::CELL_FAIL, modes)
}

/// A pack that is charged is not ready either.
fn charge_state_v2(flags: Flags) -> Option<ChargeState> {
    if flags.contains(Flags::MAV_BATTERY_STATUS_FLAGS_CHARGING) {
        Some(ChargeState::Charging)
    } else {
        let is_unready = flags.contains(Flags::MAV_BATTERY_STATUS_FLAGS_NOT_READY_TO_USE);
        is_unready.then_some(ChargeState::Unhealthy)
    }
}

/// Bits that MAVLink does not have do not belong to a fault.
fn reported(payload: &Payload<'_>) -> Reported {
    Reported {
        faults: Faults::from_bits_truncate(payload.u32(FAULT_BITMASK) as u16) & Faults::MAVLINK,
        charge_state: ChargeState::from_number(payload.u8(CHARGE_STATE)),
        modes: match payload.u8(MODE) {
            AUTO_DISCHARGING => Modes::STORING,
            _ => Modes::empty(),
        },
        ..Reported::NONE
    }
}

fn cell_fields(payload: &Payload<'_>) -> CellFields {
    array::from_fn(|cell| match cell.checked_sub(CELLS) {
        None => payload.u16(VOLTAGES + 2 * cell),
        Some(cell) => payload.u16(VOLTAGES_EXT + 2 * cell),
    })
}

/// The fields up to the first unknown one. `None` if that is the first of all, or if others are known behind it: their sum is
/// not the pack's voltage.
fn known_fields(fields: &CellFields) -> Option<&[u16]> {
    let is_unknown = |mv: &u16| *mv == VOLTAGE_UNKNOWN_MV;
    let end = fields.iter().position(is_unknown).unwrap_or(fields.len());
    let (known, rest) = fields.split_at_checked(end)?;
    // 0 is an unused field of `voltages_ext`.
    let is_whole = rest.iter().all(|mv| is_unknown(mv) || *mv == 0);
    (is_whole && !known.is_empty()).then_some(known)
}

/// The sum of the fields, whether each is a cell or they are one voltage. 0 V is a pack that is not connected.
fn sum_v(known: &[u16]) -> f32 {
    let sum_mv: u32 = known.iter().copied().map(u32::from).sum();
    sum_mv as f32 / MILLIVOLTS_PER_VOLT
}

/// Fields are cells if there are several, and none has more than a cell can have. Zeros at the end are unused fields.
fn cells(known: &[u16]) -> CellVoltages {
    let count = known.iter().rposition(|mv| *mv > 0).map_or(0, |last| last + 1);
    let used = known.get(..count).unwrap_or_default();
    let are_cells = count > 1 && used.iter().all(|mv| *mv <= HIGHEST_CELL_MV);
    CellVoltages::from_millivolts(if are_cells { used } else { &[] })
}

/// −1 is unknown, and no other negative number is an amount.
fn amount(field: i32) -> Option<f32> {
    (field >= 0).then_some(field as f32)
}

/// 0 to 100 %. −1, here 255, is unknown, and nothing else is a percentage.
fn share(percent: u8) -> Option<f32> {
    (percent <= 100).then(|| f32::from(percent) / HUNDREDTHS)
}

#[cfg(test)]
mod tests {
    use ::mavlink::{MavlinkVersion, MessageData};
    use proptest::prelude::*;

    use super::*;
    use crate::battery::Measurement;
    use crate::mavlink::dialect::{
        BATTERY_STATUS_DATA, BATTERY_STATUS_V2_DATA, MavBatteryChargeState, MavBatteryFault, MavBatteryMode,
    };

    const UNKNOWN: u16 = u16::MAX;

    /// All that is known is the voltage of the first pack.
    fn at_12_volts() -> BATTERY_STATUS_DATA {
        BATTERY_STATUS_DATA {
            id: 0,
            voltages: fields([12_000]),
            current_battery: -1,
            current_consumed: -1,
            energy_consumed: -1,
            battery_remaining: -1,
            temperature: i16::MAX,
            fault_bitmask: MavBatteryFault::empty(),
            ..BATTERY_STATUS_DATA::DEFAULT
        }
    }

    /// The other fields are unknown.
    fn fields<const N: usize>(known: [u16; N]) -> [u16; CELLS] {
        array::from_fn(|cell| known.get(cell).copied().unwrap_or(UNKNOWN))
    }

    fn decoded(message: &BATTERY_STATUS_DATA) -> Option<ExternalReading> {
        let mut bytes = [0; 255];
        let length = message.ser(MavlinkVersion::V2, &mut bytes);
        reading(&bytes[..length])
    }

    fn reading(payload: &[u8]) -> Option<ExternalReading> {
        pack_reading(&Payload(payload))
    }

    #[test]
    fn every_field_is_decoded() {
        let message = BATTERY_STATUS_DATA {
            id: 2,
            voltages: fields([4000, 3900, 4100]),
            current_battery: -250,
            current_consumed: 1234,
            energy_consumed: 72,
            battery_remaining: 42,
            temperature: -550,
            time_remaining: 1800,
            charge_state: MavBatteryChargeState::MAV_BATTERY_CHARGE_STATE_CRITICAL,
            mode: MavBatteryMode::MAV_BATTERY_MODE_AUTO_DISCHARGING,
            fault_bitmask: MavBatteryFault::from_bits_retain(0xffff_ff18),
            ..at_12_volts()
        };
        let expected = ExternalReading {
            pack: Pack::Third,
            voltage_v: 12.0,
            cells: CellVoltages::from_millivolts(&[4000, 3900, 4100]),
            current_a: Some(-2.5),
            current_range: CurrentRange::Within,
            consumed_mah: Some(1234.0),
            consumed_wh: Some(2.0),
            state_of_charge: Some(0.42),
            temperature_c: Some(-5.5),
            reported: Reported {
                faults: Faults::OVER_CURRENT | Faults::OVER_TEMPERATURE | Faults::CELLS_CONFIGURATION,
                charge_state: Some(ChargeState::Critical),
                modes: Modes::STORING,
                ..Reported::NONE
            },
            time_remaining_s: Some(1800.0),
        };
        assert_eq!(decoded(&message), Some(expected));
    }

    #[test]
    fn sentinels_are_unknown() {
        let expected = ExternalReading {
            pack: Pack::First,
            voltage_v: 12.0,
            cells: CellVoltages::NONE,
            current_a: None,
            current_range: CurrentRange::Within,
            consumed_mah: None,
            consumed_wh: None,
            state_of_charge: None,
            temperature_c: None,
            reported: Reported::NONE,
            time_remaining_s: None,
        };
        assert_eq!(decoded(&at_12_volts()), Some(expected));
        for time_remaining in [-1, i32::MIN] {
            let message = BATTERY_STATUS_DATA {
                time_remaining,
                ..at_12_volts()
            };
            assert_eq!(decoded(&message), Some(expected), "out of range");
        }
        for (battery_remaining, consumed) in [(101, -2), (-2, i32::MIN), (127, -1)] {
            let message = BATTERY_STATUS_DATA {
                battery_remaining,
                current_consumed: consumed,
                energy_consumed: consumed,
                ..at_12_volts()
            };
            assert_eq!(decoded(&message), Some(expected), "out of range");
        }
    }

    #[test]
    // Requirement: S-3
    fn the_ends_of_a_current_are_over_range_and_what_the_component_counts_goes_on() {
        use CurrentRange::{Over, OverAndCounted, Within};
        for (current_battery, current_a, range) in [
            (i16::MIN, Some(-327.68), Over),
            (-32_767, Some(-327.67), Over),
            (-32_766, Some(-327.66), Within),
            (-1, None, Within),
            (0, Some(0.0), Within),
            (32_766, Some(327.66), Within),
            (i16::MAX, Some(327.67), Over),
        ] {
            for current_consumed in [-1, 100] {
                let message = BATTERY_STATUS_DATA {
                    current_battery,
                    current_consumed,
                    ..at_12_volts()
                };
                let measurement = Measurement::from(&decoded(&message).unwrap());
                let expected = match (range, current_consumed) {
                    (Over, 100) => OverAndCounted,
                    _ => range,
                };
                let found = (measurement.current_a, measurement.current_range);
                assert_eq!(
                    found,
                    (current_a, expected),
                    "{current_battery}, {current_consumed}"
                );
            }
        }
    }

    #[test]
    fn fields_are_cells_or_one_voltage() {
        let ten = [4000; CELLS];
        for (voltages, voltages_ext, volts, cells) in [
            (fields([12_000]), [0; 4], 12.0, &[][..]),
            (fields([3700]), [0; 4], 3.7, &[]),
            (fields([65_534, 8_466]), [0; 4], 74.0, &[]),
            (fields([4000, 3500]), [0; 4], 7.5, &[4000, 3500]),
            (fields([4000, 0, 3500]), [0; 4], 7.5, &[4000, 0, 3500]),
            (
                ten,
                [4000, 3000, 0, 0],
                47.0,
                &[
                    4000, 4000, 4000, 4000, 4000, 4000, 4000, 4000, 4000, 4000, 4000, 3000,
                ],
            ),
            (ten, [UNKNOWN; 4], 40.0, &ten),
            // As some senders fill unused fields.
            ([12_000, 0, 0, 0, 0, 0, 0, 0, 0, 0], [0; 4], 12.0, &[]),
            ([4000, 3500, 0, 0, 0, 0, 0, 0, 0, 0], [0; 4], 7.5, &[4000, 3500]),
            ([0; CELLS], [0; 4], 0.0, &[]),
        ] {
            let message = BATTERY_STATUS_DATA {
                voltages,
                voltages_ext,
                ..at_12_volts()
            };
            let reading = decoded(&message).unwrap_or_else(|| panic!("{voltages:?}"));
            assert_eq!(reading.voltage_v, volts, "{voltages:?}");
            assert_eq!(reading.cells.millivolts(), cells, "{voltages:?}");
        }
    }

    #[test]
    fn without_a_whole_voltage_or_a_pack_there_is_no_reading() {
        let with_voltages = |voltages| BATTERY_STATUS_DATA {
            voltages,
            current_battery: 100,
            battery_remaining: 50,
            ..at_12_volts()
        };
        assert_eq!(decoded(&with_voltages(fields([]))), None);
        assert_eq!(decoded(&with_voltages(fields([4000, UNKNOWN, 4000]))), None);
        let behind_unknown = BATTERY_STATUS_DATA {
            voltages_ext: [4000, 0, 0, 0],
            ..at_12_volts()
        };
        assert_eq!(decoded(&behind_unknown), None);
        for id in [9, 10, 255] {
            assert_eq!(decoded(&BATTERY_STATUS_DATA { id, ..at_12_volts() }), None);
        }
    }

    /// All that is known is the voltage of the first pack.
    fn v2_at_12_volts() -> BATTERY_STATUS_V2_DATA {
        BATTERY_STATUS_V2_DATA {
            voltage: 12.0,
            current: f32::NAN,
            capacity_consumed: f32::NAN,
            capacity_remaining: f32::NAN,
            state_of_charge: f32::NAN,
            status_flags: Flags::empty(),
            temperature: i16::MAX,
            id: 0,
        }
    }

    fn decoded_v2(message: &BATTERY_STATUS_V2_DATA) -> Option<ExternalReading> {
        let mut bytes = [0; 255];
        let length = message.ser(MavlinkVersion::V2, &mut bytes);
        pack_reading_v2(&Payload(&bytes[..length]))
    }

    #[test]
    fn every_field_of_the_second_version_is_decoded() {
        let message = BATTERY_STATUS_V2_DATA {
            current: -2.5,
            capacity_consumed: -0.5,
            capacity_remaining: 7.0,
            state_of_charge: 42.0,
            status_flags: Flags::MAV_BATTERY_STATUS_FLAGS_AUTO_DISCHARGING
                | Flags::MAV_BATTERY_STATUS_FLAGS_FAULT_CELL_IMBALANCE
                | Flags::MAV_BATTERY_STATUS_FLAGS_BAD_BATTERY
                | Flags::MAV_BATTERY_STATUS_FLAGS_NOT_READY_TO_USE,
            temperature: -550,
            id: 2,
            ..v2_at_12_volts()
        };
        let reading = decoded_v2(&message).expect("a reading");
        let expected = ExternalReading {
            pack: Pack::Third,
            voltage_v: 12.0,
            cells: CellVoltages::NONE,
            current_a: Some(-2.5),
            current_range: CurrentRange::Within,
            consumed_mah: Some(-500.0),
            consumed_wh: None,
            state_of_charge: Some(0.42),
            temperature_c: Some(-5.5),
            reported: Reported {
                faults: Faults::CELL_DIFFERS | Faults::BAD_BATTERY,
                charge_state: Some(ChargeState::Unhealthy),
                modes: Modes::STORING,
                ..Reported::NONE
            },
            time_remaining_s: None,
        };
        assert_eq!(reading, expected);
    }

    #[test]
    fn sentinels_of_the_second_version_are_unknown() {
        let reading = decoded_v2(&v2_at_12_volts()).expect("a reading");
        assert_eq!(
            reading,
            ExternalReading {
                pack: Pack::First,
                ..decoded(&at_12_volts()).expect("a reading")
            }
        );
        for state_of_charge in [-1.0, 101.0, f32::INFINITY] {
            let message = BATTERY_STATUS_V2_DATA {
                state_of_charge,
                ..v2_at_12_volts()
            };
            assert_eq!(decoded_v2(&message), Some(reading), "{state_of_charge}");
        }
        for (voltage, id) in [(f32::NAN, 0), (-1.0, 0), (f32::INFINITY, 0), (12.0, 9)] {
            let message = BATTERY_STATUS_V2_DATA {
                voltage,
                id,
                ..v2_at_12_volts()
            };
            assert_eq!(decoded_v2(&message), None, "{voltage} {id}");
        }
    }

    proptest! {
        /// Any payload of the second version gives no reading or finite values.
        #[test]
        fn any_payload_of_the_second_version_gives_finite_values_or_none(
            payload in prop::collection::vec(any::<u8>(), 0..30)
        ) {
            let Some(reading) = pack_reading_v2(&Payload(&payload)) else { return Ok(()) };
            prop_assert!(reading.voltage_v >= 0.0 && reading.voltage_v.is_finite());
            prop_assert!(reading.state_of_charge.is_none_or(|share| (0.0..=1.0).contains(&share)));
            prop_assert!(reading.current_a.is_none_or(f32::is_finite));
        }

        /// Any payload, however short, gives no reading or one whose values are in the range of their fields.
        #[test]
        fn any_payload_gives_finite_values_or_none(payload in prop::collection::vec(any::<u8>(), 0..60)) {
            let Some(reading) = reading(&payload) else { return Ok(()) };
            prop_assert!((0.0..=14.0 * 65.534).contains(&reading.voltage_v));
            prop_assert!(reading.current_a.is_none_or(|current_a| current_a.abs() <= 327.68));
            prop_assert!(reading.temperature_c.is_none_or(|celsius| celsius.abs() <= 327.68));
            prop_assert!(reading.state_of_charge.is_none_or(|share| (0.0..=1.0).contains(&share)));
            for amount in [reading.consumed_mah, reading.consumed_wh].into_iter().flatten() {
                prop_assert!((0.0..=2_147_483_648.0).contains(&amount));
            }
            let cells_mv: u32 = reading.cells.millivolts().iter().copied().map(u32::from).sum();
            let are_the_voltage = (cells_mv as f32 * 1e-3 - reading.voltage_v).abs() < 1e-3;
            prop_assert!(cells_mv == 0 || are_the_voltage);
        }
    }
}
