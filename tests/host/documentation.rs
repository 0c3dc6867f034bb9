//! What the documents name exists: paths, links, pins, and what the firmware is said to say.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use rover_battmon::autopilot::{FlashStore, Notice};
use rover_battmon::battery::{
    Amount, ArmingFailure, BusError, ChargeState, CurrentRange, CurrentScale, FailsafeLevel, Faults, Gap,
    MissingSetting, PackEvent, PackNotice, ReadError, SupplyEvent,
};
use rover_battmon::crash::{CrashCause, CrashRecord, FaultSite, STACK_WORDS, TaskName, headline};
use rover_battmon::mavlink::{DefaultRate, StreamGroup, StreamKind, Subject};
use rover_battmon::memory::identity::FirmwareHash;
use rover_battmon::memory::storage::StorageError;
use rover_battmon::pack::{Pack, PackSet};
use rover_battmon::parameter::{BatteryParameter, ParameterTrouble, Refused, StickParameter};
use rover_battmon::sensor::{CanReport, FuelCellState};
use rover_battmon::system::ArmingObstacle;
use rover_battmon::vehicle::{FailsafeAction, VehicleEvent};
use rover_battmon::wifi::WifiReport;
use support::motor_poles::{Motor, motors};
use support::repository;

/// What stands in front of a path from the top of the repository.
const TOP_FOLDERS: [&str; 7] = [
    "src/",
    "tools/",
    "tests/",
    "docs/",
    "examples/",
    "benches/",
    ".ci/",
];

/// The file of another project that a requirement names.
const NOT_OURS: &str = "src/communication/mavlink/handlers/telemetry.rs";

/// Every file below `folder` with this extension, build results and hidden folders aside.
fn files_below(folder: &Path, extension: &str) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).expect("the folder can be listed") {
        let path = entry.expect("it can be listed").path();
        let name = path.file_name().expect("a name").to_string_lossy();
        if path.is_dir() && name != "target" && !name.starts_with('.') {
            found.extend(files_below(&path, extension));
        } else if path.extension().is_some_and(|found| found == extension) {
            found.push(path);
        }
    }
    found
}

fn read(path: &Path) -> String {
    fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()))
}

/// The documents, with their text.
fn documents() -> Vec<(PathBuf, String)> {
    let paths = files_below(repository(), "md").into_iter();
    let documents: Vec<_> = paths.map(|path| (path.clone(), read(&path))).collect();
    assert!(!documents.is_empty(), "no document was found");
    documents
}

/// A document with what stands in blocks of code left out.
fn prose(text: &str) -> String {
    text.split("```").step_by(2).collect()
}

/// The targets of the links in a document.
fn links(text: &str) -> Vec<String> {
    let prose = prose(text);
    let behind = prose.split("](").skip(1);
    behind
        .filter_map(|rest| rest.split_once(')'))
        .map(|(target, _)| target.into())
        .collect()
}

/// The name by which a heading is linked to, as GitHub makes it.
fn anchor(heading: &str) -> String {
    let kept = heading.trim().chars().filter_map(|c| match c {
        ' ' => Some('-'),
        _ if c.is_alphanumeric() || c == '-' || c == '_' => Some(c.to_ascii_lowercase()),
        _ => None,
    });
    kept.collect()
}

fn has_anchor(text: &str, wanted: &str) -> bool {
    let prose = prose(text);
    let mut headings = prose.lines().filter(|line| line.starts_with('#'));
    headings.any(|line| anchor(line.trim_start_matches('#')) == wanted)
}

#[test]
fn every_relative_link_leads_somewhere() {
    let mut broken = Vec::new();
    let mut followed = 0;
    for (document, text) in documents() {
        for link in links(&text).into_iter().filter(|link| !link.contains("://")) {
            followed += 1;
            let (path, anchor) = link.split_once('#').unwrap_or((&link, ""));
            let target = match path {
                "" => document.clone(),
                _ => document.parent().expect("it lies in a folder").join(path),
            };
            let leads = match anchor {
                "" => target.exists(),
                _ => target.exists() && has_anchor(&read(&target), anchor),
            };
            if !leads {
                broken.push(format!("{}: {link}", document.display()));
            }
        }
    }
    assert!(broken.is_empty(), "{broken:#?}");
    assert!(followed > 0, "no link was found");
}

