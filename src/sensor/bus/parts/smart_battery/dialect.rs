//! How makers' batteries differ from the specification.
//!
//! What is known of them is how ArduPilot's drivers read them (Rotoye's second thermistor and its coarse current by its maker's
//! own change to that). No maker's document could be read, so all but the generic one count as unconfirmed.

use super::cells::Cells;
use crate::sensor::bus::smbus::PacketErrorCode;

/// How a maker's batteries differ from the specification.
#[derive(Debug)]
pub(in crate::sensor::bus) struct Dialect {
    /// Whether they have a packet error code; `None` if the specification information says so.
    pub(super) code: Option<PacketErrorCode>,
    /// What the words for capacities have to be multiplied with.
    pub(super) capacity_factor: f32,
    pub(super) cells: Cells,
    pub(super) voltage: Voltage,
    pub(super) current: Current,
    /// Where temperatures are, in tenths of a kelvin.
    pub(super) temperatures: &'static [u8],
    pub(super) button: Option<Button>,
}

/// Where the pack's voltage comes from.
#[derive(Debug)]
pub(super) enum Voltage {
    /// Its word.
    OfPack,
    /// Its cells: it has no word for the whole.
    SumOfCells,
}

/// Where the current comes from.
#[derive(Clone, Copy, Debug)]
pub(super) enum Current {
    /// A word in milliamperes.
    Word,
    /// The same, and newer ones have a word in tenths of an ampere for what does not fit it.
    WordOrTenths { tenths: u8 },
    /// Four bytes in milliamperes.
    Long { command: u8, framing: Framing },
}

/// How bytes are sent.
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

/// What the others differ from.
const SPECIFIED: Dialect = Dialect {
    code: None,
    capacity_factor: 1.0,
    cells: Cells::WordsDownFrom(0x3f),
    voltage: Voltage::OfPack,
    current: Current::Word,
    temperatures: &[TEMPERATURE],
    button: None,
};
