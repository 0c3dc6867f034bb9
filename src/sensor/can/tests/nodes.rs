//! Nodes: their ids, given by another node and given to others, and their status.

use proptest::prelude::*;

use super::golden::{self, frames};
use super::{Battery, CanBench, OWN_ID, charger, message, node, pack, setup, status, status_with};
use crate::announce::{Announce, Severity};
use crate::memory::identity::FirmwareHash;
use crate::pack::Pack;
use crate::sensor::can::MAX_NODES;
use crate::sensor::can::allocation::Allocator;
use crate::sensor::can::frame::{Identifier, Priority};
use crate::sensor::can::messages::{ALLOCATION, Allocation, DataType};
use crate::sensor::can::transfers::{Outgoing, Transfer};
use crate::sensor::{CanFrame, CanNotice};

/// Time for the first nodes to be heard.
const LISTENING_MS: u64 = 3_000;

fn allocation(frame: &CanFrame) -> Allocation {
    let (_, payload) = frame.data().split_last().unwrap();
    Allocation::parse(payload).expect("an allocation")
}

/// Requests of a node with this unique id.
fn requests(unique_id: [u8; 16], wanted: u8) -> Vec<CanFrame> {
    let mut outgoing = Outgoing::EMPTY;
    for (index, part) in unique_id.chunks(6).enumerate() {
        let allocation = Allocation {
            node_id: crate::sensor::NodeId::new(wanted),
            is_first: index == 0,
            unique_id: part.iter().copied().collect(),
        };
        outgoing.send(&Transfer {
            identifier: Identifier::Anonymous {
                type_bits: 1,
                discriminator: index as u16,
            },
            priority: Priority::LOW,
            transfer_id: index as u8,
            crc: DataType::Allocation.crc(),
            payload: &allocation.to_bytes(),
        });
    }
    std::iter::from_fn(|| outgoing.next()).collect()
}

fn assigned(bench: &mut CanBench) -> Vec<u8> {
    let id = |notice: CanNotice| match notice {
        CanNotice::Assigned(id) => Some(id.number()),
        _ => None,
    };
    bench.take_notices().into_iter().filter_map(id).collect()
}

fn listening(packs_at: u64) -> CanBench {
    let mut bench = CanBench::with_packs(&[]);
    bench.run_ms(packs_at);
    bench.sent();
    bench.take_notices();
    bench
}

#[test]
fn node_is_given_an_id_by_the_reference() {
    let mut bench = CanBench::new(setup(None), &[]);
    for (request, answer) in golden::ID_REQUESTS.iter().zip(golden::ID_ANSWERS) {
        let started = bench.now;
        let sent = loop {
            bench.run_ms(100);
            if let Some(sent) = bench.sent().first() {
                break *sent;
            }
            assert!(bench.now.us_since(started) <= 1_100_000, "no request");
        };
        let (_, expected) = request[0];
        assert_eq!(
            sent.data()[..sent.data().len() - 1],
            expected[..expected.len() - 1]
        );
        assert_eq!(sent.id() & 0x3ff, 0x100, "anonymous");
        bench.receive(&frames(answer));
    }
    assert_eq!(bench.take_notices(), [CanNotice::OwnId(node(99))]);
    assert_eq!(bench.can.node_id(), Some(node(99)));
    bench.run_ms(1000);
    assert_eq!(
        bench.sent_of(0x0001_5500 | 99).len(),
        2,
        "its status is sent from now on"
    );
}

#[test]
fn node_without_an_id_sends_nothing_but_requests_for_one() {
    let mut bench = CanBench::new(setup(None), &[]);
    let mut sent = Vec::new();
    for _ in 0..600 {
        bench.run_ms(100);
        sent.extend(bench.sent());
    }
    assert!((50..110).contains(&sent.len()), "{} in a minute", sent.len());
    assert!(sent.iter().all(|frame| allocation(frame).is_first));
    let discriminators: std::collections::HashSet<u32> = sent.iter().map(CanFrame::id).collect();
    assert!(discriminators.len() > sent.len() / 2, "they are random");
}

#[test]
fn node_without_an_id_gives_way_to_others_and_ignores_their_answers() {
    let mut bench = CanBench::new(setup(None), &[]);
    for round in 0..50 {
        // Another node is being given an id.
        bench.receive(&requests([round; 16], 0)[..1]);
        let answer = [1, 2, 3, 4, 5, 6, 0xff].map(|byte| byte ^ 0x80);
        bench.receive(&message(
            20,
            ALLOCATION,
            DataType::Allocation,
            round,
            &[&[0][..], &answer].concat(),
        ));
        bench.run_ms(500);
    }
    assert_eq!(bench.sent(), []);
    assert_eq!(bench.can.node_id(), None);
}

