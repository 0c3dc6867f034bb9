//! scratch
use rover_battmon::battery::*;
use std::io::Write;
fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    let mut s = PackSettings::default();
    let mut file = String::new();
    let mut vonly = false;
    let mut skip = 0usize;
    let mut every = 1usize;
    let mut it = args.iter();
    while let Some(a) = it.next() {
        if a == "--param" {
            let kv = it.next().unwrap();
            let (k, v) = kv.split_once('=').unwrap();
            let v: f32 = v.parse().unwrap();
            match k {
                "BATT_CAPACITY" => s.capacity_mah = (v > 0.0).then_some(v),
                "BATT_CELLS" => s.cell_count = (v > 0.0).then_some(v as u8),
                "BATT_CHEM" => s.chemistry = Chemistry::from_number(v as i32).unwrap(),
                "BATT_MONITOR" => vonly = v == 3.0,
                "SKIP" => skip = v as usize,
                "EVERY" => every = v as usize,
                "BATT_LOW_VOLT" => s.failsafe.low.voltage_v = Some(v),
                "BATT_CRT_VOLT" => s.failsafe.critical.voltage_v = Some(v),
                "BATT_LOW_TIMER" => s.failsafe.timer_s = (v > 0.0).then_some(v),
                _ => panic!("{k}"),
            }
        } else {
            file = a.clone();
        }
    }
    let mut m = BatteryMonitor::new();
    let text = std::fs::read_to_string(&file).unwrap();
    let mut out = std::io::BufWriter::new(std::io::stdout());
    writeln!(out, "t_s,voltage_v,current_a,consumed_mah,consumed_wh,resistance_ohm,voltage_resting_v,remaining_pct,time_remaining_s,charge_state,failsafe,events").unwrap();
    for line in text.lines().skip(1 + skip).step_by(every) {
        let f: Vec<&str> = line.split(',').collect();
        let t: f64 = f[0].parse().unwrap();
        let v: f32 = f[1].parse().unwrap();
        let i: Option<f32> = f[2].parse().ok().filter(|_| !vonly);
        let ok = f[3] == "1";
        let tick = Tick {
            now_us: (t * 1e6).round() as u64,
            arm_state: if f[4] == "1" {
                ArmState::Armed
            } else {
                ArmState::Disarmed
            },
        };
        let r = if ok {
            Ok(Measurement {
                voltage_v: Some(v),
                current_a: i,
                ..Default::default()
            })
        } else {
            Err(ReadError::Timeout)
        };
        let (ev, _) = m.update(tick, r, &s);
        let st = m.state();
        let o = |x: Option<f32>| x.map_or(String::new(), |x| x.to_string());
        let evs: Vec<String> = ev.iter().map(|e| e.to_string()).collect();
        writeln!(
            out,
            "{t},{v},{},{},{},{},{},{},{},{},{},{}",
            o(i),
            o(st.consumed_mah),
            o(st.consumed_wh),
            o(st.resistance_ohm),
            st.resting_voltage_v
                .or(st.voltage_v)
                .map_or(String::new(), |x| x.to_string()),
            st.remaining_pct.unwrap_or(-1.0),
            o(st.time_remaining_s),
            st.charge_state as u8,
            m.failsafe() as u8,
            evs.join("; ").replace(',', ";")
        )
        .unwrap();
    }
}