/// A recipe for an addition in CONTRIBUTING.md, and the last one that was made by it.
struct Recipe {
    name: &'static str,
    /// A file with the rows of its kind, and the last of them.
    rows: (&'static str, &'static str),
    /// By its name in the sources, or on the wire.
    is_named_in: fn(&str) -> bool,
    /// The name of its own file, which the page has as `<part>`.
    file: &'static str,
}

const RECIPES: [Recipe; 2] = [
    Recipe {
        name: "part",
        rows: ("src/sensor/bus/registry.rs", "        Bebop = ();\n    }\n}\n"),
        is_named_in: |text| text.contains("Bebop") && !text.contains("const RECIPES"),
        file: "bebop",
    },
    Recipe {
        name: "message",
        rows: (
            "src/mavlink/messages/mod.rs",
            "build_usable_charge;\n    }\n    answers {\n",
        ),
        is_named_in: |text| {
            let mut words = text.split(|c: char| !c.is_ascii_alphanumeric());
            text.contains("UsableCharge")
                || text.contains("build_usable_charge")
                || words.any(|word| word == "USABL")
        },
        file: "named_value_float",
    },
];

/// Pages that explain how to add something, name a part as an example or have what was added.
const OF_ALL_ADDITIONS: [&str; 3] = ["CHANGELOG.md", "CONTRIBUTING.md", "docs/extending.md"];

/// Compressed files, and checksums of them, name nothing.
fn is_compressed(path: &str) -> bool {
    path == "docs/general.json" || path.ends_with(".gz") || path.ends_with(".xz")
}

impl Recipe {
    /// The files that the page lists.
    fn listed(&self) -> BTreeSet<String> {
        let page = read(&repository().join("CONTRIBUTING.md"));
        let [begin, end] = ["begins", "ends"].map(|what| format!("<!-- {} {what} -->", self.name));
        let (_, rest) = page.split_once(&begin).expect("a recipe");
        let (rows, _) = rest.split_once(&end).expect("its end");
        let spans = rows.split('`').skip(1).step_by(2);
        spans
            .filter(|span| span.contains('/') && span.contains('.') && !span.contains(' '))
            .map(|path| path.replace(&format!("<{}>", self.name), self.file))
            .collect()
    }

    /// The files that name what was added last.
    fn naming(&self) -> BTreeSet<String> {
        let kinds = ["rs", "md", "csv", "py", "js", "html"].into_iter();
        kinds
            .flat_map(|extension| files_below(repository(), extension))
            .filter(|path| (self.is_named_in)(&read(path)))
            .map(|path| {
                let name = path.strip_prefix(repository()).expect("it is below");
                name.display().to_string()
            })
            .filter(|name| !OF_ALL_ADDITIONS.contains(&name.as_str()))
            .collect()
    }
}

#[test]
fn a_recipe_has_every_file_that_the_last_addition_is_in() {
    for recipe in RECIPES {
        let (table, last) = recipe.rows;
        assert!(
            read(&repository().join(table)).contains(last),
            "{table}: compare the recipe with the row that is the last now"
        );
        let mut listed = recipe.listed();
        let missing = listed.iter().find(|path| !repository().join(path).exists());
        assert_eq!(missing, None);
        listed.retain(|path| !is_compressed(path));
        assert_eq!(listed, recipe.naming(), "{}", recipe.name);
    }
}

/// Where `Cargo.toml` says the sources are.
fn address_of_the_sources() -> String {
    let manifest = read(&repository().join("Cargo.toml"));
    let mut lines = manifest.lines();
    let address = lines.find_map(|line| line.strip_prefix("repository = \"")?.strip_suffix('"'));
    address.expect("an address").into()
}

#[test]
fn a_clone_and_releases_come_from_where_the_sources_are() {
    let (readme, address) = (read(&repository().join("README.md")), address_of_the_sources());
    let cloned = readme.lines().filter_map(|line| line.strip_prefix("git clone "));
    assert_eq!(cloned.collect::<Vec<_>>(), [&address]);
    let releases = links(&readme)
        .into_iter()
        .filter(|link| link.ends_with("/releases"));
    assert_eq!(releases.collect::<Vec<_>>(), [format!("{address}/releases")]);
}

