//! Signing over restarts, damage, power cuts and flash that fails, from set-up by cable to who is obeyed by radio.

use std::future::pending;
use std::sync::LazyLock;

use embassy_futures::join::join3;
use embassy_futures::select::select;
use embassy_time::{Duration, Instant, Timer};
use nor_flash::SmallFlash;
use proptest::prelude::*;
use rover_battmon::autopilot::Start;
use rover_battmon::crash::ParameterSource;
use rover_battmon::mavlink::{Event, LinkKind};
use rover_battmon::pack::Pack;
use rover_battmon::parameter::BatteryParameter;
use rover_battmon::tasks::{CheckIn, Link, Shared, reboot_requested, serve_link};
use rover_battmon_tools::sim::clock;
use rover_battmon_tools::sim::stepped::{BYTE_US, Port};
use support::desk::Desk;
use support::frames::{Frame, frames, texts_of};
use support::requests::{param_set, reboot, setup_signing};
use support::signer::{NEW_YEAR, OWNER, Signer};

use crate::regions::{Regions, keep};

/// Each key repeats one byte; this one stands for no key.
const NONE: u8 = 0;
const OLD: u8 = 6;

const KEY_SET: &str = "Signing key set";
const KEY_REMOVED: &str = "Signing key removed: commands are accepted from anyone";
const KEY_LOST: &str = "Signing key lost: set up by USB (used Pico: erase)";
const NOT_SAVED: &str = "Signing not saved: set it up again after a restart";

const TICKS_PER_SECOND: u64 = 100_000;

/// Frames that one start of a vehicle has sent.
struct Run {
    cable: Vec<Frame>,
    radio: Vec<Frame>,
    /// By another cable, plugged in when half of the time was over.
    late_cable: Vec<Frame>,
}

/// Of a vehicle with what is stored of signing, and nothing else.
fn regions(flash: &SmallFlash) -> Regions {
    Regions {
        signing: flash.clone(),
        ..Regions::blank()
    }
}

/// Runs a vehicle with this flash until a restart is requested, or for this many seconds. Requests come by cable.
fn run(seconds: u64, flash: &SmallFlash, requests: &[(u64, Vec<u8>)]) -> Run {
    run_while(seconds, flash, requests, pending())
}

/// Runs such a vehicle while something else happens.
fn run_while(
    seconds: u64,
    flash: &SmallFlash,
    requests: &[(u64, Vec<u8>)],
    script: impl Future<Output = ()>,
) -> Run {
    let check_in = CheckIn::new("", u32::MAX);
    let ports = [(); 3].map(|()| Port::new(BYTE_US));
    clock::run_for(Duration::from_secs(seconds), async {
        let mut storages = regions(flash).storages();
        let mut start = Start::default();
        // No pack, whose announcements would come in between.
        let monitor = BatteryParameter::Monitor.of(Pack::First);
        start.parameters.set(monitor, 0.0).unwrap();
        storages.boot(ParameterSource::Stored, &mut start).await;
        let shared = Shared::new(&start);
        let serve = async |kind, port| {
            let link = Link::new("link", kind, 11_520);
            serve_link(port, port, &shared, &link, &check_in).await;
        };
        let asked = async {
            for (second, bytes) in requests {
                Timer::at(Instant::from_secs(*second)).await;
                ports[0].send(bytes);
            }
            Timer::after_secs((seconds / 2).saturating_sub(Instant::now().as_secs())).await;
            serve(LinkKind::Direct, &ports[2]).await;
        };
        let links = join3(
            serve(LinkKind::Direct, &ports[0]),
            serve(LinkKind::Radio, &ports[1]),
            asked,
        );
        let vehicle = join3(keep(storages, &shared), links, script);
        select(vehicle, reboot_requested(&shared, || true)).await;
    });
    let [cable, radio, late_cable] = ports.map(|port| frames(&port.sent()));
    Run {
        cable,
        radio,
        late_cable,
    }
}

/// A request to set up this key `second` seconds after the start, when the ground station's clock says so, too.
fn set_up(second: u64, key: u8) -> (u64, Vec<u8>) {
    let time = if key == NONE {
        0
    } else {
        NEW_YEAR + second * TICKS_PER_SECOND
    };
    (second, setup_signing([key; 32], time))
}

/// The flash of a vehicle that ran for `seconds`, with these keys set up one second after another.
fn flash_after(seconds: u64, keys: &[u8]) -> SmallFlash {
    let flash = SmallFlash::blank();
    let request = |(second, key): (u64, &u8)| set_up(second, *key);
    let requests: Vec<_> = (1..).zip(keys).map(request).collect();
    run(seconds, &flash, &requests);
    flash
}

fn count(frames: &[Frame], text: &str) -> usize {
    texts_of(frames).iter().filter(|said| *said == text).count()
}

/// The frames that a vehicle obeys by radio.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Obeys {
    Everyone,
    Key(u8),
    Nothing,
}

