//! Checks a board: arguments, port, clock and terminal, nothing else.

use std::fs::File;
use std::io::{self, ErrorKind, IsTerminal, Read, Write};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{self, Receiver, TryRecvError};
use std::time::{Duration, Instant as Clock};
use std::{fs, thread};

use clap::Parser;
use rover_battmon::memory::identity::FirmwareHash;
use rover_battmon::time::Instant;
use rover_battmon_tools::board_check::{
    Divider, Multimeter, Owner, Plan, Port, REPORT_HEAD, Verdict, hash_of_elf, run,
};
use serialport::SerialPort;

/// Between two attempts to open a port that vanished.
const REOPEN_INTERVAL: Duration = Duration::from_millis(200);

/// Checks a board over MAVLink and writes a report: 0 no check failed, 1 some did, 2 no board answered or the report can't be written
#[derive(Parser)]
#[command(name = "board-check", version)]
struct Arguments {
    /// A serial port, as /dev/ttyACM0 or COM3, or tcp:HOST:PORT
    port: String,

    /// Baud rate of the telemetry port; USB does not care
    #[arg(long, default_value_t = 115_200)]
    baud: u32,

    /// Where the report goes
    #[arg(long, value_name = "FILE", default_value = "board-check.md")]
    report: PathBuf,

    /// Ask for the voltage that a multimeter shows at the pack
    #[arg(long, group = "measured")]
    multimeter: bool,

    /// The voltage that a multimeter shows at the pack
    #[arg(long, value_name = "VOLTS", value_parser = positive, group = "measured")]
    voltage: Option<f32>,

    /// Set BATT_VOLT_MULT so that the board shows what the multimeter does
    #[arg(long, requires = "measured")]
    apply: bool,

    /// The divider was changed: believe any voltage
    #[arg(long, requires = "measured")]
    divider_changed: bool,

    /// Provoke a fault, and check that it is recorded
    #[arg(long)]
    provoke_fault: bool,

    /// Turn the wheels, one side after the other: wheels up!
    #[arg(long)]
    motors: bool,

    /// The ELF file of the build that the board has to run
    #[arg(long, value_name = "FILE", value_parser = hash_of_file)]
    firmware: Option<FirmwareHash>,
}

fn positive(text: &str) -> Result<f32, String> {
    match text.replace(',', ".").parse::<f32>() {
        Ok(number) if number.is_finite() && number > 0.0 => Ok(number),
        _ => Err("a voltage above 0 is needed".into()),
    }
}

fn hash_of_file(name: &str) -> Result<FirmwareHash, String> {
    let file = fs::read(name).map_err(|error| error.to_string())?;
    hash_of_elf(&file).ok_or_else(|| "the firmware's ELF file is needed".into())
}

impl Arguments {
    fn plan(&self) -> Plan {
        Plan {
            provoke_fault: self.provoke_fault,
            turn_motors: self.motors,
            multimeter: match self.voltage {
                Some(voltage_v) => Multimeter::Shows(voltage_v),
                None if self.multimeter => Multimeter::Ask,
                None => Multimeter::None,
            },
            apply_calibration: self.apply,
            divider: if self.divider_changed {
                Divider::Changed
            } else {
                Divider::AsBefore
            },
            firmware_hash: self.firmware,
        }
    }
}

/// An open line.
enum Line {
    Serial(Box<dyn SerialPort>),
    Tcp(TcpStream),
}

impl Line {
    fn open(name: &str, baud: u32) -> io::Result<Self> {
        if let Some(address) = name.strip_prefix("tcp:") {
            let stream = TcpStream::connect(address)?;
            stream.set_nodelay(true)?;
            return Ok(Self::Tcp(stream));
        }
        let mut port = serialport::new(name, baud).open()?;
        // The firmware serves a USB port once this line is set; ports without it need none.
        let _ = port.write_data_terminal_ready(true);
        Ok(Self::Serial(port))
    }

    fn write_all(&mut self, bytes: &[u8]) -> io::Result<()> {
        match self {
            Self::Serial(port) => port.write_all(bytes),
            Self::Tcp(stream) => stream.write_all(bytes),
        }
    }

    fn read(&mut self, buffer: &mut [u8], timeout: Duration) -> io::Result<usize> {
        match self {
            Self::Serial(port) => {
                port.set_timeout(timeout)?;
                port.read(buffer)
            }
            Self::Tcp(stream) => {
                stream.set_read_timeout(Some(timeout))?;
                stream.read(buffer)
            }
        }
    }
}

/// The port that was named.
struct NamedPort<'a> {
    name: &'a str,
    baud: u32,
    line: Line,
    began: Clock,
}

