//! The converter behind the analog pins.

use core::sync::atomic::AtomicU16;

use embassy_rp::Peri;
use embassy_rp::adc::Channel;
use embassy_rp::gpio::Pull;
use embassy_rp::pac;
use embassy_rp::pac::adc::regs::{Cs, Fcs};
use embassy_rp::pac::dma::vals::TreqSel;
use embassy_rp::peripherals::{ADC, DMA_CH2, DMA_CH3, PIN_26, PIN_27, PIN_28, PIN_29};

use super::dma_ring::DmaRing;
use crate::battery::ReadError;
use crate::drivers::{CHANNELS, CONVERSION_CYCLES, ConversionRing, RING_CONVERSIONS};
use crate::log::warn;
use crate::sensor::{AdcCount, AnalogIn, AnalogPin, AnalogReadings, PinPull, WantedReadings};
use crate::tasks::now;
use crate::time::Instant;

/// A conversion takes 96 cycles of the converter's 48 MHz clock (RP2040 datasheet 4.9.2), 250 of the processor's, and a reset or
/// a start fewer; each poll takes five at least.
const MAX_POLLS: u32 = 200;

/// A word is on its way from the converter to the ring for some cycles, and 7,600 pass until the next one.
const LOOKS: u32 = 4;

/// The number of the first analog pin.
const FIRST_PIN: usize = 26;

/// The channel of the chip's thermometer.
const THERMOMETER: u8 = 4;

/// A ring of the DMA begins at a multiple of its length.
#[repr(C, align(4096))]
struct Ring([AtomicU16; RING_CONVERSIONS]);
const _: () = assert!(align_of::<Ring>() == size_of::<Ring>());

static RING: Ring = Ring([const { AtomicU16::new(0) }; RING_CONVERSIONS]);

/// The analog pins GP26 to GP29; on a Pico W GP29 is the radio's.
///
/// Four channels are converted in turn, without a pause and at the converter's own pace, into a ring in RAM.
pub struct AnalogInputs {
    // It keeps the pins theirs.
    _channels: [Channel<'static>; 3],
    gp29: Option<Channel<'static>>,
    ring: DmaRing<AtomicU16>,
    conversions: ConversionRing,
}

/// Peripherals of the analog inputs.
pub struct AnalogPeripherals {
    /// The converter.
    pub adc: Peri<'static, ADC>,
    /// ADC0.
    pub gp26: Peri<'static, PIN_26>,
    /// ADC1.
    pub gp27: Peri<'static, PIN_27>,
    /// ADC2.
    pub gp28: Peri<'static, PIN_28>,
    /// ADC3, unless it is the radio's.
    pub gp29: Option<Peri<'static, PIN_29>>,
    /// Brings the results to RAM, and starts that again.
    pub dma: (Peri<'static, DMA_CH2>, Peri<'static, DMA_CH3>),
}

impl AnalogInputs {
    /// Takes the converter and its pins, without pulls, and begins to convert.
    pub fn new(peripherals: AnalogPeripherals) -> Self {
        let results = pac::ADC.fifo().as_ptr().cast();
        let mut inputs = Self {
            _channels: [
                Channel::new_pin(peripherals.gp26, Pull::None),
                Channel::new_pin(peripherals.gp27, Pull::None),
                Channel::new_pin(peripherals.gp28, Pull::None),
            ],
            gp29: peripherals.gp29.map(|pin| Channel::new_pin(pin, Pull::None)),
            ring: DmaRing::new(peripherals.dma, results, TreqSel::ADC, &RING.0),
            conversions: ConversionRing::starting_at(now()),
        };
        inputs.restart();
        inputs
    }

    /// Converts from the first channel on, into the first place of the ring, whatever state everything is in.
    fn restart(&mut self) {
        hold_in_reset(true);
        self.ring.stop();
        hold_in_reset(false);
        let mut control = Cs(0);
        control.set_en(true);
        control.set_ts_en(self.gp29.is_none());
        control.set_rrobin(self.order().iter().fold(0, |mask, channel| mask | 1 << channel));
        pac::ADC.cs().write_value(control);
        poll(|| pac::ADC.cs().read().ready());
        pac::ADC
            .div()
            .write(|divisor| divisor.set_int((CONVERSION_CYCLES - 1) as u16));
        let mut fifo = Fcs(0);
        fifo.set_en(true);
        fifo.set_err(true);
        fifo.set_dreq_en(true);
        fifo.set_thresh(1);
        pac::ADC.fcs().write_value(fifo);
        self.ring.start();
        self.conversions = ConversionRing::starting_at(now());
        control.set_start_many(true);
        pac::ADC.cs().write_value(control);
    }