/// The frames that a vehicle obeys after a start with this flash. `recorded` is what its owner has sent before.
fn obeys(flash: &SmallFlash, recorded: &[u8]) -> Obeys {
    let start = regions(flash).started(ParameterSource::Stored);
    let is_lost = start.signing.has_lost_key();
    let mut desk = Desk::starting(start);
    let mut takes = |request: &[u8]| {
        let events = desk.receive_in_chunks(request, 64);
        let is_refused = |event: &Event| matches!(event, Event::Unauthorized { .. } | Event::TooOld);
        !events.iter().all(is_refused)
    };
    if takes(&param_set("BATT_LOW_VOLT", 6.5)) {
        assert!(!is_lost);
        return Obeys::Everyone;
    }
    assert!(!takes(recorded), "a recording is obeyed");
    let key = [OLD, OWNER].into_iter().find(|key| {
        let mut signer = Signer::new(*key);
        // A day later.
        signer.timestamp += 86_400 * TICKS_PER_SECOND;
        takes(&signer.sign(&param_set("BATT_LOW_VOLT", 6.5)))
    });
    assert_eq!(is_lost, key.is_none(), "locked for ever and not announced");
    key.map_or(Obeys::Nothing, Obeys::Key)
}

/// A request that the owner sent `second` seconds after New Year.
fn recorded(second: u64) -> Vec<u8> {
    let mut signer = Signer::new(OWNER);
    signer.timestamp += second * TICKS_PER_SECOND;
    signer.sign(&param_set("BATT_LOW_VOLT", 6.25))
}

#[test]
// Requirement: L-13
fn whichever_bit_flips_the_choice_stays_or_the_key_is_lost() {
    // At once, after some marks, and when the records have moved to the other sector, once and twice.
    let histories: [(u64, &[u8]); 8] = [
        (3, &[OWNER]),
        (4, &[NONE, OWNER]),
        (4, &[OLD, OWNER]),
        (5, &[OLD, NONE, OWNER]),
        (4, &[OWNER, NONE]),
        (300, &[OLD, NONE, OWNER]),
        (1200, &[OLD, OWNER]),
        (2400, &[NONE, OLD, OWNER]),
    ];
    for (seconds, keys) in histories {
        let flash = flash_after(seconds, keys);
        let expected = match keys.last() {
            Some(&NONE) => Obeys::Everyone,
            _ => Obeys::Key(OWNER),
        };
        let recording = recorded(seconds - 1);
        assert_eq!(obeys(&flash.repaired(), &recording), expected);
        let mut lost = 0;
        for bit in 0..8 * SmallFlash::REGION_BYTES {
            let outcome = obeys(&flash.with_flipped_bit(bit), &recording);
            assert!(
                outcome == expected || outcome == Obeys::Nothing,
                "{keys:?} after {seconds} s, bit {bit}: {outcome:?}"
            );
            lost += usize::from(outcome == Obeys::Nothing);
        }
        // The eight words of the key are stored once.
        let in_key = 8 * 12 * 8;
        assert!(
            expected == Obeys::Everyone || lost <= in_key + 32,
            "{keys:?}: {lost}"
        );
    }
}

#[test]
// Requirement: L-13
fn damaged_headers_lock_and_blank_flash_does_not() {
    assert_eq!(obeys(&SmallFlash::blank(), &[]), Obeys::Everyone);
    // Other programs have left something there.
    for byte in [0, 0x55, 0xa5] {
        let flash = SmallFlash::with(&[byte; SmallFlash::REGION_BYTES]);
        assert_eq!(obeys(&flash, &[]), Obeys::Nothing, "{byte:#x}");
    }
    let flash = flash_after(5, &[OLD, NONE, OWNER]);
    let sector = SmallFlash::REGION_BYTES / 2;
    for damaged in [vec![0], vec![1], vec![0, 1]] {
        let mut bytes = flash.bytes();
        for start in damaged.iter().map(|number| number * sector) {
            for header in [start, start + sector - 16] {
                bytes[header] ^= 1;
            }
        }
        let outcome = obeys(&SmallFlash::with(&bytes), &recorded(4));
        // One of the sectors is out of date.
        assert!(
            [Obeys::Key(OWNER), Obeys::Nothing].contains(&outcome),
            "{damaged:?}"
        );
        assert!(damaged.len() == 1 || outcome == Obeys::Nothing);
    }
}

#[test]
fn a_power_cut_at_any_moment_of_a_set_up_never_opens_a_vehicle() {
    let histories: [&[u8]; 5] = [&[], &[OLD, NONE], &[OLD], &[OLD, OLD], &[OWNER]];
    for (seed, keys) in (0..).zip(histories.repeat(4)) {
        let before = flash_after(10, keys);
        for after in 0.. {
            let flash = before.repaired();
            flash.chip().cut_power_after(after, seed);
            let run = run(5, &flash, &[set_up(2, OWNER)]);
            let is_over = !flash.chip().is_powered_off();
            let outcome = obeys(&flash.repaired(), &[]);
            let was = obeys(&before.repaired(), &[]);
            let was_said = count(&run.cable, KEY_SET) > 0;
            let is_allowed = match outcome {
                Obeys::Key(OWNER) => true,
                Obeys::Nothing => !was_said && was == Obeys::Everyone,
                // Not even begun.
                Obeys::Everyone => !was_said && after == 0 && was == outcome,
                _ => !was_said && outcome == was,
            };
            assert!(is_allowed, "{keys:?} cut at {after}: {was:?} became {outcome:?}");
            if is_over {
                assert!(was_said && outcome == Obeys::Key(OWNER));
                break;
            }
        }
    }
}

