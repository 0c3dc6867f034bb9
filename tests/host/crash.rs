//! A crash report, in stepped time: from the heartbeat of a ground station to the wires.

use std::cell::Cell;

use embassy_futures::join::join4;
use embassy_time::{Duration, Instant, Timer};
use rover_battmon::autopilot::Start;
use rover_battmon::crash::{CrashCause, CrashRecord, FaultSite, STACK_WORDS, TaskName};
use rover_battmon::mavlink::LinkKind;
use rover_battmon::parameter::Parameters;
use rover_battmon::tasks::{CheckIn, Link, Shared, report_crash, serve_link};
use rover_battmon_tools::sim::clock;
use rover_battmon_tools::sim::stepped::{BYTE_US, Port};
use support::frames::{HEARTBEAT, STATUSTEXT, frames, of_message};
use support::requests::{GCS, ONBOARD_CONTROLLER, heartbeat};
use support::time::SECOND;

#[test]
fn each_link_reports_a_crash_once_a_ground_station_is_heard_and_the_record_is_cleared() {
    let crash = CrashRecord {
        task: TaskName::new("battery"),
        cause: CrashCause::Fault(FaultSite {
            pc: 0x1000_1234,
            lr: 0x1000_5679,
            xpsr: 0,
            stack: [0x1000_ABCD; STACK_WORDS],
        }),
    };
    let forgotten_us = Cell::new(None);
    let check_in = CheckIn::new("", u32::MAX);
    let ports = [(); 2].map(|()| Port::new(BYTE_US));
    clock::run_for(Duration::from_secs(10), async {
        let shared = Shared::new(&Start::with_parameters(Parameters::defaults()));
        let [first, second] = ["first", "second"].map(|name| Link::new(name, LinkKind::Radio, 11_520));
        let system = async {
            // To other systems nothing is reported.
            for kind in [ONBOARD_CONTROLLER; 2].into_iter().chain([GCS; 7]) {
                Timer::after_secs(1).await;
                ports[0].send(&heartbeat(kind));
            }
        };
        let report = async {
            let forget = || forgotten_us.set(Some(Instant::now().as_micros()));
            report_crash(&crash, 0x1000_0000..0x1001_0000, forget, &shared).await;
        };
        join4(
            serve_link(&ports[0], &ports[0], &shared, &first, &check_in),
            serve_link(&ports[1], &ports[1], &shared, &second, &check_in),
            system,
            report,
        )
        .await
    });
    for port in ports {
        let sent = frames(&port.sent());
        assert_eq!(of_message(&sent, HEARTBEAT).len(), 10, "meanwhile");
        let mut texts = of_message(&sent, STATUSTEXT);
        texts.retain(|frame| frame.text(1, 50).starts_with("Crash"));
        let said: Vec<_> = texts.iter().map(|frame| frame.text(1, 50)).collect();
        // The first chunk of each.
        assert_eq!(
            said,
            [
                "Crash: hard fault in battery, PC 0x10001234 LR 0x1",
                "Crash: called from 1000abca 1000abca 1000abca 1000"
            ]
        );
        let reported_us = texts[0].at_us..texts[1].at_us;
        assert!(3 * SECOND < reported_us.start && reported_us.end < 3 * SECOND + 100_000);
    }
    let forgotten_s = forgotten_us.get().map(|at_us| at_us / SECOND);
    assert_eq!(forgotten_s, Some(5), "it had time to leave");
}
