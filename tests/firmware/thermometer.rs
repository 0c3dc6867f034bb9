//! A thermistor at the converter's pin.

use emulator::AdcInput;
use support::frames::last_of;
use workbench::bench::{Bench, DIVIDER_CODE, SECOND, TestedVehicle};

/// GP28.
const CHANNEL: usize = 2;

/// PADS_BANK0, GPIO28 (RP2040 datasheet 2.19.6.3), and its pull-up.
const PAD: u32 = 0x4001_c004 + 4 * 28;
const PULL_UP: u32 = 1 << 3;

#[test]
// Requirement: AP-30
fn a_thermistor_is_read_with_the_pull_up_of_its_pin() {
    let mut bench = Bench::configured(
        DIVIDER_CODE,
        &[
            ("TEMP1_TYPE", 5.0),
            ("TEMP1_PIN", 28.0),
            ("TEMP1_SRC", 3.0),
            ("TEMP1_SRC_ID", 1.0),
        ],
    );
    bench.set_all(&[
        ("TEMP1_A0", 129.22),
        ("TEMP1_A1", -162.20),
        ("TEMP1_A2", 136.51),
        ("TEMP1_A3", -72.08),
        ("TEMP1_A4", 19.73),
        ("TEMP1_A5", -2.222),
    ]);
    // By its resistance with the pull-up of the pad.
    bench.adc_input(CHANNEL, AdcInput::Code(2205));
    bench.run_for(2 * SECOND);
    let at_25 = last_of(&bench.frames(), 0).temperature_cdegc();
    assert!((2400..2600).contains(&at_25), "{at_25}");
    assert_eq!(bench.read_register(PAD) & PULL_UP, PULL_UP);
}
