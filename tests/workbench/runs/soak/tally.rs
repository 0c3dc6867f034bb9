//! What has happened, counted, and as a table.

use std::collections::BTreeMap;
use std::fmt;

use super::fault::Fault;

/// How a fault went.
#[derive(Default)]
struct Outcome {
    times: u64,
    recovered: u64,
    slowest_us: u64,
}

#[derive(Default)]
pub struct Tally {
    faults: BTreeMap<Fault, Outcome>,
    /// Restarts in the course of another fault.
    pub sudden: u64,
    pub seconds: u64,
    pub heartbeats: u64,
    longest_gap_us: u64,
    pub hostile_pieces: u64,
    pub drives: u64,
    pub calm_drives: u64,
    pub motor_changes: u64,
    pub oldest_stick_us: u64,
    /// Frames that a laptop has received by Wi-Fi.
    pub by_wifi: u64,
    pub settings: u64,
    pub read_back: u64,
    pub programs: u64,
    pub erases: u64,
    /// Writes and erases for the time of signatures.
    pub marks: u64,
    /// Flash operations for what is learnt of the packs.
    pub learnt: u64,
    /// Flash operations for the log.
    pub logged: u64,
    /// Log files at the end, and whole records in them.
    pub log_files: usize,
    pub log_records: usize,
    /// Of the watchdog's time, whenever it was fed.
    pub least_left_us: Option<u64>,
}

impl Tally {
    pub fn injected(&mut self, fault: Fault) {
        self.faults.entry(fault).or_default().times += 1;
    }

    pub fn recovered(&mut self, fault: Fault, after_us: u64) {
        let outcome = self.faults.entry(fault).or_default();
        outcome.recovered += 1;
        outcome.slowest_us = outcome.slowest_us.max(after_us);
    }

    pub fn heartbeat(&mut self, gap_us: u64) {
        self.heartbeats += 1;
        self.longest_gap_us = self.longest_gap_us.max(gap_us);
    }

    /// Adds what has happened to another board.
    pub fn add(&mut self, other: Self) {
        for (fault, outcome) in other.faults {
            let sum = self.faults.entry(fault).or_default();
            sum.times += outcome.times;
            sum.recovered += outcome.recovered;
            sum.slowest_us = sum.slowest_us.max(outcome.slowest_us);
        }
        // Adds the counts of these fields.
        macro_rules! add {
            ($($count:ident)*) => {
                $(self.$count += other.$count;)*
            };
        }
        add!(sudden seconds heartbeats hostile_pieces drives calm_drives motor_changes by_wifi settings read_back);
        add!(programs erases marks learnt logged log_files log_records);
        self.longest_gap_us = self.longest_gap_us.max(other.longest_gap_us);
        self.oldest_stick_us = self.oldest_stick_us.max(other.oldest_stick_us);
        let both = [self.least_left_us, other.least_left_us];
        self.least_left_us = both.into_iter().flatten().min();
    }

    /// How often a fault has come.
    pub fn times(&self, fault: Fault) -> u64 {
        self.faults.get(&fault).map_or(0, |outcome| outcome.times)
    }
}

/// The first cells of the row of a fault: those that do not change from run to run.
pub fn fixed_cells(fault: Fault) -> String {
    format!("| {} | {} s |", fault.name(), seconds(fault.limit_us()))
}

fn seconds(us: u64) -> f64 {
    us as f64 / 1e6
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| fault | bound | slowest | injected | recovered |")?;
        writeln!(f, "|---|---|---|---|---|")?;
        for (fault, outcome) in &self.faults {
            let (fixed, slowest_s) = (fixed_cells(*fault), seconds(outcome.slowest_us));
            let Outcome { times, recovered, .. } = outcome;
            writeln!(f, "{fixed} {slowest_s:.2} s | {times} | {recovered} |")?;
        }
        let all_times: u64 = self.faults.values().map(|outcome| outcome.times).sum();
        let hours = self.seconds as f64 / 3600.0;
        let (sudden, heartbeats, gap_s) = (self.sudden, self.heartbeats, seconds(self.longest_gap_us));
        writeln!(
            f,
            "\n{all_times} faults in {hours:.1} emulated hours, and {sudden} restarts in the course of one. All the time:\n"
        )?;
        writeln!(
            f,
            "- {heartbeats} HEARTBEATs, at most {gap_s:.2} s from one, or from a start, to the next;"
        )?;
        writeln!(f, "- {} messages to a laptop by Wi-Fi;", self.by_wifi)?;
        writeln!(
            f,
            "- {} changes at the motors' pins in {} drives ({} of them without a fault), each as it was ordered at most {:.2} s before;",
            self.motor_changes,
            self.drives,
            self.calm_drives,
            seconds(self.oldest_stick_us)
        )?;
        writeln!(
            f,
            "- {} parameters set and {} read back after starts, none lost, none torn;",
            self.settings, self.read_back
        )?;
        writeln!(
            f,
            "- {} pages of flash written and {} sectors erased, none of them without a parameter that was set;",
            self.programs, self.erases
        )?;
        let (learnt, marks) = (self.learnt, self.marks);
        writeln!(f, "- {learnt} flash operations for what is learnt of the packs;")?;
        writeln!(
            f,
            "- {} flash operations for the log; at the end it has {} files with {} records, the newest downloaded as it is in flash;",
            self.logged, self.log_files, self.log_records
        )?;
        if marks > 0 {
            writeln!(f, "- the time of signatures written down {marks} times;")?;
        }
        let left_s = seconds(self.least_left_us.unwrap_or(0));
        writeln!(
            f,
            "- the watchdog fed with {left_s:.2} s left at least, and no reset but those that were caused;"
        )?;
        writeln!(f, "- {} hostile pieces, none obeyed.", self.hostile_pieces)
    }
}
