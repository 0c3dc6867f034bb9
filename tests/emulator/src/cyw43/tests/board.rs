//! The chip on the board of a Pico W.

use rp2040_emu::core::CoreBus;

use super::super::super::adc::AdcInput;
use super::super::super::bench::{ALL_BLOCKS, FUNCTION_SIO, RESETS_CLEAR, select_function};
use super::super::super::board::Board;
use super::super::super::thumb::idle_board;
use super::super::pins::{POWER, SELECT};

/// GPIO_OUT_SET, GPIO_OUT_CLR and GPIO_OE_SET (RP2040 datasheet 2.3.1.7).
const OUT_SET: u32 = 0xd000_0014;
const OUT_CLEAR: u32 = 0xd000_0018;
const OUTPUT_SET: u32 = 0xd000_0024;
const ADC: u32 = 0x4004_c000;
const CHANNEL_3_ONCE: u32 = 3 << 12 | 1 << 2 | 1;

fn bench() -> Board {
    let mut board = idle_board();
    board.adc_input(3, AdcInput::Code(2000));
    board.write_register(RESETS_CLEAR, ALL_BLOCKS);
    for pin in [POWER, SELECT] {
        select_function(&mut board, pin as u32, FUNCTION_SIO);
        board.bus.write32(OUTPUT_SET, 1 << pin);
    }
    board
}

fn convert(board: &mut Board) -> u32 {
    board.write_register(ADC, 1);
    board.run_for(10);
    board.write_register(ADC, CHANNEL_3_ONCE);
    board.run_for(10);
    board.read_register(ADC + 4)
}

#[test]
fn vsys_reaches_the_converter_while_the_select_pin_is_high() {
    let mut board = bench();
    board.attach_wifi();
    assert_eq!(convert(&mut board), 0);
    board.bus.write32(OUT_SET, 1 << SELECT);
    assert_eq!(convert(&mut board), 2000);
    board.bus.write32(OUT_CLEAR, 1 << SELECT);
    assert_eq!(convert(&mut board), 0);
}

#[test]
fn on_a_pico_it_always_does() {
    let mut board = bench();
    assert_eq!(convert(&mut board), 2000);
    board.bus.write32(OUT_SET, 1 << SELECT);
    assert_eq!(convert(&mut board), 2000);
}

#[test]
fn the_power_pin_switches_the_chip_and_a_reset_lets_go_of_it() {
    let mut board = bench();
    board.attach_wifi();
    assert!(!board.wifi().is_powered());
    board.bus.write32(OUT_SET, 1 << POWER);
    assert!(board.wifi().is_powered());
    board.press_run();
    assert!(!board.wifi().is_powered());
}
