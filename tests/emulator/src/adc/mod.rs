//! ADC: the successive-approximation converter with its input multiplexer (datasheet 4.9). Samples of eight bits in the FIFO are
//! not modelled, and a panic.

mod fault;
mod fifo;
mod input;
mod pace;
mod registers;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use super::circuit::Circuit;
use super::clock::{Cycle, NEVER};
use super::register::{bit, field};
pub use fault::AdcFault;
use fault::Outcome;
use fifo::SampleFifo;
use input::Digitizer;
pub use input::{AdcCurve, AdcInput, code_of_volts};
use pace::AdcTime;

const CS_EN: u32 = 0;
const CS_START_ONCE: u32 = 2;
const CS_START_MANY: u32 = 3;
const CS_READY: u32 = 8;
const CS_ERR: u32 = 9;
const CS_ERR_STICKY: u32 = 10;
const CS_AINSEL: u32 = 12;
const CS_RROBIN: u32 = 16;

/// "After a few clock cycles, CS.READY will go high" (4.9.2): how many is not given.
const POWER_UP_ADC_CYCLES: u64 = 8;
/// The board has its power from USB.
const VSYS_VOLTS: f64 = 5.0;
/// Channels 0 to 3 are GPIO26 to 29, 4 is the temperature sensor.
const CHANNELS: usize = 5;
/// GP29.
const VSYS_CHANNEL: usize = 3;
const INTERRUPT_LINE: u32 = 22;
/// DREQ_ADC (2.5.3.1).
pub const DMA_REQUEST: u32 = 36;
/// Address of FIFO.
pub const FIFO_ADDRESS: u32 = 0x4004_c00c;
/// How many conversions the record keeps for the test; older ones are dropped.
const RECORD_LENGTH: usize = 1 << 16;

/// A finished conversion, for the test to look at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Conversion {
    /// When the input was sampled.
    pub start: Cycle,
    pub channel: usize,
    pub code: u16,
}

/// A Pico W connects a third of VSYS to GP29, or leaves the pin floating. The pull-down of its pad, of 80 kΩ at most, discharges
/// it: with 20 pF in 1.6 µs, less than a conversion takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct VsysConnection {
    pub is_connected: bool,
    pub is_pulled_down: bool,
}

impl VsysConnection {
    const OF_A_PICO: Self = Self {
        is_connected: true,
        is_pulled_down: false,
    };
}

#[derive(Clone)]
struct Running {
    conversion: Conversion,
    /// `None` while the converter is stalled.
    end: Option<AdcTime>,
}

#[derive(Clone)]
pub struct Adc {
    cs: u32,
    div: u32,
    inte: u32,
    intf: u32,
    result: u16,
    error: bool,
    error_sticky: bool,
    fifo: SampleFifo,
    powered_up_at: Cycle,
    running: Option<Running>,
    /// The next trigger of START_MANY.
    next_start: Option<AdcTime>,
    inputs: [AdcInput; CHANNELS],
    vsys: VsysConnection,
    /// Where GP29 floats to while nothing is connected to it and nothing pulls it down.
    stray_volts: f64,
    digitizer: Digitizer,
    /// At the inputs that lead to one.
    pub circuit: Option<Box<Circuit>>,
    fault: AdcFault,
    conversions: u64,
    record: VecDeque<Conversion>,
}

impl Adc {
    pub fn new(noise_seed: u64) -> Self {
        Self {
            cs: 0,
            div: 0,
            inte: 0,
            intf: 0,
            result: 0,
            error: false,
            error_sticky: false,
            fifo: SampleFifo::default(),
            powered_up_at: NEVER,
            running: None,
            next_start: None,
            inputs: [
                AdcInput::Code(0),
                AdcInput::Code(0),
                AdcInput::Code(0),
                // A third of VSYS (Pico datasheet, "GPIO29"), with the board at USB.
                AdcInput::Volts(VSYS_VOLTS / 3.0),
                AdcInput::Code(0),
            ],
            vsys: VsysConnection::OF_A_PICO,
            stray_volts: 0.0,
            digitizer: Digitizer::new(noise_seed),
            circuit: None,
            fault: AdcFault::None,
            conversions: 0,
            record: VecDeque::new(),
        }
    }

    pub fn set_input(&mut self, channel: usize, input: AdcInput) {
        assert!(
            channel < CHANNELS,
            "the RP2040's ADC has channels 0 to 4, not {channel}"
        );
        self.inputs[channel] = input;
    }

    pub fn vsys(&self) -> VsysConnection {
        self.vsys
    }

    pub fn connect_vsys(&mut self, vsys: VsysConnection) {
        self.vsys = vsys;
    }