/// The paths from the top of the repository that a document names.
fn named_paths(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| c.is_whitespace() || "`()[]|\"',;=".contains(c));
    words
        .filter(|word| TOP_FOLDERS.iter().any(|folder| word.starts_with(folder)))
        // Of `tests/host/endpoint.rs:12` the file; the end of a sentence is none of the path.
        .map(|word| word.split(':').next().unwrap_or(word).trim_end_matches('.'))
        // What stands for any file.
        .filter(|word| !word.contains(['<', '*', '…', '#']))
}

#[test]
fn every_path_that_is_named_exists() {
    let mut missing = Vec::new();
    let mut looked_at = 0;
    for (document, text) in documents() {
        for path in named_paths(&text).filter(|path| *path != NOT_OURS) {
            looked_at += 1;
            if !repository().join(path).exists() {
                missing.push(format!("{}: {path}", document.display()));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(looked_at > 0, "no path was found");
}

/// The blocks of code in a document that begin like this, each with the line above it.
fn code_blocks<'a>(text: &'a str, language: &str) -> Vec<(&'a str, &'a str)> {
    let fence = format!("\n```{language}\n");
    let mut blocks = Vec::new();
    let mut rest = text;
    while let Some((before, behind)) = rest.split_once(&fence) {
        let (block, after) = behind.split_once("\n```").expect("the end of the block");
        blocks.push((before.lines().last().unwrap_or_default(), block));
        rest = after;
    }
    blocks
}

/// What a line above a block says of it: `<!-- from src/bin/firmware/main.rs -->`.
fn marked<'a>(line: &'a str, word: &str) -> Option<&'a str> {
    let comment = line.strip_prefix("<!-- ")?.strip_suffix(" -->")?;
    comment.strip_prefix(word)
}

#[test]
fn code_in_a_document_is_code_that_is_compiled() {
    let mut looked_at = 0;
    for (document, text) in documents() {
        for (line, block) in code_blocks(&text, "rust") {
            let path = marked(line, "from ")
                .unwrap_or_else(|| panic!("{}: where is it from?\n{block}", document.display()));
            assert!(
                read(&repository().join(path)).contains(block),
                "{}: {path} does not have\n{block}",
                document.display()
            );
            looked_at += 1;
        }
    }
    assert!(looked_at > 0, "no block was found");
}

/// The pin of the Pico that each of its GPIOs is on, by the pinout of its data sheet; 0: on none.
const PICO_PINS: [u32; 29] = [
    1, 2, 4, 5, 6, 7, 9, 10, 11, 12, 14, 15, 16, 17, 19, 20, 21, 22, 24, 25, 26, 27, 29, 0, 0, 0, 31, 32, 34,
];

#[test]
fn the_picture_of_the_wiring_has_the_picos_pins() {
    let picture = read(&repository().join("docs/pictures/wiring.svg"));
    let mut looked_at = 0;
    for label in picture.split(">GP").skip(1) {
        let label = label.split('<').next().unwrap_or(label);
        let Some((gpio, rest)) = label.split_once(" (") else {
            continue;
        };
        let (pin, _) = rest.split_once(')').expect("a pin in brackets");
        let gpio: usize = gpio.parse().expect("a GPIO");
        assert_eq!(PICO_PINS[gpio].to_string(), pin, "GP{label}");
        looked_at += 1;
    }
    assert!(looked_at >= 10, "only {looked_at} labels were found");
}

#[test]
// Requirement: R-1
fn table_and_picture_of_the_wiring_have_the_vendors_poles() {
    let table = read(&repository().join("docs/hardware.md"));
    let picture = read(&repository().join("docs/pictures/wiring.svg"));
    for Motor {
        name,
        positive,
        negative,
    } in motors()
    {
        let row = table
            .lines()
            .find(|line| line.starts_with(&format!("| motor {name},")));
        let pins = format!("| {positive}, {negative} |");
        assert!(row.is_some_and(|row| row.contains(&pins)), "{name}: {row:?}");
        let (number, _) = name.split_once(' ').expect("a number and a place");
        let label = format!("{number} GP{positive}/{negative}");
        assert!(picture.contains(&label), "the picture lacks {label:?}");
    }
}

