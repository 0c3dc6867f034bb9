//! The radio's bus, with what comes from the chip checked before the driver sees it.

use core::cell::Cell;
use core::future::pending;
use core::task::Poll;

use cyw43::SpiBusCyw43;
use embassy_futures::{poll_once, yield_now};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Instant, Timer};

use super::gspi::SHORT_BYTES;
use crate::net::Role;
use crate::wifi::{PacketFault, PacketKind, check_packet, hide_refusal, lower_link};

/// Reading this register gives [`TEST_WORD`] as long as the chip answers (CYW43439 datasheet, table "gSPI registers").
const TEST_REGISTER: u32 = 0x14;
const TEST_WORD: u32 = 0xfeed_bead;
/// Its two low bits are word length and byte order. It is the first register that the driver writes.
const CONTROL_REGISTER: u32 = 0x00;
/// Whether a packet waits, and how long it is.
const STATUS_REGISTER: u32 = 0x08;

/// In the registers of the backplane's bridge: clocks that are asked for, and those that there are.
const CLOCK_REGISTER: u32 = 0x1_000e;
const LOW_POWER_CLOCK_REQUEST: u8 = 1 << 3;
const LOW_POWER_CLOCK: u32 = 1 << 6;

/// There, too.
const WATERMARK_REGISTER: u32 = 0x1_0008;
const WATERMARK: u32 = 0x10;

/// Clock and reset of the WLAN core, in the window that the driver sets before.
const CORE_CLOCK_REGISTER: u32 = 0x3408;
const CORE_CLOCK_MASK: u32 = 0b11;
const CORE_CLOCK_ON: u32 = 0b01;
const CORE_RESET_REGISTER: u32 = 0x3800;
const CORE_RESET: u32 = 1;

/// In the status register: the chip's program takes packets.
const PACKETS_READY: u32 = 1 << 5;

/// Words read from a line that the chip does not drive.
const SILENCE: [u32; 2] = [0, u32::MAX];

/// Pause after a look at a chip that is not awake yet.
const WAKING_MS: u64 = 1;

/// Why there is no sense in going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub(super) enum BusFault {
    /// The chip does not answer any more.
    Silent,
    /// It answers, and a part of it that the driver needs is not ready.
    NotReady,
    /// It has refused a control request, with this error code.
    Refused(i32),
}

/// State of the chip, for the owner of the driver.
pub(super) struct ChipState {
    /// Why the driver has to be dropped and restarted.
    pub fault: Signal<NoopRawMutex, BusFault>,
    pub stage: Cell<Stage>,
    /// Role of the board in its network.
    pub role: Role,
    pub refusals: Cell<Refusals>,
    /// It has refused, and that is not a fault.
    pub refused: Signal<NoopRawMutex, ()>,
    /// Of the chip's start.
    progress: Cell<StartProgress>,
}

impl ChipState {
    /// Of a chip that has just been switched on, for this role.
    pub fn new(role: Role) -> Self {
        Self {
            fault: Signal::new(),
            stage: Cell::new(Stage::Waking),
            role,
            refusals: Cell::new(Refusals::AreFaults),
            refused: Signal::new(),
            progress: Cell::default(),
        }
    }
}

/// The latest steps of the driver while it starts the chip. It is with the owner, since the bus lies in the driver's future several
/// times.
#[derive(Clone, Copy, Default)]
struct StartProgress {
    /// The value written last to [`CLOCK_REGISTER`].
    clock_request: u8,
    /// The read before this one was of [`CORE_CLOCK_REGISTER`].
    was_core_clock: bool,
    /// Since when it has been waiting for a required answer, in ms modulo 2^32.
    waiting_since_ms: Option<u32>,
}

/// Meaning of a control request that the chip refuses.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Refusals {
    /// Something is wrong with the chip.
    AreFaults,
    /// The network can't be joined, or is left already.
    AreReported,
}

/// Progress of the driver with the chip.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Stage {
    /// Words are swapped in halves; the driver waits for the first answer.
    Waking,
    /// Registers are read, programs are written.
    Starting,
    /// Packets come and go.
    Running,
}

impl Stage {
    fn after_write(self, command: Command) -> Self {
        match (self, command.function) {
            (_, Function::Packets) => Self::Running,
            (Self::Waking, Function::Bus) if command.address == CONTROL_REGISTER => Self::Starting,
            _ => self,
        }
    }
}

