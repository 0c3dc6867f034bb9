//! The parts on the bus, and when which is read.

use core::mem;

use heapless::Vec;

use super::part::{FAST_MODE_HZ, Sharing};
use super::registry::AnyPart;
use super::{Address, SensorBus, Wiring};
use crate::battery::{BusError, MAX_ANSWERING, Measurement, ReadError, SupplyEvent};
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{BatteryParameter, MonitorKind, Parameters, PartKind};
use crate::time::{Cadence, Instant};
use crate::vehicle::ArmState;

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

impl DeviceAddress {
    /// On the I2C bus, if it is known.
    fn number(self) -> Option<u8> {
        match self {
            Self::Set(Address::I2c(number)) | Self::Found(Address::I2c(number)) => Some(number),
            Self::Set(Address::ChipSelect)
            | Self::Found(Address::ChipSelect)
            | Self::Unknown
            | Self::Taken => None,
        }
    }
}

/// A part on the bus.
#[derive(Debug)]
struct BusDevice {
    kind: PartKind,
    place: DeviceAddress,
    /// Place among the addresses of its kind at which the search goes on.
    next_address: u8,
    part: Option<AnyPart>,
    failures: u8,
    /// Whether another part was looked for in its place, or it was announced.
    was_announced: bool,
    cadence: Cadence,
}

/// A pack that is measured by a part on the bus.
#[derive(Debug)]
struct BusPack {
    pack: Pack,
    wiring: Wiring,
    /// Which of the parts.
    device: usize,
    /// Whether the range of its current was announced, or need not be.
    range_was_announced: bool,
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
        let i2c_clock_hz = bus_clock_hz(parameters);
        for pack in Pack::ALL {
            if let Some(kind) = part_of(parameters, pack) {
                let wiring = Wiring::from_parameters(parameters.pack(pack), i2c_clock_hz);
                devices.add(kind, pack, wiring, now);
            }
        }
        devices
    }

    fn add(&mut self, kind: PartKind, pack: Pack, wiring: Wiring, now: Instant) {
        let shared = (0..self.devices.len()).find(|device| self.is_shared(*device, kind, &wiring));
        let device = match shared {
            Some(device) if self.has_room_for(device, kind, &wiring) => device,
            Some(_) => self.add_device(kind, DeviceAddress::Taken, now),
            None => self.add_device(kind, self.place_of(&wiring), now),
        };
        // There is room for every pack.
        let _ = self.packs.push(BusPack {
            pack,
            wiring,
            device,
            range_was_announced: false,
        });
    }

    fn place_of(&self, wiring: &Wiring) -> DeviceAddress {
        match wiring.address {
            Some(address) if self.taken().contains(&address) => DeviceAddress::Taken,
            Some(address) => DeviceAddress::Set(address),
            None => DeviceAddress::Unknown,
        }
    }

    /// Returns its number.
    fn add_device(&mut self, kind: PartKind, place: DeviceAddress, now: Instant) -> usize {
        let interval_us = kind.interval_us();
        let _ = self.devices.push(BusDevice {
            kind,
            place,
            next_address: 0,
            part: None,
            failures: 0,
            was_announced: false,
            // Between two ticks of the battery task, which starts at the same time: a delay on the bus must not put two
            // readings into one tick and none into the next.
            cadence: Cadence::starting_at(now.after_us(interval_us / 2), interval_us),
        });
        self.devices.len() - 1
    }

    /// Whether a pack that is set alike measures with this part, too.
    fn is_shared(&self, device: usize, kind: PartKind, wiring: &Wiring) -> bool {
        let is_of_kind = self.devices.get(device).is_some_and(|device| device.kind == kind);
        let is_set_alike = |first: &BusPack| first.wiring.address == wiring.address;
        is_of_kind
            && kind.sharing() != Sharing::None
            && self.packs_of(device).next().is_some_and(is_set_alike)
    }

    /// Whether no other pack of this part uses the channel.
    fn has_room_for(&self, device: usize, kind: PartKind, wiring: &Wiring) -> bool {
        let is_at_channel = |other: &BusPack| other.wiring.channel == wiring.channel;
        kind.sharing() == Sharing::ByPin || !self.packs_of(device).any(is_at_channel)
    }

    fn packs_of(&self, device: usize) -> impl Iterator<Item = &BusPack> {
        self.packs.iter().filter(move |pack| pack.device == device)
    }

    /// Packs at the pins of the part that is due next follow the parameters.
    pub fn follow(&mut self, parameters: &Parameters) {
        let Some((number, device)) = self.next_device() else {
            return;
        };
        if device.kind.sharing() == Sharing::ByPin {
            for pack in self.packs.iter_mut().filter(|pack| pack.device == number) {
                pack.wiring = Wiring::from_parameters(parameters.pack(pack.pack), pack.wiring.i2c_clock_hz);
            }
        }
    }

    /// The part that is due next, with its number.
    fn next_device(&self) -> Option<(usize, &BusDevice)> {
        let devices = self.devices.iter().enumerate();
        devices.min_by_key(|(_, device)| device.cadence.due())
    }

    /// When the next part has to be read.
    pub fn next_due(&self) -> Option<Instant> {
        self.next_device().map(|(_, device)| device.cadence.due())
    }

    /// The addresses of parts that are set or were found.
    fn taken(&self) -> Vec<Address, MAX_PACKS> {
        let mut taken = Vec::new();
        for device in &self.devices {
            if let DeviceAddress::Set(address) | DeviceAddress::Found(address) = device.place {
                // There is room for the part of every pack.
                let _ = taken.push(address);
            }
        }
        taken
    }

    /// Reads the part that has waited longest, if it is due at `now`, and hands over its reading of each of its packs. Returns
    /// something to announce: a smart battery that was met, the range of a current, or what answers in place of a part that is not found.
    pub async fn read_next(
        &mut self,
        bus: &mut impl SensorBus,
        now: Instant,
        arm_state: ArmState,
        mut deliver: impl FnMut(Pack, Result<Measurement, ReadError>),
    ) -> Option<(Pack, SupplyEvent)> {
        let taken = self.taken();
        let (number, _) = self.next_device()?;
        let device = self.devices.get_mut(number)?;
        if !device.cadence.take(now) {
            return None;
        }
        let packs = self.packs.iter().filter(|pack| pack.device == number);
        let first = packs.clone().next()?.pack;
        // Of the latest reading, if it is valid.
        let mut cells = None;
        let mut note_and_deliver = |pack, reading: Result<Measurement, ReadError>| {
            cells = reading.ok().map(|measurement| measurement.cells.number());
            deliver(pack, reading);
        };
        let result = device
            .read(bus, now, packs.clone(), &taken, &mut note_and_deliver)
            .await;
        device.note(result, now);
        match result {
            Ok(()) => match cells.and_then(|cells| device.met(cells)) {
                Some(met) => Some((first, met)),
                None => device.announce_range(self.packs.iter_mut().filter(|pack| pack.device == number)),
            },
            Err(error) => {
                for pack in packs {
                    deliver(pack.pack, Err(error));
                }
                if arm_state == ArmState::Armed {
                    return None;
                }
                let others = device.look_for_others(bus, &taken, error).await?;
                Some((first, others))
            }
        }
    }
}

