//! What a replay writes to destroys nothing, whichever option names it.

use std::collections::BTreeMap;
use std::ffi::OsStr;
use std::fs;
use std::os::unix::ffi::OsStrExt;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crate::generator::Owned;
use crate::program::{Run, folder, replay};

/// An option, what is replayed with it, and a name for its file.
#[derive(Clone, Copy)]
struct Kind {
    option: &'static str,
    recordings: &'static str,
    file: &'static str,
}

const fn kind(option: &'static str, recordings: &'static str, file: &'static str) -> Kind {
    Kind {
        option,
        recordings,
        file,
    }
}

const KINDS: [Kind; 5] = [
    kind("--csv", "logs/a.BIN", "own.csv"),
    kind("--plot", "logs/a.BIN", "own.svg"),
    kind("--learned", "logs/a.BIN", "own.txt"),
    kind("--table", "logs", "own.parquet"),
    kind("--history", "logs", "own.html"),
];

/// Beside the table.
const FAILURES: &str = "own.failures.csv";

/// A folder with recordings.
struct Desk(PathBuf);

impl Desk {
    fn new(name: &str) -> Self {
        let desk = Self(folder(name));
        fs::create_dir(desk.path("logs")).expect("a folder");
        let mut pack = Owned::new(0);
        for log in ["logs/a.BIN", "logs/b.BIN"] {
            // The beginning of a drive is enough.
            fs::write(desk.path(log), &pack.drive()[..30_000]).expect("a file");
        }
        desk
    }

    fn path(&self, name: impl AsRef<Path>) -> PathBuf {
        self.0.join(name)
    }

    /// With files named from this folder, unless they are options.
    fn replay(&self, arguments: &[&str]) -> Run {
        let path = |argument: &&str| match argument.starts_with("--") {
            true => PathBuf::from(argument),
            false => self.path(argument),
        };
        replay(&arguments.iter().map(path).collect::<Vec<_>>(), 1)
    }

    /// With an output in a file of this folder, which succeeds.
    fn write(&self, kind: Kind, file: &str) -> Run {
        let run = self.replay(&[kind.option, file, kind.recordings]);
        assert!(run.output.status.success(), "{}", run.errors());
        run
    }

    fn content(&self, file: &str) -> Vec<u8> {
        fs::read(self.path(file)).expect("a file")
    }

    /// All files, those in the folder of logs included.
    fn contents(&self) -> BTreeMap<PathBuf, Vec<u8>> {
        let folders = [self.0.clone(), self.path("logs")];
        let entries = folders
            .iter()
            .flat_map(|folder| fs::read_dir(folder).expect("a folder"));
        let paths = entries.map(|entry| entry.expect("an entry").path());
        let files = paths.filter(|path| path.is_file());
        files
            .map(|path| (path.clone(), fs::read(path).expect("a file")))
            .collect()
    }

    /// Checks that a replay is refused for this reason, and leaves all as it was.
    fn assert_refused(&self, arguments: &[&str], reason: &str) {
        let before = self.contents();
        let run = self.replay(arguments);
        assert_eq!(
            run.output.status.code(),
            Some(2),
            "{arguments:?}: {}",
            run.errors()
        );
        assert!(run.output.stdout.is_empty(), "{arguments:?}");
        assert!(run.errors().contains(reason), "{arguments:?}: {}", run.errors());
        assert_eq!(run.errors().lines().count(), 1, "{arguments:?}: {}", run.errors());
        assert!(self.contents() == before, "{arguments:?}");
    }

    /// One of each kind that the program writes.
    fn write_all(&self) {
        for kind in KINDS {
            self.write(kind, kind.file);
        }
    }
}

#[test]
fn a_recording_is_never_an_output() {
    let desk = Desk::new("recording_kept");
    symlink("logs/a.BIN", desk.path("symbolic.BIN")).expect("a link");
    fs::hard_link(desk.path("logs/a.BIN"), desk.path("hard.BIN")).expect("a link");
    for kind in KINDS {
        for file in ["logs/a.BIN", "logs/../logs/a.BIN", "symbolic.BIN", "hard.BIN"] {
            desk.assert_refused(&[kind.option, file, kind.recordings], "is a recording to replay");
        }
    }
    // A folder found by a link, and a log that is named behind others.
    symlink("logs", desk.path("others")).expect("a link");
    for option in ["--table", "--history"] {
        desk.assert_refused(&[option, "logs/b.BIN", "others"], "is a recording to replay");
        desk.assert_refused(
            &[option, "logs/b.BIN", "logs/a.BIN", "symbolic.BIN", "logs/b.BIN"],
            "is a recording to replay",
        );
        // Its name was forgotten.
        desk.assert_refused(
            &[option, "logs/a.BIN", "logs/b.BIN"],
            "was not written by this option",
        );
        desk.assert_refused(&[option, "logs", "logs/b.BIN"], "directory");
    }
}

