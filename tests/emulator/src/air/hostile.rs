//! Traffic of strangers who mean no good, or of a network that is not well. The seed decides all of it.

use std::net::Ipv4Addr;

use smoltcp::phy::ChecksumCapabilities;
use smoltcp::wire::{
    ArpOperation, ArpPacket, ArpRepr, DHCP_CLIENT_PORT, DHCP_SERVER_PORT, DhcpMessageType, DhcpPacket,
    DhcpRepr, EthernetAddress, EthernetFrame, EthernetProtocol, EthernetRepr, IpAddress, IpProtocol,
    Ipv4Packet, Ipv4Repr, TcpControl, TcpPacket, TcpRepr, TcpSeqNumber, UdpPacket, UdpRepr,
};

use super::radio::MacAddress;
use crate::Random;

/// What an Ethernet frame carries at most.
const LONGEST_PAYLOAD: usize = 1500;

const IP_HEADER_BYTES: usize = 20;
const UDP_HEADER_BYTES: usize = 8;
const HEADERS_BYTES: usize = IP_HEADER_BYTES + UDP_HEADER_BYTES;

/// Ports of the board, and one that it does not have.
const UDP_PORTS: [u16; 4] = [14550, 67, 68, 9];
const TCP_PORTS: [u16; 2] = [5760, 80];

const EVERYONE: MacAddress = [0xff; 6];

/// The station that it is meant for.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    pub mac: MacAddress,
    pub address: Ipv4Addr,
}

impl Target {
    pub fn new(mac: MacAddress, address: Ipv4Addr) -> Self {
        Self { mac, address }
    }
}

/// What a frame is like.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Hostility {
    /// A whole datagram of 0 to 1472 bytes that mean nothing.
    Datagram,
    /// A fragment of a datagram whose others never come.
    Fragment,
    /// A datagram whose IP or UDP checksum is wrong.
    WrongChecksum,
    /// An ARP request or answer from an address that there is not.
    Arp,
    /// A broadcast of a station that talks to others.
    Broadcast,
    /// The first segment of a connection that is never completed.
    Syn,
    /// A client that asks for an address and is never seen again.
    Dhcp,
    /// A frame of any kind that ends too early.
    Truncated,
}

impl Hostility {
    pub const ALL: [Self; 8] = [
        Self::Datagram,
        Self::Fragment,
        Self::WrongChecksum,
        Self::Arp,
        Self::Broadcast,
        Self::Syn,
        Self::Dhcp,
        Self::Truncated,
    ];
}

pub struct Hostile {
    random: Random,
    target: Target,
    kinds: Vec<Hostility>,
}

impl Hostile {
    /// Of all kinds.
    pub fn new(seed: u64, target: Target) -> Self {
        Self::of_kinds(seed, target, &Hostility::ALL)
    }

    /// Of some kinds. Panics later if there are none.
    pub fn of_kinds(seed: u64, target: Target, kinds: &[Hostility]) -> Self {
        Self {
            random: Random::new(seed),
            target,
            kinds: kinds.to_vec(),
        }
    }

    /// The next Ethernet frame.
    pub fn frame(&mut self) -> Vec<u8> {
        let kind = self.random.pick(&self.kinds);
        self.frame_of(kind)
    }

    fn frame_of(&mut self, kind: Hostility) -> Vec<u8> {
        match kind {
            Hostility::Datagram => self.datagram(self.target.mac, self.target.address),
            Hostility::Fragment => self.fragment(),
            Hostility::WrongChecksum => self.wrong_checksum(),
            Hostility::Arp => self.arp(),
            Hostility::Broadcast => self.datagram(EVERYONE, Ipv4Addr::BROADCAST),
            Hostility::Syn => self.syn(),
            Hostility::Dhcp => self.dhcp(),
            Hostility::Truncated => self.truncated(),
        }
    }

    /// Of a stranger that was not there before, mostly. The addresses are of the upper half of the network: ARP believes a
    /// stranger that claims the address of another station, and no network stack could help it.
    fn stranger(&mut self) -> (MacAddress, Ipv4Addr) {
        let [a, b, c, ..] = self.random.next_u64().to_le_bytes();
        let [first, second, third, _] = self.target.address.octets();
        let fourth = 128 + self.random.below(127) as u8;
        ([2, 0, 0xbd, a, b, c], Ipv4Addr::new(first, second, third, fourth))
    }

