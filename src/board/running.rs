//! Which task is running, noted where a reset by the watchdog does not reach: a task that never yields can't be recorded
//! by other code.
//!
//! The notes are in the watchdog's scratch registers 0 and 1. Only power-on and RUN clear them (RP2040 datasheet, 4.7.4),
//! and the boot ROM needs those two only to restart itself for USB (`reset_to_usb_boot`).
#![expect(unsafe_code, reason = "the names stay in a section without an initialiser")]

use core::future::poll_fn;
use core::sync::atomic::{AtomicBool, AtomicU32, AtomicUsize, Ordering};
use core::task::Poll;

use embassy_executor::raw::task_from_waker;
use embassy_rp::pac::WATCHDOG;

use crate::crash::{TaskName, TaskNameWords};
use crate::log::warn;
use crate::memory::identity::FirmwareHash;
use crate::memory::retained::{RetainedWords, sealed, sealed_value};

/// Content of a register that was not written since power-on or RUN.
const NOTHING: u32 = 0;
/// Noted between tasks, and when `main` begins to note; neither is the address of a task.
const NO_TASK: u32 = 1;
const MAIN: u32 = 2;

const MAX_TASKS: usize = 20;
const ENTRY_WORDS: usize = 1 + size_of::<TaskNameWords>() / 4;

/// The id and the name of each task. They are retained, too: a name has to be the one that the program had which ran then.
#[unsafe(link_section = ".uninit.TASK_NAMES")]
static NAMES: [RetainedWords<ENTRY_WORDS>; MAX_TASKS] = [const { RetainedWords::new() }; MAX_TASKS];
static NAMED: AtomicUsize = AtomicUsize::new(0);

/// Identifies the hash of a program.
const FIRMWARE_MAGIC: u32 = u32::from_le_bytes(*b"FWH1");

/// Hash of the program that runs, once known. Retained as the names are.
#[unsafe(link_section = ".uninit.FIRMWARE")]
static FIRMWARE: RetainedWords<3> = RetainedWords::new();

/// The note before a task in an interrupt began. Only one executor runs in an interrupt.
static INTERRUPTED: AtomicU32 = AtomicU32::new(NOTHING);

/// The executor runs `main` before that could look at the notes.
static NOTES_WERE_READ: AtomicBool = AtomicBool::new(false);

/// Notes of a program until it was reset.
pub(super) struct Notes {
    pub running: Option<TaskName>,
    /// The task because of which the watchdog was not fed.
    pub overdue: Option<TaskName>,
    pub firmware: Option<FirmwareHash>,
}

/// The notes of the program before this start; `None` if it makes none. From now on this program's are made.
pub(super) fn take_notes() -> Option<Notes> {
    let running = WATCHDOG.scratch0().read();
    let notes = Notes {
        running: name_of(running),
        overdue: name_of(WATCHDOG.scratch1().read()),
        firmware: firmware(),
    };
    FIRMWARE.set([0; 3]);
    WATCHDOG.scratch1().write_value(NOTHING);
    WATCHDOG.scratch0().write_value(MAIN);
    NOTES_WERE_READ.store(true, Ordering::Relaxed);
    (running != NOTHING).then_some(notes)
}

/// Sets how the task `id` is called in a crash record, instead of an earlier name. Every task that is started has to have a
/// name.
pub fn name_task(id: u32, name: &str) {
    let named = NAMED.load(Ordering::Relaxed);
    let place = entries().take(named).position(|(other, _)| other == id);
    let place = place.unwrap_or(named);
    let (Some(entry), Some(name)) = (NAMES.get(place), TaskName::new(name)) else {
        return warn!("no room for the name of task {}", name);
    };
    let [a, b, c, d] = name.to_words();
    entry.set([id, a, b, c, d]);
    NAMED.store(named.max(place + 1), Ordering::Relaxed);
}

/// Sets how the task that awaits this is called in a crash record.
pub async fn name_this_task(name: &str) {
    let own_id = poll_fn(|context| Poll::Ready(task_from_waker(context.waker()).id()));
    name_task(own_id.await, name);
}

/// Notes which program runs, for a crash record.
pub fn note_firmware(hash: FirmwareHash) {
    FIRMWARE.set(sealed(hash.number(), FIRMWARE_MAGIC));
}

/// The program that runs, if noted.
pub(super) fn firmware() -> Option<FirmwareHash> {
    FirmwareHash::from_word(sealed_value(&FIRMWARE.get(), FIRMWARE_MAGIC)?)
}

/// The task that is running.
pub(super) fn running_task() -> Option<TaskName> {
    name_of(WATCHDOG.scratch0().read())
}

/// The watchdog is not fed because this task is overdue, or is fed again.
pub(super) fn note_overdue(task: Option<&str>) {
    WATCHDOG
        .scratch1()
        .write_value(task.and_then(id_of).unwrap_or(NOTHING));
}

/// The executor is about to poll a task.
pub(super) fn note_begin(task_id: u32) {
    if NOTES_WERE_READ.load(Ordering::Relaxed) {
        WATCHDOG.scratch0().write_value(task_id);
    }
}

/// The executor has polled a task.
pub(super) fn note_end() {
    note_begin(NO_TASK);
}

/// A task in an interrupt is about to be polled.
pub(super) fn note_interruption(task_id: u32) {
    INTERRUPTED.store(WATCHDOG.scratch0().read(), Ordering::Relaxed);
    note_begin(task_id);
}

/// A task in an interrupt was polled; what it has interrupted goes on.
pub(super) fn note_resumption() {
    note_begin(INTERRUPTED.load(Ordering::Relaxed));
}

fn name_of(id: u32) -> Option<TaskName> {
    if [NOTHING, NO_TASK].contains(&id) {
        return None;
    }
    match entries().find(|(other, _)| *other == id) {
        Some((_, name)) => name,
        None => TaskName::new("main"),
    }
}

fn id_of(name: &str) -> Option<u32> {
    let name = TaskName::new(name)?;
    let (id, _) = entries().find(|(_, other)| *other == Some(name))?;
    Some(id)
}

fn entries() -> impl Iterator<Item = (u32, Option<TaskName>)> {
    NAMES.iter().map(|entry| {
        let [id, name @ ..] = entry.get();
        (id, TaskName::from_words(name))
    })
}
