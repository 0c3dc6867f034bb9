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
    /// The same for the log.
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
        self.sudden += other.sudden;
        self.seconds += other.seconds;
        self.heartbeats += other.heartbeats;
        self.longest_gap_us = self.longest_gap_us.max(other.longest_gap_us);
        self.hostile_pieces += other.hostile_pieces;
        self.drives += other.drives;
        self.calm_drives += other.calm_drives;
        self.motor_changes += other.motor_changes;
        self.oldest_stick_us = self.oldest_stick_us.max(other.oldest_stick_us);
        self.by_wifi += other.by_wifi;
        self.settings += other.settings;
        self.read_back += other.read_back;
        self.programs += other.programs;
        self.erases += other.erases;
        self.marks += other.marks;
        self.learnt += other.learnt;
        self.logged += other.logged;
        self.log_files += other.log_files;
        self.log_records += other.log_records;
        let both = [self.least_left_us, other.least_left_us];
        self.least_left_us = both.into_iter().flatten().min();
    }

    /// How often a fault has come.
    pub fn times(&self, fault: Fault) -> u64 {
        self.faults.get(&fault).map_or(0, |outcome| outcome.times)
    }

    fn all_times(&self) -> u64 {
        self.faults.values().map(|outcome| outcome.times).sum()
    }
}

/// The first cells of the row of a fault: those that do not change from run to run.
pub fn fixed_cells(fault: Fault) -> String {
    format!("| {} | {} s |", fault.name(), fault.limit_us() as f64 / 1e6)
}

impl fmt::Display for Tally {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "| fault | bound | slowest | injected | recovered |")?;
        writeln!(f, "|---|---|---|---|---|")?;
        for (fault, outcome) in &self.faults {
            writeln!(
                f,
                "{} {:.2} s | {} | {} |",
                fixed_cells(*fault),
                outcome.slowest_us as f64 / 1e6,
                outcome.times,
                outcome.recovered
            )?;
        }
        let hours = self.seconds as f64 / 3600.0;
        writeln!(
            f,
            "\n{} faults in {hours:.1} emulated hours, and {} restarts in the course of one. All the time:\n",
            self.all_times(),
            self.sudden
        )?;
        writeln!(
            f,
            "- {} HEARTBEATs, at most {:.2} s from one, or from a start, to the next;",
            self.heartbeats,
            self.longest_gap_us as f64 / 1e6
        )?;
        writeln!(f, "- {} messages to a laptop by Wi-Fi;", self.by_wifi)?;
        writeln!(
            f,
            "- {} changes at the motors' pins in {} drives ({} of them without a fault), each as it was ordered at most {:.2} s before;",
            self.motor_changes,
            self.drives,
            self.calm_drives,
            self.oldest_stick_us as f64 / 1e6
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
        writeln!(
            f,
            "- {} flash operations for what is learnt of the packs;",
            self.learnt
        )?;
        writeln!(
            f,
            "- {} flash operations for the log; at the end it has {} files with {} records, the newest downloaded as it is in flash;",
            self.logged, self.log_files, self.log_records
        )?;
        if self.marks > 0 {
            writeln!(f, "- the time of signatures written down {} times;", self.marks)?;
        }
        writeln!(
            f,
            "- the watchdog fed with {:.2} s left at least, and no reset but those that were caused;",
            self.least_left_us.unwrap_or(0) as f64 / 1e6
        )?;
        writeln!(f, "- {} hostile pieces, none obeyed.", self.hostile_pieces)
    }
}
