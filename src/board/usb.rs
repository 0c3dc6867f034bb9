//! The board's own USB port, a serial port to the host (CDC ACM).

use core::cell::Cell;
use core::ops::Range;

use embassy_futures::select::{Either, Either3, select, select3};
use embassy_rp::interrupt::{self, InterruptExt};
use embassy_rp::peripherals::USB;
use embassy_rp::usb::Driver;
use embassy_rp::{Peri, pac};
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embassy_sync::signal::Signal;
use embassy_time::{Duration, Timer};
use embassy_usb::class::cdc_acm::{CdcAcmClass, ControlChanged, Receiver, Sender, State};
use embassy_usb::{Builder, Config, Handler, UsbDevice};
use embedded_io_async::{ErrorKind, ErrorType, Write};
use heapless::Vec;

use super::Irqs;
use crate::drivers::{ControlPipe, OBSERVATION_INTERVAL_MS, UsbFault, UsbObservation, UsbWatch};
use crate::memory::identity::BoardId;
use crate::tasks::{ByteSource, ReceiveError};

/// Raspberry Pi's vendor id, and the product id its Pico SDK gives to CDC serial ports: hosts have a driver for it.
const VENDOR_ID: u16 = 0x2E8A;
const PRODUCT_ID: u16 = 0x000A;

/// The largest a bulk packet can be at full speed.
const PACKET_BYTES: usize = 64;

/// Bytes that are sent together: some frames of a download.
const TOGETHER_BYTES: usize = 8 * PACKET_BYTES;

/// One CDC ACM function with its association takes 70.
const CONFIGURATION_BYTES: usize = 80;

/// Size of the header and the one capability.
const OBJECT_STORE_BYTES: usize = 12;

/// The longest string descriptor, the product's name in UTF-16, takes 44.
const CONTROL_BYTES: usize = 64;

const OBSERVATION_INTERVAL: Duration = Duration::from_millis(OBSERVATION_INTERVAL_MS);

/// Time for which the pull-up of D+ is off, so that every host and hub sees the device leave.
const DETACHED: Duration = Duration::from_millis(100);

type UsbDriver<'d> = Driver<'d, USB>;

/// The serial port at the host.
pub struct UsbPort {
    peripheral: Peri<'static, USB>,
    id: Option<BoardId>,
    /// Number of times the device was stuck and was rebuilt.
    rebuilds: u32,
}

impl UsbPort {
    /// The port of the board with this id, by which hosts distinguish boards.
    pub fn new(peripheral: Peri<'static, USB>, id: Option<BoardId>) -> Self {
        Self {
            peripheral,
            id,
            rebuilds: 0,
        }
    }

    /// Puts the serial port on the USB and has `serve` serve one program on the host after the other. A device that is
    /// stuck is rebuilt, which the host sees as one that was unplugged and plugged in again.
    pub async fn run(&mut self, serve: impl AsyncFn(UsbTransmitter<'_, '_>, UsbReceiver<'_, '_>)) -> ! {
        loop {
            let fault = self.run_until_stuck(&serve).await;
            self.rebuilds = self.rebuilds.saturating_add(1);
            defmt::warn!("USB: stuck ({}), rebuilt ({} times)", fault, self.rebuilds);
            detach().await;
        }
    }

    /// The device is looked after first whenever this is polled, so that the watch sees what it has left undone.
    async fn run_until_stuck(
        &mut self,
        serve: &impl AsyncFn(UsbTransmitter<'_, '_>, UsbReceiver<'_, '_>),
    ) -> UsbFault {
        let serial_number = self.id.map(BoardId::serial_number);
        let bus = Bus::default();
        let mut handler = &bus;
        let mut memory = Memory::default();
        let (mut device, class) = build(
            self.peripheral.reborrow(),
            serial_number.as_deref(),
            &mut memory,
            &mut handler,
        );
        let (sender, receiver, control) = class.split_with_control();
        let line = Line { control, bus: &bus };

        match select3(
            device.run(),
            serve_programs(sender, receiver, &line, serve),
            watch(&bus),
        )
        .await
        {
            Either3::First(never) | Either3::Second(never) => never,
            Either3::Third(fault) => fault,
        }
    }
}

