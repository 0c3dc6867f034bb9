//! The tasks on a desk, in stepped time: from conversions of a converter to frames on a wire.

use std::cell::RefCell;

use embassy_futures::join::join3;
use embassy_time::{Duration, Instant, Timer};
use rover_battmon::autopilot::{CrashLine, SAMPLING_INTERVAL_US, Start};
use rover_battmon::battery::{Gap, PackEvent, PackNotice, ReadError, RetainedRecord};
use rover_battmon::mavlink::LinkKind;
use rover_battmon::pack::{MAX_PACKS, Pack};
use rover_battmon::sensor::{AnalogIn, AnalogPin, AnalogReadings, Conversions, WantedReadings};
use rover_battmon::tasks::{
    CheckIn, Link, Shared, Watchdog, sample_batteries, schedule_telemetry, serve_link, supervise,
    write_frames,
};
use rover_battmon::vehicle::ArmState;
use rover_battmon_tools::sim::clock;
use rover_battmon_tools::sim::stepped::Port;
use support::desk::start_with;
use support::frames::{
    BATTERY_STATUS, BatteryStatus, Frame, HEARTBEAT, STATUSTEXT, SYS_STATUS, SysStatus,
    assert_no_sequence_gap, frames, of_message,
};
use support::time::SECOND;
use support::vehicle::{OnHost, TestedVehicle};

/// A converter whose codes depend on the time, one for each millisecond of a tick; without one it has stalled.
struct Converter<F>(F);

impl<F: FnMut(Instant) -> Option<u16>> AnalogIn for Converter<F> {
    fn read(&mut self, until: rover_battmon::time::Instant, _: WantedReadings) -> AnalogReadings {
        let milliseconds = until.as_micros().saturating_sub(SAMPLING_INTERVAL_US)..until.as_micros();
        let codes = milliseconds
            .step_by(1000)
            .map_while(|us| (self.0)(Instant::from_micros(us)));
        let conversions = Conversions::from_codes(codes.collect::<Vec<_>>().into_iter());
        let mut readings = AnalogReadings::NONE;
        readings.set(AnalogPin::Gp26, conversions.ok_or(ReadError::Timeout));
        readings
    }
}

/// 2.0 V at the pin.
const CODE: u16 = 2482;

/// With a failsafe threshold, so that none is announced to be missing.
const THRESHOLD: (&str, f32) = ("BATT_LOW_VOLT", 1.0);

/// 10 bits a byte.
fn byte_us(baud: u64) -> u64 {
    10_000_000 / baud
}

fn run(seconds: u64, input: impl AnalogIn) -> Vec<Frame> {
    run_with(&[THRESHOLD], seconds, 115_200, input)
}

fn run_with(settings: &[(&str, f32)], seconds: u64, baud: u64, input: impl AnalogIn) -> Vec<Frame> {
    let check_ins = [0; 3].map(|_| CheckIn::new("", u32::MAX));
    let port = Port::new(byte_us(baud));
    let mut memory = [RetainedRecord::BLANK; 2];
    clock::run_for(Duration::from_secs(seconds), async {
        let (shared, link) = (
            Shared::new(&start_with(settings)),
            Link::new("line", LinkKind::Radio, baud as u32 / 10),
        );
        join3(
            sample_batteries(input, &mut memory, &shared, &check_ins[0]),
            schedule_telemetry(&shared, &link, &check_ins[1]),
            write_frames(&port, &shared, &link, &check_ins[2]),
        )
        .await
    });
    frames(&port.sent())
}

#[test]
// Requirement: FR-1, FR-8
fn a_pack_appears_on_the_wire_at_the_default_rates() {
    let frames = run(600, Converter(|_| Some(CODE)));
    assert_no_sequence_gap(&frames);
    assert_eq!(of_message(&frames, HEARTBEAT).len(), 600);
    assert_eq!(of_message(&frames, SYS_STATUS).len(), 1200);
    let battery = of_message(&frames, BATTERY_STATUS);
    assert_eq!(battery.len(), 1200);
    for frame in &battery[1..] {
        assert_eq!(BatteryStatus(frame).voltage_mv(0), 7901);
        assert_eq!(BatteryStatus(frame).charge_state(), 1);
        assert_eq!((frame.system_id, frame.component_id), (1, 1));
    }
}

#[test]
// Requirement: AP-2
fn a_scale_an_offset_and_a_pin_count_in_the_next_frame() {
    let mut vehicle = OnHost::configured(&[]);
    vehicle.set_pin_v(AnalogPin::Gp26, 2.0);
    vehicle.set_pin_v(AnalogPin::Gp27, 2.4176);
    // 2482 and 3000 counts: 2.0001 V and 2.4176 V.
    for (name, value, expected_mv) in [
        ("BATT_VOLT_MULT", 7.9, 15_801),
        ("BATT_VLT_OFFSET", 0.1, 15_011),
        ("BATT_VOLT_PIN", 27.0, 18_309),
    ] {
        vehicle.set(name, value);
        let set_us = vehicle.time_us();
        vehicle.run_for(SECOND);
        let frames = vehicle.frames_since(set_us);
        let next = BatteryStatus(of_message(&frames, BATTERY_STATUS)[0]);
        assert_eq!(next.voltage_mv(0), expected_mv, "{name}");
    }
}

