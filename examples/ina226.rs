//! Watch one pack with an INA226 power monitor: voltage, current, and how much of the pack has been used.
//!
//! | Pico pin | to |
//! |---|---|
//! | GP14 (pin 19), GP15 (pin 20) | SDA and SCL of the INA226, with pull-ups to 3.3 V |
//! | 3V3 (pin 36) | its supply |
//! | GP0 (pin 1) | RX of a USB adapter, 115200 baud; a radio mostly has 57600 |
//! | GND | ground of all |
//!
//! Flash it with `cargo run --release --target thumbv6m-none-eabi --example ina226`. The same driver reads INA219, INA228,
//! INA231, INA238 and INA260; for another part on the bus name another `PartKind`.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use defmt_rtt as _;
    use embassy_executor::Spawner;
    use embassy_time::{Duration, Ticker};
    use panic_probe as _;
    use rover_battmon::battery::{BatteryMonitor, BatteryState, LoadState, Tick};
    use rover_battmon::board::{self, SensorI2c, TelemetryUart};
    use rover_battmon::mavlink::LinkKind;
    use rover_battmon::pack::Pack;
    use rover_battmon::parameter::{BatteryParameter, MonitorKind, Parameters, PartKind};
    use rover_battmon::sensor::{BusDevices, Buses, bus_clock_hz};
    use rover_battmon::system::SystemState;
    use rover_battmon::tasks::{WiredEndpoint, now};
    use rover_battmon::vehicle::ArmState;

    const BAUD: u32 = 115_200;

    /// How the pack is measured and what it is: the parameters `BATT_MONITOR`, `BATT_SHUNT` and so on.
    const PACK: [(BatteryParameter, f32); 4] = [
        (
            BatteryParameter::Monitor,
            MonitorKind::Bus(PartKind::Ina2xx).number() as f32,
        ),
        // The resistor between the pack and its load, in ohms.
        (BatteryParameter::Shunt, 0.002),
        (BatteryParameter::Cells, 3.0),
        (BatteryParameter::Capacity, 2200.0),
    ];

    /// As often as the part has a new mean of its conversions.
    const INTERVAL: Duration = Duration::from_millis(25);

    #[embassy_executor::main]
    async fn main(_spawner: Spawner) {
        let chip = embassy_rp::init(Default::default());
        let mut parameters = Parameters::defaults();
        for (parameter, value) in PACK {
            let _ = parameters.set(parameter.of(Pack::First), value);
        }
        let clock_hz = bus_clock_hz(&parameters);
        let mut bus = Buses::i2c(SensorI2c::new(chip.I2C1, chip.PIN_14, chip.PIN_15, clock_hz));
        let parts = TelemetryUart {
            uart: chip.UART0,
            tx_pin: chip.PIN_0,
            rx_pin: chip.PIN_1,
            tx_dma: chip.DMA_CH0,
            rx_dma: (chip.DMA_CH8, chip.DMA_CH9),
        };
        let (transmitter, _receiver) = board::telemetry_uart(parts, BAUD);

        let start = now();
        let mut parts = BusDevices::from_parameters(&parameters, start);
        let settings = parameters.pack(Pack::First).settings();
        let mut monitor = BatteryMonitor::new();
        let mut battery = BatteryState::default();
        let mut link = WiredEndpoint::new(LinkKind::Radio, BAUD / 10, transmitter, start);
        let mut ticker = Ticker::every(INTERVAL);

        loop {
            // Read the part, update the pack's state, and announce its events. A part that does not answer is polled less often.
            let tick = Tick {
                now: now(),
                // Failsafes count while there may be a load, and nothing here shows when it is off.
                load_state: LoadState::On,
            };
            let judge = |_, reading| {
                let update = monitor.update(&mut battery, tick, reading, &settings);
                link.announce(Pack::First, &update.events);
            };
            parts.read_next(&mut bus, tick.now, ArmState::Armed, judge).await;

            // Report what is due.
            let batteries = [battery];
            let state = SystemState {
                batteries: &batteries,
                ..SystemState::default()
            };
            let _ = link.send_due(tick.now, &state, &parameters).await;
            ticker.next().await;
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This is firmware for the board: see the first lines of examples/ina226.rs.");
    std::process::exit(2);
}