#[test]
fn ids_are_given_as_by_the_reference() {
    let mut bench = listening(LISTENING_MS);
    for (request, answer) in golden::ID_REQUESTS.iter().zip(&golden::ID_ANSWERS[..2]) {
        bench.receive(&frames(request));
        assert_eq!(bench.sent(), frames(answer));
    }
    bench.receive(&frames(golden::ID_REQUESTS[2]));
    let (given, sent) = (assigned(&mut bench), bench.sent());
    let [id] = given[..] else {
        panic!("{given:?}");
    };
    assert_eq!(sent.len(), 3);
    assert_eq!(sent[0].data()[2], id << 1, "behind the CRC");
    let unique_id = [&sent[0].data()[3..7], &sent[1].data()[..7], &sent[2].data()[..5]].concat();
    assert_eq!(unique_id, (1..=16).collect::<Vec<u8>>());
}

#[test]
// Requirement: L-20
fn id_is_the_same_again_and_after_a_restart_of_this_board() {
    let mut ids = Vec::new();
    for _ in 0..2 {
        let mut bench = listening(LISTENING_MS);
        for _ in 0..2 {
            bench.receive(&requests([7; 16], 0));
        }
        // It is on the bus, restarts, and asks again.
        let id = assigned(&mut bench)[1];
        bench.receive(&status(id, 1, 0));
        bench.receive(&requests([7; 16], 0));
        ids.push(id);
        ids.extend(assigned(&mut bench));
    }
    assert!(ids.iter().all(|id| *id == ids[0]) && ids[0] >= 64, "{ids:?}");
}

#[test]
fn wanted_id_is_given_if_it_is_free() {
    let mut bench = listening(LISTENING_MS);
    bench.receive(&status(31, 1, 0));
    bench.take_notices();
    for (owner, wanted) in [(1, 30), (2, 30), (3, OWN_ID), (4, 125), (5, 125), (6, 127)] {
        bench.receive(&requests([owner; 16], wanted));
    }
    let ids = assigned(&mut bench);
    assert_eq!(ids[..5], [30, 32, 11, 125, 124]);
    assert!(ids[5] >= 64, "127 is for tools");
}

#[test]
fn nothing_is_given_before_other_nodes_were_heard() {
    let mut bench = listening(LISTENING_MS - 100);
    bench.receive(&requests([7; 16], 0));
    assert_eq!((bench.sent(), assigned(&mut bench)), (vec![], vec![]));
    bench.run_ms(100);
    bench.receive(&requests([7; 16], 0));
    assert_eq!(assigned(&mut bench).len(), 1);
}

#[test]
fn late_or_foreign_parts_get_nothing() {
    let mut bench = listening(LISTENING_MS);
    let parts = requests([7; 16], 0);
    bench.receive(&parts[..2]);
    bench.sent();
    bench.run_ms(600);
    bench.sent();
    bench.receive(&parts[2..]);
    assert_eq!(bench.sent(), [], "too late");
    // A second node in between starts over.
    bench.receive(&parts[..1]);
    bench.receive(&requests([8; 16], 0)[..1]);
    bench.receive(&parts[1..]);
    assert_eq!(
        assigned(&mut bench).len(),
        1,
        "of a mixed unique id: the nodes ignore it"
    );
    // Too long.
    bench.receive(&parts[..1]);
    bench.receive(&[parts[1], parts[1], parts[1]]);
    assert!(assigned(&mut bench).is_empty());
}

#[test]
// Requirement: L-20
fn ids_run_out() {
    let mut bench = listening(LISTENING_MS);
    for owner in 0..MAX_NODES as u8 + 4 {
        bench.receive(&requests([owner; 16], 0));
    }
    let notices = bench.take_notices();
    let count = |wanted: fn(&CanNotice) -> bool| notices.iter().filter(|notice| wanted(notice)).count();
    let assigned = count(|notice| matches!(notice, CanNotice::Assigned(_)));
    assert_eq!(assigned, MAX_NODES);
    let refused = count(|notice| *notice == CanNotice::NoIdLeft);
    assert_eq!(refused, 1, "announced once");
}

#[test]
fn two_nodes_of_this_kind_find_each_other() {
    let mut server = CanBench::with_packs(&[]);
    let mut client = CanBench::new(setup(None), &[]);
    for _ in 0..100 {
        client.run_ms(100);
        server.run_ms(100);
        server.receive(&client.sent());
        client.receive(&server.sent());
    }
    let id = client.can.node_id().expect("an id");
    let notices = server.take_notices();
    assert_eq!(notices, [CanNotice::Assigned(id), CanNotice::Appeared(id)]);
}

proptest! {
    /// No two nodes get the same id, none gets one that is in use, and who asks again gets the same.
    #[test]
    fn ids_are_unique(
        owners in prop::collection::vec((any::<u8>(), 0u8..128), 1..40),
        used in prop::collection::vec(1u8..126, 0..100),
    ) {
        let start = crate::time::at_us(0);
        let now = crate::time::at_us(10_000_000);
        let mut allocator = Allocator::new(node(OWN_ID), start);
        let mut given = std::collections::HashMap::new();
        for (owner, wanted) in owners {
            let mut id = None;
            for frame in requests([owner; 16], wanted) {
                let is_on_bus = |id: crate::sensor::NodeId| used.contains(&id.number());
                use crate::sensor::can::allocation::Answer;
                if let Some(Answer::Assigned(assigned, _)) =
                    allocator.request(&allocation(&frame), now, is_on_bus)
                {
                    id = Some(assigned.number());
                }
            }
            if let Some(id) = id {
                prop_assert!(id != OWN_ID && id <= 125 && !used.contains(&id));
                prop_assert_eq!(*given.entry(owner).or_insert(id), id);
            }
        }
        let mut ids: Vec<u8> = given.values().copied().collect();
        ids.sort_unstable();
        ids.dedup();
        prop_assert_eq!(ids.len(), given.len());
    }
}

