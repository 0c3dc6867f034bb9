//! WATCHDOG: the countdown that resets the chip, its scratch registers and the tick generator
//! (datasheet 4.7).

use super::clock::{Cycle, NEVER, Tick, micros};
use super::peripheral::Peripheral;
use super::register::{RegisterWrite, bit, field};

const CTRL: u32 = 0x00;
const LOAD: u32 = 0x04;
const REASON: u32 = 0x08;
const SCRATCH0: u32 = 0x0c;
const SCRATCH7: u32 = 0x28;
const TICK: u32 = 0x2c;

const CTRL_PAUSE_MASK: u32 = 0b111 << 24;
/// The bit for core 0, before that for core 1.
const CTRL_PAUSE_DBG0: u32 = 25;
const CTRL_ENABLE: u32 = 30;
const CTRL_TRIGGER: u32 = 31;
const COUNT_MASK: u32 = 0x00ff_ffff;
const TICK_ENABLE: u32 = 9;
const TICK_RUNNING: u32 = 10;
const TICK_MASK: u32 = 0x3ff;

/// RP2040-E1: the counter goes down by two at every tick.
const COUNTS_PER_TICK: u32 = 2;

/// Why the watchdog asks for a reset; the number is its REASON bit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum WatchdogReset {
    /// The countdown reached zero.
    Timer = 0b01,
    /// CTRL.TRIGGER was written.
    Force = 0b10,
}

#[derive(Clone)]
pub struct Watchdog {
    ctrl: u32,
    /// The cores a debugger has halted, one bit each.
    halted_cores: u32,
    /// The counter had `base_count` at `base_cycle`.
    base_cycle: Cycle,
    base_count: u32,
    reason: u32,
    scratch: [u32; 8],
    tick: u32,
    request: Option<WatchdogReset>,
    smallest_slack: Option<Cycle>,
}

impl Watchdog {
    pub fn new() -> Self {
        Self {
            ctrl: CTRL_PAUSE_MASK,
            halted_cores: 0,
            base_cycle: 0,
            base_count: 0,
            reason: 0,
            scratch: [0; 8],
            // Datasheet 4.7.6: TICK.ENABLE is 1 after reset, CYCLES is 0.
            tick: 1 << TICK_ENABLE,
            request: None,
            smallest_slack: None,
        }
    }

    /// The tick for TIMER and for the countdown, when it runs.
    pub fn tick(&self) -> Option<Tick> {
        let ref_cycles = u64::from(field(self.tick, 0, 9));
        (bit(self.tick, TICK_ENABLE) && ref_cycles > 0).then_some(Tick { ref_cycles })
    }

    /// A reset the watchdog asks for, once.
    pub fn take_request(&mut self) -> Option<WatchdogReset> {
        self.request.take()
    }

    /// A reset of the whole chip (power-up or RUN pin), after which nothing is remembered: it
    /// resets the scratch registers (4.7.4), and both bits of REASON "are zero for the case of a
    /// hardware reset" (4.7.6).
    pub fn forget(&mut self, now: Cycle) {
        *self = Self {
            base_cycle: now,
            halted_cores: self.halted_cores,
            smallest_slack: self.smallest_slack,
            ..Self::new()
        };
    }

    pub fn is_enabled(&self) -> bool {
        bit(self.ctrl, CTRL_ENABLE)
    }

    /// Enabled, and not paused by a debugger.
    fn is_counting(&self) -> bool {
        self.is_enabled() && self.ctrl >> CTRL_PAUSE_DBG0 & self.halted_cores & 0b11 == 0
    }

    /// A debugger halts cores, or lets them go on.
    pub fn set_halted_cores(&mut self, cores: u32, now: Cycle) {
        self.set_count(self.count(now), now);
        self.halted_cores = cores;
    }

    /// How close the countdown came to zero before it was fed, at its closest, in microseconds.
    pub fn smallest_slack_us(&self) -> Option<u64> {
        self.smallest_slack.map(micros)
    }

