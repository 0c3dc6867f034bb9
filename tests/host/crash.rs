//! Crash reports, in stepped time: from the heartbeat of a ground station to the wires.

use std::cell::Cell;
use std::future::pending;
use support::time::SECOND;

use embassy_futures::join::join4;
use embassy_time::{Duration, Instant, Timer};
use rover_battmon::autopilot::Start;
use rover_battmon::crash::{CrashCause, CrashRecord, FaultSite, STACK_WORDS, TaskName};
use rover_battmon::mavlink::LinkKind;
use rover_battmon::parameter::Parameters;
use rover_battmon::tasks::{CheckIn, Link, Shared, report_crash, serve_link};
use rover_battmon_tools::sim::clock;
use rover_battmon_tools::sim::stepped::{BYTE_US, Port};
use support::frames::{Frame, HEARTBEAT, STATUSTEXT, frames, of_message};
use support::requests::{GCS, ONBOARD_CONTROLLER, heartbeat};

/// What was said of crashes, and when.
fn texts(sent: &[Frame]) -> Vec<(u64, String)> {
    let texts = of_message(sent, STATUSTEXT);
    texts
        .iter()
        .map(|frame| (frame.at_us, frame.text(1, 50)))
        .filter(|(_, text)| text.starts_with("Crash"))
        .collect()
}

/// When the crash was forgotten.
type Memory = Cell<Option<u64>>;

fn crash() -> CrashRecord {
    CrashRecord {
        task: TaskName::new("battery"),
        cause: CrashCause::Fault(FaultSite {
            pc: 0x1000_1234,
            lr: 0x1000_5679,
            xpsr: 0,
            stack: [0x1000_ABCD; STACK_WORDS],
        }),
    }
}

/// Ten seconds with a system of this kind on the first of two links from `from_us` on.
fn run(kind: u8, from_us: u64, memory: &Memory) -> [Vec<Frame>; 2] {
    let check_in = CheckIn::new("", u32::MAX);
    let (near, far) = (Port::new(BYTE_US), Port::new(BYTE_US));
    clock::run_for(Duration::from_secs(10), async {
        let shared = Shared::new(&Start::with_parameters(Parameters::defaults()));
        let [first, second] = ["first", "second"].map(|name| Link::new(name, LinkKind::Radio, 11_520));
        let system = async {
            Timer::at(Instant::from_micros(from_us)).await;
            loop {
                near.send(&heartbeat(kind));
                Timer::after_secs(1).await;
            }
        };
        let report = async {
            let forget = || memory.set(Some(Instant::now().as_micros()));
            report_crash(&crash(), 0x1000_0000..0x1001_0000, forget, &shared).await;
            pending::<()>().await
        };
        join4(
            serve_link(&near, &near, &shared, &first, &check_in),
            serve_link(&far, &far, &shared, &second, &check_in),
            system,
            report,
        )
        .await
    });
    [near, far].map(|port| frames(&port.sent()))
}

#[test]
fn each_link_reports_a_crash_once_and_the_record_is_cleared() {
    let memory = Memory::default();
    for sent in run(GCS, 3 * SECOND, &memory) {
        assert_eq!(of_message(&sent, HEARTBEAT).len(), 10, "meanwhile");
        let texts = texts(&sent);
        let said: Vec<_> = texts.iter().map(|(_, text)| text.as_str()).collect();
        // The first chunk of each.
        assert_eq!(
            said,
            [
                "Crash: hard fault in battery, PC 0x10001234 LR 0x1",
                "Crash: called from 1000abca 1000abca 1000abca 1000"
            ]
        );
        let reported_us = texts[0].0..texts[1].0;
        assert!(3 * SECOND < reported_us.start && reported_us.end < 3 * SECOND + 100_000);
    }
    assert_eq!(
        memory.get().map(|at_us| at_us / SECOND),
        Some(5),
        "it had time to leave"
    );
}

#[test]
fn other_systems_get_no_crash_report_and_the_record_is_kept() {
    let memory = Memory::default();
    let sent = run(ONBOARD_CONTROLLER, SECOND, &memory);
    assert_eq!(sent.map(|sent| texts(&sent)), [vec![], vec![]]);
    assert_eq!(memory.get(), None);
}
