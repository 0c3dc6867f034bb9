//! Addresses for phones.

use std::net::Ipv4Addr;

use leasehund::{DhcpConfig, DhcpServer};
use rover_battmon::net::{NetReport, Role};
use smoltcp::iface::SocketHandle;
use smoltcp::socket::udp;
use smoltcp::wire::IpAddress;

use super::phone::Phone;
use super::room::{Room, play};
use support::frames::{HEARTBEAT, assert_no_sequence_gap};
use support::requests;

#[test]
fn phones_get_an_address_and_are_found_one_after_the_other() {
    play(Role::AccessPoint, async |room| {
        let mut phones = [2, 3].map(|number| Phone::without_address(&room.air, number));
        let asked = phones.each_mut().map(Phone::ask_for_address);
        let [one, two] = &mut phones;
        room.pass(3_000, &mut [one, two]).await;
        for (phone, asked) in phones.iter_mut().zip(asked) {
            assert!(phone.take_address(asked), "one was given");
        }
        let mut given = phones.each_ref().map(Phone::address);
        given.sort();
        assert_eq!(
            given,
            [2, 3].map(|number| Some(Ipv4Addr::new(192, 168, 4, number)))
        );

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
        assert!(connected.len() > 1);
        assert_no_sequence_gap(&connected);
        two.send(stations[1], &requests::heartbeat(requests::GCS));
        room.pass(2_000, &mut [one, two]).await;
        assert!(two.received_frames(stations[1]).len() > 10);
        assert_eq!(
            *room.reports.borrow(),
            [NetReport::AddressObtained([192, 168, 4, 1])]
        );
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
fn an_address_is_asked_for_until_one_is_given_and_renewed_until_the_server_is_gone() {
    play(Role::Station, async |room| {
        room.pass(29_000, &mut []).await;
        assert!(room.reports.borrow().is_empty());
        room.pass(60_000, &mut []).await;
        assert_eq!(*room.reports.borrow(), [NetReport::NoAddress]);
        let mut router = Router::new(room);
        router.serve(room, 60_000).await;
        let obtained = NetReport::AddressObtained([192, 168, 4, 77]);
        assert_eq!(*room.reports.borrow(), [NetReport::NoAddress, obtained]);
        // It is found there, too.
        let station = router.phone.listen(14550);
        router.serve(room, 3_000).await;
        assert_eq!(router.phone.received_frames(station).len(), 3);
        router.serve(room, 200_000).await;
        assert_eq!(room.reports.borrow().len(), 2, "through three leases");
        drop(router);
        room.pass(120_000, &mut []).await;
        assert_eq!(
            room.reports.borrow()[2..],
            [NetReport::AddressLost, NetReport::NoAddress]
        );
    });
}