#[test]
// Requirement: L-13
fn a_key_that_can_not_be_written_is_announced_until_it_is_and_locks_after_a_restart() {
    for keys in [&[][..], &[OLD, NONE], &[OLD]] {
        let before = flash_after(10, keys);
        for after in 0..8 {
            let flash = before.repaired();
            flash.chip().refuse_all_after(after);
            let run = run(130, &flash, &[set_up(2, OWNER)]);
            for frames in [&run.cable, &run.radio] {
                assert_eq!(count(frames, KEY_SET), 0);
                // At the start if even the time can't be written, after the set-up, and once a minute.
                let said = count(frames, NOT_SAVED);
                assert!((2..=5).contains(&said), "{keys:?}, {after} operations: {said}");
            }
            assert!(
                count(&run.late_cable, NOT_SAVED) >= 1,
                "also to who connects later"
            );
            assert!(
                run.radio.last().is_some_and(|frame| frame.signed.is_some()),
                "in force"
            );
            let outcome = obeys(&flash.repaired(), &[]);
            let is_allowed = match (after, keys) {
                // Flash that takes nothing at all can't remember that there was a key.
                (0, [] | [.., NONE]) => outcome == Obeys::Everyone,
                (_, [.., OLD]) => [Obeys::Key(OLD), Obeys::Nothing].contains(&outcome),
                _ => outcome == Obeys::Nothing,
            };
            assert!(is_allowed, "{keys:?}, {after} operations: {outcome:?}");
        }
    }
}

#[test]
fn a_key_that_could_not_be_written_at_first_is_written_later_and_announced_then() {
    let flash = SmallFlash::blank();
    flash.chip().refuse_all_after(3);
    let run = run_while(90, &flash, &[set_up(2, OWNER)], async {
        Timer::after_secs(30).await;
        flash.chip().power_up();
    });
    assert_eq!(texts_of(&run.cable), [NOT_SAVED, KEY_SET]);
    assert_eq!(obeys(&flash, &[]), Obeys::Key(OWNER));
}

#[test]
fn a_restart_that_would_lose_the_key_is_announced() {
    let flash = SmallFlash::blank();
    flash.chip().refuse_all_after(0);
    let run = run(30, &flash, &[set_up(2, OWNER), (10, reboot())]);
    assert_eq!(count(&run.cable, NOT_SAVED), 2);
}

#[test]
fn a_lost_key_is_announced_on_every_link_until_signing_is_set_up_by_cable() {
    let mut garbage = vec![0xFF; SmallFlash::REGION_BYTES];
    garbage[700] = 0x7F;
    for (key, done, expected) in [
        (OWNER, KEY_SET, Obeys::Key(OWNER)),
        (NONE, KEY_REMOVED, Obeys::Everyone),
    ] {
        let flash = SmallFlash::with(&garbage);
        let locked = run(20, &flash, &[]);
        for frames in [locked.cable, locked.radio, locked.late_cable] {
            assert_eq!(texts_of(&frames), [KEY_LOST]);
        }
        assert_eq!(obeys(&flash, &[]), Obeys::Nothing);

        let recovered = run(20, &flash, &[set_up(5, key)]);
        // In as many messages as it takes.
        for frames in [recovered.cable, recovered.radio] {
            assert_eq!(texts_of(&frames).concat(), [KEY_LOST, done].concat());
        }
        assert_eq!(texts_of(&recovered.late_cable), [""; 0]);
        assert_eq!(obeys(&flash, &[]), expected);
    }
}

#[test]
// Requirement: L-13
fn flash_that_fails_while_the_time_is_written_locks_after_a_restart() {
    // The sector fills within minutes. The next one takes nothing, so the time can't be kept.
    let flash = flash_after(10, &[OWNER]);
    flash.chip().wear_out(1);
    let run = run(1500, &flash, &[]);
    assert!(count(&run.cable, NOT_SAVED) > 1);
    assert_eq!(obeys(&flash.repaired(), &recorded(1500)), Obeys::Nothing);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    /// Whatever bytes change: no key but the last one is obeyed, and the vehicle is not open.
    #[test]
    fn no_damage_opens_a_vehicle_whose_owner_has_set_a_key(
        changes in prop::collection::vec((0..SmallFlash::REGION_BYTES, any::<u8>()), 1..40),
    ) {
        let mut bytes = FLASH_WITH_KEY.clone();
        for (at, byte) in changes {
            bytes[at] = byte;
        }
        let outcome = obeys(&SmallFlash::with(&bytes), &recorded(4));
        prop_assert!([Obeys::Key(OWNER), Obeys::Nothing].contains(&outcome), "{:?}", outcome);
    }
}

static FLASH_WITH_KEY: LazyLock<Vec<u8>> = LazyLock::new(|| flash_after(5, &[OLD, NONE, OWNER]).bytes());
