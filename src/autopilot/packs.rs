//! The packs: sampled one after the other in each tick, sums last.

use heapless::Vec;

use crate::battery::{
    BatteryBank, BatteryState, BusError, Measurement, PackSettings, PackSource, PackStatus, ReadError,
    SumVoltage,
};
use crate::in_place::in_place;
use crate::pack::{MAX_PACKS, Pack};
use crate::parameter::{BatteryParameter, Parameters};
use crate::sensor::{
    AnalogPin, AnalogReadings, AnalogWiring, ControllerBank, ControllerReading, ExternalSource, FuelMeter,
    FuelReadings, Members, MonitorKind, Pulses, Samples, capacity_ml, set_up_error, tank,
};
use crate::time::Instant;

/// Number of analog pins.
pub(super) const PIN_COUNT: usize = AnalogPin::ALL.len();

/// All packs and their latest readings.
#[derive(Debug)]
pub(super) struct Packs {
    pub bank: BatteryBank,
    /// The monitored packs in the order in which they are sampled. Their kinds take effect at boot.
    pub order: Vec<(Pack, MonitorKind), MAX_PACKS>,
    /// What the packs are read from, by the parameters at boot.
    pub read_from: [PackSource; MAX_PACKS],
    /// Why a pack can't be read with the parameters at boot.
    set_up_errors: [Option<ReadError>; MAX_PACKS],
    pub samples: [Samples; MAX_PACKS],
    pub sources: [ExternalSource; MAX_PACKS],
    controllers: ControllerBank,
    pub pulses: Pulses,
    meters: [FuelMeter; MAX_PACKS],
    pub states: [BatteryState; MAX_PACKS],
    pub ticks: u32,
}

impl Packs {
    // Not inlined: see `in_place`.
    #[inline(never)]
    pub fn new(parameters: &Parameters) -> Self {
        Self {
            bank: in_place(BatteryBank::new),
            order: in_place(|| sampling_order(parameters)),
            read_from: in_place(|| sources(parameters)),
            set_up_errors: in_place(|| set_up_errors(parameters)),
            samples: in_place(|| [Samples::new(); MAX_PACKS]),
            sources: in_place(|| [ExternalSource::default(); MAX_PACKS]),
            controllers: in_place(ControllerBank::default),
            pulses: Pulses::NONE,
            meters: in_place(|| [FuelMeter::default(); MAX_PACKS]),
            states: in_place(|| states_at_boot(parameters)),
            ticks: 0,
        }
    }

    /// Battery reset of the packs in `mask` (one bit per instance).
    pub fn reset(&mut self, mask: u16, percent: f32, parameters: &Parameters) {
        for (pack, _) in &self.order {
            if mask & pack.bit() != 0 {
                let settings = PackSettings::from_parameters(parameters, *pack);
                self.bank.monitor(*pack).reset(percent, &settings);
            }
        }
    }

    /// The pins that the packs need. Packs may share a pin.
    pub fn needed_pins(&self, parameters: &Parameters) -> Vec<AnalogPin, PIN_COUNT> {
        let mut needed = [false; PIN_COUNT];
        for (pack, kind) in &self.order {
            for pin in AnalogWiring::from_parameters(parameters, *pack).pins(*kind) {
                if let Some(is_needed) = needed.get_mut(pin as usize) {
                    *is_needed = true;
                }
            }
        }
        let mut pins = Vec::new();
        for (pin, is_needed) in AnalogPin::ALL.into_iter().zip(needed) {
            if is_needed {
                // There is room for every pin.
                let _ = pins.push(pin);
            }
        }
        pins
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
        for (pack, kind) in &self.order {
            if *kind != MonitorKind::Esc {
                continue;
            }
            let members = Members::from_parameters(parameters, *pack);
            if let Some(measurement) = self.controllers.measure(members, index, now) {
                self.samples[*pack as usize].add(Ok(measurement));
            }
        }
    }

