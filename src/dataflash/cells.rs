//! BCL and BCL2: measured voltages of a pack's cells.

use core::ops::Range;

use super::format::Kind;
use super::packet::{Packet, RecordBytes};
use crate::battery::{BatteryState, MAX_CELLS};
use crate::pack::Pack;

/// Cells in BCL; BCL2 has those that follow.
pub(super) const FIRST_CELLS: usize = 12;

/// A cell that does not exist, as in ArduPilot.
const NO_CELL_MV: u16 = 0;

pub(super) fn encode_first(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
    let packet = Packet::at(Kind::Cells, time_us)
        .u8(pack.instance())
        .number(state.voltage_v);
    with_cells(packet, state, 0..FIRST_CELLS)
}

pub(super) fn encode_more(time_us: u64, pack: Pack, state: &BatteryState) -> RecordBytes {
    let packet = Packet::at(Kind::MoreCells, time_us).u8(pack.instance());
    with_cells(packet, state, FIRST_CELLS..MAX_CELLS)
}

/// Voltages as they are, where ArduPilot adds 1 mV. A cell at 0 V is recorded as 1 mV, since 0 is no cell.
fn with_cells(packet: Packet, state: &BatteryState, places: Range<usize>) -> RecordBytes {
    let measured = state.cells.millivolts();
    let cells = places.map(|place| {
        measured
            .get(place)
            .map_or(NO_CELL_MV, |cell_mv| (*cell_mv).max(1))
    });
    cells.fold(packet, Packet::u16).finish()
}
