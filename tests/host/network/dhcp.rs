//! Addresses for phones.

use std::net::Ipv4Addr;

use leasehund::{DhcpConfig, DhcpServer};
use rover_battmon::net::{NetReport, Role};
use smoltcp::iface::SocketHandle;
use smoltcp::socket::udp;
use smoltcp::wire::{IpAddress, Ipv4Cidr};

use super::phone::{BOARD, Phone};
use super::room::{Room, play};
use support::frames::HEARTBEAT;
use support::requests;

#[test]
fn phones_get_an_address_and_are_found_one_after_the_other() {
    play(Role::AccessPoint, async |room| {
        let mut phones = [2, 3].map(|number| Phone::without_address(&room.air, number));
        let asked = phones.each_mut().map(Phone::ask_for_address);
        let [one, two] = &mut phones;
        room.pass(3_000, &mut [one, two]).await;
        let addresses = [0, 1].map(|index| phones[index].take_address(asked[index]).expect("one was given"));
        let mut given = addresses.each_ref().map(|config| config.address);
        given.sort();
        assert_eq!(
            given,
            [2, 3].map(|number| Ipv4Cidr::new(Ipv4Addr::new(192, 168, 4, number), 24))
        );
        assert!(addresses.iter().all(|config| config.router.is_none()));

        let stations = phones.each_mut().map(|phone| phone.listen(14550));
        let [one, two] = &mut phones;
        room.pass(2_000, &mut [one, two]).await;
        one.send(stations[0], &requests::heartbeat(requests::GCS));
        room.pass(100, &mut [one, two]).await;
        let _ = two.received_frames(stations[1]);
        room.pass(3_000, &mut [one, two]).await;
        let found = two.received_frames(stations[1]);
        assert_eq!(found.len(), 3, "one a second, now by unicast");
        assert!(found.iter().all(|frame| frame.message_id == HEARTBEAT));
        let connected = one.received_frames(stations[0]);
        for (before, after) in connected.iter().zip(&connected[1..]) {
            assert_eq!(
                after.sequence,
                before.sequence.wrapping_add(1),
                "it hears its own link only"
            );
        }
        two.send(stations[1], &requests::heartbeat(requests::GCS));
        room.pass(2_000, &mut [one, two]).await;
        assert!(two.received_frames(stations[1]).len() > 10);
        assert_eq!(
            *room.reports.borrow(),
            [NetReport::AddressObtained([192, 168, 4, 1])]
        );
    });
}

/// A message of a DHCP client with this hardware address (RFC 2131), about this address.
fn message_of(client: [u8; 6], kind: u8, address: Ipv4Addr) -> Vec<u8> {
    let mut message = vec![0; 240];
    message[..4].copy_from_slice(&[1, 1, 6, 0]);
    message[28..34].copy_from_slice(&client);
    message[236..].copy_from_slice(&[0x63, 0x82, 0x53, 0x63]);
    message.extend([53, 1, kind, 50, 4]);
    message.extend(address.octets());
    message.push(255);
    message
}

/// Sends messages to the DHCP server, which may be about another computer.
async fn send_to_server(room: &Room<'_>, guest: &mut Phone, messages: impl IntoIterator<Item = Vec<u8>>) {
    let client = guest.listen(68);
    for message in messages {
        let socket = guest.sockets.get_mut::<udp::Socket>(client);
        socket
            .send_slice(&message, (IpAddress::Ipv4(*BOARD.ip()), 67))
            .expect("there is room for it");
        room.pass(20, &mut [guest]).await;
    }
}

#[test]
fn a_guest_does_not_release_the_address_of_the_driver() {
    const RELEASE: u8 = 7;
    play(Role::AccessPoint, async |room| {
        let (mut driver, mut guest) = (room.phone(2).await, room.phone(3).await);
        let station = driver.listen(14550);
        driver.send(station, &requests::heartbeat(requests::GCS));
        room.pass(500, &mut [&mut driver]).await;
        let released = message_of(driver.mac, RELEASE, Ipv4Addr::new(192, 168, 4, 2));
        send_to_server(room, &mut guest, [released]).await;
        for second in 0..30 {
            let _ = driver.received_frames(station);
            driver.send(station, &requests::heartbeat(requests::GCS));
            room.pass(1_000, &mut [&mut driver, &mut guest]).await;
            // HEARTBEAT, and SYS_STATUS twice.
            assert!(driver.received_frames(station).len() >= 3, "second {second}");
        }
    });
}

