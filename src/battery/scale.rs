//! Factors of an analog voltage and current: what is estimated and learnt depends on them.

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
    fn a_converter_on_the_bus_measures_by_the_same_factors_as_a_pin() {
        for (number, is_scaled) in [(3, true), (28, true), (21, false)] {
            let kind = MonitorKind::from_number(number).expect("a kind");
            let measuring = Measuring::from_parameters(&Parameters::defaults(), Pack::First, kind);
            assert_eq!(measuring.is_some(), is_scaled, "{number}");
        }
    }
}
