//! Smart batteries that differ from the specification.

use super::{BUS, after_a_second, assert_survives_unplugging, shared, with_second_pack};
use emulator::i2c_devices::{Pec, SmartBattery};
use support::frames::{BatteryStatus, COMMAND_LONG, of_message, texts_of};
use workbench::bench::{Bench, SECOND};

const ADDRESS: u8 = 0x0b;

const SOLO: f32 = 5.0;
const SUI_3_CELLS: f32 = 13.0;
const SUI_6_CELLS: f32 = 14.0;
const NEO_DESIGN: f32 = 15.0;
const MAXELL: f32 = 16.0;
const ROTOYE: f32 = 19.0;

/// 2.5 A out of the battery, as four bytes in milliamperes.
const DISCHARGE: [u8; 4] = (-2500i32).to_le_bytes();

fn block(words: &[u16]) -> Vec<u8> {
    words.iter().flat_map(|word| word.to_le_bytes()).collect()
}

fn cells(status: &BatteryStatus<'_>, count: usize) -> Vec<u16> {
    (0..count).map(|cell| status.voltage_mv(cell)).collect()
}

#[test]
// Requirement: AP-5
fn a_maxell_holds_twice_what_its_words_say() {
    let mut battery = SmartBattery::new(Pec::None);
    battery.set_block(0x20, b"Hitachi maxell");
    // It says it had a packet error code, and has none.
    battery.set_word(0x1a, 0x0031);
    battery.set_capacity(2000, 2500);
    battery.set(11.1, 1.0, 25.0);
    let part = shared(battery);
    let mut bench = with_second_pack(MAXELL, ADDRESS, &part, &[]);
    after_a_second(&mut bench, |status| {
        assert_eq!((status.consumed_mah(), status.remaining_pct()), (1000, 80));
        assert_eq!(status.time_remaining_s(), 4000 * 3600 / 1000);
    });
    assert_survives_unplugging(&mut bench, ADDRESS, &part, |_| {});
}

#[test]
// Requirement: AP-5
fn a_rotoye_reports_its_hottest_sensor_and_large_currents() {
    let part = shared(SmartBattery::new(Pec::Right));
    part.borrow_mut().set(22.2, 10.0, 30.0);
    // A thermistor at 45 degrees, and none at the other place.
    part.borrow_mut().set_word(0x48, 3182);
    part.borrow_mut().set_word(0x49, 0);
    let mut bench = with_second_pack(ROTOYE, ADDRESS, &part, &[]);
    after_a_second(&mut bench, |status| {
        assert_eq!((status.temperature_cdegc(), status.current_ca()), (4505, 1000));
    });
    // What does not fit the word in milliamperes: 80 A.
    part.borrow_mut().set_word(0x41, (-800i16) as u16);
    after_a_second(&mut bench, |status| assert_eq!(status.current_ca(), 8000));
    part.borrow_mut().set_word(0x41, 0xffff);
    after_a_second(&mut bench, |status| assert_eq!(status.current_ca(), 1000));
    assert_survives_unplugging(&mut bench, ADDRESS, &part, |_| {});
}

#[test]
// Requirement: AP-5
fn a_sui_of_three_cells_has_them_in_a_block() {
    let mut battery = SmartBattery::new(Pec::None);
    battery.set_block(0x28, &block(&[4100, 4101, 4102, 4103]));
    battery.set_bare(0x2a, &DISCHARGE);
    battery.set_pec_of(0x28, Pec::Right);
    battery.forget(0x09);
    battery.set_capacity(2600, 5200);
    let part = shared(battery);
    let mut bench = with_second_pack(SUI_3_CELLS, ADDRESS, &part, &[]);
    after_a_second(&mut bench, |status| {
        assert_eq!(cells(&status, 4), [4100, 4101, 4102, 65535]);
        assert_eq!((status.current_ca(), status.remaining_pct()), (250, 50));
    });
    assert_survives_unplugging(&mut bench, ADDRESS, &part, |_| {});
}

