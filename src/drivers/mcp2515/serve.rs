//! The loop that serves the controller.

use core::convert::Infallible;
use core::mem;

use embassy_futures::select::{Either4, select4};
use embassy_sync::blocking_mutex::raw::RawMutex;
use embassy_time::{Duration, Instant, Timer};
use embedded_hal::digital::InputPin;
use embedded_hal::spi::SpiDevice;
use embedded_hal_async::digital::Wait;

use super::chip::{Chip, NoAnswer, ReceiveBuffer, Received, Registers};
use super::exchange::CanExchange;
use crate::sensor::{Acceptance, BitTiming, CanFrame, CanInterrupt, CanState};

/// The oscillator starts within 128 periods of 8 MHz: 16 µs (DS20001801, 8.1).
const START_UP: Duration = Duration::from_millis(1);

/// A controller that does not answer is tried again.
const RETRY_INTERVAL: Duration = Duration::from_secs(1);

/// The controller is looked at without being asked to.
const LOOK_INTERVAL: Duration = Duration::from_millis(100);

/// It joins a bus after eleven recessive bits, as there are behind every frame: 1.3 ms at the longest, at 125 kbit/s.
const LONGEST_JOINING: Duration = LOOK_INTERVAL;

/// Interval of reads without interrupts: a transfer of several frames at 1 Mbit/s fills both buffers in 260 µs, of which
/// reading them takes a part.
const POLL_INTERVAL: Duration = Duration::from_micros(100);

/// A frame that could not be sent for this long is discarded: its content is out of date.
const LONGEST_SENDING: Duration = Duration::from_secs(1);

/// Rounds of reading in one go. With a controller that always has something nothing else would run.
const MOST_ROUNDS: usize = 16;

/// Serves the controller behind `spi`, whose interrupt line is at `interrupt`, and hands what it receives to `exchange`, which
/// has to have been given what is accepted before anything is done. Nothing else may use the device.
pub async fn serve<S, P, M>(spi: S, interrupt: P, timing: BitTiming, exchange: &CanExchange<M>) -> !
where
    S: SpiDevice,
    P: Wait + InputPin<Error = Infallible>,
    M: RawMutex,
{
    let mut accepted = exchange.new_acceptance().await;
    let mut server = Server {
        chip: Chip::new(spi, timing),
        interrupt,
        exchange,
        transmission: Transmission::Free,
        look_at: Instant::MIN,
        joining_since: None,
        has_lost_setup: false,
    };
    loop {
        let ended = server.run(&accepted).await;
        server.has_lost_setup = matches!(ended, Ended::LostSetup);
        match ended {
            Ended::Accepts(changed) => accepted = changed,
            Ended::NoAnswer => {
                server.exchange.update(|status| status.state = CanState::NoAnswer);
                server.wait_for_retry().await;
            }
            Ended::LostSetup => {}
        }
    }
}

/// Why the controller has to be set up again.
enum Ended {
    Accepts(Acceptance),
    NoAnswer,
    LostSetup,
}

impl From<NoAnswer> for Ended {
    fn from(_: NoAnswer) -> Self {
        Self::NoAnswer
    }
}

/// State of the transmit buffer.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Transmission {
    /// It is empty.
    Free,
    /// It has a frame since then.
    Waiting(Instant),
    /// The frame was discarded; it may still be sent.
    GivenUp,
}

/// Result of a look at the controller.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Found {
    Something,
    Nothing,
    /// More than one go may take.
    TooMuch,
}

struct Server<'a, S: SpiDevice, P, M: RawMutex> {
    chip: Chip<S>,
    interrupt: P,
    exchange: &'a CanExchange<M>,
    transmission: Transmission,
    /// When the controller is looked at next.
    look_at: Instant,
    /// Since when the controller waits to join the bus.
    joining_since: Option<Instant>,
    /// Whether it has to be set up again because it had lost its set-up.
    has_lost_setup: bool,
}

