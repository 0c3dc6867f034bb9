//! Smart batteries that are plugged in after the start.

use super::*;
use crate::battery::CellVoltages;

const ADDRESS: u8 = 0x0b;

const SMART: [PartKind; 7] = [
    PartKind::SmartBattery,
    PartKind::Solo,
    PartKind::Sui3Cells,
    PartKind::Sui6Cells,
    PartKind::NeoDesign,
    PartKind::Maxell,
    PartKind::Rotoye,
];

/// Two or four cells of 3.7 V, and 1.5 A, with the packet error code of each answer behind it.
fn answers(kind: PartKind) -> Tables {
    let mut tables = battery(&[(0x1a, 0x0031)]).i2c;
    let cells = [3700u16; 4].map(u16::to_le_bytes).concat();
    let current = (-1500i32).to_le_bytes();
    let block = |bytes: &[u8]| [&[bytes.len() as u8], bytes].concat();
    tables.set(ADDRESS, 0x28, &block(&cells));
    match kind {
        PartKind::Solo => tables.set(ADDRESS, 0x2a, &block(&current)),
        _ => tables.set(ADDRESS, 0x2a, &current),
    }
    tables.set(ADDRESS, 0x23, &block(&[0; 6]));
    tables.set(ADDRESS, 0x5c, &2u16.to_le_bytes());
    for cell in [0x30, 0x31] {
        tables.set(ADDRESS, cell, &3700u16.to_le_bytes());
    }
    for ((_, command), bytes) in &mut tables.0 {
        let header = [ADDRESS << 1, *command, ADDRESS << 1 | 1];
        let code = smbus_pec::pec(&[&header[..], bytes].concat());
        bytes.push(code);
    }
    tables
}

/// A battery whose contacts close and open: by the number of each transfer.
struct Contacts<F> {
    battery: Tables,
    transfers: usize,
    are_closed: F,
}

impl<F: Fn(usize) -> bool> I2cBus for Contacts<F> {
    async fn transfer(&mut self, address: u8, operations: &mut [Operation<'_>]) -> Result<(), BusError> {
        self.transfers += 1;
        if !(self.are_closed)(self.transfers) {
            return Err(BusError::NoAnswer);
        }
        self.battery.transfer(address, operations).await
    }
}

type Bench<F> = (BusDevices, Buses<Contacts<F>, NoSpi>);

fn bench<F: Fn(usize) -> bool>(kind: PartKind, are_closed: F) -> Bench<F> {
    let bus = Contacts {
        battery: answers(kind),
        transfers: 0,
        are_closed,
    };
    (
        BusDevices::from_parameters(&second_is(kind), Instant::EPOCH),
        Buses::i2c(bus),
    )
}

fn read<F: Fn(usize) -> bool>((devices, bus): &mut Bench<F>) -> Result<Measurement, ReadError> {
    read_next(devices, bus)[0].1
}

/// What is known when everything has been read.
fn settled<F: Fn(usize) -> bool>(bench: &mut Bench<F>) -> Measurement {
    let readings: Vec<_> = (0..12).map(|_| read(bench)).collect();
    readings[readings.len() - 1].expect("it answers")
}

/// The battery that was there at the start, and how many transfers its first reading takes.
fn known(kind: PartKind) -> (Measurement, usize) {
    let mut bench = bench(kind, |_| true);
    read(&mut bench).expect("it answers");
    let transfers = bench.1.i2c.transfers;
    (settled(&mut bench), transfers)
}

#[test]
fn what_is_plugged_in_after_the_start_is_known_like_what_was_there() {
    for kind in SMART {
        let (expected, _) = known(kind);
        assert_ne!(
            expected.cells == CellVoltages::NONE,
            kind != PartKind::Sui6Cells,
            "{kind:?}"
        );
        assert_eq!(expected.details.state_of_health_pct, Some(80), "{kind:?}");
        let mut bench = bench(kind, |transfer| transfer > 10);
        while bench.1.i2c.transfers < 10 {
            assert_eq!(read(&mut bench), Err(BusError::NoAnswer.into()), "{kind:?}");
        }
        assert_eq!(settled(&mut bench), expected, "{kind:?}");
        // What has a packet error code is checked by it.
        let (_, bus) = &mut bench;
        let voltage = bus.i2c.battery.0.get_mut(&(ADDRESS, 0x09)).unwrap();
        *voltage.last_mut().unwrap() ^= 1;
        let has_code = ![PartKind::Sui3Cells, PartKind::Sui6Cells].contains(&kind);
        let checked = (0..4).all(|_| read(&mut bench) == Err(BusError::Checksum.into()));
        assert_eq!(checked, has_code, "{kind:?}");
    }
}

#[test]
fn contacts_that_bounce_leave_nothing_unknown() {
    for kind in SMART {
        let (expected, transfers) = known(kind);
        for opens in 1..=transfers {
            for length in 1..=3 {
                let gap = 10 + opens..10 + opens + length;
                let mut bench = bench(kind, |transfer| transfer > 10 && !gap.contains(&transfer));
                while bench.1.i2c.transfers < gap.end {
                    let _ = read(&mut bench);
                }
                assert_eq!(settled(&mut bench), expected, "{kind:?}, {gap:?}");
            }
        }
    }
}
