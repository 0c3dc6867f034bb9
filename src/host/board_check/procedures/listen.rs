//! Leaves the board alone and listens.

use super::super::evidence::{Evidence, Window};
use super::super::session::{Interruption, Session};

/// Forty messages of each stream at its default rate.
pub(in super::super) const LISTENING_US: u64 = 20_000_000;

/// Listens to telemetry.
pub(in super::super) fn listen(
    session: &mut Session<'_>,
    evidence: &mut Evidence,
) -> Result<(), Interruption> {
    let from = session.now();
    session.listen_for(LISTENING_US)?;
    evidence.window = Some(Window {
        from,
        to: session.now(),
    });
    Ok(())
}
