//! Ping, the first thing to try when looking for a fault.

use rover_battmon::net::Role;
use smoltcp::phy::ChecksumCapabilities;
use smoltcp::wire::{
    EthernetAddress, EthernetFrame, EthernetProtocol, EthernetRepr, Icmpv4Packet, Icmpv4Repr, IpProtocol,
    Ipv4Packet, Ipv4Repr,
};

use super::air::BOARD_MAC;
use super::phone::{BOARD, Phone};
use super::room::play;
use support::requests;

const QUESTION: Icmpv4Repr<'static> = Icmpv4Repr::EchoRequest {
    ident: 7,
    seq_no: 3,
    data: b"is there anyone",
};

fn echo_request(phone: &Phone) -> Vec<u8> {
    let ethernet = EthernetRepr {
        src_addr: EthernetAddress(phone.mac),
        dst_addr: EthernetAddress(BOARD_MAC),
        ethertype: EthernetProtocol::Ipv4,
    };
    let ip = Ipv4Repr {
        src_addr: phone.address().expect("it has one"),
        dst_addr: *BOARD.ip(),
        next_header: IpProtocol::Icmp,
        payload_len: QUESTION.buffer_len(),
        hop_limit: 64,
    };
    let checksums = ChecksumCapabilities::default();
    let mut frame = vec![0; ethernet.buffer_len() + ip.buffer_len() + QUESTION.buffer_len()];
    let mut ethernet_frame = EthernetFrame::new_unchecked(&mut frame[..]);
    ethernet.emit(&mut ethernet_frame);
    let mut packet = Ipv4Packet::new_unchecked(ethernet_frame.payload_mut());
    ip.emit(&mut packet, &checksums);
    QUESTION.emit(&mut Icmpv4Packet::new_unchecked(packet.payload_mut()), &checksums);
    frame
}

/// Whether the frame is the answer.
fn is_answer(frame: &[u8]) -> bool {
    let ethernet = EthernetFrame::new_unchecked(frame);
    let Ok(packet) = Ipv4Packet::new_checked(ethernet.payload()) else {
        return false;
    };
    let Ok(message) = Icmpv4Packet::new_checked(packet.payload()) else {
        return false;
    };
    let answer = Icmpv4Repr::parse(&message, &ChecksumCapabilities::default());
    let expected = Icmpv4Repr::EchoReply {
        ident: 7,
        seq_no: 3,
        data: b"is there anyone",
    };
    packet.next_header() == IpProtocol::Icmp && answer == Ok(expected)
}

#[test]
fn a_phone_with_an_address_gets_an_answer_to_its_ping() {
    play(Role::AccessPoint, async |room| {
        let mut phone = room.phone(2).await;
        let socket = phone.listen(9_000);
        // The board knows its hardware address then.
        phone.send(socket, &requests::heartbeat(requests::GCS));
        room.pass(1_000, &mut [&mut phone]).await;
        room.air.borrow_mut().send_to_board(echo_request(&phone));
        room.pass(100, &mut []).await;
        let frames: Vec<Vec<u8>> = std::iter::from_fn(|| room.air.borrow_mut().next_for(phone.mac)).collect();
        assert_eq!(frames.iter().filter(|frame| is_answer(frame)).count(), 1);
    });
}
