//! A host with one port: it notices a device, resets and enumerates it, and has a program that opens its serial port.
//!
//! Its times are those of USB 2.0, chapter 7.1.7. Transactions follow each other within frames of 1 ms, with their length
//! at full speed; what a transaction does, it does when it begins. After a NAK the host tries again in the next frame,
//! and there it begins the next control transfer.
//! The interrupt endpoint of the serial port is not polled.

use std::collections::VecDeque;

use super::super::clock::{Cycle, NEVER, cycles};
use super::super::uart::SentByte;
use super::bus::{Delivery, transaction_time};
use super::control::{AbortPoint, ControlRequest, ControlTransfer, Failure, Step};
use super::controller::Controller;
use super::serial::{Reading, SerialPort};

const FRAME: Cycle = cycles(1_000);
/// A SOF packet: 3 bytes behind 8 bits of synchronisation.
const START_OF_FRAME: Cycle = cycles(3);
/// How long a device has to be there until it is believed (TATTDB).
const DEBOUNCE: Cycle = cycles(100_000);
/// A reset by a root hub (TDRSTR).
const RESET: Cycle = cycles(50_000);
/// What a device needs after a reset, and after SET_ADDRESS (TRSTRCY, and 9.2.6.3).
const RESET_RECOVERY: Cycle = cycles(10_000);
const ADDRESS_RECOVERY: Cycle = cycles(2_000);
/// How long a resume is signalled (TDRSMDN).
const RESUME: Cycle = cycles(20_000);
/// The largest packet has to fit into what is left of a frame.
const PACKET_BYTES: usize = 64;
/// A device that can't be enumerated is reset so often; then it is left alone until it goes.
const ATTEMPTS: u32 = 4;

/// What the host's side of the port is at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Port {
    /// No device is seen.
    Empty,
    Debouncing {
        until: Cycle,
    },
    Resetting {
        until: Cycle,
    },
    /// Frames are sent, and requests follow from `until` on.
    Enabled {
        until: Cycle,
    },
    Suspended,
    Resuming {
        until: Cycle,
    },
    /// The device could not be enumerated.
    Failed,
}

/// What the device has said of itself.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Description {
    pub vendor: u16,
    pub product: u16,
    pub manufacturer_name: String,
    pub product_name: String,
    pub serial_number: String,
    /// Numbers of its bulk endpoints.
    input: u8,
    output: u8,
    configuration: u8,
    /// Indices of the strings above.
    strings: [u8; 3],
}

/// What has happened at the port.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HostEvent {
    Attached,
    Detached,
    Configured,
    Opened,
    Closed,
    Failed(ControlRequest, Failure),
    BusError,
    GivenUp,
}

#[derive(Clone)]
pub struct Host {
    now: Cycle,
    next_at: Cycle,
    is_plugged: bool,
    port: Port,
    address: u8,
    attempts: u32,
    frame: u32,
    next_frame: Cycle,
    control_waits: bool,
    transfers: VecDeque<ControlTransfer>,
    device: Description,
    is_configured: bool,
    wants_open: bool,
    corrupt_next: bool,
    serial: SerialPort,
    events: Vec<(Cycle, HostEvent)>,
}

impl Default for Host {
    fn default() -> Self {
        Self {
            now: 0,
            next_at: NEVER,
            is_plugged: false,
            port: Port::Empty,
            address: 0,
            attempts: 0,
            frame: 0,
            next_frame: 0,
            control_waits: false,
            transfers: VecDeque::new(),
            device: Description::default(),
            is_configured: false,
            wants_open: false,
            corrupt_next: false,
            serial: SerialPort::default(),
            events: Vec::new(),
        }
    }
}

impl Host {
    // ----- What a test does ---------------------------------------------------------------------------

    /// Connect the cable.
    pub fn plug(&mut self) {
        self.is_plugged = true;
        self.next_at = self.now;
    }

    /// Pull the cable.
    pub fn unplug(&mut self) {
        self.is_plugged = false;
        self.detach(self.now);
        self.next_at = NEVER;
    }

    /// A program opens the serial port, now and whenever the device comes back, until [`Self::close`].
    pub fn open(&mut self) {
        self.wants_open = true;
        if self.is_configured {
            self.request_open();
        }
    }

