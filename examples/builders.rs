//! The message builders alone: from a `BatteryState` to the bytes on the wire.
//!
//! Run it with `cargo run --example builders`.

use rover_battmon::battery::{BatteryState, ChargeState, PackStatus, Readings};
use rover_battmon::mavlink::{Framer, Stream};
use rover_battmon::pack::Pack;
use rover_battmon::system::SystemState;

fn main() {
    let batteries = [BatteryState {
        status: PackStatus::Healthy,
        charge_state: ChargeState::Ok,
        readings: Readings {
            voltage_v: Some(11.62),
            ..Readings::NONE
        },
        ..BatteryState::default()
    }];
    let state = SystemState {
        batteries: &batteries,
        ..SystemState::default()
    };

    let mut framer = Framer::new();
    for stream in [
        Stream::Heartbeat,
        Stream::SysStatus,
        Stream::BatteryStatus(Pack::First),
    ] {
        let message = stream.build(&state);
        let frame = framer.frame(&message, 1);
        println!("{message:#?}");
        println!("{} bytes: {frame:02x?}\n", frame.len());
    }
}