/// The row of a message in the table of those that are sent regularly.
fn row_of_stream(kind: StreamKind) -> String {
    let comes = match kind.default_rate() {
        DefaultRate::EverySecond => "every second",
        DefaultRate::Extra1(StreamGroup::ExtendedStatus) => {
            "at `SR0_EXTRA1`, or as requested of EXTENDED_STATUS"
        }
        DefaultRate::Extra1(StreamGroup::Extra3) => "at `SR0_EXTRA1`, or as requested of EXTRA3",
        DefaultRate::OnRequest => "on request",
        DefaultRate::OnChange => "on request, on change, and for a new ground station",
    };
    let of = match kind.subject() {
        Subject::Vehicle => "the vehicle",
        Subject::EachPack => "each pack",
        Subject::EachTank => "each tank",
        Subject::EachKnownResistance => "each pack whose resistance is known",
        Subject::EachKnownRestingVoltage => "each pack whose resting voltage is known",
        Subject::EachKnownDeviation => "each pack whose charge is estimated",
        Subject::EachKnownUsableCharge => "each pack whose usable charge is known",
    };
    format!("| {} ({}) | {comes} | {of} |", kind.name(), kind.message_id())
}

#[test]
fn the_table_of_streams_has_the_rows_of_the_source() {
    let page = read(&repository().join("docs/ground-stations.md"));
    let mut lines = page.lines();
    assert!(lines.any(|line| line == "| message | comes | of |"));
    let rows: Vec<_> = lines.skip(1).take_while(|line| line.starts_with('|')).collect();
    assert_eq!(rows, StreamKind::ALL.map(row_of_stream));
}

/// A text with every number in it as `#`, so that texts of different numbers are the same.
fn without_numbers(text: &str) -> String {
    let mut result = String::new();
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = number_length(rest);
        if length == 0 {
            result.push(first);
            rest = &rest[first.len_utf8()..];
        } else {
            result.push('#');
            rest = &rest[length..];
        }
    }
    result
}

/// How many bytes of a number the text begins with.
fn number_length(text: &str) -> usize {
    if text.starts_with('…') {
        return '…'.len_utf8();
    }
    match text.strip_prefix("0x") {
        Some(digits) => 2 + digits.bytes().take_while(u8::is_ascii_hexdigit).count(),
        None if text.starts_with(|c: char| c.is_ascii_digit()) => {
            let is_in_number = |byte: &u8| byte.is_ascii_digit() || *byte == b'.';
            text.bytes().take_while(is_in_number).count()
        }
        None => 0,
    }
}

const READ_ERRORS: [ReadError; 20] = [
    ReadError::Timeout,
    ReadError::Conversion,
    ReadError::NoPin,
    ReadError::NoCapacity,
    ReadError::NoScale,
    ReadError::NoHealthyMember,
    ReadError::LostMember,
    ReadError::GaugeTimeout,
    ReadError::Implausible,
    ReadError::OverRange,
    ReadError::Bus(BusError::NoAnswer),
    ReadError::Bus(BusError::Timeout),
    ReadError::Bus(BusError::Stuck),
    ReadError::Bus(BusError::Transfer),
    ReadError::Bus(BusError::Checksum),
    ReadError::OtherPart,
    ReadError::AddressTaken,
    ReadError::PinOfRadio,
    ReadError::PinTaken,
    ReadError::NotSetUp,
];

const WIFI_REPORTS: [WifiReport; 12] = [
    WifiReport::NoAnswer,
    WifiReport::DownloadFailed,
    WifiReport::AccessPointUp,
    WifiReport::Joined,
    WifiReport::AddressObtained([192, 168, 1, 23]),
    WifiReport::NetworkNotFound,
    WifiReport::WrongPassword,
    WifiReport::NoAddress,
    WifiReport::NetworkLost,
    WifiReport::FallbackToAccessPoint,
    WifiReport::OffAfterCrash,
    WifiReport::NoEntropy,
];

const CAN_REPORTS: [CanReport; 8] = [
    CanReport::ImpossibleBitRate,
    CanReport::NoAnswer,
    CanReport::Reconfigured,
    CanReport::Passive,
    CanReport::BusOff(3),
    CanReport::Working,
    CanReport::NoInterrupt,
    CanReport::FramesLost(12),
];

const FUEL_CELL_STATES: [FuelCellState; 8] = [
    FuelCellState::Off,
    FuelCellState::Starting,
    FuelCellState::Ready,
    FuelCellState::Running,
    FuelCellState::Stopping,
    FuelCellState::FallingAsleep,
    FuelCellState::Fault,
    FuelCellState::BatteryOnly,
];

