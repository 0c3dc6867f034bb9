//! Tests of the ADC against datasheet 4.9, by its registers.

use super::super::clock::{cycles, from_adc_clock};
use super::super::peripheral::Peripheral;
use super::super::register::RegisterWrite;
use super::registers::*;
use super::*;

const EN: u32 = 1 << CS_EN;
const START_ONCE: u32 = 1 << CS_START_ONCE;
const START_MANY: u32 = 1 << CS_START_MANY;
const READY: u32 = 1 << CS_READY;
const FCS_EN: u32 = 1;
const CONVERSION: Cycle = cycles(2);

fn write(adc: &mut Adc, offset: u32, value: u32, now: Cycle) {
    adc.advance(now);
    adc.write(offset, RegisterWrite::plain(value), now);
    adc.advance(now);
}

fn read(adc: &mut Adc, offset: u32, now: Cycle) -> u32 {
    adc.advance(now);
    adc.read(offset, now)
}

/// Enabled at 0; each channel carries its number plus 100.
fn adc() -> Adc {
    let mut adc = Adc::new(1);
    (0..CHANNELS).for_each(|channel| adc.set_input(channel, AdcInput::Code(100 + channel as u16)));
    write(&mut adc, CS, EN, 0);
    adc
}

#[test]
fn ready_comes_a_few_cycles_after_enabling() {
    let mut adc = Adc::new(1);
    assert_eq!(read(&mut adc, CS, 0), 0, "not ready while disabled");
    write(&mut adc, CS, EN, 0);
    assert_eq!(read(&mut adc, CS, 1) & READY, 0);
    assert_eq!(read(&mut adc, CS, cycles(1)) & READY, READY);
}

#[test]
fn a_conversion_takes_2_microseconds_and_clears_ready_meanwhile() {
    let mut adc = adc();
    write(&mut adc, CS, EN | START_ONCE | 2 << CS_AINSEL, 1000);
    assert_eq!(
        read(&mut adc, CS, 1000 + CONVERSION - 1) & (READY | START_ONCE),
        0
    );
    assert_eq!(read(&mut adc, CS, 1000 + CONVERSION) & READY, READY);
    assert_eq!(read(&mut adc, RESULT, 1000 + CONVERSION), 102);
    assert_eq!(
        adc.take_record(),
        [Conversion {
            start: 1000,
            channel: 2,
            code: 102
        }]
    );
}

#[test]
fn start_many_runs_back_to_back_at_500_thousand_samples_a_second() {
    let mut adc = adc();
    write(&mut adc, CS, EN | START_MANY, 1000);
    adc.advance(1000 + cycles(1000));
    assert_eq!(adc.conversions(), 500);
    write(&mut adc, CS, EN, 1000 + cycles(1001));
    adc.advance(cycles(3000));
    assert_eq!(adc.conversions(), 501, "the one that was running is finished");
}

/// When the conversions started of which `adc` has a record.
fn starts(adc: &mut Adc) -> Vec<Cycle> {
    let record = adc.take_record();
    record.iter().map(|conversion| conversion.start).collect()
}

#[test]
fn the_divider_paces_start_many() {
    // Starts every n + 1 cycles of 48 MHz; 11 cycles are too short, so every ninth of them counts.
    for (int, adc_cycles) in [(479, 480), (95, 96), (10, 99), (2933, 2934)] {
        let mut adc = adc();
        write(&mut adc, DIV, int << 8, 1000);
        write(&mut adc, CS, EN | START_MANY, 1000);
        adc.advance(1000 + cycles(1000));
        for (number, start) in starts(&mut adc).into_iter().enumerate() {
            let expected = 1000 + from_adc_clock(number as u64 * adc_cycles);
            assert_eq!(start, expected, "INT {int}, conversion {number}");
        }
    }
}

/// "For example, if AINSEL is initially 0, and RROBIN is set to 0x06 (bits 1 and 2 are set), the ADC will sample channels in the
/// following order: 0, 1, 2, 1, 2, 1, 2, ..." (4.9.2.3), and so on with other masks.
#[test]
fn round_robin_begins_at_the_selected_input_and_goes_on_with_those_of_the_mask() {
    for (selected, mask, order) in [
        (0, 0x06, [0, 1, 2, 1, 2, 1]),
        (0, 0x0f, [0, 1, 2, 3, 0, 1]),
        (0, 0x17, [0, 1, 2, 4, 0, 1]),
        (3, 0x17, [3, 4, 0, 1, 2, 4]),
        (2, 0x04, [2, 2, 2, 2, 2, 2]),
        (1, 0x00, [1, 1, 1, 1, 1, 1]),
    ] {
        let mut adc = adc();
        write(
            &mut adc,
            CS,
            EN | START_MANY | selected << CS_AINSEL | mask << CS_RROBIN,
            1000,
        );
        adc.advance(1000 + 6 * CONVERSION);
        let record = adc.take_record();
        let channels: Vec<usize> = record.iter().map(|conversion| conversion.channel).collect();
        assert_eq!(channels, order, "{selected} {mask:#x}");
        let codes = record.iter().map(|conversion| usize::from(conversion.code));
        assert!(codes.eq(channels.iter().map(|channel| 100 + channel)));
    }
}

