//! Differences of makers' batteries from the specification, and the places of their cells.
//!
//! All of them are as ArduPilot's drivers read them (Rotoye's second thermistor and its coarse current by its maker's
//! own change to that). No maker's document could be read, so all but the generic one count as unconfirmed.

use core::ops::RangeInclusive;

use crate::battery::{CellVoltages, MAX_CELLS, ReadError};
use crate::sensor::bus::SensorBus;
use crate::sensor::bus::parts::{CELL_SUM_TOLERANCE, deviation};
use crate::sensor::bus::smbus::{PacketErrorCode, SmBus};

/// A word that is not filled in.
const BLANK: u16 = 0xffff;

/// A word that is filled in. Undriven lines read as one that is not.
pub(super) fn known(word: Option<u16>) -> Option<u16> {
    word.filter(|word| *word != BLANK)
}

/// Differences of a maker's batteries from the specification.
#[derive(Debug)]
pub(in crate::sensor::bus) struct Dialect {
    /// Whether they have a packet error code; `None` if the specification information says so.
    pub(super) code: Option<PacketErrorCode>,
    /// Factor of the words for capacities.
    pub(super) capacity_factor: f32,
    pub(super) cells: Cells,
    pub(super) voltage: Voltage,
    pub(super) current: Current,
    /// Registers of temperatures, in tenths of a kelvin.
    pub(super) temperatures: &'static [u8],
    pub(super) button: Option<Button>,
}

/// Source of the pack's voltage.
#[derive(Debug)]
pub(super) enum Voltage {
    /// Its word.
    OfPack,
    /// Its cells: it has no word for the whole.
    SumOfCells,
}

/// Source of the current.
#[derive(Clone, Copy, Debug)]
pub(super) enum Current {
    /// A word in milliamperes.
    Word,
    /// A word in milliamperes; newer ones have a word in tenths of an ampere for what does not fit it.
    WordOrTenths { tenths: u8 },
    /// Four bytes in milliamperes.
    Long { command: u8, framing: Framing },
}

/// Framing of bytes.
#[derive(Clone, Copy, Debug)]
pub(super) enum Framing {
    /// With their length before them.
    Block,
    /// As they are, without a packet error code either.
    Bare,
}

/// A button on the battery.
#[derive(Clone, Copy, Debug)]
pub(super) struct Button {
    pub command: u8,
    pub byte: usize,
    pub bit: u8,
}

const TEMPERATURE: u8 = 0x08;

/// As the specification has it.
pub(in crate::sensor::bus) static GENERIC: Dialect = SPECIFIED;

/// Its capacities are half of what they are.
pub(in crate::sensor::bus) static MAXELL: Dialect = Dialect {
    capacity_factor: 2.0,
    ..SPECIFIED
};

/// Batmon: a thermistor or two beside the one on the board.
pub(in crate::sensor::bus) static ROTOYE: Dialect = Dialect {
    current: Current::WordOrTenths { tenths: 0x41 },
    temperatures: &[TEMPERATURE, 0x48, 0x49],
    ..SPECIFIED
};

/// Three cells, whose voltages come in one block.
pub(in crate::sensor::bus) static SUI_3_CELLS: Dialect = Dialect {
    code: Some(PacketErrorCode::Absent),
    cells: Cells::Block {
        command: 0x28,
        count: 3,
    },
    voltage: Voltage::SumOfCells,
    current: Current::Long {
        command: 0x2a,
        framing: Framing::Bare,
    },
    ..SPECIFIED
};

/// Six cells, of which it reports four; so none is reported, since ground stations would add them up to less than the pack.
pub(in crate::sensor::bus) static SUI_6_CELLS: Dialect = Dialect {
    cells: Cells::None,
    voltage: Voltage::OfPack,
    code: Some(PacketErrorCode::Absent),
    current: Current::Long {
        command: 0x2a,
        framing: Framing::Bare,
    },
    ..SPECIFIED
};

/// Up to ten cells, which it counts itself.
pub(in crate::sensor::bus) static NEO_DESIGN: Dialect = Dialect {
    code: Some(PacketErrorCode::Sent),
    cells: Cells::Counted {
        count_command: 0x5c,
        first: 0x30,
    },
    ..SPECIFIED
};

