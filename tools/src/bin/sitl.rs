//! The simulator: the firmware's tasks on the host. Wiring, nothing else.

use std::cell::RefCell;
use std::io;
use std::net::{IpAddr, Ipv4Addr, SocketAddr, ToSocketAddrs};
use std::path::{Path, PathBuf};
use std::pin::Pin;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use clap::Parser;
use embassy_executor::Executor;
use embassy_time::{Duration, Ticker, Timer};
use rover_battmon::parameter::ParameterId;
use rover_battmon_tools::sim::{
    self, Clients, Fleet, LogFolder, MAX_ROVERS, Role, Scenario, Setup, SimulatedFlash, UdpWire, clock,
    console,
};

const EXAMPLES: &str = "\
Examples (`cargo run --` instead of the name in a clone):
  rover-battmon-sitl                             the rover with a full pack, for a ground station
  rover-battmon-sitl --pack 2s-18650             the same with the kit's pack, set up by its file
  rover-battmon-sitl --scenario drain            see the pack run empty and the rover stop, in a minute
  rover-battmon-sitl --scenario swap --for 70    the same with a swapped pack, then end
  rover-battmon-sitl --speedup 20 --log logs     an hour in three minutes, with log files
  rover-battmon-sitl --flash rover.bin           keep what is set and learnt for the next run
  rover-battmon-sitl --tcp localhost:5761 --udp localhost:14551    beside another simulator
  rover-battmon-sitl --rovers 20 --log logs      twenty rovers for one ground station

On a terminal the last line is updated in place; `2> log.txt` takes the log, NO_COLOR=1 the colours.";

/// Simulates a rover with a battery pack, four motors and the board's own firmware: try ground stations, parameters and
/// failsafes without hardware.
#[derive(Parser)]
#[command(name = "rover-battmon-sitl", version, after_help = EXAMPLES)]
struct Arguments {
    /// Where ground stations connect by TCP
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:5760", value_parser = address)]
    tcp: SocketAddr,

    /// Where a ground station listens by UDP
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:14550", value_parser = address)]
    udp: SocketAddr,

    /// Where a browser finds the rover's page, or off [default: 127.0.0.1:8080]
    #[arg(long, value_name = "HOST:PORT", value_parser = web)]
    web: Option<Web>,

    /// Play what happens to a rover: drain, swap, cold or loose-wire. Nothing that it sets is kept
    #[arg(long, value_name = "NAME", value_parser = scenario, conflicts_with = "flash")]
    scenario: Option<&'static Scenario>,

    /// Simulate the full pack of docs/params/NAME.param instead of a 3S LiPo, and start with the parameters in it; alone, or
    /// to drain it
    #[arg(long, value_name = "NAME", value_parser = pack, conflicts_with = "rovers")]
    pack: Option<&'static [(ParameterId, f32)]>,

    /// Simulate this many rovers, with packs and system ids of their own. All send by UDP; TCP and page are the first
    /// one's
    #[arg(long, value_name = "COUNT", value_parser = rovers, conflicts_with_all = ["flash", "scenario"])]
    rovers: Option<u8>,

    /// Let simulated time pass this many times as fast; by default 1, or what lets a scenario take a minute
    #[arg(long, value_name = "FACTOR", value_parser = speedup)]
    speedup: Option<f64>,

    /// End after this many seconds of simulated time
    #[arg(long = "for", value_name = "SECONDS")]
    run_for_s: Option<u32>,

    /// Keep parameters, key and what is learnt of packs in this file, as the board does in its flash
    #[arg(long, value_name = "FILE")]
    flash: Option<PathBuf>,

    /// Copy the logs of this run into this folder, once a second; of several rovers into rover-01 and so on in it
    #[arg(long, value_name = "DIR")]
    log: Option<PathBuf>,
}

/// An address or a name, and a port. Of several addresses the first of IPv4, as ground stations try those.
fn address(text: &str) -> Result<SocketAddr, String> {
    let has_port = text
        .rsplit_once(':')
        .is_some_and(|(_, port)| port.parse::<u16>().is_ok());
    if !has_port {
        return Err("a host and a port are needed, as in localhost:5761".into());
    }
    let found: Vec<_> = text
        .to_socket_addrs()
        .map_err(|error| error.to_string())?
        .collect();
    let preferred = found.iter().find(|address| address.is_ipv4()).or(found.first());
    preferred.copied().ok_or_else(|| "the host has no address".into())
}

/// Where browsers connect.
#[derive(Clone, Copy)]
enum Web {
    Off,
    At(SocketAddr),
}

fn web(text: &str) -> Result<Web, String> {
    match text {
        "off" => Ok(Web::Off),
        _ => address(text).map(Web::At),
    }
}

/// Where browsers connect unless it is said: if the port is taken, they do not.
const DEFAULT_WEB: SocketAddr = SocketAddr::new(IpAddr::V4(Ipv4Addr::LOCALHOST), 8080);

