//! A computer that joins a Wi-Fi network and gets its address there.

use std::ops::{Deref, DerefMut};

use smoltcp::iface::SocketHandle;
use smoltcp::socket::dhcpv4;

use super::computer::Computer;
use super::radio::{Credentials, MacAddress};

pub struct Laptop {
    computer: Computer,
    /// What its owner has typed in; `None`: it joins nothing.
    pub credentials: Option<Credentials>,
    /// Its DHCP client; `None`: it keeps the address that it has.
    client: Option<SocketHandle>,
}

impl Laptop {
    /// Gets its address by DHCP.
    pub fn new(mac: MacAddress, credentials: Option<Credentials>) -> Self {
        let mut computer = Computer::new(mac);
        let client = computer.sockets.add(dhcpv4::Socket::new());
        Self {
            computer,
            credentials,
            client: Some(client),
        }
    }

    /// It has joined a network: an address of another one is worth nothing.
    pub fn joined(&mut self) {
        if let Some(client) = self.client {
            self.computer.sockets.get_mut::<dhcpv4::Socket>(client).reset();
            self.computer.set_address(None);
        }
    }

    /// It keeps the address that it has, and asks for none any more.
    pub fn keep_address(&mut self) {
        if let Some(client) = self.client.take() {
            self.computer.sockets.remove(client);
        }
    }

    /// Lets the stack do what is due at this time. Returns the frames that it sends.
    pub fn poll(&mut self, now_us: u64) -> Vec<Vec<u8>> {
        let mut frames = self.computer.poll(now_us);
        if let Some(client) = self.client {
            self.take_lease(client);
            frames.extend(self.computer.poll(now_us));
        }
        frames
    }

    fn take_lease(&mut self, client: SocketHandle) {
        let address = match self.computer.sockets.get_mut::<dhcpv4::Socket>(client).poll() {
            Some(dhcpv4::Event::Configured(lease)) => Some(lease.address),
            Some(dhcpv4::Event::Deconfigured) => None,
            None => return,
        };
        self.computer.set_address(address);
    }
}

impl Deref for Laptop {
    type Target = Computer;

    fn deref(&self) -> &Computer {
        &self.computer
    }
}

impl DerefMut for Laptop {
    fn deref_mut(&mut self) -> &mut Computer {
        &mut self.computer
    }
}
