//! Firmware that reads a power monitor on I2C1 (SDA GP14, SCL GP15), and a device that is not there.
//!
//! `tests/firmware/i2c.rs` runs it on the emulated RP2040.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use defmt_rtt as _;
    use embassy_executor::Spawner;
    use embassy_rp::Peri;
    use embassy_rp::bind_interrupts;
    use embassy_rp::gpio::{Level, OutputOpenDrain};
    use embassy_rp::i2c::{Async, Config, Error, I2c, InterruptHandler};
    use embassy_rp::peripherals::{I2C1, PIN_14, PIN_15};
    use embassy_time::{Duration, TimeoutError, Timer, with_timeout};
    use panic_probe as _;
    // The executor's trace hooks are in it.
    use rover_battmon as _;

    bind_interrupts!(struct Irqs {
        I2C1_IRQ => InterruptHandler<I2C1>;
    });

    const FREQUENCY_HZ: u32 = 400_000;
    const INA226: u8 = 0x40;
    const NOBODY: u8 = 0x41;
    const MANUFACTURER_ID: u8 = 0xfe;
    const BUS_VOLTAGE: u8 = 0x02;
    const PAUSE: Duration = Duration::from_millis(10);
    /// A transfer takes a tenth of a millisecond.
    const TIME_OUT: Duration = Duration::from_millis(5);
    /// A device that waits for the rest of a byte lets go of SDA within so many clocks.
    const RECOVERY_CLOCKS: usize = 9;
    const HALF_CLOCK: Duration = Duration::from_micros(5);

    type Bus<'d> = I2c<'d, I2C1, Async>;

    struct Peripherals {
        i2c: Peri<'static, I2C1>,
        sda: Peri<'static, PIN_14>,
        scl: Peri<'static, PIN_15>,
    }

    impl Peripherals {
        fn bus(&mut self) -> Bus<'_> {
            let mut config = Config::default();
            config.frequency = FREQUENCY_HZ;
            let (i2c, scl, sda) = (self.i2c.reborrow(), self.scl.reborrow(), self.sda.reborrow());
            I2c::new_async(i2c, scl, sda, Irqs, config)
        }

        /// Clocks until nobody holds SDA, then a STOP.
        async fn free_bus(&mut self) {
            let mut scl = OutputOpenDrain::new(self.scl.reborrow(), Level::High);
            let mut sda = OutputOpenDrain::new(self.sda.reborrow(), Level::High);
            for _ in 0..RECOVERY_CLOCKS {
                if sda.is_high() {
                    break;
                }
                scl.set_low();
                Timer::after(HALF_CLOCK).await;
                scl.set_high();
                Timer::after(HALF_CLOCK).await;
            }
            sda.set_low();
            Timer::after(HALF_CLOCK).await;
            sda.set_high();
            Timer::after(HALF_CLOCK).await;
        }
    }

    async fn read(bus: &mut Bus<'_>, address: u8, register: u8) -> Result<Result<u16, Error>, TimeoutError> {
        let mut bytes = [0; 2];
        let transfer = bus.write_read_async(address, [register], &mut bytes);
        let result = with_timeout(TIME_OUT, transfer).await?;
        Ok(result.map(|()| u16::from_be_bytes(bytes)))
    }

    async fn read_and_log(bus: &mut Bus<'_>) -> Result<(), TimeoutError> {
        match read(bus, INA226, MANUFACTURER_ID).await? {
            Ok(id) => defmt::info!("manufacturer {=u16:#x}", id),
            Err(error) => defmt::info!("no manufacturer: {}", error),
        }
        match read(bus, NOBODY, MANUFACTURER_ID).await? {
            Ok(id) => defmt::info!("nobody answered {=u16:#x}", id),
            Err(error) => defmt::info!("nobody: {}", error),
        }
        match read(bus, INA226, BUS_VOLTAGE).await? {
            Ok(code) => defmt::info!("bus {=u32} uV", u32::from(code) * 1250),
            Err(error) => defmt::info!("no bus voltage: {}", error),
        }
        Ok(())
    }

    #[embassy_executor::main]
    async fn main(_spawner: Spawner) {
        let peripherals = embassy_rp::init(Default::default());
        let mut peripherals = Peripherals {
            i2c: peripherals.I2C1,
            sda: peripherals.PIN_14,
            scl: peripherals.PIN_15,
        };
        loop {
            // A transfer that was given up leaves the block in the middle of it: a new driver resets it.
            let mut bus = peripherals.bus();
            while read_and_log(&mut bus).await.is_ok() {
                Timer::after(PAUSE).await;
            }
            defmt::info!("time-out");
            peripherals.free_bus().await;
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "This is firmware for the board. `cargo test --test firmware i2c` runs it on the emulated one."
    );
    std::process::exit(2);
}
