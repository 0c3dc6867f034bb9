//! From the conversions of a part to a [`crate::battery::Measurement`].

mod analog;

pub use analog::{
    ADC_FULL_SCALE, ADC_REFERENCE_V, AdcCount, AnalogIn, AnalogPin, BURST_CONVERSIONS, VoltageDivider,
    read_mean,
};
