//! The four motors and their drivers.

use embassy_rp::pac::pwm::Channel;
use embassy_rp::pac::{IO_BANK0, PWM, SIO};
use embassy_rp::pwm::{ChannelAPin, ChannelBPin, Config, Pwm, Slice};
use embassy_rp::{Peri, peripherals};

use crate::vehicle::{MotorDrive, Motors, SideDrives};

/// 125 MHz divided by this and by the counts of a period: 500 Hz, as in the vendor's sketches.
const DIVIDER: u8 = 4;
const PERIOD_COUNTS: u16 = 62_500;

/// Counters of the motors when their slices begin. A quarter of a period apart, and half a period on each side, the pack never
/// sees more motors switched on at a time than their duty asks for: its ripple is a quarter of that of motors in step.
const LEFT_COUNTS: [u16; 2] = [0, PERIOD_COUNTS / 2];
const RIGHT_COUNTS: [u16; 2] = [PERIOD_COUNTS / 4, PERIOD_COUNTS / 4 * 3];

/// A compare level above the counter's top is high all the time.
const ALWAYS: u16 = PERIOD_COUNTS;
const NEVER: u16 = 0;

/// The inputs of the motors' drivers, GP6 to GP9 and GP18 to GP21, as the processor's bits.
const PINS: u32 = 0b1111 << 18 | 0b1111 << 6;

/// IO_BANK0's number for the function "driven by the processor".
const FUNCTION_SIO: u8 = 5;

/// Peripherals of each motor: a PWM slice, and the pins of its positive and its negative pole, which are IN1 and IN2 of its
/// driver.
pub struct MotorPeripherals {
    /// M1.
    pub left_front: MotorPins<peripherals::PWM_SLICE1, peripherals::PIN_18, peripherals::PIN_19>,
    /// M2.
    pub left_rear: MotorPins<peripherals::PWM_SLICE2, peripherals::PIN_21, peripherals::PIN_20>,
    /// M3.
    pub right_rear: MotorPins<peripherals::PWM_SLICE3, peripherals::PIN_7, peripherals::PIN_6>,
    /// M4.
    pub right_front: MotorPins<peripherals::PWM_SLICE4, peripherals::PIN_9, peripherals::PIN_8>,
}

/// A PWM slice, the positive pole and the negative one.
pub type MotorPins<S, Positive, Negative> =
    (Peri<'static, S>, Peri<'static, Positive>, Peri<'static, Negative>);

/// The motors, each behind what is taken for a DRV8837. A wheel turns ahead while the positive pole of its motor is driven.
///
/// A new drive takes effect when the counter of a motor's PWM wraps, within 2 ms, and for both inputs of a driver at once. The
/// counters are a quarter of a period apart, so it does not for all motors at once.
pub struct BoardMotors {
    left: [Motor; 2],
    right: [Motor; 2],
}

impl BoardMotors {
    /// Takes the motors; they roll freely.
    pub fn new(peripherals: MotorPeripherals) -> Self {
        let MotorPeripherals {
            left_front: (slice1, gp18, gp19),
            left_rear: (slice2, gp21, gp20),
            right_rear: (slice3, gp7, gp6),
            right_front: (slice4, gp9, gp8),
        } = peripherals;
        let [left_front, left_rear] = LEFT_COUNTS;
        let [right_rear, right_front] = RIGHT_COUNTS;
        let motors = Self {
            left: [
                Motor::new(slice1, gp18, gp19, Ahead::ChannelA, left_front),
                Motor::new(slice2, gp20, gp21, Ahead::ChannelB, left_rear),
            ],
            right: [
                Motor::new(slice3, gp6, gp7, Ahead::ChannelB, right_rear),
                Motor::new(slice4, gp8, gp9, Ahead::ChannelB, right_front),
            ],
        };
        motors.start_together();
        motors
    }

    /// Starts all counters in the same cycle.
    fn start_together(&self) {
        PWM.en().modify(|enabled| {
            for motor in self.left.iter().chain(&self.right) {
                enabled.0 |= 1 << motor.slice_number;
            }
        });
    }
}

impl Motors for BoardMotors {
    fn drive(&mut self, drives: SideDrives) {
        for motor in &mut self.left {
            motor.drive(drives.left);
        }
        for motor in &mut self.right {
            motor.drive(drives.right);
        }
    }
}

/// The PWM channel that leads to the positive pole.
enum Ahead {
    ChannelA,
    ChannelB,
}

struct Motor {
    /// Owns the pins.
    _pwm: Pwm<'static>,
    slice_number: usize,
    /// The registers of its slice. embassy-rp would look them up by number each time, with a panic for a wrong one.
    slice: Channel,
    ahead: Ahead,
}

impl Motor {
    fn new<S: Slice>(
        slice: Peri<'static, S>,
        a: Peri<'static, impl ChannelAPin<S>>,
        b: Peri<'static, impl ChannelBPin<S>>,
        ahead: Ahead,
        first_count: u16,
    ) -> Self {
        let mut config = Config::default();
        config.divider = DIVIDER.into();
        config.top = PERIOD_COUNTS - 1;
        config.enable = false;
        let slice_number = slice.number();
        let motor = Self {
            slice: PWM.ch(slice_number),
            _pwm: Pwm::new_output_ab(slice, a, b, config),
            slice_number,
            ahead,
        };
        motor.slice.ctr().write(|counter| counter.set_ctr(first_count));
        motor
    }

    fn drive(&mut self, drive: MotorDrive) {
        let (in1, in2) = input_levels(drive);
        let (a, b) = match self.ahead {
            Ahead::ChannelA => (in1, in2),
            Ahead::ChannelB => (in2, in1),
        };
        self.slice.cc().write(|compare| {
            compare.set_a(a);
            compare.set_b(b);
        });
    }
}

/// For how many counts of a period IN1 and IN2 are high (DRV8837 datasheet, table of its logic).
fn input_levels(drive: MotorDrive) -> (u16, u16) {
    match drive {
        MotorDrive::Coast => (NEVER, NEVER),
        MotorDrive::Brake => (ALWAYS, ALWAYS),
        MotorDrive::Turn(share) if share > 0.0 => (counts(share), NEVER),
        MotorDrive::Turn(share) => (NEVER, counts(-share)),
    }
}

/// The conversion saturates, and makes 0 of what is not a number.
fn counts(share: f32) -> u16 {
    ((share * f32::from(PERIOD_COUNTS)) as u16).min(ALWAYS)
}

/// Makes the motors roll freely at once, whichever task owns them: their pins are taken from the PWM and driven low.
pub(super) fn force_coast() {
    SIO.gpio_out(0).value_clr().write_value(PINS);
    SIO.gpio_oe(0).value_set().write_value(PINS);
    // One by one: in a loop over numbers the check of the number would stay, a path to a panic.
    for pin in [
        IO_BANK0.gpio(6),
        IO_BANK0.gpio(7),
        IO_BANK0.gpio(8),
        IO_BANK0.gpio(9),
        IO_BANK0.gpio(18),
        IO_BANK0.gpio(19),
        IO_BANK0.gpio(20),
        IO_BANK0.gpio(21),
    ] {
        pin.ctrl().write(|control| control.set_funcsel(FUNCTION_SIO));
    }
}