#[test]
// Requirement: FR-12
fn the_last_good_value_stays_and_the_fifth_failed_read_says_unhealthy() {
    let stalls_at = Instant::from_micros(4_950_000);
    let frames = run(10, Converter(|at: Instant| (at < stalls_at).then_some(CODE)));
    let battery = of_message(&frames, BATTERY_STATUS);
    // Reads fail from 5.0 s on, so the fifth fails at 5.4 s.
    for frame in &battery[1..] {
        let status = BatteryStatus(frame);
        assert_eq!(status.voltage_mv(0), 7901, "at {} us", frame.at_us);
        let expected = if frame.at_us < 5_402_000 { 1 } else { 6 };
        assert_eq!(status.charge_state(), expected, "at {} us", frame.at_us);
    }
    let sys_status = of_message(&frames, SYS_STATUS);
    let last = SysStatus(sys_status[sys_status.len() - 1]);
    assert!(!last.is_battery_healthy());
    assert!(last.has_battery_sensor());
}

#[test]
fn a_voltage_step_reaches_the_wire_within_620_ms() {
    for phase in 0..20 {
        let step_us = 3_000_000 + phase * 29_917;
        let count = |at: Instant| if at.as_micros() < step_us { 2482 } else { 3000 };
        let frames = run(5, Converter(|at| Some(count(at))));
        let battery = of_message(&frames, BATTERY_STATUS);
        let shows_it = |frame: &&&Frame| BatteryStatus(frame).voltage_mv(0) > 9000;
        let arrived_us = battery.iter().find(shows_it).expect("it arrives").at_us;
        assert!(
            (step_us..step_us + 620_000).contains(&arrived_us),
            "{step_us}: {arrived_us}"
        );
    }
}

#[test]
// Requirement: AP-25
fn a_link_that_is_too_slow_loses_old_telemetry_evenly_and_counts_it_but_no_heartbeat() {
    // 21 + rate × (43 + 53) bytes a second are wanted; a tenth of the baud rate is carried. A heartbeat waits for one frame.
    for (baud, rate_hz, least_of_each, frame_us) in [(600, 2, 200, 900_000), (9_600, 50, 5_000, 60_000)] {
        let settings = [THRESHOLD, ("SR0_EXTRA1", rate_hz as f32)];
        let frames = run_with(&settings, 600, baud, Converter(|_| Some(CODE)));
        assert_no_sequence_gap(&frames);
        let heartbeats = of_message(&frames, HEARTBEAT);
        // The last one may still be on its way.
        assert!([599, 600].contains(&heartbeats.len()));
        for pair in heartbeats.windows(2) {
            let interval_us = pair[1].at_us - pair[0].at_us;
            assert!(
                interval_us.abs_diff(1_000_000) <= frame_us,
                "{baud}: {interval_us}"
            );
        }
        let counts = [SYS_STATUS, BATTERY_STATUS].map(|message| of_message(&frames, message).len());
        assert!(
            counts[0] > least_of_each && counts[0].abs_diff(counts[1]) <= 1,
            "uneven: {counts:?}"
        );
        let sys_status = of_message(&frames, SYS_STATUS);
        let dropped = SysStatus(sys_status[sys_status.len() - 1]).dropped();
        let posted = 2 * rate_hz * 600;
        let left = counts[0] + counts[1];
        assert!(
            usize::from(dropped).abs_diff(posted - left) <= 20 * rate_hz,
            "{dropped} drops counted"
        );
        let texts = texts(&frames).into_iter().map(|(_, text)| text);
        let announced: Vec<_> = texts.filter(|text| text.starts_with("Link")).collect();
        assert_eq!(announced, ["Link too slow for its rates: telemetry reduced"]);
    }
}

/// What two links send in 20 s, of `baud` and of 115200, while `script` runs.
fn sent_while(baud: u64, script: impl AsyncFn(&Shared)) -> [Vec<Frame>; 2] {
    let check_in = CheckIn::new("", u32::MAX);
    let bauds = [baud, 115_200];
    let ports = bauds.map(|baud| Port::new(byte_us(baud)));
    let [slow, fast] = bauds.map(|baud| Link::new("line", LinkKind::Radio, baud as u32 / 10));
    clock::run_for(Duration::from_secs(20), async {
        let shared = Shared::new(&start_with(&[THRESHOLD]));
        join3(
            serve_link(&ports[0], &ports[0], &shared, &slow, &check_in),
            serve_link(&ports[1], &ports[1], &shared, &fast, &check_in),
            script(&shared),
        )
        .await
    });
    ports.map(|port| frames(&port.sent()))
}

