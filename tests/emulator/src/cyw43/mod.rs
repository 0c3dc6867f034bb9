//! The CYW43439 of a Pico W: a slave at four pins, on which the driver loads the program that makes it a radio.
//!
//! What is modelled is what the driver `cyw43` 0.7 relies on: the gSPI bus ([`serial`], [`bus_registers`]), the backplane
//! with the download ([`backplane`], [`program`]), packets, control messages and events ([`wlan`], [`sdpcm`], [`control`],
//! [`events`]), and of the radio which network it is in ([`radio`]). The downloaded program is not executed: it has to be
//! the published one, byte for byte, and what it would do is written here.
//!
//! Not modelled, and not to be claimed: the air itself (rates, losses, other stations), real authentication and keys,
//! scans for a list, power save, Bluetooth, SDIO, and what the chip's own GPIOs lead to. Answers take fixed times, of the
//! order that a chip takes.

mod air;
mod backplane;
mod bus_registers;
mod chip;
mod control;
mod events;
mod fault;
pub mod pins;
mod program;
mod radio;
mod sdpcm;
mod serial;
#[cfg(test)]
mod tests;
mod wlan;

use super::clock::{Cycle, NEVER};
use super::pio::{Outputs, PinDevice};
use super::random::Random;
use air::Air;
pub use air::Network;
use chip::Chip;
use events::{Event, Kind, REASON_STATION_LEAVES, Status};
pub use fault::{ChipPart, RadioFault};
use pins::{CLOCK, DATA, Levels, POWER, SELECT, Wiring};
use program::Expected;
pub use radio::AccessPoint;
use serial::Serial;

/// Of Raspberry Pi's range of addresses.
const ADDRESS: [u8; 6] = [0x28, 0xcd, 0xc1, 0x00, 0x43, 0x39];

/// The chip, its pins, and what is around it.
#[derive(Clone)]
pub struct Cyw43 {
    expected: Expected,
    wiring: Wiring,
    outputs: Outputs,
    levels: Levels,
    serial: Serial,
    /// `None`: without power.
    chip: Option<Chip>,
    air: Air,
    fault: Option<RadioFault>,
    random: Random,
    now: Cycle,
}

impl Cyw43 {
    /// Without power at first. The seed decides what a fault does.
    pub fn new(seed: u64) -> Self {
        Self::expecting(Expected::PUBLISHED, seed)
    }

    /// A chip that expects a program of a test's own.
    fn expecting(expected: Expected, seed: u64) -> Self {
        Self {
            expected,
            wiring: Wiring::default(),
            outputs: Outputs::default(),
            levels: Levels::default(),
            serial: Serial::default(),
            chip: None,
            air: Air::default(),
            fault: None,
            random: Random::new(seed),
            now: 0,
        }
    }

    /// A fault from now on; `None`: none any more.
    pub fn set_fault(&mut self, fault: Option<RadioFault>) {
        self.fault = fault;
        if let Some(chip) = &mut self.chip {
            chip.set_fault(fault);
        }
    }

    /// Ethernet frames that the firmware has sent into the air since they were taken last, oldest first.
    pub fn take_sent(&mut self) -> Vec<Vec<u8>> {
        std::mem::take(&mut self.air.sent)
    }

    /// A frame from the air for the firmware. False when it is lost: the chip's queue of 16 frames is full, or the radio
    /// has no network.
    pub fn send(&mut self, frame: &[u8]) -> bool {
        let now = self.now;
        self.chip
            .as_mut()
            .is_some_and(|chip| chip.wlan.receive_frame(frame, now))
    }

    /// The station's address.
    pub fn mac(&self) -> [u8; 6] {
        ADDRESS
    }

    /// The access point that is up, if any.
    pub fn access_point(&self) -> Option<&AccessPoint> {
        self.chip.as_ref()?.wlan.radio.access_point()
    }

    /// The level that the driver has set of one of the chip's own GPIOs, 0 to 2.
    pub fn gpio(&self, number: usize) -> Option<bool> {
        self.chip.as_ref()?.wlan.radio.settings.gpios[number]
    }

    /// A network comes into range of the station; one of the same name is replaced.
    pub fn add_network(&mut self, network: Network) {
        self.air.networks.retain(|other| other.ssid != network.ssid);
        self.air.networks.push(network);
    }

