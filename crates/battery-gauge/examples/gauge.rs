//! State of charge from a recording: `cargo run -p battery-gauge --example gauge -- FILE CELLS MAH`, a line a minute.
//!
//! The file has a header and lines of seconds, volts and amperes; a load takes positive ones.

use std::error::Error;
use std::{env, fs};

use battery_gauge::{BatteryMonitor, BatteryState, Instant, LoadState, Measurement, PackSettings, Tick};

/// What the product draws while it is switched off is less, in amperes.
const LEAST_LOAD_A: f32 = 0.1;

fn main() -> Result<(), Box<dyn Error>> {
    let [file, cells, capacity_mah] = &env::args().skip(1).collect::<Vec<_>>()[..] else {
        return Err("usage: gauge FILE CELLS MAH".into());
    };
    let settings = PackSettings {
        cell_count: Some(cells.parse()?),
        capacity_mah: Some(capacity_mah.parse()?),
        ..PackSettings::default()
    };
    let (mut monitor, mut battery) = (BatteryMonitor::new(), BatteryState::default());
    let (mut minutes, mut loaded_s) = (0.0, f32::NEG_INFINITY);
    for line in fs::read_to_string(file)?.lines().skip(1) {
        let numbers: Vec<f32> = line.split(',').map(str::parse).collect::<Result<_, _>>()?;
        let [seconds, voltage_v, current_a, ..] = numbers[..] else {
            return Err(format!("not three numbers: {line}").into());
        };
        let reading = Measurement {
            voltage_v: Some(voltage_v),
            current_a: Some(current_a),
            ..Measurement::default()
        };
        // Nothing here shows when the load is switched off: a minute without a current does.
        if current_a > LEAST_LOAD_A {
            loaded_s = seconds;
        }
        let load_state = if seconds < loaded_s + 60.0 {
            LoadState::On
        } else {
            LoadState::Off
        };
        let now = Instant::from_micros((f64::from(seconds) * 1e6) as u64);
        let tick = Tick { now, load_state };
        let _ = monitor.update(&mut battery, tick, Ok(reading), &settings);
        if seconds >= 60.0 * minutes {
            let charge = battery.readings;
            let known = charge.remaining_pct.zip(charge.remaining_sigma_pct);
            let left = known.map(|(pct, sigma_pct)| format!("{pct:.1} ± {sigma_pct:.1} %"));
            println!("{minutes:3} min: {}", left.as_deref().unwrap_or("unknown"));
            minutes += 1.0;
        }
    }
    Ok(())
}
