//! What the converter sees at its inputs, and the code it makes of a voltage.

use super::super::circuit::{Circuit, CurrentSensor, Probe};
use super::super::clock::{Cycle, micros};
use super::super::random::Random;

/// Reference voltage of the Pico (ADC_VREF).
pub const REFERENCE_VOLTS: f64 = 3.3;
/// Codes of the 12-bit converter.
pub const CODES: u32 = 4096;

/// Erratum RP2040-E11: the codes that are far too wide. "At four values — 512, 1,536, 2,560, and
/// 3,584 — the ADC's DNL error peaks" (datasheet 4.9.4).
pub const WIDE_CODES: [u32; 4] = [512, 1536, 2560, 3584];
/// How much wider than one step each of them is, in steps: the differential nonlinearity measured
/// on a Pico is 8.9 steps (pico-adc.markomo.me, sine histogram).
pub const WIDE_CODE_EXCESS: f64 = 8.9;

/// The signal at one channel. Times are microseconds since power-up.
pub enum AdcInput {
    /// Exactly this code, past the converter's errors and its noise.
    Code(u16),
    /// This voltage, through the transfer curve, with the noise of [`super::Adc::set_noise`].
    Volts(f64),
    /// A code as a function of time.
    CodeAt(Box<dyn FnMut(u64) -> u16 + Send>),
    /// This share of the voltage at the pack's terminals, by a divider ([`crate::Board::attach_circuit`]).
    PackVoltage(f64),
    /// The output of a sensor of the pack's current.
    PackCurrent(CurrentSensor),
}

impl Clone for AdcInput {
    fn clone(&self) -> Self {
        match self {
            Self::Code(code) => Self::Code(*code),
            Self::Volts(volts) => Self::Volts(*volts),
            Self::PackVoltage(share) => Self::PackVoltage(*share),
            Self::PackCurrent(sensor) => Self::PackCurrent(*sensor),
            Self::CodeAt(_) => {
                panic!("a board with a computed ADC input cannot be copied: set it on the copies")
            }
        }
    }
}

impl AdcInput {
    /// What the converter reads when it samples at `now`.
    pub fn sample(&mut self, now: Cycle, circuit: Option<&mut Circuit>, digitizer: &mut Digitizer) -> u16 {
        let terminals = || {
            let circuit =
                circuit.unwrap_or_else(|| panic!("an ADC input without a circuit: use attach_circuit"));
            circuit.advance(now);
            circuit.terminals()
        };
        let volts = match self {
            Self::Code(code) => return *code,
            Self::CodeAt(code_at) => return code_at(micros(now)),
            Self::Volts(volts) => *volts,
            Self::PackVoltage(share) => Probe::Voltage(*share).volts(terminals()),
            Self::PackCurrent(sensor) => Probe::Current(*sensor).volts(terminals()),
        };
        digitizer.code(volts)
    }
}

/// The way from a voltage to a code.
#[derive(Clone)]
pub struct Digitizer {
    pub curve: AdcCurve,
    /// Standard deviation.
    pub noise_volts: f64,
    random: Random,
}

impl Digitizer {
    pub fn new(noise_seed: u64) -> Self {
        Self {
            curve: AdcCurve::Rp2040,
            noise_volts: 0.0,
            random: Random::new(noise_seed),
        }
    }

    fn code(&mut self, volts: f64) -> u16 {
        let noise = if self.noise_volts > 0.0 {
            self.noise_volts * self.random.gaussian()
        } else {
            0.0
        };
        self.curve.code(volts + noise)
    }
}

/// The codes that a converter makes of voltages.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum AdcCurve {
    /// With the four wide codes of erratum RP2040-E11.
    #[default]
    Rp2040,
    /// All codes have the same width.
    Ideal,
}

impl AdcCurve {
    pub fn code(self, volts: f64) -> u16 {
        match self {
            Self::Rp2040 => code_of_volts(volts),
            Self::Ideal => whole_code(volts / REFERENCE_VOLTS * f64::from(CODES)),
        }
    }
}

