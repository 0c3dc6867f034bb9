#![no_main]

use rover_battmon_fuzz::targets;

libfuzzer_sys::fuzz_target!(|bytes: &[u8]| targets::parser::run(bytes));
