//! Power cuts and failing operations at any moment.

use proptest::prelude::*;

use super::*;

const SECTORS: usize = 6;

#[derive(Clone, Copy, Debug)]
enum Step {
    Open,
    Close,
    Append { seed: u64, length: usize },
    Date,
    Erase { target: u32 },
    EraseAll,
    Restart,
}

fn step() -> impl Strategy<Value = Step> {
    prop_oneof![
        3 => Just(Step::Open),
        1 => Just(Step::Close),
        6 => (any::<u64>(), 1..9000_usize).prop_map(|(seed, length)| Step::Append { seed, length }),
        2 => Just(Step::Date),
        8 => (1..=SECTORS as u32).prop_map(|target| Step::Erase { target }),
        1 => Just(Step::EraseAll),
        1 => Just(Step::Restart),
    ]
}

impl Step {
    fn run(self, recorder: &mut Recorder<SECTORS>) -> Result<(), PowerLost> {
        match self {
            Self::Open => {
                let newest = recorder.files.last().map_or(0, |(number, _)| *number);
                if let Ok(number) = recorder.open() {
                    assert!(number > newest, "{number} after {newest}");
                }
            }
            Self::Close => recorder.close(),
            Self::Append { seed, length } => {
                let _ = recorder.append(&bytes(seed, length))?;
            }
            Self::Date => recorder.date()?,
            Self::Erase { target } => {
                recorder.erase_one(target)?;
            }
            Self::EraseAll => recorder.erase_all(),
            Self::Restart => {
                recorder.close();
                start_again(recorder, &[]);
            }
        }
        Ok(())
    }
}

/// Content without what reads as blank at its end.
fn trimmed(content: &[u8]) -> &[u8] {
    let length = content
        .iter()
        .rposition(|byte| *byte != 0xFF)
        .map_or(0, |last| last + 1);
    &content[..length]
}

/// Restarts, and checks what is found: every file that was listed, and of the open one all that was appended, with no more
/// behind it than what was `in_flight`. A file that was removed may be there again, whole.
fn start_again(recorder: &mut Recorder<SECTORS>, in_flight: &[u8]) {
    let open = recorder.ring.open_file();
    let before = std::mem::take(&mut recorder.files);
    recorder.flash.power_up();
    recorder.restart();
    let found = recorder.listed();
    for (number, content) in &found {
        let known = &recorder.history[number];
        if open.is_some_and(|open| open.number == *number) {
            let common = known.len().min(content.len());
            assert_eq!(content[..common], known[..common], "file {number}");
            assert!(trimmed(known).len() <= content.len() && content.len() <= known.len() + in_flight.len());
        } else {
            assert!(
                trimmed(known) == trimmed(content),
                "file {number} of {}",
                known.len()
            );
        }
    }
    let numbers: Vec<_> = found.iter().map(|(number, _)| *number).collect();
    assert!(numbers.is_sorted_by(|a, b| a < b), "{numbers:?}");
    for (number, content) in &before {
        assert!(
            trimmed(content).is_empty() || numbers.contains(number),
            "file {number} is lost"
        );
    }
    recorder.history.extend(found.iter().cloned());
    recorder.files = found;
}

/// Runs `steps` until a power cut, and starts again after it. Returns the number of steps run, with the interrupted one.
fn run_until_power_cut(recorder: &mut Recorder<SECTORS>, steps: &[Step]) -> usize {
    for (index, step) in steps.iter().enumerate() {
        if let Err(lost) = step.run(recorder) {
            start_again(recorder, &lost.in_flight);
            recorder.assert_files();
            return index + 1;
        }
        recorder.assert_files();
    }
    steps.len()
}

/// After whatever happened, files can be recorded.
fn assert_goes_on(recorder: &mut Recorder<SECTORS>) {
    recorder.close();
    recorder.erase(3);
    recorder.record_sectors(3);
    start_again(recorder, &[]);
    assert_eq!(recorder.files.last().unwrap().1, bytes(2, 4064));
}

/// Cuts power in every operation of `steps`, in `ways` ways each, and soon after once more.
fn cut_everywhere(flash: &Flash<SECTORS>, steps: &[Step], ways: u64) {
    let mut recorder = Recorder::on(flash.clone());
    let done = recorder.flash.operations();
    assert_eq!(run_until_power_cut(&mut recorder, steps), steps.len());
    let operations = recorder.flash.operations() - done;
    for seed in 0..operations * ways {
        let mut recorder = Recorder::on(flash.clone());
        recorder.flash.cut_power_after(seed / ways, seed);
        let mut run = run_until_power_cut(&mut recorder, steps);
        recorder.flash.cut_power_after(seed % 13, !seed);
        run += run_until_power_cut(&mut recorder, &steps[run..]);
        recorder.flash.power_up();
        run_until_power_cut(&mut recorder, &steps[run..]);
        assert_goes_on(&mut recorder);
    }
}

#[test]
fn power_cut_in_any_operation_of_a_rotation_harms_no_other_file() {
    let mut recorder = Recorder::<SECTORS>::with_erased(6);
    recorder.record(&bytes(1, 9000));
    recorder.record(&bytes(2, 5000));
    let append = |seed, length| Step::Append { seed, length };
    let erase = Step::Erase { target: 2 };
    let lap = [
        [erase, erase, Step::Open, append(3, 500), append(4, 3900)],
        [erase, erase, append(5, 300), Step::Open, append(6, 4100)],
        [Step::Date, erase, erase, Step::EraseAll, Step::Open],
        [append(7, 300), Step::Date, erase, erase, append(8, 4000)],
    ];
    cut_everywhere(&recorder.flash, lap.as_flattened(), 40);
}

#[test]
fn power_cut_while_the_last_file_of_all_is_erased_leaves_no_half_erased_sector() {
    let mut recorder = Recorder::<SECTORS>::with_erased(2);
    recorder.record(&bytes(1, 3000));
    let erase = Step::Erase { target: 1 };
    cut_everywhere(
        &recorder.flash,
        &[&[Step::EraseAll][..], &[erase; 8]].concat(),
        200,
    );
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(300))]

    #[test]
    fn arbitrary_recordings_survive_power_cuts(
        runs in prop::collection::vec((prop::collection::vec(step(), 1..30), 0..120_u64, any::<u64>()), 1..6),
    ) {
        let mut recorder = Recorder::<SECTORS>::new();
        for (steps, operations, seed) in runs {
            recorder.flash.cut_power_after(operations, seed);
            run_until_power_cut(&mut recorder, &steps);
        }
        recorder.flash.power_up();
        assert_goes_on(&mut recorder);
    }

    #[test]
    fn arbitrary_recordings_survive_failing_operations(
        runs in prop::collection::vec((prop::collection::vec(step(), 1..20), 0..60_u64), 1..6),
    ) {
        let mut recorder = Recorder::<SECTORS>::new();
        for (steps, operations) in runs {
            recorder.flash.refuse_after(operations);
            run_until_power_cut(&mut recorder, &steps);
        }
        recorder.flash.power_up();
        assert_goes_on(&mut recorder);
    }
}