/// Listens for browsers.
fn listen_for_browsers(asked: Option<Web>) -> Result<Option<Clients>, String> {
    let address = match asked {
        Some(Web::Off) => return Ok(None),
        Some(Web::At(address)) => address,
        None => DEFAULT_WEB,
    };
    match (Clients::listen(address), asked) {
        (Ok(browsers), _) => Ok(Some(browsers)),
        (Err(error), Some(_)) => Err(format!("Can't serve the page on {address}: {error}.")),
        (Err(error), None) => {
            console::print_error(format_args!(
                "No page on {address}: {error}. --web HOST:PORT takes another port."
            ));
            Ok(None)
        }
    }
}

fn scenario(name: &str) -> Result<&'static Scenario, String> {
    Scenario::named(name).ok_or_else(|| {
        let names = Scenario::ALL.map(|scenario| scenario.name);
        format!("there are {}", names.join(", "))
    })
}

fn pack(name: &str) -> Result<&'static [(ParameterId, f32)], String> {
    sim::ready_pack(name).map(|parameters| &**forever(parameters))
}

fn rovers(text: &str) -> Result<u8, String> {
    match text.parse() {
        Ok(count) if (1..=MAX_ROVERS).contains(&usize::from(count)) => Ok(count),
        _ => Err(format!(
            "a number from 1 to {MAX_ROVERS} is needed: ground stations have the system ids above"
        )),
    }
}

fn speedup(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(factor) if (0.01..=1000.0).contains(&factor) => Ok(factor),
        _ => Err("a number from 0.01 to 1000 is needed".into()),
    }
}

impl Arguments {
    fn speedup(&self) -> f64 {
        let of_scenario = self.scenario.map_or(1.0, |scenario| scenario.speedup);
        self.speedup.unwrap_or(of_scenario)
    }

    /// Simulated time between two status lines.
    fn line_interval(&self) -> Duration {
        Duration::from_micros((self.speedup() * 1e6) as u64)
    }

    /// Prints where ground stations find the rovers, and what is simulated.
    fn greet(&self, listeners: &Listeners) {
        // The port 0 stands for one that the system chooses.
        let tcp = listeners.clients.address().unwrap_or(self.tcp);
        console::print_plain(format_args!(
            "MAVLink on tcp:{tcp} and to udp:{}. Ctrl-C ends it.",
            self.udp
        ));
        let browsers = listeners.browsers.as_ref();
        if let Some(address) = browsers.and_then(|browsers| browsers.address().ok()) {
            console::print_plain(format_args!("The rover's page: http://{address}/"));
        }
        if let Some(count) = self.rovers {
            console::print_plain(format_args!(
                "{count} rovers, by UDP: system ids 1 to {count}. By TCP and on the page: 1."
            ));
        }
        if let Some(scenario) = self.scenario {
            console::print_plain(format_args!("Scenario {scenario} {}", pace(self.speedup())));
        }
    }

    /// How another simulator can run beside the one that has these ports.
    fn next_ports(&self) -> String {
        let next = |mut address: SocketAddr| {
            address.set_port(address.port().saturating_add(1));
            address
        };
        format!("--tcp {} --udp {}", next(self.tcp), next(self.udp))
    }
}

/// Whether the simulator has to end.
static STOP: AtomicBool = AtomicBool::new(false);

/// Rovers that have not ended.
static RUNNING: AtomicUsize = AtomicUsize::new(0);

/// A rover: boxed, or there would be room for as many as there may be.
#[embassy_executor::task(pool_size = MAX_ROVERS)]
async fn simulator(rover: Pin<Box<dyn Future<Output = ()>>>) {
    rover.await;
    if RUNNING.fetch_sub(1, Ordering::Relaxed) == 1 {
        STOP.store(true, Ordering::Relaxed);
    }
}

#[embassy_executor::task]
async fn show_fleet(fleet: &'static Fleet, interval: Duration) {
    fleet.print(interval).await;
}

#[embassy_executor::task]
async fn end_after(time: Duration) {
    Timer::after(time).await;
    STOP.store(true, Ordering::Relaxed);
}

/// The folder for the logs of the rover in this role.
fn open_log_folder(path: &Path, role: Role<'_>, flash: &SimulatedFlash) -> Result<LogFolder, String> {
    let path = match role {
        Role::Alone(..) => path.to_owned(),
        Role::Member(_, number) => path.join(format!("rover-{number:02}")),
    };
    LogFolder::open(path, flash.clone()).map_err(|error| format!("Can't use the log folder: {error}."))
}

#[embassy_executor::task]
async fn log_copier(folders: &'static RefCell<Vec<LogFolder>>, interval: Duration) {
    let mut copies = Ticker::every(interval);
    let mut had_failed = false;
    loop {
        let copied = copy_logs(folders);
        if let Err(error) = &copied
            && !had_failed
        {
            console::print_error(format_args!("Can't copy the log: {error}. It is tried again."));
        }
        had_failed = copied.is_err();
        copies.next().await;
    }
}

/// Copies what is new of each rover's log.
///
/// # Errors
/// The first failure.
fn copy_logs(folders: &RefCell<Vec<LogFolder>>) -> io::Result<()> {
    let mut folders = folders.borrow_mut();
    let failures = folders.iter_mut().map(LogFolder::update).filter_map(Result::err);
    failures.reduce(|first, _| first).map_or(Ok(()), Err)
}

