//! The wires of the radio's bus, gSPI, which PIO0 drives.
//!
//! In the place of `cyw43-pio` 0.10.0, which clears no FIFO, so that a transfer that was dropped halfway shifts all later ones by a word,
//! and begins to receive only when its task runs again. A release of it without both replaces this file.

use cyw43::SpiBusCyw43;
use embassy_rp::Peri;
use embassy_rp::dma::Channel;
use embassy_rp::gpio::{Drive, Level, Output, Pull, SlewRate};
use embassy_rp::peripherals::{PIN_24, PIN_29, PIO0};
use embassy_rp::pio::program::pio_asm;
use embassy_rp::pio::{
    Common, Config, Direction, Irq, LoadedProgram, Pin, ShiftConfig, ShiftDirection, StateMachine,
};

/// A bit takes two cycles of the state machine. Of the system's 125 MHz this makes a clock of 31.25 MHz; the chip takes
/// 50 MHz (CYW43439 datasheet, "gSPI timing").
const CLOCK_DIVIDER: u8 = 2;

/// Follows each transfer.
const STATUS_WORDS: usize = 1;

/// Size of a FIFO of the state machine, but for one word: the status, or the command.
const SHORT_WORDS: usize = 3;

/// Up to this length, in bytes, a transfer is over before a DMA channel would have woken the task: the processor waits for it. An
/// answer that fits into the FIFO can't overflow it.
pub(super) const SHORT_BYTES: usize = SHORT_WORDS * size_of::<u32>();

/// Looks at a FIFO for a word, which takes 1 µs on the line.
const LOOKS: usize = 200;

/// The bus, from the pins up to single transfers.
///
/// In the chip's high-speed mode the next bit is on the line as soon as the clock has risen. A full FIFO stops the clock
/// there, and the bit that should have been read is gone. So whatever takes the words of an answer is ready before the
/// command that asks for it: the command is one word, which needs no DMA, and the only channel waits for the answer, unless that
/// fits into the FIFO.
pub(super) struct Gspi<'d> {
    select: Output<'d>,
    shifter: StateMachine<'d, PIO0, 0>,
    /// Raised once the chip has pulled the data line high after a transfer.
    event: Irq<'d, PIO0, 0>,
    dma: Channel<'d>,
    program_start: u8,
}

impl<'d> Gspi<'d> {
    /// Takes the pins, clock and data low, and loads the program into a PIO without any.
    pub(super) fn new(
        common: &mut Common<'d, PIO0>,
        mut shifter: StateMachine<'d, PIO0, 0>,
        event: Irq<'d, PIO0, 0>,
        select: Output<'d>,
        data: Peri<'d, PIN_24>,
        clock: Peri<'d, PIN_29>,
        dma: Channel<'d>,
    ) -> Self {
        let program = pio_asm!(
            ".side_set 1"
            ".wrap_target"
            "write:"
            "    out pins, 1     side 0"
            "    jmp x-- write   side 1"
            "    set pindirs, 0  side 0"
            "    nop             side 0"
            "read:"
            // Reads the line as it was before the clock rises.
            "    in pins, 1      side 1"
            "    jmp y-- read    side 0"
            "    wait 1 pin 0    side 0"
            "    irq 0           side 0"
            ".wrap"
        );
        let program = common.load_program(&program.program);
        let mut data = common.make_pio_pin(data);
        data.set_pull(Pull::None);
        data.set_schmitt(true);
        data.set_input_sync_bypass(true);
        let mut clock = common.make_pio_pin(clock);
        for pin in [&mut data, &mut clock] {
            pin.set_drive_strength(Drive::_12mA);
            pin.set_slew_rate(SlewRate::Fast);
        }
        shifter.set_config(&configuration(&program, &data, &clock));
        shifter.set_pin_dirs(Direction::Out, &[&clock, &data]);
        shifter.set_pins(Level::Low, &[&clock, &data]);
        Self {
            select,
            shifter,
            event,
            dma,
            program_start: program.wrap.target,
        }
    }

    /// Selects the chip, and readies the state machine for this many words out, then in. Whatever an earlier transfer has left,
    /// which may have been dropped on its way, is gone: a word in a FIFO would be taken for one of this transfer.
    fn begin(&mut self, written: usize, read: usize) {
        self.select.set_low();
        let shifter = &mut self.shifter;
        shifter.set_enable(false);
        shifter.clear_fifos();
        shifter.restart();
        #[expect(unsafe_code, reason = "instructions outside of the program")]
        // SAFETY: the state machine stands still, pulls by itself, and the program starts there.
        unsafe {
            shifter.set_x(last_bit(written));
            shifter.set_y(last_bit(read));
            shifter.set_pindir(1);
            shifter.exec_jmp(self.program_start);
        }
        shifter.set_enable(true);
    }

    /// Takes a word that is about to come.
    async fn pull(&mut self) -> u32 {
        let fifo = self.shifter.rx();
        match (0..LOOKS).find_map(|_| fifo.try_pull()) {
            Some(word) => word,
            None => fifo.wait_pull().await,
        }
    }

    /// Takes the status word. After that the data line is the chip's.
    async fn end(&mut self) -> u32 {
        let status = self.pull().await;
        self.select.set_high();
        status
    }
}

impl SpiBusCyw43 for Gspi<'_> {
    async fn cmd_write(&mut self, words: &[u32]) -> u32 {
        self.begin(words.len(), STATUS_WORDS);
        let fifo = self.shifter.tx();
        if words.len() <= SHORT_WORDS + 1 {
            words.iter().for_each(|word| fifo.push(*word));
        } else {
            fifo.dma_push(&mut self.dma, words, false).await;
        }
        self.end().await
    }

    async fn cmd_read(&mut self, command: u32, words: &mut [u32]) -> u32 {
        self.begin(1, words.len() + STATUS_WORDS);
        let (received, sent) = self.shifter.rx_tx();
        if words.len() <= SHORT_WORDS {
            sent.push(command);
            for word in words {
                *word = self.pull().await;
            }
        } else {
            let received = received.dma_pull(&mut self.dma, words, false);
            // The clock starts now.
            sent.push(command);
            received.await;
        }
        self.end().await
    }

    async fn wait_for_event(&mut self) {
        self.event.wait().await;
    }
}

/// The loops of the program count down to 0.
fn last_bit(words: usize) -> u32 {
    (words as u32 * u32::BITS).saturating_sub(1)
}

fn configuration<'d>(
    program: &LoadedProgram<'d, PIO0>,
    data: &Pin<'d, PIO0>,
    clock: &Pin<'d, PIO0>,
) -> Config<'d, PIO0> {
    let mut configuration = Config::default();
    configuration.use_program(program, &[clock]);
    configuration.set_out_pins(&[data]);
    configuration.set_in_pins(&[data]);
    configuration.set_set_pins(&[data]);
    // Highest bit first, in whole words.
    let shift = ShiftConfig {
        auto_fill: true,
        threshold: 32,
        direction: ShiftDirection::Left,
    };
    configuration.shift_out = shift;
    configuration.shift_in = shift;
    configuration.clock_divider = CLOCK_DIVIDER.into();
    configuration
}
