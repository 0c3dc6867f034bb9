//! The six packs of the board: two on the converter, a power monitor and a smart battery on the I2C bus, two batteries on the
//! CAN bus.

use std::cell::RefCell;
use std::rc::Rc;

use crate::bench::Bench;
use crate::can::transfers::{A, A_LATER, B, B_LATER};
use crate::can::{BITS_PER_SECOND, CRYSTAL_HZ, CanRig, Peer, Transfer};
use crate::i2c_bus::{BUS, shared};
use emulator::i2c_devices::{Garbled, Ina226, Pec, Reads, RegisterMap, SmartBattery};
use emulator::{AdcInput, Random};
use support::charge_states::UNHEALTHY;
use support::frames::{BatteryStatus, Frame};

const MONITOR_AT: u8 = 0x40;
const BATTERY_AT: u8 = 0x0b;

/// The converter's channels of the first two packs.
const DIVIDERS: [usize; 2] = [0, 2];

/// A battery that can't send keeps no more frames than these: two reports.
const WAITING_FRAMES: usize = 12;

/// What the batteries on the CAN bus report, and how many millivolts that is.
const CAN_REPORTS: [[(Transfer, u32); 2]; 2] =
    [[(A, 12_500), (A_LATER, 12_250)], [(B, 25_000), (B_LATER, 24_500)]];

pub const PARAMETERS: [(&str, f32); 9] = [
    ("BATT2_MONITOR", 3.0),
    ("BATT2_VOLT_PIN", 28.0),
    ("BATT3_MONITOR", 21.0),
    ("BATT4_MONITOR", 7.0),
    ("CAN_P1_DRIVER", 1.0),
    ("BATT5_MONITOR", 8.0),
    ("BATT5_SERIAL_NUM", 1.0),
    ("BATT6_MONITOR", 8.0),
    ("BATT6_SERIAL_NUM", 2.0),
];

/// Packs by their instance.
pub const ON_ADC: &[u8] = &[0, 1];
pub const ON_BUS: &[u8] = &[2, 3];
pub const ON_CAN: &[u8] = &[4, 5];
pub const BUT_ADC: &[u8] = &[2, 3, 4, 5];
pub const BUT_BUS: &[u8] = &[0, 1, 4, 5];
pub const BUT_CAN: &[u8] = &[0, 1, 2, 3];
pub const ALL: &[u8] = &[0, 1, 2, 3, 4, 5];
const COUNT: usize = ALL.len();

/// A count of the converter is 3.2 mV, and what is on the wire is whole millivolts.
const TOLERANCE_MV: u32 = 4;

/// Of the conversions, while there are glitches.
const GLITCH_RATE: f64 = 0.05;

pub struct Packs {
    pub monitor: Rc<RefCell<Garbled<RegisterMap<Ina226>>>>,
    pub battery: Rc<RefCell<SmartBattery>>,
    pub can: CanRig,
    /// The batteries on the CAN bus, and which of their reports they send.
    can_batteries: [(Peer, usize); 2],
    pub can_is_silent: bool,
    random: Random,
    codes: [u16; 2],
    voltages_mv: [u32; COUNT],
    /// Since when each is reported right, of what was reported since [`Self::expect_news`].
    right_since_us: [Option<u64>; COUNT],
    /// Those that have to be right in every report.
    watched: &'static [u8],
}

impl Packs {
    /// Solders a CAN controller to the board.
    pub fn new(random: Random, bench: &mut Bench) -> Self {
        let can = CanRig::new(bench, CRYSTAL_HZ, BITS_PER_SECOND);
        Self {
            can_batteries: [(can.peer(), 0), (can.peer(), 0)],
            can,
            can_is_silent: false,
            monitor: shared(Garbled::new(Ina226::new(0.0005), Reads::Own)),
            battery: shared(SmartBattery::new(Pec::Right)),
            random,
            codes: [0; 2],
            voltages_mv: [0; COUNT],
            right_since_us: [None; COUNT],
            watched: &[],
        }
    }