const ARMING_FAILURES: [ArmingFailure; 21] = [
    ArmingFailure::AboveDrivers,
    ArmingFailure::Unhealthy,
    ArmingFailure::SumsASum,
    ArmingFailure::Failed,
    ArmingFailure::WrongCells,
    ArmingFailure::UnclearCells,
    ArmingFailure::ContradictedCharge,
    ArmingFailure::TooHot,
    ArmingFailure::ReportsUnhealthy,
    ArmingFailure::Emergency,
    ArmingFailure::BelowArmingVoltage,
    ArmingFailure::BelowArmingCapacity,
    ArmingFailure::LowVoltage,
    ArmingFailure::LowCapacity,
    ArmingFailure::CriticalVoltage,
    ArmingFailure::CriticalCapacity,
    ArmingFailure::NoCapacity,
    ArmingFailure::CapacityOrder,
    ArmingFailure::VoltageOrder,
    ArmingFailure::PercentageOrder,
    ArmingFailure::CurveOrder,
];

fn pack_events() -> Vec<PackEvent> {
    let failsafe = |level, consumed| PackEvent::Failsafe {
        level,
        voltage_v: Some(10.42),
        consumed: Some(consumed),
    };
    let gap = |counted_mah| {
        PackEvent::Gap(Gap {
            duration_s: 7.0,
            counted_mah,
        })
    };
    let mut events = vec![
        PackEvent::CellsDetected { count: 3 },
        PackEvent::CellsAmbiguous { voltage_v: 8.85 },
        PackEvent::Swapped,
        PackEvent::EstimateRestarted,
        PackEvent::CurrentReversed,
        PackEvent::ContactLost,
        PackEvent::ContactRestored,
        gap(Some(3.0)),
        gap(None),
        PackEvent::ReportedState {
            state: ChargeState::Failed,
            cause: Faults::empty(),
        },
        PackEvent::ReportedState {
            state: ChargeState::Unhealthy,
            cause: Faults::empty(),
        },
        PackEvent::SensorRecovered,
        PackEvent::PoweringOff,
        PackEvent::MembersLeft(0b10),
        failsafe(FailsafeLevel::Unhealthy, Amount::Mah(120.0)),
        failsafe(FailsafeLevel::Low, Amount::Mah(120.0)),
        failsafe(FailsafeLevel::Critical, Amount::Mah(120.0)),
        failsafe(FailsafeLevel::Low, Amount::Ml(120.0)),
        PackEvent::Charging,
        PackEvent::CurrentOverRange(CurrentRange::Over),
        PackEvent::CurrentOverRange(CurrentRange::OverAndCounted),
        PackEvent::Learnt {
            capacity_mah: 2995.0,
            resistance_ohm: 0.087,
        },
        PackEvent::PercentagesInert(MissingSetting::LowVoltage),
        PackEvent::CapacityAboveLabel(Some(CurrentScale::AmperesPerVolt)),
        PackEvent::CapacityAboveLabel(Some(CurrentScale::Shunt)),
        PackEvent::CapacityAboveLabel(None),
    ];
    for (remaining_pct, usable_pct) in [(Some(15.0), Some(15.0)), (Some(15.0), Some(9.0)), (None, None)] {
        let entered = |state| PackEvent::Charge {
            state,
            remaining_pct,
            usable_pct,
            voltage_v: Some(10.95),
        };
        events.extend([ChargeState::Low, ChargeState::Critical, ChargeState::Emergency].map(entered));
    }
    events.extend(
        [ChargeState::Low, ChargeState::Critical, ChargeState::Emergency].map(|state| {
            PackEvent::ReportedState {
                state,
                cause: Faults::empty(),
            }
        }),
    );
    // Some faults are found here, and some reported by packs only.
    let of_faults = [PackEvent::Faults, PackEvent::ReportedFaults].into_iter();
    let of_faults = of_faults.flat_map(|event| Faults::all().iter().map(event));
    // The others have no name.
    let has_name = |event: &PackEvent| PackNotice(Pack::First, event).to_string() != "Battery 1 ";
    events.extend(of_faults.filter(has_name));
    events.extend(READ_ERRORS.map(PackEvent::SensorFailed));
    events
}

