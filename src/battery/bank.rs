//! The monitors of all packs.

use super::alert::alert_of;
use super::sum::{SumVoltage, sum};
use super::{
    BatteryMonitor, Contents, Counted, FailsafeLevel, Measurement, PackMemory, PackSource, ReadError,
};
use crate::pack::{MAX_PACKS, Pack};
use crate::vehicle::BatteryAlert;

/// The monitors of all packs.
#[derive(Clone, Debug, Default)]
pub struct BatteryBank {
    monitors: [BatteryMonitor; MAX_PACKS],
}

impl BatteryBank {
    /// Monitors without any reading yet.
    pub fn new() -> Self {
        Self::default()
    }

    /// The monitor of a pack.
    pub fn monitor(&mut self, pack: Pack) -> &mut BatteryMonitor {
        &mut self.monitors[pack as usize]
    }

    /// All monitors, with their packs.
    pub fn monitors(&self) -> impl Iterator<Item = (Pack, &BatteryMonitor)> {
        Pack::ALL.into_iter().zip(&self.monitors)
    }

    /// The sum of the packs in `mask` (`BATT_SUM_MASK`) that are monitored, by their latest states. Bit 0 is the first; an
    /// empty mask means all packs after `own`. A sum never includes itself.
    ///
    /// # Errors
    /// No member is healthy.
    pub fn sum(
        &self,
        own: Pack,
        mask: u16,
        monitored: u16,
        voltage: SumVoltage,
    ) -> Result<Measurement, ReadError> {
        let is_member = move |pack: Pack| {
            if monitored & pack.bit() == 0 {
                false
            } else if mask == 0 {
                pack > own
            } else {
                pack != own && mask & pack.bit() != 0
            }
        };
        let members = Pack::ALL
            .iter()
            .zip(&self.monitors)
            .filter(move |(pack, _)| is_member(**pack));
        let measurement = sum(members.clone().map(|(_, monitor)| monitor.state()), voltage)?;
        let charged = members.filter(|(_, monitor)| monitor.state().contents == Contents::Charge);
        let of_members = || charged.clone().map(|(_, monitor)| monitor);
        let counted = measurement.counted.map(|counted| match counted {
            Counted::Members { consumed, .. } => Counted::Members {
                consumed,
                drawn_mah: of_members().map(drawn_mah).sum(),
            },
            other => other,
        });
        Ok(Measurement {
            counted,
            members: charged.clone().fold(0, |mask, (pack, _)| mask | pack.bit()),
            members_capacity_mah: of_members().map(|monitor| monitor.state().capacity_mah()).sum(),
            members_spread: spread(of_members().map(BatteryMonitor::resting_v)),
            ..measurement
        })
    }

    /// The worst failsafe level of all packs.
    pub fn worst_failsafe(&self) -> FailsafeLevel {
        let levels = self.monitors.iter().map(|monitor| monitor.state().failsafe);
        levels.max().unwrap_or_default()
    }

    /// The most urgent alert of all packs.
    pub fn most_urgent_alert(&self) -> BatteryAlert {
        let alerts = self.monitors.iter().map(|monitor| alert_of(monitor.state()));
        alerts.max().unwrap_or_default()
    }

    /// What is retained over a reset of the processor, of packs that are read from these sources.
    pub fn memory(&self, sources: &[PackSource; MAX_PACKS]) -> [PackMemory; MAX_PACKS] {
        let mut memory = [PackMemory::default(); MAX_PACKS];
        for ((pack, monitor), source) in memory.iter_mut().zip(&self.monitors).zip(sources) {
            *pack = monitor.memory(*source);
        }
        memory
    }

    /// Continues with what was retained over a reset of the processor of each pack that is still read from the same
    /// source.
    pub fn restore(&mut self, memory: &[PackMemory; MAX_PACKS], sources: &[PackSource; MAX_PACKS]) {
        for ((monitor, pack), source) in self.monitors.iter_mut().zip(memory).zip(sources) {
            if pack.source == *source {
                monitor.restore(pack);
            }
        }
    }
}

/// Charge drawn from a member, in milliampere-hours, if it is counted.
fn drawn_mah(monitor: &BatteryMonitor) -> Option<f32> {
    monitor.state().consumed?;
    Some(monitor.drawn_mah())
}

/// By how much the highest of these voltages exceeds the lowest, relative to it; `None` unless all are known.
fn spread(voltages: impl Iterator<Item = Option<f32>> + Clone) -> Option<f32> {
    let lowest_v = voltages.clone().try_fold(f32::INFINITY, |lowest_v, voltage_v| {
        Some(lowest_v.min(voltage_v?))
    })?;
    let highest_v = voltages.flatten().fold(0.0, f32::max);
    (highest_v >= lowest_v).then(|| highest_v / lowest_v - 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::battery::{PackSettings, Tick};

    #[test]
    fn sum_has_only_electric_packs_as_members() {
        let mut bank = BatteryBank::new();
        for (pack, contents) in [
            (Pack::Second, Contents::Charge),
            (Pack::Third, Contents::Fuel),
            (Pack::Fourth, Contents::Charge),
        ] {
            let reading = Measurement {
                contents,
                voltage_v: Some(12.0),
                ..Measurement::default()
            };
            let _ = bank
                .monitor(pack)
                .update(Tick::default(), Ok(reading), &PackSettings::default());
        }
        let members = |mask| {
            bank.sum(Pack::First, mask, u16::MAX, SumVoltage::Mean)
                .map(|sum| sum.members)
        };
        assert_eq!(members(0b1111), Ok(0b1010));
        assert_eq!(members(0b1110), Ok(0b1010));
    }
}
