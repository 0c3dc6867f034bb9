//! What runs on the host: the core, the tasks in stepped time, programs for a desk, and what documentation says.

#[path = "../support/checked.rs"]
mod checked;
#[path = "../support/desk.rs"]
mod desk;
#[path = "../support/flash.rs"]
mod flash;
#[path = "../support/line.rs"]
mod line;
#[path = "../support/motor_poles.rs"]
mod motor_poles;
#[path = "../support/page.rs"]
mod page;
#[path = "../support/signer.rs"]
mod signer;
#[path = "../support/story.rs"]
mod story;
#[path = "../support/mod.rs"]
mod support;

mod adc_to_wire;
mod announcements;
mod armed_storage;
mod battery_traces;
mod board_check;
mod builders;
mod crash;
mod dataflash;
mod documentation;
mod downloads;
mod endpoint;
mod examples;
mod external_pack;
mod failsafe;
mod fuzz;
mod learning;
mod learnt;
mod monitors;
mod motor_controllers;
mod network;
mod parameter_docs;
mod pins_and_wires;
mod replay;
mod rover;
mod safe_driving;
mod signing;
mod signing_storage;
mod simulated_packs;
mod stories;
mod wifi;
