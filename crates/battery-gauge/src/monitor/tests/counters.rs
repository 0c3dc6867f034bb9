//! Counters that others keep: in steps, seldom, from another start after they were without power.

use super::*;

/// A pack behind a companion that counts.
struct Counted3S {
    bench: MonitorBench,
    /// True charge left, in milliampere-hours.
    left_mah: f32,
    capacity_mah: f32,
    /// Step of the counter, in milliampere-hours, and what it has counted.
    step_mah: f32,
    counted_mah: f32,
    /// Between two readings, in seconds.
    period_s: f32,
    /// Share of the current that its sensor shows, if there is one.
    shown: Option<f32>,
    has_counter: bool,
    /// Time of the load's profile, in seconds.
    time_s: f32,
}

impl Counted3S {
    fn full(capacity_mah: f32, step_mah: f32) -> Self {
        let mut bench = MonitorBench::new();
        bench.settings.capacity_mah = Some(capacity_mah);
        Self {
            bench,
            left_mah: capacity_mah,
            capacity_mah,
            step_mah,
            counted_mah: 0.0,
            period_s: 0.1,
            shown: Some(1.0),
            has_counter: true,
            time_s: 0.0,
        }
    }

    fn soc(&self) -> f32 {
        self.left_mah / self.capacity_mah
    }

    /// The reading at this current, whose total is one of whole steps.
    fn reading(&self, current_a: f32) -> Measurement {
        let resistance_ohm = 3.0 * 12.0 / self.capacity_mah;
        let resting_v = 3.0 * Chemistry::LiPo.cell().curve.voltage_v(self.soc());
        let total_mah = (self.counted_mah / self.step_mah).floor() * self.step_mah;
        Measurement {
            current_a: self.shown.map(|shown| shown * current_a),
            counted: self.has_counter.then_some(Counted::TotalCharge(total_mah)),
            ..volts(resting_v - current_a * resistance_ohm)
        }
    }

    /// Some seconds with a load that changes every few seconds about a mean, in amperes; negative while charging, which the
    /// counter does not count.
    fn run(&mut self, seconds: f32, mean_a: f32) {
        let end_s = self.time_s + seconds;
        while self.time_s < end_s {
            let phase = (self.time_s / 4.0).floor() % 3.0;
            let current_a = if mean_a > 0.0 { mean_a * phase } else { mean_a };
            let drawn_mah = current_a * self.period_s / 3.6;
            self.left_mah = (self.left_mah - drawn_mah).min(self.capacity_mah);
            self.counted_mah += drawn_mah.max(0.0);
            self.time_s += self.period_s;
            let reading = self.reading(current_a);
            self.bench.tick_after(self.period_s, Ok(reading));
        }
    }

    fn drive(&mut self, seconds: f32, mean_a: f32) {
        self.bench.load_state = LoadState::On;
        self.run(seconds, mean_a);
        self.bench.load_state = LoadState::Off;
    }

    fn remaining_pct(&self) -> f32 {
        self.bench.state.readings.remaining_pct.expect("reported")
    }

    /// Error of the reported charge, in points, beyond what is allowed for.
    fn excess_pct(&self) -> f32 {
        let error_pct = (self.remaining_pct() - self.soc() * 100.0).abs();
        let step_pct = self.step_mah / self.capacity_mah * 100.0;
        let allowed_pct = match self.shown {
            Some(_) => 2.0,
            None => step_pct + 2.0f32.max(self.bench.state.remaining_uncertainty_pct()),
        };
        error_pct - allowed_pct
    }

    fn learnt_mah(&self) -> Option<f32> {
        self.bench.monitor.learnt().and_then(LearntPack::capacity_mah)
    }
}

#[test]
// Requirement: S-10
fn steps_of_a_counter_are_not_counted_on_top_of_the_current() {
    for step_mah in [0.1, 1.0, 10.0, 50.0, 100.0] {
        let mut pack = Counted3S::full(5000.0, step_mah);
        pack.run(30.0, 0.0);
        pack.drive(1800.0, 4.0);
        let excess_pct = pack.excess_pct();
        assert!(excess_pct < 0.0, "{step_mah} mAh: {excess_pct} points");
        assert_about(pack.bench.state.consumed_mah(), 2000.0, step_mah + 1.0);
    }
}

#[test]
fn what_a_counter_shows_beyond_the_current_is_drawn_whatever_its_step() {
    for step_mah in [1.0, 20.0] {
        let mut pack = Counted3S::full(5000.0, step_mah);
        pack.shown = Some(0.5);
        pack.run(30.0, 0.0);
        pack.drive(1800.0, 4.0);
        assert_about(Some(pack.remaining_pct()), 60.0, 3.0);
    }
}

