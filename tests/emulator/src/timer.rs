//! TIMER: the 64-bit microsecond counter with four alarms (datasheet 4.6). Writing the count, pausing it and forcing
//! an interrupt are not modelled: a panic.

use super::clock::{Cycle, NEVER, Tick};
use super::peripheral::Peripheral;
use super::register::{RegisterWrite, bit};

const TIMEHW: u32 = 0x00;
const TIMELW: u32 = 0x04;
const TIMEHR: u32 = 0x08;
const TIMELR: u32 = 0x0c;
const ALARM0: u32 = 0x10;
const ALARM3: u32 = 0x1c;
const ARMED: u32 = 0x20;
const TIMERAWH: u32 = 0x24;
const TIMERAWL: u32 = 0x28;
const DBGPAUSE: u32 = 0x2c;
const PAUSE: u32 = 0x30;
/// The bit for core 0, before that for core 1.
const DBGPAUSE_DBG0: u32 = 1;
const INTR: u32 = 0x34;
const INTE: u32 = 0x38;
const INTF: u32 = 0x3c;
const INTS: u32 = 0x40;

const ALARMS: usize = 4;
const ALARM_MASK: u32 = 0b1111;

#[derive(Clone, Default)]
pub struct Timer {
    /// The tick made by the watchdog block; without it the counter stands still (datasheet 4.7.2).
    tick: Option<Tick>,
    /// The counter had `base_count` at `base_cycle`.
    base_cycle: Cycle,
    base_count: u64,
    /// Reading TIMELR "latches the value in TIMEHR (i.e. stops it updating) until TIMEHR is read"
    /// (4.6.4.1).
    latched_high: Option<u32>,
    alarm: [u32; ALARMS],
    /// The count at which an armed alarm fires.
    due: [Option<u64>; ALARMS],
    dbgpause: u32,
    /// The cores a debugger has halted, one bit each.
    halted_cores: u32,
    intr: u32,
    inte: u32,
}

impl Timer {
    /// The counter.
    pub fn count(&self, now: Cycle) -> u64 {
        let ticks = self
            .running_tick()
            .map_or(0, |tick| tick.count_in(now - self.base_cycle));
        self.base_count.wrapping_add(ticks)
    }

    /// Set the counter; armed alarms wait for the new count to match.
    pub fn set_count(&mut self, count: u64, now: Cycle) {
        self.base_cycle = now;
        self.base_count = count;
        for number in 0..ALARMS {
            if self.due[number].is_some() {
                self.arm(number, now);
            }
        }
    }

    /// An alarm is disarmed without an interrupt, as if it had never matched.
    pub fn lose_alarm(&mut self, number: usize) {
        self.due[number] = None;
    }

    /// The watchdog block starts, stops or changes the tick.
    pub fn set_tick(&mut self, tick: Option<Tick>, now: Cycle) {
        if tick != self.tick {
            self.rebase(now);
            self.tick = tick;
        }
    }

    /// A debugger halts cores, or lets them go on.
    pub fn set_halted_cores(&mut self, cores: u32, now: Cycle) {
        self.rebase(now);
        self.halted_cores = cores;
    }

    fn running_tick(&self) -> Option<Tick> {
        let is_paused = self.dbgpause >> DBGPAUSE_DBG0 & self.halted_cores != 0;
        self.tick.filter(|_| !is_paused)
    }

    fn rebase(&mut self, now: Cycle) {
        self.base_count = self.count(now);
        self.base_cycle = now;
    }

    /// An alarm matches the low 32 bits of the counter, so it fires within 2^32 µs (4.6.3).
    fn arm(&mut self, number: usize, now: Cycle) {
        let count = self.count(now);
        let distance = self.alarm[number].wrapping_sub(count as u32);
        self.due[number] = Some(count.wrapping_add(u64::from(distance)));
    }

    fn armed(&self) -> u32 {
        (0..ALARMS)
            .map(|number| u32::from(self.due[number].is_some()) << number)
            .sum()
    }

    fn time_of_count(&self, count: u64) -> Cycle {
        let Some(tick) = self.running_tick() else {
            return NEVER;
        };
        let ticks = count.saturating_sub(self.base_count);
        self.base_cycle.saturating_add(tick.time_of(ticks))
    }
}

impl Peripheral for Timer {
    fn read(&mut self, offset: u32, now: Cycle) -> u32 {
        let count = self.count(now);
        match offset {
            TIMEHR => self.latched_high.take().unwrap_or((count >> 32) as u32),
            TIMELR => {
                self.latched_high = Some((count >> 32) as u32);
                count as u32
            }
            ALARM0..=ALARM3 => self.alarm[alarm_number(offset)],
            ARMED => self.armed(),
            TIMERAWH => (count >> 32) as u32,
            TIMERAWL => count as u32,
            DBGPAUSE => self.dbgpause,
            INTR => self.intr,
            INTE => self.inte,
            INTS => self.interrupt_lines(),
            _ => 0,
        }
    }

    fn write(&mut self, offset: u32, write: RegisterWrite, now: Cycle) {
        match offset {
            ALARM0..=ALARM3 => {
                let number = alarm_number(offset);
                self.alarm[number] = write.applied_to(self.alarm[number]);
                self.arm(number, now);
            }
            ARMED => {
                for number in 0..ALARMS {
                    if bit(write.value, number as u32) {
                        self.due[number] = None;
                    }
                }
            }
            DBGPAUSE => {
                self.rebase(now);
                write.update(&mut self.dbgpause, 0b110);
            }
            INTR => self.intr &= !write.value,
            INTE => write.update(&mut self.inte, ALARM_MASK),
            TIMEHW | TIMELW | PAUSE | INTF => {
                panic!("TIMER: a write at {offset:#x} is not modelled")
            }
            _ => {}
        }
    }

