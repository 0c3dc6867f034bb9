//! The simulator: the firmware's tasks on the host. Wiring, nothing else.

#[cfg(not(target_os = "none"))]
mod simulator {
    use std::net::SocketAddr;
    use std::process::ExitCode;
    use std::sync::atomic::{AtomicBool, Ordering};

    use clap::Parser;
    use embassy_executor::{Executor, Spawner};
    use embassy_time::{Duration, Ticker};
    use rover_battmon::liveness::CheckIn;
    use rover_battmon::sim::{Clients, Desk, SimulatedPackInput, Status, clock};
    use rover_battmon::tasks;

    /// Ground stations that can be connected at the same time.
    const MAX_CLIENTS: usize = 8;

    /// Simulates the rover's battery monitor: a 3S pack that is driven empty, MAVLink on TCP.
    #[derive(Parser)]
    #[command(name = "sitl", version, about)]
    struct Arguments {
        /// Where ground stations connect by TCP
        #[arg(long, value_name = "ADDRESS:PORT", default_value = "127.0.0.1:5760")]
        tcp: SocketAddr,

        /// Let simulated time pass this many times as fast
        #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = speedup)]
        speedup: f64,
    }

    fn speedup(text: &str) -> Result<f64, String> {
        match text.parse() {
            Ok(factor) if (0.01..=1000.0).contains(&factor) => Ok(factor),
            _ => Err("a number from 0.01 to 1000 is needed".into()),
        }
    }

    #[embassy_executor::task]
    async fn battery(desk: &'static Desk) -> ! {
        let check_in = CheckIn::new("battery", u32::MAX);
        tasks::sample_battery(SimulatedPackInput::new(&desk.pack), &desk.shared, &check_in).await
    }

    #[embassy_executor::task(pool_size = MAX_CLIENTS)]
    async fn client(desk: &'static Desk, clients: &'static Clients) -> ! {
        desk.serve(clients).await
    }

    #[embassy_executor::task]
    async fn terminal(desk: &'static Desk, line_interval: Duration) {
        let mut lines = Ticker::every(line_interval);
        let mut status = Status::default();
        loop {
            lines.next().await;
            status = desk.status(&status);
            println!("{status}");
        }
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
        static STOP: AtomicBool = AtomicBool::new(false);
        if let Err(error) = ctrlc::set_handler(|| STOP.store(true, Ordering::Relaxed)) {
            eprintln!("Ctrl-C will end the simulator at once: {error}.");
        }
        if clock::set_speedup(arguments.speedup).is_err() {
            eprintln!("The clock already runs, at real time.");
        }
        println!("MAVLink on tcp:{}. Ctrl-C ends it.", arguments.tcp);

        let desk: &Desk = Box::leak(Box::new(Desk::new()));
        let clients: &Clients = Box::leak(Box::new(clients));
        let line_interval = Duration::from_micros((arguments.speedup * 1e6) as u64);
        Box::leak(Box::new(Executor::new())).run_until(
            |spawner| spawn_tasks(spawner, desk, clients, line_interval),
            || STOP.load(Ordering::Relaxed),
        );
        println!("Stopped.");
        ExitCode::SUCCESS
    }

    fn spawn_tasks(
        spawner: Spawner,
        desk: &'static Desk,
        clients: &'static Clients,
        line_interval: Duration,
    ) {
        spawner.spawn(battery(desk).expect("it is spawned once"));
        spawner.spawn(terminal(desk, line_interval).expect("it is spawned once"));
        for _ in 0..MAX_CLIENTS {
            spawner.spawn(client(desk, clients).expect("the pool has this many"));
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() -> std::process::ExitCode {
    simulator::main()
}

#[cfg(target_os = "none")]
compile_error!("The simulator runs on a host. For the board build `--bin rover-battmon`.");
