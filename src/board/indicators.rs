//! The buzzer, and lamps and buzzer together.

use embassy_rp::Peri;
use embassy_rp::gpio::{Level, Output};
use embassy_rp::peripherals::{PIN_2, PIN_16, PIO1};
use embassy_sync::blocking_mutex::raw::CriticalSectionRawMutex;
use embassy_sync::signal::Signal;

use super::lamps::Lamps;
use crate::tasks::{now, timer_at};
use crate::vehicle::{Indication, Indicators, Tone};

/// The rover's lamps and the switch of its buzzer.
pub struct BoardIndicators {
    lamps: Lamps,
    buzzer: BuzzerSwitch,
}

/// Takes lamps and buzzer. The buzzer has to be run to sound.
pub fn indicators(
    buzzer: Peri<'static, PIN_2>,
    pio: Peri<'static, PIO1>,
    lamps: Peri<'static, PIN_16>,
) -> (BoardIndicators, Buzzer) {
    let (buzzer, switch) = Buzzer::new(buzzer);
    let indicators = BoardIndicators {
        lamps: Lamps::new(pio, lamps),
        buzzer: switch,
    };
    (indicators, buzzer)
}

impl Indicators for BoardIndicators {
    fn show(&mut self, indication: Indication) {
        self.lamps.show(indication.colour);
        self.buzzer.set(indication.tone);
    }
}

/// Half a period of 2 kHz.
const TOGGLE_INTERVAL_US: u64 = 250;

static TONE: Signal<CriticalSectionRawMutex, Tone> = Signal::new();

/// The buzzer on GP2, which has to be run to sound. The PWM slice of its pin is that of the motor left in front, so the
/// processor makes its tone.
pub struct Buzzer {
    pin: Output<'static>,
}

impl Buzzer {
    /// Takes the buzzer; it is silent.
    pub fn new(pin: Peri<'static, PIN_2>) -> (Self, BuzzerSwitch) {
        let buzzer = Self {
            pin: Output::new(pin, Level::Low),
        };
        (buzzer, BuzzerSwitch { latest: Tone::Silent })
    }

    /// Does what the switch says, for ever; asleep while that is silence.
    pub async fn run(&mut self) -> ! {
        loop {
            if TONE.wait().await == Tone::Sounding {
                self.sound_until_silenced().await;
            }
        }
    }

    async fn sound_until_silenced(&mut self) {
        let mut due = now();
        while TONE.try_take() != Some(Tone::Silent) {
            self.pin.toggle();
            // Missed toggles (flash was erased) are not made up for: that would be a shrill tone.
            due = due.after_us(TOGGLE_INTERVAL_US).max(now());
            timer_at(due).await;
        }
        self.pin.set_low();
    }
}

/// Switches the buzzer on and off.
pub struct BuzzerSwitch {
    latest: Tone,
}

impl BuzzerSwitch {
    /// It sounds or is silent from now on, within 250 µs.
    pub fn set(&mut self, tone: Tone) {
        if tone != self.latest {
            self.latest = tone;
            TONE.signal(tone);
        }
    }
}
