//! The radio: switched on, set up, watched, and restarted when it fails.

use core::future::pending;
use core::pin::pin;

use cyw43::{A4, Aligned, Control, JoinError, JoinOptions, NetDriver, PowerManagementMode};
use embassy_futures::select::{Either, Either3, select, select3};
use embassy_rp::clocks::RoscRng;
use embassy_rp::gpio::{Level, Output};
use embassy_rp::peripherals::{DMA_CH1, PIN_23, PIN_24, PIN_25, PIN_29, PIO0};
use embassy_rp::pio::Pio;
use embassy_rp::{Peri, dma};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer, with_timeout};

use super::bus::{BusFault, CheckedBus, ChipState, Refusals, Stage};
use super::find::{BoardKind, note_that_no_radio_answers};
use super::gspi::Gspi;
use crate::board::Irqs;
use crate::memory::in_place::in_place;
use crate::net::{self, NetMemory, NetReport, Role, Service};
use crate::tasks::{self, Shared};
use crate::time::Instant;
use crate::wifi::{Network, PowerSave, RadioAction, RadioEvent, RadioState, WifiMode, WifiReport, WifiSetup};

/// Switching on, the chip's program and its start take 0.6 s.
const START_TIMEOUT: Duration = Duration::from_secs(3);

/// Setting up waits for 0.7 s in all, an access point for another 0.1 s.
const SET_UP_TIMEOUT: Duration = Duration::from_secs(3);

/// Starts without any answer after which a board that may not be a Pico W is none.
const VAIN_STARTS: u8 = 3;

/// Interval of requests for a sign of life, and their time-out. A request waits behind packets.
const WATCH_INTERVAL: Duration = Duration::from_secs(5);
const ANSWER_TIMEOUT: Duration = Duration::from_secs(2);

/// Time for which a radio that has failed stays switched off.
const RETRY_DELAY: Duration = Duration::from_secs(10);

/// Between two attempts to join a network. A failed one takes a few seconds itself.
const JOIN_DELAY: Duration = Duration::from_secs(2);

/// Of the chip's own GPIOs: high, the regulator of a Pico W switches at a fixed frequency (Pico W datasheet, "Power chain").
/// Its ripple is on the converter's reference.
const REGULATOR_GPIO: u8 = 1;

/// Another of them: it senses the USB port's supply, and its pull-up keeps the port's supply pin at 1.4 V while the pack feeds the
/// board. A USB-C host then does not switch its supply on, as it takes the cable for fed; low, it does.
const USB_SUPPLY_GPIO: u8 = 2;

/// Time for which the board has its own network, before it looks for the other one again if no ground station is connected.
const FALLBACK_TIME: Duration = Duration::from_secs(300);

/// The task shows as often that it is alive.
const MARK_INTERVAL: Duration = Duration::from_millis(500);

/// The pins and blocks that the radio takes.
pub struct WifiPeripherals {
    /// Switches the chip on.
    pub power: Peri<'static, PIN_23>,
    /// Data in both directions, and the chip's wish to be read.
    pub data: Peri<'static, PIN_24>,
    /// Selects the chip.
    pub select: Peri<'static, PIN_25>,
    /// Clock of the bus.
    pub clock: Peri<'static, PIN_29>,
    /// Makes the bus's signals.
    pub pio: Peri<'static, PIO0>,
    /// Feeds it.
    pub dma: Peri<'static, DMA_CH1>,
}

/// The radio, and what serves links over it.
pub struct Wifi {
    board: BoardKind,
    /// Starts of a radio that may not be there.
    vain_starts: u8,
    peripherals: WifiPeripherals,
    driver: &'static mut cyw43::State,
    network: &'static mut NetMemory,
}

/// The latest of what the network stack has reported of the board's address.
type Address = Signal<NoopRawMutex, NetReport>;

impl Wifi {
    /// The radio at these pins. What driver and network stack keep stays where it is.
    pub fn new(
        board: BoardKind,
        peripherals: WifiPeripherals,
        driver: &'static mut cyw43::State,
        network: &'static mut NetMemory,
    ) -> Self {
        Self {
            board,
            vain_starts: 0,
            peripherals,
            driver,
            network,
        }
    }

    /// Keeps the radio as the owner wants it, and serves ground stations over it.
    pub async fn run(&mut self, service: &Service<'_>) -> ! {
        let alive = async {
            loop {
                tasks::mark(service.check_in);
                Timer::after(MARK_INTERVAL).await;
            }
        };
        let work = pin!(self.keep_up(service));
        match select(work, alive).await {
            Either::First(never) | Either::Second(never) => never,
        }
    }

