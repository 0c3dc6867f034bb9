//! The radio's bus, with what comes from the chip checked before the driver sees it.

use core::cell::Cell;
use core::future::pending;

use cyw43::SpiBusCyw43;
use embassy_futures::yield_now;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::Timer;

use crate::wifi::{PacketFault, check_packet};

/// Reading this register gives [`TEST_WORD`] as long as the chip answers (CYW43439 datasheet, table "gSPI registers").
const TEST_REGISTER: u32 = 0x14;
const TEST_WORD: u32 = 0xfeed_bead;
/// Its two low bits are word length and byte order. It is the first register that the driver writes.
const CONTROL_REGISTER: u32 = 0x00;
/// Whether a packet waits, and how long it is.
const STATUS_REGISTER: u32 = 0x08;

/// What the line holds that the chip does not drive.
const SILENCE: [u32; 2] = [0, u32::MAX];

/// So long after a look at a chip that is not awake yet.
const WAKING_MS: u64 = 1;

/// Why there is no sense in going on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, defmt::Format)]
pub(super) enum BusFault {
    /// The chip does not answer any more.
    Silent,
    /// It has refused a control request, with this error code.
    Refused(i32),
}

/// What the owner of the driver learns of the chip.
pub(super) struct ChipState {
    /// Why the driver has to be dropped and begun anew.
    pub fault: Signal<NoopRawMutex, BusFault>,
    pub stage: Cell<Stage>,
}

impl ChipState {
    /// Of a chip that has just been switched on.
    pub fn new() -> Self {
        Self {
            fault: Signal::new(),
            stage: Cell::new(Stage::Waking),
        }
    }
}

/// How far the driver has come with the chip.
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
            (Self::Waking, Function::Registers) if command.address == CONTROL_REGISTER => Self::Starting,
            _ => self,
        }
    }
}

/// A bus on which every transfer leaves the others their turn, and on which the driver sees nothing that it would give up at.
///
/// The driver asserts what it reads, and polls without an end. So a transfer after which the chip does not answer never ends
/// here: the fault is reported, and whoever drives the driver drops it.
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

    async fn check_answer(&mut self, command: Command, words: &mut [u32]) {
        match self.chip.stage.get() {
            // Before anything else the driver repeats this until it gets the test word.
            Stage::Waking if command.address == TEST_REGISTER => Timer::after_millis(WAKING_MS).await,
            Stage::Waking if is_silence(words) => self.fail(BusFault::Silent).await,
            Stage::Waking => {}
            Stage::Starting => self.require_answer().await,
            Stage::Running if command.function == Function::Packets => {
                self.check_packet(command, words).await
            }
            Stage::Running if command.address == STATUS_REGISTER && is_silence(words) => {
                self.require_answer().await
            }
            Stage::Running => {}
        }
    }

    /// Blanks a packet that makes no sense, which the driver then ignores.
    async fn check_packet(&mut self, command: Command, words: &mut [u32]) {
        match check_packet(words, command.bytes) {
            Ok(()) => {}
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
            let stage = self.chip.stage.get().after_write(command);
            self.chip.stage.set(stage);
        }
        yield_now().await;
        status
    }

    async fn cmd_read(&mut self, command: u32, words: &mut [u32]) -> u32 {
        let status = self.bus.cmd_read(command, words).await;
        self.check_answer(self.command(command), words).await;
        yield_now().await;
        status
    }

    async fn wait_for_event(&mut self) {
        self.bus.wait_for_event().await;
        // A line that stays high for no reason must leave the others their turn, too.
        yield_now().await;
    }
}

fn is_silence(words: &[u32]) -> bool {
    words.iter().all(|word| SILENCE.contains(word))
}

/// The part of the chip that a command is for.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Function {
    /// The bus's own registers, or the chip's insides.
    Registers,
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
                2 => Function::Packets,
                _ => Function::Registers,
            },
            address: word >> 11 & 0x1_ffff,
            bytes: (word & 0x7ff) as usize,
        }
    }

    fn read_test_word() -> u32 {
        1 << 30 | TEST_REGISTER << 11 | size_of::<u32>() as u32
    }
}
