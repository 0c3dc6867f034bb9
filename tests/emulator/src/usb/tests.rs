//! Tests of the device controller against datasheet 4.1.2 and 4.1.4, by its registers and its bus; and of the host against
//! USB 2.0, by what a small device of the tests' own answers.

use super::super::clock::{Cycle, NEVER, cycles};
use super::super::peripheral::Peripheral;
use super::super::register::{Alias, RegisterWrite};
use super::bus::{Delivery, Endpoint, Handshake, Sent, Toggle, transaction_time};
use super::controller::Controller;
use super::registers::*;
use super::{AbortPoint, ControlRequest, Failure, HostEvent, Usb};

const ADDRESS: u8 = 5;
const SETUP: [u8; 8] = [0x80, 6, 0, 1, 0, 0, 18, 0];
const EP0: Endpoint = endpoint(0);
const IN_2: u32 = 0x80 + 8 * 2;
const OUT_1: u32 = 0x84 + 8;
const EP0_IN: u32 = 0x80;
const EP0_OUT: u32 = 0x84;
const BUFFER: u32 = 0x180;

const fn endpoint(number: u8) -> Endpoint {
    Endpoint {
        address: ADDRESS,
        number,
    }
}

fn write(controller: &mut Controller, offset: u32, value: u32) {
    controller.write(offset, RegisterWrite::plain(value), 0);
}

/// A buffer control as software has to write it: AVAILABLE after the rest.
fn give(controller: &mut Controller, control: u32, bits: u32, now: Cycle) {
    controller.store_dpram(control, bits, 4, now);
    controller.store_dpram(control, bits | BUFFER_AVAILABLE, 4, now + 12);
}

/// In device mode, attached, with an address and all endpoints' interrupts of single buffers; bulk IN 2 and bulk OUT 1.
fn device() -> Controller {
    let mut controller = Controller::new();
    write(&mut controller, USB_MUXING, 0b1001);
    write(&mut controller, USB_PWR, 0b1100);
    write(&mut controller, MAIN_CTRL, 1);
    write(&mut controller, SIE_CTRL, 1 << 29 | 1 << 16);
    write(&mut controller, ADDR_ENDP, ADDRESS.into());
    // Enabled, an interrupt for each buffer, bulk (4.1.2.5.3).
    let bulk = 1 << 31 | 1 << 29 | 2 << 26;
    controller.store_dpram(0x08 + 8, bulk | (BUFFER + 64), 4, 0);
    controller.store_dpram(0x0c, bulk | BUFFER, 4, 0);
    controller
}

#[test]
fn a_device_is_attached_when_everything_for_its_pull_up_is_set() {
    let settings = [
        (USB_MUXING, 1),
        (USB_PWR, 0b1100),
        (MAIN_CTRL, 1),
        (SIE_CTRL, 1 << 16),
    ];
    for missing in 0..settings.len() {
        let mut controller = Controller::new();
        for (number, (offset, value)) in settings.into_iter().enumerate() {
            if number != missing {
                write(&mut controller, offset, value);
            }
        }
        assert!(!controller.is_attached(), "without {:#x}", settings[missing].0);
        write(&mut controller, settings[missing].0, settings[missing].1);
        assert!(controller.is_attached());
    }
}

#[test]
fn a_setup_packet_is_taken_always_and_lies_at_the_start_of_the_dpram() {
    let mut controller = device();
    write(&mut controller, INTE, 1 << 16);
    for packet in [SETUP, [0, 9, 1, 0, 0, 0, 0, 0]] {
        assert_eq!(controller.setup(ADDRESS, packet), Some(Handshake::Ack));
        assert_eq!(controller.dpram_word(0).to_le_bytes(), packet[..4]);
        assert_eq!(controller.dpram_word(4).to_le_bytes(), packet[4..]);
        assert_eq!(controller.interrupts(), 1 << 16, "SETUP_REQ");
    }
    write(&mut controller, SIE_STATUS, 1 << 17);
    assert_eq!(controller.interrupts(), 0);
    assert_eq!(controller.setup(ADDRESS + 1, SETUP), None, "another device's");
}

