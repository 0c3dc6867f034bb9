//! Tests of the bus against the CAN specification.

use std::cell::RefCell;
use std::rc::Rc;

use super::super::clock::{CLK_SYS_HZ, Cycle, cycles};
use super::*;

const BIT: Cycle = bit_time(500_000);

fn shared<N>(node: N) -> Rc<RefCell<N>> {
    Rc::new(RefCell::new(node))
}

/// A bus with two nodes that have joined it.
fn pair() -> (SharedCanBus, [Rc<RefCell<Station>>; 2]) {
    let bus = CanBus::new(1);
    let nodes = [BIT, BIT].map(|bit| shared(Station::new(bit)));
    for node in &nodes {
        bus.borrow_mut().attach(node.clone());
    }
    bus.borrow_mut().advance(cycles(1000));
    (bus, nodes)
}

fn frame(id: u32) -> CanFrame {
    CanFrame::extended(id, &[1, 2, 3])
}

fn outcomes(bus: &SharedCanBus) -> Vec<CanOutcome> {
    let records = bus.borrow_mut().take_records();
    records.iter().map(|record| record.outcome).collect()
}

#[test]
fn a_frame_arrives_after_its_bits() {
    let (bus, [a, b]) = pair();
    a.borrow_mut().send(cycles(2000), frame(5));
    let end = cycles(2000) + frame(5).bits() * BIT;
    bus.borrow_mut().advance(end - 1);
    assert!(b.borrow_mut().take_received().is_empty());
    assert_eq!(bus.borrow().next_event(), end);
    bus.borrow_mut().advance(end);
    assert_eq!(b.borrow_mut().take_received(), [(end, frame(5))]);
    assert!(a.borrow_mut().take_received().is_empty(), "its own");
}

#[test]
fn the_lower_identifier_wins_and_the_other_follows_at_once() {
    let (bus, [a, b]) = pair();
    a.borrow_mut().send(cycles(2000), frame(6));
    b.borrow_mut().send(cycles(2000), frame(5));
    bus.borrow_mut().advance(cycles(4000));
    let records = bus.borrow_mut().take_records();
    assert_eq!((&records[0].frame, &records[1].frame), (&frame(5), &frame(6)));
    assert_eq!(records[1].start, records[0].end);
}

#[test]
fn the_same_identifier_with_other_data_is_an_error_until_they_part() {
    let (bus, [a, b]) = pair();
    a.borrow_mut().send(cycles(2000), CanFrame::extended(5, &[1]));
    b.borrow_mut().send(cycles(2000), CanFrame::extended(5, &[2]));
    bus.borrow_mut().advance(cycles(2400));
    assert!(outcomes(&bus).contains(&CanOutcome::Error));
    assert!(a.borrow().confinement().transmit_errors() >= 8);
}

#[test]
fn alone_a_node_becomes_passive_and_never_goes_off() {
    let (bus, [a, b]) = pair();
    b.borrow_mut().set_bit(None);
    a.borrow_mut().send(cycles(2000), frame(5));
    bus.borrow_mut().advance(cycles(1_000_000));
    let node = a.borrow();
    assert_eq!(
        (node.confinement().state(), node.confinement().transmit_errors()),
        (ErrorState::Passive, 128)
    );
    assert_eq!(node.waiting(), 1, "it still tries");
    drop(node);
    b.borrow_mut().set_bit(Some(BIT));
    bus.borrow_mut().advance(cycles(1_100_000));
    assert_eq!(b.borrow_mut().take_received().len(), 1, "and succeeds");
}

#[test]
fn a_corrupted_frame_is_repeated_and_arrives_once() {
    let (bus, [a, b]) = pair();
    bus.borrow_mut().set_noise(1.0);
    a.borrow_mut().send(cycles(2000), frame(5));
    bus.borrow_mut().advance(cycles(2000));
    bus.borrow_mut().set_noise(0.0);
    bus.borrow_mut().advance(cycles(4000));
    assert_eq!(outcomes(&bus), [CanOutcome::Error, CanOutcome::Sent]);
    assert_eq!(b.borrow_mut().take_received().len(), 1);
    assert_eq!(a.borrow().confinement().transmit_errors(), 7, "8 up, 1 down");
    assert_eq!(b.borrow().confinement().receive_errors(), 0, "1 up, 1 down");
}