    /// The program closes the port.
    pub fn close(&mut self) {
        self.stop_program();
        self.request(ControlRequest::Close, None);
    }

    /// The program is gone, and its system drops this request halfway instead of closing the port.
    pub fn close_with_abort(&mut self, request: ControlRequest, point: AbortPoint) {
        self.stop_program();
        self.request(request, Some(point));
    }

    /// Send this request and drop it at a point, if there is one.
    pub fn request(&mut self, request: ControlRequest, abort: Option<AbortPoint>) {
        if self.is_configured {
            self.transfers.push_back(ControlTransfer::new(request, abort));
        }
    }

    /// Whether the program goes on reading.
    pub fn set_reading(&mut self, reading: Reading) {
        self.serial.reading = reading;
    }

    /// The next packet of data from the device meets a bus error (RP2040-E15).
    pub fn corrupt_next_packet(&mut self) {
        self.corrupt_next = true;
    }

    /// Reset the bus and enumerate the device again.
    pub fn reset_bus(&mut self) {
        if self.port != Port::Empty && self.is_plugged {
            self.forget_device();
            self.port = Port::Debouncing { until: self.now };
            self.next_at = self.now;
        }
    }

    /// Stop all traffic.
    pub fn suspend(&mut self) {
        if matches!(self.port, Port::Enabled { .. }) {
            self.port = Port::Suspended;
        }
    }

    /// Wake the device.
    pub fn resume(&mut self) {
        if self.port == Port::Suspended {
            self.port = Port::Resuming {
                until: self.now + RESUME,
            };
            self.next_at = self.now;
        }
    }

    /// Send bytes through the open port.
    pub fn send(&mut self, bytes: &[u8]) {
        self.serial.send(bytes);
    }

    /// Packets of [`Self::send`] that the device has not taken yet.
    pub fn unsent(&self) -> usize {
        self.serial.unsent()
    }

    /// Take what came through the port so far.
    pub fn take_received(&mut self) -> Vec<SentByte> {
        self.serial.take_received()
    }

    pub fn is_open(&self) -> bool {
        self.serial.is_open
    }

    /// The device as it described itself; `None` unless it is configured.
    pub fn device(&self) -> Option<&Description> {
        self.is_configured.then_some(&self.device)
    }

    /// Take what happened so far, with its times in cycles.
    pub fn take_events(&mut self) -> Vec<(Cycle, HostEvent)> {
        std::mem::take(&mut self.events)
    }

    // ----- Time ---------------------------------------------------------------------------------------

    pub fn next_event(&self) -> Cycle {
        self.next_at
    }

    pub fn pass_time(&mut self, now: Cycle) {
        self.now = now;
    }

    /// Does what is due.
    pub fn act(&mut self, controller: &mut Controller, now: Cycle) {
        self.now = now;
        if !controller.is_attached() {
            self.detach(now);
            self.next_at = now + FRAME;
            return;
        }
        match self.port {
            Port::Empty => {
                self.note(HostEvent::Attached);
                self.debounce();
            }
            Port::Debouncing { until } if now >= until => self.reset_device(controller),
            Port::Resetting { until } if now >= until => self.enable(),
            Port::Resuming { until } if now >= until => {
                controller.resume(now);
                self.port = Port::Enabled {
                    until: now + RESET_RECOVERY,
                };
                self.next_frame = now;
                self.next_at = now;
            }
            Port::Enabled { .. } if now >= self.next_frame => self.begin_frame(controller),
            Port::Enabled { until } => self.transact(controller, now >= until),
            Port::Debouncing { until } | Port::Resetting { until } | Port::Resuming { until } => {
                self.next_at = until.min(now + FRAME);
            }
            Port::Suspended | Port::Failed => self.next_at = now + FRAME,
        }
    }

    fn debounce(&mut self) {
        self.attempts = 0;
        self.port = Port::Debouncing {
            until: self.now + DEBOUNCE,
        };
        self.next_at = self.now + FRAME;
    }

    fn reset_device(&mut self, controller: &mut Controller) {
        controller.bus_reset();
        self.address = 0;
        self.port = Port::Resetting {
            until: self.now + RESET,
        };
        self.next_at = self.now + FRAME;
    }