    fn noise(&mut self, length: usize) -> Vec<u8> {
        let mut bytes = vec![0; length];
        self.random.fill(&mut bytes);
        bytes
    }

    fn datagram(&mut self, to_mac: MacAddress, to: Ipv4Addr) -> Vec<u8> {
        let length = self.random.below(LONGEST_PAYLOAD - HEADERS_BYTES + 1);
        let (mac, from) = self.stranger();
        let repr = UdpRepr {
            src_port: self.random.next_u64() as u16,
            dst_port: self.random.pick(&UDP_PORTS),
        };
        let content = self.noise(length);
        ethernet(
            mac,
            to_mac,
            EthernetProtocol::Ipv4,
            &udp(from, to, repr, &content),
        )
    }

    fn aimed_datagram(&mut self) -> Vec<u8> {
        self.datagram(self.target.mac, self.target.address)
    }

    fn fragment(&mut self) -> Vec<u8> {
        let mut frame = self.aimed_datagram();
        let mut ip = ip_in(&mut frame);
        ip.set_dont_frag(false);
        ip.set_ident(self.random.next_u64() as u16);
        let is_first = self.random.below(2) == 0;
        let eighths = if is_first {
            0
        } else {
            1 + self.random.below(8191) as u16
        };
        ip.set_frag_offset(eighths * 8);
        ip.set_more_frags(is_first || self.random.below(2) == 0);
        ip.fill_checksum();
        frame
    }

    fn wrong_checksum(&mut self) -> Vec<u8> {
        let mut frame = self.aimed_datagram();
        let mut ip = ip_in(&mut frame);
        if self.random.below(2) == 0 {
            ip.set_checksum(!ip.checksum());
        } else {
            let mut udp = UdpPacket::new_unchecked(ip.payload_mut());
            // 0 would mean that there is none, and 0xffff is as good as 0.
            let wrong = (udp.checksum() ^ 0x5555).max(1);
            udp.set_checksum(wrong);
        }
        frame
    }

    fn arp(&mut self) -> Vec<u8> {
        let (mac, address) = self.stranger();
        let repr = ArpRepr::EthernetIpv4 {
            operation: self.random.pick(&[ArpOperation::Request, ArpOperation::Reply]),
            source_hardware_addr: EthernetAddress(mac),
            source_protocol_addr: address,
            target_hardware_addr: EthernetAddress(self.target.mac),
            target_protocol_addr: self.target.address,
        };
        let mut bytes = vec![0; repr.buffer_len()];
        repr.emit(&mut ArpPacket::new_unchecked(&mut bytes));
        ethernet(mac, EVERYONE, EthernetProtocol::Arp, &bytes)
    }

    fn syn(&mut self) -> Vec<u8> {
        let (mac, from) = self.stranger();
        let repr = TcpRepr {
            src_port: self.random.next_u64() as u16 | 1,
            dst_port: self.random.pick(&TCP_PORTS),
            control: TcpControl::Syn,
            seq_number: TcpSeqNumber(self.random.next_u64() as i32),
            ack_number: None,
            window_len: 1024,
            window_scale: None,
            max_seg_size: Some(1460),
            sack_permitted: false,
            sack_ranges: [None; 3],
            timestamp: None,
            payload: &[],
        };
        let to = self.target.address;
        let mut bytes = vec![0; repr.buffer_len()];
        let mut packet = TcpPacket::new_unchecked(&mut bytes[..]);
        repr.emit(
            &mut packet,
            &IpAddress::Ipv4(from),
            &IpAddress::Ipv4(to),
            &checked(),
        );
        ethernet(
            mac,
            self.target.mac,
            EthernetProtocol::Ipv4,
            &ip(from, to, IpProtocol::Tcp, &bytes),
        )
    }

