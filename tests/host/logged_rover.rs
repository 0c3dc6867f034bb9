//! The autopilot on a desk with a log in its flash.

use embassy_futures::block_on;
use embedded_storage_async::nor_flash::{NorFlash, ReadNorFlash};
use nor_flash::FlashModel;
use rover_battmon::autopilot::LogStep;
use rover_battmon::mavlink::LinkKind;
use rover_battmon::recorder::Ring;
use rover_battmon::system::LogReader;
use support::desk::Desk;
use support::requests::{arm_by_force, disarm};
use support::time::SECOND;

pub type Flash = FlashModel<4096, 256, 16>;

/// A desk with a log, and its flash.
pub struct Rover {
    pub desk: Desk,
    pub flash: Flash,
}

impl Rover {
    /// A rover without packs after a start with this flash.
    pub fn starting(flash: Flash) -> Self {
        Self::with(Desk::without_packs(), flash)
    }

    /// What is on the desk after its start, with this flash.
    pub fn with(mut desk: Desk, mut flash: Flash) -> Self {
        desk.connect(LinkKind::Direct);
        let ring = block_on(Ring::scan(&mut flash, Flash::REGION));
        desk.autopilot.logs_found(ring);
        let mut rover = Self { desk, flash };
        rover.run(1);
        rover
    }

    pub fn new() -> Self {
        Self::starting(Flash::blank())
    }

    /// Drives, and writes the log.
    pub fn run(&mut self, seconds: u64) {
        for _ in 0..50 * seconds {
            self.turn();
        }
    }

    /// Drives for 20 ms, and writes the log.
    pub fn turn(&mut self) {
        self.desk.now_us += SECOND / 50;
        self.desk.drive();
        while let Some(step) = self.desk.autopilot.next_log_step(self.desk.now()) {
            self.obey(step);
        }
    }

    /// Does what the log needs, in flash that works.
    pub fn obey(&mut self, step: LogStep) {
        match step {
            LogStep::Program { address, bytes } => {
                block_on(self.flash.write(address, &bytes)).expect("it works");
                let now = self.desk.now();
                self.desk.autopilot.log_written(Ok(()), now);
            }
            LogStep::Erase(erasure) => {
                let from = erasure.address();
                block_on(self.flash.erase(from, from + 4096)).expect("it works");
                block_on(self.flash.write(erasure.mark_address(), &erasure.mark())).expect("it works");
                self.desk.autopilot.log_erased(erasure, Ok(()));
            }
        }
    }

    /// A drive of this long, in a file that goes on with the next one.
    pub fn drive(&mut self, seconds: u64) {
        self.desk.ask(&arm_by_force());
        self.run(seconds);
        self.desk.ask(&disarm());
    }

    /// The content of the chip, up to the end of the log.
    pub fn chip(&mut self) -> Vec<u8> {
        let mut chip = vec![0; Flash::REGION.end as usize];
        block_on(self.flash.read(0, &mut chip)).expect("it works");
        chip
    }

    /// The content of a file.
    pub fn file(&mut self, number: u16) -> Vec<u8> {
        let mut content = Vec::new();
        while let Some(piece) = self.desk.autopilot.locate_log(
            number,
            content.len() as u32,
            LogReader::Browser(0),
            self.desk.now(),
        ) {
            content.extend_from_slice(&self.chip()[piece.address as usize..][..piece.bytes as usize]);
        }
        content
    }
}
