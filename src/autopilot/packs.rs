//! The packs: sampled one after the other in each tick, sums last.

use core::mem;

use heapless::Vec;

use crate::battery::{
    BatteryBank, BatteryMonitor, MAX_ANSWERING, Measurement, PackSource, ReadError, SumVoltage, Tick,
};
use crate::memory::in_place::in_place;
use crate::pack::{MAX_PACKS, Pack, PackSet};
use crate::parameter::{MonitorKind, Parameters};
use crate::sensor::{
    AnalogPin, AnalogReadings, AnalogWiring, ControllerBank, ControllerReading, ExternalSource, FuelMeter,
    FuelReadings, Members, PinPull, PinUse, Pulses, Samples, Thermometers, WantedReadings, capacity_ml,
    packs_with_thermometer, part_address, set_up_error, tank, thermometer_pins, timeout_us,
};
use crate::time::Instant;
use crate::vehicle::ArmState;

/// A pull for each analog pin, in the order of [`AnalogPin::ALL`].
pub type PinPulls = [PinPull; AnalogPin::ALL.len()];

/// All packs and their latest readings.
#[derive(Debug)]
pub struct Packs {
    pub bank: BatteryBank,
    /// The monitored packs in the order in which they are sampled. Their kinds take effect at boot.
    pub order: Vec<(Pack, MonitorKind), MAX_PACKS>,
    /// Packs announced to have a voltage above `MOT_DRV_VOLT`.
    pub announced_too_high: PackSet,
    /// Sources of the packs, by the parameters at boot.
    pub read_from: [PackSource; MAX_PACKS],
    /// Sources of their currents, by the parameters at boot.
    current_sources_at_boot: [u16; MAX_PACKS],
    /// Why a pack can't be read with the parameters at boot.
    set_up_errors: [Option<ReadError>; MAX_PACKS],
    samples: [Samples; MAX_PACKS],
    pub silences: [Silence; MAX_PACKS],
    pub sources: [ExternalSource; MAX_PACKS],
    controllers: ControllerBank,
    pub pulses: Pulses,
    meters: [FuelMeter; MAX_PACKS],
    pub thermometers: Thermometers,
    /// Addresses on the I2C bus, by the parameters at boot, where a pack's part can have one only.
    pub part_addresses: [Option<u8>; MAX_PACKS],
    /// Packs whose part was announced as not found and has not answered since.
    pub not_found: PackSet,
    /// Addresses that answered then.
    pub answering: [Option<u8>; MAX_ANSWERING],
    /// The packs that had a thermometer a second ago.
    with_thermometer: PackSet,
    /// Present pulls of the analog pins.
    pub pulls: PinPulls,
    /// Revision of the parameters by which the three below are, once there is one.
    followed: Option<u32>,
    /// Pins that the packs read, and as what.
    pins: PinUse,
    /// Readings that packs and thermometers need.
    wanted: WantedReadings,
    /// Sources of the packs' currents.
    current_sources: [u16; MAX_PACKS],
    pub ticks: u32,
    /// When the latest tick began.
    pub ticked_at: Instant,
}

impl Packs {
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new(parameters: &Parameters) -> Self {
        Self {
            order: in_place(|| sampling_order(parameters)),
            announced_too_high: PackSet::NONE,
            read_from: in_place(|| sources(parameters)),
            current_sources_at_boot: in_place(|| current_sources_at_boot(parameters)),
            set_up_errors: in_place(|| set_up_errors(parameters)),
            samples: in_place(|| [Samples::new(); MAX_PACKS]),
            silences: in_place(|| silences(parameters)),
            sources: in_place(|| [ExternalSource::default(); MAX_PACKS]),
            controllers: in_place(ControllerBank::default),
            pulses: Pulses::NONE,
            meters: in_place(|| [FuelMeter::default(); MAX_PACKS]),
            thermometers: Thermometers::default(),
            part_addresses: in_place(|| part_addresses(parameters)),
            not_found: PackSet::NONE,
            answering: [None; MAX_ANSWERING],
            with_thermometer: packs_with_thermometer(parameters),
            pulls: PinPulls::default(),
            followed: None,
            pins: PinUse::default(),
            wanted: WantedReadings::NONE,
            current_sources: [0; MAX_PACKS],
            ticks: 0,
            ticked_at: Instant::EPOCH,
            // Last: behind too many others the compiler would build it on the stack.
            bank: in_place(|| BatteryBank::new(|pack| parameters.is_monitored(pack))),
        }
    }