#[test]
fn a_guest_that_declines_every_address_withholds_none() {
    const DECLINE: u8 = 4;
    play(Role::AccessPoint, async |room| {
        let mut guest = room.phone(2).await;
        let declined = (2..10).map(|last| message_of(guest.mac, DECLINE, Ipv4Addr::new(192, 168, 4, last)));
        let declined: Vec<_> = declined.collect();
        send_to_server(room, &mut guest, declined).await;
        for number in 3..11 {
            let mut phone = Phone::without_address(&room.air, number);
            let asked = phone.ask_for_address();
            room.pass(3_000, &mut [&mut phone]).await;
            assert!(phone.take_address(asked).is_some(), "phone {number}");
        }
    });
}

/// A router that gives addresses.
struct Router {
    phone: Phone,
    socket: SocketHandle,
    server: DhcpServer<8, 0, 0, 0>,
}

impl Router {
    fn new(room: &Room<'_>) -> Self {
        let mut phone = Phone::new(&room.air, 254);
        Self {
            socket: phone.listen(67),
            phone,
            server: DhcpServer::with_config(DhcpConfig {
                server_ip: Ipv4Addr::new(192, 168, 4, 254),
                subnet_mask: Ipv4Addr::new(255, 255, 255, 0),
                router: None,
                dns_servers: Default::default(),
                ip_pool_start: Ipv4Addr::new(192, 168, 4, 77),
                ip_pool_end: Ipv4Addr::new(192, 168, 4, 80),
                lease_time: 60,
                domain_name: None,
            }),
        }
    }

    async fn serve(&mut self, room: &Room<'_>, ms: u64) {
        for _ in 0..ms {
            for request in self.phone.received(self.socket) {
                let now_ms = request.at_us / 1_000;
                let outcome = self.server.handle_packet(&request.bytes, now_ms, |_, _| true);
                if let Some(reply) = outcome.reply {
                    let to = reply.destination();
                    let socket = self.phone.sockets.get_mut::<udp::Socket>(self.socket);
                    let sent = socket.send_slice(reply.bytes(), (IpAddress::Ipv4(*to.ip()), to.port()));
                    sent.expect("there is room for it");
                }
            }
            room.pass(1, &mut [&mut self.phone]).await;
        }
    }
}

#[test]
fn a_network_without_addresses_is_reported_once_and_asked_again() {
    play(Role::Station, async |room| {
        room.pass(29_000, &mut []).await;
        assert!(room.reports.borrow().is_empty());
        room.pass(60_000, &mut []).await;
        assert_eq!(*room.reports.borrow(), [NetReport::NoAddress]);
        let mut router = Router::new(room);
        router.serve(room, 60_000).await;
        let obtained = NetReport::AddressObtained([192, 168, 4, 77]);
        assert_eq!(room.reports.borrow()[1..], [obtained]);
        // It is found there, too.
        let station = router.phone.listen(14550);
        router.serve(room, 3_000).await;
        assert_eq!(router.phone.received_frames(station).len(), 3);
    });
}

#[test]
fn a_lease_is_renewed_until_the_server_is_gone() {
    play(Role::Station, async |room| {
        let mut router = Router::new(room);
        router.serve(room, 200_000).await;
        let obtained = NetReport::AddressObtained([192, 168, 4, 77]);
        assert_eq!(*room.reports.borrow(), [obtained], "through three leases");
        drop(router);
        room.pass(120_000, &mut []).await;
        assert_eq!(
            *room.reports.borrow(),
            [obtained, NetReport::AddressLost, NetReport::NoAddress]
        );
    });
}