impl<S, P, M> Server<'_, S, P, M>
where
    S: SpiDevice,
    P: Wait + InputPin<Error = Infallible>,
    M: RawMutex,
{
    /// Sets the controller up and serves it until it has to be set up again.
    async fn run(&mut self, accepted: &Acceptance) -> Ended {
        if self.set_up(accepted).await.is_err() {
            return Ended::NoAnswer;
        }
        // Only now: without its supply the set-up would be lost.
        if mem::take(&mut self.has_lost_setup) {
            self.exchange
                .update(|status| status.lost_setups = status.lost_setups.wrapping_add(1));
        }
        loop {
            if let Err(ended) = self.turn().await {
                return ended;
            }
        }
    }

    async fn set_up(&mut self, accepted: &Acceptance) -> Result<(), NoAnswer> {
        if let Transmission::Waiting(_) = self.transmission {
            self.exchange.count_unsent();
        }
        self.transmission = Transmission::Free;
        self.look_at = Instant::MIN;
        self.joining_since = None;
        self.chip.reset()?;
        Timer::after(START_UP).await;
        self.chip.set_up(accepted)
    }

    /// It shows that it is alive: without an answer nothing else is wrong.
    async fn wait_for_retry(&mut self) {
        let retry_at = Instant::now().saturating_add(RETRY_INTERVAL);
        while Instant::now() < retry_at {
            self.exchange
                .update(|status| status.looks = status.looks.wrapping_add(1));
            Timer::after(LOOK_INTERVAL).await;
        }
    }

    /// Waits until there is something to do, and does it.
    async fn turn(&mut self) -> Result<(), Ended> {
        let poll_at = self.next_poll();
        let exchange = self.exchange;
        let transmission = self.transmission;
        let to_send = async {
            if transmission != Transmission::Free {
                core::future::pending::<()>().await;
            }
            exchange.next_to_send().await
        };
        let wait = select4(
            self.interrupt.wait_for_low(),
            to_send,
            exchange.new_acceptance(),
            Timer::at(poll_at),
        );
        match wait.await {
            Either4::First(_) => self.interrupted().await,
            Either4::Second(frame) => Ok(self.send(&frame)?),
            Either4::Third(accepted) => Err(Ended::Accepts(accepted)),
            Either4::Fourth(()) => {
                if Instant::now() >= self.look_at {
                    self.look()?;
                }
                self.drain().map(drop)
            }
        }
    }

    fn next_poll(&self) -> Instant {
        match self.exchange.interrupt() {
            CanInterrupt::Working => self.look_at,
            CanInterrupt::Dead => self.look_at.min(Instant::now().saturating_add(POLL_INTERVAL)),
        }
    }

    fn send(&mut self, frame: &CanFrame) -> Result<(), NoAnswer> {
        self.transmission = Transmission::Waiting(Instant::now());
        self.chip.send(frame)
    }

    /// Does what the interrupt line asks for. One that is low for nothing, or always, must not keep everything else from running.
    async fn interrupted(&mut self) -> Result<(), Ended> {
        let found = self.drain()?;
        if found == Found::Something {
            return Ok(());
        }
        let registers = self.look()?;
        if found == Found::TooMuch {
            Timer::after(POLL_INTERVAL).await;
        } else if self.is_low() && self.drain()? == Found::Nothing {
            if !registers.is_interrupting() {
                self.set_interrupt(CanInterrupt::Dead);
            }
            Timer::after(POLL_INTERVAL).await;
        }
        Ok(())
    }

    /// Reads both receive buffers until they are empty, and notices what was sent.
    fn drain(&mut self) -> Result<Found, Ended> {
        let mut found = Found::Nothing;
        for _ in 0..MOST_ROUNDS {
            let buffers = self.chip.status()?;
            if !buffers.is_sending() {
                self.transmission = Transmission::Free;
            }
            let mut in_round = Found::Nothing;
            for buffer in [ReceiveBuffer::First, ReceiveBuffer::Second] {
                if buffers.is_full(buffer) {
                    in_round = Found::Something;
                    self.receive(buffer)?;
                }
            }
            if buffers.has_sent() {
                in_round = Found::Something;
                self.chip.clear_sent()?;
            }
            if in_round == Found::Nothing {
                return Ok(found);
            }
            found = in_round;
        }
        Ok(Found::TooMuch)
    }

    fn receive(&mut self, buffer: ReceiveBuffer) -> Result<(), NoAnswer> {
        if let Received::Frame(frame) = self.chip.receive(buffer)? {
            self.exchange.received(frame);
        }
        Ok(())
    }

    /// Looks at the controller.
    fn look(&mut self) -> Result<Registers, Ended> {
        self.look_at = Instant::now().saturating_add(LOOK_INTERVAL);
        let registers = self.chip.look()?;
        if !self.chip.is_set_up(&registers) {
            return Err(Ended::LostSetup);
        }
        // After the registers: the line follows them at once.
        if registers.is_interrupting() && !self.is_low() {
            self.set_interrupt(CanInterrupt::Dead);
        }
        self.note(&registers);
        if registers.has_error_interrupt() {
            self.chip.clear_errors()?;
        }
        self.give_up_sending()?;
        Ok(registers)
    }

    /// Gives up a frame that can't be sent.
    fn give_up_sending(&mut self) -> Result<(), NoAnswer> {
        if let Transmission::Waiting(since) = self.transmission
            && Instant::now().saturating_duration_since(since) >= LONGEST_SENDING
        {
            self.transmission = Transmission::GivenUp;
            self.exchange.count_unsent();
            self.chip.give_up_sending()?;
        }
        Ok(())
    }

    fn note(&mut self, registers: &Registers) {
        let new_state = self.state_of(registers);
        self.exchange.update(|status| {
            let state = new_state.unwrap_or(status.state);
            if state == CanState::BusOff && status.state != CanState::BusOff {
                status.bus_offs = status.bus_offs.wrapping_add(1);
            }
            status.state = state;
            status.looks = status.looks.wrapping_add(1);
            status.lost_frames = status.lost_frames.wrapping_add(registers.overflows());
        });
    }

    /// `None` while the controller joins the bus.
    fn state_of(&mut self, registers: &Registers) -> Option<CanState> {
        let now = Instant::now();
        let is_joining = registers.is_joining();
        let since = is_joining.then(|| self.joining_since.unwrap_or(now));
        self.joining_since = since;
        let is_late = since.is_some_and(|since| now.saturating_duration_since(since) >= LONGEST_JOINING);
        match registers {
            _ if registers.is_bus_off() || is_late => Some(CanState::BusOff),
            _ if is_joining => None,
            _ if registers.is_passive() => Some(CanState::Passive),
            _ => Some(CanState::Active),
        }
    }

    fn set_interrupt(&self, interrupt: CanInterrupt) {
        self.exchange.update(|status| status.interrupt = interrupt);
    }

    fn is_low(&mut self) -> bool {
        let Ok(is_low) = self.interrupt.is_low();
        is_low
    }
}