    async fn keep_up(&mut self, service: &Service<'_>) -> ! {
        let shared = service.shared;
        let mut state = RadioState::AsSetUp;
        loop {
            let setup = self.wanted(shared).await;
            if let Err(fault) = self.run_once(&setup, &mut state, service).await {
                let report = self.judge_absence().unwrap_or(fault);
                shared.with(|autopilot| autopilot.wifi_report(report, tasks::now()));
                let _off = self.held_off();
                select(Timer::after(RETRY_DELAY), changed(shared, &setup)).await;
            }
        }
    }

    /// Waits until the radio has to be on.
    async fn wanted(&mut self, shared: &Shared) -> WifiSetup {
        let _off = self.held_off();
        loop {
            let setup = shared.with(|autopilot| autopilot.wifi_setup());
            if let Some(setup) = setup
                && setup.mode != WifiMode::Off
            {
                return setup;
            }
            shared.to_set_up_wifi.wait().await;
        }
    }

    /// The pin that keeps a radio off, which would float and leave that to the chip's own pull-down. On a board that may have
    /// something else there it stays free.
    fn held_off(&mut self) -> Option<Output<'_>> {
        let power = &mut self.peripherals.power;
        (self.board == BoardKind::PicoW).then(|| Output::new(power.reborrow(), Level::Low))
    }

    /// Switches the radio on and serves until it has to be restarted. It is off afterwards.
    ///
    /// # Errors
    /// The radio has failed.
    async fn run_once(
        &mut self,
        setup: &WifiSetup,
        state: &mut RadioState,
        service: &Service<'_>,
    ) -> Result<(), WifiReport> {
        forget(self.driver);
        let chip = ChipState::new(role(setup, *state));
        let parts = &mut self.peripherals;
        let power = Output::new(parts.power.reborrow(), Level::Low);
        let select_pin = Output::new(parts.select.reborrow(), Level::High);
        let Pio {
            mut common,
            sm0,
            irq0,
            ..
        } = Pio::new(parts.pio.reborrow(), Irqs);
        let wires = Gspi::new(
            &mut common,
            sm0,
            irq0,
            select_pin,
            parts.data.reborrow(),
            parts.clock.reborrow(),
            dma::Channel::new(parts.dma.reborrow(), Irqs),
        );
        let bus = CheckedBus::new(wires, &chip);
        let run = async {
            let start = cyw43::new(self.driver, power, bus, &PROGRAM, &BOARD_DATA);
            let Ok((device, control, driver)) = with_timeout(START_TIMEOUT, start).await else {
                return Err(start_failure(&chip));
            };
            let mut operation = Operation {
                control,
                chip: &chip,
                setup,
                state: &mut *state,
                service,
            };
            // Pinned where it is built: moved, it may be built on the stack, which has no room for it.
            let operating = pin!(operation.run(device, self.network));
            match select(driver.run(), operating).await {
                Either::First(never) => never,
                Either::Second(result) => result,
            }
        };
        let result = match select3(chip.fault.wait(), changed(service.shared, setup), run).await {
            Either3::First(fault) => {
                defmt::warn!("Wi-Fi: {}", fault);
                Err(match fault {
                    BusFault::NotReady => WifiReport::DownloadFailed,
                    BusFault::Silent | BusFault::Refused(_) => WifiReport::NoAnswer,
                })
            }
            Either3::Second(()) => {
                state.next(RadioEvent::SetUpAgain, tasks::now());
                Ok(())
            }
            Either3::Third(result) => result,
        };
        if chip.stage.get() != Stage::Waking {
            self.board = BoardKind::PicoW;
        }
        result
    }

    /// Whether a radio that has failed to start is there at all. If not, nothing switches it on again, and its pins are free.
    fn judge_absence(&mut self) -> Option<WifiReport> {
        self.vain_starts = self.vain_starts.saturating_add(1);
        if self.board != BoardKind::PossiblyPicoW || self.vain_starts < VAIN_STARTS {
            return None;
        }
        note_that_no_radio_answers();
        Some(WifiReport::NoRadio)
    }
}

/// The driver's state may hold pointers into what was dropped.
// Not inlined: everything built on the stack must be gone before the radio runs.
#[inline(never)]
fn forget(driver: &mut cyw43::State) {
    *driver = in_place(cyw43::State::new);
}

/// A chip that answers until its program should run has not got it whole.
fn start_failure(chip: &ChipState) -> WifiReport {
    match chip.stage.get() {
        Stage::Starting => WifiReport::DownloadFailed,
        Stage::Waking | Stage::Running => WifiReport::NoAnswer,
    }
}

