//! The order of the check.

use super::evidence::Evidence;
use super::plan::{Part, Plan};
use super::port::{Owner, Port};
use super::procedures::{
    calibrate, connect, download, identify, keep_parameter, listen, provoke_fault, turn_motors,
};
use super::report::Report;
use super::session::{Interruption, Session};

/// Checks the board at `port`, and shows progress and findings.
pub fn run(port: &mut dyn Port, owner: &mut dyn Owner, plan: &Plan) -> Report {
    let mut evidence = plan.nothing_yet();
    let mut session = Session::new(port, owner);
    evidence.ended = go_through(&mut session, &mut evidence, plan).err();
    if evidence.ended == Some(Interruption::Stopped) {
        session.show("Stopped. What was not reached is not measured.");
    }
    evidence.record = session.into_record();
    let report = Report::of(&evidence);
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
    calibrate(session, evidence, plan.multimeter, plan.calibrate)?;
    session.show("Setting a parameter, restarting, reading it");
    keep_parameter(session, evidence)?;
    if plan.fault == Part::Run {
        session.show("Provoking a fault");
        provoke_fault(session, evidence)?;
    }
    if plan.motors == Part::Run {
        session.show("Turning the wheels, one side after the other");
        turn_motors(session, evidence)?;
    }
    Ok(())
}
