//! Firmware for a bare RP2040 board: an INA226 on I2C0 measures the pack, and a ground station on UART0 shows it.

#![no_std]
#![no_main]

use defmt_rtt as _;
use embassy_executor::Spawner;
use embassy_rp::i2c::{self, AbortReason, I2c};
use embassy_rp::peripherals::{I2C0, PIN_4, PIN_5, UART0};
use embassy_rp::uart::{self, BufferedInterruptHandler, BufferedUartTx};
use embassy_rp::{Peri, bind_interrupts};
use embassy_time::{Duration, Ticker, with_timeout};
use embedded_hal_async::i2c::{I2c as _, Operation};
use panic_probe as _;
use rover_battmon::battery::{BatteryMonitor, BatteryState, BusError, LoadState, Tick};
use rover_battmon::mavlink::LinkKind;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{BatteryParameter, MonitorKind, Parameters, PartKind};
use rover_battmon::sensor::{BusDevices, Buses, I2cBus, bus_clock_hz};
use rover_battmon::system::SystemState;
use rover_battmon::tasks::{WiredEndpoint, now};
use rover_battmon::vehicle::ArmState;
use static_cell::ConstStaticCell;

bind_interrupts!(struct Irqs {
    I2C0_IRQ => i2c::InterruptHandler<I2C0>;
    UART0_IRQ => BufferedInterruptHandler<UART0>;
});

const BAUD: u32 = 115_200;

/// How the pack is measured and what it is: the parameters `BATT_MONITOR`, `BATT_SHUNT` and so on.
const PACK: [(BatteryParameter, f32); 4] = [
    (BatteryParameter::Monitor, MonitorKind::Bus(PartKind::Ina2xx).number() as f32),
    // The resistor between the pack and its load, in ohms.
    (BatteryParameter::Shunt, 0.002),
    (BatteryParameter::Cells, 3.0),
    (BatteryParameter::Capacity, 2200.0),
];

/// The load counts as switched off after this long without a current: then a current into the pack is a charge, and another one
/// may be put in. A product with a switch reads that instead, at a pin.
const SWITCHED_OFF_AFTER_US: u64 = 60_000_000;

/// What is drawn without the load is less, in amperes.
const LEAST_LOAD_A: f32 = 0.1;

/// As often as the part has a new mean of its conversions.
const INTERVAL: Duration = Duration::from_millis(25);

/// A part may hold the clock for this long (SMBus); embassy-rp waits for it without an end.
const TRANSFER_TIMEOUT: Duration = Duration::from_millis(35);

static TRANSMIT_BUFFER: ConstStaticCell<[u8; 512]> = ConstStaticCell::new([0; 512]);

/// The bus of the INA226. An abandoned transfer leaves the peripheral in the middle of it, so each sets it up again.
struct PackBus {
    i2c: Peri<'static, I2C0>,
    sda: Peri<'static, PIN_4>,
    scl: Peri<'static, PIN_5>,
    config: i2c::Config,
}

impl I2cBus for PackBus {
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        let (i2c, scl, sda) = (self.i2c.reborrow(), self.scl.reborrow(), self.sda.reborrow());
        let mut driver = I2c::new_async(i2c, scl, sda, Irqs, self.config);
        match with_timeout(TRANSFER_TIMEOUT, driver.transaction(address, operations)).await {
            Ok(result) => result.map_err(|error| match error {
                i2c::Error::Abort(AbortReason::NoAcknowledge) => BusError::NoAnswer,
                _ => BusError::Transfer,
            }),
            Err(_) => Err(BusError::Timeout),
        }
    }
}

#[embassy_executor::main]
async fn main(_spawner: Spawner) {
    let chip = embassy_rp::init(Default::default());
    let mut parameters = Parameters::defaults();
    for (parameter, value) in PACK {
        // A refused value would leave the default in its place, and so measure with another shunt.
        if parameters.set(parameter.of(Pack::First), value).is_err() {
            defmt::panic!("{} can't be {}", parameter, value);
        }
    }

    let mut config = i2c::Config::default();
    config.frequency = bus_clock_hz(&parameters);
    let mut bus = Buses::i2c(PackBus {
        i2c: chip.I2C0,
        sda: chip.PIN_4,
        scl: chip.PIN_5,
        config,
    });

    let mut uart_config = uart::Config::default();
    uart_config.baudrate = BAUD;
    let transmitter = BufferedUartTx::new(chip.UART0, Irqs, chip.PIN_0, TRANSMIT_BUFFER.take(), uart_config);

    let start = now();
    let mut parts = BusDevices::from_parameters(&parameters, start);
    let settings = parameters.pack(Pack::First).settings();
    let mut monitor = BatteryMonitor::new();
    let mut battery = BatteryState::default();
    let mut link = WiredEndpoint::new(LinkKind::Radio, BAUD / 10, transmitter, start);
    let mut ticker = Ticker::every(INTERVAL);
    let mut loaded_at = start;

    loop {
        // Measure, and announce what happened to the pack. While its current is unknown there may be a load.
        let now = now();
        if battery.readings.current_a.is_none_or(|current_a| current_a > LEAST_LOAD_A) {
            loaded_at = now;
        }
        let (load_state, arm_state) = match now.us_since(loaded_at) {
            ..SWITCHED_OFF_AFTER_US => (LoadState::On, ArmState::Armed),
            _ => (LoadState::Off, ArmState::Disarmed),
        };
        let tick = Tick { now, load_state };
        let mut update = |pack: Pack, reading| {
            let update = monitor.update(&mut battery, tick, reading, &settings);
            link.announce(pack, &update.events);
        };
        parts.read_next(&mut bus, now, arm_state, &mut update).await;

        // Send what is due: HEARTBEAT once a second, SYS_STATUS and BATTERY_STATUS twice.
        let batteries = [battery];
        let state = SystemState {
            batteries: &batteries,
            ..SystemState::default()
        };
        let _ = link.send_due(tick.now, &state, &parameters).await;
        ticker.next().await;
    }
}
