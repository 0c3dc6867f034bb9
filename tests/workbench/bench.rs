//! A board on the bench, and what the tests ask of it.

use std::collections::BTreeMap;
use std::ops::{Deref, DerefMut, Range};
use std::sync::OnceLock;

use crate::log_flash::LogFlash;
use crate::starts::Start;
use rover_battmon::memory::flash_map;
use rover_battmon::pack::Pack;
use rover_battmon::parameter::{
    BatteryParameter, GroundStationParameter, StickParameter, THERMOMETER_COUNT, VehicleParameter,
};
use rover_battmon::sensor::AnalogPin;
use rover_battmon::vehicle::MotorDrive;
use rover_battmon_tools::sim::stepped::{Converter, conversions};

use crate::elf::{Artifact, build};
use emulator::{
    AdcFault, AdcInput, Board, CpuState, Firmware, FlashOperation, FlashOperationKind, LogLevel, ResetCause,
    ResetRecord, SentByte,
};
use support::commands::{ACCEPTED, PREFLIGHT_REBOOT_SHUTDOWN};
use support::frames::{Frame, PARAM_VALUE, ParamValue, acknowledged, frames, of_message};
use support::motor_poles::LEFT;
use support::parameter_flash;
use support::requests::{VEHICLE, param_request_list, reboot};
use support::signer::Signer;
pub use support::time::SECOND;
pub use support::vehicle::Wire;
pub use support::vehicle::{TestedVehicle, value_of};

/// DMA_IRQ_0, which signals the end of each frame at the telemetry port (RP2040 datasheet 2.3.2).
pub const DMA_IRQ: u32 = 11;

/// The pack's divider is on GP26.
pub const PACK: usize = 0;

/// Its current sensor's input is GP27.
pub const CURRENT: usize = 1;

/// FCS of the converter, which the firmware reads whenever it takes a reading.
const CONVERTER_STATUS: u32 = 0x4004_c008;

/// What the converter makes of 7.9 V there.
pub const DIVIDER_CODE: u16 = 2482;

pub const MINUTE: u64 = 60 * SECOND;
pub const MILLISECOND: u64 = 1_000;

pub const PARAMETER_OFFSET: u32 = flash_map::PARAMETERS.start;
pub const PARAMETER_BYTES: usize = bytes(flash_map::PARAMETERS);
pub const SIGNING_OFFSET: u32 = flash_map::SIGNING.start;
pub const LEARNT_OFFSET: u32 = flash_map::LEARNT.start;
pub const SECTOR_BYTES: usize = flash_map::SECTOR_BYTES as usize;

const fn bytes(range: Range<u32>) -> usize {
    (range.end - range.start) as usize
}

/// What is learnt of a pack is written whenever it rests, without anyone's request.
pub fn is_learnt(operation: &FlashOperation) -> bool {
    flash_map::LEARNT.contains(&operation.offset)
}

/// The number of operations of this kind.
pub fn count_of(kind: FlashOperationKind, operations: &[FlashOperation]) -> usize {
    let of_kind = operations.iter().filter(|operation| operation.kind == kind);
    of_kind.count()
}

/// The parameters of the vehicle, of its sticks and of its thermometers that are listed by default: ten more set up what is not in use then.
pub const LISTED_OF_VEHICLE: usize = VehicleParameter::COUNT - 10 + StickParameter::COUNT + THERMOMETER_COUNT;

/// The parameters that are listed of a pack with an analog sensor: two more are of other sensors, and five of a curve of its own.
pub const LISTED_OF_PACK: usize = BatteryParameter::COUNT - 2 - 5;

/// Those of the vehicle and of the first pack, the switches of the other packs, and the constants.
pub const LISTED_BY_DEFAULT: usize =
    LISTED_OF_VEHICLE + LISTED_OF_PACK + Pack::ALL.len() - 1 + GroundStationParameter::COUNT;

/// Long enough for everything that waits to be written to flash, erases included.
pub const SAVED_US: u64 = SECOND;

/// Where the firmware notes who runs: the watchdog's scratch register 0.
pub const RUNNING: u32 = 0x4005_800c;

/// Numbers of core registers.
pub const STACK_POINTER: usize = 13;
pub const LINK_REGISTER: usize = 14;
pub const PROGRAM_COUNTER: usize = 15;

/// Of the processor's clock, by which the emulator counts time.
pub const CYCLES_PER_US: u64 = 125;