/// The battery of 3D Robotics' Solo: four cells, and a button that switches it off.
pub(in crate::sensor::bus) static SOLO: Dialect = Dialect {
    code: Some(PacketErrorCode::Sent),
    cells: Cells::Block {
        command: 0x28,
        count: 4,
    },
    voltage: Voltage::SumOfCells,
    current: Current::Long {
        command: 0x2a,
        framing: Framing::Block,
    },
    button: Some(Button {
        command: 0x23,
        byte: 1,
        bit: 1 << 3,
    }),
    ..SPECIFIED
};

/// The dialect that the others differ from.
const SPECIFIED: Dialect = Dialect {
    code: None,
    capacity_factor: 1.0,
    cells: Cells::WordsDownFrom(0x3f),
    voltage: Voltage::OfPack,
    current: Current::Word,
    temperatures: &[TEMPERATURE],
    button: None,
};

/// A cell's voltage can be one of these, in millivolts.
const CELL_MV: RangeInclusive<u16> = 500..=5_000;

/// Bytes of a block of cells: four, whether there are as many or not.
const BLOCK_BYTES: usize = 8;

/// Reported voltages of cells, in millivolts, from the first on.
pub(super) type CellWords = [Option<u16>; MAX_CELLS];

/// Place of the voltages of the cells.
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
    /// Their number, if every such battery has as many.
    pub fn fixed(&self) -> usize {
        match self {
            Self::Block { count, .. } => *count,
            Self::None | Self::WordsDownFrom(_) | Self::Counted { .. } => 0,
        }
    }

    /// The most that it may have.
    pub async fn most<B: SensorBus>(&self, commands: &mut SmBus<'_, B>) -> Result<usize, ReadError> {
        match self {
            Self::WordsDownFrom(_) => Ok(MAX_CELLS),
            Self::Counted { count_command, .. } => {
                let count = commands.word(*count_command).await?;
                Ok(usize::from(count.unwrap_or(0)).min(MAX_CELLS))
            }
            Self::None | Self::Block { .. } => Ok(self.fixed()),
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
                *cell_mv = known(Some(word));
            }
            return Ok(cells_mv);
        }
        for (cell_mv, place) in cells_mv.iter_mut().zip(0u8..).take(count) {
            let command = match self {
                Self::WordsDownFrom(first) => first.wrapping_sub(place),
                Self::Counted { first, .. } => first.wrapping_add(place),
                Self::None | Self::Block { .. } => break,
            };
            *cell_mv = known(commands.word(command).await?);
        }
        Ok(cells_mv)
    }
}

/// Sum of the voltages of `count` cells; unknown if one of them is.
pub(super) fn sum_v(cells_mv: &CellWords, count: usize) -> Option<f32> {
    let cells_mv = cells_mv.get(..count).filter(|cells_mv| !cells_mv.is_empty())?;
    let sum_mv: Option<u32> = cells_mv.iter().map(|mv| mv.map(u32::from)).sum();
    sum_mv.map(|sum_mv| sum_mv as f32 * 1e-3)
}

/// The first `count` of the cells; none, if one is missing, or if they don't add up to the pack.
pub(super) fn cell_voltages(pack_v: f32, cells_mv: &CellWords, count: usize) -> CellVoltages {
    let add_up = sum_v(cells_mv, count).is_some_and(|sum_v| deviation(pack_v, sum_v) <= CELL_SUM_TOLERANCE);
    let cells_mv = cells_mv.map(Option::unwrap_or_default);
    CellVoltages::from_millivolts(cells_mv.get(..count).filter(|_| add_up).unwrap_or(&[]))
}

/// Number of these cells whose sum is nearest to the pack's voltage, if it is near enough: makers use the commands for other
/// things, too.
pub(super) fn cells_of(pack_v: f32, cells_mv: &CellWords) -> usize {
    let cells_mv = cells_mv
        .iter()
        .map_while(|mv| mv.filter(|mv| CELL_MV.contains(mv)));
    let (mut sum_v, mut nearest, mut cells) = (0.0, CELL_SUM_TOLERANCE, 0);
    for (cell_mv, number) in cells_mv.zip(1..) {
        sum_v += f32::from(cell_mv) * 1e-3;
        if deviation(pack_v, sum_v) <= nearest {
            (nearest, cells) = (deviation(pack_v, sum_v), number);
        }
    }
    cells
}
