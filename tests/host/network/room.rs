//! The board's network, and phones around it.

use std::cell::RefCell;

use embassy_futures::select::{Either, select};
use embassy_time::{Duration, Timer};
use rover_battmon::autopilot::Start;
use rover_battmon::net::{NetMemory, NetReport, Role, Service, serve};
use rover_battmon::tasks::{CheckIn, Shared};
use rover_battmon_tools::sim::clock::run_for;

use super::air::{Air, BoardDevice, SharedAir};
use super::phone::Phone;
use crate::web::Chip;

/// The place of a test: the board, its network and the phones in reach.
pub struct Room<'a> {
    pub air: SharedAir,
    pub reports: &'a RefCell<Vec<NetReport>>,
}

impl Room<'_> {
    /// A phone that has joined the board's access point: who has no address from the board is not heard there.
    pub async fn phone(&self, number: u8) -> Phone {
        let mut phone = Phone::without_address(&self.air, number);
        let asked = phone.ask_for_address();
        while !phone.take_address(asked) {
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
            logs: &Chip(Vec::new()),
            check_in: &CHECK_IN,
        };
        let mut memory = Box::new(NetMemory::new(Box::leak(Box::default())));
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