fn supply_events() -> Vec<SupplyEvent> {
    vec![
        SupplyEvent::PowerLimited(Some(20)),
        SupplyEvent::PowerLimited(None),
        SupplyEvent::PowerUnknown,
        SupplyEvent::ActionTooLate(FailsafeLevel::Low),
        SupplyEvent::NotFound {
            address: Some(0x40),
            answering: [Some(0x41), Some(0x44), None, None, None],
        },
        SupplyEvent::Found {
            address: 0x0b,
            cells: Some(4),
        },
        SupplyEvent::Range {
            part: "INA226",
            current_a: 0.8,
        },
    ]
}

/// What the firmware says of packs, of arming and of the rover, without its numbers.
fn announced() -> Vec<String> {
    let packs = pack_events()
        .into_iter()
        .map(|event| PackNotice(Pack::First, &event).to_string());
    let supplies = supply_events()
        .into_iter()
        .map(|event| PackNotice(Pack::First, &event).to_string());
    let of_packs = ARMING_FAILURES.map(|failure| ArmingObstacle::Pack(Pack::First, failure));
    let misfits = [
        ArmingObstacle::SticksMisfit(StickParameter::RcmapThrottle, StickParameter::RcmapRoll),
        ArmingObstacle::SticksMisfit(StickParameter::Rc1Min, StickParameter::Rc1Trim),
    ];
    let of_parameters = [
        ParameterTrouble::NotRead,
        ParameterTrouble::Damaged,
        ParameterTrouble::HalfLoaded { missing: None },
        ParameterTrouble::HalfLoaded { missing: Some(12) },
        ParameterTrouble::DoesNotFit(BatteryParameter::Cells.of(Pack::First), None),
        ParameterTrouble::DoesNotFit(
            BatteryParameter::Cells.of(Pack::First),
            Some(BatteryParameter::Chem.of(Pack::First)),
        ),
    ];
    let of_parameters = of_parameters.map(ArmingObstacle::Parameters);
    let obstacles = of_packs.into_iter().chain(misfits).chain(of_parameters);
    let obstacles = obstacles.map(|obstacle| obstacle.text("PreArm").as_str().to_owned());
    let logging = [
        "PreArm: Logging failed",
        "Log full until disarmed",
        "Log not written: flash worn out?",
    ]
    .map(String::from);
    let rover = [
        VehicleEvent::NeedsPosition(FailsafeAction::Rtl),
        VehicleEvent::Terminated,
        VehicleEvent::ControlsTimedOut,
        VehicleEvent::GroundStationsTimedOut,
    ];
    let rover = rover.map(|event| event.to_string());
    let site = FaultSite {
        pc: 1,
        lr: 1,
        xpsr: 0,
        stack: [0; STACK_WORDS],
    };
    let causes = [CrashCause::Fault(site), CrashCause::Overdue, CrashCause::Hung];
    let crashes = causes.map(|cause| {
        let task = TaskName::new("drive");
        let firmware = None;
        headline(
            &CrashRecord {
                task,
                cause,
                firmware,
            },
            None,
        )
        .to_string()
    });
    let [crashed, running] = [1, 2].map(|word| Some(FirmwareHash::of([word])));
    let of_another_version = CrashRecord {
        task: TaskName::new("drive"),
        cause: CrashCause::Hung,
        firmware: crashed,
    };
    let of_another_version = headline(&of_another_version, running).to_string();
    let id = BatteryParameter::Cells.of(Pack::First);
    let why = Refused::OutOfRange;
    let not_saved = [FlashStore::Learnt, FlashStore::Wifi]
        .into_iter()
        .flat_map(|store| {
            [StorageError::NoErasedSpace, StorageError::Corrupt]
                .map(|error| Notice::NotSaved(store, error).to_string())
        });
    let all = packs
        .chain(supplies)
        .chain(obstacles)
        .chain(WIFI_REPORTS.map(|report| report.to_string()))
        .chain(CAN_REPORTS.map(|report| report.to_string()))
        .chain(FUEL_CELL_STATES.map(|state| state.to_string()))
        .chain(logging)
        .chain(not_saved)
        .chain(
            [
                Notice::ParameterRefused { id, why },
                Notice::BatteriesReset {
                    link: "UART0",
                    packs: PackSet::from_iter([Pack::First]),
                    percent: 100.0,
                },
                Notice::LogsErased { link: "UDP 1" },
                Notice::PowerWentOff,
                Notice::ResetWhileArmed,
            ]
            .map(|notice| notice.to_string()),
        )
        .chain(rover)
        .chain(crashes)
        .chain([of_another_version]);
    all.map(|text| without_numbers(&text)).collect()
}

