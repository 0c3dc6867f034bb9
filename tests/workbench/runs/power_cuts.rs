//! Power is cut in flash operations while parameters are being set.

use std::collections::BTreeMap;
use std::sync::OnceLock;

use super::flash_cuts::Leader;
use crate::bench::{Bench, DIVIDER_CODE, MILLISECOND, PARAMETER_BYTES, PARAMETER_OFFSET, TestedVehicle};
use emulator::FlashCut;
use support::requests::param_set;

const SETS: usize = 50;

/// Enough for two erases and for moving everything to the next sector.
const BETWEEN_SETS_US: u64 = 180 * MILLISECOND;

const CUTS_BETWEEN_LINES: usize = 10;

const BOOT_US: u64 = 300 * MILLISECOND;

/// The number of sets that fill a sector but for a few places, so that the fifty that follow go over into the next one.
const SETS_BEFORE: usize = 660;

/// The sets of the test, the same in every run: name and value, never twice the same value in a row.
fn sets() -> impl Iterator<Item = (&'static str, f32)> {
    const NAMES: [&str; 4] = ["BATT_VLT_OFFSET", "SR0_EXTRA1", "BATT_VOLT_MULT", "SR0_PARAMS"];
    (0u32..).map(|number| {
        let mixed = number.wrapping_mul(2_654_435_761) >> 16;
        let name = NAMES[mixed as usize % NAMES.len()];
        let step = (number % 40) as f32;
        let value = match name {
            "BATT_VLT_OFFSET" => step * 0.01,
            // The lists of the test follow this rate.
            "SR0_PARAMS" => 10.0 + step,
            _ => 1.0 + step,
        };
        (name, value)
    })
}

/// The content of the parameters' flash after many sets.
fn used_flash() -> &'static [u8] {
    static USED: OnceLock<Vec<u8>> = OnceLock::new();
    USED.get_or_init(|| {
        let mut bench = Bench::power_up(DIVIDER_CODE);
        bench.run_for(BOOT_US);
        for (name, value) in sets().take(SETS_BEFORE) {
            set(&mut bench, name, value);
        }
        bench.read_flash(PARAMETER_OFFSET, PARAMETER_BYTES)
    })
}

fn set(bench: &mut Bench, name: &str, value: f32) {
    let now_us = bench.time_us();
    bench.uart_send(0, now_us, &param_set(name, value));
    bench.run_for(BETWEEN_SETS_US);
}

/// Cuts the power in these operations of the sets: nothing is lost, and nothing is torn.
pub fn run(cut: FlashCut, operations: impl Iterator<Item = u64>) {
    let mut bench = Bench::power_up_with_parameters(DIVIDER_CODE, used_flash());
    bench.run_for(BOOT_US);
    let mut values: BTreeMap<_, _> = bench
        .list()
        .into_iter()
        .map(|(name, value)| (name, vec![value]))
        .collect();
    let mut leader = Leader::new(bench, cut, operations);
    let mut cuts = 0;
    for (name, value) in sets().skip(SETS_BEFORE).take(SETS) {
        values.get_mut(name).expect("it is listed").push(value);
        leader.step(
            |bench| set(bench, name, value),
            |mut bench, operation| {
                assert_keeps_working(&mut bench, &values, &format!("operation {operation}, {cut:?}"));
                cuts += 1;
                if cuts % CUTS_BETWEEN_LINES == 0 {
                    println!("power cuts ({cut:?}): {cuts}");
                }
            },
        );
        values.insert(name.to_owned(), vec![value]);
    }
    let all = leader.bench.flash_operations().len();
    assert!(all > SETS, "the fifty sets did not reach the next sector");
    println!("{cuts} operations cut ({cut:?}), none lost, none torn");
}

/// Panics unless the board starts with allowed values after a cut, and keeps what is set then.
fn assert_keeps_working(bench: &mut Bench, allowed: &BTreeMap<String, Vec<f32>>, at: &str) {
    bench.power_cycle();
    bench.run_for(BOOT_US);
    let listed = bench.list();
    for (name, allowed) in allowed {
        let value = listed[name];
        assert!(
            allowed.contains(&value),
            "{at}: {name} is {value}, not of {allowed:?}"
        );
    }
    set(bench, "SYSID_THISMAV", 1.0);
    set(bench, "BATT_VLT_OFFSET", 1.25);
    bench.power_cycle();
    bench.run_for(BOOT_US);
    assert_eq!(bench.list()["BATT_VLT_OFFSET"], 1.25, "{at}");
}
