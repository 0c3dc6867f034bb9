//! Browsers: the page, and their links by WebSocket.

use std::cell::{Cell, RefCell};
use std::net::IpAddr;
use std::rc::Rc;

use embassy_futures::join::{join, join_array};
use embassy_time::Timer;
use rover_battmon::mavlink::LinkKind;
use rover_battmon::tasks::{Link, Shared};
use rover_battmon::web::{Site, Slot, Slots, refuse, serve_request, serve_web_socket};

use super::console::print_line;
use super::links::{LINK_BYTES_PER_SECOND, POLL_MS, UNWATCHED};
use super::{Client, Clients, SimulatedFlash};

/// Connections at a time, as on the board: those of WebSockets, and two that get a page or a file. One more gets 503.
const CONNECTIONS: usize = 4;

/// More than on the board: other servers on this computer may have left cookies, which a browser sends to all of them.
const BUFFER_BYTES: usize = 16_384;

/// Browsers, and the links they have.
pub(super) struct Browsers<'a> {
    flash: &'a SimulatedFlash,
    slots: Slots,
    connections: Cell<usize>,
    links: RefCell<Vec<Rc<Link<'a>>>>,
}

impl<'a> Browsers<'a> {
    pub fn new(flash: &'a SimulatedFlash) -> Self {
        Self {
            flash,
            slots: Slots::new(),
            connections: Cell::new(0),
            links: RefCell::default(),
        }
    }

    /// Their links.
    pub fn links(&self) -> Vec<Rc<Link<'a>>> {
        self.links.borrow().clone()
    }

    /// Serves who connects to `clients`.
    pub async fn serve(&self, clients: Option<&Clients>, shared: &Shared) {
        if let Some(clients) = clients {
            join(
                join_array([(); CONNECTIONS].map(|()| self.serve_connections(clients, shared))),
                self.refuse_surplus(clients),
            )
            .await;
        }
    }

    /// Serves one connection after the other.
    async fn serve_connections(&self, clients: &Clients, shared: &Shared) {
        let site = Site {
            shared,
            logs: self.flash,
            slots: &self.slots,
        };
        let mut buffer = vec![0; BUFFER_BYTES];
        loop {
            let client = clients.next().await;
            self.connections.update(|count| count + 1);
            let names = names(&client);
            let names: Vec<_> = names.iter().map(String::as_str).collect();
            if let Some(slot) = serve_request(&client, &client, &mut buffer, &names, site).await {
                self.serve_link(&client, &slot, shared).await;
            }
            client.close().await;
            self.connections.update(|count| count - 1);
        }
    }

    /// Answers 503 to those who come while all other connections are in use.
    async fn refuse_surplus(&self, clients: &Clients) -> ! {
        loop {
            while self.connections.get() == CONNECTIONS
                && let Some(client) = clients.try_next()
            {
                refuse(&client, &self.slots).await;
                client.refuse();
            }
            Timer::after_millis(POLL_MS).await;
        }
    }

    async fn serve_link(&self, client: &Client, slot: &Slot<'_>, shared: &Shared) {
        print_line(&format!("{} connected by WebSocket", client.address));
        let link = Link::new("WEB", LinkKind::Wifi, LINK_BYTES_PER_SECOND)
            .with_logs(self.flash)
            .with_access(slot.sender.access());
        let link = Rc::new(link);
        self.links.borrow_mut().push(link.clone());
        serve_web_socket(client, client, slot, &link, shared, &UNWATCHED).await;
        self.links.borrow_mut().retain(|other| !Rc::ptr_eq(other, &link));
        print_line(&format!("{} disconnected", client.address));
    }
}

/// The names by which a client may have found this computer: the address that it has connected to.
fn names(client: &Client) -> Vec<String> {
    let Some(address) = client.own_address().map(|address| address.ip()) else {
        return Vec::new();
    };
    let mut names = vec![match address {
        IpAddr::V4(address) => address.to_string(),
        IpAddr::V6(address) => format!("[{address}]"),
    }];
    if address.is_loopback() {
        names.push("localhost".into());
    }
    names
}