/// A bus on which only the driver waits for long, and on which the driver sees nothing that it would panic at.
///
/// The driver asserts what it reads, and polls without an end. So a transfer after which the chip does not answer never ends
/// here: the fault is reported, and the caller of the driver drops it.
pub(super) struct CheckedBus<'a, B> {
    bus: B,
    chip: &'a ChipState,
}

impl<'a, B: SpiBusCyw43> CheckedBus<'a, B> {
    /// To a chip that has just been switched on.
    pub(super) fn new(bus: B, chip: &'a ChipState) -> Self {
        Self { bus, chip }
    }

    fn command(&self, word: u32) -> Command {
        Command::from_word(match self.chip.stage.get() {
            Stage::Waking => word.rotate_left(16),
            Stage::Starting | Stage::Running => word,
        })
    }

    /// A long transfer has left the others their turn already. Between the registers that a running driver asks again and again it
    /// waits for an event, or transfers a packet.
    async fn leave_others_their_turn(&self, command: Command) {
        let is_running = self.chip.stage.get() == Stage::Running;
        let is_between_waits = is_running && command.function != Function::Packets;
        if command.bytes <= SHORT_BYTES && !is_between_waits {
            yield_now().await;
        }
    }

    /// Checks what was read before the driver sees it:
    ///
    /// | stage | read of | required | otherwise |
    /// |---|---|---|---|
    /// | waking | test register | – | the driver repeats it until it gets the test word |
    /// | waking | anything else | a line that the chip drives | [`BusFault::Silent`] |
    /// | starting | anything | the chip still answers | [`BusFault::Silent`] |
    /// | starting | a register that the driver waits for | its value in time: [`StartProgress::is_overdue`] | [`BusFault::NotReady`] |
    /// | running | a packet | a valid one: [`check_packet`](Self::check_packet) | it is blanked, or [`BusFault::Refused`] |
    /// | running | status | a line that the chip drives, or the chip still answers | [`BusFault::Silent`] |
    async fn check_answer(&mut self, command: Command, words: &mut [u32]) {
        match self.chip.stage.get() {
            Stage::Waking if command.address == TEST_REGISTER => Timer::after_millis(WAKING_MS).await,
            Stage::Waking if is_silence(words) => self.fail(BusFault::Silent).await,
            Stage::Waking => {}
            Stage::Starting => {
                self.require_answer().await;
                let mut progress = self.chip.progress.get();
                let is_overdue = progress.is_overdue(command, words, Instant::now().as_millis() as u32);
                self.chip.progress.set(progress);
                if is_overdue {
                    self.fail(BusFault::NotReady).await;
                }
            }
            Stage::Running if command.function == Function::Packets => {
                self.check_packet(command, words).await
            }
            Stage::Running if command.address == STATUS_REGISTER && is_silence(words) => {
                self.require_answer().await
            }
            Stage::Running => {}
        }
    }

    fn note_write(&self, command: Command, words: &[u32]) {
        let stage = self.chip.stage.get().after_write(command);
        self.chip.stage.set(stage);
        let mut progress = StartProgress {
            clock_request: self.chip.progress.get().clock_request,
            ..StartProgress::default()
        };
        if command.is_of(Function::Backplane, CLOCK_REGISTER) {
            progress.clock_request = words.get(1).map_or(0, |word| *word as u8);
        }
        self.chip.progress.set(progress);
    }

    /// Blanks a packet that makes no sense, which the driver then ignores.
    async fn check_packet(&mut self, command: Command, words: &mut [u32]) {
        match check_packet(words, command.bytes) {
            Ok(PacketKind::Exclusion) if self.chip.role == Role::Station => lower_link(words),
            Ok(_) => {}
            Err(PacketFault::Refused(code)) if self.chip.refusals.get() == Refusals::AreReported => {
                hide_refusal(words);
                defmt::info!("Wi-Fi: refused: {}", code);
                self.chip.refused.signal(());
            }
            Err(PacketFault::Refused(code)) => self.fail(BusFault::Refused(code)).await,
            Err(fault) => {
                defmt::warn!("Wi-Fi: packet dropped: {}", fault);
                words.fill(0);
                self.require_answer().await;
            }
        }
    }

    async fn require_answer(&mut self) {
        let mut answer = [0];
        self.bus.cmd_read(Command::read_test_word(), &mut answer).await;
        if answer != [TEST_WORD] {
            self.fail(BusFault::Silent).await;
        }
    }