    fn dhcp(&mut self) -> Vec<u8> {
        let (mac, _) = self.stranger();
        let nowhere = Ipv4Addr::UNSPECIFIED;
        let repr = DhcpRepr {
            message_type: self
                .random
                .pick(&[DhcpMessageType::Discover, DhcpMessageType::Request]),
            transaction_id: self.random.next_u64() as u32,
            secs: 0,
            client_hardware_address: EthernetAddress(mac),
            client_ip: nowhere,
            your_ip: nowhere,
            server_ip: nowhere,
            router: None,
            subnet_mask: None,
            relay_agent_ip: nowhere,
            broadcast: true,
            requested_ip: None,
            client_identifier: Some(EthernetAddress(mac)),
            server_identifier: None,
            parameter_request_list: None,
            dns_servers: None,
            max_size: None,
            lease_duration: None,
            renew_duration: None,
            rebind_duration: None,
            additional_options: &[],
        };
        let mut bytes = vec![0; repr.buffer_len()];
        repr.emit(&mut DhcpPacket::new_unchecked(&mut bytes))
            .expect("room");
        let ports = UdpRepr {
            src_port: DHCP_CLIENT_PORT,
            dst_port: DHCP_SERVER_PORT,
        };
        let packet = udp(nowhere, Ipv4Addr::BROADCAST, ports, &bytes);
        ethernet(mac, EVERYONE, EthernetProtocol::Ipv4, &packet)
    }

    fn truncated(&mut self) -> Vec<u8> {
        let whole = [
            Hostility::Datagram,
            Hostility::Arp,
            Hostility::Syn,
            Hostility::Dhcp,
        ];
        let kind = self.random.pick(&whole);
        let mut frame = self.frame_of(kind);
        frame.truncate(self.random.below(frame.len()));
        frame
    }
}

fn checked() -> ChecksumCapabilities {
    ChecksumCapabilities::default()
}

fn ip_in(frame: &mut [u8]) -> Ipv4Packet<&mut [u8]> {
    Ipv4Packet::new_unchecked(&mut frame[EthernetFrame::<&[u8]>::header_len()..])
}

fn udp(from: Ipv4Addr, to: Ipv4Addr, ports: UdpRepr, content: &[u8]) -> Vec<u8> {
    let mut bytes = vec![0; UDP_HEADER_BYTES + content.len()];
    ports.emit(
        &mut UdpPacket::new_unchecked(&mut bytes[..]),
        &IpAddress::Ipv4(from),
        &IpAddress::Ipv4(to),
        content.len(),
        |payload| payload.copy_from_slice(content),
        &checked(),
    );
    ip(from, to, IpProtocol::Udp, &bytes)
}

fn ip(src_addr: Ipv4Addr, dst_addr: Ipv4Addr, next_header: IpProtocol, content: &[u8]) -> Vec<u8> {
    let repr = Ipv4Repr {
        src_addr,
        dst_addr,
        next_header,
        payload_len: content.len(),
        hop_limit: 64,
    };
    let mut bytes = vec![0; repr.buffer_len()];
    repr.emit(&mut Ipv4Packet::new_unchecked(&mut bytes), &checked());
    bytes.extend(content);
    bytes
}

