//! Flash of an armed rover: nothing is erased, whatever is requested, and what is set is saved or reported.

use rover_battmon::autopilot::PackIdentity;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, ParameterId, VehicleParameter};

use crate::learnt;
use crate::rover::{GOOD_3S, VEHICLE_ID, drive_for};
use emulator::{FlashOperationKind, FlashTiming};
use support::commands::ACCEPTED;
use support::frames::{PARAM_VALUE, ParamValue, SYS_STATUS, SysStatus, of_message, texts_of};
use support::motor_poles::LEFT;
use support::parameter_flash;
use support::requests::{arm, disarm, manual_control, manual_mode, param_set};
use workbench::bench::{
    Bench, CYCLES_PER_US, LEARNT_OFFSET, MILLISECOND, SECOND, SIGNING_OFFSET, TestedVehicle, count_of,
};
use workbench::signing_key;

/// Records that a sector takes: of parameters, and of signing.
const SLOTS: u16 = 680;
const SIGNING_SLOTS: u16 = 338;

/// The parameters of a rover that follows sticks at once, and its flash after this many of another firmware and these.
fn parameters(foreign: u16) -> Vec<u8> {
    let cells: ParameterId = BatteryParameter::Cells.of(Pack::First);
    let set = [
        (cells.key(), 3.0),
        (ParameterId::Vehicle(VehicleParameter::MotSlewrate).key(), 0.0),
        (ParameterId::Vehicle(VehicleParameter::SignUartAllow).key(), 2.0),
    ];
    let others = (40_000..40_000 + foreign).map(|key| (key, 1.0));
    parameter_flash::flash_with(others.chain(set))
}

/// The signing data with a key, and marks that leave no more than `room` records.
fn signing(room: u16) -> Vec<u8> {
    let key = signing_key::words_of_key();
    let marks = (0..SIGNING_SLOTS - room - key.len() as u16).map(|number| {
        let under = [0x121, 0x123][usize::from(number % 2)];
        (under, u32::from(number) + 1)
    });
    signing_key::flash_with(key.iter().copied().chain(marks))
}

/// A sector of learnt data of as many packs as it takes: each write of another pack needs a sector.
fn learnt_data() -> Vec<u8> {
    let packs = (101..100 + learnt::SLOTS as i32).map(|number| PackIdentity {
        serial_number: Some(number),
        ..learnt::FIRST
    });
    learnt::flash_with(packs.chain([learnt::FIRST]).map(|pack| (pack, 2950.0)))
}

/// A disarmed rover whose parameters have room for `free` records in the active sector and in the one erased ahead.
fn rover_with_room(free: u16, also: impl FnOnce(&mut Bench)) -> Bench {
    let mut bench = Bench::power_up_with_parameters(GOOD_3S, &parameters(SLOTS - 4 - free));
    also(&mut bench);
    bench.run_for(3 * SECOND);
    bench
}

fn arm_and_drive(bench: &mut Bench) {
    drive_for(bench, 200 * MILLISECOND, 0);
    assert_eq!(bench.result_of(&arm()), ACCEPTED);
    bench.ask(&manual_mode());
    bench.ask(&manual_control(VEHICLE_ID, 0, 0));
    bench.take_flash_operations();
}

fn texts_since(bench: &mut Bench, from_us: u64) -> Vec<String> {
    let texts = texts_of(&bench.frames_since(from_us));
    let is_of_storage = |text: &String| text.contains("aved");
    texts.into_iter().filter(is_of_storage).collect()
}

