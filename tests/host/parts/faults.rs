//! A part whose transfer was refused, held up or damaged, or whose supply was gone, is soon one that never failed: it measures what it
//! did, and nothing was counted that did not flow.

use emulator::i2c_devices::{
    Ad7091r5, Bebop, Bq76952, Ina219, Ina226, Ina228, Ina3221, Ltc2946, Pec, SMART_BATTERY_ADDRESS,
    SmartBattery,
};

use rover_battmon::battery::{GaugeReading, PackStatus};

use super::*;

/// From then on a part that answers again measures as if it had never failed.
const KNOWN_AGAIN_US: u64 = 3 * SECOND;

const FULL_MAH: f64 = 5200.0;

fn smart_battery(set_up: fn(&mut SmartBattery)) -> Box<dyn Emulated> {
    let mut device = SmartBattery::new(Pec::Right);
    set_up(&mut device);
    wired(device, |_| (), connect_battery)
}

/// Whatever its maker has for current and remaining charge.
fn connect_battery(battery: &mut SmartBattery, amperes: f64, drawn_mah: f64) {
    battery.set(VOLTS, amperes, 25.0);
    let milliamperes = (-amperes * 1000.0) as i32;
    battery.set_word(0x41, (-amperes * 10.0) as i16 as u16);
    battery.set_bare(0x2a, &milliamperes.to_le_bytes());
    battery.set_word(0x0f, (FULL_MAH - drawn_mah) as u16);
}

const FOUR_CELLS: [u8; 8] = [0xb8, 0x0b, 0xb8, 0x0b, 0xb8, 0x0b, 0xb8, 0x0b];

