//! Lamps and buzzer together.

use embassy_rp::Peri;
use embassy_rp::peripherals::{PIN_2, PIN_16, PIO1};

use super::buzzer::{Buzzer, BuzzerSwitch};
use super::lamps::Lamps;
use crate::vehicle::{Indication, Indicators};

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