/// An erase of 400 ms under the watchdog of an armed rover would restart the board in the middle of it.
#[test]
// Requirement: R-5
fn what_waits_for_disarming_is_erased_under_the_longer_watchdog() {
    let mut bench = rover_with_room(5, |bench| {
        bench.write_flash(LEARNT_OFFSET, &learnt_data());
        bench.write_flash(SIGNING_OFFSET, &signing(3));
    });
    bench.flash_timing(FlashTiming::MAXIMUM);
    for disarmed_after_us in (0..5).map(|step| 20 * step * MILLISECOND + SECOND) {
        arm_and_drive(&mut bench);
        let from_us = bench.time_us();
        for number in 0..12 {
            bench.ask(&param_set("BATT_LOW_VOLT", 6.0 + number as f32 / 100.0));
        }
        bench.ask(&param_set("BATT_SERIAL_NUM", from_us as f32 / 1e6));
        bench.ask(&param_set("BATT_LRN_ERASE", 1.0));
        drive_for(&mut bench, 4 * SECOND, 500);
        bench.run_for(disarmed_after_us);
        bench.run_until_silent();
        assert_eq!(
            count_of(FlashOperationKind::SectorErase, &bench.take_flash_operations()),
            0
        );
        let disarmed_us = bench.time_us();
        // What is set right behind it must not be refused, as it would be while armed.
        let behind = [
            disarm(),
            param_set("BATT_CRT_VOLT", 6.0 + disarmed_after_us as f32 / 1e8),
        ];
        bench.ask(&behind.concat());
        bench.run_for(10 * SECOND);
        let operations = bench.take_flash_operations();
        let waited_us = operations.first().expect("it is saved").time_us - disarmed_us;
        println!("saving begins {waited_us} us after disarming");
        assert!(waited_us <= 200 * MILLISECOND, "{waited_us}");
        assert!(
            count_of(FlashOperationKind::SectorErase, &operations) >= 2,
            "{operations:?}"
        );
        let texts = texts_since(&mut bench, disarmed_us);
        assert!(!texts.iter().any(|text| text.contains("not saved")), "{texts:?}");
        assert!(bench.resets().is_empty(), "{:?}", bench.resets());
    }
}

/// Not later than this after the last byte of a stick input its effect has to be at the motors.
const STICK_TO_MOTOR_US: u64 = 50 * MILLISECOND;

#[test]
// Requirement: R-5
fn two_hundred_sets_at_full_rate_delay_no_stick_and_lose_no_byte() {
    // The parameters move to the sector that was erased ahead, and fill it.
    let mut bench = rover_with_room(30, |_| ());
    arm_and_drive(&mut bench);
    bench.record_pin(LEFT[0].positive);
    let from_us = bench.time_us();
    let mut at_us = from_us;
    let (mut stick_due_us, mut throttle) = (from_us, 0);
    let mut sticks = Vec::new();
    for number in 0..200 {
        if at_us >= stick_due_us {
            stick_due_us += 50 * MILLISECOND;
            throttle = if throttle == 300 { 600 } else { 300 };
            at_us = bench.uart_send(0, at_us, &manual_control(VEHICLE_ID, 0, throttle));
            sticks.push((at_us, f64::from(throttle) / 1000.0));
        }
        let value = 1.0 + number as f32 / 1000.0;
        at_us = bench.uart_send(0, at_us, &param_set("BATT_VOLT_MULT", value));
    }
    bench.run_until_time(at_us + SECOND);

    assert!(sticks.len() >= 10, "at 20 Hz");
    let changes = bench.take_pwm_changes(LEFT[0].positive);
    let mut latest_us = 0;
    for (received_us, duty) in sticks {
        let change = changes.iter().find(|(at, output)| {
            let is_this = output.is_some_and(|output| (output.duty - duty).abs() < 0.01);
            at / CYCLES_PER_US >= received_us && is_this
        });
        let (at, _) = change.unwrap_or_else(|| panic!("no motor follows the stick at {received_us} us"));
        latest_us = latest_us.max(at / CYCLES_PER_US - received_us);
    }
    println!("the motor follows {latest_us} us after the stick's last byte at the latest");
    assert!(latest_us <= STICK_TO_MOTOR_US);

    assert_eq!(
        count_of(FlashOperationKind::SectorErase, &bench.take_flash_operations()),
        0
    );
    let frames = bench.frames_since(from_us);
    let answers = of_message(&frames, PARAM_VALUE);
    let acknowledged = answers
        .iter()
        .filter(|frame| ParamValue(frame).name() == "BATT_VOLT_MULT");
    assert_eq!(acknowledged.count(), 200, "each is acknowledged");
    let status = of_message(&frames, SYS_STATUS);
    let status = SysStatus(status.last().expect("telemetry goes on"));
    assert_eq!(status.errors_comm(), 0, "received bytes or frames were lost");
    assert!(bench.resets().is_empty(), "{:?}", bench.resets());
}