/// "AINSEL will be updated after each conversion with the newly-selected channel" (CS.RROBIN).
#[test]
fn the_selected_input_is_read_from_cs_and_chosen_by_writing_it() {
    let mut adc = adc();
    let mask = 0xf << CS_RROBIN;
    let selected = |adc: &mut Adc, now| field(read(adc, CS, now), CS_AINSEL, 3);
    write(&mut adc, DIV, 959 << 8, 1000);
    write(&mut adc, CS, EN | START_MANY | mask, 1000);
    assert_eq!(selected(&mut adc, 1000 + CONVERSION - 1), 0, "while it runs");
    assert_eq!(selected(&mut adc, 1000 + CONVERSION), 1);
    write(
        &mut adc,
        CS,
        EN | START_MANY | mask | 3 << CS_AINSEL,
        1000 + cycles(10),
    );
    adc.advance(1000 + cycles(20) + CONVERSION);
    assert_eq!(selected(&mut adc, 1000 + cycles(20) + CONVERSION), 0);
    assert_eq!(adc.take_record()[1].channel, 3);
    // A single conversion goes on, too.
    write(&mut adc, CS, EN | START_ONCE | mask, cycles(1000));
    assert_eq!(selected(&mut adc, cycles(1000) + CONVERSION), 1);
}

#[test]
fn the_fifo_holds_eight_samples_then_overflows_and_underflows_when_empty() {
    let mut adc = adc();
    write(&mut adc, FCS, FCS_EN, 1000);
    write(&mut adc, CS, EN | START_MANY, 1000);
    let status = read(&mut adc, FCS, 1000 + 8 * CONVERSION);
    assert_eq!(
        (field(status, 16, 4), bit(status, 9), bit(status, 11)),
        (8, true, false)
    );
    write(&mut adc, CS, EN, 1000 + 9 * CONVERSION);
    let end = 1000 + 11 * CONVERSION;
    assert!(bit(read(&mut adc, FCS, end), 11), "OVER");
    (0..8).for_each(|_| assert_eq!(read(&mut adc, FIFO, end), 100));
    assert!(!bit(read(&mut adc, FCS, end), 10));
    assert_eq!(read(&mut adc, FIFO, end), 0);
    assert!(bit(read(&mut adc, FCS, end), 10), "UNDER");
    write(&mut adc, FCS, FCS_EN | 1 << 10 | 1 << 11, end);
    assert_eq!(
        read(&mut adc, FCS, end),
        FCS_EN | 1 << 8,
        "both are write-one-to-clear"
    );
}

#[test]
fn a_disabled_fifo_keeps_nothing() {
    let mut adc = adc();
    write(&mut adc, CS, EN | START_ONCE, 1000);
    assert_eq!(field(read(&mut adc, FCS, 1000 + CONVERSION), 16, 4), 0);
}

#[test]
fn interrupt_and_dma_request_follow_the_threshold() {
    let mut adc = adc();
    write(&mut adc, INTE, 1, 1000);
    assert_eq!(
        adc.interrupt_lines(),
        1 << 22,
        "a level of 0 has reached a threshold of 0"
    );
    write(&mut adc, FCS, FCS_EN | 1 << 3 | 2 << 24, 1000);
    assert_eq!((adc.interrupt_lines(), adc.dma_requests()), (0, 0));
    write(&mut adc, CS, EN | START_MANY, 1000);
    adc.advance(1000 + CONVERSION);
    assert_eq!((adc.interrupt_lines(), adc.dma_requests()), (0, 0));
    adc.advance(1000 + 2 * CONVERSION);
    assert_eq!((adc.interrupt_lines(), adc.dma_requests()), (1 << 22, 1 << 36));
}

#[test]
fn a_stalled_converter_never_gets_ready_and_finishes_when_the_fault_is_gone() {
    let mut adc = adc();
    adc.set_fault(AdcFault::Stalled, 0);
    write(&mut adc, CS, EN | START_ONCE, 1000);
    assert_eq!(read(&mut adc, CS, cycles(1_000_000)) & READY, 0);
    adc.set_fault(AdcFault::None, cycles(1_000_000));
    assert_eq!(read(&mut adc, CS, cycles(1_000_000)) & READY, READY);
}

