//! A board whose flash holds a signing key.

use emulator::LogLevel;
use support::frames::{BATTERY_STATUS, Frame, HEARTBEAT, SYS_STATUS, SysStatus, of_message, texts_of};
use support::requests::{param_read_by_name, param_set, reboot};
use support::signer::Signer;
use workbench::bench::{Bench, DIVIDER_CODE, MINUTE, SAVED_US, SECOND, SIGNING_OFFSET, value_of};
use workbench::runs::signing_time;
use workbench::signing_key::{OWNER, STRANGER, flash_with_key, protected};

const KEY_LOST: &str = "Signing key lost: set up by USB (used Pico: erase)";

/// Where a sector's records start, and their size.
const RECORDS: usize = 16;
const RECORD_BYTES: usize = 12;

/// A board that signs and takes everything all the same.
pub fn open_with_key() -> Bench {
    const EVERYTHING: f32 = 2.0;
    let mut bench = protected();
    let request = station(&mut bench).sign(&param_set("SIGN_UART_ALLOW", EVERYTHING));
    assert_eq!(
        value_of(&bench.ask(&request), "SIGN_UART_ALLOW"),
        Some(EVERYTHING)
    );
    bench
}

fn sets(bench: &mut Bench, frame: &[u8]) -> Option<f32> {
    value_of(&bench.ask(frame), "BATT_LOW_VOLT")
}

/// The times of the frames, all of which are signed with the owner's key.
fn times(frames: &[Frame]) -> Vec<u64> {
    let owner = Signer::new(OWNER);
    frames.iter().map(|frame| owner.verify(frame).1).collect()
}

/// A ground station that has heard what the board sent last.
pub fn station(bench: &mut Bench) -> Signer {
    let mut signer = Signer {
        timestamp: 0,
        ..Signer::new(OWNER)
    };
    signer.hear(&bench.frames());
    signer
}

#[test]
fn everything_is_signed_and_the_times_only_grow() {
    let mut bench = protected();
    bench.run_for(10 * SECOND);
    let frames = bench.frames();
    assert!(of_message(&frames, BATTERY_STATUS).len() >= 20);
    let times = times(&frames);
    assert!(times.is_sorted_by(|before, after| before < after));
    bench.assert_untroubled();
}

#[test]
fn only_who_has_the_key_is_obeyed() {
    let mut bench = protected();
    assert_eq!(sets(&mut bench, &param_set("BATT_LOW_VOLT", 6.5)), None);
    let mut stranger = station(&mut bench);
    stranger.key = [STRANGER; 32];
    assert_eq!(
        sets(&mut bench, &stranger.sign(&param_set("BATT_LOW_VOLT", 6.5))),
        None
    );
    assert_eq!(sets(&mut bench, &param_read_by_name("BATT_LOW_VOLT")), None);

    let mut owner = station(&mut bench);
    let set = owner.sign(&param_set("BATT_LOW_VOLT", 6.25));
    assert_eq!(sets(&mut bench, &set), Some(6.25));
    assert_eq!(
        sets(&mut bench, &owner.sign(&param_set("BATT_LOW_VOLT", 6.75))),
        Some(6.75)
    );
    assert_eq!(sets(&mut bench, &set), None, "a recording");
    let read = owner.sign(&param_read_by_name("BATT_LOW_VOLT"));
    assert_eq!(sets(&mut bench, &read), Some(6.75));

    bench.run_for(SECOND);
    let frames = bench.frames();
    let ignored = |text: &&String| text.contains("ignored");
    assert_eq!(
        texts_of(&frames).iter().filter(ignored).count(),
        1,
        "in ten seconds"
    );
    let logged = bench.logged(LogLevel::Info, "ignored: ");
    let announced = logged.iter().filter(|(_, line)| line.contains("announced: "));
    assert_eq!(announced.count(), 1, "{logged:?}");
    let status = of_message(&frames, SYS_STATUS);
    assert_eq!(SysStatus(status[status.len() - 1]).dropped(), 0);
}

#[test]
// Requirement: OWN-4, L-14
fn no_restart_lets_the_time_go_back_or_a_recording_in() {
    let mut bench = protected();
    let mut owner = station(&mut bench);
    let recorded = owner.sign(&param_set("BATT_LOW_VOLT", 6.25));
    assert_eq!(sets(&mut bench, &recorded), Some(6.25));
    bench.run_for(SAVED_US);

    let mut latest = owner.timestamp;
    for restart in [
        Restart::Hang,
        Restart::PowerCycle,
        Restart::Requested,
        Restart::RunPin,
    ] {
        restart.happen(&mut bench, &mut owner);
        // What was on the wire at the restart is cut off.
        bench.forget_sent();
        bench.run_for(2 * SECOND);
        let frames = bench.frames();
        assert!(of_message(&frames, HEARTBEAT).len() >= 2);
        assert!(times(&frames).iter().all(|time| *time > latest), "{restart:?}");
        latest = *times(&frames).last().expect("it sends");
        assert_eq!(sets(&mut bench, &recorded), None, "a recording");
        owner.hear(&frames);
        let read = owner.sign(&param_read_by_name("BATT_LOW_VOLT"));
        assert_eq!(
            sets(&mut bench, &read),
            Some(6.25),
            "who has heard it since is obeyed"
        );
    }
}

#[derive(Clone, Copy, Debug)]
enum Restart {
    Hang,
    PowerCycle,
    Requested,
    RunPin,
}

impl Restart {
    fn happen(self, bench: &mut Bench, owner: &mut Signer) {
        let resets = bench.resets().len();
        match self {
            Self::Hang => bench.hang_program(),
            Self::PowerCycle => bench.power_cycle(),
            Self::RunPin => bench.press_run(),
            Self::Requested => {
                let now_us = bench.time_us();
                bench.uart_send(0, now_us, &owner.sign(&reboot()));
            }
        }
        assert!(bench.run_until(4 * SECOND, |board| board.resets().len() > resets));
    }
}

/// A board with this flash obeys no command by radio, and announces why.
fn assert_locked(flash: &[u8]) {
    let mut bench = Bench::power_up_with_flash(DIVIDER_CODE, SIGNING_OFFSET, flash);
    bench.run_for(2 * SECOND);
    let frames = bench.frames();
    assert!(texts_of(&frames).contains(&KEY_LOST.into()));
    assert!(frames.iter().all(|frame| frame.signed.is_none()));
    let request = param_set("BATT_LOW_VOLT", 6.5);
    assert_eq!(sets(&mut bench, &request), None);
    assert_eq!(sets(&mut bench, &Signer::new(OWNER).sign(&request)), None);
}

/// With one bit of the record changed that was stored as number `record`.
fn with_damaged_record(flash: &[u8], record: usize) -> Vec<u8> {
    let mut damaged = flash.to_vec();
    damaged[RECORDS + record * RECORD_BYTES + 5] ^= 1;
    damaged
}

#[test]
fn a_damaged_key_locks_and_is_announced() {
    assert_locked(&with_damaged_record(flash_with_key(), 0));
}

#[test]
// Requirement: W-2
fn the_time_is_written_down_once_a_minute_and_nothing_else() {
    signing_time::run(2 * MINUTE);
}