    /// Puts the parts on the bus. They have lost what was set.
    pub fn plug_in(&self, bench: &mut Bench) {
        self.monitor.borrow_mut().power_cycle();
        let (monitor, battery) = (Rc::clone(&self.monitor), Rc::clone(&self.battery));
        bench.i2c(BUS).attach(MONITOR_AT, Box::new(monitor));
        bench.i2c(BUS).attach(BATTERY_AT, Box::new(battery));
    }

    pub fn unplug(bench: &mut Bench) {
        bench.i2c(BUS).detach(MONITOR_AT);
        bench.i2c(BUS).detach(BATTERY_AT);
    }

    /// Gives packs other voltages, so that what is reported later can't be of before.
    pub fn change_voltages(&mut self, packs: &[u8], bench: &mut Bench) {
        for pack in packs {
            let step = self.random.below(200) as u16;
            self.voltages_mv[usize::from(*pack)] = match pack {
                0 | 1 => self.set_code(usize::from(*pack), 2400 + step, bench),
                2 => self.set_monitor(11_500 + 5 * u32::from(step)),
                // Three cells.
                3 => self.set_battery(11_100 + 3 * u32::from(step)),
                number => self.set_can_battery(usize::from(number - 4)),
            };
        }
    }

    fn set_code(&mut self, pack: usize, code: u16, bench: &mut Bench) -> u32 {
        self.codes[pack] = code;
        bench.adc_input(DIVIDERS[pack], AdcInput::Code(code));
        (f64::from(code) / 4095.0 * 3.3 * 3.95 * 1000.0).round() as u32
    }

    fn set_monitor(&self, millivolts: u32) -> u32 {
        self.monitor.borrow_mut().set(f64::from(millivolts) / 1000.0, 1.0);
        millivolts
    }

    fn set_battery(&self, millivolts: u32) -> u32 {
        let volts = f64::from(millivolts) / 1000.0;
        self.battery.borrow_mut().set(volts, 1.0, 25.0);
        millivolts
    }

    fn set_can_battery(&mut self, number: usize) -> u32 {
        let (_, report) = &mut self.can_batteries[number];
        *report = 1 - *report;
        CAN_REPORTS[number][*report].1
    }

    /// The batteries on the CAN bus report, ten times a second.
    pub fn send_can_reports(&mut self, now_us: u64) {
        if self.can_is_silent {
            return;
        }
        for ((peer, report), reports) in self.can_batteries.iter_mut().zip(CAN_REPORTS) {
            if peer.station.borrow().waiting() < WAITING_FRAMES {
                peer.send(now_us, reports[*report].0);
            }
            peer.take_received();
        }
    }

    /// Some conversions give any code, until the voltages are changed.
    pub fn glitch(&mut self, bench: &mut Bench) {
        for (channel, code) in DIVIDERS.into_iter().zip(self.codes) {
            let mut random = Random::new(self.random.next_u64());
            let code_at = move |_| match random.unit() < GLITCH_RATE {
                true => random.below(4096) as u16,
                false => code,
            };
            bench.adc_input(channel, AdcInput::CodeAt(Box::new(code_at)));
        }
    }

    /// These have to be right from now on.
    pub fn watch(&mut self, packs: &'static [u8]) {
        self.watched = packs;
    }

    /// From now on it counts who is reported right.
    pub fn expect_news(&mut self) {
        self.right_since_us = [None; COUNT];
    }

    /// When the last of them was reported right; `None` while one is not.
    pub fn back_us(&self) -> Option<u64> {
        let since_us: Option<Vec<u64>> = self.right_since_us.into_iter().collect();
        since_us?.into_iter().max()
    }

    /// A BATTERY_STATUS.
    pub fn take(&mut self, frame: &Frame) {
        let status = BatteryStatus(frame);
        let place = usize::from(status.instance());
        let expected_mv = self.voltages_mv[place];
        let reported_mv = status.sum_of_cells_mv();
        let is_right =
            status.charge_state() != UNHEALTHY && reported_mv.abs_diff(expected_mv) <= TOLERANCE_MV;
        assert!(
            is_right || !self.watched.contains(&status.instance()),
            "pack {place}: {reported_mv} mV instead of {expected_mv} mV, charge state {}",
            status.charge_state()
        );
        let since_us = &mut self.right_since_us[place];
        *since_us = is_right.then(|| since_us.unwrap_or(frame.at_us));
    }
}
