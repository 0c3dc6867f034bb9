//! The board's network, and phones around it.

use std::cell::RefCell;

use embassy_futures::select::{Either, select};
use embassy_time::{Duration, Timer};
use rover_battmon::autopilot::Start;
use rover_battmon::net::{NetMemory, NetReport, RetainedLeases, Role, Service, serve};
use rover_battmon::recorder::{LogSource, ReadFailed};
use rover_battmon::tasks::{CheckIn, Shared};
use rover_battmon_tools::sim::clock::run_for;

use super::air::{Air, BoardDevice, SharedAir};
use super::phone::Phone;

/// There are no logs.
pub struct NoLogs;

impl LogSource for NoLogs {
    fn read_log(&self, _: u32, _: &mut [u8]) -> Result<(), ReadFailed> {
        Err(ReadFailed)
    }
}

/// Where a test plays.
pub struct Room<'a> {
    pub air: SharedAir,
    pub reports: &'a RefCell<Vec<NetReport>>,
}

impl Room<'_> {
    /// A phone that has joined the board's access point: who has no address from the board is not heard there.
    pub async fn phone(&self, number: u8) -> Phone {
        let mut phone = Phone::without_address(&self.air, number);
        let asked = phone.ask_for_address();
        while phone.take_address(asked).is_none() {
            self.pass(1, &mut [&mut phone]).await;
        }
        phone
    }

    /// Lets time pass.
    pub async fn pass(&self, ms: u64, phones: &mut [&mut Phone]) {
        for _ in 0..ms {
            for phone in &mut *phones {
                phone.poll();
            }
            Timer::after_millis(1).await;
        }
    }
}

/// Plays `scene` while the board serves its network, after power-up.
pub fn play<R>(role: Role, scene: impl AsyncFnOnce(&Room<'_>) -> R) -> R {
    play_with(Box::leak(Box::default()), role, scene)
}

/// The same, with what RAM holds at the board's start.
pub fn play_with<R>(
    retained: &'static RetainedLeases,
    role: Role,
    scene: impl AsyncFnOnce(&Room<'_>) -> R,
) -> R {
    static CHECK_IN: CheckIn = CheckIn::new("network", 2_500);
    let ended = run_for(Duration::from_secs(3_600), async {
        let shared = Shared::new(&Start::default());
        let reports = RefCell::default();
        let room = Room {
            air: Air::new(role == Role::Station),
            reports: &reports,
        };
        let service = Service {
            shared: &shared,
            logs: &NoLogs,
            check_in: &CHECK_IN,
        };
        let mut memory = Box::new(NetMemory::new(retained));
        let board = serve(
            BoardDevice(room.air.clone()),
            role,
            1,
            &mut memory,
            &service,
            |report| reports.borrow_mut().push(report),
        );
        match select(board, scene(&room)).await {
            Either::First(never) => never,
            Either::Second(result) => result,
        }
    });
    ended.expect("it ends within the hour")
}