    fn enable(&mut self) {
        if self.transfers.is_empty() {
            self.ask(ControlRequest::DeviceDescriptor { length: 64 });
        }
        self.port = Port::Enabled {
            until: self.now + RESET_RECOVERY,
        };
        self.next_frame = self.now;
        self.next_at = self.now;
    }

    fn begin_frame(&mut self, controller: &mut Controller) {
        self.frame += 1;
        controller.start_of_frame(self.frame, self.now);
        self.next_frame = self.now + FRAME;
        self.next_at = self.now + START_OF_FRAME;
        self.control_waits = false;
        self.serial.begin_frame();
    }

    /// One transaction of this frame, or the end of its work.
    fn transact(&mut self, controller: &mut Controller, may_ask: bool) {
        let fits = self.now + transaction_time(PACKET_BYTES) <= self.next_frame;
        let could_answer = controller.is_working();
        let moved = match self.transfers.is_empty() || self.control_waits || !may_ask || !fits {
            false => Some(self.control(controller)),
            true if fits => self.serial_transaction(controller),
            true => None,
        };
        if could_answer && !controller.is_working() {
            self.corrupt_next = false;
            self.note(HostEvent::BusError);
        }
        // What a transaction led to may have its own time.
        if matches!(self.port, Port::Enabled { .. }) {
            let next = moved.map_or(self.next_frame, |bytes| self.now + transaction_time(bytes));
            self.next_at = next.min(self.next_frame);
        }
    }

    fn delivery(&self) -> Delivery {
        match self.corrupt_next {
            true => Delivery::BusError,
            false => Delivery::Acknowledged,
        }
    }

    fn serial_transaction(&mut self, controller: &mut Controller) -> Option<usize> {
        let delivery = self.delivery();
        self.serial.transact(self.address, delivery, controller, self.now)
    }

    // ----- Control transfers --------------------------------------------------------------------------

    fn control(&mut self, controller: &mut Controller) -> usize {
        let delivery = self.delivery();
        let Some(transfer) = self.transfers.front_mut() else {
            return 0;
        };
        let request = transfer.request;
        match transfer.step(self.address, delivery, controller, self.now) {
            Step::Moved(bytes) => return bytes,
            Step::Waits => self.control_waits = true,
            Step::Completed(received) => {
                self.transfers.pop_front();
                self.control_waits = true;
                self.completed(request, &received);
            }
            Step::Failed(failure) => {
                self.transfers.pop_front();
                self.control_waits = true;
                self.failed(request, failure);
            }
        }
        0
    }

    fn ask(&mut self, request: ControlRequest) {
        self.transfers.push_back(ControlTransfer::new(request, None));
    }

    fn completed(&mut self, request: ControlRequest, received: &[u8]) {
        match request {
            ControlRequest::Open => self.opened(),
            ControlRequest::Close => self.note(HostEvent::Closed),
            ControlRequest::SetLineCoding | ControlRequest::GetLineCoding => {}
            _ => self.go_on_enumerating(request, received),
        }
    }

    fn failed(&mut self, request: ControlRequest, failure: Failure) {
        self.note(HostEvent::Failed(request, failure));
        if self.is_configured {
            return;
        }
        self.attempts += 1;
        self.forget_device();
        self.port = match self.attempts {
            ATTEMPTS => {
                self.note(HostEvent::GivenUp);
                Port::Failed
            }
            _ => Port::Debouncing { until: self.now },
        };
        self.next_at = self.now + FRAME;
    }