fn whole_code(steps: f64) -> u16 {
    steps.clamp(0.0, f64::from(CODES - 1)) as u16
}

/// The transfer curve with erratum RP2040-E11.
///
/// The four wide codes take [`WIDE_CODE_EXCESS`] steps more than they should; all codes together
/// still span the reference, so every step is a little narrower than ideal. The result is the
/// sawtooth of the datasheet's INL figure, which runs between about -4.5 and +4.5 steps here.
pub fn code_of_volts(volts: f64) -> u16 {
    let excess = WIDE_CODE_EXCESS * WIDE_CODES.len() as f64;
    let steps = volts / REFERENCE_VOLTS * (f64::from(CODES) + excess);
    let mut code = steps;
    for wide in WIDE_CODES.map(f64::from) {
        // Above the wide codes before, `code` is without what they take.
        if code < wide {
            break;
        }
        code = (code - WIDE_CODE_EXCESS).max(wide);
    }
    whole_code(code)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Width of a code in ideal steps, found by sweeping the voltage.
    fn width(code: u16) -> f64 {
        const PER_STEP: u32 = 64;
        let sweep = u32::from(code).saturating_sub(40) * PER_STEP..(u32::from(code) + 40) * PER_STEP;
        let volts = |position| f64::from(position) * REFERENCE_VOLTS / f64::from(CODES * PER_STEP);
        let hits = sweep
            .filter(|&position| code_of_volts(volts(position)) == code)
            .count();
        hits as f64 / f64::from(PER_STEP)
    }

    #[test]
    fn the_four_codes_of_erratum_e11_are_wide_and_the_others_are_not() {
        for code in [512, 1536, 2560, 3584] {
            assert!((width(code) - 9.8).abs() < 0.2, "code {code}: {}", width(code));
        }
        for code in [100, 511, 513, 1024, 2048, 3583, 3585] {
            assert!((width(code) - 0.99).abs() < 0.05, "code {code}: {}", width(code));
        }
    }

    #[test]
    fn the_curve_spans_the_reference_and_never_falls() {
        assert_eq!(code_of_volts(-0.1), 0);
        assert_eq!(code_of_volts(0.0), 0);
        assert_eq!(code_of_volts(3.4), 4095);
        let codes: Vec<u16> = (0..33_000)
            .map(|tenth_mv| code_of_volts(f64::from(tenth_mv) / 10_000.0))
            .collect();
        assert!(codes.windows(2).all(|pair| pair[0] <= pair[1]));
    }

    #[test]
    fn all_codes_of_the_ideal_curve_have_the_same_width() {
        let step = REFERENCE_VOLTS / f64::from(CODES);
        for code in [0, 1, 511, 512, 513, 2560, 4094, 4095] {
            let middle = (f64::from(code) + 0.5) * step;
            let codes = [-0.49, 0.0, 0.49].map(|steps| AdcCurve::Ideal.code(middle + steps * step));
            assert_eq!(codes, [code; 3]);
        }
        assert_eq!([-0.1, 3.4].map(|volts| AdcCurve::Ideal.code(volts)), [0, 4095]);
    }

    #[test]
    fn the_error_stays_within_five_steps() {
        for tenth_mv in (0..33_000).step_by(7) {
            let volts = f64::from(tenth_mv) / 10_000.0;
            let ideal = volts / REFERENCE_VOLTS * f64::from(CODES);
            let error = f64::from(code_of_volts(volts)) - ideal;
            assert!(error.abs() < 10.0, "{volts} V: {error}");
        }
    }

    #[test]
    fn a_code_passes_exactly_and_noise_spreads_a_voltage() {
        let mut digitizer = Digitizer::new(3);
        digitizer.noise_volts = 0.005;
        assert_eq!(AdcInput::Code(2482).sample(0, None, &mut digitizer), 2482);
        let mut input = AdcInput::Volts(2.0);
        let codes: Vec<u16> = (0..100).map(|_| input.sample(0, None, &mut digitizer)).collect();
        assert!(codes.iter().any(|&code| code != codes[0]));
    }
}
