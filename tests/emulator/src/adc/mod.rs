//! ADC: the successive-approximation converter with its input multiplexer (datasheet 4.9). Not modelled, and a panic: round
//! robin, and samples of eight bits in the FIFO.

mod fifo;
mod input;
mod registers;
#[cfg(test)]
mod tests;

use std::collections::VecDeque;

use super::clock::{CLK_ADC_HZ, CLK_SYS_HZ, Cycle, NEVER, from_adc_clock};
use super::random::Random;
use super::register::{bit, field};
use fifo::SampleFifo;
pub use input::{AdcInput, code_of_volts};

const CS_EN: u32 = 0;
const CS_START_ONCE: u32 = 2;
const CS_START_MANY: u32 = 3;
const CS_READY: u32 = 8;
const CS_ERR: u32 = 9;
const CS_ERR_STICKY: u32 = 10;
const CS_AINSEL: u32 = 12;
const CS_RROBIN: u32 = 16;

/// "Capturing a sample takes 96 clock cycles (96 × 1/48MHz) = 2μs per sample" (4.9.2).
const CONVERSION_ADC_CYCLES: u64 = 96;
/// "After a few clock cycles, CS.READY will go high" (4.9.2): how many is not given.
const POWER_UP_ADC_CYCLES: u64 = 8;
/// The board has its power from USB.
const VSYS_VOLTS: f64 = 5.0;
/// Channels 0 to 3 are GPIO26 to 29, 4 is the temperature sensor.
const CHANNELS: usize = 5;
/// GP29.
const VSYS_CHANNEL: usize = 3;
const INTERRUPT_LINE: u32 = 22;
const DMA_REQUEST: u32 = 36;
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

/// A fault of the converter, put in by a test.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AdcFault {
    #[default]
    None,
    /// Conversions start and never finish: CS.READY stays low.
    Stalled,
    /// Conversions finish with CS.ERR set.
    ConversionError,
}

#[derive(Clone)]
struct Running {
    start: Cycle,
    channel: usize,
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
    /// When START_MANY starts the next conversion.
    next_start: Option<Cycle>,
    inputs: [AdcInput; CHANNELS],
    /// Of a Pico W: its switch between VSYS/3 and GP29 is open.
    is_vsys_cut_off: bool,
    /// Where GP29 floats to while nothing is connected to it and nothing pulls it down.
    stray_volts: f64,
    is_vsys_pulled_down: bool,
    noise_volts: f64,
    random: Random,
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
            is_vsys_cut_off: false,
            stray_volts: 0.0,
            is_vsys_pulled_down: false,
            noise_volts: 0.0,
            random: Random::new(noise_seed),
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

    /// A Pico W connects a third of VSYS to its channel, or leaves the pin floating. The pull-down of its pad, of 80 kΩ at most,
    /// discharges it: with 20 pF in 1.6 µs, less than a conversion takes.
    pub fn connect_vsys(&mut self, is_connected: bool, is_pulled_down: bool) {
        self.is_vsys_cut_off = !is_connected;
        self.is_vsys_pulled_down = is_pulled_down;
    }

    /// Has the pin of a Pico W's VSYS float to this voltage.
    pub fn float_vsys_pin(&mut self, volts: f64) {
        self.stray_volts = volts;
    }

    /// Noise at the inputs given as voltages, in volts (standard deviation).
    pub fn set_noise(&mut self, volts: f64) {
        self.noise_volts = volts;
    }

    pub fn set_fault(&mut self, fault: AdcFault) {
        self.fault = fault;
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

    fn start_conversion(&mut self, now: Cycle) {
        if self.is_ready(now) {
            self.running = Some(Running {
                start: now,
                channel: field(self.cs, CS_AINSEL, 3) as usize,
            });
        }
    }

    /// The pace of START_MANY in cycles of `clk_adc`: back to back without a divider, else every
    /// 1 + INT + FRAC/256, where "the ADC ignores this if a conversion is currently in progress"
    /// (4.9.2.2). The fraction is an average here, not a delta-sigma.
    fn period(&self) -> Cycle {
        const ONE: u64 = 256;
        if self.div == 0 {
            return from_adc_clock(CONVERSION_ADC_CYCLES);
        }
        let trigger = ONE + u64::from(self.div);
        let triggers_per_conversion = (CONVERSION_ADC_CYCLES * ONE).div_ceil(trigger);
        (trigger * triggers_per_conversion * CLK_SYS_HZ).div_ceil(ONE * CLK_ADC_HZ)
    }

    fn conversion_end(&self) -> Cycle {
        match (&self.running, self.fault) {
            (None, _) | (Some(_), AdcFault::Stalled) => NEVER,
            (Some(running), _) => running.start + from_adc_clock(CONVERSION_ADC_CYCLES),
        }
    }

    fn finish_conversion(&mut self) {
        let Some(Running { start, channel }) = self.running.take() else {
            return;
        };
        let code = match self.inputs.get_mut(channel) {
            Some(_) if channel == VSYS_CHANNEL && self.is_vsys_cut_off => {
                let floats = !self.is_vsys_pulled_down;
                code_of_volts(if floats { self.stray_volts } else { 0.0 })
            }
            Some(input) => input.sample(start, self.noise_volts, &mut self.random) & 0xfff,
            None => 0,
        };
        self.result = code;
        self.error = self.fault == AdcFault::ConversionError;
        self.error_sticky |= self.error;
        self.fifo.push(code, self.error);
        self.keep_record(Conversion { start, channel, code });
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

    /// When START_MANY can start: on its beat, but not before the running conversion is over.
    fn beat(&self) -> Cycle {
        if self.running.is_some() {
            NEVER
        } else {
            self.next_start.unwrap_or(NEVER)
        }
    }

    fn start_on_beat(&mut self, beat: Cycle) {
        self.start_conversion(beat);
        self.next_start = Some(beat + self.period());
    }
}