static ROWS: [Row; 20] = [
    row(
        "INA226",
        0x40,
        || monitor(Ina226::new(0.0005)),
        &[("BATT2_MONITOR", 21.0)],
    ),
    row(
        "INA231",
        0x41,
        || monitor(Ina226::ina231(0.0005)),
        &[("BATT2_MONITOR", 21.0)],
    ),
    row(
        "INA219",
        0x40,
        || monitor(Ina219::new(0.0005)),
        &[("BATT2_MONITOR", 21.0)],
    ),
    row(
        "INA260",
        0x44,
        || monitor(Ina226::ina260()),
        &[("BATT2_MONITOR", 21.0)],
    ),
    row(
        "INA228",
        0x45,
        || monitor(Ina228::new(0.0005)),
        &[("BATT2_MONITOR", 21.0)],
    ),
    row(
        "INA238",
        0x40,
        || monitor(Ina228::ina238(0.0005)),
        &[("BATT2_MONITOR", 21.0)],
    ),
    row(
        "INA239",
        0,
        || Box::new(AtSpi(Ina239::new(0.0005))),
        &[("BATT2_MONITOR", 26.0)],
    ),
    row(
        "INA3221",
        0x43,
        || {
            wired(Ina3221::new(0.0005), power_cycle, |device, amperes, _| {
                (1..=3).for_each(|channel| device.set(channel, VOLTS, amperes))
            })
        },
        &[
            ("BATT2_MONITOR", 30.0),
            ("BATT3_MONITOR", 30.0),
            ("BATT3_CHANNEL", 2.0),
            ("BATT4_MONITOR", 30.0),
            ("BATT4_CHANNEL", 3.0),
        ],
    ),
    row(
        "LTC2946",
        0x6a,
        || {
            wired(
                Ltc2946::new(0.0005),
                Ltc2946::power_cycle,
                |device, amperes, _| device.set(VOLTS, amperes),
            )
        },
        &[("BATT2_MONITOR", 22.0)],
    ),
    row(
        "AD7091R-5",
        0x2f,
        || {
            wired(Ad7091r5::new(3.3), Ad7091r5::power_cycle, |device, amperes, _| {
                for (channel, volts) in [2.0, amperes / 10.0, 2.0, amperes / 10.0].into_iter().enumerate() {
                    device.set(channel, volts);
                }
            })
        },
        &[
            ("BATT2_MONITOR", 28.0),
            ("BATT2_VOLT_PIN", 50.0),
            ("BATT2_CURR_PIN", 51.0),
            ("BATT2_VOLT_MULT", 6.0),
            ("BATT2_AMP_PERVLT", 10.0),
            ("BATT3_MONITOR", 28.0),
            ("BATT3_VOLT_PIN", 52.0),
            ("BATT3_CURR_PIN", 53.0),
            ("BATT3_VOLT_MULT", 6.0),
            ("BATT3_AMP_PERVLT", 10.0),
        ],
    ),
    row(
        "BQ76952",
        0x08,
        || {
            wired(Bq76952::new(), Bq76952::power_cycle, |device, amperes, _| {
                device.set(&[4000; 3], amperes, 25.0)
            })
        },
        &[("BATT2_MONITOR", 32.0)],
    ),
    row(
        "Bebop",
        0x08,
        || idle(Bebop::new(12_000)),
        &[("BATT2_MONITOR", 6.0)],
    ),
    row(
        "smart battery",
        SMART_BATTERY_ADDRESS,
        || smart_battery(|_| ()),
        &[("BATT2_MONITOR", 7.0)],
    ),
    row(
        "smart battery without PEC",
        SMART_BATTERY_ADDRESS,
        || {
            smart_battery(|battery| {
                battery.set_pec(Pec::None);
                battery.set_word(0x1a, 0x0021);
            })
        },
        &[("BATT2_MONITOR", 7.0)],
    ),
    row(
        "Solo",
        SMART_BATTERY_ADDRESS,
        || {
            wired(
                {
                    let mut battery = SmartBattery::new(Pec::Right);
                    battery.set_block(0x28, &FOUR_CELLS);
                    battery.set_block(0x23, &[0; 6]);
                    battery
                },
                |_| (),
                |battery, amperes, drawn_mah| {
                    connect_battery(battery, amperes, drawn_mah);
                    battery.set_block(0x2a, &((-amperes * 1000.0) as i32).to_le_bytes());
                },
            )
        },
        &[("BATT2_MONITOR", 5.0)],
    ),
    row(
        "SUI of 3 cells",
        SMART_BATTERY_ADDRESS,
        || {
            smart_battery(|battery| {
                battery.set_pec(Pec::None);
                battery.set_block(0x28, &[0xa0, 0x0f, 0xa0, 0x0f, 0xa0, 0x0f, 0, 0]);
            })
        },
        &[("BATT2_MONITOR", 13.0)],
    ),
    row(
        "SUI of 6 cells",
        SMART_BATTERY_ADDRESS,
        || smart_battery(|battery| battery.set_pec(Pec::None)),
        &[("BATT2_MONITOR", 14.0)],
    ),
    row(
        "NeoDesign",
        SMART_BATTERY_ADDRESS,
        || {
            smart_battery(|battery| {
                battery.set_word(0x5c, 3);
                (0x30..0x33).for_each(|command| battery.set_word(command, 4000));
            })
        },
        &[("BATT2_MONITOR", 15.0)],
    ),
    row(
        "Maxell",
        SMART_BATTERY_ADDRESS,
        || {
            wired(
                {
                    let mut battery = SmartBattery::new(Pec::Right);
                    battery.set_word(0x10, 2600);
                    battery
                },
                |_| (),
                |battery, amperes, drawn_mah| {
                    connect_battery(battery, amperes, drawn_mah);
                    battery.set_word(0x0f, ((FULL_MAH - drawn_mah) / 2.0) as u16);
                },
            )
        },
        &[("BATT2_MONITOR", 16.0)],
    ),
    row(
        "Rotoye",
        SMART_BATTERY_ADDRESS,
        || smart_battery(|_| ()),
        &[("BATT2_MONITOR", 19.0)],
    ),
];

/// A part without faults.
struct Reference {
    readings: BTreeMap<u8, Measurement>,
    /// Transfers up to and with the first reading, and up to and with the third turn after it.
    of_set_up: usize,
    of_first_turns: usize,
}

impl Reference {
    fn of(row: &Row) -> Self {
        let mut bench = Bench::new(row);
        while bench.packs.is_empty() {
            bench.turn();
        }
        let of_set_up = bench.transfers();
        (0..3).for_each(|_| bench.turn());
        let of_first_turns = bench.transfers();
        bench.run_for(KNOWN_AGAIN_US);
        let readings = bench.latest.iter();
        Self {
            readings: readings
                .map(|(pack, reading)| (*pack, without_counts(reading.expect("it answers"))))
                .collect(),
            of_set_up,
            of_first_turns,
        }
    }
}

/// A reading without what changes all the time.
fn without_counts(mut reading: Measurement) -> Measurement {
    reading.counted = None;
    if let GaugeReading::Read(gauge) = &mut reading.gauge {
        gauge.remaining_mah = 0.0;
    }
    reading
}

