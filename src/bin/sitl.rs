//! The simulator: the firmware's tasks on the host. Wiring, nothing else.

#[cfg(not(target_os = "none"))]
mod simulator {
    use std::cell::RefCell;
    use std::io;
    use std::net::SocketAddr;
    use std::path::PathBuf;
    use std::process::ExitCode;
    use std::sync::atomic::{AtomicBool, Ordering};

    use clap::Parser;
    use embassy_executor::Executor;
    use embassy_time::{Duration, Ticker};
    use rover_battmon::sim::{self, Clients, LogFolder, SimulatedFlash, UdpWire, clock};

    /// Simulates the rover and its battery monitor: a full 3S pack, four motors, MAVLink on TCP and UDP.
    #[derive(Parser)]
    #[command(name = "rover-battmon-sitl", version, about)]
    struct Arguments {
        /// Where ground stations connect by TCP
        #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:5760")]
        tcp: SocketAddr,

        /// Where a ground station listens by UDP
        #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:14550")]
        udp: SocketAddr,

        /// Let simulated time pass this many times as fast
        #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = speedup)]
        speedup: f64,

        /// Keep parameters, key and what is learnt of packs in this file, as the board does in its flash
        #[arg(long, value_name = "FILE")]
        flash: Option<PathBuf>,

        /// Copy the logs of this run into this folder, once a second
        #[arg(long, value_name = "DIR")]
        log: Option<PathBuf>,
    }

    fn speedup(text: &str) -> Result<f64, String> {
        match text.parse() {
            Ok(factor) if (0.01..=1000.0).contains(&factor) => Ok(factor),
            _ => Err("a number from 0.01 to 1000 is needed".into()),
        }
    }

    /// Whether the simulator has to end.
    static STOP: AtomicBool = AtomicBool::new(false);

    #[embassy_executor::task]
    async fn simulator(clients: Clients, udp: UdpWire, flash: SimulatedFlash, line_interval: Duration) {
        sim::run(&clients, &udp, flash, line_interval).await;
        STOP.store(true, Ordering::Relaxed);
    }

    /// For the rest of the program, as tasks have it.
    fn open_log_folder(path: PathBuf, flash: &SimulatedFlash) -> io::Result<&'static RefCell<LogFolder>> {
        let folder = LogFolder::open(path, flash.clone())?;
        Ok(Box::leak(Box::new(RefCell::new(folder))))
    }

    #[embassy_executor::task]
    async fn log_copier(folder: &'static RefCell<LogFolder>, interval: Duration) {
        let mut copies = Ticker::every(interval);
        while copy_logs(folder).is_ok() {
            copies.next().await;
        }
    }

    /// Copies what is new. A failure is shown.
    fn copy_logs(folder: &RefCell<LogFolder>) -> io::Result<()> {
        let copied = folder.borrow_mut().update();
        copied.inspect_err(|error| eprintln!("Can't copy the log: {error}."))
    }

    pub fn main() -> ExitCode {
        let arguments = Arguments::parse();
        let clients = match Clients::listen(arguments.tcp) {
            Ok(clients) => clients,
            Err(error) => {
                eprintln!("Can't listen on {}: {error}.", arguments.tcp);
                eprintln!("Is another simulator running? --tcp 127.0.0.1:5761 takes another port.");
                return ExitCode::FAILURE;
            }
        };
        let udp = match UdpWire::to(arguments.udp) {
            Ok(udp) => udp,
            Err(error) => {
                eprintln!("Can't send to {}: {error}.", arguments.udp);
                return ExitCode::FAILURE;
            }
        };
        let flash_file = arguments.flash.clone().unwrap_or_default();
        let flash = match SimulatedFlash::open(arguments.flash) {
            Ok(flash) => flash,
            Err(error) => {
                eprintln!("Can't use the flash file {}: {error}.", flash_file.display());
                return ExitCode::FAILURE;
            }
        };
        let log_folder = match arguments
            .log
            .map(|path| open_log_folder(path, &flash))
            .transpose()
        {
            Ok(folder) => folder,
            Err(error) => {
                eprintln!("Can't use the log folder: {error}.");
                return ExitCode::FAILURE;
            }
        };
        if let Err(error) = ctrlc::set_handler(|| STOP.store(true, Ordering::Relaxed)) {
            eprintln!("Ctrl-C will end the simulator at once: {error}.");
        }
        if clock::set_speedup(arguments.speedup).is_err() {
            eprintln!("The clock already runs, at real time.");
        }
        println!(
            "MAVLink on tcp:{} and to udp:{}. Ctrl-C ends it.",
            arguments.tcp, arguments.udp
        );

        let line_interval = Duration::from_micros((arguments.speedup * 1e6) as u64);
        Box::leak(Box::new(Executor::new())).run_until(
            |spawner| {
                spawner.spawn(simulator(clients, udp, flash, line_interval).expect("it is spawned once"));
                if let Some(folder) = log_folder {
                    spawner.spawn(log_copier(folder, line_interval).expect("it is spawned once"));
                }
            },
            || STOP.load(Ordering::Relaxed),
        );
        // What was written since the last copy.
        if let Some(folder) = log_folder {
            let _ = copy_logs(folder);
        }
        println!("Stopped.");
        ExitCode::SUCCESS
    }
}

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    simulator::main()
}

#[cfg(target_os = "none")]
compile_error!("The simulator runs on a host. For the board build `--bin rover-battmon`.");