    /// The channels in the order in which they are converted.
    fn order(&self) -> [u8; CHANNELS] {
        let last = match self.gp29 {
            Some(_) => AnalogPin::Gp29 as u8,
            None => THERMOMETER,
        };
        [
            AnalogPin::Gp26 as u8,
            AnalogPin::Gp27 as u8,
            AnalogPin::Gp28 as u8,
            last,
        ]
    }

    /// Conversions in the ring so far, modulo the reader's period.
    ///
    /// # Errors
    /// [`ReadError::Conversion`]: some were lost on their way. As a result has no channel with it, those after it are at places
    /// of others.
    fn written(&self) -> Result<u32, ReadError> {
        let fifo = pac::ADC.fcs().read();
        if fifo.over() || fifo.under() || self.ring.is_halted() {
            return Err(ReadError::Conversion);
        }
        let mut looks = (0..LOOKS).map(|_| self.written_in_order());
        looks.find_map(|written| written).ok_or(ReadError::Conversion)
    }

    /// The conversions so far, if all of them are in the ring, and the channel that comes next has the next place.
    fn written_in_order(&self) -> Option<u32> {
        let written = self.ring.written();
        let next = pac::ADC.cs().read().ainsel();
        let is_settled = pac::ADC.fcs().read().level() == 0 && self.ring.written() == written;
        let expected = self.order().get(written as usize % CHANNELS).copied();
        (is_settled && expected == Some(next)).then_some(written)
    }

    fn read_ring(&mut self, until: Instant, wanted: WantedReadings) -> Result<AnalogReadings, ReadError> {
        let written = self.written()?;
        self.conversions.read(&RING.0, written, now(), until, wanted)
    }
}

impl AnalogIn for AnalogInputs {
    fn read(&mut self, until: Instant, wanted: WantedReadings) -> AnalogReadings {
        match self.read_ring(until, wanted) {
            Ok(mut readings) => {
                if self.gp29.is_none() {
                    readings.set(AnalogPin::Gp29, Err(ReadError::PinOfRadio));
                }
                readings
            }
            Err(error) => {
                warn!("converter: {:?}, begins again", error);
                self.restart();
                AnalogReadings::failed(error)
            }
        }
    }

    fn pull(&mut self, pin: AnalogPin, pull: PinPull) {
        let pad = pac::PADS_BANK0.gpio(FIRST_PIN + pin as usize);
        pad.modify(|pad| pad.set_pue(pull == PinPull::Up));
    }
}

/// Holds the converter in reset, or ends that.
fn hold_in_reset(is_held: bool) {
    pac::RESETS.reset().modify(|blocks| blocks.set_adc(is_held));
    if !is_held {
        poll(|| pac::RESETS.reset_done().read().adc());
    }
}

/// Waits for what takes some cycles, or never comes: reading fails then.
fn poll(condition: impl Fn() -> bool) {
    let _ = (0..MAX_POLLS).find(|_| condition());
}

/// A single conversion of the voltage at a pin, before the start.
pub(super) fn convert_once(pin: AnalogPin) -> Result<AdcCount, ReadError> {
    let mut control = pac::ADC.cs().read();
    if !control.ready() {
        return Err(ReadError::Timeout);
    }
    control.set_ainsel(pin as u8);
    control.set_start_once(true);
    pac::ADC.cs().write_value(control);
    let done = (0..MAX_POLLS)
        .map(|_| pac::ADC.cs().read())
        .find(|status| status.ready());
    match done {
        None => Err(ReadError::Timeout),
        Some(status) if status.err() => Err(ReadError::Conversion),
        Some(_) => Ok(AdcCount(pac::ADC.result().read().result().into())),
    }
}