    /// Measures a pack at `now`, from what the pins read and the share of full throttle, for a synthetic current.
    /// `None` as long as there is nothing to measure by: a part on the bus that has not been read yet, another
    /// component that has not reported since the last tick, or a sum in the first tick, when parts on the bus have no
    /// reading yet.
    pub fn measure(
        &mut self,
        pack: Pack,
        kind: MonitorKind,
        now: Instant,
        readings: &AnalogReadings,
        parameters: &Parameters,
        effort: f32,
    ) -> Option<Result<Measurement, ReadError>> {
        if let Some(error) = self.set_up_errors[pack as usize] {
            return Some(Err(error));
        }
        Some(match kind {
            MonitorKind::Bus(_)
            | MonitorKind::External
            | MonitorKind::Can
            | MonitorKind::GeneratorElectrical
            | MonitorKind::GeneratorFuel
            | MonitorKind::Torqeedo
            | MonitorKind::Efi => return self.sampled(pack, kind, now),
            MonitorKind::Esc => {
                let reading = self.samples[pack as usize].take();
                reading.unwrap_or(Err(BusError::NoAnswer.into()))
            }
            MonitorKind::Sum if self.ticks == 0 => return None,
            MonitorKind::Sum => {
                let mask = parameters.get_whole(BatteryParameter::SumMask.of(pack)) as u16;
                let voltage = SumVoltage::from_parameters(parameters, pack);
                self.bank.sum(pack, mask, voltage)
            }
            MonitorKind::Fuel(kind) => {
                let readings = FuelReadings {
                    pins: readings,
                    pulses: &self.pulses,
                    now,
                };
                self.meters[pack as usize].measure(kind, parameters, pack, &readings)
            }
            MonitorKind::AnalogVoltage
            | MonitorKind::AnalogVoltageAndCurrent
            | MonitorKind::SyntheticCurrent
            | MonitorKind::AnalogCurrent => {
                let wiring = AnalogWiring::from_parameters(parameters, pack);
                wiring.measure(kind, readings, effort)
            }
        })
    }

    /// Adds a reading of what measures all packs of this kind, or the reason why there is none.
    pub fn add(&mut self, kind: MonitorKind, reading: Result<Measurement, ReadError>) {
        for (pack, measured) in &self.order {
            if *measured == kind {
                self.samples[*pack as usize].add(reading);
            }
        }
    }

    /// Adds a reading of a generator's tank, of which only the share is known that it contains.
    pub fn add_tank(&mut self, measurement: Measurement, parameters: &Parameters) {
        let Some(share) = measurement.state_of_charge else {
            return;
        };
        for (pack, kind) in &self.order {
            if *kind == MonitorKind::GeneratorFuel {
                let reading = tank(share, capacity_ml(parameters, *pack));
                self.samples[*pack as usize].add(reading);
            }
        }
    }

    /// What was sampled since the last tick. What reports at a rate of its own may do so less often: between its readings the
    /// state stays as it is. Whoever reads it reports a silence that is too long; that of another component is noticed here.
    fn sampled(
        &mut self,
        pack: Pack,
        kind: MonitorKind,
        now: Instant,
    ) -> Option<Result<Measurement, ReadError>> {
        let samples = &mut self.samples[pack as usize];
        if !kind.reports_at_own_rate() {
            return samples.take();
        }
        let is_lost = || kind == MonitorKind::External && self.sources[pack as usize].is_lost(now);
        let reading = samples.take_new();
        reading.or_else(|| is_lost().then_some(Err(ReadError::Timeout)))
    }
}

/// Sums come last: they are of the same tick's states.
fn sampling_order(parameters: &Parameters) -> Vec<(Pack, MonitorKind), MAX_PACKS> {
    let mut order = Vec::new();
    for is_turn_of_sums in [false, true] {
        for pack in Pack::ALL {
            if let Some(kind) = MonitorKind::of(parameters, pack)
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
    Pack::ALL.map(|pack| PackSource::from_parameters(parameters, pack))
}

fn set_up_errors(parameters: &Parameters) -> [Option<ReadError>; MAX_PACKS] {
    Pack::ALL.map(|pack| set_up_error(MonitorKind::of(parameters, pack)?, parameters))
}

/// Before the first sample nothing is known of the packs, but which are monitored.
fn states_at_boot(parameters: &Parameters) -> [BatteryState; MAX_PACKS] {
    let mut states = [BatteryState::default(); MAX_PACKS];
    for (pack, state) in Pack::ALL.into_iter().zip(&mut states) {
        if !parameters.is_monitored(pack) {
            state.status = PackStatus::Disabled;
        }
    }
    states
}