/// An aborted transfer leaves its buffers to the controller: nothing but software takes them back.
#[test]
fn a_setup_packet_clears_the_stall_arm_and_no_buffer_control() {
    let mut controller = device();
    write(&mut controller, EP_STALL_ARM, 0b11);
    give(&mut controller, EP0_IN, BUFFER_FULL | BUFFER_DATA1 | 18, 0);
    let before = controller.dpram_word(EP0_IN);
    controller.setup(ADDRESS, SETUP);
    assert_eq!(controller.read(EP_STALL_ARM), 0);
    assert_eq!(controller.dpram_word(EP0_IN), before);
    let stale = controller.input(EP0, Delivery::Acknowledged);
    assert!(matches!(stale, Some(Sent::Data(Toggle::Data1, bytes)) if bytes.len() == 18));
}

#[test]
fn an_in_buffer_is_sent_once_with_its_length_and_pid() {
    let mut controller = device();
    write(&mut controller, INTE, 1 << 4);
    assert_eq!(
        controller.input(endpoint(2), Delivery::Acknowledged),
        Some(Sent::Nak)
    );
    controller.store_dpram(BUFFER + 64, u32::from_le_bytes(*b"abcd"), 4, 0);
    give(&mut controller, IN_2, BUFFER_FULL | BUFFER_LAST | 3, 0);
    let sent = controller.input(endpoint(2), Delivery::Acknowledged);
    assert_eq!(sent, Some(Sent::Data(Toggle::Data0, b"abc".to_vec())));
    let control = controller.dpram_word(IN_2);
    assert_eq!(control & (BUFFER_AVAILABLE | BUFFER_FULL), 0);
    assert_eq!(controller.read(BUFF_STATUS), 1 << 4, "EP2_IN");
    assert_eq!(controller.read(SIE_STATUS) & 1 << 18, 1 << 18, "the last buffer");
    assert_eq!(controller.interrupts(), 1 << 4);
    write(&mut controller, BUFF_STATUS, 1 << 4);
    assert_eq!(controller.interrupts(), 0);
    assert_eq!(
        controller.input(endpoint(2), Delivery::Acknowledged),
        Some(Sent::Nak)
    );
}

#[test]
fn an_out_buffer_is_filled_once_and_says_how_far() {
    let mut controller = device();
    assert_eq!(
        controller.output(endpoint(1), Toggle::Data0, b"abc"),
        Some(Handshake::Nak)
    );
    give(&mut controller, OUT_1, 64, 0);
    assert_eq!(
        controller.output(endpoint(1), Toggle::Data0, b"abc"),
        Some(Handshake::Ack)
    );
    assert_eq!(controller.dpram_word(OUT_1), BUFFER_FULL | 3);
    assert_eq!(
        controller.dpram_word(BUFFER) & 0xff_ffff,
        u32::from_le_bytes(*b"abc\0")
    );
    assert_eq!(controller.read(BUFF_STATUS), 1 << 3, "EP1_OUT");
    assert_eq!(
        controller.output(endpoint(1), Toggle::Data1, b"d"),
        Some(Handshake::Nak)
    );
}

#[test]
fn a_packet_that_was_received_before_is_acknowledged_and_dropped() {
    let mut controller = device();
    give(&mut controller, OUT_1, 64 | BUFFER_DATA1, 0);
    let control = controller.dpram_word(OUT_1);
    assert_eq!(
        controller.output(endpoint(1), Toggle::Data0, b"abc"),
        Some(Handshake::Ack)
    );
    assert_eq!(controller.dpram_word(OUT_1), control);
    assert_eq!(controller.read(SIE_STATUS) & 1 << 31, 1 << 31, "DATA_SEQ_ERROR");
    assert_eq!(controller.read(BUFF_STATUS), 0);
}

