//! The converter of a power monitor: its results are means of whole conversions, of voltages that were cut off at the ends of its
//! range before.
//!
//! Of the INA226: "the accumulated average for each of these parameters is then loaded to the corresponding output registers", and
//! a write to the configuration "halts any conversion in progress until the write sequence is completed resulting in a new
//! conversion" (SBOS547B 6.4.1, 7.1). Left out: that voltage and current are converted by turns, and the ripple of pulses in a
//! single conversion.

use super::super::super::clock::Cycle;
use super::Load;

/// Set-up of a converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Setup {
    /// Time of a result with its averaging; 0 while it is shut down.
    pub result: Cycle,
    pub measures_voltage: bool,
    pub measures_current: bool,
    /// One result after the other; otherwise one after each set-up.
    pub is_continuous: bool,
    /// The ends of what it converts.
    pub most_volts: f64,
    pub amperes: [f64; 2],
}

/// Results that follow each other and are equal: nothing has changed meanwhile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Results {
    pub volts: f64,
    pub amperes: f64,
    pub count: u64,
}

#[derive(Clone, Copy, Debug)]
pub struct Converter {
    load: Load,
    /// Share of the time in which the current flows, in pulses that are much shorter than a conversion.
    pulses: f64,
    /// `None`: from the moment it is addressed next.
    until: Option<Cycle>,
    /// When the conversion under way has begun, or begins; `None`: after the delay.
    begins: Option<Cycle>,
    delay: Cycle,
    has_ended: bool,
    /// Of the conversion under way, times cycles.
    volts: f64,
    amperes: f64,
}

impl Default for Converter {
    fn default() -> Self {
        Self {
            load: Load::default(),
            pulses: 1.0,
            until: Some(0),
            begins: None,
            delay: 0,
            has_ended: false,
            volts: 0.0,
            amperes: 0.0,
        }
    }
}

impl Converter {
    pub fn load(&self) -> Load {
        self.load
    }

    /// From the moment on at which it was addressed last.
    pub fn set_load(&mut self, load: Load) {
        self.load = load;
    }

    /// The current of the load flows for this share of the time.
    pub fn set_pulses(&mut self, share: f64) {
        self.pulses = share;
    }

    /// A conversion begins after this time, and whatever was converted until now is dropped.
    pub fn restart(&mut self, delay: Cycle) {
        self.begins = None;
        self.delay = delay;
        self.has_ended = false;
        (self.volts, self.amperes) = (0.0, 0.0);
    }

    /// Its supply was gone, and is back when it is addressed next.
    pub fn power_cycle(&mut self) {
        self.until = None;
        self.restart(self.delay);
    }

    /// Lets time pass until `now`, and returns what has become ready.
    pub fn advance(&mut self, now: Cycle, setup: &Setup) -> impl Iterator<Item = Results> + use<> {
        let from = self.until.unwrap_or(now);
        let now = now.max(from);
        self.until = Some(now);
        let begins = *self.begins.get_or_insert(from + self.delay);
        let mut first = None;
        let mut equal = None;
        if setup.result > 0 && !self.has_ended {
            let end = begins + setup.result;
            self.convert(from.max(begins), now.min(end), setup);
            if now >= end {
                first = Some(self.results(setup, 1));
                self.has_ended = !setup.is_continuous;
            }
            if now >= end && setup.is_continuous {
                let count = (now - end) / setup.result;
                let begins = end + count * setup.result;
                if count > 0 {
                    self.convert(end, end + setup.result, setup);
                    equal = Some(self.results(setup, count));
                }
                self.begins = Some(begins);
                self.convert(begins, now, setup);
            }
        }
        first.into_iter().chain(equal)
    }

    fn convert(&mut self, from: Cycle, until: Cycle, setup: &Setup) {
        let cycles = until.saturating_sub(from) as f64;
        let [least, most] = setup.amperes;
        self.volts += self.load.volts.clamp(0.0, setup.most_volts) * cycles;
        self.amperes += self.load.amperes.clamp(least, most) * self.pulses * cycles;
    }

    fn results(&mut self, setup: &Setup, count: u64) -> Results {
        let cycles = setup.result as f64;
        Results {
            volts: std::mem::take(&mut self.volts) / cycles,
            amperes: std::mem::take(&mut self.amperes) / cycles,
            count,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SETUP: Setup = Setup {
        result: 100,
        measures_voltage: true,
        measures_current: true,
        is_continuous: true,
        most_volts: 40.0,
        amperes: [-10.0, 10.0],
    };

    fn advance(converter: &mut Converter, now: Cycle, setup: &Setup) -> Vec<(f64, f64, u64)> {
        let results = converter.advance(now, setup);
        results
            .map(|results| (results.volts, results.amperes, results.count))
            .collect()
    }

    #[test]
    fn results_are_means_of_whole_conversions_and_none_is_there_before_the_first() {
        let mut converter = Converter::default();
        converter.set_load(Load::of(12.0, 4.0));
        assert_eq!(advance(&mut converter, 99, &SETUP), []);
        assert_eq!(advance(&mut converter, 150, &SETUP), [(12.0, 4.0, 1)]);
        converter.set_load(Load::of(10.0, 8.0));
        // A half of each, then two of the new load, and 30 cycles.
        assert_eq!(
            advance(&mut converter, 430, &SETUP),
            [(11.0, 6.0, 1), (10.0, 8.0, 2)]
        );
        // A new set-up drops these 30.
        converter.restart(20);
        assert_eq!(advance(&mut converter, 549, &SETUP), []);
        let once = Setup {
            is_continuous: false,
            ..SETUP
        };
        assert_eq!(advance(&mut converter, 550, &once), [(10.0, 8.0, 1)]);
        assert_eq!(advance(&mut converter, 5_000, &once), []);
        converter.power_cycle();
        converter.restart(0);
        assert_eq!(advance(&mut converter, 6_000, &SETUP), []);
        assert_eq!(advance(&mut converter, 6_100, &SETUP), [(10.0, 8.0, 1)]);
        let shut_down = Setup { result: 0, ..SETUP };
        assert_eq!(advance(&mut converter, 9_000, &shut_down), []);
    }

    #[test]
    fn pulses_are_cut_off_before_they_are_averaged() {
        let mut converter = Converter::default();
        for (amperes, share, shown) in [(8.0, 0.5, 4.0), (40.0, 0.25, 2.5), (-40.0, 0.5, -5.0)] {
            converter.set_load(Load::of(12.0, amperes));
            converter.set_pulses(share);
            converter.restart(0);
            let now = converter.until.unwrap() + 100;
            assert_eq!(advance(&mut converter, now, &SETUP), [(12.0, shown, 1)]);
        }
    }
}
