//! WIFI_CONFIG_AP (299): the password of the access point, the network to join, or none of both.

use super::Context;
use super::parameters::param_value;
use crate::mavlink::dialect::{MavResult, WIFI_CONFIG_AP_DATA, WifiConfigApMode, WifiConfigApResponse};
use crate::mavlink::event::{Event, WifiRefused};
use crate::mavlink::requests::WifiConfig;
use crate::mavlink::{Message, Peer};
use crate::parameter::{Parameters, VehicleParameter};
use crate::vehicle::ArmState;
use crate::wifi::{Network, Password, Radio, Ssid, WifiChoice, WifiCredentials, WifiMode};

/// WIFI_CONFIG_AP_MODE.
const MODE_UNDEFINED: u8 = WifiConfigApMode::WIFI_CONFIG_AP_MODE_UNDEFINED as u8;
const MODE_ACCESS_POINT: u8 = WifiConfigApMode::WIFI_CONFIG_AP_MODE_AP as u8;
const MODE_STATION: u8 = WifiConfigApMode::WIFI_CONFIG_AP_MODE_STATION as u8;
const MODE_DISABLED: u8 = WifiConfigApMode::WIFI_CONFIG_AP_MODE_DISABLED as u8;

impl WifiRefused {
    fn response(self) -> WifiConfigApResponse {
        match self {
            Self::Armed => WifiConfigApResponse::WIFI_CONFIG_AP_RESPONSE_REJECTED,
            Self::Mode => WifiConfigApResponse::WIFI_CONFIG_AP_RESPONSE_MODE_ERROR,
            Self::Ssid => WifiConfigApResponse::WIFI_CONFIG_AP_RESPONSE_SSID_ERROR,
            Self::Password => WifiConfigApResponse::WIFI_CONFIG_AP_RESPONSE_PASSWORD_ERROR,
        }
    }
}

/// The set-up by a valid request.
enum Setup {
    Off,
    AccessPoint(Password),
    Station(Network),
}

/// Does what WIFI_CONFIG_AP asks for, and answers it. Ground stations are sent the parameter that it has set.
pub fn set_up(request: &WifiConfig<'_>, context: &mut Context<'_>) -> Event {
    let arm_state = context.changeable.vehicle.arm_state();
    let (credentials, parameters) = (&mut *context.changeable.wifi, &mut *context.changeable.parameters);
    let result = set(request, arm_state, credentials, parameters);
    context
        .outbox
        .answer(answer(result.map(drop), credentials, parameters));
    match result {
        Ok(mode) => {
            context
                .outbox
                .answer(param_value(VehicleParameter::WifiMode.into(), parameters));
            Event::WifiSetUp(mode)
        }
        Err(refused) => Event::WifiRefused(refused),
    }
}

/// Sets what is requested, and returns the mode. It is also a parameter, which has to be saved.
fn set(
    request: &WifiConfig<'_>,
    arm_state: ArmState,
    credentials: &mut WifiCredentials,
    parameters: &mut Parameters,
) -> Result<WifiMode, WifiRefused> {
    if credentials.radio() == Radio::Absent {
        return Err(WifiRefused::Mode);
    }
    if arm_state == ArmState::Armed {
        return Err(WifiRefused::Armed);
    }
    let mode = match setup(request, credentials)? {
        Setup::Off => WifiMode::Off,
        Setup::AccessPoint(password) => {
            credentials.set_own_password(password);
            WifiMode::AccessPoint
        }
        Setup::Station(network) => {
            credentials.set_network(network);
            WifiMode::Station
        }
    };
    // The table has every mode.
    let _ = parameters.set(VehicleParameter::WifiMode, mode.parameter_value());
    Ok(mode)
}

fn setup(request: &WifiConfig<'_>, credentials: &WifiCredentials) -> Result<Setup, WifiRefused> {
    match request.mode {
        MODE_DISABLED => Ok(Setup::Off),
        MODE_ACCESS_POINT => access_point(request, credentials.own_name()),
        MODE_STATION => station(request, credentials.network()),
        MODE_UNDEFINED if !request.ssid().is_empty() => station(request, credentials.network()),
        _ => Err(WifiRefused::Mode),
    }
}

/// An open access point, which a blank password asks for, would let anyone near drive the rover.
fn access_point(request: &WifiConfig<'_>, own_name: &Ssid) -> Result<Setup, WifiRefused> {
    let name = request.ssid();
    if !name.is_empty() && name != own_name.as_str().as_bytes() {
        return Err(WifiRefused::Ssid);
    }
    let password = Password::new(&request.password()).ok_or(WifiRefused::Password)?;
    Ok(Setup::AccessPoint(password))
}

/// A blank name leaves it unchanged, a blank password is that of an open network.
fn station(request: &WifiConfig<'_>, known: Option<&Network>) -> Result<Setup, WifiRefused> {
    let (name, password) = (request.ssid(), request.password());
    let ssid = if name.is_empty() {
        known.map(|network| network.ssid.clone())
    } else {
        Ssid::new(&name)
    };
    let password = if password.is_empty() {
        None
    } else {
        Some(Password::new(&password).ok_or(WifiRefused::Password)?)
    };
    let ssid = ssid.ok_or(WifiRefused::Ssid)?;
    Ok(Setup::Station(Network { ssid, password }))
}

/// Answers a `command` that requests WIFI_CONFIG_AP. A board without a radio has none.
pub fn report(command: u16, from: Peer, context: &mut Context<'_>) -> Event {
    let report = current(context.changeable.wifi, context.changeable.parameters);
    let (result, event) = match report {
        Some(_) => (MavResult::MAV_RESULT_ACCEPTED, Event::Answered),
        None => (MavResult::MAV_RESULT_DENIED, Event::CommandRefused(command)),
    };
    context.outbox.acknowledge(command, result, from);
    context.outbox.answer_any(report);
    event
}

fn current(credentials: &WifiCredentials, parameters: &Parameters) -> Option<Message> {
    let is_present = credentials.radio() == Radio::Present;
    // Not 0: without a target, other vehicles could take what has no response for a request.
    is_present.then(|| answer(Ok(()), credentials, parameters))
}

/// The answer to a WIFI_CONFIG_AP: what is set up now, without the password or a hash of it.
fn answer(
    result: Result<(), WifiRefused>,
    credentials: &WifiCredentials,
    parameters: &Parameters,
) -> Message {
    let mode = WifiChoice::from_parameters(parameters).mode;
    let (mode, ssid) = match mode {
        WifiMode::Off => (WifiConfigApMode::WIFI_CONFIG_AP_MODE_DISABLED, None),
        WifiMode::AccessPoint => (
            WifiConfigApMode::WIFI_CONFIG_AP_MODE_AP,
            Some(credentials.own_name()),
        ),
        WifiMode::Station => (
            WifiConfigApMode::WIFI_CONFIG_AP_MODE_STATION,
            credentials.network().map(|network| &network.ssid),
        ),
    };
    let response = match result {
        Ok(()) => WifiConfigApResponse::WIFI_CONFIG_AP_RESPONSE_ACCEPTED,
        Err(refused) => refused.response(),
    };
    Message::WifiConfig(WIFI_CONFIG_AP_DATA {
        ssid: padded(ssid.map_or("", Ssid::as_str)).into(),
        password: [0; 64].into(),
        mode,
        response,
    })
}

fn padded(text: &str) -> [u8; Ssid::MAX_BYTES] {
    let mut bytes = [0; Ssid::MAX_BYTES];
    for (to, from) in bytes.iter_mut().zip(text.bytes()) {
        *to = from;
    }
    bytes
}

#[cfg(test)]
mod tests;
