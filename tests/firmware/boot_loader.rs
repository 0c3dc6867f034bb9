//! Restarting into the boot ROM's USB boot loader, to be flashed again without the button.

use crate::lamps::{LAMPS, decode};
use crate::motors::BUZZER;
use crate::rover::{GOOD_3S, is_coasting};
use crate::signing::station;
use crate::wheels::pins;
use emulator::{BootLoader, LogLevel, PwmOutput, ResetCause};
use support::commands::{ACCEPTED, PREFLIGHT_REBOOT_SHUTDOWN};
use support::frames::{acknowledged, texts_of};
use support::requests::{GCS, heartbeat, reboot_to_boot_loader};
use workbench::bench::{Bench, SECOND, TestedVehicle};
use workbench::signing_key::protected;

/// Waits until the board is in its boot loader, by the one reset of it.
fn run_into_boot_loader(bench: &mut Bench) {
    assert!(bench.run_until(4 * SECOND, |board| board.boot_loader().is_some()));
    let causes: Vec<_> = bench.resets().iter().map(|reset| reset.cause).collect();
    assert_eq!(causes, [ResetCause::WatchdogTimer]);
}

#[test]
fn it_restarts_into_the_boot_loader_with_everything_off_and_saved() {
    let mut bench = Bench::running(GOOD_3S);
    for pin in pins().chain([LAMPS, BUZZER]) {
        bench.record_pin(pin);
    }
    bench.set("BATT_VOLT_MULT", 4.1);
    let answers = bench.ask(&reboot_to_boot_loader());
    assert_eq!(acknowledged(&answers), [(PREFLIGHT_REBOOT_SHUTDOWN, ACCEPTED)]);
    assert!(is_coasting(&bench));
    run_into_boot_loader(&mut bench);

    // No activity pin, both interfaces.
    assert_eq!(
        bench.boot_loader(),
        Some(BootLoader {
            gpio_activity_pin_mask: 0,
            disable_interface_mask: 0,
        })
    );
    let shown = decode(&bench.take_edges(LAMPS));
    assert_eq!(shown, [0; 3 * 8], "the lamps are switched off, once");
    assert!(bench.take_edges(BUZZER).is_empty());
    for pin in pins() {
        let changes = bench.take_pwm_changes(pin);
        let coasts = |output: Option<PwmOutput>| output.is_none_or(|output| output.duty == 0.0);
        assert!(changes.iter().all(|(_, output)| coasts(*output)), "GP{pin}");
        assert_eq!(bench.pin_level(pin), None, "GP{pin} is not driven");
    }

    // The watchdog does not end it.
    bench.run_for(10 * SECOND);
    run_into_boot_loader(&mut bench);
    assert!(!bench.watchdog_is_enabled());

    bench.forget_sent();
    bench.finish_boot_loader();
    bench.run_for(2 * SECOND);
    assert_eq!(bench.parameter("BATT_VOLT_MULT"), 4.1);
    bench.ask(&heartbeat(GCS));
    bench.run_for(3 * SECOND);
    assert!(!bench.logged(LogLevel::Info, "started by PowerOn").is_empty());
    assert!(bench.logged(LogLevel::Warn, "").is_empty(), "no crash");
    let texts = texts_of(&bench.frames());
    assert!(texts.iter().all(|text| !text.contains("rash")), "{texts:?}");
}

#[test]
fn with_a_key_the_boot_loader_is_entered_for_its_owner_alone() {
    let mut bench = protected();
    assert_eq!(acknowledged(&bench.ask(&reboot_to_boot_loader())), []);
    bench.run_for(4 * SECOND);
    assert!(bench.resets().is_empty());
    let signed = station(&mut bench).sign(&reboot_to_boot_loader());
    assert_eq!(
        acknowledged(&bench.ask(&signed)),
        [(PREFLIGHT_REBOOT_SHUTDOWN, ACCEPTED)]
    );
    run_into_boot_loader(&mut bench);
}
