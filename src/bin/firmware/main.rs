//! The firmware for the board: wiring, nothing else.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use core::future::poll_fn;
    use core::pin::{Pin, pin};
    use core::task::{Context, Poll};

    use defmt::{info, warn};
    use defmt_rtt as _;
    use embassy_executor::{SendSpawner, SpawnError, SpawnToken, Spawner};
    use embassy_futures::yield_now;
    use embassy_rp::peripherals::{FLASH, I2C1, PIN_2, PIN_14, PIN_15, PIN_16, PIN_22, PIO1, USB, WATCHDOG};
    use embassy_rp::{Peri, Peripherals};
    use panic_probe as _;
    use rover_battmon::autopilot::{Start, Wiring};
    use rover_battmon::battery::RetainedMemory;
    use rover_battmon::board::{
        self, AnalogInputs, AnalogPeripherals, BoardCan, BoardFlash, BoardIndicators, BoardKind, BoardMotors,
        BoardWatchdog, Buzzer, CanController, CanPins, FlashChip, FlashDriver, LastRun, MotorPeripherals,
        PulseInput, SensorI2c, SensorSpi, SerialPort, SerialUart, SharedSpi, SpiPeripherals, TelemetryUart,
        UartReceiver, UartTransmitter, UsbPort, Wifi, WifiPeripherals,
    };
    use rover_battmon::mavlink::LinkId;
    use rover_battmon::memory::flash_map;
    use rover_battmon::memory::identity::BoardId;
    use rover_battmon::net::{NetMemory, Service};
    use rover_battmon::sensor::{Buses, DriverEnable};
    use rover_battmon::tasks::CheckIn;
    use rover_battmon::tasks::{self, Link, SeenPulses, Shared, Storages};
    use rover_battmon::wifi::{RADIO_TASK, Radio};
    use static_cell::StaticCell;

    static FLASH_DRIVER: StaticCell<FlashDriver> = StaticCell::new();
    static SHARED: StaticCell<Shared> = StaticCell::new();
    static UART0: StaticCell<Link<'static>> = StaticCell::new();
    static LOGS: StaticCell<BoardFlash> = StaticCell::new();
    static SPI: StaticCell<SharedSpi> = StaticCell::new();
    static RADIO: StaticCell<cyw43::State> = StaticCell::new();
    static NETWORK: StaticCell<NetMemory> = StaticCell::new();

    // Each deadline is several of the task's own intervals.
    static BATTERY: CheckIn = CheckIn::new("battery", 1_000);
    static BUS: CheckIn = CheckIn::new("bus", 2_500);
    static CAN: CheckIn = CheckIn::new("CAN", 2_500);
    static SERIAL: CheckIn = CheckIn::new("serial", 2_500);
    static PULSES: CheckIn = CheckIn::new("pulses", 2_500);
    static DRIVE: CheckIn = CheckIn::new("drive", 500).while_armed(150);
    static TELEMETRY: CheckIn = CheckIn::new("telemetry", 2_500);
    static UART0_WRITER: CheckIn = CheckIn::new("UART0 writer", 2_500);
    static UART0_READER: CheckIn = CheckIn::new("UART0 reader", 2_500);
    static FLASH: CheckIn = CheckIn::new("flash", 5_000);
    static WIFI: CheckIn = CheckIn::new(RADIO_TASK, 5_000);
    static STATUS: CheckIn = CheckIn::new("status", 2_500);

    /// Without a host, or with one that does not read, the USB link stands still, and nothing is wrong with the board. So
    /// the supervisor does not look at it.
    static UNWATCHED: CheckIn = CheckIn::new("USB link", u32::MAX);

    #[embassy_executor::task]
    async fn battery(pins: AnalogInputs, memory: &'static mut RetainedMemory, shared: &'static Shared) -> ! {
        tasks::sample_batteries(pins, memory, shared, &BATTERY).await
    }

    #[embassy_executor::task]
    async fn bus(bus: Buses<SensorI2c, SensorSpi>, shared: &'static Shared) -> ! {
        tasks::read_bus(bus, shared, &BUS).await
    }

    #[embassy_executor::task]
    async fn can(bus: Option<&'static BoardCan>, shared: &'static Shared) -> ! {
        tasks::serve_can(bus, shared, &CAN).await
    }

    /// In an interrupt, and only with a CAN bus. It checks in by way of the one above.
    #[embassy_executor::task]
    async fn can_controller(controller: CanController) -> ! {
        controller.serve().await
    }

    #[embassy_executor::task]
    async fn serial(line: Option<SerialPort>, shared: &'static Shared) -> ! {
        tasks::serve_serial(line, shared, &SERIAL).await
    }

    #[embassy_executor::task]
    async fn pulses(seen: Option<&'static SeenPulses>, shared: &'static Shared) -> ! {
        tasks::hand_over_pulses(seen, shared, &PULSES).await
    }

    /// In an interrupt, and only with a fuel sensor. Nothing in it can hang.
    #[embassy_executor::task]
    async fn pulse_pin(pin: PulseInput) -> ! {
        tasks::watch_pulses(pin, &board::PULSES_SEEN).await
    }

    #[embassy_executor::task]
    async fn drive(motors: BoardMotors, indicators: BoardIndicators, shared: &'static Shared) -> ! {
        tasks::drive(motors, indicators, shared, &DRIVE).await
    }

    #[embassy_executor::task]
    async fn buzzer(mut buzzer: Buzzer) -> ! {
        buzzer.run().await
    }

    #[embassy_executor::task]
    async fn telemetry(shared: &'static Shared, link: &'static Link<'static>) -> ! {
        tasks::schedule_telemetry(shared, link, &TELEMETRY).await
    }

    #[embassy_executor::task]
    async fn uart0_writer(wire: UartTransmitter, shared: &'static Shared, link: &'static Link<'static>) {
        if tasks::write_frames(wire, shared, link, &UART0_WRITER)
            .await
            .is_err()
        {
            // The writer no longer checks in, so the watchdog restarts the board.
            warn!("UART0: writing failed");
        }
    }

    #[embassy_executor::task]
    async fn uart0_reader(wire: UartReceiver, shared: &'static Shared, link: &'static Link<'static>) {
        tasks::read_frames(wire, shared, link, &UART0_READER).await;
    }

    /// Serves one program on the host after the other, each with a link of its own: its own schedule, sequence numbers
    /// and losses.
    async fn usb(mut port: UsbPort, logs: &'static BoardFlash, shared: &'static Shared) -> ! {
        port.run(async |transmitter, receiver| {
            let link = Link::of_board(LinkId::Usb, shared).with_logs(logs);
            tasks::serve_link(transmitter, receiver, shared, &link, &UNWATCHED).await;
        })
        .await
    }

    #[embassy_executor::task]
    async fn flash(
        storages: Storages<BoardFlash>,
        log: BoardFlash,
        board_id: Option<BoardId>,
        shared: &'static Shared,
    ) -> ! {
        let entropy = async || board::entropy(board_id).await;
        tasks::keep_flash(storages, log, flash_map::LOG, entropy, shared, &FLASH).await
    }

    /// Only on a board with a radio.
    #[embassy_executor::task]
    async fn wifi(mut radio: Wifi, logs: &'static BoardFlash, shared: &'static Shared) -> ! {
        let check_in = &WIFI;
        radio
            .run(&Service {
                shared,
                logs,
                check_in,
            })
            .await
    }

    #[embassy_executor::task]
    async fn status(shared: &'static Shared, link: &'static Link<'static>) -> ! {
        tasks::report_status(board::idle_us, shared, link, &STATUS).await
    }

    #[embassy_executor::task]
    async fn supervisor(shared: &'static Shared, mut watchdog: BoardWatchdog, radio: Radio) -> ! {
        let watched = [
            &WIFI,
            &BATTERY,
            &BUS,
            &CAN,
            &SERIAL,
            &PULSES,
            &DRIVE,
            &TELEMETRY,
            &UART0_WRITER,
            &UART0_READER,
            &FLASH,
            &STATUS,
        ];
        let watched = match radio {
            Radio::Present => watched.as_slice(),
            // The first one does not run.
            Radio::Absent => watched.get(1..).unwrap_or_default(),
        };
        tasks::supervise(shared, watched, &mut watchdog).await
    }

    #[embassy_executor::task]
    async fn reboot(shared: &'static Shared, link: &'static Link<'static>) {
        let restart = tasks::reboot_requested(shared, || link.is_idle()).await;
        board::restart(restart);
    }

    #[embassy_executor::task]
    async fn hash_program(shared: &'static Shared) {
        tasks::hash_program(board::program(), board::note_firmware, shared).await;
    }

    /// Starts everything, and serves USB from then on: the future of that lies where that of the start was. A task of its own
    /// would take 4.6 KB more.
    #[embassy_executor::main]
    async fn main(spawner: Spawner) {
        let (port, logs, shared) = start_all(spawner).await;
        board::name_this_task(UNWATCHED.name()).await;
        // The other tasks begin first.
        yield_now().await;
        let mut usb = pin!(usb(port, logs, shared));
        poll_fn(|context| poll_apart(usb.as_mut(), context)).await
    }

    /// Polls in a stack frame of its own. Inlined, the link that USB builds would add 5 KB to the stack of the start.
    #[inline(never)]
    fn poll_apart<F: Future>(future: Pin<&mut F>, context: &mut Context<'_>) -> Poll<F::Output> {
        future.poll(context)
    }

    /// Starts everything, in the order of the sections.
    async fn start_all(spawner: Spawner) -> (UsbPort, &'static BoardFlash, &'static Shared) {
        // The processor, and how it was started.
        board::guard_stack();
        let last_run = LastRun::take();
        let reset_reason = last_run.reset_reason;
        board::name_this_task("main").await;
        board::use_rom_floats();
        let mut parts = Parts::from(embassy_rp::init(Default::default()));
        let mut watchdog = BoardWatchdog::start(parts.watchdog);
        info!(
            "rover-battmon {}, started by {}",
            env!("CARGO_PKG_VERSION"),
            reset_reason
        );
        last_run.log();
        let kind = board::find_board(
            reset_reason,
            parts.analog.adc.reborrow(),
            parts.radio.select.reborrow(),
            parts.radio.clock.reborrow(),
        );
        let radio = kind.radio();
        info!("Wi-Fi radio: {}", radio);

        // Storage, and the core with what it has kept.
        let flash_driver = FLASH_DRIVER.init(board::flash_driver(parts.flash));
        let chip = FlashChip::read(flash_driver);
        if let Some(id) = chip.board_id {
            info!("board {}", id.serial_number().as_str());
        }
        let flash = BoardFlash::new(flash_driver);
        let mut storages = Storages::of_board(flash, radio);
        let mut stored = Start::default();
        let source = last_run.crashes_in_a_row.parameter_source();
        watchdog
            .feed_during(pin!(storages.boot(source, &mut stored)))
            .await;
        add_facts(&mut stored, &chip, last_run, radio);
        let shared = share(&stored);
        let wiring = shared.with(|autopilot| autopilot.wiring());
        let logs: &BoardFlash = LOGS.init(flash);
        let link = open_telemetry(shared, logs);

        // Tasks, with the parts that they take. Pins of sensors that no pack needs stay untouched, and some have two purposes.
        let mut radio_pins = None;
        match radio {
            Radio::Absent => parts.analog.gp29 = Some(parts.radio.clock),
            Radio::Present => radio_pins = Some(parts.radio),
        }
        let mut monitor_select = None;
        match wiring.serial.map(|setup| setup.driver_enable) {
            Some(DriverEnable::Gp22) => parts.serial.driver_enable = Some(parts.gp22),
            Some(DriverEnable::None) | None => monitor_select = Some(parts.gp22),
        }
        start_drive(spawner, parts.motors, parts.indicators, shared);
        let pins = AnalogInputs::new(parts.analog);
        let memory = board::retained_memory(reset_reason);
        start(spawner, BATTERY.name(), battery(pins, memory, shared));
        start_telemetry(spawner, parts.telemetry, &wiring, shared, link);
        let spi: &SharedSpi = SPI.init(SharedSpi::new(parts.spi));
        start_bus(spawner, parts.i2c, spi, monitor_select, &wiring, shared);
        let serial_port = wiring.serial.map(|setup| board::serial_uart(parts.serial, setup));
        start(spawner, SERIAL.name(), serial(serial_port, shared));
        start_can_or_pulses(spawner, parts.can, spi, &wiring, shared);
        start(
            spawner,
            FLASH.name(),
            self::flash(storages, flash, chip.board_id, shared),
        );
        if let Some(pins) = radio_pins {
            start(spawner, WIFI.name(), wifi(open_wifi(kind, pins), logs, shared));
        }
        start(spawner, STATUS.name(), status(shared, link));
        start(spawner, "reboot", reboot(shared, link));
        start(spawner, "program hash", hash_program(shared));
        start(spawner, "supervisor", supervisor(shared, watchdog, radio));
        (UsbPort::new(parts.usb, chip.board_id), logs, shared)
    }

    fn start_drive(
        spawner: Spawner,
        motors: MotorPeripherals,
        indicators: IndicatorParts,
        shared: &'static Shared,
    ) {
        let (buzzer, pio, lamps) = indicators;
        let motors = BoardMotors::new(motors);
        let (indicators, sounder) = board::indicators(buzzer, pio, lamps);
        start(spawner, DRIVE.name(), drive(motors, indicators, shared));
        start(spawner, "buzzer", self::buzzer(sounder));
    }

    fn start_telemetry(
        spawner: Spawner,
        uart: TelemetryUart,
        wiring: &Wiring,
        shared: &'static Shared,
        link: &'static Link<'static>,
    ) {
        let (transmitter, receiver) = board::telemetry_uart(uart, wiring.telemetry_baud);
        start(spawner, TELEMETRY.name(), telemetry(shared, link));
        start(
            spawner,
            UART0_WRITER.name(),
            uart0_writer(transmitter, shared, link),
        );
        start(spawner, UART0_READER.name(), uart0_reader(receiver, shared, link));
    }

    /// Sensors on I2C, and one on SPI.
    fn start_bus(
        spawner: Spawner,
        (i2c, sda, scl): I2cParts,
        spi: &'static SharedSpi,
        monitor_select: Option<Peri<'static, PIN_22>>,
        wiring: &Wiring,
        shared: &'static Shared,
    ) {
        let select = monitor_select.filter(|_| wiring.uses_spi_part);
        let buses = Buses {
            i2c: SensorI2c::new(i2c, sda, scl, wiring.i2c_clock_hz),
            spi: SensorSpi::new(spi, select.map(|pin| pin.into())),
        };
        start(spawner, BUS.name(), bus(buses, shared));
    }

    /// The CAN controller or, as its interrupt line is the same pin, the pulse input.
    fn start_can_or_pulses(
        spawner: Spawner,
        pins: CanPins,
        spi: &'static SharedSpi,
        wiring: &Wiring,
        shared: &'static Shared,
    ) {
        let interrupts = board::interrupt_spawner();
        let (mut can_bus, mut seen) = (None, None);
        match wiring.can {
            Some(timing) => {
                can_bus = Some(board::can_exchange());
                let controller = CanController::new(spi, pins, timing);
                start_in_interrupt(interrupts, "CAN controller", can_controller(controller));
            }
            None if wiring.uses_pulses => {
                seen = Some(&board::PULSES_SEEN);
                let pin = board::pulse_input(pins.interrupt);
                start_in_interrupt(interrupts, "pulse pin", pulse_pin(pin));
            }
            None => {}
        }
        start(spawner, CAN.name(), can(can_bus, shared));
        start(spawner, PULSES.name(), pulses(seen, shared));
    }

    /// Adds to what was stored what is known of the chip and the last run.
    fn add_facts(start: &mut Start, chip: &FlashChip, last_run: LastRun, radio: Radio) {
        start.radio = radio;
        start.flash_wear = chip.wear;
        start.identity.board_id = chip.board_id;
        start.run_end = last_run.end;
        start.has_crashed = last_run.has_crashed();
        start.crash = last_run.crash;
        start.program_code = board::program_code();
        start.radio_crashes = last_run.crashes_in_a_row.of_radio();
    }

    /// The peripherals and pins, by the part that takes them.
    struct Parts {
        watchdog: Peri<'static, WATCHDOG>,
        flash: Peri<'static, FLASH>,
        usb: Peri<'static, USB>,
        telemetry: TelemetryUart,
        /// Without GP29, which is a pin of the radio.
        analog: AnalogPeripherals,
        i2c: I2cParts,
        spi: SpiPeripherals,
        /// Without GP22.
        serial: SerialUart,
        /// Selects the power monitor on SPI, or switches the transceiver of the serial port.
        gp22: Peri<'static, PIN_22>,
        /// Its interrupt line is the pulse input as well.
        can: CanPins,
        motors: MotorPeripherals,
        indicators: IndicatorParts,
        radio: WifiPeripherals,
    }

    /// The peripheral, data and clock.
    type I2cParts = (Peri<'static, I2C1>, Peri<'static, PIN_14>, Peri<'static, PIN_15>);

    /// The buzzer, and what the lamps are on.
    type IndicatorParts = (Peri<'static, PIN_2>, Peri<'static, PIO1>, Peri<'static, PIN_16>);

    impl From<Peripherals> for Parts {
        fn from(peripherals: Peripherals) -> Self {
            Self {
                watchdog: peripherals.WATCHDOG,
                flash: peripherals.FLASH,
                usb: peripherals.USB,
                telemetry: TelemetryUart {
                    uart: peripherals.UART0,
                    tx_pin: peripherals.PIN_0,
                    rx_pin: peripherals.PIN_1,
                    tx_dma: peripherals.DMA_CH0,
                    rx_dma: (peripherals.DMA_CH8, peripherals.DMA_CH9),
                },
                analog: AnalogPeripherals {
                    adc: peripherals.ADC,
                    gp26: peripherals.PIN_26,
                    gp27: peripherals.PIN_27,
                    gp28: peripherals.PIN_28,
                    gp29: None,
                    dma: (peripherals.DMA_CH2, peripherals.DMA_CH3),
                },
                i2c: (peripherals.I2C1, peripherals.PIN_14, peripherals.PIN_15),
                spi: SpiPeripherals {
                    spi: peripherals.SPI1,
                    clock: peripherals.PIN_10,
                    to_part: peripherals.PIN_11,
                    from_part: peripherals.PIN_12,
                },
                serial: SerialUart {
                    uart: peripherals.UART1,
                    tx_pin: peripherals.PIN_4,
                    rx_pin: peripherals.PIN_5,
                    rx_dma: (peripherals.DMA_CH10, peripherals.DMA_CH11),
                    driver_enable: None,
                },
                gp22: peripherals.PIN_22,
                can: CanPins {
                    select: peripherals.PIN_13,
                    interrupt: peripherals.PIN_17,
                },
                motors: MotorPeripherals {
                    left_front: (peripherals.PWM_SLICE1, peripherals.PIN_18, peripherals.PIN_19),
                    left_rear: (peripherals.PWM_SLICE2, peripherals.PIN_21, peripherals.PIN_20),
                    right_rear: (peripherals.PWM_SLICE3, peripherals.PIN_7, peripherals.PIN_6),
                    right_front: (peripherals.PWM_SLICE4, peripherals.PIN_9, peripherals.PIN_8),
                },
                indicators: (peripherals.PIN_2, peripherals.PIO1, peripherals.PIN_16),
                radio: WifiPeripherals {
                    power: peripherals.PIN_23,
                    data: peripherals.PIN_24,
                    select: peripherals.PIN_25,
                    clock: peripherals.PIN_29,
                    pio: peripherals.PIO0,
                    dma: peripherals.DMA_CH1,
                },
            }
        }
    }

    // Built where they stay: on the stack of `main` they would take several times their size.
    #[inline(never)]
    fn share(start: &Start) -> &'static Shared {
        SHARED.init_with(|| Shared::new(start))
    }

    #[inline(never)]
    fn open_telemetry(shared: &Shared, logs: &'static BoardFlash) -> &'static Link<'static> {
        UART0.init_with(|| Link::of_board(LinkId::Uart0, shared).with_logs(logs))
    }

    #[inline(never)]
    fn open_wifi(kind: BoardKind, peripherals: WifiPeripherals) -> Wifi {
        Wifi::new(
            kind,
            peripherals,
            RADIO.init_with(cyw43::State::new),
            NETWORK.init_with(|| NetMemory::new(&board::RETAINED_LEASES)),
        )
    }

    /// A task that can't be started never checks in, so the watchdog restarts the board. A crash names it by `name`.
    fn start<S>(spawner: Spawner, name: &str, task: Result<SpawnToken<S>, SpawnError>) {
        match task {
            Ok(token) => {
                board::name_task(token.id(), name);
                spawner.spawn(token);
            }
            Err(error) => warn!("a task could not be started: {}", error),
        }
    }

    /// Starts a task that must not wait for the others.
    fn start_in_interrupt<S: Send>(
        spawner: SendSpawner,
        name: &str,
        task: Result<SpawnToken<S>, SpawnError>,
    ) {
        match task {
            Ok(token) => {
                board::name_task(token.id(), name);
                spawner.spawn(token);
            }
            Err(error) => warn!("a task could not be started: {}", error),
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "This is the firmware for the board. Flash a release's UF2 file, or type `cargo board` in a clone."
    );
    eprintln!("Without a board: the simulator, `cargo run` in a clone.");
    std::process::exit(2);
}