    fn reset(&mut self, now: Cycle) {
        *self = Self {
            tick: self.tick,
            base_cycle: now,
            dbgpause: 0b110,
            halted_cores: self.halted_cores,
            ..Self::default()
        };
    }

    fn advance(&mut self, now: Cycle) {
        let count = self.count(now);
        for number in 0..ALARMS {
            if self.due[number].is_some_and(|due| due <= count) {
                self.due[number] = None;
                self.intr |= 1 << number;
            }
        }
    }

    fn next_event(&self) -> Cycle {
        self.due
            .iter()
            .flatten()
            .map(|&due| self.time_of_count(due))
            .min()
            .unwrap_or(NEVER)
    }

    /// TIMER_IRQ_0 to TIMER_IRQ_3 are NVIC lines 0 to 3.
    fn interrupt_lines(&self) -> u32 {
        self.intr & self.inte
    }
}

fn alarm_number(offset: u32) -> usize {
    ((offset - ALARM0) / 4) as usize
}

#[cfg(test)]
mod tests {
    use super::super::clock::cycles;
    use super::*;

    fn running() -> Timer {
        let mut timer = Timer::default();
        timer.set_tick(Some(Tick { ref_cycles: 12 }), 0);
        timer
    }

    fn write(timer: &mut Timer, offset: u32, value: u32, now: Cycle) {
        timer.write(offset, RegisterWrite::plain(value), now);
    }

    #[test]
    fn counts_microseconds_only_while_the_tick_runs() {
        let mut timer = Timer::default();
        assert_eq!(timer.read(TIMERAWL, cycles(50)), 0, "no tick, no time (4.7.2)");
        timer.set_tick(Some(Tick { ref_cycles: 12 }), cycles(50));
        assert_eq!(timer.read(TIMERAWL, cycles(150)), 100);
        timer.set_tick(Some(Tick { ref_cycles: 24 }), cycles(150));
        assert_eq!(timer.read(TIMERAWL, cycles(250)), 150, "half the tick rate");
    }

    #[test]
    fn reading_the_low_word_latches_the_high_word_until_it_is_read() {
        let mut timer = running();
        timer.set_count(0x1_ffff_ffff, 0);
        assert_eq!(timer.read(TIMELR, 0), 0xffff_ffff);
        assert_eq!(timer.read(TIMERAWH, cycles(1)), 2);
        assert_eq!(timer.read(TIMEHR, cycles(1)), 1, "latched before the carry");
        assert_eq!(timer.read(TIMEHR, cycles(1)), 2);
    }

    #[test]
    fn an_alarm_fires_disarms_itself_and_holds_its_line_until_cleared() {
        let mut timer = running();
        write(&mut timer, INTE, 1 << 2, 0);
        write(&mut timer, ALARM0 + 8, 1000, 0);
        assert_eq!(timer.read(ARMED, 0), 1 << 2);
        assert_eq!(timer.next_event(), cycles(1000));
        timer.advance(cycles(1000) - 1);
        assert_eq!(timer.interrupt_lines(), 0);
        timer.advance(cycles(1000));
        assert_eq!(timer.interrupt_lines(), 1 << 2);
        assert_eq!(timer.read(ARMED, cycles(1000)), 0);
        write(&mut timer, INTR, 1 << 2, cycles(1001));
        assert_eq!(timer.interrupt_lines(), 0);
    }

    #[test]
    fn an_alarm_in_the_past_waits_for_the_32_bit_counter_to_come_round() {
        let mut timer = running();
        write(&mut timer, ALARM0, 10, cycles(20));
        assert_eq!(timer.next_event(), cycles((1 << 32) + 10));
    }

    #[test]
    fn a_written_one_disarms() {
        let mut timer = running();
        write(&mut timer, ALARM0, 10, 0);
        write(&mut timer, ARMED, 1, 0);
        timer.advance(cycles(20));
        assert_eq!(timer.read(INTR, cycles(20)), 0);
    }

    #[test]
    fn masked_alarms_show_raw() {
        let mut timer = running();
        write(&mut timer, ALARM0, 10, 0);
        timer.advance(cycles(10));
        assert_eq!(
            (timer.read(INTR, cycles(10)), timer.read(INTS, cycles(10))),
            (1, 0)
        );
    }

    #[test]
    fn a_halted_core_pauses_it_unless_that_is_switched_off() {
        for (core, its_bit) in [(0, 0b010), (1, 0b100)] {
            let mut timer = running();
            timer.reset(0);
            assert_eq!(timer.read(DBGPAUSE, 0), 0b110, "4.6.5");
            timer.set_halted_cores(1 << core, cycles(10));
            assert_eq!(timer.count(cycles(100)), 10, "core {core}");
            write(&mut timer, DBGPAUSE, 0b110 & !its_bit, cycles(100));
            assert_eq!(timer.count(cycles(101)), 11, "core {core}");
            timer.set_halted_cores(0b11 & !(1 << core), cycles(101));
            assert_eq!(timer.count(cycles(200)), 11, "the other one");
        }
    }
}
