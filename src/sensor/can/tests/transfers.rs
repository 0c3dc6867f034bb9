//! Transfers: lost, repeated, interleaved and meaningless frames.

use proptest::prelude::*;
use proptest::sample::Index;

use super::golden::{self, frames};
use super::{Battery, CanBench, charger, controller, message, pack, setup, status};
use crate::pack::Pack;
use crate::parameter::MAX_CONTROLLERS;
use crate::sensor::can::MAX_NODES;
use crate::sensor::can::messages::{BATTERY_INFO, DataType, TEMPERATURE};
use crate::sensor::{CanEvent, CanFrame, CanPack};

/// Three packs, and batteries of three nodes for them.
fn three_packs() -> CanBench {
    let of = |(number, battery_id)| CanPack {
        battery_id: Some(battery_id),
        ..pack(number)
    };
    CanBench::with_packs(&[(Pack::First, 0), (Pack::Second, 1), (Pack::Third, 2)].map(of))
}

const BATTERIES: [Battery; 3] = [
    Battery {
        voltage_v: 12.0,
        ..Battery::new(40, 0)
    },
    Battery {
        voltage_v: 13.0,
        ..Battery::new(41, 1)
    },
    Battery {
        voltage_v: 14.0,
        ..Battery::new(42, 2)
    },
];

const VOLTAGES: [(Pack, f32); 3] = [(Pack::First, 12.0), (Pack::Second, 13.0), (Pack::Third, 14.0)];

/// The frames that `taken` has a bit for.
fn some_of(frames: &[CanFrame], taken: usize) -> Vec<CanFrame> {
    let is_taken = |(index, _): &(usize, &CanFrame)| taken >> index & 1 == 1;
    frames
        .iter()
        .enumerate()
        .filter(is_taken)
        .map(|(_, frame)| *frame)
        .collect()
}

/// An MCP2515 may send the highest priority instead of the frame's own (erratum 3).
#[test]
// Requirement: R-10
fn a_frame_of_another_priority_belongs_to_its_transfer() {
    const PRIORITY: u32 = 0x1f00_0000;
    let whole = frames(golden::BATTERY_INFO);
    for changed in 0..whole.len() {
        let mut received = whole.clone();
        let frame = received[changed];
        received[changed] = CanFrame::new(frame.id() & !PRIORITY, frame.data()).unwrap();
        assert_ne!(received[changed].id(), frame.id());
        let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
        bench.receive(&received);
        assert_eq!(bench.take_voltages().len(), 1, "{changed}");
    }
}

#[test]
fn whatever_frames_are_lost_the_transfer_is_whole_or_gone() {
    let whole = frames(golden::BATTERY_INFO);
    for taken in 0..1 << whole.len() {
        let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
        bench.receive(&some_of(&whole, taken));
        let is_whole = taken == (1 << whole.len()) - 1;
        assert_eq!(bench.take_voltages().len(), usize::from(is_whole), "{taken:#b}");
        // The next one is received.
        bench.receive(&BATTERIES[0].frames(9));
        bench.receive(&whole);
        assert_eq!(bench.take_voltages().len(), 1, "{taken:#b}");
        let has_begun = taken & 1 == 1;
        assert_eq!(
            bench.can.lost_transfers(),
            u32::from(has_begun && !is_whole),
            "{taken:#b}"
        );
    }
}

#[test]
fn repeated_frames_do_no_harm() {
    let whole = frames(golden::BATTERY_INFO);
    for repeated in 0..whole.len() {
        let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
        for (index, frame) in whole.iter().enumerate() {
            let times = if index == repeated { 3 } else { 1 };
            bench.receive(&vec![*frame; times]);
        }
        assert_eq!(bench.take_voltages().len(), 1, "frame {repeated}");
    }
}

#[test]
fn frame_of_another_transfer_ends_the_one_before() {
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    let (before, after) = (BATTERIES[0].frames(1), BATTERIES[0].frames(2));
    bench.receive(&before[..2]);
    // The start of the next one is lost.
    bench.receive(&after[2..]);
    bench.receive(&before[2..]);
    assert_eq!(bench.take_voltages(), []);
    assert_eq!(bench.can.lost_transfers(), 1);
}

#[test]
fn transfer_times_out() {
    for (pause_ms, count) in [(2_000, 1), (2_100, 0)] {
        let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
        let whole = frames(golden::BATTERY_INFO);
        bench.receive(&whole[..3]);
        bench.run_ms(pause_ms);
        bench.receive(&whole[3..]);
        assert_eq!(bench.take_voltages().len(), count, "after {pause_ms} ms");
    }
}

