//! The board's own USB port, a serial port to the host (CDC ACM).

use core::cell::Cell;

use embassy_futures::select::{Either, select};
use embassy_rp::Peri;
use embassy_rp::peripherals::USB;
use embassy_rp::usb::Driver;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_usb::class::cdc_acm::{CdcAcmClass, ControlChanged, Receiver, Sender, State};
use embassy_usb::{Builder, Config, Handler};
use embedded_io_async::{ErrorKind, ErrorType, Write};
use static_cell::{ConstStaticCell, StaticCell};

use super::Irqs;
use crate::tasks::{ByteSource, ReceiveError};

/// Raspberry Pi's vendor id, and the product id its Pico SDK gives to CDC serial ports: hosts have a driver for it.
const VENDOR_ID: u16 = 0x2E8A;
const PRODUCT_ID: u16 = 0x000A;

/// The largest a bulk packet can be at full speed.
const PACKET_BYTES: usize = 64;

/// What one CDC ACM function with its association takes is 70.
const CONFIGURATION_BYTES: usize = 80;

/// What the header and the one capability take.
const OBJECT_STORE_BYTES: usize = 12;

/// The longest string descriptor, the product's name in UTF-16, takes 44.
const CONTROL_BYTES: usize = 64;

type UsbDriver = Driver<'static, USB>;

/// Answers the host's requests, and has to be run for anything else to happen at the port.
pub type UsbDevice = embassy_usb::UsbDevice<'static, UsbDriver>;

/// Puts a serial port on the USB and pulls D+ up.
///
/// # Panics
/// When called twice: the buffers exist once.
// Inlined, it would add to the stack of everything `main` calls.
#[inline(never)]
pub fn usb_port(usb: Peri<'static, USB>) -> (UsbDevice, UsbPort) {
    static CONFIGURATION: ConstStaticCell<[u8; CONFIGURATION_BYTES]> =
        ConstStaticCell::new([0; CONFIGURATION_BYTES]);
    static OBJECT_STORE: ConstStaticCell<[u8; OBJECT_STORE_BYTES]> =
        ConstStaticCell::new([0; OBJECT_STORE_BYTES]);
    static CONTROL: ConstStaticCell<[u8; CONTROL_BYTES]> = ConstStaticCell::new([0; CONTROL_BYTES]);
    static SERIAL: StaticCell<State<'static>> = StaticCell::new();
    static BUS: StaticCell<Bus> = StaticCell::new();
    static BUS_HANDLER: StaticCell<BusHandler> = StaticCell::new();

    let mut config = Config::new(VENDOR_ID, PRODUCT_ID);
    config.manufacturer = Some("rover-battmon");
    config.product = Some("rover-battmon MAVLink");
    let mut builder = Builder::new(
        Driver::new(usb, Irqs),
        config,
        CONFIGURATION.take(),
        OBJECT_STORE.take(),
        &mut [],
        CONTROL.take(),
    );
    let bus: &'static Bus = BUS.init(Bus::default());
    builder.handler(BUS_HANDLER.init(BusHandler(bus)));
    let serial = CdcAcmClass::new(&mut builder, SERIAL.init(State::new()), PACKET_BYTES as u16);
    let (sender, receiver, control) = serial.split_with_control();
    let port = UsbPort {
        sender,
        receiver,
        line: Line { control, bus },
    };
    (builder.build(), port)
}

/// The serial port as the host's programs see it: one opens it, and closes it or is unplugged.
pub struct UsbPort {
    sender: Sender<'static, UsbDriver>,
    receiver: Receiver<'static, UsbDriver>,
    line: Line,
}

impl UsbPort {
    /// Waits until a program on the host has the port open.
    pub async fn opened(&self) {
        self.line.wait_until(true).await;
    }

    /// Waits until no program has the port open.
    pub async fn closed(&self) {
        self.line.wait_until(false).await;
    }

