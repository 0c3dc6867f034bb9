//! Factors of an analog voltage and current: what is estimated and learnt depends on them.

use crate::memory::checksum::crc32;
use crate::pack::Pack;
use crate::parameter::{BatteryParameter, MonitorKind, Parameters};

/// The scale of a pack's voltage and current, with the pin of the voltage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measuring {
    /// The scale.
    pub scale: MeasuringScale,
    /// `BATT_VOLT_PIN`.
    pub voltage_pin: i32,
}

/// The scale of a pack's voltage and current.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasuringScale {
    /// Pack voltage divided by pin voltage (`BATT_VOLT_MULT`).
    pub volt_multiplier: f32,
    /// Pin voltage at zero pack voltage, in volts (`BATT_VLT_OFFSET`).
    pub volt_offset_v: f32,
    /// Amperes per volt at the pin (`BATT_AMP_PERVLT`).
    pub amperes_per_volt: f32,
}

impl Measuring {
    /// From the live parameters of a pack of this kind since boot; `None` if it does not use them.
    pub fn from_parameters(parameters: &Parameters, pack: Pack, kind: MonitorKind) -> Option<Self> {
        let value = |parameter: BatteryParameter| parameters.get(parameter.of(pack));
        kind.uses_divider().then(|| Self {
            scale: MeasuringScale {
                volt_multiplier: value(BatteryParameter::VoltMult),
                volt_offset_v: value(BatteryParameter::VltOffset),
                amperes_per_volt: value(BatteryParameter::AmpPervlt),
            },
            voltage_pin: parameters.get_whole(BatteryParameter::VoltPin.of(pack)),
        })
    }
}

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

/// Identifies the source of a pack's current by the parameters that take effect at a start.
pub fn current_source_at_boot(parameters: &Parameters, pack: Pack) -> u16 {
    hash(0, &OF_CURRENT_AT_BOOT, parameters, pack)
}

/// Identifies the source of a pack's current, where that of the start was `at_boot`. Counts of different ones are not added.
pub fn current_source(at_boot: u16, parameters: &Parameters, pack: Pack) -> u16 {
    hash(at_boot, &OF_CURRENT, parameters, pack)
}

/// Half of a checksum of these values and of what they follow.
fn hash(start: u16, of: &[BatteryParameter], parameters: &Parameters, pack: Pack) -> u16 {
    let values = of.iter().map(|parameter| parameters.get(parameter.of(pack)));
    crc32([u32::from(start)].into_iter().chain(values.map(f32::to_bits))) as u16
}

impl MeasuringScale {
    /// `None` if no parameters have these values.
    pub(super) fn if_plausible(self) -> Option<Self> {
        let is_plausible = self.volt_multiplier > 0.0
            && self.volt_multiplier.is_finite()
            && self.volt_offset_v.is_finite()
            && self.amperes_per_volt.is_finite();
        is_plausible.then_some(self)
    }

    /// By how much the voltage is higher than under the scale `before`, in volts, if it is `voltage_v` now.
    pub(super) fn voltage_change_v(&self, before: &Self, voltage_v: f32) -> f32 {
        let pin_v = voltage_v / self.volt_multiplier + self.volt_offset_v;
        voltage_v - (pin_v - before.volt_offset_v) * before.volt_multiplier
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    // Requirement: S-7
    fn each_parameter_that_makes_a_current_makes_another_source() {
        use BatteryParameter::*;
        let defaults = Parameters::defaults();
        let source = |at_boot: &Parameters, now: &Parameters| {
            current_source(current_source_at_boot(at_boot, Pack::Second), now, Pack::Second)
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
            let measuring = Measuring::from_parameters(&Parameters::defaults(), Pack::First, kind);
            assert_eq!(measuring.is_some(), is_scaled, "{number}");
        }
    }
}
