//! Crash records, and the names of tasks in them: as characters, since a pointer would be invalid after a firmware update.

use core::fmt::{self, Display, Formatter, Write};
use core::ops::Range;

use crate::memory::identity::FirmwareHash;
use crate::memory::retained::{is_sealed, seal};

/// Identifies this layout.
const MAGIC: u32 = u32::from_le_bytes(*b"CRS2");

/// Recorded words of the stack: a few frames, the innermost first.
pub const STACK_WORDS: usize = 32;

/// Magic number, cause, task name, firmware, three registers, stack, checksum.
const RECORD_WORDS: usize = 2 + 4 + 1 + 3 + STACK_WORDS + 1;

/// A record as words.
pub type CrashWords = [u32; RECORD_WORDS];

/// Codes of the causes.
const FAULT: u32 = 1;
const OVERDUE: u32 = 2;
const HUNG: u32 = 3;

/// xPSR: active exception number (ARMv6-M B1.4.2); external interrupts start at 16.
const EXCEPTION: u32 = 0x3F;
const FIRST_INTERRUPT: u32 = 16;

/// A crash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct CrashRecord {
    /// The running task, or the overdue one; `None` between tasks.
    pub task: Option<TaskName>,
    /// The cause.
    pub cause: CrashCause,
    /// The firmware that crashed, unless it crashed before it had computed its hash.
    pub firmware: Option<FirmwareHash>,
}

/// Cause of a crash.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum CrashCause {
    /// HardFault: an illegal access, an undefined instruction, or a panic.
    Fault(FaultSite),
    /// The task missed its check-in deadline, so the watchdog was not fed.
    Overdue,
    /// The watchdog was not fed although no task was overdue: a task did not yield, or the processor locked up.
    Hung,
}

/// Registers and stack at a fault.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FaultSite {
    /// Program counter.
    pub pc: u32,
    /// Link register: the return address, unless the function has made calls.
    pub lr: u32,
    /// Program status register.
    pub xpsr: u32,
    /// The stack from the stack pointer on; zeros beyond its end, and if the pointer was outside.
    pub stack: [u32; STACK_WORDS],
}

impl FaultSite {
    /// The external interrupt whose handler was active.
    pub fn interrupt(&self) -> Option<u32> {
        (self.xpsr & EXCEPTION).checked_sub(FIRST_INTERRUPT)
    }

    /// Probable call sites, the innermost first: words on the stack that lie in `code` with the Thumb bit set. Some may
    /// be stale, of earlier calls.
    pub fn call_sites(&self, code: Range<u32>) -> impl Iterator<Item = u32> + Clone {
        let words = self.stack.iter().copied();
        words
            .filter(move |word| word & 1 == 1 && code.contains(word))
            // Into the call instruction before the return address, less the Thumb bit.
            .map(|return_address| return_address - 3)
    }
}

impl CrashRecord {
    /// Whether it was during the turn of `task`, or since that was overdue.
    pub fn is_during(&self, task: &str) -> bool {
        self.task.is_some() && self.task == TaskName::new(task)
    }

    /// Whether the task itself is at fault: not an interrupt, nor what may have kept it from going on.
    pub fn is_fault_of_task(&self) -> bool {
        matches!(&self.cause, CrashCause::Fault(site) if site.interrupt().is_none())
    }

    /// The record as words with magic number and checksum.
    pub fn to_words(&self) -> CrashWords {
        let mut words = [0; RECORD_WORDS];
        let [_, code, a, b, c, d, firmware, pc, lr, xpsr, stack @ .., _] = &mut words;
        [*a, *b, *c, *d] = self.task.map_or([0; 4], TaskName::to_words);
        *firmware = FirmwareHash::to_word(self.firmware);
        *code = match &self.cause {
            CrashCause::Overdue => OVERDUE,
            CrashCause::Hung => HUNG,
            CrashCause::Fault(site) => {
                (*pc, *lr, *xpsr, *stack) = (site.pc, site.lr, site.xpsr, site.stack);
                FAULT
            }
        };
        seal(&mut words, MAGIC);
        words
    }

    /// The record in `words`, if they are valid.
    pub fn from_words(words: &CrashWords) -> Option<Self> {
        if !is_sealed(words, MAGIC) {
            return None;
        }
        let &[_, code, a, b, c, d, firmware, pc, lr, xpsr, stack @ .., _] = words;
        let cause = match code {
            FAULT => CrashCause::Fault(FaultSite { pc, lr, xpsr, stack }),
            OVERDUE => CrashCause::Overdue,
            HUNG => CrashCause::Hung,
            _ => return None,
        };
        Some(Self {
            task: TaskName::from_words([a, b, c, d]),
            cause,
            firmware: FirmwareHash::from_word(firmware),
        })
    }
}

