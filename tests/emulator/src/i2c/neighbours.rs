//! Devices that share an address, by mistake or for lack of knowledge.

use super::super::clock::Cycle;
use super::device::{Ack, I2cDevice, I2cDirection};

/// All devices at one address. The lines are open drain: who pulls one low wins, be it for an acknowledgement or for a
/// zero.
#[derive(Default)]
pub struct Neighbours(Vec<Box<dyn I2cDevice>>);

impl Neighbours {
    pub fn add(&mut self, device: Box<dyn I2cDevice>) {
        self.0.push(device);
    }

    /// Every device sees what was sent, even if another one has acknowledged it.
    fn ask_all(&mut self, mut ask: impl FnMut(&mut dyn I2cDevice) -> Ack) -> Ack {
        self.0
            .iter_mut()
            .fold(Ack::Nack, |ack, device| match ask(device.as_mut()) {
                Ack::Ack => Ack::Ack,
                Ack::Nack => ack,
            })
    }
}

impl I2cDevice for Neighbours {
    fn start(&mut self, direction: I2cDirection, now: Cycle) -> Ack {
        self.ask_all(|device| device.start(direction, now))
    }

    fn write(&mut self, byte: u8) -> Ack {
        self.ask_all(|device| device.write(byte))
    }

    fn read(&mut self) -> u8 {
        self.0.iter_mut().fold(0xff, |line, device| line & device.read())
    }

    fn stop(&mut self) {
        self.0.iter_mut().for_each(|device| device.stop());
    }

    /// SCL rises when the slowest has released it.
    fn stretch(&mut self) -> Cycle {
        self.0
            .iter_mut()
            .map(|device| device.stretch())
            .max()
            .unwrap_or(0)
    }
}

#[cfg(test)]
mod tests {
    use std::cell::RefCell;
    use std::rc::Rc;

    use super::super::devices::driver::{read, write};
    use super::super::devices::{Ina226, Ina3221, Pec, SmartBattery};
    use super::super::tests::Probe;
    use super::*;

    const CONFIGURATION: u8 = 0x00;
    const BUS_VOLTAGE: u8 = 0x02;
    const CALIBRATION: u8 = 0x05;
    const DIE_ID: u8 = 0xff;
    const VOLTAGE_COMMAND: u8 = 0x09;

    fn neighbours<const N: usize>(devices: [Box<dyn I2cDevice>; N]) -> Neighbours {
        Neighbours(devices.into())
    }

    #[test]
    fn what_two_monitors_measure_reads_as_the_and_of_both() {
        let (mut one, mut other) = (Ina226::new(0.002), Ina226::new(0.002));
        one.set(11.98, 1.0);
        other.set(7.4, 1.0);
        let mut both = neighbours([Box::new(one), Box::new(other)]);
        assert_eq!(read(&mut both, BUS_VOLTAGE, 2), 0x2570 & 0x1720);
        assert_eq!(read(&mut both, CONFIGURATION, 2), 0x4127, "the same in both");
    }

    #[test]
    fn two_kinds_of_monitor_are_none_that_exists() {
        let mut both = neighbours([Box::new(Ina226::new(0.002)), Box::new(Ina3221::new(0.002))]);
        assert_eq!(read(&mut both, DIE_ID, 2), 0x2220);
    }

    #[test]
    fn what_is_written_arrives_everywhere() {
        let monitors = [0.002, 0.001].map(|shunt_ohm| Rc::new(RefCell::new(Ina226::new(shunt_ohm))));
        let mut both = neighbours(monitors.each_ref().map(|it| Box::new(Rc::clone(it)) as Box<_>));
        write(&mut both, CALIBRATION, 0xa00);
        assert_eq!(monitors.map(|it| it.borrow().calibration()), [0xa00, 0xa00]);
    }

    #[test]
    fn one_acknowledgement_is_enough() {
        let refuses = Probe {
            refused: Some(0x11),
            ..Probe::default()
        };
        let mut both = neighbours([Box::new(Probe::default()), Box::new(refuses)]);
        assert_eq!(both.start(I2cDirection::Write, 0), Ack::Ack);
        assert_eq!(both.write(0x11), Ack::Ack);
        both = neighbours([Box::new(SmartBattery::new(Pec::Right))]);
        both.start(I2cDirection::Write, 0);
        assert_eq!(both.write(0x77), Ack::Nack);
    }

    #[test]
    fn who_refused_a_command_leaves_the_line_alone() {
        let mut knows_nothing = SmartBattery::new(Pec::Right);
        knows_nothing.forget(VOLTAGE_COMMAND);
        let mut both = neighbours([Box::new(SmartBattery::new(Pec::Right)), Box::new(knows_nothing)]);
        assert_eq!(
            read(&mut both, VOLTAGE_COMMAND, 2),
            0x3831,
            "12600 mV, low byte first"
        );
    }

    #[test]
    fn the_slowest_decides_how_long_scl_is_held() {
        let stretches = |stretch| {
            Box::new(Probe {
                stretch,
                ..Probe::default()
            })
        };
        assert_eq!(neighbours([stretches(5000), stretches(100)]).stretch(), 5000);
    }
}