/// The release firmware, built once per run, in a flash that has what every bench's parameters are, and is erased ahead of
/// the log: a new board erases a sector after the other in its first seconds.
fn firmware() -> &'static Firmware {
    static FIRMWARE: OnceLock<Firmware> = OnceLock::new();
    FIRMWARE.get_or_init(|| {
        let firmware = Firmware::load(build(Artifact::Binary("rover-battmon")));
        firmware
            .with_flash(flash_map::LOG.start, LogFlash::erased_ahead().bytes())
            .with_flash(PARAMETER_OFFSET, &parameter_flash::flash_with([]))
    })
}

/// The task that runs, by its id; `None` between tasks and in `main`.
pub fn running_task(board: &mut Board) -> Option<u32> {
    // The address of a task is larger than what is noted otherwise.
    const MAIN: u32 = 2;
    Some(board.read_register(RUNNING)).filter(|noted| *noted > MAIN)
}

/// The bytes with the time of each one's end in µs.
fn timed(sent: &[SentByte]) -> impl Iterator<Item = (u64, u8)> {
    sent.iter()
        .map(|SentByte { byte, end, .. }| (end / CYCLES_PER_US, *byte))
}

/// A powered board with the release firmware in its flash and a ground station at its telemetry port.
///
/// A copy goes on as the bench does. There is none while devices are attached to the board.
#[derive(Clone)]
pub struct Bench {
    board: Board,
    /// What decides the board's first second, unless something was done to it.
    start: Option<Start>,
    wire: Wire,
    sent: Vec<(u64, u8)>,
    /// Signs what is asked.
    signer: Option<Signer>,
}

impl Bench {
    /// Switches on with `code` at the pack's pin.
    pub fn power_up(code: u16) -> Self {
        Self::power_up_seeded(code, 1)
    }

    /// Switches on a board whose flash holds the release firmware and, at its end, `parameters`.
    pub fn power_up_with_parameters(code: u16, parameters: &[u8]) -> Self {
        Self::power_up_with_flash(code, PARAMETER_OFFSET, parameters)
    }

    /// Switches on a board whose flash holds the release firmware and other bytes at an offset.
    pub fn power_up_with_flash(code: u16, offset: u32, bytes: &[u8]) -> Self {
        Self::power_up_with_flash_seeded(code, offset, bytes, 1)
    }

    /// Switches on such a board, with the seed for whatever is left to chance.
    pub fn power_up_with_flash_seeded(code: u16, offset: u32, bytes: &[u8], seed: u64) -> Self {
        Self::with_firmware(code, firmware().with_flash(offset, bytes), seed)
    }

    /// Switches on a board whose flash holds the release firmware and, of a chip with this content, all that outlasts an update.
    pub fn power_up_updated(code: u16, chip: &[u8]) -> Self {
        let kept = [flash_map::WIFI, flash_map::LOG.start..flash_map::CHIP_BYTES];
        let firmware = kept.into_iter().fold(firmware().clone(), |firmware, range| {
            let content = &chip[range.start as usize..range.end as usize];
            firmware.with_flash(range.start, content)
        });
        Self::with_firmware(code, firmware, 1)
    }

    /// The seed decides what garbage is in RAM at power-up, and the noise at the converter.
    pub fn power_up_seeded(code: u16, seed: u64) -> Self {
        Self::with_firmware(code, firmware().clone(), seed)
    }

    /// Switches on a board with the firmware of an example.
    pub fn power_up_example(name: &'static str) -> Self {
        Self::with_firmware(0, Firmware::load(build(Artifact::Example(name))), 1)
    }

    fn with_firmware(code: u16, firmware: Firmware, seed: u64) -> Self {
        let mut board = Board::power_up(&firmware, seed);
        board.adc_input(PACK, AdcInput::Code(code));
        board.watch_reads(CONVERTER_STATUS);
        Self {
            board,
            start: Some(Start::PowerUp { firmware, code, seed }),
            wire: Wire::default(),
            sent: Vec::new(),
            signer: None,
        }
    }

    /// Switches on with `code` at the pack's pin, and waits until everything runs.
    pub fn running(code: u16) -> Self {
        let mut bench = Self::power_up(code);
        bench.run_for(SECOND);
        bench
    }

    /// A board with these parameters, set by a ground station and in effect after a restart.
    pub fn configured(code: u16, parameters: &[(&str, f32)]) -> Self {
        let named = parameters
            .iter()
            .map(|(name, value)| ((*name).to_owned(), *value));
        let start = Start::Configured(code, named.collect());
        start.shared(|| {
            let mut bench = Self::running(code);
            bench.set_all(parameters);
            bench.reboot();
            bench
        })
    }