    /// Has the pin of a Pico W's VSYS float to this voltage.
    pub fn float_vsys_pin(&mut self, volts: f64) {
        self.stray_volts = volts;
    }

    /// Noise at the inputs given as voltages, in volts (standard deviation).
    pub fn set_noise(&mut self, volts: f64) {
        self.digitizer.noise_volts = volts;
    }

    pub fn set_curve(&mut self, curve: AdcCurve) {
        self.digitizer.curve = curve;
    }

    /// A conversion that runs stalls as well, and one that has stalled ends at once.
    pub fn set_fault(&mut self, fault: AdcFault, now: Cycle) {
        self.fault = fault;
        let Some(running) = &mut self.running else {
            return;
        };
        running.end = match fault {
            AdcFault::Stalled => None,
            _ => running.end.or(Some(AdcTime::of(now))),
        };
    }

    /// Takes the oldest result out of the FIFO, as it is read there.
    pub fn pop(&mut self) -> u32 {
        u32::from(self.fifo.pop())
    }

    /// Whether it raises its interrupt, or may without being written to.
    pub fn may_interrupt(&self) -> bool {
        (self.inte | self.intf) != 0
    }

    /// How many conversions have finished since power-up.
    pub fn conversions(&self) -> u64 {
        self.conversions
    }

    /// Take the record of finished conversions (the last 65536 of them).
    pub fn take_record(&mut self) -> Vec<Conversion> {
        self.record.drain(..).collect()
    }

    fn is_ready(&self, now: Cycle) -> bool {
        bit(self.cs, CS_EN) && now >= self.powered_up_at && self.running.is_none()
    }

    /// The input is sampled now.
    fn start_conversion(&mut self, start: AdcTime) {
        let now = start.cycle();
        if !self.is_ready(now) {
            return;
        }
        let channel = field(self.cs, CS_AINSEL, 3) as usize;
        self.running = Some(Running {
            conversion: Conversion {
                start: now,
                channel,
                code: self.sample(channel, now),
            },
            end: (self.fault != AdcFault::Stalled).then(|| start.after_conversion()),
        });
    }

    fn sample(&mut self, channel: usize, now: Cycle) -> u16 {
        match self.inputs.get_mut(channel) {
            Some(_) if channel == VSYS_CHANNEL && !self.vsys.is_connected => {
                let floats = !self.vsys.is_pulled_down;
                let volts = if floats { self.stray_volts } else { 0.0 };
                self.digitizer.curve.code(volts)
            }
            Some(input) => input.sample(now, self.circuit.as_deref_mut(), &mut self.digitizer) & 0xfff,
            None => 0,
        }
    }

    fn conversion_end(&self) -> Option<AdcTime> {
        self.running.as_ref().and_then(|running| running.end)
    }

    fn finish_conversion(&mut self, end: AdcTime) {
        let Some(Running { conversion, .. }) = self.running.take() else {
            return;
        };
        let outcome = self.fault.end_conversion(self.conversions);
        self.result = conversion.code;
        self.error = outcome == Outcome::Error;
        self.error_sticky |= self.error;
        if outcome != Outcome::Lost {
            self.fifo.push(conversion.code, self.error);
        }
        self.select_next_input();
        // "The ADC ignores this if a conversion is currently in progress" (4.9.2.2).
        self.next_start = self.next_start.map(|trigger| trigger.next_trigger(self.div, end));
        self.keep_record(conversion);
    }

    /// "When the ADC completes a conversion, CS.AINSEL will automatically cycle to the next input whose corresponding bit is set
    /// in RROBIN" (4.9.2.3).
    fn select_next_input(&mut self) {
        let selected = field(self.cs, CS_AINSEL, 3);
        let inputs = CHANNELS as u32;
        let next = (1..=inputs)
            .map(|step| (selected + step) % inputs)
            .find(|&input| bit(self.cs, CS_RROBIN + input));
        if let Some(next) = next {
            self.cs = self.cs & !(0b111 << CS_AINSEL) | next << CS_AINSEL;
        }
    }

    fn keep_record(&mut self, conversion: Conversion) {
        self.conversions += 1;
        if self.record.len() == RECORD_LENGTH {
            self.record.pop_front();
        }
        self.record.push_back(conversion);
    }

    fn interrupt_status(&self) -> u32 {
        (u32::from(self.fifo.reached_threshold()) & self.inte) | self.intf
    }

    /// When START_MANY starts a conversion: at a trigger, but not before the running one is over.
    fn free_running_start(&self) -> Option<AdcTime> {
        self.next_start.filter(|_| self.running.is_none())
    }

    fn start_at_trigger(&mut self, trigger: AdcTime) {
        self.start_conversion(trigger);
        self.next_start = Some(trigger.next_trigger(self.div, trigger.after_conversion()));
    }
}