/// Waits until the board should look for its network again: not while it is driven, or a ground station is served.
async fn until_over(state: RadioState, shared: &Shared) {
    if state != RadioState::Fallback {
        pending::<()>().await;
    }
    Timer::after(FALLBACK_TIME).await;
    while shared.with(|autopilot| autopilot.is_wifi_in_use(tasks::now())) {
        Timer::after(WATCH_INTERVAL).await;
    }
}

/// Waits until something else is wanted than `setup`.
async fn changed(shared: &Shared, setup: &WifiSetup) {
    while shared.with(|autopilot| autopilot.wifi_setup()).as_ref() == Some(setup) {
        shared.to_set_up_wifi.wait().await;
    }
    // The answer to the sender, perhaps over this radio, leaves first.
    Timer::after_secs(1).await;
}

/// Role of the board in its network.
fn role(setup: &WifiSetup, state: RadioState) -> Role {
    match (setup.mode, &setup.network, state) {
        (WifiMode::Station, Some(_), RadioState::AsSetUp | RadioState::Joining { .. }) => Role::Station,
        _ => Role::AccessPoint,
    }
}

/// The radio whose driver runs.
struct Operation<'a> {
    control: Control<'a>,
    chip: &'a ChipState,
    setup: &'a WifiSetup,
    state: &'a mut RadioState,
    service: &'a Service<'a>,
}

impl Operation<'_> {
    /// Serves until the radio has to be restarted.
    async fn run(&mut self, device: NetDriver<'_>, network: &mut NetMemory) -> Result<(), WifiReport> {
        if with_timeout(SET_UP_TIMEOUT, self.set_up()).await.is_err() {
            return Err(WifiReport::NoAnswer);
        }
        let (service, role) = (self.service, self.chip.role);
        let address = Address::new();
        let report = |report| {
            address.signal(report);
            if let (Role::Station, NetReport::AddressObtained(address)) = (role, report) {
                let report = WifiReport::AddressObtained(address);
                service
                    .shared
                    .with(|autopilot| autopilot.wifi_report(report, tasks::now()));
            }
        };
        let serving = pin!(net::serve(
            device,
            role,
            RoscRng.next_u64(),
            network,
            service,
            report
        ));
        match select(serving, self.watch(&address)).await {
            Either::First(never) => never,
            Either::Second(result) => result,
        }
    }

    async fn set_up(&mut self) {
        self.control.init(COUNTRIES).await;
        self.control.gpio_set(REGULATOR_GPIO, true).await;
        self.control.gpio_set(USB_SUPPLY_GPIO, false).await;
        let power = match self.setup.power_save {
            PowerSave::On => PowerManagementMode::PowerSave,
            PowerSave::Off => PowerManagementMode::None,
        };
        self.control.set_power_management(power).await;
        if self.chip.role == Role::AccessPoint {
            let setup = self.setup;
            let (name, password) = (setup.own_name.as_str(), setup.own_password.as_str());
            // The log's reader has the board in hand.
            defmt::info!("Wi-Fi: access point {=str}, password {=str}", name, password);
            self.control.start_ap_wpa2(name, password, setup.channel).await;
            self.report(match self.state {
                RadioState::Fallback => WifiReport::FallbackToAccessPoint,
                RadioState::AsSetUp | RadioState::Joining { .. } => WifiReport::AccessPointUp,
            });
        }
    }

    fn report(&self, report: WifiReport) {
        self.service
            .shared
            .with(|autopilot| autopilot.wifi_report(report, tasks::now()));
    }

    async fn watch(&mut self, address: &Address) -> Result<(), WifiReport> {
        match (self.chip.role, &self.setup.network) {
            (Role::Station, Some(network)) => self.stay_joined(network, address).await,
            (Role::Station | Role::AccessPoint, _) => {
                let over = until_over(*self.state, self.service.shared);
                match select(self.look_for_life(), over).await {
                    Either::First(fault) => Err(fault),
                    Either::Second(()) => {
                        self.state.next(RadioEvent::SetUpAgain, tasks::now());
                        Ok(())
                    }
                }
            }
        }
    }

    /// Ends when the chip does not answer any more.
    async fn look_for_life(&mut self) -> WifiReport {
        loop {
            Timer::after(WATCH_INTERVAL).await;
            if with_timeout(ANSWER_TIMEOUT, self.control.address())
                .await
                .is_err()
            {
                return WifiReport::NoAnswer;
            }
        }
    }

    /// Joins the network whenever the board is not in it. Ends when it has had no address for too long.
    ///
    /// # Errors
    /// The chip does not answer any more.
    async fn stay_joined(&mut self, network: &Network, address: &Address) -> Result<(), WifiReport> {
        let mut event = RadioEvent::NotInNetwork;
        loop {
            event = match self.state.next(event, tasks::now()) {
                RadioAction::Join { by } => {
                    address.reset();
                    self.join(network, by).await
                }
                RadioAction::Stay { leave_at } => self.stay(address, leave_at).await?,
                RadioAction::Leave => self.leave().await?,
                RadioAction::Restart => return Ok(()),
            };
        }
    }

    /// Tries to join the network, until `by` at the latest. If that fails the chip may still be in it.
    async fn join(&mut self, network: &Network, by: Instant) -> RadioEvent {
        let options = match &network.password {
            Some(password) => JoinOptions::new(password.as_str().as_bytes()),
            None => JoinOptions::new_open(),
        };
        let chip = self.chip;
        chip.refusals.set(Refusals::AreReported);
        chip.refused.reset();
        let joining = self.control.join(network.ssid.as_str(), options);
        let (event, report) = match select3(joining, chip.refused.wait(), tasks::timer_at(by)).await {
            Either3::First(Ok(())) => {
                chip.refusals.set(Refusals::AreFaults);
                (RadioEvent::Joined, WifiReport::Joined)
            }
            Either3::First(Err(JoinError::AuthenticationFailure)) => {
                (RadioEvent::JoinFailed, WifiReport::WrongPassword)
            }
            Either3::First(Err(JoinError::NetworkNotFound)) => {
                (RadioEvent::JoinFailed, WifiReport::NetworkNotFound)
            }
            Either3::First(Err(JoinError::JoinFailure(_))) | Either3::Second(()) | Either3::Third(()) => {
                (RadioEvent::JoinFailed, WifiReport::JoinFailed)
            }
        };
        self.report(report);
        event
    }

    /// Leaves the network, which a chip that is in none may refuse, and waits for [`JOIN_DELAY`].
    ///
    /// # Errors
    /// The chip does not answer any more.
    async fn leave(&mut self) -> Result<RadioEvent, WifiReport> {
        self.chip.refusals.set(Refusals::AreReported);
        let left = with_timeout(ANSWER_TIMEOUT, self.control.leave()).await;
        self.chip.refusals.set(Refusals::AreFaults);
        left.map_err(|_| WifiReport::NoAnswer)?;
        Timer::after(JOIN_DELAY).await;
        Ok(RadioEvent::NotInNetwork)
    }

    /// Stays in the network until the board has an address there or loses it, until `leave_at` at the latest.
    ///
    /// # Errors
    /// The chip does not answer any more.
    async fn stay(&mut self, address: &Address, leave_at: Instant) -> Result<RadioEvent, WifiReport> {
        loop {
            let report = match select3(address.wait(), tasks::timer_at(leave_at), self.look_for_life()).await
            {
                Either3::First(NetReport::AddressObtained(_)) => return Ok(RadioEvent::AddressObtained),
                // It may be of the attempt before.
                Either3::First(NetReport::NoAddress) => continue,
                Either3::First(NetReport::AddressLost) => WifiReport::NetworkLost,
                Either3::Second(()) => WifiReport::NoAddress,
                Either3::Third(fault) => return Err(fault),
            };
            self.report(report);
            return Ok(RadioEvent::NoAddress);
        }
    }
}