    fn count(&self, now: Cycle) -> u32 {
        let running_tick = self.tick().filter(|_| self.is_counting());
        let ticks = running_tick.map_or(0, |tick| tick.count_in(now - self.base_cycle));
        let counts = ticks.saturating_mul(u64::from(COUNTS_PER_TICK));
        self.base_count
            .saturating_sub(u32::try_from(counts).unwrap_or(u32::MAX))
    }

    fn set_count(&mut self, count: u32, now: Cycle) {
        self.base_count = count;
        self.base_cycle = now;
    }

    /// A count of zero at the moment of enabling is noticed by the next tick.
    fn deadline(&self) -> Cycle {
        let Some(tick) = self.tick().filter(|_| self.is_counting()) else {
            return NEVER;
        };
        let ticks = self.base_count.div_ceil(COUNTS_PER_TICK).max(1);
        self.base_cycle.saturating_add(tick.time_of(u64::from(ticks)))
    }

    fn feed(&mut self, count: u32, now: Cycle) {
        if self.is_enabled() {
            let slack = self.deadline().saturating_sub(now);
            self.smallest_slack = Some(self.smallest_slack.map_or(slack, |least| least.min(slack)));
        }
        self.set_count(count & COUNT_MASK, now);
    }

    fn expire(&mut self, reset: WatchdogReset) {
        self.ctrl &= !(1 << CTRL_ENABLE);
        self.reason = reset as u32;
        self.request = Some(reset);
    }
}

impl Peripheral for Watchdog {
    fn read(&mut self, offset: u32, now: Cycle) -> u32 {
        match offset {
            CTRL => self.ctrl | self.count(now),
            REASON => self.reason,
            SCRATCH0..=SCRATCH7 => self.scratch[scratch_number(offset)],
            TICK => self.tick | u32::from(self.tick().is_some()) << TICK_RUNNING,
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, now: Cycle) {
        match offset {
            CTRL => {
                let ctrl = write.applied_to(self.ctrl);
                self.set_count(self.count(now), now);
                self.ctrl = ctrl & (CTRL_PAUSE_MASK | 1 << CTRL_ENABLE);
                if bit(ctrl, CTRL_TRIGGER) {
                    self.expire(WatchdogReset::Force);
                }
            }
            LOAD => self.feed(write.value, now),
            SCRATCH0..=SCRATCH7 => {
                let scratch = &mut self.scratch[scratch_number(offset)];
                *scratch = write.applied_to(*scratch);
            }
            TICK => {
                self.set_count(self.count(now), now);
                write.update(&mut self.tick, TICK_MASK);
            }
            _ => {}
        }
    }

    /// "The watchdog is reset by rst_n_run" (4.7.1), which only power-up and the RUN pin assert: in
    /// any other reset it keeps REASON, scratch registers and tick. It has switched itself off by
    /// firing; left on, it would fire again at once, and silicon does not.
    fn reset(&mut self, now: Cycle) {
        self.set_count(self.count(now), now);
    }

    fn advance(&mut self, now: Cycle) {
        if self.deadline() <= now {
            self.expire(WatchdogReset::Timer);
        }
    }

    fn next_event(&self) -> Cycle {
        self.deadline()
    }
}

fn scratch_number(offset: u32) -> usize {
    ((offset - SCRATCH0) / 4) as usize
}

#[cfg(test)]
mod tests {
    use super::super::clock::cycles;
    use super::*;

    fn write(watchdog: &mut Watchdog, offset: u32, value: u32, now: Cycle) {
        watchdog.write(offset, RegisterWrite::plain(value), now);
    }

    /// Ticking every microsecond, loaded with `load`, enabled at 0.
    fn started(load: u32) -> Watchdog {
        let mut watchdog = Watchdog::new();
        write(&mut watchdog, TICK, 1 << TICK_ENABLE | 12, 0);
        write(&mut watchdog, LOAD, load, 0);
        write(&mut watchdog, CTRL, 1 << CTRL_ENABLE, 0);
        watchdog
    }

