//! What the check needs of its surroundings: a line with a clock, and the board's owner.

use crate::time::Instant;

/// The line to the board is gone: unplugged, or closed by the other end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PortClosed;

/// The line to the board, and the clock by which it is measured.
pub trait Port {
    /// The time since an arbitrary epoch.
    fn now(&mut self) -> Instant;

    /// Sends bytes.
    ///
    /// # Errors
    /// The line is gone.
    fn send(&mut self, bytes: &[u8]) -> Result<(), PortClosed>;

    /// Waits for bytes, until `deadline` at the latest, and appends them to `bytes`.
    ///
    /// # Errors
    /// The line is gone.
    fn receive(&mut self, deadline: Instant, bytes: &mut Vec<u8>) -> Result<(), PortClosed>;

    /// Opens the line again, trying until `deadline`: a board on USB vanishes while it restarts.
    ///
    /// # Errors
    /// It did not come back.
    fn reopen(&mut self, deadline: Instant) -> Result<(), PortClosed>;
}

/// What the owner has answered.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Answer {
    /// Nothing yet.
    Pending,
    /// This line.
    Line(String),
    /// There is no one to ask.
    Unavailable,
}

/// The user who runs the check.
pub trait Owner {
    /// Shows a line.
    fn show(&mut self, line: &str);

    /// Asks for a line.
    fn ask(&mut self, question: &str);

    /// The answer to the latest question.
    fn answer(&mut self) -> Answer;

    /// Whether the check has to end, by Ctrl-C.
    fn has_stopped(&mut self) -> bool;
}