/// Runs a part until the transfers that fail are over and it is known again, with this load until a second before.
///
/// # Errors
/// A voltage that was not right meanwhile, a reading that is another than without a fault, or a charge that did not flow.
fn recovers(
    row: &Row,
    reference: &Reference,
    failing: Range<usize>,
    fault: Fault,
    amperes_at: fn(u64) -> f64,
) -> Result<(), String> {
    let mut bench = Bench::new(row);
    bench.fail(failing.clone(), fault);
    while bench.transfers() + 1 < failing.end || bench.is_off() {
        bench.set_amperes(amperes_at(bench.now_us()));
        bench.turn();
        reference.check_voltages(&bench)?;
    }
    let known_again = bench.now_us() + KNOWN_AGAIN_US;
    while bench.now_us() < known_again {
        let is_late = bench.now_us() + SECOND >= known_again;
        bench.set_amperes(if is_late {
            AMPERES
        } else {
            amperes_at(bench.now_us())
        });
        bench.turn();
        reference.check_voltages(&bench)?;
    }
    reference.check(&bench)?;
    let [least_a, most_a] = [amperes_at(0), amperes_at(LOAD_US)];
    for pack in reference.packs() {
        let counted_mah = bench.counted_mah(pack);
        let (drawn_mah, tolerance_mah) = match bench.latest[&pack.number()] {
            // A gauge counts from the start, in steps of up to 2 mAh.
            Ok(reading) if reading.gauge.read().is_some() => (bench.drawn_mah(), 2.0 + 0.2 * most_a / 3.6),
            _ => {
                let drawn_mah = bench.drawn_mah() - bench.packs[&pack.number()].drawn_before_mah;
                // A gap is filled with a current that was measured before or after it.
                let unread_s = match counts(row, reference, &failing, fault) {
                    true => 0.0,
                    false => bench.unread_us(pack) as f64 * 1e-6,
                };
                let gap_mah = unread_s * (most_a - least_a) / 3.6;
                (drawn_mah, gap_mah + 0.3 * most_a / 3.6 + 0.01 * drawn_mah)
            }
        };
        if (counted_mah - drawn_mah).abs() > tolerance_mah {
            return Err(format!(
                "{counted_mah} of {drawn_mah} mAh, {tolerance_mah} tolerated"
            ));
        }
    }
    Ok(())
}

/// Whether a part has counted on by itself.
fn counts(row: &Row, reference: &Reference, failing: &Range<usize>, fault: Fault) -> bool {
    let was_set_up_once = matches!(fault, Fault::Refused | Fault::Delayed { .. });
    ["INA228", "LTC2946", "BQ76952"].contains(&row.name)
        && was_set_up_once
        && failing.start > reference.of_set_up
}

impl Reference {
    /// The packs with a current.
    fn packs(&self) -> impl Iterator<Item = Pack> {
        let readings = |pack: &Pack| self.readings.get(&pack.number());
        Pack::ALL
            .into_iter()
            .filter(move |pack| readings(pack).is_some_and(|reading| reading.current_a.is_some()))
    }

    /// A voltage is that of a part without a fault, and so is a current, or it is unknown.
    fn check_voltages(&self, bench: &Bench) -> Result<(), String> {
        for (pack, reading) in &bench.readings {
            let Ok(reading) = reading else { continue };
            let expected = &self.readings[&pack.number()];
            let (volts, amperes) = (reading.voltage_v, reading.current_a);
            let is_current = amperes.is_none_or(|amperes| amperes.abs() > 0.5 * LEAST_AMPERES as f32);
            if volts != expected.voltage_v || !is_current {
                return Err(format!("meanwhile {volts:?} V, {amperes:?} A"));
            }
        }
        Ok(())
    }

    fn check(&self, bench: &Bench) -> Result<(), String> {
        for (pack, expected) in &self.readings {
            let reading = bench.latest[pack].map(without_counts);
            if reading != Ok(*expected) {
                return Err(format!("then {reading:?}"));
            }
        }
        Ok(())
    }
}

/// Collects what has failed.
#[derive(Default)]
struct Runs {
    count: usize,
    failed: Vec<String>,
}

impl Runs {
    fn run(
        &mut self,
        row: &Row,
        reference: &Reference,
        failing: Range<usize>,
        fault: Fault,
        amperes_at: fn(u64) -> f64,
    ) {
        if !is_possible(row, fault) {
            return;
        }
        self.count += 1;
        if let Err(error) = recovers(row, reference, failing.clone(), fault, amperes_at) {
            let failed = format!("{}, {fault:?} in {failing:?}: {error}", row.name);
            self.failed.push(failed);
        }
    }

    fn assert_all_recovered(self, count: usize) {
        let failed = self.failed.iter().map(|failed| &failed[..failed.len().min(400)]);
        let failed: Vec<_> = failed.collect();
        assert!(
            failed.is_empty(),
            "{} of {}: {failed:#?}",
            failed.len(),
            self.count
        );
        assert_eq!(self.count, count);
    }
}