/// The string literals of a folder's sources, tests aside.
fn string_literals(folder: &str, extension: &str, quote: char) -> Vec<String> {
    let mut literals = Vec::new();
    for path in files_below(&repository().join(folder), extension) {
        let source = read(&path);
        let source = source.split("#[cfg(test)]").next().unwrap_or(&source);
        let lines = source.lines().filter(|line| !line.trim_start().starts_with("//"));
        for line in lines {
            literals.extend(line.split(quote).skip(1).step_by(2).map(str::to_owned));
        }
    }
    literals
}

/// A format string with `#` for its arguments, numbers included.
fn with_gaps(literal: &str) -> String {
    let mut pieces = literal.split('{');
    let first = pieces.next().unwrap_or_default().to_string();
    let filled = pieces.fold(first, |text, piece| {
        let rest = piece.split_once('}').map_or("", |(_, rest)| rest);
        text + "#" + rest
    });
    without_numbers(&filled)
}

/// Whether `text` is `pattern` with anything but a space in place of each `#`.
fn matches(pattern: &str, text: &str) -> bool {
    let is_alike = |(pattern, text): (&str, &str)| match pattern.split_once('#') {
        Some((before, behind)) => text
            .strip_prefix(before)
            .is_some_and(|rest| rest.ends_with(behind)),
        None => pattern == text,
    };
    pattern.split(' ').count() == text.split(' ').count()
        && pattern.split(' ').zip(text.split(' ')).all(is_alike)
}

/// Below this a literal has too little fixed text to identify what it matches.
const LEAST_FIXED_BYTES: usize = 8;

/// The texts that the lists of the guide's part "By text" quote before the colon of each item, with what the line above
/// a list says that each of them begins with.
fn quoted() -> Vec<String> {
    let guide = read(&repository().join("docs/troubleshooting.md"));
    let (_, by_text) = guide.split_once("\n## By text\n").expect("the part");
    let mut quoted = Vec::new();
    let mut before = String::new();
    for line in by_text.lines() {
        if line.starts_with('#') {
            before.clear();
        } else if let Some(prefix) = line.strip_prefix("Each begins with `") {
            before = prefix.replace("`:", " ");
        } else if let Some(item) = line.strip_prefix("- ") {
            let (texts, _) = item.split_once("`: ").expect("a colon behind the texts");
            let texts = texts.split('`').skip(1).step_by(2);
            quoted.extend(texts.map(|text| format!("{before}{text}")));
        }
    }
    quoted
}

#[test]
fn every_text_the_guide_quotes_is_said_by_the_firmware_or_its_page() {
    let announced = announced();
    let literals = ["src", "crates"].map(|folder| string_literals(folder, "rs", '"'));
    let literals: Vec<_> = literals
        .iter()
        .flatten()
        .map(|literal| with_gaps(literal))
        .collect();
    let of_page = string_literals("web", "js", '\'');
    let is_said = |text: &String| {
        // The page appends to what ends so why.
        let is_of_page = |said: &String| said == text || (said.ends_with(": ") && text.starts_with(said));
        let text = without_numbers(text);
        announced.contains(&text)
            || of_page.iter().any(is_of_page)
            || literals
                .iter()
                .filter(|literal| literal.replace('#', "").len() >= LEAST_FIXED_BYTES)
                .any(|literal| matches(literal, &text))
    };
    let unsaid: Vec<_> = quoted().into_iter().filter(|text| !is_said(text)).collect();
    assert!(unsaid.is_empty(), "{unsaid:#?}");
}

#[test]
fn every_text_about_packs_arming_and_crashes_is_in_the_guide() {
    let quoted: Vec<_> = quoted().iter().map(|text| without_numbers(text)).collect();
    let missing: Vec<_> = announced()
        .into_iter()
        .filter(|text| !quoted.contains(text))
        .collect();
    assert!(missing.is_empty(), "{missing:#?}");
}