impl Port for NamedPort<'_> {
    fn now(&mut self) -> Instant {
        Instant::from_micros(self.began.elapsed().as_micros() as u64)
    }

    fn send(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.line.write_all(bytes)
    }

    fn receive(&mut self, deadline: Instant, bytes: &mut Vec<u8>) -> io::Result<()> {
        // No time-out at all would be an endless one, or an error.
        let left_us = deadline.us_since(self.now()).max(1_000);
        let mut buffer = [0; 4096];
        match self.line.read(&mut buffer, Duration::from_micros(left_us)) {
            Ok(0) => Err(ErrorKind::UnexpectedEof.into()),
            Ok(received) => {
                bytes.extend(&buffer[..received]);
                Ok(())
            }
            Err(error) => match error.kind() {
                ErrorKind::TimedOut | ErrorKind::WouldBlock | ErrorKind::Interrupted => Ok(()),
                _ => Err(error),
            },
        }
    }

    fn reopen(&mut self, deadline: Instant) -> io::Result<()> {
        while self.now() < deadline && !STOP.load(Ordering::Relaxed) {
            thread::sleep(REOPEN_INTERVAL);
            if let Ok(line) = Line::open(self.name, self.baud) {
                self.line = line;
                return Ok(());
            }
        }
        Err(ErrorKind::NotConnected.into())
    }
}

/// Whether the check has to end.
static STOP: AtomicBool = AtomicBool::new(false);

/// The user at the terminal, or a program that has written all answers beforehand.
struct Terminal {
    /// Lines that are typed, if there will be a question; read by a thread, since the board has to be listened to meanwhile.
    lines: Option<Receiver<String>>,
}

fn read_lines() -> Receiver<String> {
    let (sender, receiver) = mpsc::channel();
    thread::spawn(move || {
        for line in io::stdin().lines().map_while(Result::ok) {
            if sender.send(line).is_err() {
                return;
            }
        }
    });
    receiver
}

impl Owner for Terminal {
    fn show(&mut self, line: &str) {
        println!("{line}");
    }

    fn ask(&mut self, question: &str) {
        if io::stdin().is_terminal() {
            // It was typed before the question, so it is no answer to it.
            while self.answer().is_ok() {}
        }
        println!("{question}");
    }

    fn answer(&mut self) -> Result<String, TryRecvError> {
        let lines = self.lines.as_ref().ok_or(TryRecvError::Disconnected)?;
        lines.try_recv()
    }

    fn has_stopped(&mut self) -> bool {
        STOP.load(Ordering::Relaxed)
    }
}

/// Whether the report can be written, before the board is touched. A file that is there is replaced only if it is a report.
fn try_report(path: &Path) -> Result<(), String> {
    match fs::metadata(path) {
        Ok(file) if file.is_file() && file.len() > 0 => {
            let mut head = [0; REPORT_HEAD.len()];
            let read = File::open(path).and_then(|mut file| file.read_exact(&mut head));
            if read.is_err() || head != *REPORT_HEAD.as_bytes() {
                return Err("it is no report of board-check; remove it, or name another file".into());
            }
            let opened = File::options().append(true).open(path);
            opened.map(drop).map_err(|error| error.to_string())
        }
        Ok(file) if !file.is_file() && !file.is_dir() => Ok(()),
        _ => fs::write(path, REPORT_HEAD).map_err(|error| error.to_string()),
    }
}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    if let Err(error) = ctrlc::set_handler(|| STOP.store(true, Ordering::Relaxed)) {
        eprintln!("Ctrl-C can't stop the motors ({error}): nothing was done.");
        return ExitCode::from(2);
    }
    let line = match Line::open(&arguments.port, arguments.baud) {
        Ok(line) => line,
        Err(error) => {
            eprintln!("Can't open {}: {error}.", arguments.port);
            return ExitCode::from(2);
        }
    };
    let file = arguments.report.display();
    if let Err(error) = try_report(&arguments.report) {
        eprintln!("Can't write {file}: {error}.");
        return ExitCode::from(2);
    }
    let mut port = NamedPort {
        name: &arguments.port,
        baud: arguments.baud,
        line,
        began: Clock::now(),
    };
    let asks = arguments.motors || arguments.multimeter;
    let mut terminal = Terminal {
        lines: asks.then(read_lines),
    };
    let report = run(&mut port, &mut terminal, &arguments.plan());
    if report.verdict() == Verdict::Armed {
        return ExitCode::FAILURE;
    }
    let text = report.markdown(&arguments.port);
    match fs::write(&arguments.report, &text) {
        Ok(()) => println!("The report is in {file}."),
        Err(error) => {
            eprintln!("Can't write {file}: {error}. The report:\n\n{text}");
            return ExitCode::FAILURE;
        }
    }
    match report.verdict() {
        Verdict::Passed => ExitCode::SUCCESS,
        Verdict::Failed | Verdict::Armed => ExitCode::FAILURE,
        Verdict::NotConnected => ExitCode::from(2),
    }
}

#[cfg(target_os = "none")]
compile_error!("The check runs on a host. For the board build `--bin rover-battmon`.");
