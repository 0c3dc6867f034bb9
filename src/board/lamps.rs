//! The row of eight WS2812 lamps.
#![expect(
    unsafe_code,
    reason = "the pulses' lengths need code in RAM and counted instructions"
)]

use core::arch::asm;

use embassy_rp::Peri;
use embassy_rp::gpio::{Level, Output};
use embassy_rp::pac;
use embassy_rp::peripherals::PIN_16;
use embassy_time::{Duration, Instant};

use crate::vehicle::Colour;

const LAMPS: usize = 8;
const BITS_PER_LAMP: u32 = 24;

/// GP16 among the pins of the processor.
const PIN: u32 = 1 << 16;

/// The lamps take the next bits for those of the first lamp when the line has been low for 50 µs.
const LONGEST_PAUSE: Duration = Duration::from_micros(40);

/// Of 255: enough to be seen indoors. Eight lamps at full power draw as much as a motor.
const BRIGHTNESS: u8 = 16;

/// The lamps on GP16.
pub struct Lamps {
    _pin: Output<'static>,
    shown: Option<Colour>,
}

impl Lamps {
    /// Takes the lamps. What they show is not known: they keep it over a restart of the chip.
    pub fn new(pin: Peri<'static, PIN_16>) -> Self {
        Self {
            _pin: Output::new(pin, Level::Low),
            shown: None,
        }
    }

    /// Makes all lamps show a colour, if they don't yet; that takes about 250 µs. To be called again later: if interrupts
    /// came in between, some lamps may still show the last colour.
    pub fn show(&mut self, colour: Colour) {
        if self.shown != Some(colour) {
            self.shown = send_to_all(colour).then_some(colour);
        }
    }
}

/// Returns whether it has certainly reached all lamps.
///
/// Interrupts are off for one lamp at a time, some 30 µs. Off for all, at 921,600 baud the telemetry port would overrun:
/// it calls for the processor when four places of its buffer are left, which are taken after 43 µs.
fn send_to_all(colour: Colour) -> bool {
    let bits = wire_bits(colour);
    let mut whole = true;
    let mut low_since = Instant::now();
    for _ in 0..LAMPS {
        cortex_m::interrupt::free(|_| {
            whole &= low_since.elapsed() < LONGEST_PAUSE;
            send_to_one(bits);
            low_since = Instant::now();
        });
    }
    whole
}

/// Green, red and blue, in this order.
fn wire_bits(colour: Colour) -> u32 {
    let (red, green, blue) = match colour {
        Colour::Off => (0, 0, 0),
        Colour::Green => (0, BRIGHTNESS, 0),
        Colour::Blue => (0, 0, BRIGHTNESS),
        Colour::White => (BRIGHTNESS, BRIGHTNESS, BRIGHTNESS),
        Colour::Yellow => (BRIGHTNESS, BRIGHTNESS, 0),
        Colour::Red => (BRIGHTNESS, 0, 0),
    };
    u32::from_be_bytes([0, green, red, blue])
}

/// Sends one lamp's bits, from the highest. Of a bit the line is high for 0.35 µs (a zero) or 0.7 µs (a one), each
/// ±0.15 µs; the whole takes 1.25 µs ±0.6 µs.
///
/// In RAM: a miss of the flash's cache would take longer than that tolerance.
#[unsafe(link_section = ".data.send_to_one")]
#[inline(never)]
fn send_to_one(bits: u32) {
    let line = pac::SIO.gpio_out(0);
    for bit in (0..BITS_PER_LAMP).rev() {
        let low_if_zero = if bits >> bit & 1 == 0 { PIN } else { 0 };
        line.value_set().write_value(PIN);
        wait(12);
        line.value_clr().write_value(low_if_zero);
        wait(11);
        line.value_clr().write_value(PIN);
        wait(20);
    }
}

/// Waits this many rounds of three cycles, 24 ns each.
///
/// As `cortex_m::asm::delay`, but certainly in its caller, and so in RAM.
#[inline(always)]
fn wait(rounds: u32) {
    // SAFETY: it counts a register down and touches nothing else. Not marked as touching no memory, so that it stays
    // between the accesses around it.
    unsafe { asm!("2:", "subs {0}, #1", "bne 2b", inout(reg) rounds => _, options(nostack)) }
}
