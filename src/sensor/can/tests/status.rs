//! Status of nodes, of this one and of others.

use super::bench::{Bench, OWN_ID, node, setup, status};
use super::golden::{self, frames};
use crate::memory::identity::FirmwareHash;
use crate::sensor::CanNotice;
use crate::sensor::can::MAX_NODES;

const OWN_STATUS: u32 = 0x0001_5500 | OWN_ID as u32;

#[test]
fn own_status_is_sent_each_second_as_by_the_reference() {
    let mut bench = Bench::with_packs(&[]);
    bench.run_ms(10_000);
    assert_eq!(bench.sent_of(OWN_STATUS).len(), 11);
    for _ in 0..365 {
        bench.run_ms(10_000);
        bench.sent();
    }
    bench.run_ms(1000);
    let mut sent = bench.sent_of(OWN_STATUS);
    let sent = sent.pop().expect("a status");
    let expected = frames(golden::OWN_STATUS)[0];
    assert_eq!(sent.id(), expected.id());
    // All but the count of transfers.
    assert_eq!(sent.data()[..7], expected.data()[..7]);
    assert_eq!(sent.data()[7], 0xc0 | (3661 % 32) as u8);
}

#[test]
fn node_info_is_answered_as_by_the_reference() {
    let hash = FirmwareHash::of([1, 2, 3]);
    let mut bench = Bench::with_packs(&[]);
    bench.run_ms(1000);
    // It takes a moment to compute.
    bench.settings.firmware_hash = Some(hash);
    bench.run_ms(1000);
    bench.sent();
    bench.receive(&frames(golden::NODE_INFO_REQUEST));
    let (sent, expected) = (bench.sent(), frames(golden::NODE_INFO));
    let bytes = |frames: &[crate::sensor::CanFrame]| -> Vec<u8> {
        frames
            .iter()
            .flat_map(|frame| frame.data()[..frame.data().len() - 1].to_vec())
            .collect()
    };
    let mut wanted = bytes(&expected);
    // Behind CRC and status: version and hash, which are of this program.
    wanted[9] = env!("CARGO_PKG_VERSION_MAJOR").parse().unwrap();
    wanted[10] = env!("CARGO_PKG_VERSION_MINOR").parse().unwrap();
    wanted[16..20].copy_from_slice(&hash.number().to_le_bytes());
    assert_eq!(bytes(&sent)[2..], wanted[2..]);
    let outside = |frames: &[crate::sensor::CanFrame]| -> Vec<(u32, u8)> {
        frames
            .iter()
            .map(|frame| (frame.id(), *frame.data().last().unwrap()))
            .collect()
    };
    assert_eq!(outside(&sent), outside(&expected));
}

#[test]
fn requests_to_others_are_not_answered() {
    let mut bench = Bench::new(setup(Some(11)), &[]);
    bench.sent();
    bench.receive(&frames(golden::NODE_INFO_REQUEST));
    assert_eq!(bench.sent(), []);
}

#[test]
fn nodes_appear_restart_and_are_lost() {
    let mut bench = Bench::with_packs(&[]);
    bench.receive(&frames(golden::NODE_STATUS));
    assert_eq!(bench.take_notices(), [CanNotice::Appeared(node(42))]);
    bench.run_ms(3000);
    bench.receive(&status(42, 3664, 0));
    bench.receive(&status(43, 1, 0));
    assert_eq!(bench.take_notices(), [CanNotice::Appeared(node(43))]);
    bench.run_ms(2000);
    bench.receive(&status(42, 0, 0));
    assert_eq!(bench.take_notices(), [CanNotice::Restarted(node(42))]);
    bench.run_ms(1100);
    assert_eq!(bench.take_notices(), [CanNotice::Lost(node(43))]);
    // It says itself that it leaves.
    bench.receive(&status(42, 3, 7));
    bench.receive(&status(42, 4, 7));
    bench.run_ms(5000);
    assert_eq!(bench.take_notices(), [CanNotice::Lost(node(42))]);
    bench.receive(&status(42, 0, 0));
    assert_eq!(bench.take_notices(), [CanNotice::Appeared(node(42))]);
}

#[test]
fn many_nodes_are_served_though_not_all_are_watched() {
    let mut bench = Bench::with_packs(&[]);
    for id in (1..=127).filter(|id| *id != OWN_ID) {
        bench.receive(&status(id, 1, 0));
    }
    assert_eq!(bench.take_notices().len(), MAX_NODES);
}

#[test]
fn another_node_with_the_own_id_is_announced_once() {
    let mut bench = Bench::with_packs(&[]);
    for _ in 0..3 {
        bench.receive(&status(OWN_ID, 1, 0));
    }
    assert_eq!(bench.take_notices(), [CanNotice::SameId(node(OWN_ID))]);
}

#[test]
fn texts_name_node_and_pack() {
    for (notice, text) in [
        (CanNotice::Appeared(node(42)), "CAN node 42 found"),
        (
            CanNotice::Source(crate::pack::Pack::Second, node(7)),
            "Battery 2 measured by CAN node 7",
        ),
    ] {
        assert_eq!(notice.to_string(), text);
        assert!(!notice.is_fault());
    }
    assert!(CanNotice::Lost(node(1)).is_fault());
}
