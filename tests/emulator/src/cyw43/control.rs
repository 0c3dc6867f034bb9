//! Control messages: what the driver sets and asks for, by number or, as a variable, by name.

use super::super::clock::Cycle;
use super::events::Mask;
use super::radio::{Mode, Radio};

const HEADER_BYTES: usize = 16;
const FLAG_ERROR: u16 = 1;
const FLAG_SET: u16 = 2;

/// Broadcom's error numbers (`bcmutils.h`).
const FAILED: i32 = -1;
const BAD_ARGUMENT: i32 = -2;
const NOT_UP: i32 = -4;
const NOT_ASSOCIATED: i32 = -17;
const UNSUPPORTED: i32 = -23;

const UP: u32 = 2;
const DOWN: u32 = 3;
const SET_INFRA: u32 = 20;
const SET_AUTH: u32 = 22;
const SET_SSID: u32 = 26;
const SET_CHANNEL: u32 = 30;
const DISASSOC: u32 = 52;
const SET_ANTDIV: u32 = 64;
const SET_PM: u32 = 86;
const SET_GMODE: u32 = 110;
const SET_AP: u32 = 118;
const SET_WSEC: u32 = 134;
const SET_BAND: u32 = 142;
const SET_WPA_AUTH: u32 = 165;
const GET_VAR: u32 = 262;
const SET_VAR: u32 = 263;
const SET_WSEC_PMK: u32 = 268;

/// Of the header of a download: it is its last part.
const DOWNLOAD_END: u16 = 4;
const PASSPHRASE_BYTES: std::ops::RangeInclusive<usize> = 8..=64;

type Answer = Result<Vec<u8>, i32>;

/// What a message asks for.
struct Request<'a> {
    number: u32,
    data: &'a [u8],
}

/// The program's state beside the radio's.
#[derive(Clone, Debug, Default)]
pub struct Control {
    /// The regulatory data was downloaded.
    has_regulatory_data: bool,
    pub mask: Mask,
}

/// Everything that a message may change.
pub struct Context<'a> {
    pub radio: &'a mut Radio,
    pub address: [u8; 6],
    pub now: Cycle,
}

impl Control {
    /// The answer to a message, if it is one.
    pub fn answer(&mut self, message: &[u8], context: &mut Context) -> Option<Vec<u8>> {
        let header: &[u8; HEADER_BYTES] = message.first_chunk()?;
        let word = |index: usize| u32::from_le_bytes([0, 1, 2, 3].map(|byte| header[index + byte]));
        let data = message.get(HEADER_BYTES..)?.get(..word(4) as usize)?;
        let number = word(0);
        let flags = u16::from_le_bytes([header[8], header[9]]);
        let answer = match flags & FLAG_SET {
            0 => self.get(Request { number, data }, context),
            _ => self.set(Request { number, data }, context).map(|()| Vec::new()),
        };
        let (content, status, error) = match answer {
            Ok(content) => (content, 0, 0),
            Err(status) => (Vec::new(), status, FLAG_ERROR),
        };
        let mut bytes = number.to_le_bytes().to_vec();
        bytes.extend((content.len() as u32).to_le_bytes());
        bytes.extend((flags | error).to_le_bytes());
        bytes.extend(&header[10..12]);
        bytes.extend(status.to_le_bytes());
        bytes.extend(content);
        Some(bytes)
    }

    fn get(&self, request: Request, context: &Context) -> Answer {
        let answer = match request.number {
            GET_VAR => self.variable(name_and_value(request.data)?.0, context)?,
            _ => return Err(UNSUPPORTED),
        };
        let filler = std::iter::repeat(0);
        Ok(answer
            .into_iter()
            .chain(filler)
            .take(request.data.len())
            .collect())
    }

    fn variable(&self, name: &str, context: &Context) -> Answer {
        match name {
            "cur_etheraddr" => Ok(context.address.to_vec()),
            "clmload_status" => Ok(u32::from(!self.has_regulatory_data).to_le_bytes().to_vec()),
            _ => Err(UNSUPPORTED),
        }
    }

    fn set(&mut self, request: Request, context: &mut Context) -> Result<(), i32> {
        let data = request.data;
        let radio = &mut *context.radio;
        match request.number {
            UP => radio.up(),
            DOWN => radio.down(),
            SET_INFRA | SET_AUTH | SET_ANTDIV | SET_PM | SET_GMODE | SET_BAND | SET_WPA_AUTH => {
                number(data)?;
            }
            SET_SSID if radio.is_up() => radio.join(ssid(data)?, context.now),
            SET_SSID => return Err(NOT_UP),
            SET_CHANNEL => radio.settings.channel = channel(number(data)?)?,
            DISASSOC if radio.is_associated() => radio.leave(),
            DISASSOC => return Err(NOT_ASSOCIATED),
            SET_AP => radio.settings.mode = mode(number(data)?),
            SET_WSEC => radio.settings.is_secure = number(data)? != 0,
            SET_WSEC_PMK if radio.is_associated() => return Err(FAILED),
            SET_WSEC_PMK => radio.settings.passphrase = passphrase(data)?,
            SET_VAR => {
                let (name, value) = name_and_value(data)?;
                return self.set_variable(name, value, context);
            }
            _ => return Err(UNSUPPORTED),
        }
        Ok(())
    }

