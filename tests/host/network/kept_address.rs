//! Phones that keep their address while the board restarts, and who would like to have it.

use std::net::Ipv4Addr;

use embassy_time::{Instant, Timer};
use rover_battmon::net::Role;
use smoltcp::iface::SocketHandle;
use smoltcp::wire::{
    ArpOperation, ArpPacket, ArpRepr, EthernetAddress, EthernetFrame, EthernetProtocol, EthernetRepr,
    Ipv4Cidr,
};

use super::phone::{BOARD, Phone};
use super::room::{Room, play};
use support::requests;

fn address(last: u8) -> Ipv4Addr {
    Ipv4Addr::new(192, 168, 4, last)
}

fn mac(number: u16) -> [u8; 6] {
    let [high, low] = number.to_be_bytes();
    [2, 0, 0, 0, high, low]
}

/// Asks in ARP for the board.
fn who_is_the_board(mac: [u8; 6], address: Ipv4Addr) -> Vec<u8> {
    let ethernet = EthernetRepr {
        src_addr: EthernetAddress(mac),
        dst_addr: EthernetAddress::BROADCAST,
        ethertype: EthernetProtocol::Arp,
    };
    let question = ArpRepr::EthernetIpv4 {
        operation: ArpOperation::Request,
        source_hardware_addr: EthernetAddress(mac),
        source_protocol_addr: address,
        target_hardware_addr: EthernetAddress([0; 6]),
        target_protocol_addr: *BOARD.ip(),
    };
    let mut frame = vec![0; ethernet.buffer_len() + question.buffer_len()];
    let mut ethernet_frame = EthernetFrame::new_unchecked(&mut frame[..]);
    ethernet.emit(&mut ethernet_frame);
    question.emit(&mut ArpPacket::new_unchecked(ethernet_frame.payload_mut()));
    frame
}

/// Whether the board answers a computer with this address.
async fn is_heard(room: &Room<'_>, mac: [u8; 6], address: Ipv4Addr) -> bool {
    room.air.borrow_mut().join(mac);
    room.air
        .borrow_mut()
        .send_to_board(who_is_the_board(mac, address));
    room.pass(2, &mut []).await;
    let frames: Vec<Vec<u8>> = std::iter::from_fn(|| room.air.borrow_mut().next_for(mac)).collect();
    room.air.borrow_mut().leave(mac);
    let is_answer = |frame: &Vec<u8>| frame[..6] == mac && frame[12..14] == [0x08, 0x06];
    frames.iter().any(is_answer)
}

/// Whether the board serves a phone that sends it a HEARTBEAT, within half a second.
async fn is_served(room: &Room<'_>, phone: &mut Phone) -> bool {
    let station = phone.listen(14550);
    is_station_served(room, phone, station).await
}

async fn is_station_served(room: &Room<'_>, phone: &mut Phone, station: SocketHandle) -> bool {
    let _ = phone.received(station);
    phone.send(station, &requests::heartbeat(requests::GCS));
    room.pass(500, &mut [&mut *phone]).await;
    let received = phone.received_frames(station);
    // Others get a HEARTBEAT each second at most.
    received.len() > 1
}

#[test]
// Requirement: R-8
fn after_power_up_a_phone_keeps_its_address_and_is_heard_at_once() {
    play(Role::AccessPoint, async |room| {
        let mut phone = Phone::new(&room.air, 3);
        assert!(is_served(room, &mut phone).await);
        assert!(
            !is_heard(room, mac(7), address(3)).await,
            "another with its address"
        );
        let mut stranger = Phone::without_address(&room.air, 8);
        stranger.set_address(Ipv4Cidr::new(address(3), 24));
        assert!(!is_served(room, &mut stranger).await);
        let mut others = [room.phone(4).await, room.phone(5).await];
        assert_eq!(
            others.each_ref().map(Phone::address),
            [2, 4].map(|last| Some(address(last)))
        );
        let [one, _] = &mut others;
        assert!(is_served(room, one).await);
    });
}

#[test]
// Requirement: L-19
fn an_address_is_lent_until_ten_minutes_after_the_start() {
    play(Role::AccessPoint, async |room| {
        for (second, is_lent) in [(1, true), (599, true), (600, false)] {
            Timer::at(Instant::from_secs(second)).await;
            assert_eq!(is_heard(room, mac(7), address(9)).await, is_lent, "{second} s");
        }
    });
}

#[test]
// Requirement: L-19
fn strangers_with_every_address_keep_none_from_who_asks_and_push_out_no_lease() {
    play(Role::AccessPoint, async |room| {
        let mut driver = room.phone(2).await;
        let station = driver.listen(14550);
        assert!(is_station_served(room, &mut driver, station).await);
        for number in 0..2_000 {
            let last = 2 + (number % 8) as u8;
            let claim = who_is_the_board(mac(number), address(last));
            room.air.borrow_mut().send_to_board(claim);
            room.pass(1, &mut [&mut driver]).await;
        }
        assert!(is_heard(room, mac(7), address(9)).await, "the first of them");
        for number in 3..10 {
            let phone = room.phone(number).await;
            assert!(
                phone
                    .address()
                    .is_some_and(|address| Some(address) != driver.address())
            );
        }
        assert!(!is_heard(room, mac(7), address(9)).await);
        assert!(is_station_served(room, &mut driver, station).await);
    });
}
