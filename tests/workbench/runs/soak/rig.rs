//! A board with six packs and a radio, a ground station with a driver, and the line between them.

use std::collections::{BTreeMap, VecDeque};

use rover_battmon::memory::flash_map;

use super::fault::Fault;
use super::hostile::{hostile, stranger};
use super::ledger::Ledger;
use super::line::{Condition, Line};
use super::motors::{Motors, Orders};
use super::packs::{self, Packs};
use super::receiver::Receiver;
use super::station::Station;
use super::tally::Tally;
use super::wifi::Wifi;
use crate::bench::{Bench, MILLISECOND, SECOND, SIGNING_OFFSET, TestedVehicle};
use crate::downloads::{download, list};
use crate::log_flash::files_in;
use crate::log_records::records_of_torn;
use crate::signing_key::{OWNER, flash_with_key};
use emulator::Random;
use support::requests::{VEHICLE, disarm, param_read_by_name, param_request_list, ping};
use support::signer::Signer;

/// What the ground station sets: nothing that anything else depends on.
const SET: [&str; 6] = [
    "BATT_SERIAL_NUM",
    "BATT2_SERIAL_NUM",
    "BATT3_SERIAL_NUM",
    "BATT4_SERIAL_NUM",
    "BATT_CAPACITY",
    "BATT2_CAPACITY",
];

const STEP_US: u64 = 100 * MILLISECOND;
const BAUD: u32 = 115_200;

/// The line carries 1152 bytes in a step; the last hostile frames are longer than there is room for, and the station sends, too.
const FLOOD_BYTES: usize = 800;

/// Signed frames are longer.
const SIGNED_FLOOD_BYTES: usize = 650;

/// How many of the owner's frames a stranger has recorded. The latest of them may not have arrived, and then they are no
/// recordings yet.
const RECORDED: usize = 200;
const TOO_NEW: usize = 50;

/// The sequence number of the rig's own PINGs; those of the station have another.
pub(super) const PROBE: u32 = 77;

/// A request that was not answered is repeated.
const TRIES: usize = 5;

/// Enough for three times the parameters of six packs: hostile frames that are still on their way may ask for the list again.
const LIST_STEPS: usize = 105;

/// The log goes on for 15 s after disarming, and is in flash a second later.
const LOG_WRITTEN_US: u64 = 17 * SECOND;

/// Which senders a board obeys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Protection {
    /// Everyone.
    None,
    /// Who has the key, which its station has.
    Key,
}

/// A board that starts while its converter fails does not find its radio, and one that hung in the radio's task leaves it off. Either
/// has no Wi-Fi until the next start.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Radio {
    Used,
    Unused,
}

pub struct Rig {
    pub bench: Bench,
    /// Signs what the station sends to a board with a key.
    pub(super) owner: Option<Signer>,
    recorded: VecDeque<Vec<u8>>,
    pub random: Random,
    pub line: Line,
    pub packs: Packs,
    pub wifi: Wifi,
    pub(super) radio: Radio,
    pub(super) converter_works: bool,
    pub ledger: Ledger,
    pub station: Station,
    pub tally: Tally,
    pub(super) orders: Orders,
    pub(super) motors: Motors,
    pub(super) receiver: Receiver,
    /// The last reported value of each parameter.
    pub(super) reported: BTreeMap<String, f32>,
    /// The last HEARTBEAT, or the start.
    pub(super) alive_us: u64,
    /// The first HEARTBEAT since news are expected, and the first answer to one of [`Self::probe`]'s.
    pub(super) heard_us: Option<u64>,
    pub(super) answered_us: Option<u64>,
    /// Resets that were caused so far.
    pub(super) resets: usize,
    /// Of the program, since a start that was asked for.
    pub(super) crashes: u32,
    /// Since when there has been no fault.
    pub(super) calm_since_us: Option<u64>,
}