/// The addresses at which parts are searched, with repetitions.
fn known_addresses() -> impl Iterator<Item = Address> {
    let kinds = MonitorKind::ALL.iter();
    let addresses = kinds.filter_map(|kind| match kind {
        MonitorKind::Bus(part) => Some(part.addresses()),
        _ => None,
    });
    addresses.flatten().copied()
}

/// The kind of part that measures a pack; `None` if no part on the bus does.
fn part_of(parameters: &Parameters, pack: Pack) -> Option<PartKind> {
    match parameters.monitor_kind(pack)? {
        MonitorKind::Bus(kind) => Some(kind),
        _ => None,
    }
}

/// The address of a pack's part on the I2C bus: as set, or the only one that its kind can have. `None` if it is searched at
/// several.
pub fn part_address(parameters: &Parameters, pack: Pack) -> Option<u8> {
    let set = Address::from_parameter(parameters.get_whole(BatteryParameter::I2cAddr.of(pack)));
    let only = match part_of(parameters, pack)?.addresses() {
        [Address::ChipSelect] => return None,
        [only] => Some(*only),
        _ => None,
    };
    match set.or(only)? {
        Address::I2c(number) => Some(number),
        Address::ChipSelect => None,
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
        now: Instant,
        packs: impl Iterator<Item = &'a BusPack> + Clone,
        taken: &[Address],
        deliver: &mut impl FnMut(Pack, Result<Measurement, ReadError>),
    ) -> Result<(), ReadError> {
        let part = match &mut self.part {
            Some(part) => {
                part.begin_turn(bus).await?;
                part
            }
            none => {
                let first = packs.clone().next().ok_or(ReadError::NoPin)?;
                let next = &mut self.next_address;
                let (address, part) = find(self.kind, self.place, next, &first.wiring, bus, taken).await?;
                if self.place == DeviceAddress::Unknown {
                    self.place = DeviceAddress::Found(address);
                }
                let part = none.insert(part);
                let first_result_us = self.kind.first_result_us();
                if first_result_us > 0 {
                    self.cadence.skip_until(now.after_us(first_result_us));
                    return Ok(());
                }
                part
            }
        };
        for BusPack { pack, wiring, .. } in packs {
            match part.read(bus, wiring).await {
                // Another pack of the part may be wired all right, and within its range; or the part has no reading yet.
                Err(error)
                    if error.is_configuration()
                        || matches!(error, ReadError::OverRange | ReadError::Timeout) =>
                {
                    deliver(*pack, Err(error));
                }
                reading => deliver(*pack, Ok(reading?)),
            }
        }
        Ok(())
    }

    /// A smart battery answers for the first time: which one it is can't be seen otherwise.
    fn met(&mut self, cells: Option<u8>) -> Option<SupplyEvent> {
        let address = self.place.number().filter(|_| self.kind.is_announced())?;
        let is_first = !mem::replace(&mut self.was_announced, true);
        is_first.then_some(SupplyEvent::Found { address, cells })
    }

    /// The range of the current of one of its packs, once for each.
    fn announce_range<'a>(
        &self,
        packs: impl IntoIterator<Item = &'a mut BusPack>,
    ) -> Option<(Pack, SupplyEvent)> {
        let part = self.part.as_ref()?;
        packs.into_iter().find_map(|pack| {
            let was_announced = mem::replace(&mut pack.range_was_announced, true);
            let (part, current_a) = part.range(&pack.wiring).filter(|_| !was_announced)?;
            Some((pack.pack, SupplyEvent::Range { part, current_a }))
        })
    }

    /// Nothing was ever found: reads a byte, once, wherever parts are searched.
    async fn look_for_others(
        &mut self,
        bus: &mut impl SensorBus,
        taken: &[Address],
        error: ReadError,
    ) -> Option<SupplyEvent> {
        let is_lost = self.part.is_none() && error == ReadError::Bus(BusError::NoAnswer);
        if !is_lost || self.failures < FAILURES_UNTIL_REST || mem::replace(&mut self.was_announced, true) {
            return None;
        }
        let mut answering = [None; MAX_ANSWERING];
        let mut free = answering.iter_mut();
        let mut asked = 0_u128;
        for address in known_addresses() {
            let Address::I2c(number) = address else { continue };
            let bit = 1 << (number & 0x7f);
            if asked & bit != 0 || taken.contains(&address) {
                continue;
            }
            asked |= bit;
            if bus.write_read(address, &[], &mut [0]).await.is_ok()
                && let Some(place) = free.next()
            {
                *place = Some(number);
            }
        }
        Some(SupplyEvent::NotFound {
            address: self.place.number(),
            answering,
        })
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

/// Sets up the part where it has to be, or where it is found, in a search from `next` on among the addresses of its kind.
async fn find(
    kind: PartKind,
    place: DeviceAddress,
    next: &mut u8,
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
            let mut error = ReadError::Bus(BusError::NoAnswer);
            let from = mem::take(next);
            for (address, behind) in kind.addresses().iter().zip(1..).skip(from.into()) {
                if taken.contains(address) {
                    continue;
                }
                match kind.set_up(bus, *address, wiring).await {
                    Ok(part) => return Ok((*address, part)),
                    // It holds up the other parts: those behind it are looked at in the next turn.
                    Err(error @ ReadError::Bus(BusError::Timeout)) => {
                        *next = behind;
                        return Err(error);
                    }
                    Err(error @ ReadError::Bus(BusError::Stuck)) => return Err(error),
                    Err(ReadError::Bus(BusError::NoAnswer)) => {}
                    // It may be another part's.
                    Err(other) => error = other,
                }
            }
            Err(error)
        }
    }
}