    /// Battery reset of these packs, which is in force when this returns.
    pub fn reset(&mut self, packs: PackSet, percent: f32, parameters: &Parameters, arm_state: ArmState) {
        for (pack, kind) in &self.order {
            if packs.contains(*pack) {
                let settings = parameters.pack(*pack).settings_of_kind(Some(*kind));
                let (monitor, state) = self.bank.get_mut(*pack);
                monitor.reset(state, arm_state.into(), percent, &settings);
            }
        }
    }

    /// A changed scale of the measurements is one of the estimates.
    pub fn follow_scales(&mut self, parameters: &Parameters) {
        for (pack, kind) in &self.order {
            if let Some(measuring) = parameters.pack(*pack).measuring(*kind) {
                let (monitor, state) = self.bank.get_mut(*pack);
                monitor.follow(&measuring, state.cell_count);
            }
        }
    }

    /// Follows the pins, the readings at them and the sources of currents. Nine packs have too many parameters for every tick.
    pub fn follow_wiring(&mut self, parameters: &Parameters) {
        if self.followed.replace(parameters.revision()) != Some(parameters.revision()) {
            self.change_wiring(parameters);
        }
    }

    // Inlined, it would be among what runs in every tick.
    #[inline(never)]
    fn change_wiring(&mut self, parameters: &Parameters) {
        self.pins = PinUse::of_packs(&self.order, parameters);
        self.wanted = self.needed_readings(parameters);
        let sources = self.current_sources.iter_mut().zip(self.current_sources_at_boot);
        for (pack, (source, at_boot)) in Pack::ALL.into_iter().zip(sources) {
            *source = parameters.pack(pack).current_source(at_boot);
        }
    }

    /// Follows the source of a pack's current, before its reading.
    pub fn follow_current(&mut self, pack: Pack) {
        let source = self.current_sources[pack as usize];
        self.bank.get_mut(pack).0.follow_current(source);
    }

    /// A pack whose thermometer was taken away is not too hot any more, nor is a sum that it is a member of.
    pub fn follow_thermometers(&mut self, parameters: &Parameters) {
        let with_thermometer = packs_with_thermometer(parameters);
        let before = mem::replace(&mut self.with_thermometer, with_thermometer);
        let without = before - with_thermometer;
        for pack in Pack::ALL {
            let (monitor, state) = self.bank.get_mut(pack);
            let members = PackSet::from_bits(state.members);
            if without.contains(pack) || !(without & members).is_empty() {
                monitor.forget_temperature();
            }
        }
    }

    /// Pulls that the parameters want: up at a thermometer, unless a pack has its pin.
    pub fn wanted_pulls(&self, parameters: &Parameters) -> PinPulls {
        let mut pulls = PinPulls::default();
        for (_, pin) in thermometer_pins(parameters) {
            if let Some(pull) = pulls.get_mut(pin as usize)
                && !self.pins.contains(pin)
            {
                *pull = PinPull::Up;
            }
        }
        pulls
    }

    /// The readings that packs and thermometers need, by the wiring that is followed. Packs may share a pin.
    pub fn wanted_readings(&self) -> WantedReadings {
        self.wanted
    }

    fn needed_readings(&self, parameters: &Parameters) -> WantedReadings {
        let mut wanted = WantedReadings::NONE;
        for (_, pin) in thermometer_pins(parameters) {
            wanted.add(pin);
        }
        for (pack, kind) in &self.order {
            let wiring = AnalogWiring::from_parameters(parameters.pack(*pack));
            for pin in wiring.pins(*kind) {
                wanted.add(pin);
            }
            if let Some((voltage_pin, current_pin)) = wiring.power_pins(*kind) {
                wanted.add_pair(voltage_pin, current_pin);
            }
        }
        wanted
    }

    /// Takes a motor controller's reading, for every pack that it is a member of.
    pub fn add_controller_reading(
        &mut self,
        index: u8,
        reading: ControllerReading,
        now: Instant,
        parameters: &Parameters,
    ) {
        self.controllers.add(index, reading, now);
        for pack in Pack::ALL {
            if !self.is_of_kind(pack, MonitorKind::Esc) {
                continue;
            }
            let members = Members::from_parameters(parameters.pack(pack));
            if let Some(measurement) = self.controllers.measure(members, index, now) {
                self.add_reading(pack, Ok(measurement), now);
            }
        }
    }

