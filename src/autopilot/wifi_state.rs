//! State of Wi-Fi: names and passwords, the set-up in force, announced reports.

use core::mem::replace;

use heapless::Vec;

use super::start::Start;
use crate::parameter::Parameters;
use crate::time::Instant;
use crate::wifi::{
    RADIO_TASK, Radio, StoredWifi, WifiChoice, WifiCredentials, WifiMode, WifiReport, WifiSetup,
};

/// Reports of each kind, each announced once.
const REPORTS: usize = 14;

/// A ground station that was not heard by Wi-Fi for this long is absent.
pub const PRESENCE_US: u64 = 10_000_000;

/// The state of Wi-Fi.
#[derive(Debug)]
pub struct WifiState {
    pub credentials: WifiCredentials,
    /// The choice by the parameters when the vehicle was last disarmed.
    choice: WifiChoice,
    /// Announced since the radio was set up, or since it last did what it is set up for.
    announced: Vec<WifiReport, REPORTS>,
    /// Why the radio stays off until the next start.
    pub off: Option<WifiReport>,
    /// The present fault.
    pub fault: Option<WifiReport>,
    /// When a frame last came by Wi-Fi.
    pub heard_at: Option<Instant>,
}

impl WifiState {
    pub fn new(start: &Start) -> Self {
        Self {
            credentials: WifiCredentials::new(start.radio, start.identity.board_id, StoredWifi::default()),
            choice: WifiChoice::from_parameters(&start.parameters),
            announced: Vec::new(),
            off: is_radio_to_blame(start).then_some(WifiReport::OffAfterCrash),
            fault: None,
            heard_at: None,
        }
    }

    /// The radio's set-up.
    pub fn setup(&self) -> Option<WifiSetup> {
        match self.off {
            Some(_) => None,
            None => self.credentials.setup(self.choice),
        }
    }

    /// The report for a ground station that connects.
    pub fn trouble(&self) -> Option<WifiReport> {
        self.off.or(self.fault)
    }

    /// Whether a report is news. A fault that comes back at each retry is not, until the radio has done what it is set up for.
    pub fn is_news(&mut self, report: WifiReport) -> bool {
        if report.is_fault() {
            self.fault = Some(report);
        }
        if self.announced.contains(&report) {
            return false;
        }
        if self.is_success(report) {
            self.forget_reports();
        } else if is_interruption(report) {
            self.announced.retain(|report| report.is_fault());
        }
        // There is room for each kind: another address is a success.
        let _ = self.announced.push(report);
        true
    }

    /// Whether the radio does what it is set up for.
    fn is_success(&self, report: WifiReport) -> bool {
        match report {
            WifiReport::AddressObtained(_) => true,
            WifiReport::AccessPointUp => self.choice.mode == WifiMode::AccessPoint,
            _ => false,
        }
    }

    pub fn forget_reports(&mut self) {
        self.announced.clear();
        self.fault = None;
    }

    /// Follows the parameters, and returns whether they have changed.
    pub fn follow(&mut self, parameters: &Parameters) -> bool {
        let choice = WifiChoice::from_parameters(parameters);
        replace(&mut self.choice, choice) != choice
    }
}

/// Whether the radio's task has failed: its driver gives up at what it does not expect, and a radio that makes it do so must
/// not restart the board again and again. Anything may hang or be interrupted during its turn: once in a row that is not blamed
/// on it.
fn is_radio_to_blame(start: &Start) -> bool {
    let crash = start
        .crash
        .as_ref()
        .filter(|crash| start.has_crashed && crash.is_during(RADIO_TASK));
    start.radio == Radio::Present
        && crash.is_some_and(|crash| crash.is_fault_of_task() || start.radio_crashes > 1)
}

/// Whether a report ends a success, so that the next one is announced.
fn is_interruption(report: WifiReport) -> bool {
    matches!(
        report,
        WifiReport::NoAnswer | WifiReport::DownloadFailed | WifiReport::NetworkLost
    )
}
