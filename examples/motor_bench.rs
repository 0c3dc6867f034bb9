//! Firmware that shows what motors, lamps and buzzer can do, one after the other, and then panics.
//!
//! `tests/firmware/motors.rs` runs it on the emulated RP2040. On the board, put the wheels up first.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use defmt_rtt as _;
    use embassy_executor::Spawner;
    use embassy_time::Timer;
    use panic_probe as _;
    use rover_battmon::board::{self, BoardMotors, Buzzer, MotorPeripherals};
    use rover_battmon::vehicle::{Colour, Indication, Indicators, MotorDrive, Motors, SideDrives, Tone};

    /// The tests look once within each step.
    const STEP_MS: u64 = 20;

    /// Something not to do to the rover, but to this firmware.
    const FULL_SPIN: SideDrives = SideDrives {
        left: MotorDrive::Turn(1.0),
        right: MotorDrive::Turn(-1.0),
    };

    const DRIVES: [(&str, SideDrives); 7] = [
        ("coast", SideDrives::COAST),
        ("brake", SideDrives::BRAKE),
        ("ahead 50 %", both_sides(0.5)),
        ("back 25 %", both_sides(-0.25)),
        ("full spin", FULL_SPIN),
        (
            "out of range",
            SideDrives {
                left: MotorDrive::Turn(f32::INFINITY),
                right: MotorDrive::Turn(f32::NAN),
            },
        ),
        ("coast again", SideDrives::COAST),
    ];

    const COLOURS: [(&str, Colour); 5] = [
        ("red", Colour::Red),
        ("green", Colour::Green),
        ("blue", Colour::Blue),
        ("yellow", Colour::Yellow),
        ("off", Colour::Off),
    ];

    const fn both_sides(share: f32) -> SideDrives {
        SideDrives {
            left: MotorDrive::Turn(share),
            right: MotorDrive::Turn(share),
        }
    }

    #[embassy_executor::task]
    async fn buzzer(mut buzzer: Buzzer) -> ! {
        buzzer.run().await
    }

    async fn step(name: &str) {
        defmt::info!("{=str}", name);
        Timer::after_millis(STEP_MS).await;
    }

    #[embassy_executor::main]
    async fn main(spawner: Spawner) {
        let peripherals = embassy_rp::init(Default::default());
        step("nothing yet").await;
        let mut motors = BoardMotors::new(MotorPeripherals {
            left_front: (peripherals.PWM_SLICE1, peripherals.PIN_18, peripherals.PIN_19),
            left_rear: (peripherals.PWM_SLICE2, peripherals.PIN_21, peripherals.PIN_20),
            right_rear: (peripherals.PWM_SLICE3, peripherals.PIN_7, peripherals.PIN_6),
            right_front: (peripherals.PWM_SLICE4, peripherals.PIN_9, peripherals.PIN_8),
        });
        let (mut indicators, sounder) =
            board::indicators(peripherals.PIN_2, peripherals.PIO1, peripherals.PIN_16);
        spawner.spawn(buzzer(sounder).expect("it is the only one"));

        for (name, drives) in DRIVES {
            motors.drive(drives);
            step(name).await;
        }
        for (name, colour) in COLOURS {
            indicators.show(Indication {
                colour,
                tone: Tone::Silent,
            });
            step(name).await;
        }
        for (name, colour, tone) in [
            ("tone", Colour::Off, Tone::Sounding),
            ("green tone", Colour::Green, Tone::Sounding),
            ("silence", Colour::Green, Tone::Silent),
        ] {
            indicators.show(Indication { colour, tone });
            step(name).await;
        }
        motors.drive(FULL_SPIN);
        step("spin until it panics").await;
        panic!("as announced");
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "This is firmware for the board. `cargo test --test firmware motors` runs it on the emulated one."
    );
    std::process::exit(2);
}
