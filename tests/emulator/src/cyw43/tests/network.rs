//! Control messages, the access point, the station, frames and events.

use super::super::{AccessPoint, RadioFault};
use super::master::Master;

const DOWN: u32 = 3;
const SET_SSID: u32 = 26;
const SET_CHANNEL: u32 = 30;
const DISASSOC: u32 = 52;
const SET_AP: u32 = 118;
const SET_WSEC: u32 = 134;
const SET_WSEC_PMK: u32 = 268;
const AES: u32 = 4;

const UNSUPPORTED: i32 = -23;
const CLIENT: [u8; 6] = [2, 0, 0, 0, 0, 7];

/// Events by kind, status, flags and reason.
const LINK_UP: (u8, u8, u8, u8) = (16, 0, 1, 0);
const SET_SSID_DONE: (u8, u8, u8, u8) = (0, 0, 0, 0);
const NO_NETWORKS: (u8, u8, u8, u8) = (0, 3, 0, 0);
const KEYED: (u8, u8, u8, u8) = (46, 6, 0, 0);
const KEY_TIME_OUT: (u8, u8, u8, u8) = (46, 8, 0, 15);

fn word(value: u32) -> [u8; 4] {
    value.to_le_bytes()
}

fn ssid(name: &str) -> Vec<u8> {
    let mut ssid = [&word(name.len() as u32), name.as_bytes()].concat();
    ssid.resize(36, 0);
    ssid
}

fn passphrase(text: &str) -> Vec<u8> {
    let mut passphrase = [&word(text.len() as u32 | 1 << 16), text.as_bytes()].concat();
    passphrase.resize(68, 0);
    passphrase
}

fn second(value: u32) -> Vec<u8> {
    [word(0), word(value)].concat()
}

fn done(master: &mut Master, number: u32, data: &[u8]) {
    assert_eq!(master.control(number, data), Ok(Vec::new()), "{number}");
}

fn access_point() -> Master {
    let mut master = Master::station(&[]);
    done(&mut master, SET_AP, &word(1));
    master.set_variable("bsscfg:ssid", &[&word(0)[..], &ssid("rover")].concat());
    done(&mut master, SET_CHANNEL, &word(11));
    master.set_variable("bsscfg:wsec", &second(AES));
    done(&mut master, SET_WSEC_PMK, &passphrase("twelve bytes"));
    master.set_variable("bss", &second(1));
    master
}

fn join(master: &mut Master, name: &str, key: Option<&str>) {
    done(master, SET_WSEC, &word(key.map_or(0, |_| AES)));
    if let Some(key) = key {
        done(master, SET_WSEC_PMK, &passphrase(key));
    }
    done(master, SET_SSID, &ssid(name));
}

#[test]
fn an_unknown_message_is_answered_with_an_error() {
    let mut master = Master::running();
    assert_eq!(master.control(999, &[]), Err(UNSUPPORTED));
    assert_eq!(master.control(263, b"no_such\0"), Err(UNSUPPORTED));
    assert_eq!(master.variable("no_such", 4), Err(UNSUPPORTED));
}

#[test]
fn its_address_is_answered() {
    let mut master = Master::running();
    let mac = master.chip.mac();
    assert_eq!(master.variable("cur_etheraddr", 6), Ok(mac.to_vec()));
}

#[test]
fn regulatory_data_counts_once_its_last_part_has_come() {
    let mut master = Master::running();
    let part = |flags: u8| [&[flags, 0x10, 2, 0][..], &[0; 12]].concat();
    master.set_variable("clmload", &part(2));
    assert_eq!(master.variable("clmload_status", 4), Ok(word(1).to_vec()));
    master.set_variable("clmload", &part(4));
    assert_eq!(master.variable("clmload_status", 4), Ok(word(0).to_vec()));
}

#[test]
fn an_access_point_comes_up_as_it_was_set_up() {
    let mut master = access_point();
    let expected = AccessPoint {
        ssid: "rover".to_owned(),
        passphrase: Some("twelve bytes".to_owned()),
        channel: 11,
    };
    assert_eq!(master.chip.access_point(), Some(&expected));
    assert_eq!(master.take_events(), [LINK_UP]);
    done(&mut master, DOWN, &[]);
    assert_eq!(master.chip.access_point(), None);
    assert_eq!(master.take_events(), [(16, 0, 0, 2)]);
}

#[test]
fn an_access_point_needs_a_name_and_its_passphrase() {
    let mut master = Master::station(&[]);
    done(&mut master, SET_AP, &word(1));
    let bss = [b"bss\0", &second(1)[..]].concat();
    assert!(master.control(263, &bss).is_err());
    assert!(master.control(SET_WSEC_PMK, &passphrase("seven b")).is_err());
    assert_eq!(master.chip.access_point(), None);
}

#[test]
fn clients_of_the_access_point_are_events() {
    let mut master = access_point();
    master.take_events();
    master.chip.client_joined(CLIENT);
    master.wait_us(1_000);
    assert_eq!(master.take_events(), [(4, 0, 0, 0), (8, 0, 0, 0)]);
    master.chip.client_left(CLIENT);
    master.wait_us(1_000);
    assert_eq!(master.take_events(), [(12, 0, 0, 8), (6, 0, 0, 8)]);
}

