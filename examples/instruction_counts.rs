//! Firmware that does one thing at a time, so that its instructions can be counted on the emulated RP2040.
//!
//! `cargo bench` builds it, runs it and writes the counts into `docs/performance.md`. A log line says what comes next and how
//! often; GP22 is high while it runs.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use core::hint::black_box;

    use cortex_m_rt::entry;
    use defmt_rtt as _;
    use embassy_rp::gpio::{Level, Output};
    use panic_probe as _;
    use rover_battmon::battery::{
        Amount, BatteryMonitor, BatteryState, CellVoltages, ChargeState, Contents, Faults, Measurement,
        PackDetails, PackSettings, PackStatus, Readings, Tick,
    };
    use rover_battmon::mavlink::dialect::{MavParamType, PARAM_VALUE_DATA};
    use rover_battmon::mavlink::{
        FrameParser, Framer, LinkKind, Message, Signing, SigningKey, StoredSigning, Stream, ToStore,
    };
    use rover_battmon::memory::storage::Condition;
    use rover_battmon::pack::Pack;
    use rover_battmon::system::SystemState;
    use rover_battmon::time::Instant;

    /// What a ground station sends, in chunks as they come from a port. Eight times over, packed by pymavlink 2.4.50 as MAVLink 2 (system 255,
    /// component 190): HEARTBEAT, PARAM_REQUEST_READ, PARAM_SET, COMMAND_LONG, REQUEST_DATA_STREAM, MANUAL_CONTROL, RC_CHANNELS_OVERRIDE,
    /// RADIO_STATUS, SYSTEM_TIME, PING, TIMESYNC, PARAM_REQUEST_LIST.
    const RECEIVED: &[u8] = include_bytes!("../benches/data/mixed_stream.bin");
    const CHUNK_BYTES: usize = 64;

    /// The emulator looks at the pin every ten microseconds: so often that this does not matter.
    const TIMES: u32 = 1000;

    #[entry]
    fn main() -> ! {
        let peripherals = embassy_rp::init(Default::default());
        rover_battmon::board::use_rom_floats();
        let mut bench = Bench {
            measuring: Output::new(peripherals.PIN_22, Level::Low),
        };
        receive(&mut bench);
        send(&mut bench);
        sign(&mut bench);
        update(&mut bench);
        defmt::info!("done");
        loop {
            cortex_m::asm::wfe();
        }
    }

    struct Bench {
        measuring: Output<'static>,
    }

    impl Bench {
        fn measure(&mut self, verb: &str, what: &str, mut once: impl FnMut()) {
            self.begin(verb, what, TIMES);
            for _ in 0..TIMES {
                once();
            }
            self.end();
        }

        fn begin(&mut self, verb: &str, what: &str, times: u32) {
            defmt::info!("{} {}, {} times", verb, what, times);
            self.measuring.set_high();
        }

        fn end(&mut self) {
            self.measuring.set_low();
        }
    }

    fn receive(bench: &mut Bench) {
        let mut parser = FrameParser::new();
        bench.begin("receive", "a byte", RECEIVED.len() as u32);
        for chunk in black_box(RECEIVED).chunks(CHUNK_BYTES) {
            parser.push(chunk);
            while let Some(frame) = parser.next_frame() {
                black_box(frame);
            }
        }
        bench.end();
    }

    fn send(bench: &mut Bench) {
        let (typical, full, tank) = (typical_pack(), full_pack(), tank());
        for (name, stream, pack) in [
            ("HEARTBEAT", Stream::Heartbeat, &typical),
            ("SYS_STATUS, typical", Stream::SysStatus, &typical),
            (
                "BATTERY_STATUS, typical",
                Stream::BatteryStatus(Pack::First),
                &typical,
            ),
            (
                "BATTERY_STATUS, all fields",
                Stream::BatteryStatus(Pack::First),
                &full,
            ),
            (
                "BATTERY_STATUS_V2",
                Stream::BatteryStatusV2(Pack::First),
                &typical,
            ),
            ("BATTERY_INFO", Stream::BatteryInfo(Pack::First), &full),
            ("SMART_BATTERY_INFO", Stream::SmartBatteryInfo(Pack::First), &full),
            ("FUEL_STATUS", Stream::FuelStatus(Pack::First), &tank),
        ] {
            let state = SystemState {
                batteries: core::slice::from_ref(pack),
                load_permille: 40,
                ..SystemState::default()
            };
            build(bench, name, stream, &state);
            serialise(bench, name, &stream.build(&state));
        }
        let parameter = PARAM_VALUE_DATA {
            param_value: 3.95,
            param_count: 60,
            param_index: 7,
            param_id: (*b"BATT_VOLT_MULT\0\0").into(),
            param_type: MavParamType::MAV_PARAM_TYPE_REAL32,
        };
        serialise(bench, "PARAM_VALUE", &Message::ParamValue(parameter));
    }

    fn build(bench: &mut Bench, name: &str, stream: Stream, state: &SystemState<'_>) {
        bench.measure("build", name, || {
            black_box(black_box(stream).build(black_box(state)));
        });
    }

    fn serialise(bench: &mut Bench, name: &str, message: &Message) {
        let mut framer = Framer::new();
        bench.measure("serialise", name, || {
            black_box(framer.frame(black_box(message), 1));
        });
    }

    fn sign(bench: &mut Bench) {
        let mut framer = Framer::new();
        let mut signing = with_key(SigningKey::new([7; 32]));
        let pack = typical_pack();
        let state = SystemState {
            batteries: core::slice::from_ref(&pack),
            ..SystemState::default()
        };
        let message = Stream::BatteryStatus(Pack::First).build(&state);
        bench.measure("serialise and sign", "BATTERY_STATUS, typical", || {
            black_box(framer.signed_frame(
                black_box(&message),
                1,
                &mut signing,
                LinkKind::Radio,
                Instant::EPOCH,
            ));
        });
    }

    fn update(bench: &mut Bench) {
        for (name, measures_current) in [("voltage", false), ("voltage and current", true)] {
            let mut pack = PackInUse::new(measures_current);
            bench.measure("update a pack by", name, || pack.update());
        }
    }

    fn typical_pack() -> BatteryState {
        BatteryState {
            status: PackStatus::Healthy,
            charge_state: ChargeState::Ok,
            readings: Readings {
                voltage_v: Some(11.62),
                current_a: Some(4.31),
                remaining_pct: Some(72.3),
                time_remaining_s: Some(1342.0),
                ..Readings::NONE
            },
            consumed: Some(Amount::Mah(612.0)),
            consumed_wh: Some(7.2),
            ..BatteryState::UNKNOWN
        }
    }

    fn full_pack() -> BatteryState {
        let mut battery = typical_pack();
        battery.temperature_c = Some(31.5);
        battery.readings.faults = Faults::all();
        battery.capacity = Some(Amount::Mah(2200.0));
        battery.cells = CellVoltages::from_millivolts(&[3870; 14]);
        battery.details = PackDetails {
            serial_number: Some(4711),
            cycle_count: Some(123),
            design_capacity_mah: Some(2300.0),
            design_voltage_v: Some(51.8),
            state_of_health_pct: Some(96),
            ..PackDetails::NONE
        };
        battery
    }

    fn tank() -> BatteryState {
        BatteryState {
            status: PackStatus::Healthy,
            contents: Contents::Fuel,
            capacity: Some(Amount::Ml(1500.0)),
            consumed: Some(Amount::Ml(400.0)),
            readings: Readings {
                remaining_pct: Some(73.3),
                ..Readings::NONE
            },
            ..BatteryState::UNKNOWN
        }
    }

    /// Signing as it starts with this key in flash.
    fn with_key(key: Option<SigningKey>) -> Signing {
        let mut stored = StoredSigning::default();
        let Some(key) = key else {
            return stored.restore(Condition::Blank);
        };
        for (key, word) in StoredSigning::default().words(&ToStore::Key(key)) {
            stored.found(key, word);
        }
        stored.restore(Condition::Intact)
    }

    /// A 3S pack whose load changes every second.
    struct PackInUse {
        monitor: BatteryMonitor,
        state: BatteryState,
        settings: PackSettings,
        measures_current: bool,
        tick: Tick,
    }

    impl PackInUse {
        /// In use for two minutes, after a rest: its charge is known.
        fn new(measures_current: bool) -> Self {
            let mut pack = Self::at_rest(measures_current);
            for _ in 0..1200 {
                pack.update();
            }
            pack
        }

        fn at_rest(measures_current: bool) -> Self {
            Self {
                monitor: BatteryMonitor::new(),
                state: BatteryState::default(),
                settings: PackSettings {
                    cell_count: Some(3),
                    capacity_mah: Some(2200.0),
                    ..PackSettings::default()
                },
                measures_current,
                tick: Tick::default(),
            }
        }

        fn update(&mut self) {
            self.tick.now = self.tick.now.after_us(100_000);
            let current_a = if (self.tick.now.as_micros() / 1_000_000).is_multiple_of(2) {
                2.0
            } else {
                7.0
            };
            let measurement = Measurement {
                voltage_v: Some(11.4 - 0.05 * current_a),
                current_a: self.measures_current.then_some(current_a),
                ..Measurement::default()
            };
            let reading = black_box(Ok(measurement));
            let update = self
                .monitor
                .update(&mut self.state, self.tick, reading, &self.settings);
            // Not by value, which would be copied.
            black_box(&update);
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!("This is firmware for the board. `cargo bench` runs it on the emulated one.");
    std::process::exit(2);
}
