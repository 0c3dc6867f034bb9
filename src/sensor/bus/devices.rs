//! The parts on the bus, and when which is read.

use heapless::Vec;

use super::part::FAST_MODE_HZ;
use super::registry::AnyPart;
use super::{Address, SensorBus, Wiring};
use crate::battery::{BusError, Measurement, ReadError};
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{MonitorKind, Parameters, PartKind};
use crate::time::{Cadence, Instant};

/// Failures in a row before a part's back-off period, so that it does not hold up the others.
const FAILURES_UNTIL_REST: u8 = 3;

/// At most this much of it: ArduPilot looks for a missing part as often.
const REST_US: u64 = 200_000;

/// The address of a device.
#[derive(Clone, Copy, Debug, PartialEq)]
enum DeviceAddress {
    /// Set by a parameter.
    Set(Address),
    /// To be found.
    Unknown,
    /// Found by a search. It stays: after a loose contact no pack must be mistaken for another.
    Found(Address),
    /// Another device is there.
    Taken,
}

/// A part on the bus.
#[derive(Debug)]
struct BusDevice {
    kind: PartKind,
    place: DeviceAddress,
    part: Option<AnyPart>,
    failures: u8,
    cadence: Cadence,
}

/// A pack that is measured by a part on the bus.
#[derive(Debug)]
struct BusPack {
    pack: Pack,
    wiring: Wiring,
    /// Which of the parts.
    device: usize,
}

/// All parts on the bus, and the packs that they measure.
#[derive(Debug, Default)]
pub struct BusDevices {
    devices: Vec<BusDevice, MAX_PACKS>,
    packs: Vec<BusPack, MAX_PACKS>,
}

impl BusDevices {
    /// The parts the parameters name. Packs share a part with several channels if their address is set alike.
    pub fn from_parameters(parameters: &Parameters, now: Instant) -> Self {
        let mut devices = Self::default();
        for pack in Pack::ALL {
            if let Some(kind) = part_of(parameters, pack) {
                devices.add(kind, pack, Wiring::from_parameters(parameters, pack), now);
            }
        }
        devices
    }

    fn add(&mut self, kind: PartKind, pack: Pack, wiring: Wiring, now: Instant) {
        let shared = (0..self.devices.len()).find(|device| self.has_room_for(*device, kind, &wiring));
        let device = shared.unwrap_or_else(|| self.add_device(kind, &wiring, now));
        // There is room for every pack.
        let _ = self.packs.push(BusPack { pack, wiring, device });
    }

    /// Returns its number.
    fn add_device(&mut self, kind: PartKind, wiring: &Wiring, now: Instant) -> usize {
        let place = match wiring.address {
            Some(address) if self.taken().any(|taken| taken == address) => DeviceAddress::Taken,
            Some(address) => DeviceAddress::Set(address),
            None => DeviceAddress::Unknown,
        };
        let interval_us = kind.interval_us();
        let _ = self.devices.push(BusDevice {
            kind,
            place,
            part: None,
            failures: 0,
            // Between two ticks of the battery task, which starts at the same time: a delay on the bus must not put two
            // readings into one tick and none into the next.
            cadence: Cadence::starting_at(now.after_us(interval_us / 2), interval_us),
        });
        self.devices.len() - 1
    }

    /// Whether a part has a channel for another pack that is set alike.
    fn has_room_for(&self, device: usize, kind: PartKind, wiring: &Wiring) -> bool {
        let is_of_kind = self.devices.get(device).is_some_and(|device| device.kind == kind);
        let mut packs = self.packs.iter().filter(|other| other.device == device);
        let is_set_alike = packs
            .next()
            .is_some_and(|first| first.wiring.address == wiring.address);
        is_of_kind && is_set_alike && 1 + packs.count() < kind.channels()
    }

    fn taken(&self) -> impl Iterator<Item = Address> {
        self.devices.iter().filter_map(|device| match device.place {
            DeviceAddress::Set(address) | DeviceAddress::Found(address) => Some(address),
            DeviceAddress::Unknown | DeviceAddress::Taken => None,
        })
    }

    /// When the next part has to be read.
    pub fn next_due(&self) -> Option<Instant> {
        let due = self.devices.iter().map(|device| device.cadence.due());
        due.min()
    }