/// The texts of one frame each, with the time at which they had arrived.
fn texts(frames: &[Frame]) -> Vec<(u64, String)> {
    of_message(frames, STATUSTEXT)
        .iter()
        .map(|frame| (frame.at_us, frame.text(1, 50)))
        .collect()
}

#[test]
fn what_is_announced_is_said_once_and_at_once_on_every_link() {
    let said = sent_while(57_600, async |shared| {
        for number in 1..=5 {
            Timer::after_millis(1_030).await;
            shared.announce(&CrashLine(&format!("Battery {number} is low")));
        }
    });
    for frames in said {
        assert_no_sequence_gap(&frames);
        let texts = texts(&frames);
        assert_eq!(texts.len(), 5, "{texts:?}");
        for (number, (at_us, text)) in (1..).zip(texts) {
            assert_eq!(text, format!("Battery {number} is low"));
            let announced_us = number * 1_030_000;
            assert!(at_us > announced_us && at_us - announced_us < 100_000, "{at_us}");
        }
    }
}

#[test]
fn all_packs_can_be_announced_in_the_same_tick() {
    let said = sent_while(57_600, async |shared| {
        Timer::after_millis(1_030).await;
        for number in 1..=9 {
            shared.announce(&CrashLine(&format!("Battery {number}: {}", "x".repeat(80))));
        }
    });
    for frames in said {
        let texts = texts(&frames);
        // Two chunks each.
        assert_eq!(texts.len(), 18);
        for (number, chunks) in (1..).zip(texts.chunks(2)) {
            assert!(
                chunks[0].1.starts_with(&format!("Battery {number}: ")),
                "{chunks:?}"
            );
            assert_eq!(chunks[0].1.len() + chunks[1].1.len(), 91);
        }
    }
}

/// 1200 baud carry two texts a second; eighty are announced in that time, of several packs and kinds, so that none is left
/// out as too frequent.
#[test]
fn a_link_that_is_too_slow_loses_the_oldest_and_no_other_link_does() {
    const TEXTS: usize = 80;
    let [slow, fast] = sent_while(1_200, async |shared| {
        for number in 1..=TEXTS {
            Timer::after_millis(20).await;
            let gap = PackEvent::Gap(Gap {
                duration_s: number as f32 + 100.0,
                counted_mah: None,
            });
            shared.announce(&PackNotice(Pack::ALL[number % MAX_PACKS], &gap));
        }
    });
    let numbers = |frames: &[Frame]| {
        let number = |(_, text): (u64, String)| {
            text.split_once("not measured for ")?
                .1
                .split_once('s')?
                .0
                .parse()
                .ok()
        };
        texts(frames)
            .into_iter()
            .filter_map(number)
            .collect::<Vec<usize>>()
    };
    assert_eq!(numbers(&fast), Vec::from_iter(101..=100 + TEXTS));
    let said = numbers(&slow);
    assert!(said.len() < TEXTS / 2, "{}", said.len());
    assert!(
        said.is_sorted() && said.windows(2).all(|pair| pair[0] != pair[1]),
        "{said:?}"
    );
    assert_eq!(said[0], 101);
    assert_eq!(of_message(&slow, HEARTBEAT).len(), 20);
}

/// When it was fed, and who has kept it from being fed since then.
#[derive(Default)]
struct Fed {
    at_ms: RefCell<Vec<u64>>,
    overdue: RefCell<Vec<String>>,
}

impl Watchdog for &Fed {
    fn feed(&mut self, _: ArmState) {
        self.at_ms.borrow_mut().push(Instant::now().as_millis());
        self.overdue.borrow_mut().clear();
    }

    fn starve(&mut self, overdue: &str) {
        self.overdue.borrow_mut().push(overdue.to_owned());
    }
}

#[test]
fn the_watchdog_is_fed_until_a_task_is_overdue() {
    let (busy, quiet) = (CheckIn::new("busy", 500), CheckIn::new("quiet", 2_500));
    let fed = Fed::default();
    let shared = Shared::new(&Start::default());
    clock::run_for(Duration::from_secs(10), async {
        let check_in = async {
            loop {
                busy.mark(Instant::now().as_micros() as u32);
                Timer::after_millis(100).await;
            }
        };
        embassy_futures::join::join(check_in, supervise(&shared, &[&busy, &quiet], &mut &fed)).await
    });
    // Every 100 ms from 0 to 2500; at 2600 "quiet" is overdue.
    let (at_ms, overdue) = (fed.at_ms.into_inner(), fed.overdue.into_inner());
    assert!(at_ms.into_iter().eq((0..=25).map(|look| look * 100)));
    assert!(!overdue.is_empty() && overdue.iter().all(|task| task == "quiet"));
}