    #[test]
    fn counts_down_twice_per_tick() {
        let mut watchdog = started(2_000_000);
        assert_eq!(watchdog.next_event(), cycles(1_000_000), "RP2040-E1");
        assert_eq!(watchdog.read(CTRL, cycles(400_000)) & COUNT_MASK, 1_200_000);
        watchdog.advance(cycles(1_000_000) - 1);
        assert_eq!(watchdog.take_request(), None);
        watchdog.advance(cycles(1_000_000));
        assert_eq!(watchdog.take_request(), Some(WatchdogReset::Timer));
        assert_eq!(watchdog.read(REASON, cycles(1_000_000)), 0b01);
    }

    #[test]
    fn the_longest_period_is_8_3_seconds() {
        let watchdog = started(COUNT_MASK);
        assert_eq!(
            watchdog.next_event(),
            cycles(8_388_608),
            "0xffffff / 2 ticks (4.7.3)"
        );
    }

    #[test]
    fn feeding_restarts_the_countdown_and_its_slack_is_recorded() {
        let mut watchdog = started(2000);
        write(&mut watchdog, LOAD, 2000, cycles(700));
        write(&mut watchdog, LOAD, 2000, cycles(900));
        assert_eq!(watchdog.smallest_slack_us(), Some(300));
        assert_eq!(watchdog.next_event(), cycles(1900));
    }

    #[test]
    fn disabled_or_without_a_tick_it_neither_counts_nor_fires() {
        for register in [CTRL, TICK] {
            let mut watchdog = started(2000);
            write(&mut watchdog, register, 0, cycles(500));
            assert_eq!(watchdog.read(CTRL, cycles(9000)) & COUNT_MASK, 1000);
            assert_eq!(watchdog.next_event(), NEVER);
        }
    }

    #[test]
    fn a_halted_core_pauses_it_when_it_is_to() {
        for (core, its_bit) in [(0, 1 << 25), (1, 1 << 26)] {
            let mut watchdog = started(2000);
            assert_eq!(Watchdog::new().read(CTRL, 0), 0b111 << 24, "4.7.6");
            watchdog.set_halted_cores(1 << core, cycles(500));
            assert_eq!(watchdog.next_event(), cycles(1000), "no pause, core {core}");
            write(&mut watchdog, CTRL, 1 << CTRL_ENABLE | its_bit, cycles(500));
            assert_eq!(watchdog.next_event(), NEVER, "core {core}");
            watchdog.set_halted_cores(0, cycles(700));
            assert_eq!(watchdog.next_event(), cycles(1200), "core {core}");
        }
    }

    #[test]
    fn the_trigger_bit_resets_at_once() {
        let mut watchdog = Watchdog::new();
        watchdog.write(CTRL, RegisterWrite::to_address(0x4005_a000, 1 << CTRL_TRIGGER), 0);
        assert_eq!(watchdog.take_request(), Some(WatchdogReset::Force));
        assert_eq!(watchdog.read(REASON, 0), 0b10);
    }

    #[test]
    fn reason_scratch_and_tick_survive_a_reset_but_not_a_hardware_reset() {
        let mut watchdog = started(2000);
        write(&mut watchdog, SCRATCH7, 0xcafe, 0);
        watchdog.advance(cycles(1000));
        watchdog.reset(cycles(1000));
        assert_eq!(watchdog.read(SCRATCH7, 0), 0xcafe);
        assert_eq!(watchdog.read(REASON, 0), 0b01);
        assert!(!watchdog.is_enabled());
        assert_eq!(watchdog.tick(), Some(Tick { ref_cycles: 12 }));
        watchdog.forget(cycles(2000));
        assert_eq!(watchdog.tick(), None);
        assert_eq!(watchdog.read(SCRATCH7, 0), 0);
        assert_eq!(watchdog.read(REASON, 0), 0);
    }
}