/// Rows are a recording, too, and what was learnt is read.
#[test]
fn an_own_file_that_is_read_is_not_an_output() {
    let desk = Desk::new("own_recording");
    desk.write_all();
    symlink("own.csv", desk.path("link.csv")).expect("a link");
    fs::hard_link(desk.path("own.csv"), desk.path("hard.csv")).expect("a link");
    for file in ["own.csv", "link.csv", "hard.csv"] {
        desk.assert_refused(&["--csv", file, "own.csv"], "is a recording to replay");
        desk.assert_refused(&["--csv", "own.csv", file], "is a recording to replay");
    }
    for option in ["--csv", "--plot"] {
        let arguments = ["--learned", "own.txt", option, "own.txt", "logs/a.BIN"];
        desk.assert_refused(&arguments, "is also what --learned writes");
    }
}

#[test]
fn two_outputs_are_never_one_file() {
    let desk = Desk::new("two_outputs");
    // Both lead to a file that does not exist yet.
    symlink("new", desk.path("link")).expect("a link");
    symlink("../new", desk.path("logs/link")).expect("a link");
    fs::write(desk.path("empty"), "").expect("a file");
    fs::hard_link(desk.path("empty"), desk.path("hard")).expect("a link");
    for [first, second] in [
        ["new", "new"],
        ["new", "logs/../new"],
        ["new", "link"],
        ["link", "logs/link"],
        ["empty", "hard"],
    ] {
        for (one, other) in [
            ("--learned", "--plot"),
            ("--plot", "--csv"),
            ("--learned", "--csv"),
        ] {
            let reason = format!("is also what {one} writes");
            desk.assert_refused(&[one, first, other, second, "logs/a.BIN"], &reason);
        }
        let arguments = ["--table", first, "--history", second, "logs"];
        desk.assert_refused(&arguments, "is also what --table writes");
    }
    let failures = ["--table", "own.parquet", "--history", FAILURES, "logs"];
    desk.assert_refused(&failures, "is also what --table writes");
}

/// Only an earlier file of the same kind is replaced.
#[test]
fn what_an_option_did_not_write_is_kept() {
    let desk = Desk::new("foreign");
    desk.write_all();
    let mut by_another_program = desk.content("own.parquet");
    // Its name is there as the writer's, and as a key.
    for _ in 0..2 {
        let name = by_another_program
            .windows(13)
            .rposition(|bytes| bytes == b"rover-battmon");
        by_another_program[name.expect("the name of the program")] = b'R';
    }
    let mut files: Vec<(String, Vec<u8>)> = [
        "a note",
        "# a note",
        "t_s,voltage_v,current_a\n0,11.1,1\n",
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"1000\">\n</svg>\n",
        "<!DOCTYPE html>\n<html lang=\"en\">\n<title>Packs</title>\n",
        "path;reason\n",
        "\n",
    ]
    .map(|text| (text.into(), text.into()))
    .into();
    files.push(("a table by another program".into(), by_another_program));
    let owns = KINDS.map(|kind| kind.file).into_iter().chain([FAILURES]);
    files.extend(owns.map(|file| (file.into(), desk.content(file))));
    let failures = kind("--table", "logs", FAILURES);
    for kind in KINDS.into_iter().chain([failures]) {
        // The place of the failures follows from that of the table.
        let [file, named] = match kind.file {
            FAILURES => ["here.failures.csv", "here.parquet"],
            _ => ["here", "here"],
        };
        let mut replaced = 0;
        for (name, content) in &files {
            fs::write(desk.path(file), content).expect("a file");
            if name == kind.file {
                desk.write(kind, named);
                replaced += 1;
            } else {
                println!("{} on {name}", kind.option);
                desk.assert_refused(
                    &[kind.option, named, kind.recordings],
                    "was not written by this option",
                );
            }
        }
        assert_eq!(replaced, 1, "{}", kind.file);
    }
}

#[test]
fn new_and_empty_files_and_pipes_take_every_output() {
    let desk = Desk::new("taken");
    desk.write_all();
    for kind in KINDS {
        let expected = desk.content(kind.file);
        fs::write(desk.path("empty"), "").expect("a file");
        desk.write(kind, "empty");
        assert!(desk.content("empty") == expected, "{}", kind.option);
        let _ = fs::remove_file(desk.path("empty.failures.csv"));
        let pipe = desk.path("pipe");
        let made = Command::new("mkfifo").arg(&pipe).status();
        assert!(made.expect("mkfifo can be started").success());
        let reader = Command::new("cat").arg(&pipe).stdout(Stdio::piped()).spawn();
        desk.write(kind, "pipe");
        let read = reader
            .expect("cat can be started")
            .wait_with_output()
            .expect("it ends");
        assert!(read.stdout == expected, "{}", kind.option);
        fs::remove_file(pipe).expect("a pipe");
        let run = desk.write(kind, "/dev/stdout");
        // Without --csv the rows follow a picture.
        assert!(run.output.stdout.starts_with(&expected), "{}", kind.option);
    }
    assert!(!Path::new("/dev/stdout.failures.csv").exists());
    assert!(!desk.path("pipe.failures.csv").exists());
}