    /// Both directions of the wire to the program that has the port open.
    pub fn split(&mut self) -> (UsbTransmitter<'_>, UsbReceiver<'_>) {
        let receiver = UsbReceiver {
            receiver: &mut self.receiver,
            line: &self.line,
            packet: [0; PACKET_BYTES],
            taken: 0,
            received: 0,
        };
        (UsbTransmitter(&mut self.sender), receiver)
    }
}

/// Whether a program has the port open.
struct Line {
    control: ControlChanged<'static>,
    bus: &'static Bus,
}

impl Line {
    /// A program that opens the port raises DTR. One that is unplugged can't lower it, but then the bus falls silent.
    fn is_open(&self) -> bool {
        self.control.dtr() && self.bus.configured.get() && !self.bus.suspended.get()
    }

    async fn changed(&self) {
        select(self.control.control_changed(), self.bus.changed.wait()).await;
    }

    async fn wait_until(&self, open: bool) {
        while self.is_open() != open {
            self.changed().await;
        }
    }
}

/// What the host has done with the device. All tasks run on one executor, so plain cells hold it.
#[derive(Default)]
struct Bus {
    configured: Cell<bool>,
    suspended: Cell<bool>,
    changed: Signal<NoopRawMutex, ()>,
}

struct BusHandler(&'static Bus);

impl Handler for BusHandler {
    fn reset(&mut self) {
        self.0.suspended.set(false);
        self.configured(false);
    }

    fn configured(&mut self, configured: bool) {
        self.0.configured.set(configured);
        self.0.changed.signal(());
    }

    fn suspended(&mut self, suspended: bool) {
        self.0.suspended.set(suspended);
        self.0.changed.signal(());
    }
}

/// The wire to the host.
pub struct UsbTransmitter<'a>(&'a mut Sender<'static, UsbDriver>);

impl ErrorType for UsbTransmitter<'_> {
    type Error = ErrorKind;
}

impl Write for UsbTransmitter<'_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        let packet = bytes.get(..PACKET_BYTES).unwrap_or(bytes);
        self.send(packet).await?;
        // A full packet leaves the host waiting for the rest, so an empty one ends a frame whose last packet is full.
        if packet.len() == PACKET_BYTES && bytes.len() == PACKET_BYTES {
            self.send(&[]).await?;
        }
        Ok(packet.len())
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        Ok(())
    }
}

impl UsbTransmitter<'_> {
    /// Waits until the host has taken the packet before, and hands over this one.
    async fn send(&mut self, packet: &[u8]) -> Result<(), ErrorKind> {
        self.0
            .write_packet(packet)
            .await
            .map_err(|_| ErrorKind::NotConnected)
    }
}

/// The wire from the host.
pub struct UsbReceiver<'a> {
    receiver: &'a mut Receiver<'static, UsbDriver>,
    line: &'a Line,
    /// A packet has to be fetched whole, whatever room there is in the caller's buffer.
    packet: [u8; PACKET_BYTES],
    taken: usize,
    received: usize,
}

impl ByteSource for UsbReceiver<'_> {
    /// # Errors
    /// The port was closed or unplugged. Bytes can't be lost: the host keeps them until they are fetched.
    async fn receive(&mut self, buffer: &mut [u8]) -> Result<usize, ReceiveError> {
        while self.taken >= self.received {
            self.fetch().await?;
        }
        let waiting = self.packet.get(self.taken..self.received).unwrap_or(&[]);
        let length = waiting.len().min(buffer.len());
        for (to, from) in buffer.iter_mut().zip(waiting) {
            *to = *from;
        }
        self.taken += length;
        Ok(length)
    }
}

impl UsbReceiver<'_> {
    /// Waits for the next packet, which may be empty. A closed port is noticed here, because the driver's read would
    /// just go on waiting.
    async fn fetch(&mut self) -> Result<(), ReceiveError> {
        while self.line.is_open() {
            let read = self.receiver.read_packet(&mut self.packet);
            if let Either::Second(result) = select(self.line.changed(), read).await {
                self.received = result.map_err(|_| ReceiveError::Closed)?;
                self.taken = 0;
                return Ok(());
            }
        }
        Err(ReceiveError::Closed)
    }
}
