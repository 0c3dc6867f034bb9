//! Surroundings of the check: a line with a clock, and the board's owner.

use std::io;
use std::sync::mpsc::TryRecvError;

use rover_battmon::time::Instant;

/// The line to the board, and the clock by which it is measured.
pub trait Port {
    /// The time since an arbitrary epoch.
    fn now(&mut self) -> Instant;

    /// Sends bytes.
    ///
    /// # Errors
    /// The line is gone: unplugged, or closed by the other end.
    fn send(&mut self, bytes: &[u8]) -> io::Result<()>;

    /// Waits for bytes, until `deadline` at the latest, and appends them to `bytes`.
    ///
    /// # Errors
    /// The line is gone: unplugged, or closed by the other end.
    fn receive(&mut self, deadline: Instant, bytes: &mut Vec<u8>) -> io::Result<()>;

    /// Opens the line again, trying until `deadline`: a board on USB vanishes while it restarts.
    ///
    /// # Errors
    /// It did not come back.
    fn reopen(&mut self, deadline: Instant) -> io::Result<()>;
}

/// The user who runs the check.
pub trait Owner {
    /// Shows a line.
    fn show(&mut self, line: &str);

    /// Asks for a line.
    fn ask(&mut self, question: &str);

    /// The answer to the latest question.
    ///
    /// # Errors
    /// `Empty`: there is none yet. `Disconnected`: there is no one to ask.
    fn answer(&mut self) -> Result<String, TryRecvError>;

    /// Whether the check has to end, by Ctrl-C.
    fn has_stopped(&mut self) -> bool;
}
