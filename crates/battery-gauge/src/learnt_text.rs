//! Learnt properties of a pack as text, one a line, for tools on a desk.
//!
//! ```text
//! chemistry 3
//! cells 1
//! drives 2
//! capacity_mah_sigma 2987.5 0.03
//! shown_mah_sigma 3010 0.02
//! resistance_ohm_now_first 0.0295 0.0288
//! offsets_100uv_sigma 75 144 -201 144 -323 144 -428 144 236 144
//! charge_sigma_resting_v 0.143 0.04 3.387
//! slow_share_sigma 0.4 0.06
//! scale_volt_mult_offset_amp_pervlt 3.95 0 17
//! open_drawn_ah_rested_h_ohm 1.9 0.1 0.029
//! open_start_1e4_points 10000 100 34120 310 60211 0 0 0 36320 280 30100 37900 270 20500 41200 100 900
//! open_current_source 4711
//! collapse_1e4_10uohm 2300 4100
//! ```

use core::fmt;
use core::str::FromStr;

use crate::learnt::{
    Collapse, LastCharge, LearntCapacity, LearntResistance, LearntSlowShare, OFFSET_POINTS, Offset,
    OpenLesson,
};
use crate::{Chemistry, LearntPack, MeasuringScale};

const CHEMISTRY: &str = "chemistry";
const CELLS: &str = "cells";
const SERIAL_NUMBER: &str = "serial_number";
const DRIVES: &str = "drives";
const CAPACITY: &str = "capacity_mah_sigma";
const RESISTANCE: &str = "resistance_ohm_now_first";
const OFFSETS: &str = "offsets_100uv_sigma";
const CHARGE: &str = "charge_sigma_resting_v";
const SEEN: &str = "shown_mah_sigma";
const SLOW: &str = "slow_share_sigma";
const SCALE: &str = "scale_volt_mult_offset_amp_pervlt";
const OPEN: &str = "open_drawn_ah_rested_h_ohm";
const OPEN_POINTS: &str = "open_start_1e4_points";
const OPEN_SOURCE: &str = "open_current_source";
const COLLAPSE: &str = "collapse_1e4_10uohm";

/// Why a text is not what was learnt of a pack.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LearntTextError {
    /// This line, counted from 1, has an unknown name, or not the numbers that belong to its name.
    Line(usize),
    /// There is no pack with such values.
    Implausible,
}

impl fmt::Display for LearntTextError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Line(line) => write!(f, "line {line} is not a property of a pack"),
            Self::Implausible => f.write_str("no pack has these values"),
        }
    }
}

impl fmt::Display for LearntPack {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{CHEMISTRY} {}", self.chemistry as u8)?;
        writeln!(f, "{CELLS} {}", self.cell_count)?;
        if let Some(number) = self.serial_number {
            writeln!(f, "{SERIAL_NUMBER} {number}")?;
        }
        writeln!(f, "{DRIVES} {}", self.drives)?;
        if let Some(LearntCapacity {
            capacity_mah,
            sigma,
            seen_mah,
            seen_sigma,
        }) = self.capacity
        {
            writeln!(f, "{CAPACITY} {capacity_mah} {sigma}")?;
            if seen_mah > 0.0 {
                writeln!(f, "{SEEN} {seen_mah} {seen_sigma}")?;
            }
        }
        if let Some(LearntResistance { now_ohm, first_ohm }) = self.resistance {
            writeln!(f, "{RESISTANCE} {now_ohm} {first_ohm}")?;
        }
        f.write_str(OFFSETS)?;
        for offset in &self.offsets {
            write!(f, " {} {}", offset.mean_100uv, offset.sigma_100uv)?;
        }
        writeln!(f)?;
        if let Some(charge) = self.charge {
            writeln!(f, "{CHARGE} {} {} {}", charge.soc, charge.sigma, charge.resting_v)?;
        }
        if let Some(slow) = self.slow {
            writeln!(f, "{SLOW} {} {}", slow.share, slow.sigma)?;
        }
        if let Some(MeasuringScale {
            volt_multiplier,
            volt_offset_v,
            amperes_per_volt,
        }) = self.scale
        {
            writeln!(f, "{SCALE} {volt_multiplier} {volt_offset_v} {amperes_per_volt}")?;
        }
        if let Some(OpenLesson {
            start: [soc, sigma],
            drawn_ah,
            rested_h,
            ohm,
            points,
            current_source,
        }) = self.open
        {
            writeln!(f, "{OPEN} {drawn_ah} {rested_h} {ohm}")?;
            write!(f, "{OPEN_POINTS} {soc} {sigma}")?;
            for number in points.as_flattened() {
                write!(f, " {number}")?;
            }
            writeln!(f, "\n{OPEN_SOURCE} {current_source}")?;
        }
        if let Some(collapse) = self.collapse {
            let [soc, ohm] = collapse.to_numbers();
            writeln!(f, "{COLLAPSE} {soc} {ohm}")?;
        }
        Ok(())
    }
}