/// A task's name as words of four characters.
pub type TaskNameWords = [u32; 4];

/// A task's name of 1 to 16 ASCII characters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TaskName(TaskNameWords);

impl TaskName {
    /// `name`, truncated; `None` if empty.
    pub fn new(name: &str) -> Option<Self> {
        let mut bytes = name.bytes();
        let word = [(); 4];
        Self::from_words(word.map(|()| u32::from_le_bytes([(); 4].map(|()| bytes.next().unwrap_or(0)))))
    }

    /// The name as words.
    pub fn to_words(self) -> TaskNameWords {
        self.0
    }

    /// The name in `words`; `None` for zeros.
    pub fn from_words(words: TaskNameWords) -> Option<Self> {
        (words != TaskNameWords::default()).then_some(Self(words))
    }
}

/// Drops characters that are not printable.
impl Display for TaskName {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        let bytes = self.0.iter().flat_map(|word| word.to_le_bytes());
        bytes
            .filter(|byte| (b' '..=b'~').contains(byte))
            .try_for_each(|byte| f.write_char(char::from(byte)))
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn site() -> impl Strategy<Value = FaultSite> {
        any::<(u32, u32, u32, [u32; STACK_WORDS])>().prop_map(|(pc, lr, xpsr, stack)| FaultSite {
            pc,
            lr,
            xpsr,
            stack,
        })
    }

    fn cause() -> impl Strategy<Value = CrashCause> {
        prop_oneof![
            site().prop_map(CrashCause::Fault),
            Just(CrashCause::Overdue),
            Just(CrashCause::Hung),
        ]
    }

    fn record() -> impl Strategy<Value = CrashRecord> {
        let task = prop::option::of("[ -~]{1,16}");
        (task, cause(), any::<u32>()).prop_map(|(task, cause, firmware)| CrashRecord {
            task: task.and_then(|name| TaskName::new(&name)),
            cause,
            firmware: FirmwareHash::from_word(firmware),
        })
    }

    proptest! {
        #[test]
        fn records_round_trip(record in record()) {
            prop_assert_eq!(CrashRecord::from_words(&record.to_words()), Some(record));
        }

        #[test]
        fn arbitrary_words_are_no_record(words in prop::collection::vec(any::<u32>(), RECORD_WORDS)) {
            prop_assert_eq!(CrashRecord::from_words(&words.try_into().unwrap()), None);
        }

        #[test]
        fn torn_record_is_invalid(record in record(), written in 0..RECORD_WORDS) {
            let mut torn = [0; RECORD_WORDS];
            torn[..written].copy_from_slice(&record.to_words()[..written]);
            prop_assert_eq!(CrashRecord::from_words(&torn), None);
        }
    }

    #[test]
    fn unknown_cause_is_invalid() {
        let mut words = CrashRecord {
            task: None,
            cause: CrashCause::Hung,
            firmware: None,
        }
        .to_words();
        words[1] = HUNG + 1;
        seal(&mut words, MAGIC);
        assert_eq!(CrashRecord::from_words(&words), None);
    }

    #[test]
    fn call_sites_are_odd_words_in_the_code() {
        let mut site = FaultSite {
            pc: 0,
            lr: 0,
            xpsr: 0x0100_0000,
            stack: [0; STACK_WORDS],
        };
        assert_eq!(site.interrupt(), None);
        site.xpsr = 0x2100_0000 | (16 + 20);
        assert_eq!(site.interrupt(), Some(20));
        let words = [
            0x1000_2001,
            0x1000_2002,
            0x1000_1001,
            0x1000_0FFF,
            0x1000_3001,
            0x2000_0001,
        ];
        site.stack[..6].copy_from_slice(&words);
        assert!(
            site.call_sites(0x1000_1000..0x1000_3000)
                .eq([0x1000_1FFE, 0x1000_0FFE])
        );
    }

    fn written(name: &str) -> Option<String> {
        TaskName::new(name).map(|name| name.to_string())
    }

    #[test]
    fn name_is_truncated_and_printable() {
        assert_eq!(written("UART0 reader").unwrap(), "UART0 reader");
        assert_eq!(written("seventeen letters").unwrap(), "seventeen letter");
        assert_eq!(written("a\n\u{7f}b\0c").unwrap(), "abc");
        assert_eq!(written(""), None);
    }

    proptest! {
        #[test]
        fn names_round_trip(name in "[ -~]{1,16}") {
            let words = TaskName::new(&name).unwrap().to_words();
            prop_assert_eq!(TaskName::from_words(words).unwrap().to_string(), name);
        }

        #[test]
        fn arbitrary_words_are_printable(words: TaskNameWords) {
            let written = TaskName::from_words(words).unwrap().to_string();
            prop_assert!(written.len() <= 16 && !written.contains(|character: char| character.is_control()));
        }
    }
}
