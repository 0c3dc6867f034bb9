//! What a pack's readings and its current come from, and their scale, by its parameters.

use super::{Measuring, MeasuringScale, PackSource};
use crate::memory::checksum::crc32;
use crate::parameter::{BatteryParameter, MonitorKind, PackParameters};

/// Parameters of a current.
const OF_CURRENT: [BatteryParameter; 8] = [
    BatteryParameter::CurrPin,
    BatteryParameter::AmpPervlt,
    BatteryParameter::AmpOffset,
    BatteryParameter::MaxVolt,
    BatteryParameter::CurrMult,
    // Bit 1 chooses the side of a charger.
    BatteryParameter::Options,
    BatteryParameter::EscMask,
    BatteryParameter::SumMask,
];

/// Parameters of a current that take effect at the next start.
const OF_CURRENT_AT_BOOT: [BatteryParameter; 5] = [
    BatteryParameter::Monitor,
    BatteryParameter::I2cBus,
    BatteryParameter::I2cAddr,
    BatteryParameter::Channel,
    BatteryParameter::Shunt,
];

impl PackParameters<'_> {
    /// The source of its readings since boot.
    pub fn source(self) -> PackSource {
        let source = [
            BatteryParameter::Monitor,
            BatteryParameter::I2cAddr,
            BatteryParameter::Channel,
        ];
        PackSource(source.map(|parameter| self.get_whole(parameter) as u8))
    }

    /// The scale of a pack of this kind since boot; `None` if it does not use these parameters.
    pub fn measuring(self, kind: MonitorKind) -> Option<Measuring> {
        kind.uses_divider().then(|| Measuring {
            scale: MeasuringScale {
                volt_multiplier: self.get(BatteryParameter::VoltMult),
                volt_offset_v: self.get(BatteryParameter::VltOffset),
                amperes_per_volt: self.get(BatteryParameter::AmpPervlt),
            },
            voltage_pin: self.get_whole(BatteryParameter::VoltPin),
        })
    }

    /// Identifies the source of its current by the parameters that take effect at a start.
    pub fn current_source_at_boot(self) -> u16 {
        self.hash(0, &OF_CURRENT_AT_BOOT)
    }

    /// Identifies the source of its current, where that of the start was `at_boot`. Counts of different ones are not added.
    pub fn current_source(self, at_boot: u16) -> u16 {
        self.hash(at_boot, &OF_CURRENT)
    }

    /// Half of a checksum of these values and of what they follow.
    fn hash(self, start: u16, of: &[BatteryParameter]) -> u16 {
        let values = of.iter().map(|parameter| self.get(*parameter));
        crc32([u32::from(start)].into_iter().chain(values.map(f32::to_bits))) as u16
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pack::Pack;
    use crate::parameter::Parameters;

    #[test]
    // Requirement: S-7
    fn each_parameter_that_makes_a_current_makes_another_source() {
        use BatteryParameter::*;
        let defaults = Parameters::defaults();
        let source = |at_boot: &Parameters, now: &Parameters| {
            now.pack(Pack::Second)
                .current_source(at_boot.pack(Pack::Second).current_source_at_boot())
        };
        let before = source(&defaults, &defaults);
        for (parameter, value, is_live) in [
            (CurrPin, 28.0, true),
            (AmpPervlt, 17.1, true),
            (AmpPervlt, -17.0, true),
            (AmpOffset, 0.001, true),
            (MaxVolt, 12.7, true),
            (CurrMult, 1.1, true),
            (Options, 2.0, true),
            (EscMask, 1.0, true),
            (SumMask, 256.0, true),
            (Monitor, 21.0, false),
            (Shunt, 0.001, false),
            (I2cAddr, 64.0, false),
            (Channel, 2.0, false),
        ] {
            let mut changed = defaults.clone();
            changed.set(parameter.of(Pack::Second), value).unwrap();
            assert_eq!(source(&defaults, &changed) != before, is_live, "{parameter:?}");
            assert_ne!(source(&changed, &changed), before, "{parameter:?}");
            // Of another pack.
            let mut other = defaults.clone();
            other.set(parameter.of(Pack::First), value).unwrap();
            assert_eq!(source(&other, &other), before, "{parameter:?}");
        }
    }

    #[test]
    fn a_converter_on_the_bus_measures_by_the_same_factors_as_a_pin() {
        for (number, is_scaled) in [(3, true), (28, true), (21, false)] {
            let kind = MonitorKind::from_number(number).expect("a kind");
            let measuring = Parameters::defaults().pack(Pack::First).measuring(kind);
            assert_eq!(measuring.is_some(), is_scaled, "{number}");
        }
    }

    #[test]
    fn any_other_monitor_address_or_channel_is_another_source() {
        let mut parameters = Parameters::defaults();
        let mut sources = vec![parameters.pack(Pack::First).source()];
        for (parameter, value) in [
            (BatteryParameter::Monitor, 4.0),
            (BatteryParameter::Monitor, 32.0),
            (BatteryParameter::I2cAddr, 64.0),
            (BatteryParameter::I2cAddr, 119.0),
            (BatteryParameter::Channel, 3.0),
        ] {
            parameters.set(parameter.of(Pack::First), value).unwrap();
            let source = parameters.pack(Pack::First).source();
            assert!(!sources.contains(&source), "{parameter:?} {value}");
            sources.push(source);
        }
    }
}