impl FromStr for LearntPack {
    type Err = LearntTextError;

    /// Empty lines and those that begin with `#` are ignored; what is left out is not learnt.
    fn from_str(text: &str) -> Result<Self, LearntTextError> {
        let mut learnt = Self::UNKNOWN;
        for (line, number) in text.lines().map(str::trim).zip(1..) {
            if !line.is_empty() && !line.starts_with('#') {
                learnt.set(line).ok_or(LearntTextError::Line(number))?;
            }
        }
        let is_plausible = Self::from_words(&learnt.to_words()) == Some(learnt);
        is_plausible.then_some(learnt).ok_or(LearntTextError::Implausible)
    }
}

impl LearntPack {
    /// Takes a line of a text.
    fn set(&mut self, line: &str) -> Option<()> {
        let (name, numbers) = line.split_once(' ')?;
        match name {
            CHEMISTRY => {
                let [number] = parse(numbers)?;
                self.chemistry = Chemistry::from_number(number)?;
            }
            CELLS => [self.cell_count] = parse(numbers)?,
            SERIAL_NUMBER => {
                let [number] = parse(numbers)?;
                self.serial_number = Some(number);
            }
            DRIVES => [self.drives] = parse(numbers)?,
            CAPACITY => {
                let [capacity_mah, sigma] = parse(numbers)?;
                self.capacity = Some(LearntCapacity {
                    capacity_mah,
                    sigma,
                    seen_mah: 0.0,
                    seen_sigma: 0.0,
                });
            }
            SEEN => {
                let [seen_mah, seen_sigma] = parse(numbers)?;
                let capacity = self.capacity.as_mut()?;
                (capacity.seen_mah, capacity.seen_sigma) = (seen_mah, seen_sigma);
            }
            RESISTANCE => {
                let [now_ohm, first_ohm] = parse(numbers)?;
                self.resistance = Some(LearntResistance { now_ohm, first_ohm });
            }
            OFFSETS => {
                let numbers: [i16; 2 * OFFSET_POINTS] = parse(numbers)?;
                for (offset, pair) in self.offsets.iter_mut().zip(numbers.as_chunks().0) {
                    let [mean_100uv, sigma_100uv] = *pair;
                    *offset = Offset {
                        mean_100uv,
                        sigma_100uv,
                    };
                }
            }
            CHARGE => {
                let [soc, sigma, resting_v] = parse(numbers)?;
                self.charge = Some(LastCharge {
                    soc,
                    sigma,
                    resting_v,
                });
            }
            SLOW => {
                let [share, sigma] = parse(numbers)?;
                self.slow = Some(LearntSlowShare { share, sigma });
            }
            SCALE => {
                let [volt_multiplier, volt_offset_v, amperes_per_volt] = parse(numbers)?;
                self.scale = Some(MeasuringScale {
                    volt_multiplier,
                    volt_offset_v,
                    amperes_per_volt,
                });
            }
            OPEN => {
                let [drawn_ah, rested_h, ohm] = parse(numbers)?;
                self.open = Some(OpenLesson {
                    start: [0; 2],
                    drawn_ah,
                    rested_h,
                    ohm,
                    points: [[0; 3]; OFFSET_POINTS],
                    current_source: 0,
                });
            }
            OPEN_POINTS => {
                let numbers: [u16; 2 + 3 * OFFSET_POINTS] = parse(numbers)?;
                let (start, points) = numbers.split_first_chunk()?;
                let open = self.open.as_mut()?;
                open.start = *start;
                open.points.as_flattened_mut().copy_from_slice(points);
            }
            OPEN_SOURCE => [self.open.as_mut()?.current_source] = parse(numbers)?,
            COLLAPSE => self.collapse = Some(Collapse::from_numbers(parse(numbers)?)?),
            _ => return None,
        }
        Some(())
    }
}