#[test]
fn ep0_stalls_when_armed_and_other_endpoints_without() {
    let mut controller = device();
    controller.store_dpram(EP0_OUT, BUFFER_STALL, 4, 0);
    assert_eq!(controller.output(EP0, Toggle::Data1, &[]), Some(Handshake::Nak));
    write(&mut controller, EP_STALL_ARM, 0b10);
    assert_eq!(controller.output(EP0, Toggle::Data1, &[]), Some(Handshake::Stall));
    controller.store_dpram(IN_2, BUFFER_STALL, 4, 0);
    assert_eq!(
        controller.input(endpoint(2), Delivery::Acknowledged),
        Some(Sent::Stall)
    );
}

#[test]
fn an_aborted_endpoint_sends_naks_and_reports_it() {
    let mut controller = device();
    give(&mut controller, IN_2, BUFFER_FULL | 3, 0);
    write(&mut controller, EP_ABORT, 1 << 4);
    assert_eq!(controller.read(EP_ABORT_DONE), 1 << 4);
    assert_eq!(
        controller.input(endpoint(2), Delivery::Acknowledged),
        Some(Sent::Nak)
    );
}

#[test]
fn an_endpoint_that_is_not_enabled_does_not_answer() {
    let mut controller = device();
    assert_eq!(controller.input(endpoint(3), Delivery::Acknowledged), None);
    assert_eq!(controller.output(endpoint(2), Toggle::Data0, &[]), None);
}

#[test]
#[should_panic(expected = "AVAILABLE of buffer control 4 was set too early")]
fn available_together_with_the_other_bits_is_a_mistake() {
    let mut controller = device();
    controller.store_dpram(IN_2, BUFFER_AVAILABLE | BUFFER_FULL | 3, 4, 0);
}

#[test]
fn frames_are_counted_in_eleven_bits_and_reading_clears_their_interrupt() {
    let mut controller = device();
    write(&mut controller, INTE, 1 << 17);
    controller.start_of_frame(2047, 0);
    assert_eq!(controller.interrupts(), 1 << 17, "DEV_SOF");
    assert_eq!(controller.read(SOF_RD), 2047);
    assert_eq!(controller.interrupts(), 0);
    controller.start_of_frame(2048, cycles(1_000));
    assert_eq!(controller.read(SOF_RD), 0);
}

#[test]
fn three_idle_milliseconds_suspend_and_a_reset_does_not() {
    let mut controller = device();
    assert_eq!(controller.next_event(), cycles(3_000));
    controller.start_of_frame(1, cycles(2_000));
    assert_eq!(controller.next_event(), cycles(5_000));
    controller.advance(cycles(5_000) - 1);
    assert_eq!(controller.read(SIE_STATUS) & 1 << 4, 0);
    controller.advance(cycles(5_000));
    assert_eq!(controller.read(SIE_STATUS) & 1 << 4, 1 << 4);
    write(&mut controller, SIE_STATUS, 1 << 4);
    assert_eq!(controller.read(SIE_STATUS) & 1 << 4, 0);

    controller.resume(cycles(9_000));
    assert_eq!(controller.read(SIE_STATUS) & 1 << 11, 1 << 11);
    controller.bus_reset();
    assert_eq!(controller.read(SIE_STATUS) & 1 << 19, 1 << 19);
    assert_eq!(controller.next_event(), NEVER);
}

#[test]
fn status_bits_are_cleared_by_ones_and_enables_set_by_alias() {
    let mut controller = device();
    controller.bus_reset();
    controller.setup(ADDRESS, SETUP);
    write(&mut controller, SIE_STATUS, 1 << 19);
    assert_eq!(controller.read(SIE_STATUS) & (1 << 17 | 1 << 19), 1 << 17);
    let set = RegisterWrite {
        value: 1 << 16,
        alias: Alias::Set,
    };
    controller.write(INTE, RegisterWrite::plain(1 << 12), 0);
    controller.write(INTE, set, 0);
    assert_eq!(controller.read(INTE), 1 << 12 | 1 << 16);
    assert_eq!(controller.read(INTS), 1 << 16);
}