/// Buffers of the device.
struct Memory<'d> {
    configuration: [u8; CONFIGURATION_BYTES],
    object_store: [u8; OBJECT_STORE_BYTES],
    control: [u8; CONTROL_BYTES],
    serial: State<'d>,
}

impl Default for Memory<'_> {
    fn default() -> Self {
        Self {
            configuration: [0; CONFIGURATION_BYTES],
            object_store: [0; OBJECT_STORE_BYTES],
            control: [0; CONTROL_BYTES],
            serial: State::new(),
        }
    }
}

/// Puts a serial port on the USB and pulls D+ up.
// Inlined, it would add to the stack of everything that serves the port.
#[inline(never)]
fn build<'d>(
    peripheral: Peri<'d, USB>,
    serial_number: Option<&'d str>,
    memory: &'d mut Memory<'d>,
    handler: &'d mut &'d Bus,
) -> (UsbDevice<'d, UsbDriver<'d>>, CdcAcmClass<'d, UsbDriver<'d>>) {
    let mut config = Config::new(VENDOR_ID, PRODUCT_ID);
    config.manufacturer = Some("rover-battmon");
    config.product = Some("rover-battmon MAVLink");
    config.serial_number = serial_number;
    let mut builder = Builder::new(
        Driver::new(peripheral, Irqs),
        config,
        &mut memory.configuration,
        &mut memory.object_store,
        &mut [],
        &mut memory.control,
    );
    builder.handler(handler);
    let class = CdcAcmClass::new(&mut builder, &mut memory.serial, PACKET_BYTES as u16);
    (builder.build(), class)
}

/// A program on the host opens the port, and closes it or is unplugged.
async fn serve_programs<'d>(
    mut sender: Sender<'d, UsbDriver<'d>>,
    mut receiver: Receiver<'d, UsbDriver<'d>>,
    line: &Line<'d>,
    serve: &impl AsyncFn(UsbTransmitter<'_, '_>, UsbReceiver<'_, '_>),
) -> ! {
    let mut waiting = Vec::new();
    loop {
        line.wait_until(true).await;
        defmt::info!("USB: opened");
        let receiver = UsbReceiver {
            receiver: &mut receiver,
            line,
            packet: [0; PACKET_BYTES],
            taken: 0,
            received: 0,
        };
        waiting.clear();
        let transmitter = UsbTransmitter {
            sender: &mut sender,
            waiting: &mut waiting,
        };
        serve(transmitter, receiver).await;
        line.wait_until(false).await;
        defmt::info!("USB: closed");
    }
}

/// Ends when the device is stuck.
async fn watch(bus: &Bus) -> UsbFault {
    let mut watch = UsbWatch::default();
    loop {
        Timer::after(OBSERVATION_INTERVAL).await;
        if let Some(fault) = watch.observe(observe(bus)) {
            return fault;
        }
    }
}

fn observe(bus: &Bus) -> UsbObservation {
    let status = pac::USB.sie_status().read();
    let has_answer = pac::USB_DPRAM.ep_in_buffer_control(0).read().available(0);
    let is_busy = status.setup_rec() || status.bus_reset() || has_answer;
    UsbObservation {
        control: if is_busy {
            ControlPipe::Busy
        } else {
            ControlPipe::Idle
        },
        frame: bus.expects_frames().then(|| pac::USB.sof_rd().read().count()),
    }
}