#[test]
// Requirement: S-10
fn a_pack_that_is_charged_in_place_has_what_it_was_charged_to() {
    for shown in [Some(1.0), None] {
        let mut pack = Counted3S::full(5000.0, 1.0);
        pack.shown = shown;
        pack.run(30.0, 0.0);
        pack.drive(3600.0, 3.0);
        assert_about(Some(pack.remaining_pct()), 40.0, 10.0);
        pack.run(3600.0, -3.0);
        pack.run(120.0, 0.0);
        let remaining_pct = pack.remaining_pct();
        println!("{shown:?}: {remaining_pct} of {}", pack.soc() * 100.0);
        assert!(remaining_pct > 85.0);
        // The counter stays a limit of what is left from there.
        pack.drive(1800.0, 3.0);
        assert_about(Some(pack.remaining_pct()), 70.0, 12.0);
    }
}

#[test]
// Requirement: S-10
fn a_first_total_that_the_rest_denies_was_drawn_from_another_pack() {
    for shown in [Some(1.0), None] {
        let mut pack = Counted3S::full(2200.0, 1.0);
        pack.shown = shown;
        pack.bench.settings.failsafe.low.remaining_mah = Some(500.0);
        pack.counted_mah = 3000.0;
        let mut reported = Vec::new();
        for _ in 0..60 {
            pack.run(1.0, 0.0);
            reported.extend(pack.bench.state.readings.remaining_pct);
            let remaining = pack.bench.state.remaining_or_counted();
            assert!(
                remaining.is_none_or(|mah| mah > 2000.0),
                "{shown:?}: {remaining:?}"
            );
        }
        assert!(reported.iter().all(|pct| *pct > 90.0), "{shown:?}: {reported:?}");
        assert!(reported.len() > 49, "within ten seconds");
        assert_eq!(pack.bench.state.consumed_mah(), Some(3000.0), "as it is sent");
        let states = [ChargeState::Undefined, ChargeState::Ok];
        assert!(states.contains(&pack.bench.state.charge_state));
        pack.drive(600.0, 3.0);
        let expected = pack.soc() * 100.0;
        assert_about(Some(pack.remaining_pct()), expected, 5.0);
    }
}

#[test]
fn a_first_total_that_fits_the_rest_is_this_packs() {
    let mut pack = Counted3S::full(5000.0, 1.0);
    (pack.left_mah, pack.counted_mah) = (2000.0, 3000.0);
    pack.run(30.0, 0.0);
    assert_about(Some(pack.remaining_pct()), 40.0, 5.0);
    assert!(pack.bench.state.left_at_most.expect("counted") < 0.5);
}

fn total(charge_mah: f32, energy_wh: f32) -> Measurement {
    Measurement {
        counted: Some(Counted::Total(Consumed {
            charge_mah,
            energy_wh,
        })),
        ..loaded(10.0, 0.36)
    }
}

fn total_without_energy(charge_mah: f32) -> Measurement {
    Measurement {
        counted: Some(Counted::TotalCharge(charge_mah)),
        ..total(charge_mah, 0.0)
    }
}

#[test]
fn an_energy_that_is_unknown_for_a_while_is_not_counted_twice() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, total(500.0, 5.0));
    // A thousand seconds at 3.6 W.
    bench.run(1000.0, total_without_energy(600.0));
    assert_about(bench.state.consumed_wh, 6.0, 0.01);
    bench.run(1.0, total(600.0, 6.1));
    assert_about(bench.state.consumed_wh, 6.1, 0.01);
}

#[test]
fn a_late_first_energy_was_drawn_before() {
    let mut bench = MonitorBench::new();
    bench.run(1000.0, total_without_energy(100.0));
    assert_about(bench.state.consumed_wh, 1.0, 0.01);
    bench.run(1.0, total(100.0, 440.0));
    assert_about(bench.state.consumed_wh, 1.0, 0.01);
    bench.run(1.0, total(100.0, 441.0));
    assert_about(bench.state.consumed_wh, 2.0, 0.01);
}

#[test]
// Requirement: L-12
fn a_total_that_falls_and_comes_back_was_never_drawn() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, total(1000.0, 10.0));
    bench.run(1.0, total(1010.0, 10.1));
    for _ in 0..3 {
        bench.run(1.0, total(0.0, 0.0));
        bench.run(1.0, total(1010.0, 10.1));
    }
    assert_about(bench.state.consumed_mah(), 1010.0, 0.1);
    assert_about(bench.state.consumed_wh, 10.1, 0.01);
    // Its count beyond that is drawn, and so is its count after a restart.
    bench.run(1.0, total(0.0, 0.0));
    bench.run(1.0, total(1030.0, 10.3));
    assert_about(bench.state.consumed_mah(), 1030.0, 0.1);
    bench.run(1.0, total(0.0, 0.0));
    bench.run(1.0, total(5.0, 0.05));
    assert_about(bench.state.consumed_mah(), 1035.0, 0.1);
}