#[test]
// Requirement: AP-5
fn a_six_cell_sui_reports_the_pack_voltage_and_no_invented_cells() {
    let mut battery = SmartBattery::new(Pec::None);
    battery.set(24.6, 0.0, 25.0);
    battery.set_block(0x28, &block(&[4100, 4100, 4100, 4100]));
    battery.set_bare(0x2a, &DISCHARGE);
    let part = shared(battery);
    let mut bench = with_second_pack(SUI_6_CELLS, ADDRESS, &part, &[]);
    after_a_second(&mut bench, |status| {
        assert_eq!(cells(&status, 2), [24_600, 65535]);
        assert_eq!(status.current_ca(), 250);
    });
    assert_survives_unplugging(&mut bench, ADDRESS, &part, |_| {});
}

#[test]
// Requirement: AP-5
fn a_neodesign_counts_its_cells_itself() {
    let part = shared(SmartBattery::new(Pec::Right));
    part.borrow_mut().set(37.0, 2.0, 25.0);
    part.borrow_mut().set_word(0x5c, 10);
    for cell in 0..10 {
        part.borrow_mut().set_word(0x30 + cell, 3700);
    }
    let mut bench = with_second_pack(NEO_DESIGN, ADDRESS, &part, &[]);
    after_a_second(&mut bench, |status| {
        assert_eq!(cells(&status, 10), [3700; 10]);
        assert_eq!(status.current_ca(), 200);
    });
    // Its packet error code is checked, whatever specification it says it follows.
    part.borrow_mut().set_pec(Pec::Wrong);
    bench.run_for(2 * SECOND);
    assert!(texts_of(&bench.frames()).contains(&"Battery 2 unhealthy: wrong checksum".into()));
}

#[test]
// Requirement: AP-5, AP-20
fn a_solo_has_blocks_and_a_button_that_switches_it_off() {
    let part = shared(SmartBattery::new(Pec::Right));
    part.borrow_mut()
        .set_block(0x28, &block(&[3900, 3901, 3902, 3903]));
    part.borrow_mut().set_block(0x2a, &DISCHARGE);
    part.borrow_mut().set_block(0x23, &[0; 6]);
    part.borrow_mut().forget(0x09);
    let mut bench = with_second_pack(SOLO, ADDRESS, &part, &[]);
    after_a_second(&mut bench, |status| {
        assert_eq!(cells(&status, 5), [3900, 3901, 3902, 3903, 65535]);
        assert_eq!(status.current_ca(), 250);
    });
    // A short press does nothing; a long one is announced while it lasts, and another one again.
    for (press_us, announced) in [(SECOND / 2, 0), (3 * SECOND, 1), (SECOND / 2, 1), (2 * SECOND, 2)] {
        part.borrow_mut().set_block(0x23, &[0, 8, 0, 0, 0, 0]);
        bench.run_for(press_us);
        part.borrow_mut().set_block(0x23, &[0; 6]);
        bench.run_for(SECOND);
        assert_eq!(power_offs(&mut bench), announced);
    }
    bench.i2c(BUS).detach(ADDRESS);
    bench.run_for(2 * SECOND);
    assert!(texts_of(&bench.frames()).contains(&"Battery 2 unhealthy: no answer".into()));
}

/// How often it was announced that the second pack powers off: each time by a text and by a command.
fn power_offs(bench: &mut Bench) -> usize {
    let frames = bench.frames();
    let texts = texts_of(&frames);
    let texts = texts.iter().filter(|text| *text == "Battery 2 is powering off");
    let commands = of_message(&frames, COMMAND_LONG);
    for command in &commands {
        // Parameter 1 is the pack's number, the target is every component of every system.
        assert_eq!((command.f32(0), command.u16(28)), (2.0, 42000));
        assert_eq!((command.u8(30), command.u8(31)), (0, 0));
    }
    assert_eq!(texts.count(), commands.len());
    commands.len()
}