    /// A network is no longer in range: a station that was in it loses it.
    pub fn remove_network(&mut self, ssid: &str) {
        self.air.networks.retain(|network| network.ssid != ssid);
        let now = self.now;
        if let Some(chip) = &mut self.chip {
            chip.wlan.lose(ssid, now);
        }
    }

    /// The network that the station is in excludes it: DEAUTH is the only event.
    pub fn deauthenticated(&mut self) {
        let now = self.now;
        if let Some(chip) = &mut self.chip {
            chip.wlan.deauthenticated(now);
        }
    }

    /// The name of the network that the station is in.
    pub fn joined(&self) -> Option<&str> {
        self.chip.as_ref()?.wlan.radio.joined()
    }

    /// A client joins the access point.
    pub fn client_joined(&mut self, mac: [u8; 6]) {
        for kind in [Kind::AuthInd, Kind::AssocInd] {
            self.emit(Event::new(kind, Status::Success).of(mac));
        }
    }

    /// A client leaves the access point.
    pub fn client_left(&mut self, mac: [u8; 6]) {
        for kind in [Kind::DisassocInd, Kind::DeauthInd] {
            let event = Event::new(kind, Status::Success).of(mac);
            self.emit(event.because(REASON_STATION_LEAVES));
        }
    }

    fn emit(&mut self, event: Event) {
        let now = self.now;
        if let Some(chip) = &mut self.chip {
            chip.wlan.emit(event, now);
        }
    }

    /// Whether the power pin is high.
    pub fn is_powered(&self) -> bool {
        self.chip.is_some()
    }

    /// Whether the program was accepted, started, and takes packets by now.
    pub fn is_running(&self) -> bool {
        self.chip
            .as_ref()
            .is_some_and(|chip| chip.takes_packets(self.now))
    }

    /// Whether a program that is not the chip's was started since the chip has power.
    pub fn refused_download(&self) -> bool {
        self.chip.as_ref().is_some_and(Chip::has_refused_program)
    }

    /// Whether the pin that selects the chip, low, connects VSYS/3 to the converter: while it is high, or floats.
    pub fn connects_vsys(&self) -> bool {
        self.levels.is_high(SELECT) || self.wiring.floats(SELECT, self.outputs)
    }

    /// The RP2040's pins are set up so from now on.
    pub fn set_wiring(&mut self, wiring: Wiring, now: Cycle) {
        if wiring != self.wiring {
            self.wiring = wiring;
            self.follow_levels(now);
        }
    }

    /// The level that the chip puts on the data line; `None`: it does not drive it.
    pub fn data_line(&self) -> Option<bool> {
        let chip = self.chip.as_ref()?;
        if chip.is_silent() {
            Some(false)
        } else if self.levels.is_high(SELECT) {
            Some(chip.is_interrupt_high())
        } else {
            self.serial.line()
        }
    }

    fn follow_levels(&mut self, now: Cycle) {
        self.now = now;
        let before = self.levels;
        self.levels = self.wiring.levels(self.outputs);
        let levels = self.levels;
        let is = |pin| levels.is_high(pin);
        if is(POWER) != before.is_high(POWER) {
            let random = Random::new(self.random.next_u64());
            self.chip = is(POWER).then(|| Chip::new(self.expected, ADDRESS, random, now));
            self.set_fault(self.fault);
        }
        let Some(chip) = &mut self.chip else {
            return;
        };
        if is(SELECT) {
            self.serial = Serial::default();
        } else if is(CLOCK) != before.is_high(CLOCK) {
            let mut functions = chip.with_air(&mut self.air);
            match is(CLOCK) {
                true => self.serial.rising_edge(is(DATA), &mut functions, now),
                false => self.serial.falling_edge(&functions),
            }
        }
    }
}

impl PinDevice for Cyw43 {
    fn follow(&mut self, outputs: Outputs, now: Cycle) {
        if outputs != self.outputs {
            self.outputs = outputs;
            self.follow_levels(now);
        }
    }

    fn levels(&self) -> Outputs {
        let data = 1 << DATA & self.wiring.input_enabled;
        self.data_line().map_or(Outputs::default(), |is_high| Outputs {
            driven: data,
            high: if is_high { data } else { 0 },
        })
    }

    fn advance(&mut self, now: Cycle) {
        self.now = now;
        if let Some(chip) = &mut self.chip {
            chip.wlan.advance(&self.air, now);
        }
    }

    fn next_event(&self) -> Cycle {
        self.chip.as_ref().map_or(NEVER, |chip| chip.wlan.next_event())
    }
}