#[test]
fn another_bit_rate_destroys_every_frame_until_its_node_is_passive() {
    let (bus, [a, b]) = pair();
    b.borrow_mut().set_bit(Some(bit_time(250_000)));
    bus.borrow_mut().advance(cycles(1200));
    a.borrow_mut().send(cycles(2000), frame(5));
    bus.borrow_mut().advance(cycles(20_000));
    assert!(outcomes(&bus).len() > 15);
    assert!(b.borrow_mut().take_received().is_empty());
}

#[test]
fn shorted_wires_switch_a_sender_off_for_128_times_11_bits() {
    let (bus, [a, _]) = pair();
    bus.borrow_mut().set_wires(CanWires::Shorted);
    a.borrow_mut().send(cycles(2000), frame(5));
    bus.borrow_mut().advance(cycles(3500));
    assert_eq!(a.borrow().confinement().state(), ErrorState::BusOff);
    let attempts = outcomes(&bus).len();
    assert_eq!(attempts, 32);
    bus.borrow_mut().set_wires(CanWires::Sound);
    let back = bus.borrow().next_event();
    let recovery = 128 * 11 * BIT;
    assert!(
        (recovery - cycles(700)..=recovery).contains(&(back - cycles(3500))),
        "{back}"
    );
    bus.borrow_mut().advance(back + cycles(2000));
    assert_eq!(outcomes(&bus), [CanOutcome::Sent]);
}

#[test]
fn a_stuck_wire_makes_receivers_passive_and_is_left_without_harm() {
    let (bus, [a, b]) = pair();
    bus.borrow_mut().set_wires(CanWires::StuckDominant);
    a.borrow_mut().send(cycles(2000), frame(5));
    bus.borrow_mut().advance(cycles(1_000_000));
    assert_eq!(a.borrow().confinement().state(), ErrorState::Passive);
    assert_eq!(a.borrow().confinement().transmit_errors(), 0);
    assert!(outcomes(&bus).is_empty());
    bus.borrow_mut().set_wires(CanWires::Sound);
    bus.borrow_mut().advance(cycles(1_010_000));
    assert_eq!(b.borrow_mut().take_received().len(), 1);
}

#[test]
fn traffic_takes_its_share_of_the_bus() {
    let (bus, [a, b]) = pair();
    let traffic = shared(Traffic::new(BIT, 1, 0.9, cycles(2000)));
    bus.borrow_mut().attach(traffic.clone());
    bus.borrow_mut().advance(cycles(1_002_000));
    let records = bus.borrow_mut().take_records();
    let busy: Cycle = records.iter().map(|record| record.end - record.start).sum();
    let share = busy as f64 / CLK_SYS_HZ as f64;
    assert!((0.89..0.91).contains(&share), "{share}");
    let heard = b.borrow_mut().take_received().len() as u64;
    assert_eq!(heard, traffic.borrow().sent_frames());
    // Weaker frames get the rest.
    for number in 0..100 {
        a.borrow_mut().send(cycles(1_002_000), frame(100 + number));
    }
    bus.borrow_mut().advance(cycles(1_402_000));
    assert_eq!(a.borrow().waiting(), 0);
}

#[test]
fn noise_corrupts_its_share() {
    let (bus, [a, b]) = pair();
    bus.borrow_mut().set_noise(0.1);
    for number in 0..1000 {
        a.borrow_mut().send(cycles(2000 + number * 1000), frame(5));
    }
    bus.borrow_mut().advance(cycles(1_100_000));
    assert_eq!(b.borrow_mut().take_received().len(), 1000);
    let errors = outcomes(&bus).iter().filter(|o| **o == CanOutcome::Error).count();
    assert!((70..160).contains(&errors), "{errors}");
}
