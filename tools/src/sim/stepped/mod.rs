//! The vehicle in stepped time: the firmware's tasks, with pins, wires and a flash that tests drive.

mod history;
mod pins;
mod port;

use std::cell::Cell;
use std::future::pending;
use std::pin::Pin;
use std::rc::Rc;

use embassy_futures::join::join;
use embassy_futures::select::{Either, select};
use embedded_hal_async::i2c::{ErrorKind, ErrorType, I2c, NoAcknowledgeSource, Operation};
use rover_battmon::autopilot::Start;
use rover_battmon::battery::{RetainedMemory, RetainedRecord};
use rover_battmon::mavlink::LinkId;
use rover_battmon::sensor::Buses;
use rover_battmon::tasks::{Link, Shared, reboot_requested, serve_link};
use rover_battmon::vehicle::{Indication, Restart, SideDrives};

use super::SimulatedFlash;
use super::clock::Stepped;
use super::links::UNWATCHED;
use super::tasks::{Hardware, boot};

pub use self::history::History;
pub use self::pins::{Converter, Pins, conversions};
pub use self::port::{BYTE_US, Port};

/// A byte by USB takes less than this, in µs.
const USB_BYTE_US: u64 = 1;

/// Random bytes for a password, the same in every run.
const ENTROPY: [u8; 32] = [7; 32];

/// A vehicle in stepped time.
pub struct SteppedVehicle {
    /// Its hardware.
    pub board: Rc<SteppedBoard>,
    run: Stepped<Pin<Box<dyn Future<Output = ()>>>>,
    epoch_us: u64,
    now_us: u64,
}

/// The board of a vehicle in stepped time.
pub struct SteppedBoard {
    /// The analog inputs.
    pub pins: Pins,
    /// The telemetry port.
    pub uart: Port,
    /// The port on USB.
    pub usb: Port,
    /// The second serial port.
    pub serial: Port,
    /// The flash chip.
    pub flash: SimulatedFlash,
    /// Outputs to the motors.
    pub drives: History<SideDrives>,
    /// Outputs to lamps and buzzer.
    pub indications: History<Indication>,
    /// Restarts since power-up.
    restarts: Cell<usize>,
}

impl SteppedVehicle {
    /// Switches on a vehicle with this flash, and nothing at its pins.
    pub fn power_up(flash: SimulatedFlash) -> Self {
        let board = Rc::new(SteppedBoard {
            pins: Pins::default(),
            uart: Port::new(BYTE_US),
            usb: Port::new(USB_BYTE_US),
            serial: Port::new(BYTE_US),
            flash,
            drives: History::default(),
            indications: History::default(),
            restarts: Cell::new(0),
        });
        Self {
            run: Stepped::new(board.clone().run()),
            board,
            epoch_us: 0,
            now_us: 0,
        }
    }

    /// Switches off and on again. A flash that had lost its power works again.
    pub fn power_cycle(&mut self) {
        self.epoch_us = self.now_us;
        self.board.flash.chip().power_up();
        self.board.restarts.set(0);
        for port in [&self.board.uart, &self.board.usb, &self.board.serial] {
            port.restart(self.epoch_us);
        }
        self.run = Stepped::new(self.board.clone().run());
    }

    /// Time since the first power-up, in µs.
    pub fn now_us(&self) -> u64 {
        self.now_us
    }

    /// Lets time pass.
    pub fn run_for(&mut self, duration_us: u64) {
        self.now_us += duration_us;
        self.run.run_until(self.now_us - self.epoch_us);
    }
}

impl SteppedBoard {
    /// Restarts by the software since power-up.
    pub fn restarts(&self) -> usize {
        self.restarts.get()
    }

    /// Runs the firmware, and restarts it when that is requested; in the boot loader nothing runs.
    fn run(self: Rc<Self>) -> Pin<Box<dyn Future<Output = ()>>> {
        Box::pin(async move {
            let mut memory = [RetainedRecord::BLANK; 2];
            while self.run_until_restart(&mut memory).await != Restart::BootLoader {
                self.restarts.set(self.restarts.get() + 1);
            }
            pending().await
        })
    }

    async fn run_until_restart(&self, memory: &mut RetainedMemory) -> Restart {
        let mut start = Start::default();
        let storages = boot(&self.flash, &mut start).await;
        let shared = Shared::new(&start);
        let uart = Link::of_board(LinkId::Uart0, &shared).with_logs(&self.flash);
        let usb = Link::of_board(LinkId::Usb, &shared).with_logs(&self.flash);
        let links = join(
            serve_link(&self.uart, &self.uart, &shared, &uart, &UNWATCHED),
            serve_link(&self.usb, &self.usb, &shared, &usb, &UNWATCHED),
        );
        let hardware = Hardware {
            pins: &self.pins,
            bus: Buses::i2c(NoDevices),
            line: &self.serial,
            wheels: &self.drives,
            lamps: &self.indications,
            entropy: Some(ENTROPY),
        };
        let vehicle = join(hardware.run(storages, self.flash.clone(), memory, &shared), links);
        match select(vehicle, reboot_requested(&shared, || uart.is_idle())).await {
            Either::First((never, _)) => never,
            Either::Second(restart) => restart,
        }
    }
}

/// A bus without devices.
struct NoDevices;

impl ErrorType for NoDevices {
    type Error = ErrorKind;
}

impl I2c for NoDevices {
    async fn transaction(&mut self, _: u8, _: &mut [Operation<'_>]) -> Result<(), ErrorKind> {
        Err(ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address))
    }
}