fn ethernet(from: MacAddress, to: MacAddress, ethertype: EthernetProtocol, content: &[u8]) -> Vec<u8> {
    let repr = EthernetRepr {
        src_addr: EthernetAddress(from),
        dst_addr: EthernetAddress(to),
        ethertype,
    };
    let mut frame = vec![0; repr.buffer_len()];
    repr.emit(&mut EthernetFrame::new_unchecked(&mut frame));
    frame.extend(content);
    frame
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;
    use std::net::SocketAddrV4;

    use smoltcp::wire::Ipv4Cidr;

    use super::*;
    use crate::air::computer::Computer;
    use crate::air::echo::{ECHO_PORT, Echo};

    const BOARD: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1);

    fn target() -> Target {
        Target::new([2, 0, 0, 0, 0, 1], BOARD)
    }

    fn frames_of(kind: Hostility, count: usize) -> Vec<Vec<u8>> {
        let mut hostile = Hostile::of_kinds(1, target(), &[kind]);
        (0..count).map(|_| hostile.frame()).collect()
    }

    fn ip_of(frame: &[u8]) -> Ipv4Packet<&[u8]> {
        Ipv4Packet::new_checked(&frame[14..]).expect("an IP packet")
    }

    /// Whether both checksums are right.
    fn is_sound(frame: &[u8]) -> bool {
        let ip = ip_of(frame);
        let (from, to) = (IpAddress::Ipv4(ip.src_addr()), IpAddress::Ipv4(ip.dst_addr()));
        ip.verify_checksum()
            && UdpPacket::new_checked(ip.payload())
                .unwrap()
                .verify_checksum(&from, &to)
    }

    #[test]
    fn a_seed_decides_all_frames() {
        let draw = |seed| {
            let mut hostile = Hostile::new(seed, target());
            (0..100).map(|_| hostile.frame()).collect::<Vec<_>>()
        };
        assert_eq!(draw(1), draw(1));
        assert_ne!(draw(1), draw(2));
    }

    #[test]
    fn datagrams_have_all_sizes_and_are_sound() {
        for kind in [Hostility::Datagram, Hostility::Broadcast] {
            let frames = frames_of(kind, 20_000);
            assert!(frames.iter().all(|frame| is_sound(frame)));
            let sizes: BTreeSet<_> = frames.iter().map(|frame| frame.len() - 14).collect();
            assert_eq!(
                (sizes.first(), sizes.last()),
                (Some(&28), Some(&1500)),
                "{kind:?}"
            );
        }
    }

    #[test]
    fn every_frame_is_what_its_kind_says() {
        assert!(
            frames_of(Hostility::WrongChecksum, 1000)
                .iter()
                .all(|frame| !is_sound(frame))
        );
        let fragments = frames_of(Hostility::Fragment, 1000);
        assert!(
            fragments
                .iter()
                .all(|frame| ip_of(frame).more_frags() || ip_of(frame).frag_offset() > 0)
        );
        assert!(fragments.iter().any(|frame| ip_of(frame).frag_offset() == 0));
        let is_syn = |frame: &Vec<u8>| TcpPacket::new_checked(ip_of(frame).payload()).unwrap().syn();
        assert!(frames_of(Hostility::Syn, 1000).iter().all(is_syn));
        let is_arp = |frame: &Vec<u8>| ArpPacket::new_checked(&frame[14..]).is_ok();
        assert!(frames_of(Hostility::Arp, 1000).iter().all(is_arp));
        let is_dhcp = |frame: &Vec<u8>| DhcpPacket::new_checked(&ip_of(frame).payload()[8..]).is_ok();
        assert!(frames_of(Hostility::Dhcp, 1000).iter().all(is_dhcp));
        assert!(frames_of(Hostility::Truncated, 1000).iter().any(Vec::is_empty));
    }

    #[test]
    fn they_come_from_many_stations() {
        for kind in [Hostility::Arp, Hostility::Dhcp, Hostility::Syn] {
            let senders: BTreeSet<_> = frames_of(kind, 1000)
                .iter()
                .map(|frame| frame[6..12].to_vec())
                .collect();
            assert!(senders.len() > 990, "{kind:?}: {}", senders.len());
        }
    }

    #[test]
    fn a_sound_stack_serves_its_station_meanwhile() {
        let mut echo = Echo::new(Ipv4Cidr::new(BOARD, 24));
        let mut computer = Computer::new([2, 0, 0, 0, 0, 9]);
        computer.set_address(Some(Ipv4Cidr::new(Ipv4Addr::new(192, 168, 4, 9), 24)));
        let port = computer.bind_udp(14550);
        let mut hostile = Hostile::new(1, Target::new(echo.computer.mac(), BOARD));
        let mut echoed = 0;
        for now_ms in 0..20_000 {
            if now_ms % 10 == 0 {
                echo.computer.receive(&hostile.frame());
            }
            if now_ms % 100 == 0 {
                computer.send_to(port, b"still there?", SocketAddrV4::new(BOARD, ECHO_PORT));
            }
            for frame in computer.poll(now_ms * 1000) {
                echo.computer.receive(&frame);
            }
            for frame in echo.poll(now_ms * 1000) {
                computer.receive(&frame);
            }
            echoed += computer.take_datagrams(port).len();
        }
        assert_eq!(echoed, 200);
    }
}