impl Rig {
    /// A board that runs, with its packs plugged in and everything right.
    pub fn new(seed: u64, protection: Protection) -> Self {
        let mut random = Random::new(seed);
        let mut another = || Random::new(random.next_u64());
        let (line, of_packs) = (Line::new(another()), another());
        let station = Station::new(another(), 4 * SECOND);
        let (seed, of_air) = (random.next_u64(), random.next_u64());
        let owner = (protection == Protection::Key).then(|| Signer::new(OWNER));
        let mut bench = match protection {
            Protection::None => Bench::power_up_seeded(0, seed),
            Protection::Key => Bench::power_up_with_flash_seeded(0, SIGNING_OFFSET, flash_with_key(), seed),
        };
        let wifi = Wifi::new(of_air, &mut bench);
        let packs = Packs::new(of_packs, &mut bench);
        packs.plug_in(&mut bench);
        bench.run_for(SECOND);
        if let Some(owner) = &owner {
            bench.sign_with(owner.clone());
        }
        bench.set_all(&packs::PARAMETERS);
        // Stick input is to take effect at once, and a list to be over soon.
        bench.set_all(&[("MOT_SLEWRATE", 0.0), ("SR0_PARAMS", 50.0)]);
        bench.reboot();
        let mut ledger = Ledger::default();
        for name in SET {
            ledger.add(name, bench.parameter(name));
        }
        let mut rig = Self {
            owner,
            recorded: VecDeque::new(),
            line,
            packs,
            wifi,
            radio: Radio::Used,
            converter_works: true,
            ledger,
            station,
            tally: Tally::default(),
            orders: Orders::default(),
            motors: Motors::default(),
            receiver: Receiver::default(),
            reported: BTreeMap::new(),
            alive_us: 0,
            heard_us: None,
            answered_us: None,
            resets: bench.resets().len(),
            crashes: 0,
            calm_since_us: None,
            random,
            bench,
        };
        rig.start();
        rig
    }

    /// Begins to look at the board, from its next start on.
    fn start(&mut self) {
        Motors::record(&mut self.bench);
        self.bench.uart(0).take_sent();
        self.bench.take_flash_operations();
        self.suffer(Fault::RunPin);
        self.tally = Tally::default();
    }

    pub fn now_us(&self) -> u64 {
        self.bench.time_us()
    }

    /// Lets a tenth of a second pass, in which the station sends what it wants to.
    pub fn step(&mut self) {
        self.send_messages();
        self.packs.send_can_reports(self.bench.time_us());
        self.wifi.run_for(&mut self.bench, STEP_US);
        self.look();
    }

    /// Lets time pass, in steps.
    pub fn run_for(&mut self, time_us: u64) {
        let end_us = self.now_us() + time_us;
        while self.now_us() < end_us {
            self.step();
        }
    }

    pub fn send_messages(&mut self) {
        let now_us = self.now_us();
        let messages = self.station.messages(now_us, &mut self.orders, &mut self.ledger);
        let flood_bytes = self.owner.as_ref().map_or(FLOOD_BYTES, |_| SIGNED_FLOOD_BYTES);
        let behind = self.random.below(flood_bytes);
        self.flood(flood_bytes - behind);
        for message in messages {
            self.send(&message);
        }
        self.flood(behind);
    }

    /// Hostile frames of about this many bytes, if the line is shared.
    fn flood(&mut self, bytes: usize) {
        let mut sent = 0;
        while self.line.condition == Condition::Shared && sent < bytes {
            let piece = self.hostile();
            sent += piece.len();
            self.tally.hostile_pieces += 1;
            self.transmit(&piece);
        }
    }

    /// To a board with a key, every other one is what only a signature keeps out.
    fn hostile(&mut self) -> Vec<u8> {
        if self.owner.is_some() && self.random.below(2) == 0 {
            let old = self.recorded.len().saturating_sub(TOO_NEW);
            let recording = (old > 0).then(|| &self.recorded[self.random.below(old)]);
            return stranger(&mut self.random, recording);
        }
        hostile(&mut self.random)
    }

    /// Sends what the station sends, signed if it has a key.
    pub fn send(&mut self, message: &[u8]) {
        let Some(owner) = &mut self.owner else {
            return self.transmit(message);
        };
        let signed = owner.sign(message);
        self.transmit(&signed);
        self.recorded.push_back(signed);
        if self.recorded.len() > RECORDED {
            self.recorded.pop_front();
        }
    }

    /// Sends over the line as it is.
    fn transmit(&mut self, bytes: &[u8]) {
        let now_us = self.now_us();
        let arriving = self.line.carry(bytes);
        self.bench.uart_send_at_baud(0, now_us, &arriving, BAUD);
    }