    /// The requests of an enumeration in their order, each after the answer to the one before. A descriptor that is too short
    /// reads as zeros, and a device that means nothing by it fails in the end.
    fn go_on_enumerating(&mut self, request: ControlRequest, received: &[u8]) {
        let [manufacturer, product, serial] = self.device.strings;
        match request {
            ControlRequest::DeviceDescriptor { length: 64 } => {
                self.ask(ControlRequest::SetAddress(1));
                self.port = Port::Debouncing { until: self.now };
                self.next_at = self.now;
            }
            ControlRequest::SetAddress(address) => {
                self.address = address;
                self.port = Port::Enabled {
                    until: self.now + ADDRESS_RECOVERY,
                };
                self.ask(ControlRequest::DeviceDescriptor { length: 18 });
            }
            ControlRequest::DeviceDescriptor { .. } => {
                self.device = Description::of_device(received);
                self.ask(ControlRequest::ConfigurationDescriptor { length: 9 });
            }
            ControlRequest::ConfigurationDescriptor { length: 9 } => {
                let length = word(received, 2);
                self.ask(ControlRequest::ConfigurationDescriptor { length });
            }
            ControlRequest::ConfigurationDescriptor { .. } => {
                self.device.add_configuration(received);
                self.ask(ControlRequest::Languages);
            }
            ControlRequest::Languages => self.ask_for_string(&[manufacturer, product, serial]),
            ControlRequest::StringDescriptor(index) => {
                let text = text_of(received);
                if index == manufacturer {
                    self.device.manufacturer_name = text;
                    self.ask_for_string(&[product, serial]);
                } else if index == product {
                    self.device.product_name = text;
                    self.ask_for_string(&[serial]);
                } else {
                    self.device.serial_number = text;
                    self.ask_for_string(&[]);
                }
            }
            _ => self.configured(),
        }
    }

    /// Of the strings that are left, the first that the device has; then it is configured.
    fn ask_for_string(&mut self, indices: &[u8]) {
        let next = indices.iter().find(|index| **index != 0);
        self.ask(match next {
            Some(index) => ControlRequest::StringDescriptor(*index),
            None => ControlRequest::SetConfiguration(self.device.configuration),
        });
    }

    fn configured(&mut self) {
        self.serial.configure(self.device.input, self.device.output);
        self.is_configured = true;
        self.attempts = 0;
        self.note(HostEvent::Configured);
        if self.wants_open {
            self.request_open();
        }
    }

    fn request_open(&mut self) {
        self.ask(ControlRequest::SetLineCoding);
        self.ask(ControlRequest::Open);
    }

    fn opened(&mut self) {
        self.serial.is_open = true;
        self.note(HostEvent::Opened);
    }

    fn stop_program(&mut self) {
        self.wants_open = false;
        self.serial.detach();
    }

    fn detach(&mut self, now: Cycle) {
        self.now = now;
        if self.port != Port::Empty {
            self.note(HostEvent::Detached);
            self.forget_device();
            self.port = Port::Empty;
        }
    }

    fn forget_device(&mut self) {
        self.transfers.clear();
        self.serial.detach();
        self.is_configured = false;
        self.address = 0;
    }

    fn note(&mut self, event: HostEvent) {
        self.events.push((self.now, event));
    }
}

impl Description {
    /// From a device descriptor (9.6.1).
    fn of_device(bytes: &[u8]) -> Self {
        Self {
            vendor: word(bytes, 8),
            product: word(bytes, 10),
            strings: [14, 15, 16].map(|at| bytes.get(at).copied().unwrap_or(0)),
            ..Self::default()
        }
    }

    /// From a configuration descriptor (9.6.3) and the endpoints (9.6.6) behind it.
    fn add_configuration(&mut self, bytes: &[u8]) {
        const ENDPOINT: u8 = 5;
        const BULK: u8 = 2;
        self.configuration = bytes.get(5).copied().unwrap_or(0);
        let mut rest = bytes;
        while let [length, kind, fields @ ..] = rest {
            if let (ENDPOINT, [address, BULK, ..]) = (*kind, fields) {
                match address & 0x80 {
                    0 => self.output = address & 0xf,
                    _ => self.input = address & 0xf,
                }
            }
            rest = rest.get(usize::from(*length).max(2)..).unwrap_or(&[]);
        }
    }
}

fn word(bytes: &[u8], at: usize) -> u16 {
    let byte = |at| u16::from(bytes.get(at).copied().unwrap_or(0));
    byte(at) | byte(at + 1) << 8
}

/// A string descriptor's text (9.6.7).
fn text_of(descriptor: &[u8]) -> String {
    let units = descriptor.get(2..).unwrap_or(&[]).chunks_exact(2);
    let units: Vec<u16> = units.map(|unit| word(unit, 0)).collect();
    String::from_utf16_lossy(&units)
}
