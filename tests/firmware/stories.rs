//! Some of the stories of `tests/stories/` on the release firmware: voltages at its pins, texts on its wire, motors at its
//! pins. All of them run on the core, `tests/host/stories.rs`; here are those in which a converter, a clock or a flash has a part.

use crate::wheels::duties;
use emulator::{AdcFault, AdcInput};
use support::commands::REQUEST_MESSAGE;
use support::frames::{BATTERY_INFO, STATUSTEXT, last_of, of_message};
use support::motor_poles::LEFT;
use support::requests::{VEHICLE_ID, command_long, manual_control};
use support::story::{Drive, Input, Source, Story, Supplied};
use workbench::bench::{Bench, MILLISECOND};

/// ADC channels: dividers of both packs, and the first one's current sensor.
const DIVIDERS: [usize; 2] = [0, 2];
const CURRENT_SENSOR: usize = 1;

const DIVIDER: f64 = 3.95;
const AMPERES_PER_VOLT: f64 = 17.0;
const COUNTS_PER_VOLT: f64 = 4095.0 / 3.3;

/// Half throttle, so that the motors would turn if they may.
const THROTTLE: i16 = 500;

/// Interval of the control inputs.
const STEP_US: u64 = 100 * MILLISECOND;

/// Up to a tick until it is measured, and until a text has left behind other messages; a count more of the current is
/// earlier by as much.
const LATENCY_S: f64 = 0.25;

struct Stage {
    bench: Bench,
    start_us: u64,
    source: Source,
}

impl Stage {
    /// A board with the story's parameters, and no pack yet: its story begins when it is plugged in.
    fn new(story: &Story) -> Self {
        let mut parameters = vec![("BATT_MONITOR", 4.0), ("BATT_CURR_PIN", 27.0)];
        parameters.extend(
            story
                .parameters
                .iter()
                .map(|(name, value)| (name.as_str(), *value)),
        );
        let bench = Bench::configured(0, &parameters);
        let start_us = bench.time_us();
        Self {
            bench,
            start_us,
            source: Source::default(),
        }
    }

    fn time_s(&self) -> f64 {
        (self.bench.time_us() - self.start_us) as f64 * 1e-6
    }

    fn send(&mut self, request: &[u8]) {
        let now_us = self.bench.time_us();
        self.bench.uart_send(0, now_us, request);
    }

    fn set_pin(&mut self, channel: usize, pin_v: f64) {
        let code = (pin_v * COUNTS_PER_VOLT).round() as u16;
        self.bench.adc_input(channel, AdcInput::Code(code));
    }

    fn take(&mut self, input: Input) {
        self.source.take(input);
        match input {
            Input::Pack { .. } | Input::Unplug | Input::Plug | Input::Wire(_) | Input::Load { .. } => {}
            Input::Voltage { pack, volts } => self.set_pin(DIVIDERS[pack], f64::from(volts) / DIVIDER),
            Input::Current { pack, amperes } => {
                assert_eq!(pack, 0, "only the first pack has a current sensor");
                self.set_pin(CURRENT_SENSOR, f64::from(amperes) / AMPERES_PER_VOLT);
            }
            Input::SensorFails => self.bench.adc_fault(AdcFault::Stalled),
            Input::SensorWorks => self.bench.adc_fault(AdcFault::None),
            Input::Request(request) => self.send(&request.frames()),
        }
    }

    fn step(&mut self) {
        if let Some(Supplied { volts, amperes }) = self.source.supply(STEP_US as f32 * 1e-6) {
            self.set_pin(DIVIDERS[0], f64::from(volts) / DIVIDER);
            self.set_pin(CURRENT_SENSOR, f64::from(amperes) / AMPERES_PER_VOLT);
        }
        self.send(&manual_control(VEHICLE_ID, 0, THROTTLE));
        self.bench.run_for(STEP_US);
    }

