//! Results of a scan: an event for each network in range.

use super::air::{Air, Network};
use super::events::{Event, Kind, Status};

const BSS_INFO_BYTES: usize = 126;
const RESULTS_HEADER_BYTES: usize = 12;
const RSSI_DBM: i16 = -50;
const CAPABILITY_PRIVACY: u16 = 0x0010;

pub fn scan_results(air: &Air) -> impl Iterator<Item = Event> {
    air.networks.iter().filter(|_| !air.is_deaf).map(|network| Event {
        data: results(network),
        ..Event::new(Kind::EscanResult, Status::Partial)
    })
}

/// One network: the header of the results, and what is known of it (Broadcom's `wl_bss_info`).
fn results(network: &Network) -> Vec<u8> {
    let mut info = vec![0; BSS_INFO_BYTES];
    let mut put = |offset: usize, bytes: &[u8]| info[offset..][..bytes.len()].copy_from_slice(bytes);
    let privacy = network.passphrase.as_ref().map_or(0, |_| CAPABILITY_PRIVACY);
    put(0, &109_u32.to_le_bytes());
    put(4, &(BSS_INFO_BYTES as u32).to_le_bytes());
    put(14, &100_u16.to_le_bytes());
    put(16, &privacy.to_le_bytes());
    put(18, &[network.ssid.len() as u8]);
    put(19, network.ssid.as_bytes());
    put(72, &u16::from(network.channel).to_le_bytes());
    put(78, &RSSI_DBM.to_le_bytes());
    let length = (RESULTS_HEADER_BYTES + BSS_INFO_BYTES) as u32;
    let header = [length.to_le_bytes(), 109_u32.to_le_bytes(), [1, 0, 1, 0]];
    [header.as_flattened(), &info].concat()
}
