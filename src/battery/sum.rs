//! Sum of several packs.

use super::{BatteryState, Consumed, Contents, Counted, Measurement, PackStatus, ReadError};
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, Parameters};

/// How the members' voltages are combined.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SumVoltage {
    /// The mean, for packs in parallel.
    #[default]
    Mean,
    /// The lowest (`BATT_OPTIONS` bit 9).
    Lowest,
}

/// `BATT_OPTIONS` bit of [`SumVoltage::Lowest`].
const USE_LOWEST: i32 = 1 << 9;

impl SumVoltage {
    /// From the live parameters of the sum.
    pub fn from_parameters(parameters: &Parameters, pack: Pack) -> Self {
        if parameters.get_whole(BatteryParameter::Options.of(pack)) & USE_LOWEST != 0 {
            Self::Lowest
        } else {
            Self::Mean
        }
    }
}

/// Combines packs into one: voltage and mean temperature of the healthy ones, the sum of their currents, and the sum of
/// the consumption of all. The current is known only if that of every healthy pack is. Fuel tanks are left out.
///
/// # Errors
/// No member is healthy.
pub fn sum<'a>(
    packs: impl Iterator<Item = &'a BatteryState> + Clone,
    voltage: SumVoltage,
) -> Result<Measurement, ReadError> {
    let packs = packs.filter(|pack| pack.contents == Contents::Charge);
    let healthy = packs.clone().filter(|pack| pack.status == PackStatus::Healthy);
    if healthy.clone().next().is_none() {
        return Err(ReadError::NoHealthyMember);
    }
    let voltages = healthy.clone().filter_map(|pack| pack.voltage_v);
    Ok(Measurement {
        voltage_v: match voltage {
            SumVoltage::Mean => mean(voltages),
            SumVoltage::Lowest => voltages.reduce(f32::min),
        },
        current_a: healthy.clone().map(|pack| pack.current_a).sum(),
        counted: consumed(packs).map(|consumed| Counted::Members {
            consumed,
            drawn_mah: None,
        }),
        temperature_c: mean(healthy.filter_map(|pack| pack.temperature_c)),
        ..Measurement::default()
    })
}

/// Total consumption, including packs whose sensor has failed.
fn consumed<'a>(packs: impl Iterator<Item = &'a BatteryState> + Clone) -> Option<Consumed> {
    let monitored = packs.filter(|pack| pack.consumed_mah().is_some());
    monitored.clone().next()?;
    Some(Consumed {
        charge_mah: monitored.clone().filter_map(|pack| pack.consumed_mah()).sum(),
        energy_wh: monitored.filter_map(|pack| pack.consumed_wh).sum(),
    })
}

/// The mean; `None` of no values.
pub(crate) fn mean(values: impl Iterator<Item = f32>) -> Option<f32> {
    let (sum, count) = values.fold((0.0, 0u8), |(sum, count), value| {
        (sum + value, count.saturating_add(1))
    });
    (count > 0).then(|| sum / f32::from(count))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::Amount;

    fn pack(voltage_v: f32, current_a: Option<f32>) -> BatteryState {
        BatteryState {
            status: PackStatus::Healthy,
            voltage_v: Some(voltage_v),
            current_a,
            consumed: current_a.map(|_| Amount::Mah(100.0)),
            consumed_wh: current_a.map(|_| 1.0),
            ..BatteryState::default()
        }
    }

    fn drawn(charge_mah: f32, energy_wh: f32) -> Option<Counted> {
        Some(Counted::Members {
            consumed: Consumed {
                charge_mah,
                energy_wh,
            },
            drawn_mah: None,
        })
    }

    #[test]
    fn parallel_packs_have_mean_voltage_and_summed_current() {
        let packs = [pack(12.0, Some(2.0)), pack(11.0, Some(3.0))];
        let measurement = sum(packs.iter(), SumVoltage::Mean).unwrap();
        assert_eq!(measurement.voltage_v, Some(11.5));
        assert_eq!(measurement.current_a, Some(5.0));
        assert_eq!(measurement.counted, drawn(200.0, 2.0));
        let lowest = sum(packs.iter(), SumVoltage::Lowest).unwrap();
        assert_eq!(lowest.voltage_v, Some(11.0));
    }

    #[test]
    fn fuel_tanks_are_left_out() {
        let tank = BatteryState {
            contents: Contents::Fuel,
            ..pack(3.0, Some(9.0))
        };
        let packs = [pack(12.0, Some(2.0)), tank];
        let measurement = sum(packs.iter(), SumVoltage::Mean).unwrap();
        assert_eq!(measurement.voltage_v, Some(12.0));
        assert_eq!(measurement.current_a, Some(2.0));
        assert_eq!(measurement.counted, drawn(100.0, 1.0));
        assert_eq!(
            sum([tank].iter(), SumVoltage::Mean),
            Err(ReadError::NoHealthyMember)
        );
    }

    #[test]
    fn current_is_unknown_unless_known_of_every_member() {
        let packs = [pack(12.0, Some(2.0)), pack(11.0, None)];
        assert_eq!(sum(packs.iter(), SumVoltage::Mean).unwrap().current_a, None);
    }

    #[test]
    fn unhealthy_pack_counts_only_in_the_consumption() {
        let unhealthy = BatteryState {
            status: PackStatus::Unhealthy,
            ..pack(3.0, Some(9.0))
        };
        let packs = [pack(12.0, Some(2.0)), unhealthy];
        let measurement = sum(packs.iter(), SumVoltage::Mean).unwrap();
        assert_eq!(measurement.voltage_v, Some(12.0));
        assert_eq!(measurement.current_a, Some(2.0));
        assert_eq!(measurement.counted, drawn(200.0, 2.0));
        assert_eq!(
            sum(packs[1..].iter(), SumVoltage::Mean),
            Err(ReadError::NoHealthyMember)
        );
    }
}
