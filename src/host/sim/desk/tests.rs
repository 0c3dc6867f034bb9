//! Scenarios in stepped time: what is announced, when, and in which order.

use std::cell::RefCell;

use embassy_time::Instant;

use super::*;
use crate::host::sim::clock;

/// Something that was shown, and when, in seconds.
#[derive(Clone, Debug)]
struct Shown {
    at_s: u64,
    level: Level,
    text: String,
}

/// Everything that a scenario shows, to its closing sentence.
fn shown(name: &str) -> Vec<Shown> {
    let scenario = Scenario::named(name).expect(name);
    let shown = RefCell::new(Vec::new());
    let (flash, rover) = (SimulatedFlash::open(None).unwrap(), SimulatedRover::default());
    let pack = RefCell::new(scenario.pack.clone());
    clock::run_for(Duration::from_secs(u64::from(scenario.end_s) + 2), async {
        let (desk, storages) = start(&flash, Some(scenario), &pack).await;
        let show = |level, text: &str| {
            shown.borrow_mut().push(Shown {
                at_s: Instant::now().as_secs(),
                level,
                text: text.to_owned(),
            });
        };
        join(
            desk.run_vehicle(storages, &rover),
            desk.serve_station(Some(scenario), show),
        )
        .await;
    });
    shown.take()
}

/// When each of these was shown, after asserting that they came in this order.
fn times(shown: &[Shown], beginnings: &[&str]) -> Vec<u64> {
    let mut rest = shown.iter();
    beginnings
        .iter()
        .map(|beginning| {
            let found = rest.find(|shown| shown.text.starts_with(beginning));
            found
                .unwrap_or_else(|| panic!("no {beginning:?} in its place: {shown:#?}"))
                .at_s
        })
        .collect()
}

#[test]
fn a_drained_pack_is_low_then_critical_and_the_rover_stops() {
    let shown = shown("drain");
    let times = times(
        &shown,
        &[
            "the driver arms",
            "MANUAL, armed",
            "Battery 1 low: ",
            "Battery 1 is low ",
            "Battery 1 critical: ",
            "Battery 1 is critical ",
            "HOLD, armed",
            "the driver disarms",
            "Seen: low at ",
        ],
    );
    // 2.2 Ah at 4.2 A are 31 minutes.
    assert!((1500..1860).contains(&times[2]), "{times:?}");
    assert!(times[6] - times[5] <= 1, "{times:?}");
    assert!(!shown.iter().any(|shown| shown.text.contains("Failsafe: Hold")));
    let failsafe = shown.iter().find(|shown| shown.text.contains("is critical"));
    assert_eq!(failsafe.map(|shown| shown.level), Some(Level::Critical));
}

#[test]
fn a_cold_pack_is_low_ten_minutes_earlier() {
    let low_at_s = |name| times(&shown(name), &["MANUAL, armed", "Battery 1 is low "])[1];
    let (cold_s, warm_s) = (low_at_s("cold"), low_at_s("drain"));
    assert!((500..800).contains(&(warm_s - cold_s)), "{cold_s} and {warm_s}");
}

#[test]
fn a_cold_drive_ends_in_hold() {
    times(
        &shown("cold"),
        &["Battery 1 is critical ", "HOLD, armed", "Seen: low at "],
    );
}

#[test]
fn a_swapped_pack_is_announced_and_estimated_anew() {
    let shown = shown("swap");
    let times = times(
        &shown,
        &[
            "the pack is unplugged",
            "a full pack is plugged in",
            "Battery 1 swapped: ",
            "Seen: the swap at ",
        ],
    );
    assert!(times[2] - times[1] <= 5, "{times:?}");
    let closing = &shown.last().unwrap().text;
    assert!(closing.contains("at the end 100 % left, 100 ±"), "{closing}");
}

#[test]
fn a_loose_wire_stops_the_rover_until_the_driver_goes_on() {
    let shown = shown("loose-wire");
    let times = times(
        &shown,
        &[
            "MANUAL, armed",
            "a wire of the power monitor comes loose",
            "Battery 1 unhealthy: no answer",
            "Battery 1 is missing, last: 11.",
            "HOLD, armed",
            "the wire is put back",
            "Battery 1 healthy again",
            "the driver goes on",
            "MANUAL, armed",
            "MANUAL, disarmed",
            "Seen: unhealthy at ",
        ],
    );
    let [loose_s, unhealthy_s, missing_s, hold_s] = times[1..5] else {
        panic!("{times:?}");
    };
    assert!(unhealthy_s - loose_s <= 1, "{times:?}");
    assert!((5..=6).contains(&(missing_s - loose_s)), "{times:?}");
    assert!(hold_s - missing_s <= 1, "{times:?}");
}
