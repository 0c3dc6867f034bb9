//! The release firmware on an emulated RP2040: what leaves its pins, what its log says, what faults do to it.

#[path = "../workbench/bench.rs"]
mod bench;
#[path = "../workbench/can/mod.rs"]
mod can_bench;
#[path = "../support/checked.rs"]
mod checked;
#[path = "../workbench/downloads.rs"]
mod downloads;
#[path = "../support/elf.rs"]
mod elf;
#[path = "../workbench/i2c_bus.rs"]
mod i2c_bus;
#[path = "../workbench/log_records.rs"]
mod log_records;
#[path = "../support/motor_poles.rs"]
mod motor_poles;
#[path = "../support/page.rs"]
mod page;
#[path = "../workbench/runs/mod.rs"]
mod runs;
#[path = "../support/signer.rs"]
mod signer;
#[path = "../workbench/signing_key.rs"]
mod signing_key;
#[path = "../support/story.rs"]
mod story;
#[path = "../support/mod.rs"]
mod support;

mod armed_storage;
mod board_check;
mod boot;
mod boot_loader;
mod boot_loop;
mod bus_packs;
mod can;
mod can_wiring;
mod commands;
mod crash;
mod debugger;
mod examples;
mod external_pack;
mod faults;
mod firmware_hash;
mod floats;
mod fuel;
mod lamps;
mod learning;
mod learnt;
mod link_noise;
mod log;
mod monitors;
mod motors;
mod nine_kinds;
mod packs;
mod parameter_files;
mod parameters;
mod power_cuts;
mod pulses_and_esc;
mod reception;
mod rover;
mod safe_driving;
mod sampling;
mod serial;
mod serial_engine;
mod session;
mod shown;
mod signing;
mod slow_link;
mod soak;
mod stack;
mod storage_faults;
mod stories;
mod telemetry;
mod time_wrap;
mod usb;
mod wheels;
mod wifi;