/// Takes the device off the bus and puts the controller into the state after a reset. Everything that uses it is gone by
/// now.
async fn detach() {
    interrupt::USBCTRL_IRQ.disable();
    pac::RESETS.reset().modify(|resets| resets.set_usbctrl(true));
    Timer::after(DETACHED).await;
    pac::RESETS.reset().modify(|resets| resets.set_usbctrl(false));
    while !pac::RESETS.reset_done().read().usbctrl() {}
}

/// Whether a program has the port open.
struct Line<'d> {
    control: ControlChanged<'d>,
    bus: &'d Bus,
}

impl Line<'_> {
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

/// Actions of the host on the device. All tasks run on one executor, so plain cells hold them.
#[derive(Default)]
struct Bus {
    addressed: Cell<bool>,
    configured: Cell<bool>,
    suspended: Cell<bool>,
    changed: Signal<NoopRawMutex, ()>,
}

impl Bus {
    /// A host that has given an address begins a frame each millisecond, until it suspends or resets the bus.
    fn expects_frames(&self) -> bool {
        self.addressed.get() && !self.suspended.get()
    }
}

impl Handler for &Bus {
    fn reset(&mut self) {
        self.addressed.set(false);
        self.suspended.set(false);
        self.configured(false);
    }

    fn addressed(&mut self, _address: u8) {
        self.addressed.set(true);
    }

    fn configured(&mut self, configured: bool) {
        self.configured.set(configured);
        self.changed.signal(());
    }

    fn suspended(&mut self, suspended: bool) {
        self.suspended.set(suspended);
        self.changed.signal(());
    }
}

/// The wire to the host. Frames are collected and sent together: while a packet is on the wire, there is time to prepare the
/// next one, but not to build a frame for it, and a host that gets no packet asks again a millisecond later.
pub struct UsbTransmitter<'a, 'd> {
    sender: &'a mut Sender<'d, UsbDriver<'d>>,
    // By reference: what a transmitter has itself is there for each future that it is handed to.
    waiting: &'a mut Vec<u8, TOGETHER_BYTES>,
}

impl ErrorType for UsbTransmitter<'_, '_> {
    type Error = ErrorKind;
}

impl Write for UsbTransmitter<'_, '_> {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        if self.waiting.is_full() {
            self.send().await?;
        }
        let room = self.waiting.capacity() - self.waiting.len();
        let taken = bytes.get(..room).unwrap_or(bytes);
        // There is room for them.
        let _ = self.waiting.extend_from_slice(taken);
        Ok(taken.len())
    }

    async fn flush(&mut self) -> Result<(), ErrorKind> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        let is_last_full = self.waiting.len().is_multiple_of(PACKET_BYTES);
        self.send().await?;
        // A full packet leaves the host waiting for the rest.
        if is_last_full {
            self.send_packet(0..0).await?;
        }
        Ok(())
    }
}

impl UsbTransmitter<'_, '_> {
    /// Sends what waits.
    async fn send(&mut self) -> Result<(), ErrorKind> {
        let end = self.waiting.len();
        for start in (0..end).step_by(PACKET_BYTES) {
            self.send_packet(start..end.min(start + PACKET_BYTES)).await?;
        }
        self.waiting.clear();
        Ok(())
    }

    /// Waits until the host has taken the packet before, and hands over this one.
    async fn send_packet(&mut self, range: Range<usize>) -> Result<(), ErrorKind> {
        let packet = self.waiting.get(range).unwrap_or_default();
        let sent = self.sender.write_packet(packet).await;
        sent.map_err(|_| ErrorKind::NotConnected)
    }
}

/// The wire from the host.
pub struct UsbReceiver<'a, 'd> {
    receiver: &'a mut Receiver<'d, UsbDriver<'d>>,
    line: &'a Line<'d>,
    /// A packet has to be fetched whole, whatever room there is in the caller's buffer.
    packet: [u8; PACKET_BYTES],
    taken: usize,
    received: usize,
}

impl ByteSource for UsbReceiver<'_, '_> {
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

impl UsbReceiver<'_, '_> {
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
