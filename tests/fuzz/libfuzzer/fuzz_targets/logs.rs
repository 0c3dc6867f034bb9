#![no_main]

use support::fuzz;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| fuzz::logs::run(bytes));