    /// Measures a pack in a tick, from what the pins read and the share of full throttle, for a synthetic current. `None`
    /// between two readings: then its state stands.
    ///
    /// # Errors
    /// The read failed, no reading came in time, or it lacks the voltage that its kind measures.
    pub fn measure(
        &mut self,
        pack: Pack,
        kind: MonitorKind,
        tick: Tick,
        readings: &AnalogReadings,
        parameters: &Parameters,
        effort: f32,
    ) -> Option<Result<Measurement, ReadError>> {
        if let Some(error) = self.set_up_errors[pack as usize] {
            return Some(Err(error));
        }
        if self.ticks == 0 {
            self.silences[pack as usize].restart(tick.now);
        }
        match self.read(pack, kind, tick, readings, parameters, effort) {
            Some(Ok(Measurement { voltage_v: None, .. })) if kind.measures_voltage() => {
                Some(Err(ReadError::Implausible))
            }
            None if self.silences[pack as usize].is_overdue(tick.now) => {
                Some(Err(self.samples[pack as usize].why_none()))
            }
            reading => reading,
        }
    }

    /// Reads what is read in each tick, and takes what was received since the last tick.
    fn read(
        &mut self,
        pack: Pack,
        kind: MonitorKind,
        tick: Tick,
        readings: &AnalogReadings,
        parameters: &Parameters,
        effort: f32,
    ) -> Option<Result<Measurement, ReadError>> {
        Some(match kind {
            MonitorKind::Bus(_)
            | MonitorKind::External
            | MonitorKind::Can
            | MonitorKind::Esc
            | MonitorKind::GeneratorElectrical
            | MonitorKind::GeneratorFuel
            | MonitorKind::Torqeedo
            | MonitorKind::Efi => return self.samples[pack as usize].take(),
            // Parts on the bus have no reading yet.
            MonitorKind::Sum if self.ticks == 0 => return None,
            MonitorKind::Sum => {
                let settings = parameters.pack(pack);
                let voltage = SumVoltage::from_parameters(settings);
                // The packs of another sum would count twice.
                let others = self.order.iter().filter(|(_, kind)| *kind != MonitorKind::Sum);
                let summable = others.map(|(pack, _)| *pack).collect();
                self.bank
                    .sum(pack, settings.named_members(), summable, voltage, tick.load_state)
            }
            MonitorKind::Fuel(fuel) => {
                let is_taken = self.pins.is_taken(kind, parameters, pack);
                let readings = FuelReadings {
                    pins: readings,
                    pulses: &self.pulses,
                    now: tick.now,
                };
                // Pulses that are taken meanwhile must not count later.
                let measured = self.meters[pack as usize].measure(fuel, parameters.pack(pack), &readings);
                if is_taken {
                    Err(ReadError::PinTaken)
                } else {
                    measured
                }
            }
            MonitorKind::AnalogVoltage
            | MonitorKind::AnalogVoltageAndCurrent
            | MonitorKind::SyntheticCurrent
            | MonitorKind::AnalogCurrent => {
                let wiring = AnalogWiring::from_parameters(parameters.pack(pack));
                let is_taken = self.pins.has_other_use(&wiring, kind);
                // The voltage goes on.
                let measured = match kind {
                    MonitorKind::AnalogVoltageAndCurrent if is_taken => MonitorKind::AnalogVoltage,
                    _ if is_taken => return Some(Err(ReadError::PinTaken)),
                    _ => kind,
                };
                wiring.measure(measured, readings, effort)
            }
        })
    }

    /// Adds a reading of a pack of this kind, which was received at `received_at`, or the reason why there is none. That of
    /// any other pack is ignored.
    pub fn add(
        &mut self,
        pack: Pack,
        kind: MonitorKind,
        reading: Result<Measurement, ReadError>,
        received_at: Instant,
    ) {
        if self.is_of_kind(pack, kind) {
            self.add_reading(pack, reading, received_at);
        }
    }

    /// Adds a reading of whatever kind the pack is, which was received at `received_at`, or the reason why there is none.
    pub fn add_reading(&mut self, pack: Pack, reading: Result<Measurement, ReadError>, received_at: Instant) {
        self.samples[pack as usize].add(reading);
        if reading.is_ok() {
            self.not_found.remove(pack);
            self.silences[pack as usize].hear(received_at);
        }
    }

    /// Adds a reading of what measures all packs of this kind, or the reason why there is none.
    pub fn add_to_all(
        &mut self,
        kind: MonitorKind,
        reading: Result<Measurement, ReadError>,
        received_at: Instant,
    ) {
        for pack in Pack::ALL {
            self.add(pack, kind, reading, received_at);
        }
    }