#[test]
fn events_that_are_not_wanted_do_not_come() {
    let mut master = access_point();
    master.take_events();
    master.set_variable(
        "bsscfg:event_msgs",
        &[&[0; 4][..], &[0xff, 0xfe], &[0xff; 22]].concat(),
    );
    master.chip.client_joined(CLIENT);
    master.wait_us(1_000);
    assert_eq!(master.take_events(), [(4, 0, 0, 0)]);
}

#[test]
fn frames_pass_both_ways() {
    let mut master = access_point();
    let (out, back) = ([0x11; 60], [0x22; 1514]);
    master.send_frame(&out);
    assert_eq!(master.chip.take_sent(), [out.to_vec()]);
    assert!(master.chip.send(&back));
    assert_eq!(master.take_frames(), Vec::<Vec<u8>>::new(), "it takes its time");
    master.wait_us(1_000);
    assert_eq!(master.take_frames(), [back.to_vec()]);
}

#[test]
fn the_driver_gets_new_credits_while_it_only_sends() {
    let mut master = access_point();
    // The master panics without a credit.
    (0..100).for_each(|_| master.send_frame(&[0x33; 100]));
    assert_eq!(master.chip.take_sent().len(), 100);
}

#[test]
fn sixteen_frames_wait_and_more_are_lost() {
    let mut master = access_point();
    let taken = (0..20).filter(|_| master.chip.send(&[0x44; 64])).count();
    assert_eq!(taken, 16);
    master.wait_us(1_000);
    assert_eq!(master.take_frames().len(), 16);
    assert!(master.chip.send(&[0x44; 64]));
}

#[test]
fn the_right_passphrase_joins() {
    let mut master = Master::station(&[("home", Some("right words"))]);
    join(&mut master, "home", Some("right words"));
    master.wait_us(1_400_000);
    assert_eq!(master.chip.joined(), None, "1.5 s for scan and association");
    master.wait_us(200_000);
    assert_eq!(master.chip.joined(), Some("home"));
    let events = master.take_events();
    assert_eq!(events[0], (3, 0, 0, 0), "authenticated first");
    assert_eq!(events.last(), Some(&KEYED));
    assert!(events.contains(&LINK_UP) && events.contains(&SET_SSID_DONE));
    assert!(master.chip.send(&[0x77; 64]));
}

#[test]
fn an_open_network_needs_no_keys() {
    let mut master = Master::station(&[("home", None)]);
    join(&mut master, "home", None);
    master.wait_us(2_000_000);
    assert_eq!(master.chip.joined(), Some("home"));
    assert_eq!(master.take_events().last(), Some(&SET_SSID_DONE));
}

#[test]
fn with_the_wrong_passphrase_the_keys_time_out() {
    let mut master = Master::station(&[("home", Some("right words"))]);
    join(&mut master, "home", Some("wrong words"));
    master.wait_us(2_000_000);
    assert!(!master.take_events().contains(&KEYED));
    master.wait_us(2_500_000);
    assert_eq!(master.take_events(), [KEY_TIME_OUT, (16, 0, 0, 2)]);
    assert_eq!(master.chip.joined(), None);
}

#[test]
fn a_network_that_is_not_there_is_not_found() {
    let mut master = Master::station(&[("home", Some("right words"))]);
    join(&mut master, "away", Some("right words"));
    master.wait_us(1_500_000);
    assert_eq!(master.take_events(), [NO_NETWORKS]);
    join(&mut master, "home", None);
    master.wait_us(1_500_000);
    assert_eq!(master.take_events(), [NO_NETWORKS], "another security");
}

#[test]
fn a_network_that_goes_takes_the_link_along() {
    let mut master = Master::station(&[("home", None)]);
    join(&mut master, "home", None);
    master.wait_us(2_000_000);
    master.take_events();
    master.chip.remove_network("home");
    master.wait_us(1_000);
    assert_eq!(master.take_events(), [(16, 0, 0, 1)]);
    assert_eq!(master.chip.joined(), None);
    assert!(!master.chip.send(&[0x88; 64]));
}

#[test]
fn an_exclusion_is_an_event_of_its_own_and_the_link_has_none() {
    let mut master = Master::station(&[("home", None)]);
    join(&mut master, "home", None);
    master.wait_us(2_000_000);
    master.take_events();
    master.chip.deauthenticated();
    master.wait_us(1_000);
    assert_eq!(master.take_events(), [(6, 0, 0, 6)]);
    assert_eq!(master.chip.joined(), None);
    assert_eq!(master.control(DISASSOC, &[]), Err(-17), "it is in none");
}

#[test]
fn a_station_that_stays_associated_takes_no_other_passphrase_until_it_leaves() {
    let mut master = Master::station(&[("home", Some("right words"))]);
    master.chip.set_fault(Some(RadioFault::StaysAssociated));
    join(&mut master, "home", Some("wrong words"));
    master.wait_us(5_000_000);
    assert_eq!(master.take_events().last(), Some(&(46, 4, 0, 15)));
    assert_eq!(master.control(SET_WSEC_PMK, &passphrase("right words")), Err(-1));
    done(&mut master, DISASSOC, &[]);
    join(&mut master, "home", Some("right words"));
    master.wait_us(2_000_000);
    assert_eq!(master.chip.joined(), Some("home"));
}

#[test]
fn leaving_is_an_event() {
    let mut master = Master::station(&[("home", None)]);
    join(&mut master, "home", None);
    master.wait_us(2_000_000);
    master.take_events();
    done(&mut master, DISASSOC, &[]);
    assert_eq!(master.take_events(), [(11, 0, 0, 0), (16, 0, 0, 2)]);
}
