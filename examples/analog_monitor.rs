//! Watch one pack with a bare Raspberry Pi Pico and two resistors: from the converter to a ground station.
//!
//! | Pico pin | to |
//! |---|---|
//! | GP26 (pin 31) | the middle of a divider across the pack: 30 kΩ to plus, 10 kΩ to ground; up to 13 V, three LiPo cells |
//! | GP0 (pin 1) | RX of a USB adapter, 115200 baud; a radio mostly has 57600 |
//! | GND | ground of both |
//!
//! Flash it with `cargo run --release --target thumbv6m-none-eabi --example analog_monitor`. The Pico's own LED is lit while
//! the pack is fine (a Pico W's is not at GP25, and stays dark). The remaining charge is known after half a minute: the load is not measured, so the highest voltage
//! until then is taken for the one at rest. It only speaks: a ground station shows the battery, and finds no parameters to set.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use defmt_rtt as _;
    use embassy_executor::Spawner;
    use embassy_rp::gpio::{Level, Output};
    use embassy_time::{Duration, Ticker};
    use panic_probe as _;
    use rover_battmon::battery::{
        BatteryMonitor, BatteryState, ChargeState, FailsafeSettings, LoadState, Measurement, PackSettings,
        Thresholds, Tick,
    };
    use rover_battmon::board::{self, AnalogInputs, AnalogPeripherals, TelemetryUart};
    use rover_battmon::mavlink::LinkKind;
    use rover_battmon::pack::Pack;
    use rover_battmon::parameter::Parameters;
    use rover_battmon::sensor::{AnalogIn, AnalogPin, VoltageDivider, WantedReadings};
    use rover_battmon::system::SystemState;
    use rover_battmon::tasks::{WiredEndpoint, now};

    const BAUD: u32 = 115_200;

    /// (30 kΩ + 10 kΩ) / 10 kΩ; compare with a multimeter.
    const DIVIDER: VoltageDivider = VoltageDivider {
        multiplier: 4.0,
        offset_v: 0.0,
    };

    /// 10 readings a second.
    const INTERVAL: Duration = Duration::from_millis(100);

    #[embassy_executor::main]
    async fn main(_spawner: Spawner) {
        let chip = embassy_rp::init(Default::default());
        let mut led = Output::new(chip.PIN_25, Level::Low);
        let mut pins = AnalogInputs::new(AnalogPeripherals {
            adc: chip.ADC,
            gp26: chip.PIN_26,
            gp27: chip.PIN_27,
            gp28: chip.PIN_28,
            gp29: Some(chip.PIN_29),
            dma: (chip.DMA_CH2, chip.DMA_CH3),
        });
        let parts = TelemetryUart {
            uart: chip.UART0,
            tx_pin: chip.PIN_0,
            rx_pin: chip.PIN_1,
            tx_dma: chip.DMA_CH0,
            rx_dma: (chip.DMA_CH8, chip.DMA_CH9),
        };
        let (transmitter, _receiver) = board::telemetry_uart(parts, BAUD);

        // A LiPo pack of three cells that is low once it was below 10.5 V for 10 s.
        let settings = PackSettings {
            cell_count: Some(3),
            failsafe: FailsafeSettings {
                timer_s: Some(10.0),
                low: Thresholds {
                    voltage_v: Some(10.5),
                    ..Thresholds::default()
                },
                ..FailsafeSettings::default()
            },
            ..PackSettings::default()
        };
        let mut monitor = BatteryMonitor::new();
        let mut battery = BatteryState::default();
        // The defaults have HEARTBEAT sent once a second, SYS_STATUS and BATTERY_STATUS twice.
        let parameters = Parameters::defaults();
        let mut link = WiredEndpoint::new(LinkKind::Radio, BAUD / 10, transmitter, now());
        let mut ticker = Ticker::every(INTERVAL);

        loop {
            // Measure: the mean of what was converted since the last reading.
            ticker.next().await;
            let now = now();
            let conversions = pins
                .read(now, WantedReadings::of(AnalogPin::Gp26))
                .pin(AnalogPin::Gp26);
            let reading = conversions.map(|conversions| Measurement {
                voltage_v: Some(DIVIDER.pack_voltage_v(conversions.mean().pin_voltage_v())),
                ..Measurement::default()
            });

            // Update the pack's state, and announce its events.
            let tick = Tick {
                now,
                // Failsafes count while there may be a load, and nothing here shows when it is off.
                load_state: LoadState::On,
            };
            let update = monitor.update(&mut battery, tick, reading, &settings);
            link.announce(Pack::First, &update.events);
            led.set_level((battery.charge_state == ChargeState::Ok).into());

            // Report what is due.
            let batteries = [battery];
            let state = SystemState {
                batteries: &batteries,
                ..SystemState::default()
            };
            let _ = link.send_due(now, &state, &parameters).await;
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This is firmware for the board: see the first lines of examples/analog_monitor.rs.");
    std::process::exit(2);
}
