//! The firmware for the board: wiring, nothing else.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use defmt::{info, warn};
    use defmt_rtt as _;
    use embassy_executor::{SpawnError, SpawnToken, Spawner};
    use embassy_rp::uart::BufferedUartTx;
    use panic_probe as _;
    use rover_battmon::board::{self, BoardWatchdog, ExecutorIdleTime, PackVoltageInput};
    use rover_battmon::liveness::CheckIn;
    use rover_battmon::tasks::{self, Link, Shared};
    use static_cell::StaticCell;

    static SHARED: StaticCell<Shared> = StaticCell::new();
    static TELEMETRY: Link = Link::new("UART0");

    // Each deadline is several of the task's own intervals.
    static BATTERY: CheckIn = CheckIn::new("battery", 500);
    static SCHEDULER: CheckIn = CheckIn::new("telemetry", 2_500);
    static WRITER: CheckIn = CheckIn::new("UART0 writer", 2_500);
    static STATUS: CheckIn = CheckIn::new("status", 2_500);

    #[embassy_executor::task]
    async fn battery(input: PackVoltageInput, shared: &'static Shared) -> ! {
        tasks::sample_battery(input, shared, &BATTERY).await
    }

    #[embassy_executor::task]
    async fn telemetry(shared: &'static Shared) -> ! {
        tasks::schedule_telemetry(shared, &TELEMETRY, &SCHEDULER).await
    }

    #[embassy_executor::task]
    async fn writer(wire: BufferedUartTx, shared: &'static Shared) {
        if tasks::write_frames(wire, shared, &TELEMETRY, &WRITER)
            .await
            .is_err()
        {
            // The writer no longer checks in, so the watchdog restarts the board.
            warn!("UART0: writing failed");
        }
    }

    #[embassy_executor::task]
    async fn status(shared: &'static Shared) -> ! {
        tasks::report_status(ExecutorIdleTime, shared, &TELEMETRY, &STATUS).await
    }

    #[embassy_executor::task]
    async fn supervisor(mut watchdog: BoardWatchdog) -> ! {
        tasks::supervise(&[&BATTERY, &SCHEDULER, &WRITER, &STATUS], &mut watchdog).await
    }

    #[embassy_executor::main]
    async fn main(spawner: Spawner) {
        let reset_reason = board::reset_reason();
        let peripherals = embassy_rp::init(Default::default());
        let watchdog = BoardWatchdog::start(peripherals.WATCHDOG);
        info!(
            "rover-battmon {}, started by {}",
            env!("CARGO_PKG_VERSION"),
            reset_reason
        );

        let shared = SHARED.init(Shared::new());
        let input = board::pack_voltage_input(peripherals.ADC, peripherals.PIN_26);
        let (wire, _) = board::telemetry_uart(peripherals.UART0, peripherals.PIN_0, peripherals.PIN_1);

        start(spawner, battery(input, shared));
        start(spawner, telemetry(shared));
        start(spawner, writer(wire, shared));
        start(spawner, status(shared));
        start(spawner, supervisor(watchdog));
    }

    /// A task that can't be started never checks in, so the watchdog restarts the board.
    fn start<S>(spawner: Spawner, task: Result<SpawnToken<S>, SpawnError>) {
        match task {
            Ok(token) => spawner.spawn(token),
            Err(error) => warn!("a task could not be started: {}", error),
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This is the firmware for the board. Flash and run it with `cargo board`.");
    eprintln!("Without a board, `cargo run` starts the simulator.");
    std::process::exit(2);
}