#[test]
fn a_source_that_was_silent_may_have_counted_much() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, total(0.0, 0.0));
    bench.run(1.0, total(1.0, 0.01));
    bench.tick_after(300.0, Ok(total(900.0, 9.0)));
    assert_about(bench.state.consumed_mah(), 900.0, 0.1);
}

#[test]
fn the_total_of_another_component_is_a_base() {
    let mut bench = MonitorBench::new();
    bench.run(1.0, total(100.0, 1.0));
    bench.monitor.change_counter();
    bench.run(1.0, total(1500.0, 15.0));
    assert_about(bench.state.consumed_mah(), 100.0, 0.1);
    bench.run(1.0, total(1501.0, 15.0));
    assert_about(bench.state.consumed_mah(), 101.0, 0.1);
}

#[test]
fn a_braking_motor_at_one_end_of_a_gap_charges_nothing() {
    for (before_a, after_a, counted_mah) in [
        (3.6, -32.4, 18.0),
        (-32.4, 3.6, 18.0),
        (-3.6, -3.6, -36.0),
        (3.6, 7.2, 54.0),
    ] {
        let mut bench = MonitorBench::new();
        bench.run(1.0, loaded(11.5, 0.0));
        bench.tick(Ok(loaded(11.5, before_a)));
        let at_start_mah = bench.state.consumed_mah().expect("counted");
        bench.tick_after(36.0, Ok(loaded(11.5, after_a)));
        let counted = bench.state.consumed_mah().expect("counted") - at_start_mah;
        assert_about(Some(counted), counted_mah, 0.1);
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]
    /// A pack behind a counter with any step, read seldom or often, that restarts and is charged in place, is reported as what
    /// flowed, and learns what it learns without the counter.
    #[test]
    fn counters_of_others_are_followed_as_what_flowed(
        capacity_mah in 2000.0..20_000.0f32,
        step_mah in prop_oneof![Just(0.1f32), Just(1.0), 0.1..100.0f32],
        period_s in prop_oneof![Just(0.1f32), Just(1.0), 0.2..5.0f32],
        rate in 0.2..0.8f32,
        is_measured: bool,
        restarts in prop::collection::vec(0.1..0.9f32, 0..3),
        // In shares of what a drive draws at its mean load. Not to between 95 % and full: a rest there is that of a full pack,
        // whatever counts. A drive may draw some more than at its mean, so to be full takes longer.
        recharged in prop::option::of(prop_oneof![0.3..0.92f32, Just(1.2)]),
    ) {
        let shown = is_measured.then_some(1.0);
        let run = |has_counter| {
            let mut pack = Counted3S {
                period_s,
                shown,
                has_counter,
                ..Counted3S::full(capacity_mah, step_mah)
            };
            pack.bench.monitor.restore_learnt(LearntPack::UNKNOWN);
            let load_a = rate * capacity_mah * 1e-3;
            let drive_s = 0.7 / rate * 3600.0;
            let mut worst_pct = f32::NEG_INFINITY;
            pack.run(60.0, 0.0);
            for part in 0..10 {
                if restarts.iter().any(|at| (at * 10.0) as u32 == part) {
                    pack.counted_mah = 0.0;
                }
                pack.drive(drive_s / 10.0, load_a);
                worst_pct = worst_pct.max(pack.excess_pct());
            }
            pack.run(120.0, 0.0);
            let learnt_mah = pack.learnt_mah();
            if let Some(share) = recharged {
                pack.run(share * 0.7 * 3600.0, -capacity_mah * 1e-3);
                pack.run(300.0, 0.0);
                worst_pct = worst_pct.max(pack.excess_pct());
            }
            (worst_pct, learnt_mah)
        };
        let (excess_pct, learnt_mah) = run(true);
        prop_assert!(excess_pct <= 0.0, "{excess_pct} points too far");
        if is_measured {
            let (_, without_mah) = run(false);
            let ratio = learnt_mah.zip(without_mah).map(|(with, without)| with / without);
            prop_assert!(ratio.is_none_or(|ratio| (0.97..1.03).contains(&ratio)), "{ratio:?}");
            prop_assert_eq!(learnt_mah.is_some(), without_mah.is_some());
        }
    }
}
