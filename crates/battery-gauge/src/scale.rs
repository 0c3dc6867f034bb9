//! Factors of an analog voltage and current: what is estimated and learnt depends on them.

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

impl MeasuringScale {
    /// `None` if no parameters have these values.
    pub fn if_plausible(self) -> Option<Self> {
        let is_plausible = self.volt_multiplier > 0.0
            && self.volt_multiplier.is_finite()
            && self.volt_offset_v.is_finite()
            && self.amperes_per_volt.is_finite();
        is_plausible.then_some(self)
    }

    /// By how much the voltage is higher than under the scale `before`, in volts, if it is `voltage_v` now.
    pub fn voltage_change_v(&self, before: &Self, voltage_v: f32) -> f32 {
        let pin_v = voltage_v / self.volt_multiplier + self.volt_offset_v;
        voltage_v - (pin_v - before.volt_offset_v) * before.volt_multiplier
    }
}
