//! Which address the board has in the network.

use core::net::Ipv4Addr;

use embassy_futures::select::{Either, select};
use embassy_net::{Config, Ipv4Cidr, Stack, StaticConfigV4};
use embassy_time::{Duration, Timer};

use super::socket::until;

/// The board's own address where it is the access point.
pub(super) const ACCESS_POINT: Ipv4Addr = Ipv4Addr::new(192, 168, 4, 1);

/// The most addresses that are given to DHCP clients.
pub(super) const MAX_CLIENTS: usize = 8;

/// The network of the access point has 254 addresses.
const ACCESS_POINT_PREFIX: u8 = 24;

/// Time without an answer of a DHCP server until that is reported.
const DHCP_TIMEOUT: Duration = Duration::from_secs(30);

/// Source of the board's address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// It is 192.168.4.1, and gives addresses to others by DHCP.
    AccessPoint,
    /// It asks a DHCP server.
    Station,
}

/// Report on the board's address.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum NetReport {
    /// The board has this address now.
    AddressObtained([u8; 4]),
    /// No DHCP server has answered for 30 s. The board goes on asking.
    NoAddress,
    /// The address is not valid any more.
    AddressLost,
}

impl Role {
    /// Configuration of the network.
    pub(super) fn config(self) -> Config {
        match self {
            Self::AccessPoint => Config::ipv4_static(StaticConfigV4 {
                address: Ipv4Cidr::new(ACCESS_POINT, ACCESS_POINT_PREFIX),
                gateway: None,
                dns_servers: Default::default(),
            }),
            Self::Station => Config::dhcpv4(Default::default()),
        }
    }
}

/// The board's address, and how large its network is; `None` while it has none.
fn address(stack: Stack<'_>) -> Option<Ipv4Cidr> {
    stack.config_v4().map(|config| config.address)
}

/// The address that reaches all others on the network, if the board has one of its own.
pub(super) fn broadcast_address(stack: Stack<'_>) -> Option<Ipv4Addr> {
    address(stack)?.broadcast()
}

/// Reports each change of the board's address.
pub(super) async fn report_address(stack: Stack<'_>, mut report: impl FnMut(NetReport)) -> ! {
    loop {
        let obtained = obtain(stack, &mut report).await;
        report(NetReport::AddressObtained(obtained.address().octets()));
        until(|| address(stack) != Some(obtained)).await;
        report(NetReport::AddressLost);
    }
}

/// Waits for an address, and reports once that there is none.
async fn obtain(stack: Stack<'_>, report: &mut impl FnMut(NetReport)) -> Ipv4Cidr {
    let obtained = until(|| address(stack).is_some());
    if let Either::Second(()) = select(obtained, Timer::after(DHCP_TIMEOUT)).await {
        report(NetReport::NoAddress);
    }
    loop {
        until(|| address(stack).is_some()).await;
        if let Some(obtained) = address(stack) {
            return obtained;
        }
    }
}
