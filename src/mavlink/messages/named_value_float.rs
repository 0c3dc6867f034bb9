//! NAMED_VALUE_FLOAT (251): estimates of a pack for which no other message has a field.

use super::units::{number, time_boot_ms};
use crate::mavlink::dialect::NAMED_VALUE_FLOAT_DATA;
use crate::pack::Pack;
use crate::system::SystemState;

/// The longest name, in bytes. One that is as long has no 0 at its end.
const NAME_BYTES: usize = 10;

const MILLIOHMS_PER_OHM: f32 = 1000.0;

/// The internal resistance of `pack`, in milliohms: `BAT1_RES` of the first one. NaN while it is unknown.
pub fn build_resistance(state: &SystemState<'_>, pack: Pack) -> NAMED_VALUE_FLOAT_DATA {
    let resistance_ohm = state.battery(pack).resistance_ohm;
    let resistance_mohm = resistance_ohm.map(|resistance_ohm| resistance_ohm * MILLIOHMS_PER_OHM);
    named_value(state, pack, *b"BAT#_RES\0\0", resistance_mohm)
}

/// The voltage of `pack` without its load, in volts: `BAT1_VREST` of the first one. NaN while it is unknown.
pub fn build_resting_voltage(state: &SystemState<'_>, pack: Pack) -> NAMED_VALUE_FLOAT_DATA {
    let readings = &state.battery(pack).readings;
    named_value(state, pack, *b"BAT#_VREST", readings.resting_voltage_v)
}

/// The standard deviation of the remaining charge of `pack`, in percent of a full pack: `BAT1_SIGMA` of the first one. NaN while
/// it is unknown.
pub fn build_charge_deviation(state: &SystemState<'_>, pack: Pack) -> NAMED_VALUE_FLOAT_DATA {
    named_value(
        state,
        pack,
        *b"BAT#_SIGMA",
        state.battery(pack).readings.remaining_sigma_pct,
    )
}

/// The usable charge of `pack`, in percent of a full pack's: `BAT1_USABL` of the first one. NaN while it is unknown.
pub fn build_usable_charge(state: &SystemState<'_>, pack: Pack) -> NAMED_VALUE_FLOAT_DATA {
    named_value(
        state,
        pack,
        *b"BAT#_USABL",
        state.battery(pack).readings.usable_pct,
    )
}

/// A value under a name whose `#` becomes the number of the pack.
fn named_value(
    state: &SystemState<'_>,
    pack: Pack,
    mut name: [u8; NAME_BYTES],
    value: Option<f32>,
) -> NAMED_VALUE_FLOAT_DATA {
    name[3] = b'0' + pack.number();
    NAMED_VALUE_FLOAT_DATA {
        time_boot_ms: time_boot_ms(state.now),
        value: number(value),
        name: name.into(),
    }
}
