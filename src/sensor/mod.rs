//! From the conversions of a part to a [`crate::battery::Measurement`].

mod analog;

pub use analog::{
    ADC_FULL_SCALE, ADC_REFERENCE_V, AdcCount, AnalogIn, BURST_CONVERSIONS, pack_voltage_v, read_mean,
};