#[test]
fn damaged_transfer_is_dropped() {
    let whole = frames(golden::BATTERY_INFO);
    for (index, frame) in whole.iter().enumerate() {
        for bit in 0..8 * (frame.data().len() - 1) {
            let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
            let mut damaged = whole.clone();
            let mut data = frame.data().to_vec();
            data[bit / 8] ^= 1 << (bit % 8);
            damaged[index] = CanFrame::new(frame.id(), &data).unwrap();
            bench.receive(&damaged);
            assert_eq!(bench.take_voltages(), [], "frame {index}, bit {bit}");
        }
    }
}

#[test]
fn transfer_that_is_too_short_is_dropped() {
    for bytes in [0, 7, 8, 22, 23, 60] {
        let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
        let payload = vec![0x40; bytes];
        bench.receive(&message(42, BATTERY_INFO, DataType::BatteryInfo, 0, &payload));
        assert_eq!(bench.take_readings().len(), usize::from(bytes > 22), "{bytes}");
    }
}

#[test]
fn endless_transfer_fills_nothing() {
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    let frame = |tail| CanFrame::new(0x1004_442a, &[1, 2, 3, 4, 5, 6, 7, tail]).unwrap();
    bench.receive(&[frame(0x80)]);
    for index in 1..200u8 {
        // Different contents: no repetition.
        let toggle = if index % 2 == 1 { 0x20 } else { 0 };
        bench.receive(&[CanFrame::new(0x1004_442a, &[index, 2, 3, 4, 5, 6, 7, toggle]).unwrap()]);
    }
    assert_eq!(bench.can.lost_transfers(), 1);
    bench.receive(&frames(golden::BATTERY_INFO));
    assert_eq!(bench.take_voltages().len(), 1);
}

/// The first frame of each transfer, then the second of each, and so on.
fn receive_interleaved(bench: &mut CanBench, all: &[Vec<CanFrame>]) {
    let longest = all.iter().map(Vec::len).max().unwrap_or_default();
    for place in 0..longest {
        for frame in all.iter().filter_map(|transfer| transfer.get(place)) {
            bench.receive(&[*frame]);
        }
    }
}

#[test]
fn all_motor_controllers_and_packs_are_heard_at_a_time() {
    let packs = Pack::ALL.map(|of| CanPack {
        battery_id: Some(of.number().into()),
        ..pack(of)
    });
    let mut bench = CanBench::with_packs(&packs);
    for round in 0..10 {
        let controllers = (0..MAX_CONTROLLERS as u8).map(|index| controller(20 + index, index, round));
        let batteries = packs.iter().map(|pack| {
            let number = pack.pack.number();
            Battery::new(40 + number, number).frames(round)
        });
        let all: Vec<_> = controllers.chain(batteries).collect();
        receive_interleaved(&mut bench, &all);
        let heard = bench.events.iter().filter_map(|event| match event {
            CanEvent::Controller(index, reading) => Some((*index, reading.current_a.unwrap())),
            _ => None,
        });
        let expected = (0..MAX_CONTROLLERS as u8).map(|index| (index, f32::from(index)));
        assert!(heard.eq(expected), "round {round}");
        assert_eq!(
            bench.take_voltages(),
            Pack::ALL.map(|pack| (pack, 12.0)),
            "round {round}"
        );
        bench.run_ms(100);
    }
    assert_eq!(bench.can.lost_transfers(), 0);
}

#[test]
fn more_transfers_at_a_time_than_there_is_room_for_lose_some_and_no_more() {
    const TOO_MANY: u8 = 10;
    let mut bench = CanBench::with_packs(&[pack(Pack::First)]);
    let nodes = 20..20 + MAX_NODES as u8 + TOO_MANY;
    let all: Vec<Vec<CanFrame>> = nodes.map(|node| Battery::new(node, 0).frames(0)).collect();
    receive_interleaved(&mut bench, &all);
    assert_eq!(bench.can.lost_transfers(), TOO_MANY.into());
    bench.receive(&frames(golden::BATTERY_INFO));
    bench.receive(all.last().unwrap());
    assert_eq!(bench.can.lost_transfers(), TOO_MANY.into());
}

#[test]
fn frames_of_cyphal_are_left_out() {
    let mut bench = CanBench::with_packs(&[]);
    // Its transfers start with a set toggle bit (Cyphal specification 1.0, 4.2.2.2).
    bench.receive(&[CanFrame::new(0x1801_552a, &[0, 0, 0, 0, 0, 0, 0, 0xe1]).unwrap()]);
    assert_eq!(bench.events, []);
}