    /// Lets time pass until nothing is left of a fault that has ended now.
    pub fn recover(&mut self, fault: Fault) {
        let end_us = self.now_us();
        self.packs.expect_news();
        (self.heard_us, self.answered_us, self.wifi.heard_us) = (None, None, None);
        let back_us = loop {
            if let Some(back_us) = self.back_us(fault) {
                break back_us;
            }
            let past_us = self.now_us() - end_us;
            assert!(
                past_us <= fault.limit_us(),
                "{fault:?}: not back after {past_us} us: HEARTBEAT {:?}, by Wi-Fi {:?}, answer {:?}, packs {:?}",
                self.heard_us,
                self.wifi.heard_us,
                self.answered_us,
                self.packs.back_us()
            );
            self.probe();
            self.step();
        };
        self.tally.recovered(fault, back_us - end_us);
        self.packs.watch(packs::ALL);
        self.calm_since_us = Some(self.now_us());
    }

    /// When the last of what has to come again did so: HEARTBEAT, an answer, every pack, and a HEARTBEAT by Wi-Fi.
    fn back_us(&self, fault: Fault) -> Option<u64> {
        let by_line_us = self.packs.back_us()?.max(self.heard_us?).max(self.answered_us?);
        match fault.hits_wifi() {
            true => Some(by_line_us.max(self.wifi.heard_us?)),
            false => Some(by_line_us),
        }
    }

    /// Asks for an answer until there is one. It shows that the board has dealt with all that was sent before.
    fn probe(&mut self) {
        if self.answered_us.is_none() {
            self.send(&ping(self.now_us(), PROBE));
        }
    }

    /// Asks for every parameter that is set. The ledger panics if one has another value than it may.
    pub fn read_back(&mut self) {
        let names: Vec<_> = self.ledger.names().cloned().collect();
        for name in names {
            self.reported.remove(&name);
            let reported = (0..TRIES).any(|_| {
                self.send(&param_read_by_name(&name));
                self.run_for(2 * STEP_US);
                self.reported.contains_key(&name)
            });
            assert!(reported, "{name} is not reported");
            self.tally.read_back += 1;
        }
    }

    /// All parameters but those that are set.
    pub fn list(&mut self) -> BTreeMap<String, f32> {
        self.reported.clear();
        self.send(&param_request_list(VEHICLE));
        (0..LIST_STEPS).for_each(|_| self.step());
        let mut listed = self.reported.clone();
        listed.retain(|name, _| !SET.contains(&name.as_str()));
        listed
    }

    /// Disarms, downloads the newest log, and reads all of them.
    pub fn read_log(&mut self) {
        let bench = &mut self.bench;
        if let Some(owner) = &self.owner {
            bench.sign_with(owner.clone());
        }
        bench.run_until_silent();
        bench.forget_sent();
        bench.ask(&disarm());
        bench.run_for(LOG_WRITTEN_US);
        let listed = list(bench);
        let files = files_in(&bench.read_flash(flash_map::LOG.start, flash_map::LOG.len()));
        assert_eq!(listed.len(), files.len(), "{listed:?}");
        let (newest, (_, content)) = listed.last().zip(files.last()).expect("it was armed");
        assert!(download(bench, *newest) == *content, "{newest:?}");
        let records = files.iter().map(|(_, content)| records_of_torn(content).len());
        let records: usize = records.sum();
        (self.tally.log_records, self.tally.log_files) = (records, files.len());
        assert!(records > 100 * files.len(), "{records}");
    }

    /// What has happened since `from_us`.
    pub fn sum_up(mut self, from_us: u64) -> Tally {
        let bus_errors = self.bench.bus_errors();
        assert!(bus_errors.is_empty(), "{bus_errors:?}");
        self.tally.seconds = (self.now_us() - from_us) / SECOND;
        self.tally.settings = self.station.settings;
        self.tally.by_wifi = self.wifi.frames;
        self.tally.motor_changes = self.motors.changes;
        self.tally.least_left_us = self.bench.smallest_watchdog_slack_us();
        self.tally.oldest_stick_us = self.motors.oldest_stick_us;
        self.tally
    }
}
