//! Motor controllers: several may measure a pack together.

/// A motor controller's reading. `None` is not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ControllerReading {
    /// Voltage at its supply, in volts.
    pub voltage_v: Option<f32>,
    /// Current drawn from the pack, in amperes.
    pub current_a: Option<f32>,
    /// Temperature, in degrees Celsius.
    pub temperature_c: Option<f32>,
    /// Charge drawn since its previous reading, in milliampere-hours, by a counter of its own.
    pub drawn_mah: Option<f32>,
}
