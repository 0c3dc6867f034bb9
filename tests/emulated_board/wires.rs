//! From the board's ports to those of the host.

use crate::port::Port;
use emulator::{Board, Reading, SentByte};

/// This many bytes go onto the UART's line before the next are read.
const UART_CHUNK_BYTES: usize = 64;

/// What the driver of a serial adapter keeps for a program that does not read; the rest is lost.
const UART_UNREAD_BYTES: usize = 65_536;

/// More than the board takes in a frame of the bus.
const USB_UNSENT_PACKETS: usize = 32;
const USB_CHUNK_BYTES: usize = 64;

/// UART0 and a serial adapter at it, at the rate that the firmware has set.
pub struct UartWire {
    port: Port,
    /// When the last bit on the line to the board is over, in µs.
    free_us: u64,
}

impl UartWire {
    pub fn new(port: Port) -> Self {
        Self { port, free_us: 0 }
    }

    /// Takes over what was sent, and puts onto the line what is to begin before `until_us`.
    pub fn exchange(&mut self, board: &mut Board, until_us: u64) {
        self.port.accept();
        let sent = bytes(&board.uart(0).take_sent());
        if self.port.unwritten() < UART_UNREAD_BYTES {
            self.port.write(&sent);
        }
        // While the UART is in reset it has no rate.
        while self.free_us < until_us && board.uart(0).programmed_bit().is_some() {
            let received = self.port.read(UART_CHUNK_BYTES);
            if received.is_empty() {
                break;
            }
            self.free_us = board.uart_send(0, board.time_us(), &received);
        }
    }
}

/// The USB cable and a host at it. Its serial port is open while there is a client, also after the board has restarted.
pub struct UsbWire {
    port: Port,
}

impl UsbWire {
    pub fn plug(port: Port, board: &mut Board) -> Self {
        board.usb().plug();
        Self { port }
    }

    /// Takes over what was sent, and hands over what is to be sent.
    pub fn exchange(&mut self, board: &mut Board) {
        if self.port.accept() {
            // Of the port's last program.
            board.usb().take_received();
            board.usb().open();
        }
        if !self.port.is_connected() {
            return;
        }
        self.send(board);
        self.receive(board);
        if !self.port.is_connected() {
            board.usb().close();
        }
    }

    fn send(&mut self, board: &mut Board) {
        let usb = board.usb();
        while usb.is_open() && usb.unsent() < USB_UNSENT_PACKETS {
            let to_send = self.port.read(USB_CHUNK_BYTES);
            if to_send.is_empty() {
                break;
            }
            usb.send(&to_send);
        }
    }

    /// A host fetches nothing while its program does not read.
    fn receive(&mut self, board: &mut Board) {
        let usb = board.usb();
        self.port.write(&bytes(&usb.take_received()));
        usb.set_reading(match self.port.unwritten() {
            0 => Reading::Reads,
            _ => Reading::Stalls,
        });
    }
}

fn bytes(sent: &[SentByte]) -> Vec<u8> {
    sent.iter().map(|sent| sent.byte).collect()
}
