//! The cells of a smart battery.

use core::ops::RangeInclusive;

use crate::battery::{CellVoltages, MAX_CELLS, ReadError};
use crate::sensor::bus::SensorBus;
use crate::sensor::bus::smbus::SmBus;

/// A cell's voltage can be one of these, in millivolts.
const CELL_MV: RangeInclusive<u16> = 500..=5_000;

/// The cells are the pack's if they amount to its voltage within this share: they are read a moment later.
const CELL_SUM_TOLERANCE: f32 = 0.05;

/// Bytes of a block of cells: four, whether there are as many or not.
const BLOCK_BYTES: usize = 8;

/// What a battery reports of its cells, in millivolts, from the first on.
pub(super) type CellWords = [Option<u16>; MAX_CELLS];

/// Where the voltages of the cells are.
#[derive(Debug)]
pub(super) enum Cells {
    /// It does not report them all.
    None,
    /// Each in a word, the first at this command and the next below it: a custom, since the specification leaves these
    /// commands to the maker. How many there are shows their sum.
    WordsDownFrom(u8),
    /// Each in a word from this command up; another says how many.
    Counted { count_command: u8, first: u8 },
    /// This many at the start of one block.
    Block { command: u8, count: usize },
}

impl Cells {
    /// How many there are.
    pub async fn count<B: SensorBus>(
        &self,
        commands: &mut SmBus<'_, B>,
        pack_v: Option<f32>,
    ) -> Result<usize, ReadError> {
        match self {
            Self::None => Ok(0),
            Self::WordsDownFrom(_) => {
                let cells_mv = self.read(commands, MAX_CELLS).await?;
                Ok(pack_v.map_or(0, |pack_v| cells_of(pack_v, &cells_mv)))
            }
            Self::Counted { count_command, .. } => {
                let [count] = commands.words([*count_command]).await?;
                Ok(usize::from(count.unwrap_or(0)).min(MAX_CELLS))
            }
            Self::Block { count, .. } => Ok(*count),
        }
    }

    /// The first `count` of them.
    pub async fn read<B: SensorBus>(
        &self,
        commands: &mut SmBus<'_, B>,
        count: usize,
    ) -> Result<CellWords, ReadError> {
        let mut cells_mv = [None; MAX_CELLS];
        if let Self::Block { command, .. } = self {
            let block: [u8; BLOCK_BYTES] = commands.block(*command).await?;
            let words = block.as_chunks().0.iter().map(|word| u16::from_le_bytes(*word));
            for (cell_mv, word) in cells_mv.iter_mut().zip(words).take(count) {
                *cell_mv = Some(word);
            }
            return Ok(cells_mv);
        }
        for (cell_mv, place) in cells_mv.iter_mut().zip(0u8..).take(count) {
            let command = match self {
                Self::WordsDownFrom(first) => first.wrapping_sub(place),
                Self::Counted { first, .. } => first.wrapping_add(place),
                Self::None | Self::Block { .. } => break,
            };
            let [answer] = commands.words([command]).await?;
            *cell_mv = answer;
        }
        Ok(cells_mv)
    }
}

/// What `count` cells amount to, in volts; unknown if one of them is.
pub(super) fn sum_v(cells_mv: &CellWords, count: usize) -> Option<f32> {
    let cells_mv = cells_mv.get(..count).filter(|cells_mv| !cells_mv.is_empty())?;
    let sum_mv: Option<u32> = cells_mv.iter().map(|mv| mv.map(u32::from)).sum();
    sum_mv.map(|sum_mv| sum_mv as f32 * 1e-3)
}

/// As many of the cells as amount to the pack's voltage; none, if they don't.
pub(super) fn cell_voltages(pack_v: f32, cells_mv: &CellWords) -> CellVoltages {
    let cells = cells_of(pack_v, cells_mv);
    let cells_mv = cells_mv.map(Option::unwrap_or_default);
    CellVoltages::from_millivolts(cells_mv.get(..cells).unwrap_or(&[]))
}

/// How many of these cells amount to the pack's voltage: makers use the commands for other things, too.
fn cells_of(pack_v: f32, cells_mv: &CellWords) -> usize {
    let cells_mv = cells_mv
        .iter()
        .map_while(|mv| mv.filter(|mv| CELL_MV.contains(mv)));
    let mut sum_v = 0.0;
    for (place, cell_mv) in cells_mv.enumerate() {
        sum_v += f32::from(cell_mv) * 1e-3;
        if (pack_v - sum_v).abs() <= pack_v * CELL_SUM_TOLERANCE {
            return place + 1;
        }
    }
    0
}