    fn set_variable(&mut self, name: &str, value: &[u8], context: &mut Context) -> Result<(), i32> {
        let radio = &mut *context.radio;
        match name {
            "clmload" => self.has_regulatory_data = flag_of_download(value)? & DOWNLOAD_END != 0,
            "bsscfg:event_msgs" => self.mask = Mask::of(value.get(4..).ok_or(BAD_ARGUMENT)?),
            "bsscfg:ssid" => radio.settings.ssid = ssid(value.get(4..).ok_or(BAD_ARGUMENT)?)?,
            "bsscfg:wsec" => radio.settings.is_secure = second_number(value)? != 0,
            "sae_password" => radio.settings.passphrase = sae_password(value)?,
            "bss" => return switch_access_point(radio, second_number(value)?),
            "ampdu_ba_wsize" | "ampdu_mpdu" | "apsta" | "assoc_listen" | "bcn_li_bcn" | "bcn_li_dtim"
            | "bus:txglom" | "mfp" | "pm2_sleep_ret" | "2g_mrate" => {
                number(value)?;
            }
            "bsscfg:sup_wpa" | "bsscfg:sup_wpa2_eapver" | "bsscfg:sup_wpa_tmo" | "bsscfg:wpa_auth" => {
                second_number(value)?;
            }
            "gpioout" => {
                let (pins, levels) = (number(value)?, second_number(value)?);
                for (pin, level) in radio.settings.gpios.iter_mut().enumerate() {
                    if pins >> pin & 1 != 0 {
                        *level = Some(levels >> pin & 1 != 0);
                    }
                }
            }
            "country" if value.len() == 12 => {}
            _ => return Err(UNSUPPORTED),
        }
        Ok(())
    }
}

/// It comes up while the radio is up in its mode, with a name and, unless it is open, a passphrase.
fn switch_access_point(radio: &mut Radio, wanted: u32) -> Result<(), i32> {
    if wanted == 0 {
        radio.stop_access_point();
        return Ok(());
    }
    let settings = &radio.settings;
    let lacks_passphrase = settings.is_secure && settings.passphrase.is_empty();
    if !radio.is_up() {
        return Err(NOT_UP);
    }
    if settings.mode != Mode::AccessPoint || settings.ssid.is_empty() || lacks_passphrase {
        return Err(BAD_ARGUMENT);
    }
    radio.start_access_point();
    Ok(())
}

/// A name ends with a zero; its value follows.
fn name_and_value(data: &[u8]) -> Result<(&str, &[u8]), i32> {
    let end = data.iter().position(|&byte| byte == 0).ok_or(BAD_ARGUMENT)?;
    let name = str::from_utf8(&data[..end]).map_err(|_| BAD_ARGUMENT)?;
    Ok((name, &data[end + 1..]))
}

fn number(data: &[u8]) -> Result<u32, i32> {
    let bytes = data.first_chunk().ok_or(BAD_ARGUMENT)?;
    Ok(u32::from_le_bytes(*bytes))
}

/// Behind the number of an interface.
fn second_number(data: &[u8]) -> Result<u32, i32> {
    number(data.get(4..).ok_or(BAD_ARGUMENT)?)
}

fn flag_of_download(data: &[u8]) -> Result<u16, i32> {
    number(data).map(|word| word as u16)
}

fn mode(number: u32) -> Mode {
    match number {
        0 => Mode::Station,
        _ => Mode::AccessPoint,
    }
}

fn channel(number: u32) -> Result<u8, i32> {
    match number {
        1..=14 => Ok(number as u8),
        _ => Err(BAD_ARGUMENT),
    }
}

/// A length in a word, and up to 32 bytes.
fn ssid(data: &[u8]) -> Result<String, i32> {
    let length = number(data)? as usize;
    text(data.get(4..4 + length.min(32)))
}

/// A length and flags in halves of a word, and up to 64 bytes.
fn passphrase(data: &[u8]) -> Result<String, i32> {
    let length = (number(data)? & 0xffff) as usize;
    if !PASSPHRASE_BYTES.contains(&length) {
        return Err(BAD_ARGUMENT);
    }
    text(data.get(4..4 + length))
}

/// A length in half a word, and up to 128 bytes.
fn sae_password(data: &[u8]) -> Result<String, i32> {
    let length = (number(data)? & 0xffff) as usize;
    text(data.get(2..2 + length.min(128)))
}

fn text(bytes: Option<&[u8]>) -> Result<String, i32> {
    let bytes = bytes.ok_or(BAD_ARGUMENT)?;
    String::from_utf8(bytes.to_vec()).map_err(|_| BAD_ARGUMENT)
}