#[test]
// Requirement: R-10
fn hardware_lets_everything_through_that_is_used() {
    for own_id in [Some(10), None] {
        let bench = CanBench::new(setup(own_id), &[]);
        let accepted = bench.can.acceptance();
        let has_both_buffers = |frame: &CanFrame| accepted.first.pass(frame.id());
        let is_let_through = |frame: &CanFrame| has_both_buffers(frame) || accepted.second.pass(frame.id());
        for golden in [golden::BATTERY_INFO, golden::BATTERY_AUX, golden::CONTROLLER] {
            assert!(frames(golden).iter().all(has_both_buffers), "{golden:?}");
        }
        let about_ids = [golden::NODE_STATUS, golden::ID_ANSWERS[0], golden::ID_REQUESTS[0]];
        for golden in about_ids.iter().chain([&golden::CHARGER]) {
            assert!(frames(golden).iter().all(is_let_through), "{golden:?}");
        }
        for golden in [golden::NODE_INFO_REQUEST, golden::IS_ON] {
            assert_eq!(frames(golden).iter().all(is_let_through), own_id.is_some());
        }
        // `uavcan.equipment.esc.RawCommand` and a request to node 11.
        for id in [0x0804_060a, 0x1e01_8b7f] {
            assert!(!is_let_through(&CanFrame::new(id, &[]).unwrap()));
        }
    }
}

/// Frames whose identifiers and last bytes are likely to mean something.
fn likely_frame() -> impl Strategy<Value = CanFrame> {
    let type_id = prop::sample::select(vec![1u32, 341, 1034, 1092, 20004, 20009]);
    let message = (type_id, 0u32..128).prop_map(|(type_id, source)| type_id << 8 | source);
    let service = (
        prop::sample::select(vec![1u32, 240]),
        0u32..2,
        8u32..12,
        0u32..128,
    )
        .prop_map(|(type_id, request, destination, source)| {
            type_id << 16 | request << 15 | destination << 8 | 1 << 7 | source
        });
    let id = prop_oneof![message, service, 0u32..1 << 29];
    let tail = prop_oneof![
        prop::sample::select(vec![0x80u8, 0x20, 0x00, 0x40, 0x60, 0xc0]),
        any::<u8>()
    ];
    (id, prop::collection::vec(any::<u8>(), 0..8), tail).prop_map(|(id, mut data, tail)| {
        data.push(tail);
        CanFrame::new(id, &data).expect("a frame")
    })
}

/// Transfers of all devices in a period: batteries of a pack that takes any and of one that names its own, with their
/// cells, controllers, a charger, a thermometer, and what their nodes report. Their values differ from those of the
/// period before.
fn period(number: u8) -> Vec<Vec<CanFrame>> {
    let temperature = [1, 0, number, 0x5c, 0];
    let batteries = [(40, 3), (41, 7)].map(|(node, battery_id)| Battery {
        voltage_v: f32::from(node - 28) + f32::from(number) / 8.0,
        current_a: number.into(),
        charge_pct: 50 - number,
        ..Battery::new(node, battery_id)
    });
    let of_batteries = batteries.into_iter().flat_map(|battery| {
        let cell_v = 3.0 + f32::from(number) / 64.0;
        [
            status(battery.node, number.into(), 0),
            battery.frames(number),
            battery.aux(&[cell_v; 3], 11.0),
        ]
    });
    let others = [
        controller(50, number, number),
        controller(51, 2 * number, number),
        message(60, TEMPERATURE, DataType::Temperature, number, &temperature),
        charger(33, number),
    ];
    of_batteries.chain(others).collect()
}

/// Failure of a bus in one period.
#[derive(Clone, Copy, Debug)]
enum BusFailure {
    Drop,
    Repeat,
    Swap,
    /// Bits of one byte of the data, or of the identifier.
    Corrupt(u8, Index),
}

impl BusFailure {
    /// At one frame, or at one transfer.
    fn apply(
        self,
        transfers: Vec<Vec<CanFrame>>,
        is_of_frame: bool,
        at: Index,
        other: Index,
    ) -> Vec<CanFrame> {
        let mut parts: Vec<Vec<CanFrame>> = if is_of_frame {
            transfers.into_iter().flatten().map(|frame| vec![frame]).collect()
        } else {
            transfers
        };
        let place = at.index(parts.len());
        match self {
            Self::Drop => drop(parts.remove(place)),
            Self::Repeat => parts.insert(other.index(parts.len()), parts[place].clone()),
            Self::Swap => {
                let other = other.index(parts.len());
                parts.swap(place, other);
            }
            Self::Corrupt(mask, byte) => {
                for frame in &mut parts[place] {
                    *frame = corrupted(frame, mask, byte);
                }
            }
        }
        parts.concat()
    }
}

fn corrupted(frame: &CanFrame, mask: u8, byte: Index) -> CanFrame {
    const ID_BYTES: usize = 4;
    let mut bytes = [&frame.id().to_be_bytes(), frame.data()].concat();
    let place = byte.index(bytes.len());
    bytes[place] ^= mask;
    let (id, data) = bytes.split_at(ID_BYTES);
    let id = u32::from_be_bytes(id.try_into().expect("four bytes"));
    CanFrame::new(id & 0x1fff_ffff, data).expect("a frame")
}

