//! A board whose flash holds a signing key.

use emulator::Board;
use support::frames::{Frame, HEARTBEAT, of_message};
use support::requests::{param_read_by_name, param_set};
use support::signer::Signer;
use workbench::bench::{Bench, SAVED_US, SECOND, TestedVehicle, value_of};
use workbench::signing_key::{OWNER, protected};
/// A board that signs and takes everything all the same.
pub fn open_with_key() -> Bench {
    const EVERYTHING: f32 = 2.0;
    let mut bench = protected();
    let request = station(&mut bench).sign(&param_set("SIGN_UART_ALLOW", EVERYTHING));
    let set = value_of(&bench.ask(&request), "SIGN_UART_ALLOW");
    assert_eq!(set, Some(EVERYTHING));
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
// Requirement: OWN-4, L-14
fn no_restart_lets_the_time_go_back_or_a_recording_in() {
    let mut bench = protected();
    let mut owner = station(&mut bench);
    let recorded = owner.sign(&param_set("BATT_LOW_VOLT", 6.25));
    assert_eq!(sets(&mut bench, &recorded), Some(6.25));
    bench.run_for(SAVED_US);

    let mut latest = owner.timestamp;
    for restart in [Board::hang_program, Board::power_cycle] {
        bench.reset_by(4 * SECOND, |bench| restart(bench));
        // What was on the wire at the restart is cut off.
        bench.forget_sent();
        bench.run_for(2 * SECOND);
        let frames = bench.frames();
        assert!(of_message(&frames, HEARTBEAT).len() >= 2);
        assert!(times(&frames).iter().all(|time| *time > latest));
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