    /// What the motor left in front does.
    fn motors(&self) -> Drive {
        match duties(LEFT[0], &self.bench) {
            (0.0, 0.0) => Drive::Coast,
            (1.0, 1.0) => Drive::Brake,
            _ => Drive::Turn,
        }
    }

    /// The first pack's state of health, in percent, by BATTERY_INFO.
    fn health_pct(&mut self) -> Option<u8> {
        const UNKNOWN_PCT: u8 = 255;
        let answers = self
            .bench
            .ask(&command_long(REQUEST_MESSAGE, BATTERY_INFO as f32));
        let info = of_message(&answers, BATTERY_INFO)[0];
        Some(info.u8(47)).filter(|percent| *percent != UNKNOWN_PCT)
    }

    /// The first pack's state of charge, in percent, by the latest BATTERY_STATUS.
    fn reported_pct(&mut self) -> Option<f32> {
        let frames = self.bench.frames_since(self.start_us);
        let percent = last_of(&frames, 0).remaining_pct();
        (percent >= 0).then_some(f32::from(percent))
    }

    /// The texts since the start, with the time at which they had left.
    fn texts(&mut self) -> Vec<(f64, String)> {
        let start_us = self.start_us;
        let frames = self.bench.frames_since(start_us);
        let texts = of_message(&frames, STATUSTEXT).into_iter();
        texts
            .map(|frame| ((frame.at_us - start_us) as f64 * 1e-6, frame.text(1, 50)))
            .collect()
    }
}

fn run(story: &Story) {
    let name = &story.name;
    let mut stage = Stage::new(story);
    let mut inputs = story.inputs.iter().peekable();
    let mut looks: Vec<_> = story.motors().collect();
    let mut healths = story.healths().peekable();
    let mut charges = story.charges().peekable();
    while stage.time_s() < story.end_s {
        let now_s = stage.time_s();
        while let Some((_, input)) = inputs.next_if(|(at_s, _)| *at_s <= now_s + 1e-6) {
            stage.take(*input);
        }
        looks.retain(|(at_s, expected)| {
            let is_due = *at_s + LATENCY_S <= now_s;
            if is_due {
                assert_eq!(stage.motors(), *expected, "{name} at {now_s} s");
            }
            !is_due
        });
        if let Some((at_s, expected_pct)) = healths.next_if(|(at_s, _)| *at_s + LATENCY_S <= now_s) {
            story.check_health(at_s, stage.health_pct(), expected_pct);
        }
        if let Some(at_s) = charges.next_if(|at_s| at_s + LATENCY_S <= now_s) {
            story.check_charge(at_s, stage.reported_pct(), stage.source.charge_pct());
        }
        stage.step();
    }
    assert!(charges.next().is_none(), "{name} ends too soon");
    assert!(healths.next().is_none(), "{name} ends too soon");
    assert!(looks.is_empty(), "{name} ends too soon");
    story.check_texts(&stage.texts(), LATENCY_S);
}

/// A test for each story.
macro_rules! stories {
    ($($name:ident)*) => {
        $(
            #[test]
            fn $name() {
                let stories = Story::all();
                let story = stories.iter().find(|story| story.name == stringify!($name));
                run(story.expect("a story of this name"));
            }
        )*
    };
}

stories! {
    // Timers, to the tick, and a level that stays.
    low_voltage_has_to_last
    // A converter that stalls, and works again.
    sensor_lost_while_driving
    // Single readings without a pack.
    sense_wire_that_flickers
    // Two inputs.
    the_most_severe_of_two_packs
    // A current below the offset of its sensor.
    charging
    // Motors that coast, and turn with another pack.
    terminate_ends_with_a_fuller_pack
    // Packs that are taken out and put in, and a wire that is loose.
    another_pack_while_usb_keeps_the_board_on
    the_same_pack_put_back
    loose_wire_at_the_voltage
    // A pack that is learnt, kept in flash, and forgotten with the next.
    aged_pack_is_swapped
}