/// RP2040-E15.
#[test]
fn after_a_bus_error_nothing_but_a_reset_of_the_block_helps() {
    let mut controller = device();
    assert_eq!(
        controller.input(endpoint(2), Delivery::BusError),
        Some(Sent::Nak),
        "there was no packet to corrupt"
    );
    give(&mut controller, IN_2, BUFFER_FULL | 3, 0);
    controller.start_of_frame(1, 0);
    assert_eq!(controller.input(endpoint(2), Delivery::BusError), None);
    let status = controller.read(SIE_STATUS);
    controller.bus_reset();
    controller.start_of_frame(2, cycles(1_000));
    controller.advance(cycles(100_000));
    assert_eq!(controller.setup(ADDRESS, SETUP), None);
    assert_eq!(controller.input(endpoint(2), Delivery::Acknowledged), None);
    assert_eq!(
        (controller.read(SIE_STATUS), controller.read(SOF_RD)),
        (status, 1)
    );
    write(&mut controller, MAIN_CTRL, 0);
    write(&mut controller, MAIN_CTRL, 1);
    assert_eq!(controller.setup(ADDRESS, SETUP), None);

    controller.reset();
    assert!(!controller.is_attached());
    assert_eq!(controller.setup(0, SETUP), Some(Handshake::Ack));
    assert_ne!(controller.dpram_word(0x0c), 0, "memory keeps what it holds");
}

/// "Maximum bulk transactions per frame": 19 of 64 bytes, 71 of 8 (USB 2.0, table 5-9).
#[test]
fn as_many_transactions_fit_into_a_frame_as_the_standard_says() {
    assert_eq!(cycles(1_000) / transaction_time(64), 19);
    assert_eq!(cycles(1_000) / transaction_time(8), 71);
}

// ----- The host -----------------------------------------------------------------------------------------

/// A device that is attached and answers nothing: the host's first steps and their times.
#[test]
fn a_host_debounces_resets_and_gives_up_on_a_silent_device() {
    let mut usb = Usb::new();
    for (offset, value) in [
        (USB_MUXING, 1),
        (USB_PWR, 0b1100),
        (MAIN_CTRL, 1),
        (SIE_CTRL, 1 << 16),
        // An address that no host uses first.
        (ADDR_ENDP, 99),
    ] {
        usb.write(offset, RegisterWrite::plain(value), 0);
    }
    usb.host.plug();
    let is_reset = |usb: &mut Usb| usb.read(SIE_STATUS, 0) & STATUS_BUS_RESET != 0;
    usb.advance(cycles(99_000));
    assert!(!is_reset(&mut usb), "7.1.7.3: a debounce of 100 ms");
    usb.advance(cycles(102_000));
    assert!(is_reset(&mut usb));
    usb.advance(cycles(140_000));
    assert_eq!(usb.read(SOF_RD, 0), 0, "7.1.7.5: a reset of 50 ms");
    usb.advance(cycles(155_000));
    assert_ne!(usb.read(SOF_RD, 0), 0);
    usb.advance(cycles(2_000_000));
    let events: Vec<_> = usb
        .host
        .take_events()
        .into_iter()
        .map(|(_, event)| event)
        .collect();
    let failed = HostEvent::Failed(ControlRequest::DeviceDescriptor { length: 64 }, Failure::NoAnswer);
    let expected = [
        HostEvent::Attached,
        failed,
        failed,
        failed,
        failed,
        HostEvent::GivenUp,
    ];
    assert_eq!(events, expected);
    usb.write(SIE_CTRL, RegisterWrite::plain(0), cycles(2_000_000));
    usb.advance(cycles(2_010_000));
    assert_eq!(usb.host.take_events()[0].1, HostEvent::Detached);
}

#[test]
fn without_a_cable_the_host_does_nothing() {
    let mut usb = Usb::new();
    assert_eq!(usb.next_event(), NEVER);
    usb.host.open();
    usb.host.send(b"abc");
    usb.host
        .request(ControlRequest::Close, Some(AbortPoint::BeforeStatus));
    assert_eq!(usb.next_event(), NEVER);
    assert!(usb.host.device().is_none() && usb.host.take_events().is_empty());
}