    /// Adds a reading of a generator's tank, of which only the share is known that it contains.
    pub fn add_tank(&mut self, measurement: Measurement, parameters: &Parameters, received_at: Instant) {
        let Some(share) = measurement.state_of_charge else {
            return;
        };
        for pack in Pack::ALL {
            let reading = tank(share, capacity_ml(parameters.pack(pack)));
            self.add(pack, MonitorKind::GeneratorFuel, reading, received_at);
        }
    }

    /// The packs that are monitored, in the order of their instances.
    pub fn monitors(&self) -> impl Iterator<Item = (Pack, &BatteryMonitor)> {
        self.bank
            .monitors()
            .filter(|(pack, _)| self.kind(*pack).is_some())
    }

    /// The kind of a pack's monitor since boot; `None` if it is not monitored.
    pub fn kind(&self, pack: Pack) -> Option<MonitorKind> {
        let own = self.order.iter().find(|(monitored, _)| *monitored == pack);
        own.map(|(_, kind)| *kind)
    }

    /// Whether a pack is of this kind since boot.
    pub fn is_of_kind(&self, pack: Pack, kind: MonitorKind) -> bool {
        self.order.contains(&(pack, kind))
    }

    /// The packs that are of this kind since boot, in the order of their instances.
    pub fn of_kind(&self, kind: MonitorKind) -> impl Iterator<Item = Pack> {
        let is_wanted = move |(_, own): &&(Pack, MonitorKind)| *own == kind;
        self.order.iter().filter(is_wanted).map(|(pack, _)| *pack)
    }
}

/// Sums come last: they are of the same tick's states.
fn sampling_order(parameters: &Parameters) -> Vec<(Pack, MonitorKind), MAX_PACKS> {
    let mut order = Vec::new();
    for is_turn_of_sums in [false, true] {
        for pack in Pack::ALL {
            if let Some(kind) = parameters.monitor_kind(pack)
                && (kind == MonitorKind::Sum) == is_turn_of_sums
            {
                // There is room for every pack.
                let _ = order.push((pack, kind));
            }
        }
    }
    order
}

fn sources(parameters: &Parameters) -> [PackSource; MAX_PACKS] {
    Pack::ALL.map(|pack| parameters.pack(pack).source())
}

fn set_up_errors(parameters: &Parameters) -> [Option<ReadError>; MAX_PACKS] {
    Pack::ALL.map(|pack| set_up_error(parameters.monitor_kind(pack)?, parameters))
}

fn current_sources_at_boot(parameters: &Parameters) -> [u16; MAX_PACKS] {
    Pack::ALL.map(|pack| parameters.pack(pack).current_source_at_boot())
}

fn part_addresses(parameters: &Parameters) -> [Option<u8>; MAX_PACKS] {
    Pack::ALL.map(|pack| part_address(parameters, pack))
}

fn silences(parameters: &Parameters) -> [Silence; MAX_PACKS] {
    Pack::ALL.map(|pack| {
        let kind = parameters.monitor_kind(pack);
        Silence::new(kind.map_or(0, |kind| timeout_us(kind, parameters)))
    })
}

/// For how long a pack has had no valid reading: whatever it is read from, its read fails after the time-out.
#[derive(Clone, Copy, Debug)]
pub struct Silence {
    timeout_us: u64,
    /// When the latest reading was received, valid or not.
    heard_at: Instant,
    /// When the latest valid reading was received, or the time-out began.
    valid_at: Instant,
}

impl Silence {
    /// Nothing was received yet.
    const fn new(timeout_us: u64) -> Self {
        Self {
            timeout_us,
            heard_at: Instant::EPOCH,
            valid_at: Instant::EPOCH,
        }
    }

    /// The time-out begins: it is the first tick, or the source answers without a reading.
    pub fn restart(&mut self, now: Instant) {
        self.valid_at = now;
    }

    /// A reading was received at `at`.
    fn hear(&mut self, at: Instant) {
        self.heard_at = self.heard_at.max(at);
    }

    /// The latest reading was valid.
    pub fn confirm(&mut self) {
        self.valid_at = self.valid_at.max(self.heard_at);
    }

    /// Whether a reading is overdue, in a tick without one.
    fn is_overdue(&self, now: Instant) -> bool {
        now.us_since(self.valid_at) >= self.timeout_us
    }
}
