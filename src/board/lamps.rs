//! The row of eight WS2812 lamps.

use embassy_rp::Peri;
use embassy_rp::gpio::Level;
use embassy_rp::peripherals::{PIN_16, PIO1};
use embassy_rp::pio::program::pio_asm;
use embassy_rp::pio::{
    Config, Direction, FifoJoin, LoadedProgram, Pin, Pio, ShiftConfig, ShiftDirection, StateMachine,
};
use embassy_time::{Duration, Instant};

use super::Irqs;
use crate::vehicle::Colour;

/// As many as the state machine's joined FIFO has places for words: a frame fits into it whole.
const LAMPS: usize = 8;
const BITS_PER_LAMP: u8 = 24;

/// A cycle of the state machine in cycles of the 125 MHz system clock: 120 ns.
///
/// In these cycles the line is high for 3 of a zero's 10 (0.36 µs), for 6 of a one's (0.72 µs). WS2812 want 0.35 and 0.7 µs,
/// WS2812B 0.4 and 0.8 µs, each ±0.15 µs.
const CLOCK_DIVIDER: u8 = 15;

/// A frame takes 230 µs. The line has to be low for 50 µs after it, 280 µs for later types of the lamps.
const FRAME_AND_RESET: Duration = Duration::from_millis(1);

/// Of 255: enough to be seen indoors. Eight lamps at full power draw as much as a motor.
const BRIGHTNESS: u8 = 16;

/// The lamps on GP16.
///
/// A state machine makes the pulses, without the processor: interrupts, misses of the flash's cache, flash operations and
/// a halted processor do not change them.
pub struct Lamps {
    sender: StateMachine<'static, PIO1, 0>,
    shown: Option<Colour>,
    ready_at: Instant,
}

impl Lamps {
    /// Takes the lamps, and the PIO block that a radio does not need. What they show is not known: they keep it over a
    /// restart of the chip.
    // Inlined, it would add to the stack of everything `main` calls.
    #[inline(never)]
    pub fn new(pio: Peri<'static, PIO1>, pin: Peri<'static, PIN_16>) -> Self {
        let Pio {
            mut common,
            sm0: mut sender,
            ..
        } = Pio::new(pio, Irqs);
        let pin = common.make_pio_pin(pin);
        let program = pio_asm!(
            ".side_set 1"
            ".wrap_target"
            "bit:"
            "    out x, 1     side 0 [3]"
            "    jmp !x zero  side 1 [2]"
            "    jmp bit      side 1 [2]"
            "zero:"
            "    nop          side 0 [2]"
            ".wrap"
        );
        sender.set_config(&configuration(&common.load_program(&program.program), &pin));
        sender.set_pins(Level::Low, &[&pin]);
        sender.set_pin_dirs(Direction::Out, &[&pin]);
        Self {
            sender,
            shown: None,
            ready_at: Instant::now(),
        }
    }

    /// Has all lamps show a colour, if they don't yet; that takes 230 µs after the return. To be called again later: within
    /// a millisecond after a change nothing is sent.
    pub fn show(&mut self, colour: Colour) {
        let now = Instant::now();
        if self.shown == Some(colour) || now < self.ready_at {
            return;
        }
        self.send_to_all(wire_bits(colour));
        self.shown = Some(colour);
        self.ready_at = now + FRAME_AND_RESET;
    }

    /// Fills the FIFO while the state machine stands: between two words the processor may be held up for longer than the
    /// lamps wait for the next bit.
    fn send_to_all(&mut self, bits: u32) {
        self.sender.set_enable(false);
        for _ in 0..LAMPS {
            self.sender.tx().push(bits);
        }
        self.sender.set_enable(true);
    }
}

fn configuration(program: &LoadedProgram<'static, PIO1>, pin: &Pin<'static, PIO1>) -> Config<'static, PIO1> {
    let mut config = Config::default();
    config.use_program(program, &[pin]);
    config.clock_divider = CLOCK_DIVIDER.into();
    config.fifo_join = FifoJoin::TxOnly;
    config.shift_out = ShiftConfig {
        threshold: BITS_PER_LAMP,
        direction: ShiftDirection::Left,
        auto_fill: true,
    };
    config
}

/// Green, red and blue from the highest bit, in this order.
fn wire_bits(colour: Colour) -> u32 {
    let (red, green, blue) = match colour {
        Colour::Off => (0, 0, 0),
        Colour::Green => (0, BRIGHTNESS, 0),
        Colour::Blue => (0, 0, BRIGHTNESS),
        Colour::White => (BRIGHTNESS, BRIGHTNESS, BRIGHTNESS),
        Colour::Yellow => (BRIGHTNESS, BRIGHTNESS, 0),
        Colour::Red => (BRIGHTNESS, 0, 0),
    };
    u32::from_be_bytes([green, red, blue, 0])
}
