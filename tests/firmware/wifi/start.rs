//! From power-up to the access point.

use crate::bench::{Bench, SECOND};

#[test]
fn first() {
    let mut bench = Bench::power_up(2482);
    bench.attach_wifi();
    for _ in 0..300 {
        bench.run_for(SECOND / 100);
        let now = bench.time_us();
        let wifi = bench.wifi();
        let sent = wifi.take_sent();
        if !sent.is_empty() {
            println!("{now}: {:?} {}", wifi.access_point(), sent.len());
            println!("{:02x?}", sent[0]);
        }
    }
    for line in bench.log_lines() {
        println!("{line}");
    }
}
