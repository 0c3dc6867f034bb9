use std::cell::RefCell;

use embassy_time::{Instant, with_timeout};
use rover_battmon::autopilot::Start;
use rover_battmon::parameter::{Parameters, SimulationParameter};
use rover_battmon::tasks::Shared;

use super::super::{PackModel, SimulatedPack, SimulatedRover, clock};
use super::*;

const UNUSED_ADDRESS: u8 = 0x41;
const REFUSED: ErrorKind = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Data);
/// In addition to 0.2 A of the rover's electronics.
const LOAD_A: f32 = 4.8;
/// 25 time constants of the pack.
const SETTLING: Duration = Duration::from_secs(200);

/// Runs `test` on the bus of a pack with a resting voltage of 12 V, after 200 s of constant current.
fn on_bus<R>(load_a: f32, test: impl AsyncFnOnce(&mut SimulatedBus<'_>) -> R) -> R {
    let values = [
        (SimulationParameter::BattVoltage, 12.0),
        (SimulationParameter::BattCurrent, load_a),
    ];
    on_bus_of(SimulatedPack::full(PackModel::LIPO_3S_2200), &values, test)
}

fn on_bus_of<R>(
    pack: SimulatedPack,
    values: &[(SimulationParameter, f32)],
    test: impl AsyncFnOnce(&mut SimulatedBus<'_>) -> R,
) -> R {
    let mut parameters = Parameters::defaults();
    for (parameter, value) in values {
        parameters.set(*parameter, *value).expect("it is in range");
    }
    let (pack, rover) = (RefCell::new(pack), SimulatedRover::default());
    let shared = Shared::new(&Start::with_parameters(parameters));
    let settle_and_test = async {
        let simulation = PackSimulation::new(&pack, &rover, &shared);
        Timer::after(SETTLING).await;
        test(&mut SimulatedBus::new(&simulation)).await
    };
    clock::run_for(SETTLING * 2, settle_and_test).expect("the test ends")
}

async fn read<const N: usize>(bus: &mut SimulatedBus<'_>, address: u8, register: u8) -> [u8; N] {
    let mut bytes = [0; N];
    let result = bus.write_read(address, &[register], &mut bytes).await;
    assert_eq!(result, Ok(()), "{address:#x}, {register:#x}");
    bytes
}

async fn monitor_register(bus: &mut SimulatedBus<'_>, register: u8) -> u16 {
    u16::from_be_bytes(read(bus, POWER_MONITOR_ADDRESS, register).await)
}

/// A word of the smart battery, with its packet error code checked.
async fn word(bus: &mut SimulatedBus<'_>, command: u8) -> u16 {
    let [low, high, pec] = read(bus, SMART_BATTERY_ADDRESS, command).await;
    assert_eq!(pec, crc8(&[0x16, command, 0x17, low, high]), "{command:#x}");
    u16::from_le_bytes([low, high])
}

/// CRC-8/SMBUS by long division.
fn crc8(bytes: &[u8]) -> u8 {
    let bits = bytes
        .iter()
        .flat_map(|byte| (0..8).rev().map(move |bit| byte >> bit & 1));
    bits.chain([0; 8]).fold(0, |remainder, bit| {
        let shifted = u16::from(remainder) << 1 | u16::from(bit);
        (if shifted & 0x100 != 0 {
            shifted ^ 0x107
        } else {
            shifted
        }) as u8
    })
}

#[test]
fn crc8_has_the_published_check_value() {
    assert_eq!(crc8(b"123456789"), 0xf4);
}

#[test]
fn power_monitor_measures_the_packs_voltage_and_current() {
    on_bus(LOAD_A, async |bus| {
        assert_eq!(monitor_register(bus, 0xfe).await, 0x5449);
        assert_eq!(monitor_register(bus, 0xff).await, 0x2260);
        assert_eq!(monitor_register(bus, 0x01).await, 4000, "5 A, 2 mOhm, 2.5 uV");
        // 12 V less 5 A through 54 mOhm.
        assert_eq!(monitor_register(bus, 0x02).await, 9384, "11.73 V");
    });
}

#[test]
fn power_monitor_can_be_configured_and_reset() {
    on_bus(LOAD_A, async |bus| {
        assert_eq!(monitor_register(bus, 0x00).await, 0x4127);
        for (written, then) in [(0x4527u16, 0x4527), (0xc527, 0x4127)] {
            let [high, low] = written.to_be_bytes();
            assert_eq!(bus.write(POWER_MONITOR_ADDRESS, &[0x00, high, low]).await, Ok(()));
            assert_eq!(monitor_register(bus, 0x00).await, then);
        }
    });
}

#[test]
fn smart_battery_reports_the_same_pack() {
    on_bus(LOAD_A, async |bus| {
        for (command, expected) in [
            (0x03, 0),
            (0x08, 2982),
            (0x09, 11_730),
            (0x0a, (-5000i16) as u16),
            (0x0d, 87),
            // 5 A for 200 s are 278 mAh.
            (0x0f, 1922),
            (0x10, 2200),
            (0x16, 0x00c0),
            (0x17, 12),
            (0x18, 2200),
            (0x19, 11_100),
            (0x1a, 0x0031),
            (0x1b, 44 * 512 + 5 * 32 + 17),
            (0x1c, 4711),
            (0x3f, 3910),
            (0x3e, 3910),
            (0x3d, 3910),
        ] {
            assert_eq!(word(bus, command).await, expected, "{command:#x}");
        }
    });
}

#[test]
fn charging_current_is_negative() {
    on_bus(-2.2, async |bus| {
        assert_eq!(monitor_register(bus, 0x01).await as i16, -1600);
        assert_eq!(word(bus, 0x0a).await, 2000);
        assert_eq!(word(bus, 0x16).await, 0x0080);
    });
}

#[test]
fn registers_saturate() {
    on_bus(100.0, async |bus| {
        assert_eq!(monitor_register(bus, 0x01).await, 0x7fff);
        assert_eq!(word(bus, 0x0a).await as i16, i16::MIN);
    });
}

#[test]
fn smart_battery_has_names() {
    on_bus(LOAD_A, async |bus| {
        let chemistry: [u8; 6] = read(bus, SMART_BATTERY_ADDRESS, 0x22).await;
        assert_eq!(chemistry[..5], *b"\x04LION");
        assert_eq!(chemistry[5], crc8(b"\x16\x22\x17\x04LION"));
        for (command, name) in [(0x20, b"\x09Simulated"), (0x21, b"\x09Desk pack")] {
            let block: [u8; 10] = read(bus, SMART_BATTERY_ADDRESS, command).await;
            assert_eq!(block, *name);
        }
    });
}

#[test]
fn unknown_addresses_and_commands_are_not_acknowledged() {
    on_bus(LOAD_A, async |bus| {
        let mut bytes = [0; 2];
        let absent = ErrorKind::NoAcknowledge(NoAcknowledgeSource::Address);
        assert_eq!(
            bus.write_read(UNUSED_ADDRESS, &[0], &mut bytes).await,
            Err(absent)
        );
        assert_eq!(bus.read(UNUSED_ADDRESS, &mut bytes).await, Err(absent));
        for command in [0x3c, 0x40, 0x77] {
            let result = bus
                .write_read(SMART_BATTERY_ADDRESS, &[command], &mut bytes)
                .await;
            assert_eq!(result, Err(REFUSED), "{command:#x}");
        }
        assert_eq!(word(bus, 0x10).await, 2200, "the next command is acknowledged");
    });
}

#[test]
fn transfer_takes_the_time_of_its_bits() {
    on_bus(LOAD_A, async |bus| {
        let begun = Instant::now();
        word(bus, 0x09).await;
        // START, address and command, RESTART, address, word and its code, STOP.
        let bits = 1 + 18 + 1 + 36 + 1;
        assert_eq!(begun.elapsed(), Duration::from_micros(10 * bits));
        let begun = Instant::now();
        assert!(bus.read(UNUSED_ADDRESS, &mut [0]).await.is_err());
        assert_eq!(
            begun.elapsed(),
            Duration::from_micros(110),
            "START, address, STOP"
        );
    });
}

#[test]
fn consecutive_reads_continue_and_aborted_transfers_reset() {
    on_bus(LOAD_A, async |bus| {
        let (mut low, mut high) = ([0], [0]);
        let word_in_halves = &mut [
            Operation::Write(&[0x18]),
            Operation::Read(&mut low),
            Operation::Read(&mut high),
        ];
        assert_eq!(
            bus.transaction(SMART_BATTERY_ADDRESS, word_in_halves).await,
            Ok(())
        );
        assert_eq!(u16::from_le_bytes([low[0], high[0]]), 2200);
        let given_up = with_timeout(Duration::from_micros(250), word(bus, 0x09)).await;
        assert!(given_up.is_err());
        assert_eq!(word(bus, 0x18).await, 2200);
    });
}

#[test]
fn no_device_answers_while_a_wire_is_off_or_the_pack_unplugged() {
    let answers = |fault, unplug: bool| {
        let mut pack = SimulatedPack::full(PackModel::LIPO_3S_2200);
        if unplug {
            pack.unplug();
        }
        on_bus_of(pack, &[(SimulationParameter::BattFault, fault)], async |bus| {
            let mut answers = [false; 2];
            for (answer, address) in answers
                .iter_mut()
                .zip([POWER_MONITOR_ADDRESS, SMART_BATTERY_ADDRESS])
            {
                *answer = bus.write_read(address, &[0x09], &mut [0; 2]).await.is_ok();
            }
            answers
        })
    };
    assert!(answers(0.0, false)[1]);
    assert_eq!(answers(5.0, false), [false; 2]);
    // The power monitor is the rover's, the electronics of a smart battery go with the pack.
    assert!(!answers(0.0, true)[1]);
}