/// A shell has opened what the rows are printed to.
#[test]
fn rows_are_not_printed_into_a_recording_or_a_picture() {
    let desk = Desk::new("printed");
    let trace = "t_s,voltage_v\n0,11.1\n";
    fs::write(desk.path("trace.csv"), trace).expect("a file");
    fs::write(desk.path("notes.txt"), "of old: ").expect("a file");
    let shell = |command: &str| {
        let replay = env!("CARGO_BIN_EXE_replay");
        let mut shell = Command::new("bash");
        shell
            .current_dir(&desk.0)
            .args(["-c", &format!("{replay} {command}")]);
        shell.output().expect("bash can be started")
    };
    for command in [
        "trace.csv >> trace.csv",
        "--csv /dev/stdout trace.csv >> trace.csv",
    ] {
        assert_eq!(shell(command).status.code(), Some(2), "{command}");
        assert_eq!(fs::read_to_string(desk.path("trace.csv")).expect("a file"), trace);
    }
    assert_eq!(shell("--plot a.svg trace.csv > a.svg").status.code(), Some(2));
    let foreign = shell("--csv /dev/stdout trace.csv >> notes.txt");
    assert_eq!(foreign.status.code(), Some(2));
    assert!(shell("trace.csv >> notes.txt").status.success());
    let notes = fs::read_to_string(desk.path("notes.txt")).expect("a file");
    assert!(notes.starts_with("of old: t_s,"), "{notes}");
    assert!(shell("trace.csv >&-").stdout.is_empty());
}

/// Of recordings, of what is written, and of what is wrong.
#[test]
fn names_of_files_can_not_write_to_the_terminal() {
    let desk = Desk::new("names");
    let name = |ending: &str| {
        let bytes = [b"\x1b[2J\r\n\xc2\x9b\xff".as_slice(), ending.as_bytes()].concat();
        desk.path(OsStr::from_bytes(&bytes))
    };
    let mut log = desk.content("logs/a.BIN");
    log.extend([0xff; 100]);
    fs::write(name("log.BIN"), &log).expect("a file");
    fs::write(name("none.BIN"), "no log").expect("a file");
    fs::write(name("note"), "a note").expect("a file");
    fs::create_dir(name("folder")).expect("a folder");
    let option = |text: &str| PathBuf::from(text);
    let own = ["own.csv", "own.svg", "own.txt", "own.parquet", "own.html"].map(name);
    let [csv, svg, txt, parquet, html] = own;
    for (arguments, lines) in [
        (
            vec![
                option("--csv"),
                csv,
                option("--plot"),
                svg,
                option("--learned"),
                txt,
                name("log.BIN"),
            ],
            4,
        ),
        (
            vec![
                option("--table"),
                parquet,
                option("--history"),
                html,
                name("folder"),
                desk.0.clone(),
            ],
            4,
        ),
        (vec![name("none.BIN")], 1),
        (vec![name("gone.csv")], 1),
        (vec![option("--table"), name("new"), name("gone")], 1),
        (vec![option("--csv"), name("note"), name("log.BIN")], 1),
        (vec![option("--history"), name("log.BIN"), name("log.BIN")], 1),
    ] {
        let run = replay(&arguments, 1);
        let said = String::from_utf8(run.output.stderr).expect("UTF-8");
        assert!(said.chars().all(|c| c == '\n' || !c.is_control()), "{said:?}");
        let named = said
            .lines()
            .filter(|line| line.contains(r"\u{1b}[2J\r\n\u{9b}\xff"));
        assert_eq!(named.count(), lines, "{said}");
    }
}

/// A name that was mistyped, or a folder that is not mounted.
#[test]
fn without_logs_the_outputs_of_before_stay() {
    let desk = Desk::new("without_logs");
    desk.write_all();
    fs::create_dir(desk.path("unmounted")).expect("a folder");
    fs::write(desk.path("text.BIN"), "a letter, not a log").expect("a file");
    for kind in &KINDS[3..] {
        for (recordings, said) in [
            (["logs", "lgos"], "lgos: No such file or directory (os error 2)\n"),
            (
                ["unmounted", "text.BIN"],
                "\nerror: no row: nothing was written\n",
            ),
        ] {
            let before = desk.contents();
            for file in [kind.file, "new"] {
                let run = desk.replay(&[&[kind.option, file], &recordings[..]].concat());
                assert_eq!(run.output.status.code(), Some(2), "{}", run.errors());
                assert!(run.errors().ends_with(said), "{}", run.errors());
            }
            assert!(desk.contents() == before, "{}: {recordings:?}", kind.option);
        }
    }
}