proptest! {
    /// Three periods after any failure of the bus all readings are those of a bus that never failed.
    #[test]
    fn readings_recover_from_a_failure_of_the_bus(
        failed_period in 0u8..12,
        is_of_frame: bool,
        failure in prop_oneof![
            Just(BusFailure::Drop),
            Just(BusFailure::Repeat),
            Just(BusFailure::Swap),
            (1u8.., any::<Index>()).prop_map(|(mask, byte)| BusFailure::Corrupt(mask, byte)),
        ],
        at: Index,
        other: Index,
    ) {
        let named = CanPack { battery_id: Some(7), ..pack(Pack::Second) };
        let packs = [pack(Pack::First), named, pack(Pack::Third)];
        let [mut failing, mut healthy] = [0; 2].map(|_| CanBench::with_packs(&packs));
        for number in 0..16 {
            let transfers = period(number);
            let received = transfers.concat();
            healthy.receive(&received);
            if number == failed_period {
                failing.receive(&failure.apply(transfers, is_of_frame, at, other));
            } else {
                failing.receive(&received);
            }
            let [readings, expected] = [&mut failing, &mut healthy].map(|bench| {
                bench.run_ms(1000);
                let mut events = core::mem::take(&mut bench.events);
                events.retain(|event| !matches!(event, CanEvent::Announce(_)));
                events
            });
            // Both batteries, both controllers, the thermometer, and the charger after 10 s.
            prop_assert_eq!(expected.len(), if number < 10 { 5 } else { 6 });
            if number >= failed_period + 3 {
                prop_assert_eq!(readings, expected, "period {}", number);
            }
        }
    }

    #[test]
    fn interleaved_transfers_are_all_read(order in prop::collection::vec(0usize..3, 40)) {
        let mut bench = three_packs();
        let mut waiting = BATTERIES.map(|battery| battery.frames(3).into_iter());
        for next in order.into_iter().chain((0..3).flat_map(|next| [next; 10])) {
            let frame: Vec<CanFrame> = waiting[next].next().into_iter().collect();
            bench.receive(&frame);
        }
        let mut voltages = bench.take_voltages();
        voltages.sort_by_key(|(pack, _)| *pack);
        prop_assert_eq!(voltages, VOLTAGES);
        prop_assert_eq!(bench.can.lost_transfers(), 0);
    }

    /// Frames of three nodes, some of them lost or repeated, with any others between them.
    #[test]
    fn no_reading_is_wrong(
        steps in prop::collection::vec((0usize..3, 0u8..10, likely_frame()), 1..200),
    ) {
        let mut bench = three_packs();
        let batteries = BATTERIES;
        let mut transfers = batteries.map(|battery| battery.frames(0));
        let mut places = [0usize; 3];
        for (place, (source, what, other)) in steps.into_iter().enumerate() {
            let frame = transfers[source][places[source]];
            match what {
                0 => {}
                1 => bench.receive(&[frame, frame]),
                // Of nodes that have none of these batteries.
                2 if other.id() & 0x7f < 40 || other.id() & 0x7f > 42 => bench.receive(&[other]),
                _ => bench.receive(&[frame]),
            }
            places[source] += 1;
            if places[source] == transfers[source].len() {
                places[source] = 0;
                transfers[source] = batteries[source].frames(place as u8);
            }
        }
        for (pack, reading) in bench.take_readings() {
            prop_assert!(VOLTAGES.contains(&(pack, reading.voltage_v.unwrap())));
        }
    }

    #[test]
    fn any_frames_are_survived(
        all in prop::collection::vec((likely_frame(), 0u64..300), 0..300),
        own_id in prop_oneof![Just(None), Just(Some(10))],
        place: Index,
    ) {
        let mut bench = CanBench::new(setup(own_id), &[pack(Pack::First), pack(Pack::Second)]);
        let last = place.index(all.len() + 1);
        for (frame, pause_ms) in &all[..last] {
            bench.receive(&[*frame]);
            bench.run_ms(*pause_ms);
            bench.sent();
        }
        for event in &bench.events {
            if let CanEvent::Controller(index, reading) = event {
                prop_assert!(*index < 32);
                let values = [reading.voltage_v, reading.current_a, reading.temperature_c];
                prop_assert!(values.iter().flatten().all(|value| value.is_finite()));
            }
        }
    }

    /// What waits to be sent is bounded, and whole transfers are dropped.
    #[test]
    fn flood_of_requests_is_bounded(count in 1usize..40) {
        let mut bench = CanBench::with_packs(&[]);
        bench.sent();
        for _ in 0..count {
            bench.receive(&frames(golden::NODE_INFO_REQUEST));
        }
        let answers = count.min(2);
        prop_assert_eq!(bench.sent().len(), 9 * answers);
        prop_assert_eq!(bench.can.dropped_transfers() as usize, count - answers);
    }
}