const OWN_STATUS: u32 = 0x0001_5500 | OWN_ID as u32;

#[test]
fn own_status_is_sent_each_second_as_by_the_reference() {
    let mut bench = CanBench::with_packs(&[]);
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
    let mut bench = CanBench::with_packs(&[]);
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
    let mut bench = CanBench::new(setup(Some(11)), &[]);
    bench.sent();
    bench.receive(&frames(golden::NODE_INFO_REQUEST));
    assert_eq!(bench.sent(), []);
}

#[test]
fn nodes_appear_restart_and_are_lost() {
    let mut bench = CanBench::with_packs(&[]);
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

/// A node's health, once in a second for this many seconds, and how often a critical one was announced.
fn announced_critical(bench: &mut CanBench, id: u8, health: u8, seconds: u32) -> usize {
    for _ in 0..seconds {
        let uptime_s = (bench.now.as_micros() / 1_000_000) as u32;
        bench.receive(&status_with(id, uptime_s, health, 0));
        bench.run_ms(1000);
    }
    let notices = bench.take_notices();
    let critical = notices
        .iter()
        .filter(|notice| matches!(notice, CanNotice::Critical(..)));
    critical.count()
}

/// `HEALTH_OK` to `HEALTH_CRITICAL`.
const HEALTHS: [u8; 4] = [0, 1, 2, 3];

#[test]
// Requirement: L-10
fn critical_health_of_a_batterys_node_is_announced_once_until_it_was_better_for_long() {
    let [ok, warning, error, critical] = HEALTHS;
    let mut bench = CanBench::with_packs(&[pack(Pack::Second), pack(Pack::Third)]);
    assert_eq!(
        announced_critical(&mut bench, 42, critical, 5),
        0,
        "it measures nothing"
    );
    // Two batteries of one node.
    bench.receive(&Battery::new(42, 0).frames(0));
    bench.receive(&Battery::new(42, 1).frames(0));
    bench.take_notices();
    bench.receive(&status_with(42, 6, critical, 0));
    assert_eq!(
        bench.take_notices(),
        [CanNotice::Critical(Pack::Second, node(42))]
    );
    assert_eq!(announced_critical(&mut bench, 42, critical, 60), 0);
    for _ in 0..30 {
        for other in [ok, warning, error] {
            assert_eq!(announced_critical(&mut bench, 42, other, 1), 0);
            assert_eq!(announced_critical(&mut bench, 42, critical, 1), 0, "it toggles");
        }
    }
    // It is lost, and restarts.
    bench.run_ms(5_000);
    bench.receive(&status_with(42, 0, critical, 0));
    let notices = bench.take_notices();
    assert_eq!(
        notices,
        [CanNotice::Lost(node(42)), CanNotice::Appeared(node(42))]
    );
    assert_eq!(announced_critical(&mut bench, 42, error, 29), 0);
    assert_eq!(announced_critical(&mut bench, 42, critical, 1), 0, "after 29 s");
    assert_eq!(announced_critical(&mut bench, 42, error, 31), 0);
    assert_eq!(announced_critical(&mut bench, 42, critical, 5), 1, "after 31 s");
}

#[test]
fn critical_health_of_a_chargers_node_is_announced_and_that_of_others_is_not() {
    let named = crate::sensor::CanPack {
        battery_id: Some(33),
        ..pack(Pack::First)
    };
    let mut bench = CanBench::with_packs(&[named]);
    bench.receive(&charger(33, 0));
    let [_, _, _, critical] = HEALTHS;
    assert_eq!(announced_critical(&mut bench, 33, critical, 3), 1);
    assert_eq!(announced_critical(&mut bench, 34, critical, 3), 0);
}

#[test]
fn many_nodes_are_served_though_not_all_are_watched() {
    let mut bench = CanBench::with_packs(&[]);
    for id in (1..=127).filter(|id| *id != OWN_ID) {
        bench.receive(&status(id, 1, 0));
    }
    assert_eq!(bench.take_notices().len(), MAX_NODES);
}

#[test]
fn another_node_with_the_own_id_is_announced_once() {
    let mut bench = CanBench::with_packs(&[]);
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
        assert_eq!(notice.severity(), Severity::Info);
    }
    assert_eq!(CanNotice::Lost(node(1)).severity(), Severity::Warning);
    let critical = CanNotice::Critical(Pack::Ninth, node(127));
    assert_eq!(critical.severity(), Severity::Warning);
    assert_eq!(
        critical.to_string(),
        "Battery 9 CAN node 127 reports critical health"
    );
}