/// Words for which the field has better ones, such as report, announce, estimate, detect, owner and ground station.
const REFUSED: [&str; 7] = [
    "tell",
    "tells",
    "told",
    "nobody",
    "somebody",
    "whom",
    "for the sake of",
];

/// The folders in which refused words are looked for, with the extensions of the files there.
const CHECKED: [(&str, &[&str]); 7] = [
    ("docs", &["md", "param"]),
    ("src", &["rs"]),
    ("crates", &["rs", "md"]),
    ("tools", &["rs"]),
    ("tests", &["rs", "py", "md", "txt", "story"]),
    ("examples", &["rs", "py", "md"]),
    ("benches", &["rs", "md"]),
];

/// The files in which refused words are looked for, by their path from the top. This one has the list of them.
fn checked_files() -> Vec<String> {
    let pages = ["README.md", "CONTRIBUTING.md"].map(|page| repository().join(page));
    let in_folders = CHECKED.iter().flat_map(|(folder, extensions)| {
        let folder = repository().join(folder);
        extensions
            .iter()
            .flat_map(move |extension| files_below(&folder, extension))
    });
    // Scripts, most of them without an extension.
    let scripts = fs::read_dir(repository().join(".ci")).expect("the folder can be listed");
    let scripts = scripts.map(|entry| entry.expect("it can be listed").path());
    pages
        .into_iter()
        .chain(in_folders)
        .chain(scripts.filter(|path| path.is_file()))
        .map(|path| {
            let below = path.strip_prefix(repository()).expect("it is below");
            below.display().to_string()
        })
        .filter(|path| path != file!())
        .collect()
}

/// The refused words of a text, each behind the number of its line.
fn refused_in(text: &str) -> Vec<String> {
    let mut found = Vec::new();
    for (line, number) in text.lines().zip(1..) {
        // The words of the line with single spaces between and around them.
        let words: Vec<_> = line
            .split(|c: char| !c.is_alphanumeric())
            .filter(|word| !word.is_empty())
            .collect();
        let words = format!(" {} ", words.join(" ").to_lowercase());
        let refused = REFUSED
            .iter()
            .filter(|refused| words.contains(&format!(" {refused} ")));
        found.extend(refused.map(|refused| format!("{number}: {refused}")));
    }
    found
}

/// The pages that a text names from the top of the repository, with their anchors.
fn named_pages(text: &str) -> impl Iterator<Item = &str> {
    let words = text.split(|c: char| !c.is_alphanumeric() && !"/._-#".contains(c));
    words
        .map(|word| word.trim_start_matches("../").trim_end_matches('.'))
        .filter(|word| word.starts_with("docs/") && word.contains(".md"))
}

fn is_there(page: &str) -> bool {
    let (path, wanted) = page.split_once('#').unwrap_or((page, ""));
    let path = repository().join(path);
    path.is_file() && (wanted.is_empty() || has_anchor(&read(&path), wanted))
}

#[test]
fn every_page_that_sources_name_exists_with_its_anchor() {
    let mut missing = Vec::new();
    let mut looked_at = 0;
    for file in checked_files().into_iter().chain(["Cargo.toml".into()]) {
        for page in named_pages(&read(&repository().join(&file))) {
            looked_at += 1;
            if !is_there(page) {
                missing.push(format!("{file}: {page}"));
            }
        }
    }
    assert!(missing.is_empty(), "{missing:#?}");
    assert!(looked_at > 0, "no page was found");
}

#[test]
fn pages_sources_and_tests_have_no_refused_words() {
    let files = checked_files();
    assert!(files.len() > 300, "only {} files were found", files.len());
    let refused_in_file = |file: &String| {
        let refused = refused_in(&read(&repository().join(file)));
        refused
            .into_iter()
            .map(|refused| format!("{file}:{refused}"))
            .collect::<Vec<_>>()
    };
    let refused: Vec<_> = files.iter().flat_map(refused_in_file).collect();
    assert!(refused.is_empty(), "{refused:#?}");
}

#[test]
fn refused_words_are_found_in_any_case_but_not_within_others() {
    let text = "It is told.\nNobody!\nonly for the\tsake of it\na foretelling";
    assert_eq!(refused_in(text), ["1: told", "2: nobody", "3: for the sake of"]);
}
