//! From interrupt lines to pending interrupts, and which may preempt which (ARMv6-M B1.5, B3.4).

use rp2040_emu::bus::ppb::Ppb;
use rp2040_emu::core::Nvic;

const PENDSV: u16 = 14;
const SYSTICK: u16 = 15;
const FIRST_INTERRUPT: u16 = 16;
const ICSR_PENDSVSET: u32 = 1 << 28;
const ICSR_PENDSTSET: u32 = 1 << 26;

/// Priority of thread mode: below everything.
const THREAD_PRIORITY: i16 = 256;

/// The lines as the NVIC saw them last, and those a test has cut.
#[derive(Clone, Default)]
pub struct InterruptLines {
    level: u32,
    cut: u32,
}

impl InterruptLines {
    /// A cut line never makes its interrupt pending.
    pub fn cut(&mut self, line: u32) {
        self.cut |= 1 << line;
    }

    pub fn restore(&mut self, line: u32) {
        self.cut &= !(1 << line);
    }

    /// Make interrupts pending. A line that is high is pending again as soon as its handler has
    /// returned; one that rises while the handler runs is pending at once; one that falls before
    /// it was taken stays pending (Cortex-M0+ Devices Generic User Guide, 4.2.9).
    pub fn update(&mut self, level: u32, nvic: &mut Nvic, ppb: &Ppb) {
        let level = level & !self.cut;
        let rising = level & !self.level;
        let active = (ppb.active >> FIRST_INTERRUPT) as u32;
        nvic.pending |= rising | (level & !active);
        nvic.pending &= !self.cut;
        self.level = level;
    }

    /// After a reset of the processor the NVIC has seen nothing yet.
    pub fn forget_levels(&mut self) {
        self.level = 0;
    }
}

/// Priority of the most urgent exception that waits to be taken.
pub fn pending_priority(nvic: &Nvic, ppb: &Ppb) -> Option<i16> {
    let system = [(ICSR_PENDSVSET, PENDSV), (ICSR_PENDSTSET, SYSTICK)];
    let system = system.iter().filter(|(flag, _)| ppb.icsr & flag != 0);
    let system = system
        .map(|&(_, exception)| ppb.exception_priority(exception))
        .min();
    let interrupt = nvic
        .highest_priority_pending()
        .map(|(_, priority)| i16::from(priority));
    [system, interrupt].into_iter().flatten().min()
}

/// Priority at which the processor runs, PRIMASK left aside.
pub fn execution_priority(nvic: &Nvic, ppb: &Ppb) -> i16 {
    let mut active = ppb.active;
    let mut priority = THREAD_PRIORITY;
    while active != 0 {
        let exception = active.trailing_zeros() as u16;
        priority = priority.min(exception_priority(exception, nvic, ppb));
        active &= active - 1;
    }
    priority
}

fn exception_priority(exception: u16, nvic: &Nvic, ppb: &Ppb) -> i16 {
    match exception.checked_sub(FIRST_INTERRUPT) {
        Some(line) => i16::from(nvic.get_priority(line as u8)),
        None => ppb.exception_priority(exception),
    }
}

/// Something waits that is more urgent than what runs, PRIMASK left aside.
pub fn would_preempt(nvic: &Nvic, ppb: &Ppb) -> bool {
    pending_priority(nvic, ppb).is_some_and(|waiting| waiting < execution_priority(nvic, ppb))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LINE: u32 = 20;

    fn parts() -> (InterruptLines, Nvic, Ppb) {
        (InterruptLines::default(), Nvic::new(), Ppb::new())
    }

    #[test]
    fn a_high_line_becomes_pending_again_only_after_its_handler() {
        let (mut lines, mut nvic, mut ppb) = parts();
        lines.update(1 << LINE, &mut nvic, &ppb);
        assert!(nvic.is_pending(LINE as u8));
        nvic.pending = 0;
        ppb.mark_active(16 + LINE as u16);
        lines.update(1 << LINE, &mut nvic, &ppb);
        assert_eq!(nvic.pending, 0, "still in its handler");
        ppb.clear_active(16 + LINE as u16);
        lines.update(1 << LINE, &mut nvic, &ppb);
        assert!(nvic.is_pending(LINE as u8));
    }

    #[test]
    fn a_rising_edge_during_the_handler_is_kept() {
        let (mut lines, mut nvic, mut ppb) = parts();
        ppb.mark_active(16 + LINE as u16);
        lines.update(0, &mut nvic, &ppb);
        lines.update(1 << LINE, &mut nvic, &ppb);
        lines.update(0, &mut nvic, &ppb);
        assert!(nvic.is_pending(LINE as u8));
    }

    #[test]
    fn a_cut_line_is_never_pending() {
        let (mut lines, mut nvic, ppb) = parts();
        lines.cut(LINE);
        lines.update(1 << LINE, &mut nvic, &ppb);
        assert_eq!(nvic.pending, 0);
        lines.restore(LINE);
        lines.update(1 << LINE, &mut nvic, &ppb);
        assert!(nvic.is_pending(LINE as u8));
    }
}