    async fn fail(&self, fault: BusFault) {
        self.chip.fault.signal(fault);
        pending().await
    }
}

impl<B: SpiBusCyw43> SpiBusCyw43 for CheckedBus<'_, B> {
    async fn cmd_write(&mut self, write: &[u32]) -> u32 {
        let command = write.first().map(|word| self.command(*word));
        let status = self.bus.cmd_write(write).await;
        if let Some(command) = command {
            self.note_write(command, write);
            self.leave_others_their_turn(command).await;
        }
        status
    }

    async fn cmd_read(&mut self, command: u32, words: &mut [u32]) -> u32 {
        let status = self.bus.cmd_read(command, words).await;
        let command = self.command(command);
        self.check_answer(command, words).await;
        self.leave_others_their_turn(command).await;
        status
    }

    async fn wait_for_event(&mut self) {
        match poll_once(self.bus.wait_for_event()) {
            // A line that stays high for no reason must leave the others their turn, too.
            Poll::Ready(()) => yield_now().await,
            Poll::Pending => self.bus.wait_for_event().await,
        }
    }
}

impl StartProgress {
    /// Takes over an answer, read at `now_ms`. Whether the driver would panic now, as it requires another one and has waited for it
    /// for too long.
    fn is_overdue(&mut self, command: Command, words: &[u32], now_ms: u32) -> bool {
        // Of each required answer the bits that count, their value, and the time in ms for which the driver may repeat the read. By
        // time and not by number: of the status it asks the bus every other time only, and after a pause it catches up.
        let (mask, value, timeout_ms) = match (command.function, command.address) {
            // The driver asks a hundred times, once in a millisecond.
            (Function::Backplane, CLOCK_REGISTER) if self.clock_request == LOW_POWER_CLOCK_REQUEST => {
                (LOW_POWER_CLOCK, LOW_POWER_CLOCK, 90)
            }
            // It reads the value that it has written.
            (Function::Backplane, WATERMARK_REGISTER) => (u32::MAX, WATERMARK, 0),
            // It reads the clock twice and then the reset only to see whether the core runs.
            (Function::Backplane, CORE_CLOCK_REGISTER) if self.was_core_clock => {
                (CORE_CLOCK_MASK, CORE_CLOCK_ON, 0)
            }
            (Function::Backplane, CORE_RESET_REGISTER) if self.was_core_clock => (CORE_RESET, 0, 0),
            // It asks a thousand times, once in a millisecond.
            (Function::Bus, STATUS_REGISTER) => (PACKETS_READY, PACKETS_READY, 900),
            // Any answer will do.
            _ => (0, 0, 0),
        };
        self.was_core_clock = command.is_of(Function::Backplane, CORE_CLOCK_REGISTER);
        let answer = words.last().copied().unwrap_or(0) & command.mask();
        if answer & mask == value {
            self.waiting_since_ms = None;
            return false;
        }
        let since_ms = *self.waiting_since_ms.get_or_insert(now_ms);
        now_ms.wrapping_sub(since_ms) >= timeout_ms
    }
}

fn is_silence(words: &[u32]) -> bool {
    words.iter().all(|word| SILENCE.contains(word))
}

/// The part of the chip that a command is for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Function {
    /// The bus's own registers.
    Bus,
    /// The chip's insides.
    Backplane,
    /// The queue of packets.
    Packets,
}

/// A command word: bit 31 write, 30 count up, 29 and 28 function, 27 to 11 address, 10 to 0 bytes.
#[derive(Clone, Copy)]
struct Command {
    function: Function,
    address: u32,
    bytes: usize,
}

impl Command {
    fn from_word(word: u32) -> Self {
        Self {
            function: match word >> 28 & 0b11 {
                0 => Function::Bus,
                2 => Function::Packets,
                _ => Function::Backplane,
            },
            address: word >> 11 & 0x1_ffff,
            bytes: (word & 0x7ff) as usize,
        }
    }

    fn is_of(self, function: Function, address: u32) -> bool {
        self.function == function && self.address == address
    }

    /// Significant bits of a register of this length.
    fn mask(self) -> u32 {
        let unused_bits = u32::BITS.saturating_sub(u8::BITS * self.bytes as u32);
        u32::MAX.checked_shr(unused_bits).unwrap_or(0)
    }

    fn read_test_word() -> u32 {
        1 << 30 | TEST_REGISTER << 11 | size_of::<u32>() as u32
    }
}