/// The program of the CYW43439, as the driver uploads it at each start.
pub(super) static PROGRAM: Aligned<A4, [u8; 231_077]> = Aligned(*cyw43_firmware::CYW43_43439A0);

/// Country locale matrix: which channels and powers are allowed where.
pub(super) static COUNTRIES: &[u8] = cyw43_firmware::CYW43_43439A0_CLM;

/// Board data of the module on a Pico W, as lines `name=value` (the values that the driver's release
/// 0.6.0 carried in its source, `nvram.rs`).
const BOARD_DATA_LINES: &[u8] = include_bytes!("nvram.txt");

/// A zero after each line and one at the end, filled up to whole words.
const BOARD_DATA_BYTES: usize = (BOARD_DATA_LINES.len() + 1).next_multiple_of(4);

/// The board data as the chip reads it.
pub(super) static BOARD_DATA: Aligned<A4, [u8; BOARD_DATA_BYTES]> = Aligned(ended_by_zeros(BOARD_DATA_LINES));

const fn ended_by_zeros(lines: &[u8]) -> [u8; BOARD_DATA_BYTES] {
    let mut data = [0; BOARD_DATA_BYTES];
    let mut at = 0;
    while at < lines.len() {
        if lines[at] != b'\n' {
            data[at] = lines[at];
        }
        at += 1;
    }
    data
}