    /// Lets time pass. The first second of a board to which nothing was done is shared with those that begin alike.
    pub fn run_for(&mut self, duration_us: u64) {
        let has_run = self.board.time_us() > 0;
        let start = self.start.take().filter(|_| !has_run && duration_us >= SECOND);
        let Some(start) = start else {
            return self.board.run_for(duration_us);
        };
        let begun = start.shared(|| {
            self.board.run_for(SECOND);
            self.clone()
        });
        self.board = begun.board;
        self.board.run_for(duration_us - SECOND);
    }

    /// When the firmware has taken readings of the converter since this was asked last, in µs: at each sampling tick.
    pub fn take_ticks(&mut self) -> Vec<u64> {
        let mut ticks: Vec<u64> = Vec::new();
        for read in self.take_reads() {
            let read_us = read / CYCLES_PER_US;
            // It looks several times.
            if ticks.last().is_none_or(|tick_us| read_us - tick_us > MILLISECOND) {
                ticks.push(read_us);
            }
        }
        ticks
    }

    /// Waits until a task runs, on its own and not in an interrupt. The next is drive, unless something else is due.
    pub fn run_into_task(&mut self) {
        let is_in_a_task = |board: &mut Board| {
            board.cpu_state() == CpuState::Running
                && board.active_exception() == 0
                && running_task(board).is_some()
        };
        assert!(self.run_until(SECOND, is_in_a_task));
    }

    /// Makes the task that runs next panic.
    pub fn panic(&mut self) {
        self.run_into_task();
        // Its bit 0 stands for Thumb.
        let entry = self.symbol("_defmt_panic") & !1;
        self.set_register(PROGRAM_COUNTER, entry);
    }

    /// Does what makes the board restart within this time, and returns how it did.
    #[track_caller]
    pub fn reset_by(&mut self, within_us: u64, act: impl FnOnce(&mut Self)) -> ResetRecord {
        let resets = self.resets().len();
        act(self);
        let is_reset = self.run_until(within_us, |board| board.resets().len() > resets);
        assert!(is_reset, "no reset within {within_us} us");
        self.resets()[resets]
    }

    /// A host is plugged in, and a program opens the port.
    pub fn plug_usb(&mut self) {
        self.usb().plug();
        self.usb().open();
        let opened = self.run_until(2 * SECOND, |board| board.usb().is_open());
        assert!(opened, "{:?}", self.usb().take_events());
    }

    fn take_sent(&mut self) -> Vec<SentByte> {
        match self.wire {
            Wire::Uart => self.board.uart(0).take_sent(),
            Wire::Usb => self.board.usb().take_received(),
        }
    }

    /// Signs all requests from now on, with timestamps that follow the board's.
    pub fn sign_with(&mut self, signer: Signer) {
        self.signer = Some(signer);
    }

    fn sign(&mut self, request: &[u8]) -> Vec<u8> {
        let Some(mut signer) = self.signer.take() else {
            return request.to_vec();
        };
        signer.hear(&self.frames());
        let signed = signer.sign(request);
        self.signer = Some(signer);
        signed
    }

    /// Everything that has left the port since power-up, with the time of each byte's end in µs.
    pub fn sent(&mut self) -> &[(u64, u8)] {
        let new = self.take_sent();
        self.sent.extend(timed(&new));
        &self.sent
    }

    /// The frames that have left the UART since this was asked last, whatever wire the ground station uses.
    pub fn uart_frames(&mut self) -> Vec<Frame> {
        let sent: Vec<_> = timed(&self.board.uart(0).take_sent()).collect();
        frames(&sent)
    }

    /// Forgets what was sent up to now: what a reset has cut off is not a frame.
    pub fn forget_sent(&mut self) {
        self.sent();
        self.sent.clear();
    }

    /// The frames among it.
    pub fn frames(&mut self) -> Vec<Frame> {
        frames(self.sent())
    }

    /// Waits until nothing is being sent: what is sent next begins a frame.
    pub fn run_until_silent(&mut self) {
        let mut before = usize::MAX;
        while self.sent().len() != before {
            before = self.sent().len();
            self.board.run_for(MILLISECOND);
        }
    }

    /// The frames among what was sent after the first `position` bytes, which end with a frame.
    pub fn frames_from(&mut self, position: usize) -> Vec<Frame> {
        frames(&self.sent()[position..])
    }