/// SPI has no acknowledge, and only what has a checksum shows that an answer is damaged.
fn is_possible(row: &Row, fault: Fault) -> bool {
    let with_checksum = ["smart battery", "Solo", "NeoDesign", "Maxell", "Rotoye", "Bebop"];
    match fault {
        Fault::Corrupted { .. } => with_checksum.contains(&row.name),
        Fault::Refused => row.name != "INA239",
        _ => true,
    }
}

#[test]
// Requirement: AP-6, AP-7, S-6
fn three_seconds_after_any_of_its_first_transfers_failed_a_part_is_one_that_never_failed() {
    let mut runs = Runs::default();
    for row in &ROWS {
        let reference = Reference::of(row);
        for first in 1..=reference.of_first_turns {
            let (place, bits) = (first, 0x10);
            for (fault, transfers) in [
                (Fault::Refused, 1),
                (Fault::Refused, 4),
                // As of a pack that is plugged in later.
                (Fault::Refused, 40),
                (Fault::Delayed { has_taken: false }, 1),
                (Fault::Delayed { has_taken: true }, 1),
                (Fault::PowerLost { us: 0 }, 1),
                (Fault::PowerLost { us: SECOND }, 1),
                (Fault::Corrupted { place, bits }, 1),
            ] {
                let failing = first..first + transfers;
                runs.run(row, &reference, failing, fault, |_| AMPERES);
            }
        }
    }
    runs.assert_all_recovered(6496);
}

#[test]
// Requirement: AP-5
fn a_battery_that_is_still_asked_for_its_scale_is_not_announced_as_unhealthy() {
    let make = || smart_battery(|battery| battery.refuse(0x1a));
    let part = row(
        "smart battery",
        SMART_BATTERY_ADDRESS,
        make,
        &[("BATT2_MONITOR", 7.0)],
    );
    let mut bench = Bench::new(&part);
    bench.desk.autopilot.open(&mut bench.desk.endpoint);
    let mut texts = Vec::new();
    while bench.now_us() < START_US + 10 * SECOND {
        bench.run_for(TICK_US);
        texts.extend(bench.announced());
        let is_measured = bench.state(Pack::Second).readings.voltage_v.is_some();
        match bench.now_us() - START_US {
            ..2_400_000 => assert!(!is_measured, "it may be scaled"),
            3_000_000.. => assert!(is_measured),
            _ => {}
        }
        assert_ne!(bench.state(Pack::Second).status, PackStatus::Unhealthy);
    }
    assert!(texts.iter().any(|text| text.contains("found")), "{texts:?}");
    assert!(!texts.iter().any(|text| text.contains("healthy")), "{texts:?}");
    // One that does not answer any more is.
    let transfers = bench.transfers();
    bench.fail(transfers..transfers + 1_000, Fault::Refused);
    bench.run_for(SECOND);
    let texts = bench.announced();
    assert!(
        texts.contains(&"Battery 2 unhealthy: no answer".into()),
        "{texts:?}"
    );
}

/// The load changes as often, between these.
const LOAD_US: u64 = 700_000;
const LEAST_AMPERES: f64 = 2.0;
const MOST_AMPERES: f64 = 12.0;

fn changing_load(now_us: u64) -> f64 {
    match now_us / LOAD_US % 2 {
        0 => LEAST_AMPERES,
        _ => MOST_AMPERES,
    }
}

const RANDOM_FAULTS: usize = 120;

#[test]
// Requirement: AP-6, AP-7, S-6, S-10
fn after_a_random_transfer_failed_under_a_changing_load_nothing_is_counted_that_did_not_flow() {
    let mut runs = Runs::default();
    let mut random = fastrand::Rng::with_seed(77);
    for row in &ROWS {
        let reference = Reference::of(row);
        for _ in 0..RANDOM_FAULTS {
            let fault = match random.u8(..5) {
                0 => Fault::Refused,
                1 => Fault::Delayed {
                    has_taken: random.bool(),
                },
                2 => Fault::Corrupted {
                    place: random.usize(..40),
                    bits: random.u8(1..),
                },
                _ => Fault::PowerLost {
                    us: random.u64(..5) * 500_000,
                },
            };
            let transfers = match fault {
                Fault::Refused => random.usize(1..40),
                _ => 1,
            };
            let first = random.usize(1..reference.of_set_up + 250);
            runs.run(row, &reference, first..first + transfers, fault, changing_load);
        }
    }
    runs.assert_all_recovered(2064);
}
