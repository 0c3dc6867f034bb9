//! Drive the rover from a ground station's gamepad: the smallest complete firmware, with the pins of the Freenove board.
//!
//! No flash, no tasks: one loop that listens, obeys, measures the pack at GP26 and reports it at the rate `SR0_EXTRA1`. Nothing
//! acts on a low pack here. Flash it with
//! `cargo run --release --target thumbv6m-none-eabi --example mavlink_rc_control`, wheels up the first time. Then, in a ground
//! station on the telemetry port: arm, choose the mode MANUAL, and move the sticks (MANUAL_CONTROL or
//! RC_CHANNELS_OVERRIDE), which have to be centred once before they drive. When the link is silent for 1.5 s, the rover brakes.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use defmt_rtt as _;
    use embassy_executor::Spawner;
    use embassy_time::{Duration, with_timeout};
    use panic_probe as _;
    use rover_battmon::battery::{BatteryMonitor, BatteryState, Measurement, ReadError, Tick};
    use rover_battmon::board::{
        self, AnalogInputs, AnalogPeripherals, BoardMotors, BoardWatchdog, MotorPeripherals, TelemetryUart,
    };
    use rover_battmon::mavlink::{Changeable, LinkKind, Signing};
    use rover_battmon::pack::Pack;
    use rover_battmon::parameter::{Parameters, VehicleParameter};
    use rover_battmon::sensor::{AnalogIn, AnalogPin, AnalogWiring, WantedReadings};
    use rover_battmon::system::SystemState;
    use rover_battmon::tasks::{ByteSource, Watchdog, WiredEndpoint, now};
    use rover_battmon::time::{Cadence, Instant};
    use rover_battmon::vehicle::{Motors, Vehicle, VehicleSettings};
    use rover_battmon::wifi::WifiCredentials;

    const BAUD: u32 = 115_200;

    /// So long it listens before it looks after the motors again.
    const LISTEN: Duration = Duration::from_millis(20);

    /// 10 readings a second.
    const READING_INTERVAL_US: u64 = 100_000;

    #[embassy_executor::main]
    async fn main(_spawner: Spawner) {
        let chip = embassy_rp::init(Default::default());
        // A firmware that hangs must not leave the motors turning.
        let mut watchdog = BoardWatchdog::start(chip.WATCHDOG);
        let mut motors = BoardMotors::new(MotorPeripherals {
            left_front: (chip.PWM_SLICE1, chip.PIN_18, chip.PIN_19),
            left_rear: (chip.PWM_SLICE2, chip.PIN_21, chip.PIN_20),
            right_rear: (chip.PWM_SLICE3, chip.PIN_7, chip.PIN_6),
            right_front: (chip.PWM_SLICE4, chip.PIN_9, chip.PIN_8),
        });
        let parts = TelemetryUart {
            uart: chip.UART0,
            tx_pin: chip.PIN_0,
            rx_pin: chip.PIN_1,
            tx_dma: chip.DMA_CH0,
            rx_dma: (chip.DMA_CH8, chip.DMA_CH9),
        };
        let (transmitter, mut receiver) = board::telemetry_uart(parts, BAUD);

        let mut pins = AnalogInputs::new(AnalogPeripherals {
            adc: chip.ADC,
            gp26: chip.PIN_26,
            gp27: chip.PIN_27,
            gp28: chip.PIN_28,
            gp29: Some(chip.PIN_29),
            dma: (chip.DMA_CH2, chip.DMA_CH3),
        });

        // The defaults have HEARTBEAT sent once a second, SYS_STATUS and BATTERY_STATUS twice.
        let mut parameters = Parameters::defaults();
        // No pack is too low to drive with here.
        let _ = parameters.set(VehicleParameter::ArmingCheck, 0.0);
        let mut monitor = BatteryMonitor::new();
        let mut battery = BatteryState::default();
        let mut readings = Cadence::starting_at(now().after_us(READING_INTERVAL_US), READING_INTERVAL_US);
        let mut vehicle = Vehicle::new();
        let mut wifi = WifiCredentials::absent();
        let mut link = WiredEndpoint::new(LinkKind::Radio, BAUD / 10, transmitter, now());
        // No key is set: every sender may drive.
        let mut signing = Signing::off();
        let mut bytes = [0; 64];

        loop {
            // Receive requests and stick input of ground stations.
            let received = match with_timeout(LISTEN, receiver.receive(&mut bytes)).await {
                Ok(Ok(count)) => bytes.get(..count).unwrap_or(&[]),
                Ok(Err(_)) | Err(_) => &[],
            };
            let now = now();
            // 64 bytes at most, less than it has room for once everything before them was handled.
            link.endpoint.push(received);
            let batteries = [battery];
            let state = state_of(&vehicle, &batteries);
            while link
                .endpoint
                .handle_next(
                    now,
                    now,
                    &state,
                    Changeable {
                        command: &mut None,
                        parameters: &mut parameters,
                        vehicle: &mut vehicle,
                        signing: &mut signing,
                        wifi: &mut wifi,
                    },
                )
                .is_some()
            {}

            // Follow the stick input, or stop when it times out.
            let _ = vehicle.update(now, &VehicleSettings::from_parameters(&parameters));
            motors.drive(vehicle.drives());

            // Measure the pack, update its state, and announce its events.
            if readings.take(now) {
                let reading = measure(&mut pins, now, &parameters);
                let tick = Tick {
                    now,
                    load_state: vehicle.arm_state().into(),
                };
                let settings = parameters.pack(Pack::First).settings();
                let update = monitor.update(&mut battery, tick, reading, &settings);
                link.announce(Pack::First, &update.events);
            }

            // Report what is due: HEARTBEAT, SYS_STATUS, BATTERY_STATUS, acknowledgements, parameters.
            let batteries = [battery];
            let state = state_of(&vehicle, &batteries);
            let _ = link.send_due(now, &state, &parameters).await;
            watchdog.feed(vehicle.arm_state());
        }
    }

    /// The mean of what was converted since the last reading.
    fn measure(
        pins: &mut AnalogInputs,
        now: Instant,
        parameters: &Parameters,
    ) -> Result<Measurement, ReadError> {
        let divider = AnalogWiring::from_parameters(parameters.pack(Pack::First)).divider;
        let conversions = pins
            .read(now, WantedReadings::of(AnalogPin::Gp26))
            .pin(AnalogPin::Gp26)?;
        Ok(Measurement {
            voltage_v: Some(divider.pack_voltage_v(conversions.mean().pin_voltage_v())),
            ..Measurement::default()
        })
    }

    fn state_of<'a>(vehicle: &Vehicle, batteries: &'a [BatteryState]) -> SystemState<'a> {
        SystemState {
            vehicle: vehicle.status(),
            batteries,
            ..SystemState::default()
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This is firmware for the board: see the first lines of examples/mavlink_rc_control.rs.");
    std::process::exit(2);
}
