//! Checks a board over MAVLink, as any ground station could, and writes a report (host only).
//!
//! [`run()`] goes through the procedures: they listen, ask, set, restart and drive, and leave evidence. Each row of
//! [`CHECKS`] judges that evidence, without I/O and without a clock, and [`Report`] has the result. Bytes, time and
//! the owner's answers come through [`Port`] and [`Owner`], so that tests need no wall time.

mod checks;
mod evidence;
mod plan;
mod port;
mod procedures;
mod report;
mod session;

pub use checks::{CHECKS, Check, Outcome};
pub use evidence::Divider;
pub use plan::{Multimeter, Plan, hash_of_elf};
pub use port::{Owner, Port};
pub use report::{REPORT_HEAD, Report, Verdict};

use evidence::{Evidence, Interruption};
use procedures::{
    calibrate, connect, download, identify, keep_parameter, listen, provoke_fault, turn_motors,
};
use session::Session;

/// Checks the board at `port`, and shows progress and findings.
pub fn run(port: &mut dyn Port, owner: &mut dyn Owner, plan: &Plan) -> Report {
    let mut evidence = plan.nothing_yet();
    let mut session = Session::new(port, owner);
    evidence.ended = go_through(&mut session, &mut evidence, plan).err();
    match evidence.ended {
        Some(Interruption::Stopped) => session.show("Stopped. What was not reached is not measured."),
        Some(Interruption::Armed) => {
            session.show("The rover is armed, and a check restarts it: disarm it first.")
        }
        Some(Interruption::Lost) | None => {}
    }
    evidence.record = session.into_record();
    let report = Report::of(&evidence);
    if report.verdict() == Verdict::Armed {
        return report;
    }
    for line in report.findings() {
        owner.show(&line);
    }
    owner.show(&report.summary());
    report
}

fn go_through(session: &mut Session<'_>, evidence: &mut Evidence, plan: &Plan) -> Result<(), Interruption> {
    session.show("Waiting for the board's heartbeat");
    connect(session, evidence)?;
    if evidence.board.is_none() {
        return Ok(());
    }
    session.show("Asking for its version");
    identify(session, evidence)?;
    session.show("Downloading its parameters");
    download(session, evidence)?;
    session.show("Listening for 20 seconds");
    listen(session, evidence)?;
    calibrate(session, evidence, plan)?;
    session.show("Setting a parameter, restarting, reading it");
    keep_parameter(session, evidence)?;
    if plan.provoke_fault {
        session.show("Provoking a fault");
        provoke_fault(session, evidence)?;
    }
    if plan.turn_motors {
        session.show("Turning the wheels, one side after the other");
        turn_motors(session, evidence)?;
    }
    Ok(())
}