    /// Reads the part that has waited longest, if it is due at `now`, and hands over its reading of each of its packs.
    pub async fn read_next(
        &mut self,
        bus: &mut impl SensorBus,
        now: Instant,
        mut deliver: impl FnMut(Pack, Result<Measurement, ReadError>),
    ) {
        let mut taken: Vec<Address, MAX_PACKS> = Vec::new();
        for address in self.taken() {
            // There is room for the part of every pack.
            let _ = taken.push(address);
        }
        let devices = self.devices.iter_mut().enumerate();
        let Some((number, device)) = devices.min_by_key(|(_, device)| device.cadence.due()) else {
            return;
        };
        if !device.cadence.take(now) {
            return;
        }
        let packs = self.packs.iter().filter(|pack| pack.device == number);
        let is_new = device.part.is_none();
        let result = device.read(bus, packs.clone(), &taken, &mut deliver).await;
        // Contacts bounce while a part is plugged in: what it did not answer then must not count as refused.
        if is_new && device.kind.refuses_commands() && (device.failures > 0 || result.is_err()) {
            device.part = None;
        }
        device.note(result, now);
        if let Err(error) = result {
            packs.for_each(|pack| deliver(pack.pack, Err(error)));
        }
    }
}

/// The kind of part that measures a pack; `None` if no part on the bus does.
fn part_of(parameters: &Parameters, pack: Pack) -> Option<PartKind> {
    match parameters.monitor_kind(pack)? {
        MonitorKind::Bus(kind) => Some(kind),
        _ => None,
    }
}

/// The fastest clock that every part the parameters name stands, in Hz.
pub fn bus_clock_hz(parameters: &Parameters) -> u32 {
    let kinds = Pack::ALL.into_iter().filter_map(|pack| part_of(parameters, pack));
    kinds
        .map(PartKind::highest_clock_hz)
        .min()
        .unwrap_or(FAST_MODE_HZ)
}

impl BusDevice {
    async fn read<'a>(
        &mut self,
        bus: &mut impl SensorBus,
        packs: impl Iterator<Item = &'a BusPack> + Clone,
        taken: &[Address],
        deliver: &mut impl FnMut(Pack, Result<Measurement, ReadError>),
    ) -> Result<(), ReadError> {
        let part = match &mut self.part {
            Some(part) => {
                part.check(bus).await?;
                part
            }
            none => {
                let first = packs.clone().next().ok_or(ReadError::NoPin)?;
                let (address, part) = find(self.kind, self.place, &first.wiring, bus, taken).await?;
                if self.place == DeviceAddress::Unknown {
                    self.place = DeviceAddress::Found(address);
                }
                none.insert(part)
            }
        };
        for BusPack { pack, wiring, .. } in packs {
            match part.read(bus, wiring).await {
                // Another pack of the part may be wired all right.
                Err(error) if error.is_configuration() => deliver(*pack, Err(error)),
                reading => deliver(*pack, Ok(reading?)),
            }
        }
        Ok(())
    }

    fn note(&mut self, result: Result<(), ReadError>, now: Instant) {
        match result {
            Ok(()) => {
                self.failures = 0;
                return;
            }
            // The part is not there any more, or is not set up any more. Even whether there is a check byte depends
            // on the part.
            Err(ReadError::OtherPart | ReadError::Bus(BusError::Checksum)) => self.part = None,
            Err(_) => {}
        }
        self.failures = self.failures.saturating_add(1);
        if self.failures >= FAILURES_UNTIL_REST {
            self.cadence.skip_until(now.after_us(REST_US));
        }
    }
}

/// Sets up the part where it has to be, or where it is found.
async fn find(
    kind: PartKind,
    place: DeviceAddress,
    wiring: &Wiring,
    bus: &mut impl SensorBus,
    taken: &[Address],
) -> Result<(Address, AnyPart), ReadError> {
    match place {
        DeviceAddress::Taken => Err(ReadError::AddressTaken),
        DeviceAddress::Set(address) | DeviceAddress::Found(address) => {
            Ok((address, kind.set_up(bus, address, wiring).await?))
        }
        DeviceAddress::Unknown => {
            let free = kind.addresses().iter().filter(|address| !taken.contains(address));
            let mut error = ReadError::Bus(BusError::NoAnswer);
            for address in free {
                match kind.set_up(bus, *address, wiring).await {
                    Ok(part) => return Ok((*address, part)),
                    Err(ReadError::Bus(BusError::NoAnswer)) => {}
                    // It may be another part's.
                    Err(ReadError::OtherPart) => error = ReadError::OtherPart,
                    Err(error) => return Err(error),
                }
            }
            Err(error)
        }
    }
}
