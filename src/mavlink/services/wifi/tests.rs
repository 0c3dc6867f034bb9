use proptest::prelude::*;

use super::*;
use crate::mavlink::payload::Payload;
use crate::wifi::StoredWifi;

const OWN_PASSWORD: &[u8] = b"own password";

/// A board that has joined a network.
fn credentials() -> WifiCredentials {
    let stored = StoredWifi {
        own_password: Password::new(OWN_PASSWORD),
        network: Some(network("home", Some("at home 1"))),
    };
    WifiCredentials::new(Radio::Present, None, stored)
}

fn network(name: &str, password: Option<&str>) -> Network {
    Network {
        ssid: Ssid::new(name.as_bytes()).expect("valid"),
        password: password.map(|text| Password::new(text.as_bytes()).expect("valid")),
    }
}

fn payload(ssid: &[u8], password: &[u8], mode: u8) -> [u8; 98] {
    let mut payload = [0; 98];
    payload[..ssid.len()].copy_from_slice(ssid);
    payload[32..32 + password.len()].copy_from_slice(password);
    payload[96] = mode;
    payload
}

fn request(bytes: &[u8]) -> WifiConfig<'_> {
    let payload = Payload(bytes);
    WifiConfig {
        mode: payload.u8(96),
        payload,
    }
}

fn set(
    credentials: &mut WifiCredentials,
    parameters: &mut Parameters,
    [ssid, password]: [&[u8]; 2],
    mode: u8,
) -> Result<WifiMode, WifiRefused> {
    let bytes = payload(ssid, password, mode);
    super::set(&request(&bytes), ArmState::Disarmed, credentials, parameters)
}

/// Asks to join this network.
fn join(credentials: &mut WifiCredentials, fields: [&[u8]; 2]) -> Result<WifiMode, WifiRefused> {
    set(credentials, &mut Parameters::defaults(), fields, MODE_STATION)
}

#[test]
fn each_mode_sets_what_it_is_for() {
    let mut credentials = credentials();
    let mut parameters = Parameters::defaults();
    let mut set = |fields, mode| {
        set(&mut credentials, &mut parameters, fields, mode).map(|mode| {
            (
                mode,
                credentials.clone(),
                parameters.get(VehicleParameter::WifiMode),
            )
        })
    };

    let (mode, now, value) = set([b"", b"new password"], MODE_ACCESS_POINT).unwrap();
    assert_eq!((mode, value), (WifiMode::AccessPoint, 1.0));
    assert_eq!(now.own_password(), Password::new(b"new password").as_ref());

    // Its own name is allowed.
    let (_, now, _) = set([b"rover", b"new password 2"], MODE_ACCESS_POINT).unwrap();
    assert_eq!(now.own_password(), Password::new(b"new password 2").as_ref());

    let (mode, now, value) = set([b"work", b"at work 1"], MODE_STATION).unwrap();
    assert_eq!((mode, value), (WifiMode::Station, 2.0));
    assert_eq!(now.network(), Some(&network("work", Some("at work 1"))));

    let (mode, now, _) = set([b"open", b""], MODE_UNDEFINED).unwrap();
    assert_eq!(mode, WifiMode::Station);
    assert_eq!(now.network(), Some(&network("open", None)));

    let (_, now, _) = set([b"", b"12345678"], MODE_STATION).unwrap();
    assert_eq!(now.network(), Some(&network("open", Some("12345678"))));

    let (mode, now, value) = set([b"", b""], MODE_DISABLED).unwrap();
    assert_eq!((mode, value), (WifiMode::Off, 0.0));
    assert_eq!(now.own_password(), Password::new(b"new password 2").as_ref());
}

#[test]
fn names_and_passwords_of_full_length_end_with_their_fields() {
    let mut credentials = credentials();
    let (ssid, password) = ([b'n'; 32], [b'p'; 63]);
    join(&mut credentials, [&ssid, &password]).unwrap();
    let joined = credentials.network().expect("it is set");
    assert_eq!(joined.ssid.as_str(), "n".repeat(32));
    assert_eq!(
        joined.password.as_ref().map(Password::as_str),
        Some("p".repeat(63).as_str())
    );
    let too_long = [b'p'; 64];
    let refused = join(&mut credentials, [&ssid, &too_long]);
    assert_eq!(refused, Err(WifiRefused::Password));
}

#[test]
fn what_is_not_valid_changes_nothing() {
    let cases: [([&[u8]; 2], u8, WifiRefused); 9] = [
        ([b"", b"12345678"], MODE_UNDEFINED, WifiRefused::Mode),
        ([b"home", b"12345678"], 4, WifiRefused::Mode),
        ([b"home", b"12345678"], 0xff, WifiRefused::Mode),
        ([b"another", b"12345678"], MODE_ACCESS_POINT, WifiRefused::Ssid),
        ([b"", b""], MODE_ACCESS_POINT, WifiRefused::Password),
        ([b"", b"1234567"], MODE_ACCESS_POINT, WifiRefused::Password),
        ([b"home", b"1234567"], MODE_STATION, WifiRefused::Password),
        ([b"home", b"1234567\xe4"], MODE_STATION, WifiRefused::Password),
        ([b"\xff", b"12345678"], MODE_STATION, WifiRefused::Ssid),
    ];
    for (fields, mode, refused) in cases {
        let mut credentials = credentials();
        let mut parameters = Parameters::defaults();
        let result = set(&mut credentials, &mut parameters, fields, mode);
        assert_eq!(result, Err(refused), "{fields:?} {mode}");
        assert_eq!(credentials.next_unsaved(), None);
        assert_eq!(parameters, Parameters::defaults());
    }
}

#[test]
fn without_a_known_network_a_blank_name_is_none() {
    let mut credentials = WifiCredentials::new(Radio::Present, None, StoredWifi::default());
    let refused = join(&mut credentials, [b"", b"12345678"]);
    assert_eq!(refused, Err(WifiRefused::Ssid));
}

proptest! {
    #[test]
    fn any_bytes_are_set_up_whole_or_not_at_all(bytes in prop::collection::vec(any::<u8>(), 0..=98), mode in 0u8..6) {
        // Any mode comes with a payload of any length.
        let request = WifiConfig {
            mode,
            payload: Payload(&bytes),
        };
        let mut credentials = credentials();
        let mut parameters = Parameters::defaults();
        let result = super::set(&request, ArmState::Disarmed, &mut credentials, &mut parameters);
        match result {
            Ok(WifiMode::Off) => prop_assert_eq!(credentials.next_unsaved(), None),
            Ok(_) => prop_assert!(credentials.next_unsaved().is_some()),
            Err(_) => {
                prop_assert_eq!(credentials.next_unsaved(), None);
                prop_assert_eq!(parameters, Parameters::defaults());
            }
        }
    }
}
