//! Two packs on one Pico, each with settings of its own: a drive pack with a current sensor, and an electronics pack.
//!
//! | Pico pin | to |
//! |---|---|
//! | GP26 (pin 31) | the divider of the drive pack |
//! | GP27 (pin 32) | the current sensor of the drive pack |
//! | GP28 (pin 34) | the divider of the electronics pack |
//! | GP0 (pin 1) | RX of a USB adapter, 115200 baud; a radio mostly has 57600 |
//! | GND | ground of all |
//!
//! Flash it with `cargo run --release --target thumbv6m-none-eabi --example two_packs`. A ground station shows them as
//! battery 1 and battery 2.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use defmt_rtt as _;
    use embassy_executor::Spawner;
    use embassy_time::{Duration, Ticker};
    use panic_probe as _;
    use rover_battmon::battery::{
        BatteryMonitor, BatteryState, Chemistry, FailsafeSettings, LoadState, Measurement, PackSettings,
        ReadError, Thresholds, Tick,
    };
    use rover_battmon::board::{self, AnalogInputs, AnalogPeripherals, TelemetryUart};
    use rover_battmon::mavlink::LinkKind;
    use rover_battmon::pack::Pack;
    use rover_battmon::parameter::Parameters;
    use rover_battmon::sensor::{
        AnalogIn, AnalogPin, AnalogReadings, CurrentSensor, VoltageDivider, WantedReadings,
    };
    use rover_battmon::system::SystemState;
    use rover_battmon::tasks::{WiredEndpoint, now};

    const BAUD: u32 = 115_200;

    /// 10 readings a second.
    const INTERVAL: Duration = Duration::from_millis(100);

    /// A pack's wiring, its settings, and its state.
    struct MonitoredPack {
        voltage_pin: AnalogPin,
        divider: VoltageDivider,
        current: Option<(AnalogPin, CurrentSensor)>,
        settings: PackSettings,
        monitor: BatteryMonitor,
        state: BatteryState,
    }

    /// Three LiPo cells with a sensor of 20 A for each volt.
    fn drive_pack() -> MonitoredPack {
        MonitoredPack {
            voltage_pin: AnalogPin::Gp26,
            divider: VoltageDivider {
                multiplier: 4.0,
                offset_v: 0.0,
            },
            current: Some((
                AnalogPin::Gp27,
                CurrentSensor {
                    amperes_per_volt: 20.0,
                    offset_v: 0.0,
                },
            )),
            settings: PackSettings {
                chemistry: Chemistry::LiPo,
                cell_count: Some(3),
                capacity_mah: Some(2200.0),
                failsafe: low_below(10.5),
                ..PackSettings::default()
            },
            monitor: BatteryMonitor::new(),
            state: BatteryState::default(),
        }
    }

    /// Two 18650 cells.
    fn electronics_pack() -> MonitoredPack {
        MonitoredPack {
            voltage_pin: AnalogPin::Gp28,
            divider: VoltageDivider {
                multiplier: 3.0,
                offset_v: 0.0,
            },
            current: None,
            settings: PackSettings {
                chemistry: Chemistry::LiIon,
                cell_count: Some(2),
                failsafe: low_below(6.4),
                ..PackSettings::default()
            },
            monitor: BatteryMonitor::new(),
            state: BatteryState::default(),
        }
    }

    /// A pack is low once its voltage was below this for 10 s.
    fn low_below(voltage_v: f32) -> FailsafeSettings {
        FailsafeSettings {
            timer_s: Some(10.0),
            low: Thresholds {
                voltage_v: Some(voltage_v),
                ..Thresholds::default()
            },
            ..FailsafeSettings::default()
        }
    }

    #[embassy_executor::main]
    async fn main(_spawner: Spawner) {
        let chip = embassy_rp::init(Default::default());
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

        let mut packs = [drive_pack(), electronics_pack()];
        // The defaults have HEARTBEAT sent once a second, SYS_STATUS and each BATTERY_STATUS twice.
        let parameters = Parameters::defaults();
        let mut link = WiredEndpoint::new(LinkKind::Radio, BAUD / 10, transmitter, now());
        let mut wanted = WantedReadings::NONE;
        for pack in &packs {
            wanted.add(pack.voltage_pin);
            if let Some((pin, _)) = pack.current {
                wanted.add(pin);
            }
        }
        let mut ticker = Ticker::every(INTERVAL);

        loop {
            // Measure each pack by what was converted since the last reading, update its state by its own settings, and
            // announce its events.
            ticker.next().await;
            let now = now();
            let readings = pins.read(now, wanted);
            for (instance, pack) in Pack::ALL.into_iter().zip(&mut packs) {
                let reading = measure(pack, &readings);
                let tick = Tick {
                    now,
                    // Failsafes count while there may be a load, and nothing here shows when it is off.
                    load_state: LoadState::On,
                };
                let update = pack
                    .monitor
                    .update(&mut pack.state, tick, reading, &pack.settings);
                link.announce(instance, &update.events);
            }

            // Report what is due: the instance of a BATTERY_STATUS is the pack's place here.
            let batteries = packs.each_ref().map(|pack| pack.state);
            let state = SystemState {
                batteries: &batteries,
                ..SystemState::default()
            };
            let _ = link.send_due(now, &state, &parameters).await;
        }
    }

    fn measure(pack: &MonitoredPack, readings: &AnalogReadings) -> Result<Measurement, ReadError> {
        let pin_v = |pin| {
            let conversions = readings.pin(pin);
            conversions.map(|conversions| conversions.mean().pin_voltage_v())
        };
        let mut measurement = Measurement {
            voltage_v: Some(pack.divider.pack_voltage_v(pin_v(pack.voltage_pin)?)),
            ..Measurement::default()
        };
        if let Some((pin, sensor)) = &pack.current {
            measurement.current_a = Some(sensor.current_a(pin_v(*pin)?));
        }
        Ok(measurement)
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This is firmware for the board: see the first lines of examples/two_packs.rs.");
    std::process::exit(2);
}