#[test]
fn what_would_have_been_converted_while_it_was_stalled_is_not_made_up_for() {
    let mut adc = adc();
    write(&mut adc, DIV, 2933 << 8, 1000);
    write(&mut adc, CS, EN | START_MANY, 1000);
    let at = |conversion: u64| 1000 + from_adc_clock(2934 * conversion);
    // Within the second conversion, and within the pause before the hundredth.
    let (stalls, goes_on) = (at(1) + 100, at(100) - 1000);
    adc.advance(stalls);
    adc.set_fault(AdcFault::Stalled, stalls);
    adc.advance(goes_on);
    adc.set_fault(AdcFault::None, goes_on);
    adc.advance(at(101));
    assert_eq!(starts(&mut adc), [at(0), at(1), at(100)]);
}

/// A lost conversion shifts all later ones against the inputs, as the FIFO names none.
#[test]
fn a_lost_conversion_takes_its_turn_and_does_not_reach_the_fifo() {
    let mut adc = adc();
    write(&mut adc, FCS, FCS_EN, 1000);
    write(&mut adc, CS, EN | START_MANY | 0xf << CS_RROBIN, 1000);
    let now = 1000 + CONVERSION;
    adc.advance(now);
    adc.set_fault(AdcFault::LostConversions(2), now);
    assert_eq!(read(&mut adc, RESULT, now + CONVERSION), 101);
    let now = 1000 + 6 * CONVERSION;
    let level = field(read(&mut adc, FCS, now), 16, 4);
    let codes: Vec<u32> = (0..level).map(|_| read(&mut adc, FIFO, now)).collect();
    assert_eq!(codes, [100, 103, 100, 101]);
    assert_eq!(adc.conversions(), 6);
}

/// The numbers of the conversions with FIFO.ERR, from 1.
fn errors(fault: AdcFault, conversions: u64) -> Vec<u64> {
    let mut adc = adc();
    adc.set_fault(fault, 1000);
    write(&mut adc, FCS, FCS_EN | 1 << 2, 1000);
    write(&mut adc, CS, EN | START_MANY, 1000);
    (1..=conversions)
        .filter(|conversion| read(&mut adc, FIFO, 1000 + conversion * CONVERSION) & 1 << 15 != 0)
        .collect()
}

#[test]
fn some_conversions_end_with_an_error() {
    assert_eq!(errors(AdcFault::ConversionErrors(2), 10), [1, 2]);
    assert_eq!(errors(AdcFault::ConversionErrorInEvery(7), 21), [7, 14, 21]);
    assert_eq!(errors(AdcFault::ConversionError, 3), [1, 2, 3]);
}

#[test]
fn a_conversion_error_shows_in_cs_and_in_the_fifo() {
    let mut adc = adc();
    adc.set_fault(AdcFault::ConversionError, 0);
    write(&mut adc, FCS, FCS_EN | 1 << 2, 1000);
    write(&mut adc, CS, EN | START_ONCE, 1000);
    let now = 1000 + CONVERSION;
    assert_eq!(read(&mut adc, FIFO, now), 1 << 15 | 100);
    assert_eq!(field(read(&mut adc, CS, now), CS_ERR, 2), 0b11);
    adc.set_fault(AdcFault::None, now);
    write(&mut adc, CS, EN | START_ONCE, now);
    assert_eq!(
        field(read(&mut adc, CS, now + CONVERSION), CS_ERR, 2),
        0b10,
        "ERR_STICKY stays"
    );
    write(&mut adc, CS, EN | 1 << CS_ERR_STICKY, now + CONVERSION);
    assert_eq!(field(read(&mut adc, CS, now + CONVERSION), CS_ERR, 2), 0);
}

#[test]
fn an_input_can_be_a_function_of_time() {
    let mut adc = adc();
    adc.set_input(0, AdcInput::CodeAt(Box::new(|micros| micros as u16)));
    write(&mut adc, CS, EN | START_ONCE, cycles(1234));
    assert_eq!(read(&mut adc, RESULT, cycles(1300)), 1234, "sampled at the start");
}

#[test]
fn reset_disables_and_keeps_the_voltages() {
    let mut adc = adc();
    write(&mut adc, CS, EN | START_MANY, 1000);
    adc.reset(2000);
    assert_eq!(read(&mut adc, CS, 2000), 0);
    assert_eq!(adc.next_event(), NEVER);
    write(&mut adc, CS, EN, 3000);
    write(&mut adc, CS, EN | START_ONCE, 4000);
    assert_eq!(read(&mut adc, RESULT, 4000 + CONVERSION), 100);
}