    /// All parameters, by the board's list, at 115200 baud or faster. Panics if it takes longer than twice its time.
    pub fn list(&mut self) -> BTreeMap<String, f32> {
        // Often, so that nothing else happens once it is complete.
        const STEP_US: u64 = 100 * MILLISECOND;
        // A list has 30 % of 11520 bytes a second; a PARAM_VALUE has at most 37 of them.
        const MOST_US_FOR_EACH: u64 = 2 * SECOND * 37 / 3456;
        self.run_until_silent();
        let (position, from_us) = (self.sent().len(), self.time_us());
        self.request(&param_request_list(VEHICLE));
        loop {
            self.run_for(STEP_US);
            let frames = self.frames_from(position);
            let values: Vec<_> = of_message(&frames, PARAM_VALUE)
                .into_iter()
                .map(ParamValue)
                .collect();
            let first = values.first();
            let count = first.map_or(LISTED_BY_DEFAULT, |value| usize::from(value.count()));
            if values.len() >= count {
                return values.iter().map(|value| (value.name(), value.value())).collect();
            }
            let took_us = self.time_us() - from_us;
            let is_in_time = took_us < MOST_US_FOR_EACH * count as u64;
            assert!(is_in_time, "{} of {count} after {took_us} us", values.len());
        }
    }

    /// The log lines of at least `level` that contain `text`.
    pub fn logged(&self, level: LogLevel, text: &str) -> Vec<(u64, String)> {
        let lines = self.board.log_lines().iter();
        lines
            .filter(|line| line.level >= level && line.text.contains(text))
            .map(|line| (line.time_us, line.text.clone()))
            .collect()
    }

    /// Panics if anything happened that a sound firmware on a sound board does not see.
    pub fn assert_untroubled(&self) {
        let (resets, bus_errors) = (self.resets(), self.bus_errors());
        assert!(resets.is_empty(), "resets: {resets:?}");
        assert!(bus_errors.is_empty(), "bus errors: {bus_errors:?}");
        let warnings = self.logged(LogLevel::Warn, "");
        assert!(warnings.is_empty(), "warnings: {warnings:?}");
    }
}

impl Deref for Bench {
    type Target = Board;

    fn deref(&self) -> &Board {
        &self.board
    }
}

impl DerefMut for Bench {
    fn deref_mut(&mut self) -> &mut Board {
        self.start = None;
        &mut self.board
    }
}

impl TestedVehicle for Bench {
    fn power_up() -> Self {
        Self::power_up(0)
    }

    fn power_cycle(&mut self) {
        self.run_until_silent();
        self.board.power_cycle();
    }

    fn time_us(&self) -> u64 {
        self.board.time_us()
    }

    fn run_for(&mut self, duration_us: u64) {
        self.run_for(duration_us);
    }

    fn set_pin_v(&mut self, pin: AnalogPin, pin_v: f32) {
        let channel = AnalogPin::ALL.iter().position(|each| *each == pin);
        let code = conversions(pin_v).mean().0 as u16;
        self.adc_input(channel.expect("one of all"), AdcInput::Code(code));
    }

    fn set_converter(&mut self, converter: Converter) {
        self.adc_fault(match converter {
            Converter::Working => AdcFault::None,
            Converter::Stalled => AdcFault::Stalled,
        });
    }

    fn use_wire(&mut self, wire: Wire) {
        self.forget_sent();
        self.wire = wire;
        if wire == Wire::Usb {
            self.plug_usb();
        }
    }

    fn send(&mut self, bytes: &[u8]) {
        match self.wire {
            Wire::Uart => {
                let now_us = self.time_us();
                self.board.uart_send(0, now_us, bytes);
            }
            Wire::Usb => self.board.usb().send(bytes),
        }
    }

    /// Signed, if requests are.
    fn request(&mut self, request: &[u8]) {
        let request = self.sign(request);
        self.send(&request);
    }

    fn sent(&mut self) -> Vec<(u64, u8)> {
        self.sent().to_vec()
    }

    fn reboot(&mut self) {
        let reset = self.reset_by(4 * SECOND, |bench| {
            let answers = bench.ask(&reboot());
            assert_eq!(acknowledged(&answers)[0], (PREFLIGHT_REBOOT_SHUTDOWN, ACCEPTED));
        });
        assert_eq!(reset.cause, ResetCause::WatchdogForce);
        self.run_for(SECOND);
        assert!(!self.logged(LogLevel::Info, "started by Software").is_empty());
    }

    fn left_drive(&self) -> MotorDrive {
        let duty = |pin| {
            self.board
                .pwm_output(pin)
                .map_or(0.0, |output| output.duty as f32)
        };
        match (duty(LEFT[0].positive), duty(LEFT[0].negative)) {
            (0.0, 0.0) => MotorDrive::Coast,
            (1.0, 1.0) => MotorDrive::Brake,
            (ahead, back) => MotorDrive::Turn(ahead - back),
        }
    }

    fn restarts(&self) -> usize {
        self.board.resets().len()
    }

    fn configured(parameters: &[(&str, f32)]) -> Self {
        Self::configured(0, parameters)
    }
}
