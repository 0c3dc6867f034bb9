//! Engines, boat motors and several packs behind the second serial port, UART1 at GP4 (out) and GP5 (in).

pub mod mega_squirt;
pub mod torqeedo;

use emulator::{LogLevel, SentByte, UartPins};
use support::charge_states::UNHEALTHY;
use support::frames::{BatteryStatus, last_of, texts_of};
use workbench::bench::{Bench, DIVIDER_CODE, SECOND};

const PORT: usize = 1;

/// A board whose second pack is of this kind, measured at the port.
fn with_second_pack(kind: f32, parameters: &[(&str, f32)]) -> Bench {
    let mut bench = Bench::running(DIVIDER_CODE);
    bench.wire_uart(PORT, UartPins { tx: 4, rx: 5 });
    bench.set("BATT2_MONITOR", kind);
    bench.set("SR0_EXTRA1", 10.0);
    bench.set_all(parameters);
    bench.reboot();
    // What was sent before belongs to no request.
    bench.uart(PORT).take_sent();
    bench
}

/// What is connected to the port: answers what the board sends, and sends by itself.
pub trait Peer {
    const BAUD: u32;

    /// Takes what the board has sent, and returns what is put on the wire at `now_us`.
    fn turn(&mut self, sent: &[u8], now_us: u64) -> Vec<u8>;
}

/// Time between two turns of a peer, in microseconds.
const TURN_US: u64 = 1_000;

/// Runs a board with its peer, and returns what the board sent.
fn run_with<P: Peer>(bench: &mut Bench, peer: &mut P, duration_us: u64) -> Vec<SentByte> {
    let end_us = bench.time_us() + duration_us;
    let mut all = Vec::new();
    while bench.time_us() < end_us {
        bench.run_for(TURN_US);
        let sent = bench.uart(PORT).take_sent();
        let bytes: Vec<u8> = sent.iter().map(|sent| sent.byte).collect();
        let now_us = bench.time_us();
        let answer = peer.turn(&bytes, now_us);
        if !answer.is_empty() {
            bench.uart_send_at_baud(PORT, now_us, &answer, P::BAUD);
        }
        all.extend(sent);
    }
    all
}

/// Runs for a second with the peer, and shows what was reported of the second pack last.
fn after_a_second<R>(
    bench: &mut Bench,
    peer: &mut impl Peer,
    look: impl FnOnce(BatteryStatus<'_>) -> R,
) -> R {
    run_with(bench, peer, SECOND);
    let frames = bench.frames();
    look(last_of(&frames, 1))
}

/// Panics if the board was reset again since its parameters took effect, or warned since `from_us`.
fn assert_untroubled(bench: &Bench, from_us: u64) {
    assert_eq!(bench.resets().len(), 1, "{:?}", bench.resets());
    let mut warnings = bench.logged(LogLevel::Warn, "");
    warnings.retain(|(at_us, _)| *at_us > from_us);
    assert!(warnings.is_empty(), "{warnings:?}");
}

/// The second pack stays healthy for `pause_us` with each of these faults, is unhealthy a second later, and recovers.
fn assert_recovers_from<P: Peer, F: Copy>(
    bench: &mut Bench,
    peer: &mut P,
    faults: &[F],
    none: F,
    set: impl Fn(&mut P, F),
    pause_us: u64,
) {
    for fault in faults {
        set(peer, none);
        run_with(bench, peer, 8 * SECOND);
        let frames = bench.frames();
        assert_ne!(last_of(&frames, 1).charge_state(), UNHEALTHY);
        set(peer, *fault);
        run_with(bench, peer, pause_us);
        let frames = bench.frames();
        assert_ne!(last_of(&frames, 1).charge_state(), UNHEALTHY, "it may pause");
        after_a_second(bench, peer, |status| {
            assert_eq!(status.charge_state(), UNHEALTHY);
        });
    }
    set(peer, none);
    run_with(bench, peer, 8 * SECOND);
    assert!(texts_of(&bench.frames()).contains(&"Battery 2 healthy again".into()));
}