/// Exactly `N` numbers.
fn parse<T: FromStr + Copy + Default, const N: usize>(text: &str) -> Option<[T; N]> {
    let mut words = text.split_whitespace();
    let mut numbers = [T::default(); N];
    for number in &mut numbers {
        *number = words.next()?.parse().ok()?;
    }
    words.next().is_none().then_some(numbers)
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const TEXT: &str = "chemistry 3
cells 3
serial_number 7
drives 258
capacity_mah_sigma 2950 0.02
shown_mah_sigma 3010 0.015
resistance_ohm_now_first 0.03 0.028
offsets_100uv_sigma -400 80 -200 81 0 82 100 83 350 84
charge_sigma_resting_v 0.6 0.03 3.71
slow_share_sigma 0.4 0.06
scale_volt_mult_offset_amp_pervlt 3.95 -0.01 -17
open_drawn_ah_rested_h_ohm 1.9 0.1 0.029
open_start_1e4_points 9990 120 0 0 0 36120 210 65535 37000 200 40000 1 2 3 41000 0 9
open_current_source 4711
collapse_1e4_10uohm 2300 4100
";

    #[test]
    fn words_and_text_restore_what_was_learnt() {
        let learnt: LearntPack = TEXT.parse().expect("a pack");
        assert_eq!(learnt.to_string(), TEXT);
        for learnt in [learnt, LearntPack::UNKNOWN] {
            assert_eq!(LearntPack::from_words(&learnt.to_words()), Some(learnt));
        }
    }

    #[test]
    fn what_is_left_out_is_not_learnt() {
        let learnt: LearntPack = "# a pack\n\ndrives 3\ncapacity_mah_sigma 2900 0.05\n"
            .parse()
            .unwrap();
        assert_eq!(learnt.drives, 3);
        assert_eq!(learnt.capacity_mah(), Some(2900.0));
        assert_eq!(learnt.resistance, None);
        assert_eq!("".parse(), Ok(LearntPack::UNKNOWN));
    }

    #[test]
    fn a_bad_line_is_named() {
        for line in [
            "capacity",
            "capacity 2900",
            "capacity_mah_sigma 2900",
            "capacity_mah_sigma 2900 0.05 1",
            "capacity_mah_sigma 2900 x",
            "chemistry 9",
            "cells 256",
            "offsets_100uv_sigma 1 2 3",
        ] {
            let text = format!("drives 1\n{line}\n");
            assert_eq!(
                text.parse::<LearntPack>(),
                Err(LearntTextError::Line(2)),
                "{line}"
            );
        }
        for line in ["capacity_mah_sigma -5 0.05", "charge_sigma_resting_v NaN 0 3.7"] {
            assert_eq!(
                line.parse::<LearntPack>(),
                Err(LearntTextError::Implausible),
                "{line}"
            );
        }
    }

    proptest! {
        #[test]
        fn text_restores_whatever_flash_may_hold(words in prop::array::uniform::<_, { crate::LEARNT_WORDS }>(any::<u32>()), chemistry in 1u8..=4) {
            let mut words = words;
            words[0] = words[0] & !0xff | u32::from(chemistry);
            let learnt = LearntPack::from_words(&words).expect("a chemistry");
            prop_assert_eq!(learnt.to_string().parse(), Ok(learnt));
            prop_assert!(learnt.capacity_mah().is_none_or(|capacity_mah| capacity_mah >= 1.0));
            prop_assert!(learnt.charge.is_none_or(|charge| (0.0..=1.0).contains(&charge.soc)));
        }

        #[test]
        fn arbitrary_text_is_refused_or_plausible(text in "(([a-z_]{0,24}|drives|cells|charge_sigma_resting_v) [-0-9. eNa]{0,30}\n){0,4}") {
            if let Ok(learnt) = text.parse::<LearntPack>() {
                prop_assert_eq!(LearntPack::from_words(&learnt.to_words()), Some(learnt));
            }
        }
    }
}
