//! Firmware that does one thing at a time, so that its instructions can be counted on the emulated RP2040.
//!
//! `cargo bench --bench instructions` builds it, runs it and prints the counts. GP22 is high while something is measured.
#![cfg_attr(target_os = "none", no_std, no_main)]

#[cfg(target_os = "none")]
mod firmware {
    use core::hint::black_box;

    use cortex_m_rt::entry;
    use defmt_rtt as _;
    use embassy_rp::gpio::{Level, Output};
    use panic_probe as _;
    use rover_battmon::battery::{BatteryMonitor, Measurement, PackSettings, Tick};
    use rover_battmon::mavlink::{
        FrameParser, Framer, LinkKind, Message, Signing, SigningKey, StoredSigning, Stream, SystemState,
        ToStore,
    };

    /// A mixed stream from a ground station, written by the bench: 64-byte chunks of frames.
    const STREAM: &[u8] = include_bytes!("../benches/data/mixed_stream.bin");

    const CHUNK_BYTES: usize = 64;

    /// The emulator looks at the pin every ten microseconds: so many that this does not matter.
    const SERIALISATIONS: u64 = 1000;

    /// The same for a pack's readings: 100 s of them.
    const UPDATES: u64 = 1000;

    #[entry]
    fn main() -> ! {
        let peripherals = embassy_rp::init(Default::default());
        let mut measuring = Output::new(peripherals.PIN_22, Level::Low);

        let mut parser = FrameParser::new();
        let mut frames = 0u32;
        measuring.set_high();
        for chunk in black_box(STREAM).chunks(CHUNK_BYTES) {
            parser.push(chunk);
            while let Some(frame) = parser.next_frame() {
                black_box(frame);
                frames += 1;
            }
        }
        measuring.set_low();
        defmt::info!("receive {} bytes, {} frames", STREAM.len(), frames);

        let state = SystemState::default();
        let mut framer = Framer::new();
        for stream in [Stream::Heartbeat, Stream::SysStatus, Stream::BatteryStatus(0)] {
            let message: Message = stream.build(black_box(&state));
            measuring.set_high();
            for _ in 0..SERIALISATIONS {
                black_box(framer.frame(black_box(&message), 1));
            }
            measuring.set_low();
            defmt::info!("serialise {}", stream);
        }

        let mut signing = with_key(SigningKey::new([7; 32]));
        let message: Message = Stream::BatteryStatus(0).build(black_box(&state));
        measuring.set_high();
        for _ in 0..SERIALISATIONS {
            black_box(framer.signed_frame(black_box(&message), 1, &mut signing, LinkKind::Radio, 0));
        }
        measuring.set_low();
        defmt::info!("serialise and sign");

        for measures_current in [false, true] {
            let mut pack = PackInUse::new(measures_current);
            measuring.set_high();
            for _ in 0..UPDATES {
                pack.update();
            }
            measuring.set_low();
            defmt::info!(
                "battery update, current {}: {} %",
                measures_current,
                pack.remaining_pct()
            );
        }
        loop {
            cortex_m::asm::wfe();
        }
    }

    /// Signing as it starts with this key in flash.
    fn with_key(key: Option<SigningKey>) -> Signing {
        let mut stored = StoredSigning::default();
        if let Some(key) = key {
            for (key, word) in StoredSigning::default().words(&ToStore::Key(key)) {
                stored.found(key, word);
            }
        }
        stored.restore(Ok(()))
    }

    /// A 3S pack whose load changes every second.
    struct PackInUse {
        monitor: BatteryMonitor,
        settings: PackSettings,
        measures_current: bool,
        tick: Tick,
    }

    impl PackInUse {
        fn new(measures_current: bool) -> Self {
            Self {
                monitor: BatteryMonitor::new(),
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
            self.tick.now_us += 100_000;
            let current_a = if (self.tick.now_us / 1_000_000).is_multiple_of(2) {
                2.0
            } else {
                7.0
            };
            let measurement = Measurement {
                voltage_v: Some(11.4 - 0.05 * current_a),
                current_a: self.measures_current.then_some(current_a),
                ..Measurement::default()
            };
            black_box(
                self.monitor
                    .update(self.tick, black_box(Ok(measurement)), &self.settings),
            );
        }

        fn remaining_pct(&self) -> f32 {
            self.monitor.state().remaining_pct.unwrap_or(-1.0)
        }
    }
}

#[cfg(not(target_os = "none"))]
fn main() {
    eprintln!(
        "This is firmware for the board. `cargo bench --bench instructions` runs it on the emulated one."
    );
    std::process::exit(2);
}