fn pace(speedup: f64) -> String {
    match speedup {
        1.0 => "In real time.".into(),
        _ => format!("{speedup} times as fast."),
    }
}

fn main() -> ExitCode {
    match simulate(Arguments::parse()) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            console::print_error(format_args!("{error}"));
            ExitCode::FAILURE
        }
    }
}

/// For the rest of the program, as tasks have it.
fn forever<T>(value: T) -> &'static T {
    Box::leak(Box::new(value))
}

/// What each rover is among others, and the fleet, if there is one.
fn roles(arguments: &Arguments) -> (Vec<Role<'static>>, Option<&'static Fleet>) {
    if arguments.rovers.is_some() {
        // The log does not say which rover it is of.
        console::print_only_warnings();
    }
    let output = console::use_terminal();
    let Some(count) = arguments.rovers else {
        return (
            vec![Role::Alone(output, arguments.pack.unwrap_or_default())],
            None,
        );
    };
    let fleet: &Fleet = forever(Fleet::of(count));
    (fleet.roles().collect(), Some(fleet))
}

/// Where ground stations connect by TCP, and browsers.
struct Listeners {
    clients: Clients,
    browsers: Option<Clients>,
}

fn listen(arguments: &Arguments) -> Result<Listeners, String> {
    let clients = Clients::listen(arguments.tcp).map_err(|error| {
        format!(
            "Can't listen on {}: {error}.\nIs another simulator running? {} takes other ports.",
            arguments.tcp,
            arguments.next_ports()
        )
    })?;
    let browsers = listen_for_browsers(arguments.web)?;
    Ok(Listeners { clients, browsers })
}

/// A rover that ground stations reach by UDP only.
fn rover(arguments: &Arguments, role: Role<'static>) -> Result<Setup<'static>, String> {
    let udp =
        UdpWire::to(arguments.udp).map_err(|error| format!("Can't send to {}: {error}.", arguments.udp))?;
    let flash_file = arguments.flash.clone().unwrap_or_default();
    let flash = SimulatedFlash::open(arguments.flash.clone())
        .map_err(|error| format!("Can't use the flash file {}: {error}.", flash_file.display()))?;
    Ok(Setup {
        role,
        clients: None,
        udp: forever(udp),
        web: None,
        flash,
        scenario: arguments.scenario,
        status_interval: arguments.line_interval(),
    })
}

/// Runs the simulator until it is stopped, or says why it can't.
fn simulate(arguments: Arguments) -> Result<(), String> {
    if let (Some(scenario), Some(_)) = (arguments.scenario, arguments.pack)
        && !scenario.takes_any_pack
    {
        return Err(format!(
            "The scenario {} has a pack of its own: no --pack.",
            scenario.name
        ));
    }
    let listeners: &Listeners = forever(listen(&arguments)?);
    let (roles, fleet) = roles(&arguments);
    let rovers = roles.iter().map(|role| rover(&arguments, *role));
    let mut rovers = rovers.collect::<Result<Vec<_>, _>>()?;
    if let Some(first) = rovers.first_mut() {
        first.clients = Some(&listeners.clients);
        first.web = listeners.browsers.as_ref();
    }
    let log_folders = arguments.log.iter().flat_map(|path| {
        rovers
            .iter()
            .map(|rover| open_log_folder(path, rover.role, &rover.flash))
    });
    let log_folders: &RefCell<_> = forever(RefCell::new(log_folders.collect::<Result<Vec<_>, _>>()?));
    if let Err(error) = ctrlc::set_handler(|| STOP.store(true, Ordering::Relaxed)) {
        console::print_error(format_args!("Ctrl-C will end the simulator at once: {error}."));
    }
    if clock::set_speedup(arguments.speedup()).is_err() {
        console::print_error(format_args!("The clock already runs, at real time."));
    }
    arguments.greet(listeners);
    RUNNING.store(rovers.len(), Ordering::Relaxed);
    Box::leak(Box::new(Executor::new())).run_until(
        |spawner| {
            for rover in rovers {
                let rover = Box::pin(sim::run(rover));
                spawner.spawn(simulator(rover).expect("there are not too many"));
            }
            if let Some(fleet) = fleet {
                let shown = show_fleet(fleet, arguments.line_interval());
                spawner.spawn(shown.expect("it is spawned once"));
            }
            if arguments.log.is_some() {
                let copier = log_copier(log_folders, arguments.line_interval());
                spawner.spawn(copier.expect("it is spawned once"));
            }
            if let Some(run_for_s) = arguments.run_for_s {
                let time = Duration::from_secs(run_for_s.into());
                spawner.spawn(end_after(time).expect("it is spawned once"));
            }
        },
        || STOP.load(Ordering::Relaxed) || console::is_closed(),
    );
    console::end();
    // What was written since the last copy.
    let copied = copy_logs(log_folders);
    console::print_plain(format_args!("Stopped."));
    copied.map_err(|error| format!("The logs are incomplete: {error}."))
}

#[cfg(target_os = "none")]
compile_error!("The simulator runs on a host. For the board build `--bin rover-battmon`.");
